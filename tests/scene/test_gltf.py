"""The glTF reader: every asset, figures of an independent reader, and each feature on a file made for it."""

from __future__ import annotations

import base64
import json
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rendergraph.errors import InputError
from rendergraph.images import write
from rendergraph.scene.load import load
from rendergraph.scene.model import Scene, SceneLimits

TRIANGLE = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], np.float32)


def gltf(**parts: Any) -> dict[str, Any]:
    """A file of one triangle; parts replace or add."""
    data = TRIANGLE.tobytes() + np.array([0, 1, 2], np.uint16).tobytes()
    top: dict[str, Any] = {
        "asset": {"version": "2.0"},
        "buffers": [{"byteLength": len(data), "uri": uri(data)}],
        "bufferViews": [
            {"buffer": 0, "byteLength": 36},
            {"buffer": 0, "byteOffset": 36, "byteLength": 6},
        ],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "type": "VEC3", "count": 3, "min": [0, 0, 0], "max": [1, 1, 0]},
            {"bufferView": 1, "componentType": 5123, "type": "SCALAR", "count": 3},
        ],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "nodes": [{"mesh": 0, "name": "Tri"}],
        "scenes": [{"nodes": [0]}],
        "scene": 0,
    }
    return {**top, **parts}


def uri(data: bytes) -> str:
    return "data:application/octet-stream;base64," + base64.b64encode(data).decode()


def read(tmp_path: Path, top: dict[str, Any] | str) -> Scene:
    path = tmp_path / "a.gltf"
    path.write_text(top if isinstance(top, str) else json.dumps(top))
    return load(path)


def with_arrays(*arrays: tuple[np.ndarray, str, int, dict[str, Any]], **parts: Any) -> dict[str, Any]:
    """A file whose accessors are arrays with their type, component type and further properties."""
    data, views, accessors = b"", [], []
    for array, kind, component, more in arrays:
        data += b"\0" * (-len(data) % 4)
        views.append({"buffer": 0, "byteOffset": len(data), "byteLength": array.nbytes})
        accessors.append(
            {"bufferView": len(views) - 1, "componentType": component, "type": kind, "count": len(array), **more}
        )
        data += array.tobytes()
    return gltf(buffers=[{"byteLength": len(data), "uri": uri(data)}], bufferViews=views, accessors=accessors, **parts)


ASSETS = [
    "AlphaBlendModeTest.glb",
    "AnisotropyStrengthTest.glb",
    "Box/Box.gltf",
    "BoxInterleaved.glb",
    "BoxTextured.glb",
    "BoxVertexColors.glb",
    "Cameras/Cameras.gltf",
    "DamagedHelmet.glb",
    "EmissiveStrengthTest.glb",
    "LightsPunctualLamp/LightsPunctualLamp.gltf",
    "MetalRoughSpheresNoTextures.glb",
    "NormalTangentTest.glb",
    "SimpleInstancing.glb",
    "SimpleMeshes.gltf",
    "SimpleSparseAccessor/SimpleSparseAccessor.gltf",
    "Suzanne/Suzanne.gltf",
    "TextureCoordinateTest.glb",
    "TextureSettingsTest.glb",
    "TextureTransformTest/TextureTransformTest.gltf",
    "TriangleWithoutIndices/TriangleWithoutIndices.gltf",
    "TwoSidedPlane/TwoSidedPlane.gltf",
    "UnlitTest.glb",
    "WaterBottle/WaterBottle.gltf",
]


@pytest.mark.slow
@pytest.mark.parametrize("name", ASSETS)
def test_asset_agrees_with_another_reader(shared: Path, name: str) -> None:
    pygltflib = pytest.importorskip("pygltflib")
    path = shared / "assets/gltf" / name
    scene, other = load(path), pygltflib.GLTF2().load(str(path))
    assert {material.name for material in scene.materials} >= {entry.name for entry in other.materials if entry.name}
    reachable, stack = set(), list(other.scenes[other.scene or 0].nodes)
    while stack:
        index = stack.pop()
        reachable.add(index)
        stack += other.nodes[index].children or []
    placed = [other.meshes[other.nodes[index].mesh] for index in reachable if other.nodes[index].mesh is not None]
    if "Instancing" not in name:
        assert len(scene.objects) == sum(len(mesh.primitives) for mesh in placed)
    assert len(scene.cameras) == sum(other.nodes[index].camera is not None for index in reachable)
    for entry in scene.objects:
        mesh = scene.meshes[entry.mesh]
        assert np.isfinite(mesh.positions).all()
        assert np.allclose(np.linalg.norm(mesh.normals, axis=1), 1, atol=1e-5)
        assert int(mesh.indices.max()) < len(mesh.positions)
        assert np.isfinite(entry.transform).all()


@pytest.mark.slow
@pytest.mark.parametrize("name", ["DamagedHelmet.glb", "WaterBottle/WaterBottle.gltf", "NormalTangentTest.glb"])
def test_geometry_agrees_with_trimesh(shared: Path, name: str) -> None:
    trimesh = pytest.importorskip("trimesh")
    path = shared / "assets/gltf" / name
    ours, theirs = load(path), trimesh.load(path, process=False, force="scene")
    assert sum(len(mesh.indices) for mesh in ours.meshes) == sum(len(mesh.faces) for mesh in theirs.geometry.values())
    corners = np.concatenate(
        [
            ours.meshes[entry.mesh].positions @ entry.transform[:3, :3].T + entry.transform[:3, 3]
            for entry in ours.objects
        ]
    )
    assert np.allclose([corners.min(axis=0), corners.max(axis=0)], theirs.bounds, atol=1e-4)


def test_reference_scenes_have_their_camera_and_light(shared: Path) -> None:
    folder = shared / "reference/b2_shadows/spot_basic"
    scene, case = load(folder / "scene.glb"), json.loads((folder / "case.json").read_text())
    (light,) = scene.lights
    camera = scene.cameras["camera"]
    assert np.allclose(light.position, case["light"]["position"], atol=1e-6)
    wanted = np.array(case["light"]["direction"])
    assert np.allclose(light.direction, wanted / np.linalg.norm(wanted), atol=1e-6)
    assert np.allclose(camera.transform[:3, 3], case["camera"]["eye"], atol=1e-6)
    assert camera.fov_y == pytest.approx(case["camera"]["yfov_radians"])
    assert {entry.name for entry in scene.objects} == {entry["name"] for entry in case["objects"]}


def test_one_triangle(tmp_path: Path) -> None:
    scene = read(tmp_path, gltf())
    (entry,), (mesh,) = scene.objects, scene.meshes
    assert entry.name == entry.node == "Tri"
    assert np.array_equal(mesh.positions, TRIANGLE)
    assert np.allclose(mesh.normals, (0, 0, 1)), "flat normals where there are none"
    assert scene.materials[entry.material].metallic == 1, "glTF's default material"
    assert scene.warnings == ()


def test_strips_and_fans(tmp_path: Path) -> None:
    square = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]], np.float32)
    for mode, order in ((5, [0, 1, 2, 3]), (6, [0, 1, 3, 2])):
        top = with_arrays(
            (square, "VEC3", 5126, {}),
            (np.array(order, np.uint8), "SCALAR", 5121, {}),
            meshes=[{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1, "mode": mode}]}],
        )
        mesh = read(tmp_path, top).meshes[0]
        assert len(mesh.indices) == 2
        assert np.allclose(mesh.normals, (0, 0, 1)), "both triangles have the same winding"


def test_points_and_lines_are_left_out_with_a_warning(tmp_path: Path) -> None:
    top = gltf(meshes=[{"primitives": [{"attributes": {"POSITION": 0}, "mode": mode} for mode in (0, 1, 3)]}])
    scene = read(tmp_path, top)
    assert not scene.objects
    assert [problem.code for problem in scene.warnings] == ["RG333"] * 3


def test_normalized_colors_and_coordinates(tmp_path: Path) -> None:
    top = with_arrays(
        (TRIANGLE, "VEC3", 5126, {}),
        (np.array([[255, 0, 51, 0]] * 3, np.uint8), "VEC4", 5121, {"normalized": True}),
        (np.array([[65535, 0]] * 3, np.uint16), "VEC2", 5123, {"normalized": True}),
        meshes=[{"primitives": [{"attributes": {"POSITION": 0, "COLOR_0": 1, "TEXCOORD_0": 2}}]}],
    )
    mesh = read(tmp_path, top).meshes[0]
    assert mesh.colors is not None
    assert mesh.uv0 is not None
    assert np.allclose(mesh.colors, (1, 0, 0.2, 0))
    assert np.allclose(mesh.uv0, (1, 0))


def test_sparse_accessor_without_a_view(tmp_path: Path) -> None:
    data = np.array([1, 2], np.uint16).tobytes() + TRIANGLE[1:].tobytes()
    top = gltf(
        buffers=[{"byteLength": len(data), "uri": uri(data)}],
        bufferViews=[{"buffer": 0, "byteLength": 4}, {"buffer": 0, "byteOffset": 4, "byteLength": 24}],
        accessors=[
            {
                "componentType": 5126,
                "type": "VEC3",
                "count": 3,
                "sparse": {
                    "count": 2,
                    "indices": {"bufferView": 0, "componentType": 5123},
                    "values": {"bufferView": 1},
                },
            }
        ],
        meshes=[{"primitives": [{"attributes": {"POSITION": 0}}]}],
    )
    assert np.array_equal(read(tmp_path, top).meshes[0].positions, TRIANGLE)


def test_hierarchy_multiplies_and_keeps_mirrors(tmp_path: Path) -> None:
    turn = [0, 0, np.sin(np.pi / 4), np.cos(np.pi / 4)]
    nodes = [
        {"children": [1], "translation": [1, 2, 3], "rotation": turn},
        {"mesh": 0, "matrix": [-2, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 1, 0, 0, 1], "name": "child"},
    ]
    (entry,) = read(tmp_path, gltf(nodes=nodes)).objects
    assert np.allclose(entry.transform @ (0, 0, 0, 1), (1, 3, 3, 1))
    assert np.allclose(entry.transform @ (1, 0, 0, 1), (1, 1, 3, 1))
    assert np.linalg.det(entry.transform) < 0


def test_names_are_made_unique_and_parts_numbered(tmp_path: Path) -> None:
    primitive = {"attributes": {"POSITION": 0}, "indices": 1}
    top = gltf(
        meshes=[{"primitives": [primitive, primitive]}],
        nodes=[{"mesh": 0, "name": "Box"}, {"mesh": 0, "name": "Box"}, {"mesh": 0}],
        scenes=[{"nodes": [0, 1, 2]}],
    )
    scene = read(tmp_path, top)
    assert [entry.name for entry in scene.objects] == ["Box", "Box#1", "Box_1", "Box_1#1", "node_2", "node_2#1"]
    assert [entry.node for entry in scene.objects] == ["Box", "Box", "Box_1", "Box_1", "node_2", "node_2"]
    assert len(scene.meshes) == 1, "equal primitives are one mesh"


def test_default_scene_is_the_one_named(tmp_path: Path) -> None:
    top = gltf(
        nodes=[{"mesh": 0, "name": "a"}, {"mesh": 0, "name": "b"}], scenes=[{"nodes": [0]}, {"nodes": [1]}], scene=1
    )
    assert [entry.name for entry in read(tmp_path, top).objects] == ["b"]
    del top["scene"]
    assert [entry.name for entry in read(tmp_path, top).objects] == ["a"]
    del top["scenes"]
    assert [entry.name for entry in read(tmp_path, top).objects] == ["a", "b"]


def test_materials_with_extensions(tmp_path: Path) -> None:
    material = {
        "name": "M",
        "alphaMode": "MASK",
        "alphaCutoff": 0.3,
        "doubleSided": True,
        "emissiveFactor": [0.5, 0, 0],
        "pbrMetallicRoughness": {
            "baseColorFactor": [0.1, 0.2, 0.3, 0.4],
            "metallicFactor": 0.5,
            "roughnessFactor": 0.6,
        },
        "extensions": {
            "KHR_materials_emissive_strength": {"emissiveStrength": 4},
            "KHR_materials_ior": {"ior": 1.3},
            "KHR_materials_specular": {"specularFactor": 0.7, "specularColorFactor": [1, 0.5, 2]},
            "KHR_materials_anisotropy": {"anisotropyStrength": 0.8, "anisotropyRotation": 0.9},
            "KHR_materials_unlit": {},
        },
    }
    found = read(tmp_path, gltf(materials=[material])).materials[0]
    assert found.base_color == (0.1, 0.2, 0.3, 0.4)
    assert (found.metallic, found.roughness, found.ior, found.specular) == (0.5, 0.6, 1.3, 0.7)
    assert found.specular_color == (1, 0.5, 2)
    assert found.emissive == (2, 0, 0)
    assert (found.anisotropy_strength, found.anisotropy_rotation) == (0.8, 0.9)
    assert (found.alpha_mode, found.alpha_cutoff, found.double_sided, found.unlit) == ("mask", 0.3, True, True)


def test_layers_are_read_as_the_extensions_have_them(tmp_path: Path) -> None:
    """Those that a file requires, too; a factor outside of its range is clamped."""
    layers = {
        "KHR_materials_clearcoat": {"clearcoatFactor": 1.5, "clearcoatRoughnessFactor": 0.2},
        "KHR_materials_sheen": {"sheenColorFactor": [0.1, 0.2, 0.3], "sheenRoughnessFactor": 0.4},
        "KHR_materials_iridescence": {"iridescenceFactor": 0.5, "iridescenceThicknessMaximum": 500},
        "KHR_materials_transmission": {"transmissionFactor": 0.9},
        "KHR_materials_volume": {"thicknessFactor": 2, "attenuationColor": [0.5, 1, 1], "attenuationDistance": 3},
        "KHR_materials_dispersion": {"dispersion": 0.6},
    }
    top = gltf(materials=[{"extensions": layers}], extensionsUsed=[*layers], extensionsRequired=[*layers])
    scene = read(tmp_path, top)
    found = scene.materials[0]
    assert [warning.code for warning in scene.warnings] == ["RG332"]
    assert (found.clearcoat, found.clearcoat_roughness, found.clearcoat_normal_scale) == (1, 0.2, 1)
    assert (found.sheen_color, found.sheen_roughness) == ((0.1, 0.2, 0.3), 0.4)
    assert (found.iridescence, found.iridescence_ior, found.iridescence_thickness) == (0.5, 1.3, (100, 500))
    assert (found.transmission, found.thickness, found.dispersion) == (0.9, 2, 0.6)
    assert (found.attenuation_color, found.attenuation_distance) == ((0.5, 1, 1), 3)
    assert scene.layers(found) == ("clearcoat", "sheen", "iridescence", "transmission")
    assert scene.is_blended(found)


def test_texture_transform(shared: Path) -> None:
    scene = load(shared / "assets/gltf/TextureTransformTest/TextureTransformTest.gltf")
    moved = {
        material.name: texture.transform
        for material in scene.materials
        for texture in material.textures.values()
        if texture.transform is not None
    }
    assert moved
    for matrix in moved.values():
        assert np.isfinite(matrix).all()
    tables = [np.array(matrix).reshape(2, 3) for matrix in moved.values()]
    assert any(np.allclose(table[:, :2], np.eye(2)) and np.allclose(table[:, 2], 0.5, atol=0.6) for table in tables)


def test_samplers_of_textures(shared: Path) -> None:
    scene = load(shared / "assets/gltf/TextureSettingsTest.glb")
    used = {(t.wrap_s, t.wrap_t) for material in scene.materials for t in material.textures.values()}
    assert {wrap for pair in used for wrap in pair} == {"repeat", "mirror", "clamp"}


def test_instances(shared: Path) -> None:
    scene = load(shared / "assets/gltf/SimpleInstancing.glb")
    assert len(scene.objects) == 125
    assert len({entry.node for entry in scene.objects}) == 1
    assert scene.objects[3].name.endswith("[3]")


def test_optional_extension_warns_once_and_required_one_stops(tmp_path: Path) -> None:
    scene = read(tmp_path, gltf(extensionsUsed=["ACME_x", "ACME_y"]))
    assert [problem.code for problem in scene.warnings] == ["RG333", "RG333"]
    with pytest.raises(InputError, match="RG308 requires the extension 'ACME_x'") as error:
        read(tmp_path, gltf(extensionsUsed=["ACME_x"], extensionsRequired=["ACME_x"]))
    assert error.value.exit_code == 3


def glb(top: dict[str, Any], binary: bytes = b"", extra: bytes = b"") -> bytes:
    text = json.dumps(top).encode()
    text += b" " * (-len(text) % 4)
    body = struct.pack("<II", len(text), 0x4E4F534A) + text
    if binary:
        binary += b"\0" * (-len(binary) % 4)
        body += struct.pack("<II", len(binary), 0x004E4942) + binary
    return struct.pack("<4sII", b"glTF", 2, 12 + len(body)) + body + extra


def test_glb_and_what_follows_its_end(tmp_path: Path) -> None:
    data = TRIANGLE.tobytes() + np.array([0, 1, 2], np.uint16).tobytes()
    path = tmp_path / "a.glb"
    path.write_bytes(glb(gltf(buffers=[{"byteLength": len(data)}]), data, b"tail"))
    scene = load(path)
    assert np.array_equal(scene.meshes[0].positions, TRIANGLE)
    assert [problem.code for problem in scene.warnings] == ["RG332"]


BROKEN: dict[str, tuple[dict[str, Any], str]] = {
    "index": (
        gltf(accessors=[gltf()["accessors"][0] | {"count": 2, "max": [1, 0, 0]}, gltf()["accessors"][1]]),
        "RG305 .*index 2 is out of range; there are 2 vertices",
    ),
    "accessor past its view": (gltf(accessors=[gltf()["accessors"][0] | {"count": 4}]), "needs 48 bytes"),
    "view past its buffer": (gltf(bufferViews=[{"buffer": 0, "byteLength": 360}]), "ends at byte 360"),
    "buffer shorter": (gltf(buffers=[{"byteLength": 99, "uri": uri(b"abc")}]), "truncated: 'byteLength' is 99"),
    "accessor unused": (
        gltf(accessors=[*gltf()["accessors"], {"componentType": 1, "type": "VEC3", "count": 1}]),
        r"Invalid enum value 1 - at `\$\.accessors\[2\]\.componentType",
    ),
    "misaligned": (gltf(accessors=[gltf()["accessors"][0] | {"byteOffset": 2, "count": 2}]), "not aligned"),
    "stride": (gltf(bufferViews=[{"buffer": 0, "byteLength": 36, "byteStride": 8}]), "stride of 8"),
    "min": (gltf(accessors=[gltf()["accessors"][0] | {"min": [0]}]), "'min' must be 3 numbers"),
    "wrong type": (gltf(meshes=[{"primitives": [{"attributes": {"POSITION": 1}}]}]), "POSITION must be VEC3"),
    "cycle": (gltf(nodes=[{"children": [1]}, {"children": [0]}], scenes=[{"nodes": []}]), "RG309 .*own ancestor"),
    "two parents": (gltf(nodes=[{"children": [2]}, {"children": [2]}, {}]), "RG309 .*two parents"),
    "not a root": (gltf(nodes=[{"children": [1]}, {}], scenes=[{"nodes": [1]}]), "RG309 .*has a parent"),
    "zero rotation": (gltf(nodes=[{"rotation": [0, 0, 0, 0]}]), "length zero"),
    "matrix": (gltf(nodes=[{"matrix": [1] * 16}]), "not affine"),
    "no such mesh": (gltf(nodes=[{"mesh": 3}]), "mesh is 3, but there are 1 meshes"),
    "missing buffer": (gltf(buffers=[{"byteLength": 3, "uri": "a.bin"}]), "RG301 buffer 'a.bin' does not exist"),
    "missing image": (gltf(images=[{"uri": "a.png"}]), "RG350 image 'a.png' does not exist"),
    "escape": (gltf(buffers=[{"byteLength": 3, "uri": "../../a.bin"}]), "RG302"),
    "encoded escape": (gltf(buffers=[{"byteLength": 3, "uri": "%2e%2e/%2e%2e/a.bin"}]), "RG302"),
    "absolute": (gltf(buffers=[{"byteLength": 3, "uri": "/etc/passwd"}]), "RG302"),
    "address": (
        gltf(buffers=[{"byteLength": 3, "uri": "http://localhost/a"}]),
        "RG302 .*only local files can be loaded",
    ),
    "zero byte": (gltf(buffers=[{"byteLength": 3, "uri": "a%00"}]), "RG302"),
    "base64": (gltf(buffers=[{"byteLength": 3, "uri": "data:;base64,####"}]), "broken base64"),
    "camera": (gltf(cameras=[{"type": "perspective", "perspective": {"yfov": 1, "znear": 0}}]), "0 < znear"),
    "old": (gltf(asset={"version": "1.0"}), "RG303 .*version '1.0'"),
    "null": (gltf(meshes=None), "got `null` - at `.*meshes"),
    "infinite place": (gltf(nodes=[{"scale": [1e308] * 3, "children": [1]}, {"scale": [1e308] * 3}]), "RG306"),
    "many": (gltf(accessors=[{"componentType": 5126, "type": "VEC3", "count": 4_000_000_000}]), "RG307 .*48,000,"),
}


@pytest.mark.parametrize("case", BROKEN)
def test_broken_file_is_one_clear_error(tmp_path: Path, case: str) -> None:
    top, message = BROKEN[case]
    with pytest.raises(InputError, match=message) as error:
        read(tmp_path, top)
    assert len(error.value.problems) == 1
    assert "a.gltf" in str(error.value)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('{"asset": {"version": "2.0"}, "asset": {}}', "duplicate key 'asset'"),
        ('{"asset": {"version": "2.0"}, "x": NaN}', "NaN is not allowed"),
        ('{"asset": {"version": "2.0"}, "x": 1e999}', "number 1e999 is out of range"),
        ('{"asset": {"version": "2.0"}, "x": ' + "9" * 5000 + "}", "Exceeds the limit"),
        ('{"asset": ' + "[" * 100_000, "nested too deeply"),
        ('{"asset": {"version": "2.0"}', "delimiter: line 1"),
        ("[]", "Expected `object`, got `array`"),
        ("", "invalid JSON: Expecting value"),
    ],
)
def test_json_is_strict(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(InputError, match=message):
        read(tmp_path, text)


def test_json_is_utf8(tmp_path: Path) -> None:
    (tmp_path / "a.gltf").write_bytes(b'{"asset": "\xff"}')
    with pytest.raises(InputError, match="can't decode byte 0xff in position 11"):
        load(tmp_path / "a.gltf")


def test_nan_in_any_accessor_is_found(tmp_path: Path) -> None:
    top = with_arrays(
        (TRIANGLE, "VEC3", 5126, {}),
        (np.array([np.nan], np.float32), "SCALAR", 5126, {}),
        meshes=[{"primitives": [{"attributes": {"POSITION": 0}}]}],
    )
    with pytest.raises(InputError, match=r"RG306 accessors\[1\] contains NaN"):
        read(tmp_path, top)


def test_a_vertex_too_far_away_and_too_many_nodes_are_errors(tmp_path: Path) -> None:
    far = with_arrays((TRIANGLE * 3e38, "VEC3", 5126, {}), meshes=[{"primitives": [{"attributes": {"POSITION": 0}}]}])
    with pytest.raises(InputError, match=r"RG306 meshes\[0\].*: a vertex lies beyond 1e\+12 m"):
        read(tmp_path, far)
    path = tmp_path / "many.gltf"
    path.write_text(json.dumps(gltf(nodes=[{"mesh": 0}, {}, {}])))
    with pytest.raises(InputError, match="RG307 has 3 nodes, the limit is 2; --limit scene-objects=N allows more"):
        load(path, limits=SceneLimits(objects=2))


def test_a_texture_without_its_coordinates_is_said(tmp_path: Path) -> None:
    write(tmp_path / "a.png", np.zeros((2, 2, 3), np.uint8))
    uvs = np.zeros((3, 2), np.float32)
    for attributes, said in (({"POSITION": 0}, 1), ({"POSITION": 0, "TEXCOORD_0": 1}, 0)):
        top = with_arrays(
            (TRIANGLE, "VEC3", 5126, {}),
            (uvs, "VEC2", 5126, {}),
            meshes=[{"primitives": [{"attributes": attributes, "material": 0}]}],
            materials=[{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}],
            textures=[{"source": 0}],
            images=[{"uri": "a.png"}],
        )
        warnings = read(tmp_path, top).warnings
        assert [problem.code for problem in warnings] == ["RG333"] * said
        assert all("has no coordinates for its base_color texture" in problem.message for problem in warnings)


def test_zero_normals_are_computed_and_said(tmp_path: Path) -> None:
    top = with_arrays(
        (TRIANGLE, "VEC3", 5126, {}),
        (np.zeros((3, 3), np.float32), "VEC3", 5126, {}),
        meshes=[{"primitives": [{"attributes": {"POSITION": 0, "NORMAL": 1}}]}],
    )
    scene = read(tmp_path, top)
    assert np.allclose(scene.meshes[0].normals, (0, 0, 1))
    assert "3 normals of length zero" in str(scene.warnings[0])


def test_every_length_of_a_truncated_file_is_an_error(tmp_path: Path, shared: Path) -> None:
    whole = (shared / "assets/gltf/BoxTextured.glb").read_bytes()
    path = tmp_path / "a.glb"
    for length in [*range(0, 64), *range(64, len(whole), 97)]:
        path.write_bytes(whole[:length])
        with pytest.raises(InputError, match=r"RG30[34]"):
            load(path)


def test_overlapping_accessors_end_in_an_error_and_not_in_time(tmp_path: Path) -> None:
    data = bytes(1 << 20)
    accessors = [{"bufferView": 0, "componentType": 5126, "type": "VEC3", "count": 80_000} for _ in range(4000)]
    views = [{"buffer": 0, "byteLength": len(data)}]
    top = gltf(
        buffers=[{"byteLength": len(data), "uri": "a.bin"}],
        bufferViews=views,
        accessors=accessors,
        meshes=[],
        nodes=[],
        scenes=[],
    )
    (tmp_path / "a.bin").write_bytes(data)
    with pytest.raises(InputError, match="accessors overlap"):
        read(tmp_path, top)


def test_many_nodes_of_many_primitives_end_at_the_limit(tmp_path: Path) -> None:
    primitives = [{"attributes": {"POSITION": 0}, "indices": 1}] * 2000
    top = gltf(meshes=[{"primitives": primitives}], nodes=[{"mesh": 0}] * 2000, scenes=[{"nodes": list(range(2000))}])
    with pytest.raises(InputError, match="RG307 its nodes place 4,000,000 objects"):
        read(tmp_path, top)
