"""Camera matrices against independent vectors, and what pack makes of them."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rendergraph import projection
from rendergraph.projection import look_at
from rendergraph.scene import pack
from rendergraph.scene.cameras import projection_matrix, view_matrices
from rendergraph.scene.geometry import translation
from rendergraph.scene.model import Camera
from rendergraph.scene.scene_values import camera_words, described_camera
from rendergraph.steps import ViewMatrices

EYE = np.eye(4)


@pytest.fixture(scope="module")
def vectors(shared: Path) -> dict[str, object]:
    found: dict[str, object] = json.loads((shared / "reference/b6_math/vectors.json").read_text())
    return found


def test_projections(vectors: dict[str, object]) -> None:
    for case in vectors["projections"]["cases"]:  # type: ignore[index]  # plain JSON
        near, far, aspect = case["near"], case["far"], case["aspect"]
        camera = Camera("c", EYE, fov_y=case["yfov"], near=near, far=far)
        assert np.allclose(projection_matrix(camera, aspect), case["perspective"], rtol=1e-12, atol=1e-12)
        endless = Camera("c", EYE, fov_y=case["yfov"], near=near, far=math.inf)
        assert case["eps"] == projection.INFINITE_EPSILON
        assert np.allclose(projection_matrix(endless, aspect), case["infinite_eps"], rtol=1e-12, atol=1e-12)
        assert np.allclose(projection_matrix(camera, aspect) @ case["point"], case["clip_perspective"], rtol=1e-12)
        if "orthographic" in case:
            height = 2 / case["orthographic"][1][1]
            flat = Camera("c", EYE, "orthographic", height=height, near=near, far=far)
            wide = projection_matrix(flat, case["orthographic"][1][1] / case["orthographic"][0][0])
            assert np.allclose(wide, case["orthographic"], rtol=1e-12, atol=1e-12)


def test_view(vectors: dict[str, object]) -> None:
    for case in vectors["view"]:  # type: ignore[attr-defined]  # plain JSON
        camera = Camera("c", look_at(case["eye"], case["target"], case["up"]))
        assert np.allclose(view_matrices(camera, (4, 3)).view, case["matrix"], rtol=1e-12, atol=1e-12)


def test_frustum_of_a_symmetric_camera_is_the_perspective_one() -> None:
    straight = Camera("c", EYE, fov_y=1.0, near=0.5, far=9)
    top = 0.5 * math.tan(0.5)
    off = Camera("c", EYE, "frustum", frustum=(-top * 2, top * 2, -top, top), near=0.5, far=9)
    assert np.allclose(projection_matrix(off, 1.0), projection_matrix(straight, 2.0))
    shifted = Camera("c", EYE, "frustum", frustum=(0, 2, -1, 1), near=1, far=9)
    corner = projection_matrix(shifted, 1.0) @ (0, -1, -1, 1)
    assert np.allclose(corner / corner[3], (-1, -1, -1, 1))


def test_orthographic_is_as_high_as_it_says() -> None:
    camera = Camera("c", EYE, "orthographic", height=4, near=1, far=11)
    clip = projection_matrix(camera, 2.0)
    assert np.allclose(clip @ (4, 2, -1, 1), (1, 1, -1, 1))
    assert np.allclose(clip @ (-4, -2, -11, 1), (-1, -1, 1, 1))


def test_look_at_straight_down_has_a_frame() -> None:
    matrix = look_at((0, 5, 0), (0, 0, 0))
    assert np.allclose(matrix[:3, :3] @ matrix[:3, :3].T, np.eye(3))
    assert np.allclose(matrix[:3, 2], (0, 1, 0))
    assert np.linalg.det(matrix) == pytest.approx(1)


def test_look_at_nowhere_is_an_error() -> None:
    with pytest.raises(ValueError, match="eye and target coincide"):
        look_at((1, 2, 3), (1, 2, 3))


def block(view: bytes) -> Any:
    return np.frombuffer(view, pack.VIEW)[0]


def test_view_block() -> None:
    camera = Camera("c", look_at((1, 2, 3), (0, 0, 0)), near=0.1, far=50)
    view = view_matrices(camera, (640, 360))
    data = pack.pack_view(view)
    assert len(data) == 448
    found = block(data)
    assert np.allclose(found["view"].T, view.view, atol=1e-6)  # columns behind each other
    assert np.allclose(np.frombuffer(data, np.float32)[12:15], view.view[:3, 3], atol=1e-6)
    reversed_depth = pack.reversed_projection(view)
    assert np.allclose(found["view_projection"].T, reversed_depth @ view.view, atol=1e-6)
    assert np.allclose(found["inverse_view_projection"].T @ found["view_projection"].T, np.eye(4), atol=1e-4)
    assert np.allclose(found["eye"], (1, 2, 3, 1))
    assert np.allclose(found["viewport"], (640, 360, 1 / 640, 1 / 360))
    assert np.allclose(found["range"], (0.1, 50, 0, np.inf))


def test_eye_of_an_orthographic_view_points_at_the_viewer() -> None:
    camera = Camera("c", look_at((0, 0, 7), (0, 0, 0)), "orthographic")
    assert np.allclose(block(pack.pack_view(view_matrices(camera, (8, 8))))["eye"], (0, 0, 1, 0))


def test_inverse_rigid_is_the_inverse() -> None:
    transform = translation((1, 2, 3)) @ look_at((3, 1, 2), (0, 1, 0))
    assert np.allclose(projection.inverse_rigid(transform) @ transform, np.eye(4), atol=1e-14)


DIRECTION = projection.view_along((0.2, -0.5, -1), eye=(1, 2, 3))


@pytest.mark.parametrize(
    ("matrix", "near", "far"),
    [
        (projection.perspective(0.9, 1.5, 5.6e-5, 100), 5.6e-5, 100.0),
        (projection.perspective(0.9, 1.5, 0.1, math.inf), 0.1, math.inf),
        (projection.frustum(-0.1, 0.3, -0.2, 0.1, 0.5, 20), 0.5, 20.0),
        (projection.orthographic(-1, 3, 2, 4, -2, 7), -2.0, 7.0),
    ],
)
def test_depth_is_reversed(matrix: Any, near: float, far: float) -> None:
    """1 at the near plane, 0 at the far one or at infinity, between them (1 - z) / 2 of the classical z, in float32."""
    view = ViewMatrices(DIRECTION, matrix, (8, 8), near, far)
    made = block(pack.pack_view(view))["projection"].T.astype(np.float64)

    def depth(of: Any, *place: float) -> float:
        clip = of @ place
        return float(clip[2] / clip[3])

    assert depth(made, 0, 0, -near, 1) == pytest.approx(1, rel=3e-7)
    end = (0, 0, -far, 1) if far < math.inf else (0, 0, -1, 0)
    assert depth(made, *end) == pytest.approx(0, abs=0 if far == math.inf else 6e-8)
    for share in (0.01, 0.3, 0.8):
        distance = near + share * (min(far, 50) - near)
        expected = (1 - depth(matrix, 0.3, -0.2, -distance, 1)) / 2
        slack = projection.INFINITE_EPSILON if far == math.inf else 0.0
        assert depth(made, 0.3, -0.2, -distance, 1) == pytest.approx(expected, rel=3e-6, abs=slack)
    np.testing.assert_array_equal(made[[0, 1, 3]], matrix[[0, 1, 3]].astype(np.float32))


@pytest.mark.parametrize("turn", [0.0, 0.3])
def test_camera_words_keep_the_distance_of_the_target(turn: float) -> None:
    """A camera that is moved by hand turns around its target, also one that an animation has turned away from it."""
    transform = look_at((1, 2, 8), (1 + 4 * math.sin(turn), 2, 8 - 4 * math.cos(turn)), (0, 1, 0))
    camera = Camera("c", transform, fov_y=1.0, target=(1, 2, 4))
    again = described_camera(camera_words(camera), Camera("other", EYE, fov_y=2.0))
    assert np.allclose(again.transform, transform, atol=1e-12)
    assert again.target is not None
    assert math.dist((1, 2, 8), again.target) == pytest.approx(4 * math.cos(turn))
