"""Projections, frusta and fitted views, in closed form."""

from __future__ import annotations

import itertools
import math
from typing import Any

import numpy as np
import pytest

from rendergraph.api import ViewMatrices, projection

UNIT_BOX = np.array([[-1.0, -1, -1], [1, 1, 1]])


def camera(eye: Any = (0, 2, 6), target: Any = (0, 0, 0), far: float = 100.0) -> ViewMatrices:
    view = projection.inverse_rigid(projection.look_at(eye, target))
    return ViewMatrices(view, projection.perspective(0.9, 1.5, 0.1, far), (300, 200), 0.1, far)


def clip(matrix: Any, points: Any) -> Any:
    """Points after a projection, divided by w."""
    points = np.asarray(points, np.float64)
    homogeneous = np.concatenate([points, np.ones((len(points), 1))], axis=1) @ matrix.T
    return homogeneous[:, :3] / homogeneous[:, 3:]


# --- projections -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("far", [9.0, math.inf])
def test_perspective_takes_its_pyramid_to_the_cube(far: float) -> None:
    up, right = math.tan(0.35), 2 * math.tan(0.35)
    end = min(far, 1e9)
    corners = [(x * right * d, y * up * d, -d) for d in (0.5, end) for x in (-1, 1) for y in (-1, 1)]
    expected = [(x, y, z) for z in (-1, 1) for x in (-1, 1) for y in (-1, 1)]
    np.testing.assert_allclose(clip(projection.perspective(0.7, 2.0, 0.5, far), corners), expected, atol=1e-6)


def test_perspective_is_the_frustum_of_its_angle() -> None:
    top = 0.5 * math.tan(0.4)
    given = projection.frustum(-top * 1.5, top * 1.5, -top, top, 0.5, 20)
    np.testing.assert_allclose(projection.perspective(0.8, 1.5, 0.5, 20), given, rtol=1e-14)


def test_orthographic_takes_its_box_to_the_cube() -> None:
    matrix = projection.orthographic(-1, 3, 2, 4, -0.5, 7)
    np.testing.assert_allclose(clip(matrix, [(-1, 2, 0.5), (3, 4, -7)]), [(-1, -1, -1), (1, 1, 1)], atol=1e-14)


@pytest.mark.parametrize(
    "matrix", [projection.perspective(0.7, 2.0, 0.5, 9), projection.orthographic(-2, 2, -1, 1, 0.5, 9)]
)
def test_a_wider_picture_has_the_narrow_one_in_its_middle(matrix: Any) -> None:
    points = [(0.2, 0.1, -3), (-0.4, 0.3, -8)]
    before, after = clip(matrix, points), clip(projection.widened(matrix, 1.25), points)
    np.testing.assert_allclose(after, before * [0.8, 0.8, 1], rtol=1e-14)
    moved = clip(projection.shifted(matrix, 0.01, -0.02), points)
    np.testing.assert_allclose(moved, before + [0.01, -0.02, 0], rtol=1e-13)


def test_a_guard_band_is_part_of_the_resolution() -> None:
    assert projection.guard_band(1024, 0) == 1
    assert projection.guard_band(100, 10) == 1.25  # 80 texels show what 100 showed
    assert projection.guard_band(16, 8) == 2


# --- views -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("direction", [(0, -1, 0), (1, 2, 3), (0, 0, -1)])
def test_a_view_along_a_direction_has_it_at_minus_z(direction: Any) -> None:
    view = projection.view_along(direction, eye=(1, 2, 3))
    np.testing.assert_allclose(view[:3, :3] @ projection.unit(direction), (0, 0, -1), atol=1e-15)
    np.testing.assert_allclose(view @ (1, 2, 3, 1), (0, 0, 0, 1), atol=1e-14)
    np.testing.assert_allclose(view[:3, :3] @ view[:3, :3].T, np.eye(3), atol=1e-15)
    assert np.linalg.det(view[:3, :3]) == pytest.approx(1)


def test_a_view_along_a_direction_turns_its_side_to_the_right() -> None:
    view = projection.view_along((0, 0, -2), side=(1, 1, 5))
    np.testing.assert_allclose(view[:3, :3] @ projection.unit((1, 1, 0)), (1, 0, 0), atol=1e-15)


def test_a_parallel_view_holds_its_box_and_the_margin_around() -> None:
    rotation = projection.view_along((0.3, -1, 0.2))
    low, high = np.array([-2.0, 1, -9]), np.array([4.0, 3, -5])
    made = projection.orthographic_view(rotation, low, high, 100, margin=10)
    corners = projection.box_corners([low, high]) @ rotation[:3, :3]  # back to the world
    found = clip(made.projection @ made.view, corners)
    np.testing.assert_allclose(np.abs(found[:, :2]), 0.8, rtol=1e-12)
    assert np.all(np.abs(found[:, 2]) < 1)
    assert made.far == pytest.approx(4 * 1.002, rel=0.01)


def test_a_parallel_view_of_a_point_is_no_point() -> None:
    made = projection.orthographic_view(np.eye(4), (1, 1, 1), (1, 1, 1), 64)
    assert np.isfinite(np.linalg.inv(made.projection)).all()


def test_a_cone_view_ends_at_the_cone() -> None:
    made = projection.cone_view((1, 2, 3), (0, -1, 0), 0.5, 0.1, 10, 100, margin=10)
    rim = np.array([(1, 2, 3)]) + 2 * np.array([[math.sin(0.5), -math.cos(0.5), 0]])
    found = clip(made.projection @ made.view, rim)
    assert np.abs(found[0, :2]).max() == pytest.approx(0.8)


def test_each_face_of_a_cube_looks_along_its_axis() -> None:
    for number, made in enumerate(projection.cube_views((0, 0, 0), 0.1, 10, 64)):
        axis = np.zeros(3)
        axis[number // 2] = 1 - 2 * (number % 2)
        np.testing.assert_allclose(clip(made.projection @ made.view, [axis])[0, :2], 0, atol=1e-15)
        edge = axis + np.roll(axis, 1)  # 45° off: the face ends here
        assert np.abs(clip(made.projection @ made.view, [edge])[0, :2]).max() == pytest.approx(1)


# --- frusta ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("far", [12.0, math.inf])
def test_planes_are_zero_at_the_corners(far: float) -> None:
    made = camera(far=far)
    corners = projection.frustum_corners(made, far=12.0)
    planes = projection.frustum_planes(made)
    assert len(planes) == (5 if math.isinf(far) else 6)
    np.testing.assert_allclose(np.linalg.norm(planes[:, :3], axis=1), 1)
    distance = corners @ planes[:, :3].T + planes[:, 3]
    assert np.all(distance > -1e-9)
    assert np.all((np.abs(distance) < 1e-9).sum(axis=1) == (3 if math.isfinite(far) else [3] * 4 + [2] * 4))


def test_a_far_plane_that_float64_does_not_know_from_infinity_is_left_out() -> None:
    np.testing.assert_allclose(
        projection.frustum_planes(camera(far=1e18)), projection.frustum_planes(camera(far=math.inf))
    )


def test_a_part_of_a_frustum_lies_between_its_distances() -> None:
    made = camera()
    corners = projection.frustum_corners(made, 2.0, 5.0)
    in_view = corners @ made.view[:3, :3].T + made.view[:3, 3]
    np.testing.assert_allclose(in_view[:, 2], [-2] * 4 + [-5] * 4, rtol=1e-12)
    up = math.tan(0.45)
    np.testing.assert_allclose(np.abs(in_view[:, :2] / in_view[:, 2:]), [[1.5 * up, up]] * 8, rtol=1e-12)
    assert np.all(np.diff(in_view[:2, 0]) > 0)
    flat = projection.orthographic(-2, 2, -1, 1, 0.5, 9)
    sides = projection.frustum_corners(ViewMatrices(np.eye(4), flat, (2, 1), 0.5, 9), 1.0, 3.0)
    np.testing.assert_allclose(sides, [(x, y, -d) for d in (1, 3) for y in (-1, 1) for x in (-2, 2)], rtol=1e-12)


def test_an_endless_frustum_has_no_far_corners() -> None:
    with pytest.raises(ValueError, match="the view reaches to infinity; give the distance"):
        projection.frustum_corners(camera(far=math.inf))


def test_a_square_is_cut_to_the_triangle_inside() -> None:
    square = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    found = projection.clip_polygon(square, np.array([[-1.0, -1, 0, 1]]))  # x + y <= 1
    assert set(map(tuple, found.tolist())) == {(0, 0, 0), (0, 1, 0), (1, 0, 0)}
    assert len(projection.clip_polygon(square, np.array([[0.0, 0, 1, -1]]))) == 0


def test_a_box_inside_is_seen_whole() -> None:
    seen = projection.visible_part(camera(), UNIT_BOX)
    assert {tuple(point) for point in seen.round(9).tolist()} == {
        tuple(c) for c in projection.box_corners(UNIT_BOX).tolist()
    }
    assert len(projection.visible_part(camera((0, 0, 6), (0, 0, 9)), UNIT_BOX)) == 0


def test_visible_part_agrees_with_sampling() -> None:
    rng = np.random.default_rng(0)
    box = np.array([[-3.0, -1, -8], [4, 2, 5]])
    for _ in range(30):
        eye, target = rng.uniform(-6, 6, 3), rng.uniform(-3, 3, 3)
        made = camera(eye, target, far=float(rng.choice([8.0, math.inf])))
        points = rng.uniform(box[0], box[1], (4000, 3))
        eyes = points @ made.view[:3, :3].T + made.view[:3, 3]
        homogeneous = np.concatenate([eyes, np.ones((len(eyes), 1))], 1) @ made.projection.T
        inside = points[np.all(np.abs(homogeneous[:, :3]) <= homogeneous[:, 3:], axis=1)]
        seen = projection.visible_part(made, box)
        if len(inside):
            assert np.all(inside.min(0) >= seen.min(0) - 1e-6)
            assert np.all(inside.max(0) <= seen.max(0) + 1e-6)
        if len(seen):
            assert np.all(seen >= box[0] - 1e-6)
            assert np.all(seen <= box[1] + 1e-6)


def test_bounds_of_balls_hold_them_and_no_more() -> None:
    """Against points on the sphere, projected one by one: perspective, parallel, off-centre, endless."""
    rng = np.random.default_rng(3)
    around = projection.unit(rng.normal(size=(8000, 3)))
    view = projection.view_along((0.2, -0.1, -1), eye=(0.5, 0.3, 4))
    projections = (
        (projection.perspective(0.9, 1.5, 0.5, 40), 40.0),
        (projection.perspective(0.9, 1.5, 0.5, math.inf), math.inf),
        (projection.frustum(-0.1, 0.4, -0.3, 0.1, 0.5, 40), 40.0),
        (projection.orthographic(-3, 2, -2, 2, 0.5, 40), 40.0),
    )
    checked = 0
    for (matrix, far), center, radius in itertools.product(projections, rng.uniform(-4, 3, (25, 3)), (0.2, 1.0, 2.5)):
        made = ViewMatrices(view, matrix, (300, 200), 0.5, far)
        (x, y, width, height), (least, most) = projection.sphere_bounds(made, center, radius)
        clip = np.column_stack([center + radius * around, np.ones(len(around))]) @ (matrix @ view).T
        ahead = clip[:, 3] > 1e-6
        ndc = clip[ahead, :3] / clip[ahead, 3:]
        pixels, depth = (ndc[:, :2] + 1) / 2 * (300, 200), (1 - ndc[:, 2]) / 2
        shown = np.all(np.abs(ndc[:, :2]) <= 1, axis=1) & (depth >= 0) & (depth <= 1)
        if not ahead.all():
            assert not shown.any() or (x, y, width, height) == (0, 0, 300, 200)
            continue
        if shown.any():
            assert np.all((pixels[shown] >= (x, y)) & (pixels[shown] <= (x + width, y + height)))
            assert np.all((depth[shown] >= least) & (depth[shown] <= most))
        if width and shown.all():
            checked += 1
            assert np.abs(pixels.min(axis=0) - (x, y)).max() < 1.6
            assert np.abs(pixels.max(axis=0) - (x + width, y + height)).max() < 1.6
            assert least == pytest.approx(depth.min(), rel=1e-2)
            assert most == pytest.approx(depth.max(), rel=1e-2)
    assert checked > 20
    behind = projection.sphere_bounds(ViewMatrices(view, projections[0][0], (300, 200), 0.5, 40), (0.5, 0.3, 9), 1)
    assert behind[0] == (0, 0, 0, 0)


def test_corners_of_a_region() -> None:
    """A box's own; and of a box that a frustum cuts those that its faces and edges, cut one by one, have."""
    found = projection.region_corners(projection.box_planes(UNIT_BOX))
    assert {tuple(corner) for corner in found} == {tuple(corner) for corner in projection.box_corners(UNIT_BOX)}
    made = camera((0.2, 0.1, 1.5), (0.3, 0, 0))
    cut = projection.region_corners(np.concatenate([projection.box_planes(UNIT_BOX), projection.frustum_planes(made)]))
    expected = projection.visible_part(made, UNIT_BOX)
    for some, others in ((cut, expected), (expected, cut)):
        apart = np.linalg.norm(some[:, np.newaxis] - others, axis=-1).min(axis=1)
        assert apart.max() < 1e-6
    assert (
        len(projection.region_corners(np.array([[0, 1.0, 0, 0], [0, -1, 0, -1], *projection.box_planes(UNIT_BOX)])))
        == 0
    )


def test_a_narrowed_view_holds_its_rectangle() -> None:
    wide = projection.cone_view((0, 0, 0), (0, 0, -1), 1.0, 0.1, 50.0, 100)
    made = projection.narrowed_view(wide, (-0.2, 0.1), (0.4, 0.3), 2.0, 10.0, margin=10)
    matrix = made.projection @ made.view
    sides = clip(matrix, [(x * 5, y * 5, -5.0) for x, y in ((-0.2, 0.1), (0.4, 0.3))])
    np.testing.assert_allclose(sides[:, :2], [[-0.8, -0.8], [0.8, 0.8]], atol=1e-9)
    np.testing.assert_allclose(clip(matrix, [(0, 0, -2.0), (0, 0, -10.0)])[:, 2], [-1, 1], atol=1e-9)


@pytest.mark.parametrize("shape", [(0,), (3,), (0, 3), (2, 0), (4, 2, 3)])
def test_unit_vectors_along_the_last_axis_of_any_shape(shape: tuple[int, ...]) -> None:
    vectors = np.random.default_rng(1).normal(size=shape)
    lengths = np.sqrt((vectors**2).sum(axis=-1, keepdims=True))
    np.testing.assert_allclose(projection.unit(vectors), vectors / lengths, rtol=1e-15)
