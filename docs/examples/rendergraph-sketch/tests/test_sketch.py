"""Pictures with known answers, and STL files against another reader."""

from __future__ import annotations

import importlib.util
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rendergraph_sketch.stl import read_stl

import rendergraph as rg

SCENES = Path(__file__).parents[1] / "scenes"
BALL = """scene: 1
objects: {ball: {shape: sphere, radius: 0.5, material: grey, segments: 128}}
materials: {grey: {base_color: [0.5, 0.25, 0.125], roughness: 0.5}}
lights: {sun: {type: directional, direction: [-1, -2, -2], intensity: 2}}
cameras: {main: {eye: [0, 0, 3], height: 2}}
"""
SIZE = (128, 128)


@pytest.fixture(scope="session")
def gl() -> Iterator[rg.Session]:
    with rg.Session() as session:
        yield session


@pytest.fixture
def ball(tmp_path: Path) -> Path:
    path = tmp_path / "ball.yaml"
    path.write_text(BALL)
    return path


def drawn(gl: rg.Session, scene: Path, *sets: str, taps: tuple[str, ...] = ()) -> rg.Frame:
    pipeline = rg.load(SCENES / "sketch.yaml", scene=scene, size=SIZE, sets=("light.ambient=0", *sets))
    return gl.render(pipeline, taps=taps)


@pytest.mark.parametrize("width", [2, 6])
def test_a_ball_gets_a_ring_of_ink(gl: rg.Session, ball: Path, width: int) -> None:
    frame = drawn(gl, ball, f"outline.width={width}", "outline.crease=180", taps=("outline.inked", "light.radiance"))
    inked = np.abs(frame["outline.inked"] - frame["light.radiance"])[..., :3].max(axis=-1) > 1e-3
    y, x = np.nonzero(inked)
    away = np.hypot(x + 0.5 - 64, y + 0.5 - 64) - 32  # the ball is 32 pixels in radius
    assert np.abs(away).max() < 0.5 * width + 1
    assert len(np.unique(np.round(np.degrees(np.arctan2(y - 63.5, x - 63.5))))) > 170
    assert inked.sum() == pytest.approx(2 * np.pi * 32 * width, rel=0.35)


def test_an_edge_of_a_box_is_inked_where_it_bends_enough(gl: rg.Session, tmp_path: Path) -> None:
    scene = tmp_path / "box.yaml"
    scene.write_text(
        "scene: 1\nobjects: {box: {shape: box, rotate_degrees: [0, 45, 0]}}\n"
        "cameras: {main: {eye: [0, 0, 3], height: 1}}\n"
    )

    def ink(crease: int) -> Any:
        frame = drawn(gl, scene, f"outline.crease={crease}", taps=("outline.inked", "light.radiance"))
        return np.abs(frame["outline.inked"] - frame["light.radiance"])[60, 32:96, :3].max(axis=-1) > 1e-3

    # From the middle of the picture the edge between two faces, 90 degrees, and nothing else.
    assert not ink(91).any()
    assert set(np.flatnonzero(ink(89))) == {31, 32}


def test_toon_is_three_tones_of_the_colour(gl: rg.Session, ball: Path) -> None:
    settings = ("gbuffer.precision=full", "light.terms=diffuse", "shadows.type=shadow_pcf", "sun.resolution=512")
    frame = drawn(gl, ball, *settings, taps=("gbuffer.normal", "light.radiance"))
    normal, light = frame["gbuffer.normal"][..., :3].astype(float), frame["light.radiance"][..., :3]
    n_l = normal @ (np.array([1, 2, 2]) / 3)
    inner = (np.abs(normal).sum(axis=-1) > 0) & (np.abs(n_l) > 0.1)  # at the terminator the ball shadows itself

    def smooth(low: float, high: float) -> Any:
        t = np.clip((n_l - low) / (high - low), 0, 1)
        return t * t * (3 - 2 * t)

    tone = 0.35 * smooth(0, 0.02) + 0.35 * smooth(0.3, 0.32) + 0.3 * smooth(0.65, 0.67)
    expected = 2 * tone[..., None] * [0.5, 0.25, 0.125]
    np.testing.assert_allclose(light[inner], expected[inner], atol=4e-3)
    assert len(np.unique(np.round(light[inner][:, 0], 2))) >= 4


def test_forward_and_deferred_draw_the_same_toon(gl: rg.Session, ball: Path) -> None:
    pictures = [
        gl.render(rg.load(name, scene=ball, size=SIZE).set("light.shading", "toon"))["image"].astype(int)
        for name in ("forward", "deferred")
    ]
    assert (np.abs(pictures[0] - pictures[1]).max(axis=-1) > 4).mean() < 0.01


# --- STL -------------------------------------------------------------------------------------------------------------


def test_both_kinds_of_stl_are_what_another_reader_reads(tmp_path: Path) -> None:
    trimesh = pytest.importorskip("trimesh")
    solid = trimesh.creation.icosphere(subdivisions=2, radius=3)
    for kind in ("stl", "stl_ascii"):
        path = tmp_path / f"{kind}.stl"
        solid.export(path, file_type=kind)
        mine, theirs = read_stl(path), trimesh.load_mesh(path, process=False)
        corners = np.asarray(mine.positions)[np.asarray(mine.indices)]
        np.testing.assert_allclose(corners, theirs.triangles, rtol=1e-6, atol=1e-7)
        assert len(corners) == 320


def test_a_binary_file_may_begin_with_solid(tmp_path: Path) -> None:
    data = (SCENES / "gear.stl").read_bytes()
    (tmp_path / "a.stl").write_bytes(b"solid gear".ljust(80) + data[80:])
    np.testing.assert_array_equal(read_stl(tmp_path / "a.stl").positions, read_stl(SCENES / "gear.stl").positions)


@pytest.mark.parametrize(
    ("data", "said"),
    [
        (b"", "a binary STL at least 84"),
        (b"\0" * 80 + b"\2\0\0\0" + b"\0" * 60, "cut short: 2 triangles take 184 bytes, it has 144"),
        (b"solid x\n facet normal 0 0 1\n outer loop\n vertex 0 0 0\n", "there is no 'endsolid'"),
        (b"solid x\nvertex 0 0 0\nvertex 1 0 0\nendfacet\nendsolid x\n", "2 corners in 1 facets"),
        (b"solid x\nvertex 0 0 zero\nvertex 1 0 0\nvertex 1 1 0\nendfacet\nendsolid\n", "could not convert"),
    ],
)
def test_broken_files_are_refused(tmp_path: Path, data: bytes, said: str) -> None:
    path = tmp_path / "broken.stl"
    path.write_bytes(data)
    with pytest.raises(ValueError, match=said):
        read_stl(path)
    with pytest.raises(rg.RendergraphError, match=r"stl\.py:\d+:1: RG497 mesh 'broken\.stl' cannot be read: .*sketch"):
        rg.load("forward", scene=path).check()


def test_the_gear_is_what_its_program_writes() -> None:
    spec = importlib.util.spec_from_file_location("gear", SCENES / "gear.py")
    assert spec is not None
    assert spec.loader is not None
    gear: Any = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(gear)
    corners = gear.triangles()
    assert (SCENES / "gear.stl").read_bytes() == gear.stl(corners)
    volume = np.einsum("ij,ij->i", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])).sum() / 6
    assert 2 * 5 * np.pi * (22**2 - 8**2) < volume < 2 * 5 * np.pi * (28**2 - 8**2)  # closed, and not inside out


def test_the_pipeline_draws_gears_with_lines(gl: rg.Session) -> None:
    frame = gl.render(rg.load(SCENES / "sketch.yaml", size=(160, 90)))
    image = frame["image"][..., :3].astype(int)
    assert (image.max(axis=-1) < 60).mean() > 0.03  # ink
    assert ((image[..., 2] > 1.15 * image[..., 0]) & (image[..., 2] > 90)).mean() > 0.05  # the blue gear
