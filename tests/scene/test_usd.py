"""USD stages as scenes: units and axes, polygons, materials, instances, lights and cameras, and what is said of mistakes."""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import rendergraph as rg
from rendergraph.errors import InputError
from rendergraph.images import write
from rendergraph.scene.load import load
from rendergraph.scene.model import Scene

pytest.importorskip("pxr")

QUAD = """
    point3f[] points = [(-1, 0, 0), (1, 0, 0), (1, 2, 0), (-1, 2, 0)]
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    uniform token subdivisionScheme = "none"
"""


STATEMENT = re.compile(
    r"(?<!uniform) (?=(uniform|def|class|over|rel|(double|float|int|bool|color3f|asset|token)[234]?(\[\])?) [\w\"])"
)


def stage(prims: str, head: str = 'upAxis = "Y"; metersPerUnit = 1') -> str:
    """The text of a stage: each statement on a line of its own, as the format wants it."""
    return f"#usda 1.0\n( {head} )\n" + STATEMENT.sub("\n", prims).replace("}", "\n}\n")


def read(folder: Path, prims: str, head: str = 'upAxis = "Y"; metersPerUnit = 1') -> Scene:
    (folder / "stage.usda").write_text(stage(prims, head))
    return load(folder / "stage.usda")


def surface(inputs: str, others: str = "") -> str:
    """A material `red`, and the line that binds it."""
    return f"""
def Material "red" {{
    token outputs:surface.connect = </red/shader.outputs:surface>
    def Shader "shader" {{
        uniform token info:id = "UsdPreviewSurface"
        token outputs:surface
        {inputs}
    }}
    {others}
}}
"""


BOUND = 'def Mesh "quad" (prepend apiSchemas = ["MaterialBindingAPI"]) { rel material:binding = </red> ' + QUAD


def test_centimetres_with_z_up_become_metres_with_y_up(tmp_path: Path) -> None:
    scene = read(
        tmp_path,
        'def Xform "up" { double3 xformOp:translate = (100, 200, 300) uniform token[] xformOpOrder = ["xformOp:translate"]\n'
        'def Cube "cube" { double size = 50 } }',
        'upAxis = "Z"; metersPerUnit = 0.01',
    )
    assert [one.name for one in scene.objects] == ["cube"]
    np.testing.assert_allclose(scene.bounds, [(0.75, 2.75, -2.25), (1.25, 3.25, -1.75)], atol=1e-6)


@pytest.mark.parametrize("shape", ["Cylinder", "Cone"])
@pytest.mark.parametrize(("axis", "extent"), [("X", (4, 2, 2)), ("Y", (2, 4, 2)), ("Z", (2, 2, 4))])
def test_shapes_stand_along_their_axis(tmp_path: Path, shape: str, axis: str, extent: tuple[int, ...]) -> None:
    scene = read(tmp_path, f'def {shape} "it" {{ double radius = 1 double height = 4 uniform token axis = "{axis}" }}')
    (mesh,) = scene.meshes
    np.testing.assert_allclose(np.ptp(mesh.positions, axis=0), extent, atol=1e-5)
    assert mesh.solid
    a, b, c = np.moveaxis(mesh.positions.astype(float)[mesh.indices], 1, 0)
    assert np.einsum("ij,ij->", a, np.cross(b, c)) > 0  # its faces look out


def test_polygons_are_cut_and_turned_to_the_side_that_they_show(tmp_path: Path) -> None:
    """A concave face of six corners, seen from +Z by its orientation; its texture coordinates are turned over."""
    points = "[(0, 0, 0), (2, 0, 0), (2, 1, 0), (1, 1, 0), (1, 2, 0), (0, 2, 0)]"
    scene = read(
        tmp_path,
        f"""def Mesh "corner" {{
    point3f[] points = {points}
    int[] faceVertexCounts = [6]
    int[] faceVertexIndices = [5, 4, 3, 2, 1, 0]
    uniform token orientation = "leftHanded"
    uniform token subdivisionScheme = "none"
    texCoord2f[] primvars:st = [(0, 2), (1, 2), (1, 1), (2, 1), (2, 0), (0, 0)] ( interpolation = "faceVarying" )
}}""",
    )
    (mesh,) = scene.meshes
    a, b, c = np.moveaxis(mesh.positions.astype(float)[mesh.indices], 1, 0)
    area = np.cross(b - a, c - a)[:, 2] / 2
    assert area.sum() == pytest.approx(3)
    assert (area > 0).all()
    np.testing.assert_allclose(mesh.normals, np.tile([0, 0, 1], (len(mesh.normals), 1)), atol=1e-6)
    assert mesh.uv0 is not None
    np.testing.assert_allclose(mesh.uv0, mesh.positions[:, :2] * (1, -1) + (0, 1), atol=1e-6)


def test_vertices_are_shared_where_all_their_values_are(tmp_path: Path) -> None:
    """A folded strip: flat faces part along the fold, a subdivision surface is smooth there."""
    strip = """
    point3f[] points = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 1, -1), (1, 1, -1)]
    int[] faceVertexCounts = [4, 4]
    int[] faceVertexIndices = [0, 1, 2, 3, 3, 2, 5, 4]
    """
    scene = read(
        tmp_path,
        f'def Mesh "flat" {{ {strip} uniform token subdivisionScheme = "none" }} def Mesh "smooth" {{ {strip} }}',
    )
    flat, smooth = scene.meshes
    assert (len(flat.positions), len(smooth.positions)) == (8, 6)
    fold = np.isclose(smooth.positions[:, 1], 1) & np.isclose(smooth.positions[:, 2], 0)
    np.testing.assert_allclose(smooth.normals[fold], np.tile(np.sqrt([0, 0.5, 0.5]), (2, 1)), atol=1e-6)
    assert ["control mesh" in one.text for one in scene.warnings] == [True]


def test_values_of_a_preview_surface(tmp_path: Path) -> None:
    scene = read(
        tmp_path,
        surface(
            """color3f inputs:diffuseColor = (0.8, 0.1, 0.2) float inputs:metallic = 0.25 float inputs:roughness = 0.4
            color3f inputs:emissiveColor = (2, 3, 4) float inputs:opacity = 0.5 float inputs:ior = 1.8
            float inputs:clearcoat = 0.6 float inputs:clearcoatRoughness = 0.1"""
        )
        + BOUND
        + "uniform bool doubleSided = 1 }",
    )
    (material,) = scene.materials
    assert material.base_color == pytest.approx((0.8, 0.1, 0.2, 0.5))
    assert (material.name, material.alpha_mode, material.double_sided) == ("red", "blend", True)
    values = (material.metallic, material.roughness, material.ior, material.clearcoat, material.clearcoat_roughness)
    assert values == pytest.approx((0.25, 0.4, 1.8, 0.6, 0.1))
    assert material.emissive == pytest.approx((2, 3, 4))


def test_a_specular_surface_has_the_reflectance_that_it_names(tmp_path: Path) -> None:
    inputs = (
        "int inputs:useSpecularWorkflow = 1 color3f inputs:specularColor = (0.1, 0.2, 0.3) float inputs:metallic = 1"
    )
    (material,) = read(tmp_path, surface(inputs) + BOUND + "}").materials
    assert material.metallic == 0
    assert np.multiply(material.specular_color, 0.04) == pytest.approx((0.1, 0.2, 0.3))


TEXTURE = """
    def Shader "image" {
        uniform token info:id = "UsdUVTexture"
        asset inputs:file = @chart.png@
        token inputs:wrapS = "mirror"
        float4 inputs:scale = (0.5, 0.25, 1, 1)
        float2 inputs:st.connect = </red/turn.outputs:result>
        float3 outputs:rgb
    }
    def Shader "turn" {
        uniform token info:id = "UsdTransform2d"
        float2 inputs:in.connect = </red/map.outputs:result>
        float inputs:rotation = 90
        float2 inputs:scale = (2, 3)
        float2 inputs:translation = (0.25, 0.5)
        float2 outputs:result
    }
    def Shader "map" {
        uniform token info:id = "UsdPrimvarReader_float2"
        string inputs:varname = "map1"
        float2 outputs:result
    }
"""


def test_textures_with_their_coordinates(tmp_path: Path) -> None:
    write(tmp_path / "chart.png", np.zeros((4, 4, 3), np.uint8))
    scene = read(
        tmp_path,
        surface("color3f inputs:diffuseColor.connect = </red/image.outputs:rgb>", TEXTURE)
        + BOUND
        + 'texCoord2f[] primvars:map1 = [(0, 0), (1, 0), (1, 1), (0, 1)] ( interpolation = "vertex" ) }',
    )
    (material,), (mesh,) = scene.materials, scene.meshes
    texture = material.textures["base_color"]
    assert material.base_color == pytest.approx((0.5, 0.25, 1, 1))
    assert (texture.srgb, texture.wrap_s, texture.wrap_t) == (True, "mirror", "repeat")
    assert texture.transform is not None
    assert mesh.uv0 is not None
    found = np.reshape(texture.transform, (2, 3)) @ np.vstack([mesh.uv0.T, np.ones(4)])
    s, t = mesh.positions[:, 0] / 2 + 0.5, mesh.positions[:, 1] / 2  # USD's: scaled, turned, then moved
    np.testing.assert_allclose(found, [-3 * t + 0.25, 1 - (2 * s + 0.5)], atol=1e-6)
    assert not scene.warnings


def test_parts_of_a_mesh_have_materials_of_their_own(tmp_path: Path) -> None:
    mesh = """
def Mesh "pair" {
    point3f[] points = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (2, 0, 0), (2, 1, 0)]
    int[] faceVertexCounts = [4, 4]
    int[] faceVertexIndices = [0, 1, 2, 3, 1, 4, 5, 2]
    uniform token subdivisionScheme = "none"
    color3f[] primvars:displayColor = [(0.1, 0.2, 0.3)]
    def GeomSubset "right" (prepend apiSchemas = ["MaterialBindingAPI"]) {
        uniform token elementType = "face"
        uniform token familyName = "materialBind"
        int[] indices = [1]
        rel material:binding = </red>
    }
}"""
    scene = read(tmp_path, surface("color3f inputs:diffuseColor = (1, 0, 0)") + mesh)
    parts = {scene.materials[one.material].name: scene.meshes[one.mesh] for one in scene.objects}
    assert parts["red"].positions[:, 0].min() == 1
    assert parts["default"].positions[:, 0].max() == 1
    assert {one.node for one in scene.objects} == {"pair"}
    colors = parts["default"].colors
    assert colors is not None
    np.testing.assert_allclose(colors, np.tile([0.1, 0.2, 0.3, 1], (4, 1)), atol=1e-6)


def test_instances_share_their_meshes(tmp_path: Path) -> None:
    move = 'double3 xformOp:translate = ({}, 0, 0) uniform token[] xformOpOrder = ["xformOp:translate"]'
    scene = read(
        tmp_path,
        f"""
class "tree" {{ def Sphere "crown" {{ double radius = 0.5 {move.format(5)} }} }}
def "a" (instanceable = true; prepend references = </tree>) {{}}
def Xform "b" (instanceable = true; prepend references = </tree>) {{ {move.format(1)} }}
def PointInstancer "wood" {{
    rel prototypes = </wood/leaf>
    int[] protoIndices = [0, 0]
    point3f[] positions = [(10, 0, 0), (20, 0, 0)]
    float3[] scales = [(1, 1, 1), (2, 2, 2)]
    def Cube "leaf" {{ double size = 1 {move.format(3)} }}
}}""",
    )
    assert len(scene.meshes) == 2
    at = [one.transform[0, 3] for one in scene.objects]
    assert sorted(at) == pytest.approx([5, 6, 13, 26])
    assert max(one.transform[0, 0] for one in scene.objects) == 2


def test_what_is_hidden_and_what_only_helps_is_not_drawn(tmp_path: Path) -> None:
    scene = read(
        tmp_path,
        'def Cube "a" { token visibility = "invisible" } def Cube "b" { uniform token purpose = "guide" } '
        'def Xform "c" { token visibility = "invisible" def Cube "d" {} } def Cube "e" {} over "f" {} ',
    )
    assert [one.name for one in scene.objects] == ["e"]


@pytest.mark.parametrize(
    ("prim", "type_", "intensity"),
    [
        ('DistantLight "l" { float inputs:intensity = 2 bool inputs:normalize = 1 }', "directional", 2.0),
        ('DistantLight "l" {}', "directional", 50000 * math.pi * math.sin(math.radians(0.265)) ** 2),
        ('SphereLight "l" { float inputs:intensity = 3 float inputs:radius = 0.5 }', "point", 3 * math.pi / 4),
        (
            'SphereLight "l" { float inputs:intensity = 8 bool inputs:normalize = 1 float inputs:exposure = 1 }',
            "point",
            4.0,
        ),
        ('RectLight "l" { float inputs:intensity = 3 float inputs:width = 2 float inputs:height = 0.5 }', "spot", 3.0),
        ('DiskLight "l" { float inputs:intensity = 3 float inputs:radius = 2 }', "spot", 12 * math.pi),
    ],
)
def test_lights_have_the_intensity_of_their_axis(tmp_path: Path, prim: str, type_: str, intensity: float) -> None:
    """A ball of radiance L and radius r sends L π r² to any side; normalised, its power is L times the area of 1."""
    turn = "float xformOp:rotateY = 90 double3 xformOp:translate = (1, 2, 3) uniform token[] xformOpOrder = "
    turn += '["xformOp:translate", "xformOp:rotateY"] }'
    scene = read(tmp_path, f'def {prim[:-1]} {turn} def Cube "c" {{}}')
    (light,) = scene.lights
    assert light.type == type_
    assert light.intensity == pytest.approx(intensity)
    if type_ != "point":
        assert light.direction == pytest.approx((-1, 0, 0))
    if type_ != "directional":
        assert light.position == pytest.approx((1, 2, 3))


def test_a_dome_is_the_environment(tmp_path: Path) -> None:
    """The middle of its image lies at +Z, of ours at +X, before either is turned."""
    write(tmp_path / "around.exr", np.ones((4, 8, 3), np.float32))
    turn = 'float xformOp:rotateY = 30 uniform token[] xformOpOrder = ["xformOp:rotateY"]'
    scene = read(
        tmp_path,
        f'def DomeLight "sky" {{ asset inputs:texture:file = @around.exr@ float inputs:intensity = 2 {turn} }}'
        ' def Cube "c" {}',
    )
    assert scene.environment is not None
    assert scene.environment.intensity == 2
    assert scene.environment.size == (8, 4)
    angle = scene.environment.rotate
    middle = np.array([math.cos(angle), 0, -math.sin(angle)])
    np.testing.assert_allclose(middle, [math.sin(math.radians(30)), 0, math.cos(math.radians(30))], atol=1e-9)


def test_a_camera(tmp_path: Path) -> None:
    scene = read(
        tmp_path,
        """def Camera "main" {
    float focalLength = 50
    float verticalAperture = 24
    float2 clippingRange = (10, 5000)
    double3 xformOp:translate = (0, -300, 100)
    float xformOp:rotateX = 90
    uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateX"]
} def Cube "c" {}""",
        'upAxis = "Z"; metersPerUnit = 0.01',
    )
    camera = scene.cameras["main"]
    assert camera.fov_y == pytest.approx(2 * math.atan(12 / 50))
    assert (camera.near, camera.far) == pytest.approx((0.1, 50))
    np.testing.assert_allclose(camera.transform[:3, 3], (0, 1, 3), atol=1e-9)
    np.testing.assert_allclose(camera.transform[:3, :3], np.eye(3), atol=1e-7)


def test_a_stage_is_drawn_as_the_same_scene_file(gl: rg.Session, tmp_path: Path) -> None:
    chart = np.random.default_rng(2).integers(0, 256, (8, 8, 3)).astype(np.uint8)
    write(tmp_path / "chart.png", chart)
    image = 'def Shader "image" { uniform token info:id = "UsdUVTexture" asset inputs:file = @chart.png@ float3 outputs:rgb }'
    (tmp_path / "stage.usda").write_text(
        stage(
            surface(
                "color3f inputs:diffuseColor.connect = </red/image.outputs:rgb> float inputs:roughness = 0.4", image
            )
            + BOUND
            + """texCoord2f[] primvars:st = [(0, 0), (1, 0), (1, 1), (0, 1)] ( interpolation = "vertex" ) }
def Sphere "ball" { double radius = 0.5 color3f[] primvars:displayColor = [(0.2, 0.6, 0.3)]
    double3 xformOp:translate = (0.3, 0.6, 1) uniform token[] xformOpOrder = ["xformOp:translate"] }
def DistantLight "sun" { float inputs:intensity = 3 bool inputs:normalize = 1
    float xformOp:rotateX = -50 uniform token[] xformOpOrder = ["xformOp:rotateX"] }
def Camera "main" { float focalLength = 30 float verticalAperture = 24 float2 clippingRange = (0.1, 100)
    double3 xformOp:translate = (0, 1, 4) uniform token[] xformOpOrder = ["xformOp:translate"] }"""
        )
    )
    fall = math.radians(50)
    (tmp_path / "same.yaml").write_text(f"""scene: 1
objects:
  quad: {{shape: plane, size: [2, 2], at: [0, 1, 0], rotate_degrees: [90, 0, 0], material: red}}
  ball: {{shape: sphere, radius: 0.5, at: [0.3, 0.6, 1], material: green}}
materials:
  red: {{base_color_texture: chart.png, roughness: 0.4, metallic: 0}}
  green: {{base_color: [0.2, 0.6, 0.3], roughness: 0.5, metallic: 0}}
lights: {{sun: {{type: directional, direction: [0, {-math.sin(fall)}, {-math.cos(fall)}], intensity: 3}}}}
cameras: {{main: {{eye: [0, 1, 4], target: [0, 1, 0], fov_y_degrees: {math.degrees(2 * math.atan(12 / 30))}, near: 0.1, far: 100}}}}
""")
    a, b = (
        gl.render(rg.load("forward", scene=tmp_path / name, size=(64, 48), environment="none"), outputs=["radiance"])
        for name in ("stage.usda", "same.yaml")
    )
    assert b["radiance"].max() > 0.5
    off = np.abs(a["radiance"] - b["radiance"])
    assert (off > 2e-3).mean() < 0.003  # of pixels on an edge


@pytest.mark.parametrize(
    ("prims", "code", "text"),
    [
        ('def Mesh "m" { point3f[] points = [(0, 0, 0)] int[] faceVertexCounts = [3] int[] faceVertexIndices = [0, 1, 2] }',
         "RG305", "mesh 'm' has corners without a point"),
        ("def Cube {", "RG304", "the stage cannot be read"),
        ('def "a" (prepend references = @../outside.usda@) {}', "RG302", "leaves the folder"),
    ],
)  # fmt: skip
def test_mistakes_are_said(tmp_path: Path, prims: str, code: str, text: str) -> None:
    (tmp_path / "outside.usda").write_text('#usda 1.0\n( defaultPrim = "x" )\ndef Cube "x" {}')
    folder = tmp_path / "inside"
    folder.mkdir()
    with pytest.raises(InputError, match=f"{code} .*{text}"):
        read(folder, prims)


@pytest.mark.parametrize(
    ("prims", "text"),
    [
        ('def Cube "c" { double3 xformOp:translate.timeSamples = { 0: (0, 0, 0), 5: (1, 0, 0) } '
         'uniform token[] xformOpOrder = ["xformOp:translate"] }', "'c' moves; its motion is left out"),
        ('def Capsule "c" {}', "'Capsule' is no shape that is drawn"),
        ('def RectLight "l" {} def Cube "c" {}', "'l' shines from its middle, as a spot"),
        ('def Scope "s" {}', "contains no mesh"),
    ],
)  # fmt: skip
def test_what_is_left_out_is_said(tmp_path: Path, prims: str, text: str) -> None:
    warnings = [one.text for one in read(tmp_path, prims).warnings]
    assert any(text in one for one in warnings), warnings


def test_without_usd_core_the_way_to_it_is_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("rendergraph.pipelines.formats.usd.find_spec", lambda name: None)
    with pytest.raises(InputError, match=r"pip install 'rendergraph\[usd\]'"):
        read(tmp_path, 'def Cube "c" {}')


def test_images_within_a_package(tmp_path: Path) -> None:
    from pxr import UsdUtils

    write(tmp_path / "chart.png", np.full((4, 4, 3), 7, np.uint8))
    read(
        tmp_path,
        surface("color3f inputs:diffuseColor.connect = </red/image.outputs:rgb>", TEXTURE) + BOUND + "}",
    )
    (tmp_path / "away").mkdir()
    package: Any = tmp_path / "away" / "all.usdz"
    assert UsdUtils.CreateNewUsdzPackage(str(tmp_path / "stage.usda"), str(package))
    (material,) = load(package).materials
    image = material.textures["base_color"].image
    assert (image.size, image.data is not None) == ((4, 4), True)
