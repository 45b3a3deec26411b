"""The OBJ and MTL reader: every asset, figures of an independent reader, and each feature on a file made for it."""

from __future__ import annotations

import re
import struct
import time
import zlib
from pathlib import Path

import numpy as np
import pytest
from rendergraph.pipelines.formats.obj.parser import parse
from rendergraph.pipelines.polygons import clip_ears, triangulate

import rendergraph as rg
from rendergraph.errors import InputError, Problem
from rendergraph.scene.load import load
from rendergraph.scene.model import Scene
from rendergraph.scene.reading import Reading, inside

TRIANGLE = "v 0 0 0\nv 1 0 0\nv 0 1 0\n"


def read(tmp_path: Path, text: str | bytes, mtl: str | None = None) -> Scene:
    (tmp_path / "a.obj").write_bytes(text.encode() if isinstance(text, str) else text)
    if mtl is not None:
        (tmp_path / "a.mtl").write_text(mtl)
    return load(tmp_path / "a.obj")


def codes(scene: Scene) -> list[str]:
    return [problem.code for problem in scene.warnings]


def png(width: int = 1, height: int = 1, color: int = 2) -> bytes:
    """A whole PNG of zeros, colour type 0 grey, 2 RGB, 6 RGBA."""

    def chunk(name: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))

    rows = zlib.compress((b"\0" + bytes(width * {0: 1, 2: 3, 6: 4}[color])) * height)
    header = struct.pack(">IIBBBBB", width, height, 8, color, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", rows) + chunk(b"IEND", b"")


@pytest.mark.slow
@pytest.mark.parametrize(
    "name",
    [
        "obj/bunny",
        "obj/cornell_box",
        "obj/fish",
        "obj/koala",
        "obj/teapot",
        "obj/torus",
        "obj/wingnut",
        "sponza/sponza",
    ],
)
def test_asset_agrees_with_another_reader(shared: Path, name: str) -> None:
    trimesh = pytest.importorskip("trimesh")
    path = shared / "assets" / f"{name}.obj"
    ours = load(path)
    theirs = trimesh.load(path, process=False, force="scene", skip_materials=True)
    assert sum(len(mesh.indices) for mesh in ours.meshes) == sum(len(mesh.faces) for mesh in theirs.geometry.values())
    points = np.concatenate([mesh.positions for mesh in ours.meshes])
    assert np.allclose([points.min(axis=0), points.max(axis=0)], theirs.bounds, rtol=1e-5)
    area = 0.0
    for mesh in ours.meshes:
        a, b, c = (mesh.positions[mesh.indices[:, k]].astype(float) for k in range(3))
        area += float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)
        assert np.allclose(np.linalg.norm(mesh.normals, axis=1), 1, atol=1e-5)
    assert area == pytest.approx(sum(mesh.area for mesh in theirs.geometry.values()), rel=1e-4)


def test_cornell_box_has_its_objects_and_materials(shared: Path) -> None:
    scene = load(shared / "assets/obj/cornell_box.obj")
    assert [entry.name for entry in scene.objects][:4] == ["floor", "ceiling", "back_wall", "right_wall"]
    light = next(material for material in scene.materials if material.name == "light")
    assert light.emissive == (17, 12, 4)
    assert scene.warnings == ()


def test_shadow_scene_follows_the_naming_rule(shared: Path) -> None:
    scene = load(shared / "reference/b2_shadows/dir_basic/scene.obj")
    assert {entry.name for entry in scene.objects if not entry.casts_shadow} == {"groundNS"}


def test_sponza_is_read_fast(shared: Path) -> None:
    start = time.process_time()
    scene = load(shared / "assets/sponza/sponza.obj")
    assert time.process_time() - start < 20  # an attack takes minutes; a slow machine does not
    assert len(scene.materials) == 11
    leaf = next(material for material in scene.materials if material.name == "leaf")
    assert leaf.alpha_mode == "mask"
    assert {"base_color", "normal"} <= set(leaf.textures)


def test_faces_in_all_four_forms(tmp_path: Path) -> None:
    text = TRIANGLE + "vt 0 0.25\nvn 0 0 1\nf 1 2 3\nf 1/1 2/1 3/1\nf 1//1 2//1 3//1\nf 1/1/1 2/1/1 3/1/1\nf 1/ 2/ 3/\n"
    (mesh,) = read(tmp_path, text).meshes
    assert len(mesh.indices) == 5
    assert np.allclose(mesh.normals, (0, 0, 1))
    assert mesh.uv0 is not None
    assert set(map(tuple, mesh.uv0.tolist())) == {(0.0, 0.0), (0.0, 0.75)}, (
        "v is turned over; corners without one are 0"
    )


def test_negative_indices_count_from_their_own_line(tmp_path: Path) -> None:
    (mesh,) = read(tmp_path, TRIANGLE + "f -3 -2 -1\nv 5 5 5\nf -4 -3 -2\nf 1 2 -1\n").meshes
    corners = mesh.positions[mesh.indices]
    assert np.array_equal(corners[0], corners[1])
    assert np.array_equal(corners[2, 2], (5, 5, 5))


def test_bom_crlf_continuation_and_comments(tmp_path: Path) -> None:
    text = (
        b"\xef\xbb\xbf# head\r\nv 0 0 0 # one\r\nv 1 \\\r\n  0 0\r\n\tv 0 1 0\r\n\r\no \xd6bjekt#1\r\nf 1 2 \\\r\n3\r\n"
    )
    scene = read(tmp_path, text)
    assert [entry.name for entry in scene.objects] == ["Öbjekt#1"]
    assert scene.meshes[0].indices.shape == (1, 3)
    assert scene.warnings == ()


def test_lines_are_counted_through_continuations(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"a\.obj:5:1: RG305 index 9"):
        read(tmp_path, "v 0 0 \\\n0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n")


def test_names_may_be_any_bytes(tmp_path: Path) -> None:
    scene = read(tmp_path, TRIANGLE.encode() + b"o \xe9t\xe9\nf 1 2 3\n")
    assert scene.objects[0].name == "été"


def test_w_and_colors(tmp_path: Path) -> None:
    scene = read(tmp_path, "v 0 0 0 1\nv 1 0 0 1 0 0.5\nv 0 1 0 1 2 0 0\nf 1 2 3\n")
    (mesh,) = scene.meshes
    assert mesh.colors is not None
    assert {tuple(row) for row in mesh.colors.tolist()} == {(1, 1, 1, 1), (1, 0, 0.5, 1), (1, 0, 0, 1)}
    assert codes(scene) == ["RG332"], "a colour of 2 is clamped and said"


def test_objects_groups_and_materials_split(tmp_path: Path) -> None:
    text = TRIANGLE + "o A\ng x\nusemtl r\nf 1 2 3\nusemtl g\nf 1 2 3\ng y\nf 1 2 3\no B\nf 1 2 3\n"
    scene = read(tmp_path, "mtllib a.mtl\n" + text, "newmtl r\nnewmtl g\n")
    assert [entry.name for entry in scene.objects] == ["A/x", "A/x#1", "A/y", "B"]
    assert [scene.materials[entry.material].name for entry in scene.objects] == ["r", "g", "g", "g"]
    assert [entry.node for entry in scene.objects][:2] == ["A/x", "A/x"]


def test_names_that_cast_no_shadow(tmp_path: Path) -> None:
    scene = read(tmp_path, TRIANGLE + "o floorNS\nf 1 2 3\no ShadowPlaneNS\nf 1 2 3\no NSx\nf 1 2 3\n")
    assert [(entry.casts_shadow, entry.hidden) for entry in scene.objects] == [
        (False, False),
        (False, True),
        (True, False),
    ]


CUBE = """v -1 -1 -1\nv 1 -1 -1\nv 1 1 -1\nv -1 1 -1\nv -1 -1 1\nv 1 -1 1\nv 1 1 1\nv -1 1 1\n{}
f 4 3 2 1\nf 5 6 7 8\nf 1 2 6 5\nf 3 4 8 7\nf 2 3 7 6\nf 4 1 5 8\n"""


def test_missing_normals_are_the_mean_of_the_adjacent_faces(tmp_path: Path) -> None:
    (mesh,) = read(tmp_path, CUBE.format("")).meshes
    assert len(mesh.positions) == 8
    assert np.allclose(mesh.normals, mesh.positions / np.sqrt(3), atol=1e-6)


def test_smoothing_off_is_flat_and_groups_are_apart(tmp_path: Path) -> None:
    (mesh,) = read(tmp_path, CUBE.format("s off")).meshes
    assert len(mesh.positions) == 24
    assert np.abs(mesh.normals).max(axis=1).min() == 1
    roof = "v 0 0 0\nv 0 0 1\nv 1 1 0\nv 1 1 1\nv 2 0 0\nv 2 0 1\ns 1\nf 1 2 4 3\n{}\nf 3 4 6 5\n"
    ridge = {s: read(tmp_path, roof.format(s)).meshes[0] for s in ("s 1", "s 2")}
    assert len(ridge["s 1"].positions) == 6
    assert len(ridge["s 2"].positions) == 8
    top = ridge["s 1"].normals[ridge["s 1"].positions[:, 1] == 1]
    assert np.allclose(np.abs(top), (0, 1, 0), atol=1e-6)


def test_concave_polygons_are_cut_inside(tmp_path: Path) -> None:
    # An L and an arrowhead: a fan from the first corner would cover area outside.
    text = "v 0 0 0\nv 2 0 0\nv 2 1 0\nv 1 1 0\nv 1 2 0\nv 0 2 0\nv 0 0 5\nv 2 -1 5\nv 1 0 5\nv 2 1 5\n"
    text += "f 6 1 2 3 4 5\nf 8 9 10 7\n"
    scene = read(tmp_path, text)
    (mesh,) = scene.meshes
    a, b, c = (mesh.positions[mesh.indices[:, k]] for k in range(3))
    signed = np.cross(b - a, c - a)[:, 2] / 2
    assert len(signed) == 6
    assert np.abs(signed).sum() == pytest.approx(abs(signed.sum())), "none overlaps another"
    assert np.abs(signed[:4]).sum() == pytest.approx(3)
    assert np.abs(signed[4:]).sum() == pytest.approx(1)


def test_ears_of_random_star_polygons() -> None:
    rng = np.random.default_rng(3)
    for count in (5, 9, 40):
        angle = np.sort(rng.uniform(0, 2 * np.pi, count))
        radius = rng.uniform(0.2, 1, count)
        points = np.stack([radius * np.cos(angle), radius * np.sin(angle), np.full(count, 2.0)], axis=1)
        for axes in ([0, 1, 2], [2, 0, 1], [1, 2, 0]):
            turned = points[:, axes]
            triangles = clip_ears(turned)
            assert triangles.shape == (count - 2, 3)
            a, b, c = (turned[triangles[:, k]] for k in range(3))
            areas = np.cross(b - a, c - a) / 2
            whole = np.cross(turned, np.roll(turned, -1, axis=0)).sum(axis=0) / 2
            assert np.allclose(areas.sum(axis=0)[axes.index(2)], whole[axes.index(2)])
            assert (areas[:, axes.index(2)] >= -1e-12).all()


def test_triangulate_keeps_the_faces_order() -> None:
    positions = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [2, 0, 0]], float)
    places, owner = triangulate(positions, np.array([0, 1, 2, 3, 1, 4, 2, 0, 1, 2, 3]), np.array([4, 3, 4]))
    assert owner.tolist() == [0, 0, 1, 2, 2]
    assert places[2].tolist() == [4, 5, 6]


def test_materials(tmp_path: Path) -> None:
    (tmp_path / "d.png").write_bytes(png())
    (tmp_path / "with space.png").write_bytes(png(color=6))
    (tmp_path / "grey.png").write_bytes(png(color=0))
    mtl = """# two kinds
newmtl phong
Ka 0.1 0.1 0.1
Kd 0.2 0.3 0.7
Ks 0.4 0.4 0.4
Ns 12
d 0.5
map_Kd -s 2 3 1 -o 0.25 0.5 0 d.png
norm -bm 0.5 with space.png
bump grey.png
newmtl pbr
Kd 1 0 0
Pr 0.3
Pm 0.9
Ke 2 0 0
Tr 0.25
newmtl matt
Kd 1 1 1
Ks 1 1 1
illum 1
"""
    text = "mtllib a.mtl\n" + TRIANGLE + "".join(f"usemtl {name}\nf 1 2 3\n" for name in ("phong", "pbr", "matt"))
    scene = read(tmp_path, text, mtl)
    phong, pbr, matt = scene.materials
    assert (phong.ambient, phong.diffuse, phong.specular_phong, phong.shininess) == (
        (0.1, 0.1, 0.1),
        (0.2, 0.3, 0.7),
        (0.4, 0.4, 0.4),
        12,
    )
    assert phong.base_color == (0.2, 0.3, 0.7, 0.5)
    assert phong.alpha_mode == "blend"
    alpha = phong.roughness**2
    assert pytest.approx(2 / alpha**2 - 2) == 4 * 12, "4n = 2/α² - 2"
    assert phong.textures["base_color"].transform == (2, 0, 0.25, 0, 3, 1 - 3 - 0.5)
    assert phong.textures["base_color"].srgb
    assert phong.textures["normal"].image.path.name == "with space.png"
    assert phong.normal_scale == 0.5
    assert pbr.shininess is None
    assert (pbr.roughness, pbr.metallic, pbr.emissive) == (0.3, 0.9, (2, 0, 0))
    assert pbr.base_color == (1, 0, 0, 0.75)
    assert matt.specular_phong == (0, 0, 0), "illum 1 has no highlight"
    assert codes(scene) == ["RG333", "RG333"], "the height map, and no coordinates"
    assert "has no coordinates for its base_color texture" in str(scene.warnings[1])


@pytest.mark.parametrize(
    ("text", "code", "says"),
    [
        ("mtllib none.mtl\n", "RG330", "'none.mtl' cannot be read"),
        ("mtllib a.mtl\nusemtl nope\n", "RG330", "'nope' is in no material library"),
        ("usemtl nope\nf 1 2 3\nusemtl nothing\n", "RG330", "' is in no material library"),
        ("l 1 2\n", "RG333", "lines are left out"),
        ("xyz 1\n", "RG331", "'xyz' is left out"),
        ("f 1 1 2\n", "RG332", "1 triangles with a repeated corner"),
        ("vn 0 0 0\nf 1//1 2//1 3//1\n", "RG332", "1 normals of length zero"),
    ],
)
def test_what_is_left_out_is_said_once(tmp_path: Path, text: str, code: str, says: str) -> None:
    scene = read(tmp_path, TRIANGLE + text * 2 + "f 1 2 3\n", "newmtl m\n")
    assert codes(scene) == [code]
    assert says.replace("1 tri", "2 tri") in str(scene.warnings[0]).replace("2 normals", "1 normals")
    assert scene.objects


@pytest.mark.parametrize(
    ("mtl", "says"),
    [
        ("map_Kd gone.png", "'gone.png' cannot be read"),
        ("map_Kd C:\\textures\\gone.png", "cannot be read"),
        ("map_Kd a.obj", "has an unknown format"),
        ("Kd x", "no value that can be read"),
        ("Kd 2 0 0", "'Kd' outside 0 to 1 is clamped"),
        ("blah 1", "unknown statement 'blah'"),
        ("map_d d.png", "'map_d' of another image"),
    ],
)
def test_what_an_mtl_lacks_is_said(tmp_path: Path, mtl: str, says: str) -> None:
    (tmp_path / "d.png").write_bytes(png())
    scene = read(tmp_path, "mtllib a.mtl\nusemtl m\n" + TRIANGLE + "f 1 2 3\n", f"newmtl m\n{mtl}\n")
    assert len(scene.warnings) == 1
    assert says in str(scene.warnings[0])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("f 1 2 4\n", "RG305 index 4 is out of range; there are 3 vertices"),
        ("f 1 2 -4\n", "RG305 index -4 is out of range"),
        ("f 0 1 2\n", "RG305 index 0"),
        ("f 1/1 2/1 3/1\n", "RG305 index 1 is out of range; there are 0 texture coordinates"),
        ("f 1 2 99999999999999999999999\n", "RG30"),
        ("f 1 2\n", "RG304 'f': expected at least 3 corners, got 2"),
        ("f 1 2 x\n", "RG304 'x' is not a corner"),
        ("f 1 2 3/4/5/6\n", "RG304 '3/4/5/6' is not a corner"),
        ("f 1.5 2 3\n", "RG304 '1.5' is not a corner"),
        ("f /1 2 3\n", "RG304 '/1' is not a corner"),
        ("v 1 2\n", "RG304 'v': expected 3 to 7 numbers, got 2"),
        ("v 1 2 3 4 5\n", "RG304 .*got 5"),
        ("v 1 2 1,5\n", "RG304 '1,5' is not a number"),
        ("v 1 2 1-5\n", "RG304 '1-5' is not a number"),
        ("v 1 2 nan\n", "RG306 '1 2 nan' is not finite"),
        ("v 1 2 inf\n", "RG306"),
        ("v 1 2 1e39\n", "RG306"),
        ("v 1 2 1e999\n", "RG306"),
        ("vn 1 2\n", "RG304 'vn': expected 3 to 3"),
        ("vt x\n", "RG304 'x' is not a number"),
        ("mtllib ../../a.mtl\n", "RG302"),
    ],
)
def test_broken_file_is_one_clear_error(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(InputError, match=message) as error:
        read(tmp_path, TRIANGLE + "f 1 2 3\n" + text)
    (problem,) = error.value.problems
    assert problem.place is not None
    assert problem.place.line == 5


def test_map_outside_the_root_is_an_error(tmp_path: Path) -> None:
    inner = tmp_path / "inner"
    inner.mkdir()
    (tmp_path / "secret.png").write_bytes(png())
    (inner / "link.png").symlink_to(tmp_path / "secret.png")
    for name in ("../secret.png", "link.png"):
        with pytest.raises(InputError, match=r"a\.mtl:2:1: RG302"):
            read(inner, "mtllib a.mtl\n" + TRIANGLE + "f 1 2 3\n", f"newmtl m\nmap_Kd {name}\n")


def test_blocks_join_without_a_seam(tmp_path: Path) -> None:
    text = "".join(f"v {k} 0 0\nv {k} 1 0\nv {k} 0 1\nvt {k} 0\no n{k % 3}\nf -3/-1 -2/-1 -1/-1\n" for k in range(200))
    reading = Reading(tmp_path / "a.obj", inside(tmp_path))
    whole, parts = parse(text.encode(), reading), parse(text.encode(), reading, block_bytes=100)
    assert whole.names[0] == ["", "n0", "n1", "n2"]
    for field in ("positions", "uvs", "corners", "sizes", "lines", "states"):
        assert np.array_equal(getattr(whole, field), getattr(parts, field)), field
    assert whole.names == parts.names
    with pytest.raises(InputError, match=":1201:1: RG304 'y'"):
        parse(f"{text}v 0 0 y\n".encode(), reading, block_bytes=100)


def test_every_length_of_a_truncated_file_is_an_error_or_a_smaller_mesh(tmp_path: Path, shared: Path) -> None:
    whole = (shared / "assets/obj/cornell_box.obj").read_bytes()
    for length in range(0, len(whole), 13):
        problems: tuple[Problem, ...] = ()
        try:
            assert len(read(tmp_path, whole[:length], "newmtl white\n").objects) <= 8
        except InputError as error:
            problems = error.problems
        assert [problem.code for problem in problems] in ([], ["RG303"], ["RG304"], ["RG305"])


HOSTILE = {
    "unknown words": "".join(f"w{k} 1\n" for k in range(200_000)),
    "continuations": "v 0 0 0\n" + "\\\n" * 500_000,
    "libraries": "".join(f"mtllib {k}.mtl\n" for k in range(5_000)),
    "one long face": TRIANGLE + "f" + " 1 2 3" * 100_000 + "\n",
    "material changes": TRIANGLE + "".join(f"usemtl {k % 7}\nf 1 2 3\n" for k in range(50_000)),
    "objects": TRIANGLE + "".join(f"o {k}\nf 1 2 3\n" for k in range(20_000)),
    "bad last number": "v 1 2 3\n" * 300_000 + "v 1 2 z\n",
    "bad last corner": TRIANGLE + "f 1 2 3\n" * 200_000 + "f 1 2 z\n",
    "comments": "# x\n" * 300_000,
    "zeros": "\0" * 1_000_000,
    "carriage returns": "v 0 0 0\r" * 100_000,
}


@pytest.mark.slow
@pytest.mark.parametrize("case", HOSTILE)
@pytest.mark.nightly(keep=5)
def test_hostile_text_ends_soon(tmp_path: Path, case: str) -> None:
    start = time.process_time()
    problems: tuple[Problem, ...] = ()
    try:
        assert len(read(tmp_path, HOSTILE[case]).warnings) <= 50
    except InputError as error:
        problems = error.problems
    assert len(problems) <= 1
    assert time.process_time() - start < 20  # an attack takes minutes; a slow machine does not


@pytest.mark.parametrize(
    ("obj", "mtl", "says"),
    [
        ("mtllib gone.mtl", "", "'gone.mtl' cannot be read"),
        ("mtllib", "", "'' cannot be read"),
        ("mtllib folder", "", "'folder' cannot be read"),
        (f"mtllib {'a' * 300}.mtl", "", "…' cannot be read"),
        ("mtllib a.mtl", "map_Kd gone.png", "map 'gone.png' cannot be read"),
        ("mtllib a.mtl", "map_Kd", "map '' cannot be read"),
        ("mtllib a.mtl", "map_Kd folder", "map 'folder' cannot be read"),
    ],
)
@pytest.mark.parametrize("scene", ["a.obj", "a.yaml"])
def test_what_is_missing_under_the_root_rule_of_a_run_is_said(
    tmp_path: Path, scene: str, obj: str, mtl: str, says: str
) -> None:
    (tmp_path / "folder").mkdir()
    (tmp_path / "a.obj").write_text(f"{obj}\n{TRIANGLE}f 1 2 3\n")
    (tmp_path / "a.mtl").write_text(f"newmtl m\n{mtl}\n")
    (tmp_path / "a.yaml").write_text("scene: 1\nobjects: {o: {file: a.obj}}\n")
    (warning,) = rg.load("forward", scene=tmp_path / scene).link().warnings
    assert (warning.code, warning.severity) == ("RG330", "warning")
    assert says in warning.message
    (tmp_path / "a.obj").write_text("mtllib ../../secret.mtl\n" + TRIANGLE + "f 1 2 3\n")
    with pytest.raises(InputError, match="RG012"):
        rg.load("forward", scene=tmp_path / scene).link()


@pytest.mark.parametrize("number", ["3e38", "-2e12", "1e39", "nan"])
def test_what_single_precision_cannot_multiply_is_an_error(tmp_path: Path, number: str) -> None:
    with pytest.raises(InputError, match=rf"RG306 '{re.escape(number)} 0 0' is not finite, or beyond 1e\+12"):
        read(tmp_path, f"v {number} 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
