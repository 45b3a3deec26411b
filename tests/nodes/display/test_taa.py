"""Edges from many frames: what stands still becomes the supersampled picture, and what moves leaves nothing behind."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import rendergraph as rg


def light(picture: Any) -> Any:
    """What a display makes of bytes."""
    c = picture[..., :3] / 255
    return np.where(c > 0.04045, ((c + 0.055) / 1.055) ** 2.4, c / 12.92)


def rmse(a: Any, b: Any) -> float:
    return float(np.sqrt(((a - b) ** 2).mean()))


def drawn(session: rg.Session, pipeline: rg.Pipeline, frame: int = 1) -> Any:
    return session.render(pipeline, outputs=["image"], frames=range(frame, frame + 1))["image"]


def supersampled(session: rg.Session, pipeline: rg.Pipeline, size: tuple[int, int], times: int, frame: int = 1) -> Any:
    width, height = size
    fine = light(drawn(session, pipeline.with_size((width * times, height * times)), frame))
    return fine.reshape(height, times, width, times, 3).mean(axis=(1, 3))


def test_one_frame_is_the_picture_as_it_is(session: rg.Session) -> None:
    plain, smooth = (drawn(session, rg.load(name, scene="stairs", size=(80, 45))) for name in ("deferred", "taa"))
    np.testing.assert_array_equal(smooth, plain)


@pytest.mark.nightly(keep=1)
@pytest.mark.slow
@pytest.mark.parametrize("scene", ["cornell_box", "spheres"])
def test_sixteen_still_frames_are_a_supersampled_picture(session: rg.Session, scene: str) -> None:
    """Of scenes without images, which more pixels would show in finer levels, lit by their lights alone."""
    size = (160, 90)
    exact = supersampled(session, rg.load("deferred", scene=scene, environment="none"), size, 8)
    pipeline = rg.load("taa", scene=scene, size=size, environment="none")
    found = [light(drawn(session, pipeline, frame)) for frame in (1, 16)]
    assert rmse(found[0], exact) > 0.018
    assert rmse(found[1], exact) < 0.005


BALL = """scene: 1
objects:
  wall: {shape: box, size: [40, 40, 1], at: [0, 0, -3], material: grey}
  post: {shape: box, size: [0.3, 4, 0.3], at: [1, 0, -1], rotate_degrees: [0, 0, 25], material: blue}
  ball: {shape: sphere, radius: 0.7, at: [-1.5, 0, 0], material: white}
materials:
  grey: {base_color: [0.1, 0.12, 0.1]}
  blue: {base_color: [0.1, 0.2, 0.7]}
  white: {base_color: [1, 0.9, 0.8]}
lights: {sun: {type: directional, direction: [-1, -2, -1]}}
cameras: {main: {eye: [0, 0, 6], target: [0, 0, 0], CAMERA}}
"""
MOVING = BALL + "keyframes: {objects.ball.at: {0: [-1.5, 0, 0], 0.4: [1.5, 0, 0]}}\n"
ORBIT = BALL + "orbit: {degrees_per_second: 45}\n"
CAMERAS = {
    "perspective": "fov_y_degrees: 40, near: 0.1, far: 60",
    "off centre": "frustum: [-0.05, 0.03, -0.03, 0.02], near: 0.1, far: 60",
    "orthographic": "height: 4, near: 0.1, far: 60",
    "infinite": "fov_y_degrees: 40, near: 0.1, far: .inf",
}


def with_scene(folder: Path, text: str, size: tuple[int, int], camera: str = "perspective") -> rg.Pipeline:
    (folder / "scene.yaml").write_text(text.replace("CAMERA", CAMERAS[camera]))
    return rg.load("taa", scene=folder / "scene.yaml", size=size).set("light.shading", "unlit")


def test_what_moves_leaves_nothing_behind(session: rg.Session, tmp_path: Path) -> None:
    """A white ball over a dark wall: where it is no more the wall is as it was, and its own edge is smooth."""
    size = (96, 64)
    pipeline = with_scene(tmp_path, MOVING, size)
    plain = pipeline.set("aa.enabled", False)
    exact, hard, found = (
        supersampled(session, plain, size, 4, frame=8),
        light(drawn(session, plain, 8)),
        light(drawn(session, pipeline, 8)),
    )
    ball = exact[..., 0] > 0.15
    near = np.zeros_like(ball)
    for y in range(-2, 3):
        for x in range(-2, 3):
            near |= np.roll(ball, (y, x), axis=(0, 1))
    edges = np.abs(exact - hard).max(axis=-1) > 0.02
    assert (near & edges).sum() > 30
    assert (~near & ~edges).sum() > 2000
    assert np.abs(found - exact)[~near & ~edges].max() < 0.015
    assert rmse(found[near & edges], exact[near & edges]) < 0.8 * rmse(hard[near & edges], exact[near & edges])


@pytest.mark.parametrize("camera", CAMERAS)
def test_a_camera_that_turns(session: rg.Session, tmp_path: Path, camera: str) -> None:
    """Nearer to more pixels than one sample is; the camera's movement alone, taken from depth, does as well."""
    size = (96, 64)
    pipeline = with_scene(tmp_path, ORBIT, size, camera)
    plain = pipeline.set("aa.enabled", False)
    exact = supersampled(session, plain, size, 4, frame=8)
    hard, found, from_depth = (
        light(drawn(session, one, 8)) for one in (plain, pipeline, pipeline.set("aa.velocity", None))
    )
    assert rmse(found, exact) < 0.93 * rmse(hard, exact)
    assert rmse(from_depth, found) < 0.02 * rmse(hard, exact)


def test_a_sharp_look_up_does_not_ring(session: rg.Session, tmp_path: Path) -> None:
    """Of frames that hold nothing but the ball's and the wall's light no mean is brighter or darker than both."""
    pipeline = with_scene(tmp_path, ORBIT, (96, 64)).set("aa.tolerance", 16.0)
    frames = list(session.frames(pipeline, frames=range(1, 9), taps=["aa.history"]))
    shown = [light(frame["image"]) for frame in session.frames(pipeline.set("aa.enabled", False), frames=range(1, 9))]
    least, most = np.min(shown), np.max(shown)
    gathered = np.stack([frame["aa.history"][..., :3] for frame in frames])
    assert gathered.min() > least - 0.003  # half floats, and the display's dither
    assert gathered.max() < most + 0.003


def test_in_the_place_of_another(session: rg.Session) -> None:
    """Swapped for `fxaa` or taken out, nothing is left of it: the camera's picture stands still."""
    pipeline = rg.load("taa", scene="stairs", size=(80, 45))
    swapped = pipeline.set("aa.type", "fxaa")
    np.testing.assert_array_equal(drawn(session, swapped, 5), drawn(session, swapped, 1))
    out, plain = pipeline.set("aa.enabled", False), rg.load("deferred", scene="stairs", size=(80, 45))
    np.testing.assert_array_equal(drawn(session, out, 5), drawn(session, plain))
