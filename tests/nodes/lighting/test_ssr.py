"""Screen-space reflections against a mirror's geometry and against traced reflections."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt
import OpenImageIO as oiio

import rendergraph as rg

Floats = npt.NDArray[np.float64]

WALLS = """scene: 1
objects:
  floor: {shape: plane, size: [30, 30], material: mirror}
  left: {shape: plane, size: [2, 2], rotate_degrees: [90, 0, 0], at: [-1, 1, -2], material: bright}
  right: {shape: plane, size: [2, 2], rotate_degrees: [90, 0, 0], at: [1, 1, -2], material: dim}
materials:
  mirror: {base_color: [0.8, 0.8, 0.8], metallic: 1, roughness: 0}
  bright: {base_color: [1, 1, 1], unlit: true}
  dim: {base_color: [0.5, 0.5, 0.5], unlit: true}
lights: {none: {type: directional, direction: [0, -1, 0], intensity: 0}}
environment: {file: around.exr}
cameras: {main: {eye: [0, 1, 3], target: [0, 1, 0], fov_y_degrees: 80, near: 0.1, far: 60}}
"""


def walls(folder: Path, text: str, around: float) -> Path:
    """The scene, in an environment of constant radiance."""
    image = oiio.ImageBuf(oiio.ImageSpec(16, 8, 3, oiio.FLOAT))
    oiio.ImageBufAlgo.fill(image, (around,) * 3)
    image.write(str(folder / "around.exr"))
    (folder / "walls.yaml").write_text(text)
    return folder / "walls.yaml"


def draw(session: rg.Session, scene: Path | str, *sets: str, size: tuple[int, int], pipeline: str = "ssr") -> Floats:
    loaded = rg.load(pipeline, scene=scene, size=size, sets=sets)
    return np.asarray(session.render(loaded, outputs=["radiance"])["radiance"], np.float64)[..., :3]


def test_a_floor_mirrors_the_walls_that_the_picture_shows(session: rg.Session, tmp_path: Path) -> None:
    """A ray from the eye, mirrored at y = 0, meets z = -2 at a known place; elsewhere the floor shows the environment."""
    width, height = 160, 120
    scene, sets = (
        walls(tmp_path, WALLS, 0.25),
        ("mirror.fade=0", "mirror.reach=1000", "mirror.steps=256", "gbuffer.precision=full"),
    )
    found = draw(session, scene, *sets, size=(width, height))[..., 0]
    lit = rg.load("deferred", scene=scene, size=(width, height), sets=["gbuffer.precision=full"])
    albedo = session.render(lit, outputs=(), taps=["light.specular_albedo"])["light.specular_albedo"][..., 0]
    x, y = np.meshgrid((np.arange(width) + 0.5) / width * 2 - 1, 1 - (np.arange(height) + 0.5) / height * 2)
    tangent = np.tan(np.radians(40))
    ray = np.stack([x * tangent * width / height, y * tangent, np.full_like(x, -1.0)], axis=-1)
    with np.errstate(divide="ignore", invalid="ignore"):
        floor = -ray / ray[..., 1:2] + (0, 1, 3)  # where it meets the floor
    is_floor = (y < 0) & (floor[..., 2] > -1.95)
    wall = floor + ray * (1, -1, 1) * (floor[..., 2] + 2)[..., None]
    on_wall = (np.abs(wall[..., 0]) < 1.9) & (wall[..., 1] < 1.9) & (np.abs(wall[..., 0]) > 0.06)
    expected = albedo * np.where(wall[..., 0] < 0, 1.0, 0.5)
    judged = is_floor & on_wall
    assert judged.mean() > 0.05
    off = np.abs(found - expected)[judged]
    assert np.median(off) < 2e-3
    assert (off > 0.01).mean() < 0.02  # at the foot of the walls
    beside = is_floor & ((np.abs(wall[..., 0]) > 2.1) | (wall[..., 1] > 2.1))
    np.testing.assert_allclose(found[beside], 0.25 * albedo[beside], rtol=4e-3)


def test_what_is_as_bright_as_the_environment_changes_nothing(session: rg.Session, tmp_path: Path) -> None:
    """The environment's reflection is replaced, and not added to."""
    scene = walls(tmp_path, WALLS.replace("[0.5, 0.5, 0.5]", "[1, 1, 1]"), 1)
    pictures = [draw(session, scene, size=(64, 48), pipeline=name) for name in ("ssr", "deferred")]
    np.testing.assert_allclose(pictures[0], pictures[1], atol=2e-3)


HALL = """scene: 1
objects:
  floor: {shape: plane, size: [12, 12], material: floor}
  knot: {shape: torus_knot, radius: 0.6, tube: 0.18, at: [-0.9, 0.95, 0], material: red}
  box: {shape: box, size: [0.8, 1.4, 0.8], at: [0.9, 0.7, -0.4], rotate_degrees: [0, 25, 0], material: green}
materials:
  floor: {base_color: [0.9, 0.9, 0.9], metallic: 1, roughness: 0.1}
  red: {base_color: [0.7, 0.1, 0.08], roughness: 0.8}
  green: {base_color: [0.1, 0.5, 0.2], roughness: 0.8}
environment: {file: studio}
cameras: {main: {eye: [0.5, 1.5, 5], target: [0, 0.6, 0], fov_y_degrees: 40}}
"""


def test_reflections_are_nearer_to_traced_ones_than_the_environment_is(session: rg.Session, tmp_path: Path) -> None:
    (tmp_path / "hall.yaml").write_text(HALL)
    patch = {
        "nodes": {
            "mirror": {"type": "traced_reflections", "inputs": {"depth": "gbuffer.depth", "normal": "gbuffer.normal"}},
            "light": {"inputs": {"reflections": "mirror.reflections"}},
        }
    }
    traced = rg.load(
        "deferred", scene=tmp_path / "hall.yaml", size=(160, 90), patches=[patch], sets=["mirror.samples=16"]
    )
    truth = np.asarray(session.render(traced, outputs=["radiance"])["radiance"], np.float64)[..., :3]
    found, plain = (
        draw(session, tmp_path / "hall.yaml", size=(160, 90), pipeline=name) for name in ("ssr", "deferred")
    )
    changed = np.abs(found - plain).max(axis=-1) > 0.01
    assert changed.mean() > 0.03
    assert np.abs(found - truth)[changed].mean() < 0.5 * np.abs(plain - truth)[changed].mean()
