"""Keyframes, orbit, and what a scene without camera or light gets."""

from __future__ import annotations

import itertools
import math
from pathlib import Path

import numpy as np
import pytest

from rendergraph.errors import InputError
from rendergraph.scene import animate
from rendergraph.scene.cameras import framing_camera, view_matrices
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
    with pytest.raises(InputError, match=r"RG323 keyframes bring cameras\.m to an impossible state"):
        animate.at(scene, 1.0)


def test_a_still_scene_is_itself(tmp_path: Path) -> None:
    scene = read(tmp_path, "objects: {b: {shape: box}}\n")
    assert not animate.moves(scene)
    assert animate.at(scene, 3) is scene


SHAPES = """
objects:
  knot: {shape: torus_knot, radius: 1, tube: 0.2, at: [5, 5, 5], rotate_degrees: [40, 0, 10]}
  long: {shape: box, size: [8, 0.2, 0.3], at: [4, 3, 5], rotate_degrees: [0, 70, 0], scale: [1, 2, 1]}
  again: {shape: sphere, radius: 0.5, at: [6, 6, 5]}
"""


@pytest.mark.parametrize("aspect", [16 / 9, 1.0, 0.4])
def test_framing_is_as_near_as_points_allow(tmp_path: Path, aspect: float) -> None:
    """Every vertex is in the picture, and along one axis both its sides are touched but for the margin."""
    scene = animate.complete(read(tmp_path, SHAPES), aspect=aspect)
    camera = scene.cameras["default"]
    assert np.allclose(camera.transform[:3, 2], np.array([1, 0.6, 1.5]) / np.linalg.norm([1, 0.6, 1.5]))
    assert camera.fov_y == math.radians(45)
    view = view_matrices(camera, (round(1000 * aspect), 1000))
    points = np.concatenate(
        [scene.meshes[o.mesh].positions @ o.transform[:3, :3].T + o.transform[:3, 3] for o in scene.objects]
    )
    clip = np.c_[points, np.ones(len(points))] @ (view.projection @ view.view).T
    assert (np.abs(clip[:, 2]) < clip[:, 3]).all(), "between near and far"
    seen = clip[:, :2] / clip[:, 3:]
    low, high = seen.min(axis=0), seen.max(axis=0)
    assert np.allclose(high + low, 0, atol=0.03), "in the middle"
    assert high.max() == pytest.approx(0.94, abs=1e-4)
    eye = camera.transform[:3, 3]
    aimed = np.array(camera.target) - eye
    assert np.allclose(aimed / np.linalg.norm(aimed), -camera.transform[:3, 2]), "an orbit starts without a jump"


def test_many_placed_vertices_are_framed_by_their_boxes(tmp_path: Path) -> None:
    scene = read(tmp_path, SHAPES)
    near, away = framing_camera(scene), framing_camera(scene, most_points=0)
    distances = [float(np.linalg.norm(c.transform[:3, 3] - np.array([5, 5, 5]))) for c in (near, away)]
    assert distances[0] < distances[1] < 1.3 * distances[0]


def test_a_point_is_framed(tmp_path: Path) -> None:
    """Something without any size, as large files have it by mistake, still has a camera."""
    scene = animate.complete(read(tmp_path, "objects: {b: {shape: sphere, radius: 1, scale: 1e-9}}\n"))
    camera = scene.cameras["default"]
    assert np.isfinite(camera.transform).all()
    assert 0 < camera.near < camera.far


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
    assert scene.bounds == ((-0.5, -0.5, -0.5), (0.5, 0.5, 0.5))
    assert scene.cameras
    assert scene.lights


def test_bounds_are_those_of_every_turned_and_scaled_box(tmp_path: Path) -> None:
    objects = "".join(
        f"  o{n}: {{shape: {shape}, at: [{n}, {-n}, 2], rotate_degrees: [{17 * n}, {31 * n}, 5], scale: {1 + n / 4}}}\n"
        for n, shape in enumerate(("box", "sphere", "torus", "plane", "box"))
    )
    scene = read(tmp_path, f"objects:\n{objects}")
    corners = []
    for entry in scene.objects:
        low, high = scene.meshes[entry.mesh].box
        for corner in itertools.product(*zip(low, high, strict=True)):
            corners.append(entry.transform[:3, :3] @ np.array(corner, np.float64) + entry.transform[:3, 3])
    np.testing.assert_allclose(scene.bounds, (np.min(corners, axis=0), np.max(corners, axis=0)), atol=1e-6)


def test_hidden_objects_do_not_count(tmp_path: Path) -> None:
    scene = read(tmp_path, "objects: {a: {shape: box}, b: {shape: box, at: [9, 0, 0], hidden: true}}\n")
    assert scene.bounds[1] == (0.5, 0.5, 0.5)


def test_a_camera_in_words(tmp_path: Path) -> None:
    """What it does not say is that of the scene's camera; the keys are those of scene files."""
    scene = read(
        tmp_path, "cameras: {m: {eye: [0, 1, 5], target: [0, 1, 0], fov_y_degrees: 30, near: 0.2, shutter: 0.5}}\n"
    )
    camera = animate.complete(scene, "eye=2,1,0 fov=40").camera
    assert camera is not None
    np.testing.assert_allclose(camera.transform[:3, 3], [2, 1, 0])
    np.testing.assert_allclose(camera.transform[:3, 2], [1, 0, 0], atol=1e-12)  # it looks at the target from there
    assert (camera.fov_y, camera.near, camera.shutter) == (math.radians(40), 0.2, 0.5)
    flat = animate.complete(scene, "height=3").camera
    assert flat is not None
    assert (flat.type, flat.height, flat.target) == ("orthographic", 3, (0, 1, 0))
    same = animate.complete(scene, "near=0.1").camera
    assert same is not None
    np.testing.assert_allclose(same.transform, scene.cameras["m"].transform, atol=1e-12)
    assert math.isclose(same.fov_y, math.radians(30))


@pytest.mark.parametrize(
    ("text", "message"),
    {
        "eye=1,2": r"--camera 'eye=1,2': RG321 'eye': expected a list of 3 numbers, got 1, 2|expected a list of 3",
        "eyes=1,2,3": "no key 'eyes'; did you mean 'eye'",
        "eye=0,0,0 target=0,0,0": "eye and target coincide",
        "fov=wide": "'fov_y_degrees': expected a number",
        "fov=40 height=2": "choose one",
        "follow=box": "camera 'camera' has no key 'follow'; available: aspect, eye, far, fov_y_degrees",
        "eye=[1": "RG0",
    }.items(),
)
def test_mistakes_in_a_camera(tmp_path: Path, text: str, message: str) -> None:
    scene = read(tmp_path, "cameras: {m: {}}\n")
    with pytest.raises(InputError, match=message):
        animate.complete(scene, text)


def test_a_shutter_for_all_cameras(tmp_path: Path) -> None:
    scene = read(tmp_path, "cameras: {m: {}}\nkeyframes: {cameras.m.eye: {0: [0, 0, 1], 1: [0, 0, 5]}}\n")
    camera = animate.at(animate.complete(scene, shutter=0.25), 0.5).camera
    assert camera is not None
    assert camera.shutter == 0.25
