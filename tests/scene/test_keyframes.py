"""Keyframes that ease, turn about one axis, drive parameters of nodes, and cameras that follow."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from msgspec.structs import replace

import rendergraph as rg
from rendergraph.errors import InputError, RendergraphError
from rendergraph.scene import animate
from rendergraph.scene.cameras import view_matrices
from rendergraph.scene.geometry import euler_matrix
from rendergraph.scene.load import load
from rendergraph.scene.model import Scene
from rendergraph.scene.rig import quaternion

TIMES = (-1.0, 0.0, 0.3, 1.0, 1.7, 2.0, 2.9, 3.0, 9.0)


def read(folder: Path, text: str) -> Scene:
    (folder / "scene.yaml").write_text("scene: 1\n" + text)
    return load(folder / "scene.yaml")


def share(ease: str, t: float) -> float:
    return {"linear": t, "smooth": 3 * t**2 - 2 * t**3, "step": 0.0 if t < 1 else 1.0}[ease]


@pytest.mark.parametrize("ease", ["linear", "smooth", "step"])
def test_easing_between_two_keys(tmp_path: Path, ease: str) -> None:
    """Closed forms, in each interval by itself, for vectors and numbers; held outside."""
    keys = f"{{0: [1, 2, 3], 2: [5, 2, -1], 3: [0, 0, 0], ease: {ease}}}"
    numbers = f"{{3: 10, 0: 4, 2: 6, ease: {ease}}}"
    scene = read(
        tmp_path,
        f"objects: {{b: {{shape: box}}}}\nlights: {{l: {{type: point}}}}\n"
        f"keyframes: {{objects.b.at: {keys}, lights.l.intensity: {numbers}}}",
    )
    for time in TIMES:
        first, last, t = (0, 1, time / 2) if time < 2 else (1, 2, time - 2)
        s = share(ease, min(max(t, 0.0), 1.0))
        at = np.array([(1, 2, 3), (5, 2, -1), (0, 0, 0)], float)
        number = np.array([4.0, 6, 10])
        moment = animate.at(scene, time)
        np.testing.assert_allclose(
            moment.objects[0].transform[:3, 3], at[first] + s * (at[last] - at[first]), atol=1e-12
        )
        assert math.isclose(moment.lights[0].intensity, number[first] + s * (number[last] - number[first]))


def rotation_between(a: Any, b: Any, t: float) -> Any:
    """The rotation from one matrix to another about the one axis of both, by the share t of its angle (Rodrigues)."""
    between = b @ a.T
    angle = math.acos(np.clip((np.trace(between) - 1) / 2, -1, 1))
    axis = np.array([between[2, 1] - between[1, 2], between[0, 2] - between[2, 0], between[1, 0] - between[0, 1]])
    x, y, z = axis / np.linalg.norm(axis)
    k = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return (np.eye(3) + math.sin(t * angle) * k + (1 - math.cos(t * angle)) * k @ k) @ a


@pytest.mark.parametrize("ease", ["linear", "smooth"])
def test_slerp_turns_about_one_axis(tmp_path: Path, ease: str) -> None:
    """Against the axis and angle of two matrices, the shorter way round; scale and position go along."""
    angles = [(10, 20, 30), (80, -50, 200)]
    keys = f"{{0: {list(angles[0])}, 2: {list(angles[1])}, slerp: true, ease: {ease}}}"
    scene = read(
        tmp_path,
        "objects: {b: {shape: box, at: [1, 2, 3], scale: [2, 3, 4]}}\n"
        f"keyframes: {{objects.b.rotate_degrees: {keys}}}",
    )
    a, b = map(euler_matrix, angles)
    for time in (-1.0, 0.0, 0.25, 1.0, 1.9, 2.0, 5.0):
        expected = rotation_between(a, b, share(ease, min(max(time / 2, 0), 1)))
        transform = animate.at(scene, time).objects[0].transform
        np.testing.assert_allclose(transform[:3, :3], expected * [2, 3, 4], atol=1e-12)
        np.testing.assert_allclose(transform[:3, 3], [1, 2, 3])


def test_quaternions_are_the_rotations_of_scene_files() -> None:
    for angles in np.random.default_rng(1).uniform(-360, 360, (20, 3)):
        x, y, z, w = quaternion(angles)
        vector = np.array([x, y, z])
        k = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
        matrix = (w * w - vector @ vector) * np.eye(3) + 2 * np.outer(vector, vector) + 2 * w * k
        np.testing.assert_allclose(matrix, euler_matrix(angles), atol=1e-12)


FOLLOWING = """objects:
  ball: {shape: sphere, radius: 0.5, at: [0, 1, 0], repeat: {line: 2, step: [0, 0, -3]}}
  box: {shape: box, at: [-2, 0.5, 0]}
cameras:
  main: {eye: [0, 2, 8], follow: FOLLOWED, fov_y_degrees: 40}
keyframes:
  objects.box.at: {0: [-2, 0.5, 0], 1: [2, 1.5, 1]}
  objects.ball.at: {0: [0, 1, 0], 1: [3, 1, 0]}
  cameras.main.eye: {0: [0, 2, 8], 1: [1, 3, 8]}
"""


@pytest.mark.parametrize(
    ("name", "to"),
    [("box", ((-2, 0.5, 0), (0, 1, 0.5), (2, 1.5, 1))), ("ball.1", ((0, 1, -3), (1.5, 1, -3), (3, 1, -3)))],
)
def test_a_camera_follows_an_object(tmp_path: Path, name: str, to: tuple[tuple[float, ...], ...]) -> None:
    """The middle of the object is the middle of the picture, at any time and from wherever the camera is."""
    scene = animate.complete(read(tmp_path, FOLLOWING.replace("FOLLOWED", name)))
    for time, point in zip((0, 0.5, 1), to, strict=True):
        camera = (animate.at(scene, time) if time else scene).camera
        assert camera is not None
        np.testing.assert_allclose(camera.transform[:3, 3], [time, 2 + time, 8], atol=1e-12)
        view = view_matrices(camera, (160, 90))
        x, y, _, w = view.projection @ view.view @ np.append(point, 1.0)
        np.testing.assert_allclose([x / w, y / w], 0, atol=1e-9)


def test_a_camera_follows_a_skinned_animal() -> None:
    """Its skin moves with the walk, but the picture does not sway with every step."""
    scene = rg.load("forward", scene="salamander").link().scene
    scene = animate.complete(scene)
    recipe = {**scene.recipe, ("cameras", "main"): {"eye": (1, 1, 1), "follow": "salamander"}}
    index = next(n for n, placed in enumerate(scene.objects) if placed.name.startswith("salamander"))
    scene = replace(scene, recipe=recipe, follows={"main": (index,)})
    targets = np.array([animate.at(scene, time).cameras["main"].target for time in np.linspace(0, 4.8, 25)])
    straight = targets[:1] + (targets[-1:] - targets[:1]) * np.linspace(0, 1, 25)[:, None]
    np.testing.assert_allclose(targets[-1] - targets[0], [0, 0, 1.5], atol=1e-6)
    assert np.abs(targets - straight).max() < 0.07  # of a length of 1.4


@pytest.mark.parametrize(
    ("text", "message"),
    {
        "objects.b.at: {0: [0, 0, 0], ease: bouncy}": "'ease': expected one of linear, smooth, step, got 'bouncy'",
        "objects.b.at: {0: [0, 0, 0], slerp: true}": "'slerp' is for the 'rotate_degrees' of objects",
        "objects.b.at: {ease: smooth}": "keyframes of 'objects.b.at' have no times",
        "objects.b.at: {0: [0, 0, 0], easing: smooth}": "'easing' is not a time in seconds, `ease` or `slerp`",
        "nodes.bloom.intensity: {0: 1, 1: [1, 2]}": "keyframes of 'nodes.bloom.intensity' are of different lengths",
        "nodes.bloom.intensity: {0: high}": "'value': expected a number",
        "nodes.bloom: {0: 1}": "'nodes.bloom' names no parameter of a node; write nodes.ID.PARAM",
        "objects.b.at: {0: [.nan, 0, 0]}": "expected a list of 3 numbers",
        "objects.b.at: {.nan: [0, 0, 0]}": "RG321 keyframes of 'objects.b.at'",
    }.items(),
)
def test_mistakes_in_keyframes(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(InputError) as caught:
        read(tmp_path, f"objects: {{b: {{shape: box}}}}\nkeyframes: {{{text}}}")
    assert message in str(caught.value)


@pytest.mark.parametrize(
    ("camera", "message"),
    {
        "follow: bx": "there is no object 'bx'; did you mean 'box'?",
        "follow: box, target: [0, 0, 0]": "has both 'follow' and 'target'; choose one",
        "follow: box, eye: [-2, 0.5, 0]": "eye and target coincide",
        "follow: box}}\nkeyframes: {cameras.m.target: {0: [1, 1, 1]": "4:13: RG322 keyframes: camera 'm' follows an object",
    }.items(),
)
def test_mistakes_in_following(tmp_path: Path, camera: str, message: str) -> None:
    with pytest.raises(RendergraphError) as caught:
        read(tmp_path, f"objects: {{box: {{shape: box, at: [-2, 0.5, 0]}}}}\ncameras: {{m: {{{camera}}}}}")
    assert message in str(caught.value)
