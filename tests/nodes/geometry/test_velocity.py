"""How far surfaces have moved, against matrices of two moments in float64."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import rendergraph as rg
from rendergraph.scene import animate
from rendergraph.scene.cameras import view_matrices

SIZE = (48, 32)
CAMERAS = {
    "perspective": "fov_y_degrees: 40, near: 0.1, far: 60",
    "off centre": "frustum: [-0.05, 0.03, -0.03, 0.02], near: 0.1, far: 60",
    "orthographic": "height: 4, near: 0.1, far: 60",
    "infinite": "fov_y_degrees: 40, near: 0.1, far: .inf",
}
SCENE = """scene: 1
objects: {{box: {{shape: box, size: [2, 2, 2]}}}}
cameras: {{main: {{eye: [1, 2, 5], target: [0, 0, 0], {camera}}}}}
keyframes:
  objects.box.at: {{0: [0, 0, 0], 1: [3, 1, -2]}}
  objects.box.rotate_degrees: {{0: [0, 0, 0], 1: [0, 120, 40]}}
  objects.box.scale: {{0: 1, 1: 1.5}}
orbit: {{degrees_per_second: 40}}
"""
JITTERED = """rendergraph: 1
size: [48, 32]
nodes:
  gbuffer: {type: gbuffer, params: {precision: full}}
  prepass: {type: depth_prepass}
  environment: {type: environment_light}
  light: {type: deferred_lighting, inputs: {gbuffer: gbuffer, environment: environment.light}}
  display: {type: tonemap, inputs: {radiance: light.radiance}}
  aa: {type: taa, inputs: {source: display.color, depth: gbuffer.depth, velocity: gbuffer.velocity}}
outputs: {image: aa.color, velocity: gbuffer.velocity, before: prepass.velocity, depth: gbuffer.depth}
"""


@pytest.fixture
def moving(tmp_path: Path) -> Any:
    def made(camera: str) -> rg.Pipeline:
        (tmp_path / "scene.yaml").write_text(SCENE.format(camera=CAMERAS[camera]))
        (tmp_path / "moving.yaml").write_text(JITTERED)
        return rg.load(tmp_path / "moving.yaml", scene=tmp_path / "scene.yaml")

    return made


@pytest.mark.parametrize("camera", CAMERAS)
def test_surfaces_and_camera_that_move(session: rg.Session, moving: Any, camera: str) -> None:
    """Every pixel's point, taken back to the object, along with it, and into the picture of the frame before."""
    pipeline = moving(camera)
    frames = list(session.frames(pipeline, frames=range(1, 4), outputs=["velocity", "before", "depth", "image"]))
    assert not frames[0]["velocity"].any()
    frame = frames[-1]
    scene = pipeline.link().scene
    now, then = (animate.at(scene, number / 30) for number in (2, 1))
    seen, last = (view_matrices(one.cameras["main"], SIZE) for one in (now, then))
    height, width = SIZE[::-1]
    depth = frame["depth"][..., 0].astype(np.float64)
    y, x = np.nonzero(depth)
    assert len(x) > 100
    # The picture was moved by the third of the places that frames are taken at, from the 1897th of the sequence on.
    jitter = np.array([(halton(1899, 2), halton(1899, 3))])
    place = np.stack([x + 0.5, height - y - 0.5], axis=1) - jitter
    ndc = np.column_stack([place / SIZE * 2 - 1, 1 - 2 * depth[y, x], np.ones(len(x))])
    world = ndc @ np.linalg.inv(seen.projection @ seen.view).T
    world /= world[:, 3:]
    matrix = then.objects[0].transform @ np.linalg.inv(now.objects[0].transform)
    before = world @ matrix.T @ (last.projection @ last.view).T
    expected = (ndc[:, :2] - before[:, :2] / before[:, 3:]) / 2
    assert np.abs(expected).max() * width > 1
    for name in ("velocity", "before"):
        found = frame[name][y, x, :2]
        assert np.abs((found - expected) * SIZE).max() < 0.02, name  # pixels
    assert not frame["velocity"][depth == 0].any()


def halton(index: int, base: int) -> float:
    """Digits behind the point, from the last to the first."""
    digits = np.base_repr(index, base)[::-1]
    return int(digits, base) / float(base ** len(digits)) - 0.5


@pytest.mark.parametrize("view", ["guard_band", "hemicube"])
def test_a_wider_view_knows_how_far_it_is_jittered(session: rg.Session, view: str) -> None:
    """Nothing moves, while the camera's picture does: by as many texels in a band, and not at all in a hemicube."""
    nodes = {
        "view": {"type": view},
        "seen": {"type": "gbuffer", "inputs": {"view": "view.view" if view == "guard_band" else "view.front"}},
    }
    patch = {"nodes": nodes, "outputs": {"velocity": "seen.velocity"}}
    pipeline = rg.load("taa", size=SIZE, patches=[patch])
    for frame in session.frames(pipeline, frames=range(1, 4), outputs=["velocity", "image"]):
        assert np.abs(frame["velocity"]).max() < 3e-6  # of the picture; it is moved by up to 1e-2


def test_a_cropped_velocity_is_that_of_the_picture(session: rg.Session, moving: Any) -> None:
    nodes = {
        "band": {"type": "guard_band"},
        "wide": {"type": "gbuffer", "inputs": {"view": "band.view"}},
        "small": {"type": "crop", "inputs": {"source": "wide.velocity"}},
    }
    pipeline = moving("perspective").patch({"nodes": nodes, "outputs": {"cropped": "small.cropped"}})
    frame = session.render(pipeline, frames=range(3, 4), outputs=["velocity", "cropped", "image"])
    velocity, cropped = frame["velocity"], frame["cropped"]
    drawn = velocity.any(axis=-1) & cropped.any(axis=-1)  # at borders of surfaces one of them may miss
    assert drawn.sum() > 100
    assert np.abs(velocity).max() * SIZE[0] > 1
    np.testing.assert_allclose(cropped[drawn], velocity[drawn], rtol=5e-3, atol=2e-5)


def test_who_reads_none_pays_for_none(session: rg.Session) -> None:
    plan = rg.load("deferred", size=SIZE).plan()
    assert "gbuffer.velocity" not in plan.resources
    with session.current():
        assert not session.compile(rg.load("deferred", size=SIZE)).executable.uses_previous
