"""Keyframes, orbit, and what a scene without camera or light gets."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from rendergraph.errors import InputError
from rendergraph.scene import animate
from rendergraph.scene.cameras import view_matrices
from rendergraph.scene.load import load
from rendergraph.scene.model import Scene


def read(tmp_path: Path, text: str) -> Scene:
    path = tmp_path / "a.yaml"
    path.write_text("scene: 1\n" + text)
    return load(path)


MOVING = """
objects:
  box: {shape: box, at: [0, 0, 0]}
  grid: {shape: sphere_grid, columns: 2, rows: 1}
materials: {m: {roughness: 0}}
lights: {lamp: {type: point, intensity: 2}}
cameras: {main: {eye: [0, 0, 4], near: 1}}
keyframes:
  cameras.main.eye: {0: [0, 0, 4], 2.0: [2, 0, 4]}
  objects.box.at: {1: [1, 0, 0], 3: [3, 0, 0]}
  objects.box.scale: {0: 1, 4: [3, 1, 1]}
  objects.grid.at: {0: [0, 0, 0], 1: [0, 5, 0]}
  materials.m.roughness: {0: 0, 1: 1}
  lights.lamp.intensity: {0: 2, 1: 4}
"""


def test_keyframes_are_linear_and_held_outside(tmp_path: Path) -> None:
    scene = read(tmp_path, MOVING)
    assert animate.moves(scene)
    half = animate.at(scene, 0.5)
    assert np.allclose(half.cameras["main"].transform[:3, 3], (0.5, 0, 4))
    assert half.cameras["main"].near == 1
    assert np.allclose(half.objects[0].transform[:3, 3], (1, 0, 0)), "held before the first"
    assert np.allclose(np.diag(half.objects[0].transform), (1.25, 1, 1, 1))
    assert np.allclose([entry.transform[1, 3] for entry in half.objects[1:]], 2.5)
    assert half.materials[0].roughness == 0.5
    assert half.lights[0].intensity == 3
    late = animate.at(scene, 99)
    assert np.allclose(late.objects[0].transform[:3, 3], (3, 0, 0))
    assert late.meshes is scene.meshes
    assert np.allclose(scene.objects[0].transform, np.eye(4)), "the scene itself does not change"


def test_a_camera_keeps_looking_at_its_target(tmp_path: Path) -> None:
    scene = read(tmp_path, MOVING)
    camera = animate.at(scene, 2.0).cameras["main"]
    assert np.allclose(camera.transform[:3, 2], np.array([2, 0, 4]) / math.sqrt(20))


def test_orbit_turns_counter_clockwise_about_the_target(tmp_path: Path) -> None:
    text = "cameras: {main: {eye: [1, 1, 4], target: [1, 0, 0]}}\norbit: {degrees_per_second: 90}\n"
    scene = read(tmp_path, text)
    camera = animate.at(scene, 1.0).cameras["main"]
    assert np.allclose(camera.transform[:3, 3], (5, 1, 0))
    back = np.array([4, 1, 0]) / math.sqrt(17)
    assert np.allclose(camera.transform[:3, 2], back)
    assert np.allclose(animate.at(scene, 4.0).cameras["main"].transform, scene.cameras["main"].transform)


def test_an_impossible_moment_is_an_error(tmp_path: Path) -> None:
    scene = read(tmp_path, "cameras: {m: {}}\nkeyframes: {cameras.m.eye: {0: [0, 0, 1], 2: [0, 0, -1]}}\n")
    animate.at(scene, 0.5)
    with pytest.raises(InputError, match=r"RG323 keyframes bring cameras\.m to a state"):
        animate.at(scene, 1.0)


def test_a_still_scene_is_itself(tmp_path: Path) -> None:
    scene = read(tmp_path, "objects: {b: {shape: box}}\n")
    assert not animate.moves(scene)
    assert animate.at(scene, 3) is scene


def test_framing_shows_the_whole_bounding_sphere(tmp_path: Path) -> None:
    scene = animate.complete(read(tmp_path, "objects: {b: {shape: box, size: [2, 4, 6], at: [5, 5, 5]}}\n"))
    camera = scene.cameras["default"]
    center, radius = animate.bounding_sphere(scene)
    assert center == (5, 5, 5)
    assert radius == pytest.approx(math.sqrt(14))
    away = camera.transform[:3, 3] - center
    assert np.allclose(away / np.linalg.norm(away), np.array([1, 0.6, 1.5]) / np.linalg.norm([1, 0.6, 1.5]))
    assert camera.fov_y == math.radians(45)
    view = view_matrices(camera, (100, 100))
    rng = np.random.default_rng(1)
    points = rng.normal(size=(500, 3))
    points = center + radius * points / np.linalg.norm(points, axis=1, keepdims=True)
    clip = np.c_[points, np.ones(500)] @ (view.projection @ view.view).T
    assert (np.abs(clip[:, :3]) <= clip[:, 3:] * 1.0001).all()
    assert np.abs(clip[:, 1] / clip[:, 3]).max() > 0.95, "and no smaller than needed"


def test_key_light_comes_over_the_left_shoulder(tmp_path: Path) -> None:
    scene = animate.complete(read(tmp_path, "cameras: {m: {eye: [0, 0, 5]}}\nobjects: {b: {shape: box}}\n"))
    (light,) = scene.lights
    assert (light.type, light.intensity) == ("directional", 3)
    assert np.allclose(light.direction, np.array([1, -1, -1]) / math.sqrt(3)), "to the right, down, away"


def test_complete_takes_the_camera_asked_for(tmp_path: Path) -> None:
    scene = read(tmp_path, "cameras: {a: {}, b: {eye: [1, 0, 0]}}\nlights: {l: {type: point}}\n")
    assert list(animate.complete(scene, "b").cameras) == ["b", "a"]
    assert animate.complete(scene).lights == scene.lights
    with pytest.raises(InputError, match=r"^--camera c: RG322 the scene has no camera 'c'"):
        animate.complete(scene, "c")


def test_an_empty_scene_has_bounds(tmp_path: Path) -> None:
    scene = animate.complete(read(tmp_path, ""))
    assert animate.bounds(scene) == ((-0.5, -0.5, -0.5), (0.5, 0.5, 0.5))
    assert scene.cameras
    assert scene.lights


def test_hidden_objects_do_not_count(tmp_path: Path) -> None:
    scene = read(tmp_path, "objects: {a: {shape: box}, b: {shape: box, at: [9, 0, 0], hidden: true}}\n")
    assert animate.bounds(scene)[1] == (0.5, 0.5, 0.5)
