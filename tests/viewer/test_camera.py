"""Moving a camera by hand, against geometry."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rendergraph.projection import look_at
from rendergraph.scene.cameras import view_matrices
from rendergraph.scene.model import Camera
from rendergraph.viewer import camera as cameras

SPHERE = ((0.0, 1.0, 0.0), 2.0)


def camera(**more: object) -> Camera:
    return Camera("main", look_at((0, 1, 5), (0, 1, 0)), target=(0.0, 1.0, 0.0), **more)  # type: ignore[arg-type]


def eye(found: Camera) -> np.ndarray:
    return found.transform[:3, 3]


def test_a_quarter_to_the_right_looks_from_the_left() -> None:
    """What is dragged to the right turns to the right: the eye goes to the left."""
    found = cameras.orbit(camera(), SPHERE, math.pi / 2, 0.0)
    np.testing.assert_allclose(eye(found), [-5, 1, 0], atol=1e-12)
    np.testing.assert_allclose(found.transform[:3, 2], [-1, 0, 0], atol=1e-12)


def test_an_orbit_keeps_its_distance_and_never_turns_over() -> None:
    found = camera()
    for _ in range(50):
        found = cameras.orbit(found, SPHERE, 0.3, 0.4)
        assert np.linalg.norm(eye(found) - (0, 1, 0)) == pytest.approx(5)
        assert found.transform[1, 1] > 0


def test_what_is_dragged_stays_under_the_hand() -> None:
    """By a quarter of the picture's height: the target is drawn a quarter of the height beside the middle."""
    found = cameras.pan(camera(), SPHERE, -0.25, 0.1)
    view = view_matrices(found, (100, 100))
    clip = view.projection @ view.view @ np.array([0, 1, 0, 1.0])
    np.testing.assert_allclose(clip[:2] / clip[3], [0.5, -0.2], atol=1e-12)


def test_a_pan_of_an_orthographic_camera_goes_by_its_height() -> None:
    found = cameras.pan(camera(type="orthographic", height=4.0), SPHERE, 0.5, 0.0)
    np.testing.assert_allclose(eye(found), [2, 1, 5], atol=1e-12)


def test_zooming_halves_the_distance_and_stops_at_the_target() -> None:
    found = cameras.zoom(camera(), SPHERE, 0.5)
    np.testing.assert_allclose(eye(found), [0, 1, 2.5])
    for _ in range(100):
        found = cameras.zoom(found, SPHERE, 0.5)
    assert eye(found)[2] == pytest.approx(2 * found.near)
    assert cameras.zoom(camera(type="orthographic", height=4.0), SPHERE, 0.5).height == 2.0


@pytest.mark.parametrize("kind", ["perspective", "orthographic"])
def test_zooming_out_ends_where_the_scene_is_a_few_texels(kind: str) -> None:
    found = camera(type=kind, height=4.0)
    for _ in range(100):
        found = cameras.zoom(found, SPHERE, 2.0)
    assert (found.height if kind == "orthographic" else eye(found)[2]) == pytest.approx(2000)


def test_flying_goes_along_the_cameras_own_axes() -> None:
    np.testing.assert_allclose(eye(cameras.fly(camera(), SPHERE, 0, 0, 0.5)), [0, 1, 4])
    np.testing.assert_allclose(eye(cameras.fly(camera(), SPHERE, 1, 0.5, 0)), [2, 2, 5])


@pytest.mark.parametrize(
    "more", [{}, {"type": "orthographic"}, {"type": "frustum", "frustum": (-0.05, 0.05, -0.04, 0.04)}]
)
def test_framing_shows_all_of_the_sphere(more: dict[str, object]) -> None:
    away = cameras.fly(camera(**more), SPHERE, 30, 4, -100)
    view = view_matrices(cameras.frame(away, SPHERE), (100, 100))
    directions = np.array([[x, y, z] for x in (-1, 0, 1) for y in (-1, 0, 1) for z in (-1, 0, 1) if x or y or z])
    points = np.array(SPHERE[0]) + SPHERE[1] * directions / np.linalg.norm(directions, axis=1, keepdims=True)
    clip = (view.projection @ view.view @ np.c_[points, np.ones(len(points))].T).T
    assert np.all(np.abs(clip[:, :3]) <= clip[:, 3:] * (1 + 1e-9))
    assert np.abs(clip[:, :2] / clip[:, 3:]).max() > 0.7


def test_a_camera_without_a_target_turns_around_what_it_sees() -> None:
    found = cameras.orbit(Camera("main", look_at((0, 1, 5), (0, 1, 0))), SPHERE, math.pi, 0.0)
    np.testing.assert_allclose(eye(found), [0, 1, -5], atol=1e-12)


def test_the_scene_stays_nearer_than_the_far_plane() -> None:
    found = cameras.zoom(camera(far=8.0), SPHERE, 10.0)
    assert found.far > 50 + 2
