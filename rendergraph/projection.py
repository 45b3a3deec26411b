"""Views: projections, frusta, the visible part of a box, and views fitted around boxes and cones.

Conventions: right-handed, +Y up, a view looks down its own -Z; matrices act on column vectors and are float64 of shape
(4, 4); clip space has z in -w…w. Angles are in radians, distances in metres, points in world space with shape (n, 3). A
box is its minimum and maximum corner, shape (2, 3).
"""

from __future__ import annotations

import math
from itertools import combinations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rendergraph.steps import ViewMatrices

Matrix = NDArray[np.float64]
Points = NDArray[np.float64]

INFINITE_EPSILON = 2.4e-7
"""Margin of an infinite far plane inside the clip volume: two steps of a float32 at 1."""

BOX_FACES = ((0, 1, 3, 2), (4, 5, 7, 6), (0, 1, 5, 4), (2, 3, 7, 6), (0, 2, 6, 4), (1, 3, 7, 5))
"""The corners of each face of a box in cyclic order, as indices into `box_corners`."""


# --- projections: view space to clip space ---------------------------------------------------------------------------


def frustum(left: float, right: float, bottom: float, top: float, near: float, far: float) -> Matrix:
    """Return the perspective projection with these bounds on the near plane; `far` may be infinite."""
    if math.isinf(far):
        z, w = INFINITE_EPSILON - 1, near * (INFINITE_EPSILON - 2)
    else:
        z, w = (far + near) / (near - far), 2 * far * near / (near - far)
    rows = [
        [2 * near / (right - left), 0, (right + left) / (right - left), 0],
        [0, 2 * near / (top - bottom), (top + bottom) / (top - bottom), 0],
        [0, 0, z, w],
        [0, 0, -1, 0],
    ]
    return np.array(rows, np.float64)


def perspective(fov_y: float, aspect: float, near: float, far: float) -> Matrix:
    """Return the perspective projection with a full vertical angle and an aspect ratio; `far` may be infinite."""
    matrix = frustum(-1, 1, -1, 1, near, far)
    matrix[1, 1] = 1 / math.tan(fov_y / 2)
    matrix[0, 0] = matrix[1, 1] / aspect
    return matrix


def orthographic(left: float, right: float, bottom: float, top: float, near: float, far: float) -> Matrix:
    """Return an orthographic projection; `near` may be 0 or behind the view."""
    rows = [
        [2 / (right - left), 0, 0, -(right + left) / (right - left)],
        [0, 2 / (top - bottom), 0, -(top + bottom) / (top - bottom)],
        [0, 0, -2 / (far - near), -(far + near) / (far - near)],
        [0, 0, 0, 1],
    ]
    return np.array(rows, np.float64)


def widened(projection: Matrix, factor: float) -> Matrix:
    """Return the projection of a view that is wider by a factor on all sides; the old view is its middle."""
    return np.diag([1 / factor, 1 / factor, 1.0, 1.0]) @ projection


def shifted(projection: Matrix, x: float, y: float) -> Matrix:
    """Return a projection shifted by x and y in clip space units, where a texel is 2 / size; for jitter."""
    moved = np.eye(4)
    moved[:2, 3] = x, y
    return moved @ projection


def guard_band(resolution: int, texels: float) -> float:
    """Return the factor by which a band of `texels` inside a `resolution` widens a view.

    It is at most 2, for resolutions that are hardly larger than the band.
    """
    return resolution / max(resolution - 2 * texels, 0.5 * resolution)


# --- views: world space to view space --------------------------------------------------------------------------------


def unit(vectors: ArrayLike) -> Points:
    """Normalise vectors along the last axis; zero vectors stay zero."""
    given = np.asarray(vectors, np.float64)
    rows = given.reshape(math.prod(given.shape[:-1]), given.shape[-1])
    parts = np.ascontiguousarray(rows.T)  # NumPy is slow along short axes
    peak = np.abs(parts).max(axis=0, initial=0.0)
    scaled = parts / np.where(peak > 0, peak, 1.0)  # avoids underflow and overflow of squares
    length = np.sqrt((scaled * scaled).sum(axis=0))
    return np.ascontiguousarray((scaled / np.where(length > 0, length, 1.0)).T).reshape(given.shape)


def look_at(eye: ArrayLike, target: ArrayLike, up: ArrayLike = (0.0, 1.0, 0.0)) -> Matrix:
    """Return a camera's transform (view to world) at `eye`, looking at `target`; `inverse_rigid` gives the view matrix.

    If `up` is parallel to the view direction, another axis replaces it, so a camera may look straight down.

    Raises:
        ValueError: eye and target coincide.
    """
    eye = np.asarray(eye, np.float64)
    back = unit(eye - np.asarray(target, np.float64))
    if not back.any():
        raise ValueError("eye and target coincide")
    for candidate in (unit(up), np.array([0.0, 0.0, -1.0]), np.array([1.0, 0.0, 0.0])):
        side = _cross(candidate, back)
        if np.linalg.norm(side) > 1e-9:
            break
    side = unit(side)
    matrix = np.eye(4)
    matrix[:3, 0], matrix[:3, 1], matrix[:3, 2], matrix[:3, 3] = side, _cross(back, side), back, eye
    return matrix


def _cross(a: Matrix, b: Matrix) -> Matrix:
    """Return the cross product of two vectors, shape (3,); `np.cross` takes ten times as long for a single pair."""
    (x, y, z), (u, v, w) = a.tolist(), b.tolist()
    return np.array([y * w - z * v, z * u - x * w, x * v - y * u])


def inverse_rigid(transform: Matrix) -> Matrix:
    """Return the inverse of a rotation with translation, which is exact, unlike `np.linalg.inv`."""
    rotation = transform[:3, :3].T
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = rotation, -rotation @ transform[:3, 3]
    return matrix


def view_along(direction: ArrayLike, side: ArrayLike | None = None, eye: ArrayLike = (0.0, 0.0, 0.0)) -> Matrix:
    """Return world to view: from `eye` along a direction, with `side` towards +x; by default any side."""
    forward = np.asarray(direction, np.float64)
    forward = forward / np.linalg.norm(forward)
    side = any_side(direction) if side is None else np.asarray(side, np.float64)
    x = side - forward * (side @ forward)
    x /= np.linalg.norm(x)
    view = np.eye(4)
    view[:3, :3] = np.stack([x, _cross(-forward, x), -forward])
    view[:3, 3] = -view[:3, :3] @ np.asarray(eye, np.float64)
    return view


def any_side(direction: ArrayLike) -> Matrix:
    """Return the world axis that is most perpendicular to a direction, shape (3,)."""
    side = np.zeros(3)
    side[int(np.argmin(np.abs(np.asarray(direction, np.float64))))] = 1.0
    return side


# --- views fitted around something -----------------------------------------------------------------------------------


def orthographic_view(
    rotation: Matrix, low: ArrayLike, high: ArrayLike, resolution: int, margin: float = 0.0
) -> ViewMatrices:
    """Return an orthographic view around a box given in the axes of a rotation.

    Args:
        rotation: world to view without translation, as from `view_along`.
        low, high: minimum and maximum corner of the box, shape (3,), after the rotation; the view looks from `high`
            to `low` in z. The box does not touch the near or far plane.
        resolution: texels along a side.
        margin: texels around the box.
    """
    low, high = np.asarray(low, np.float64), np.asarray(high, np.float64)
    size = np.maximum(high[:2] - low[:2], 1e-6 * max(1.0, float(np.abs([low[2], high[2]]).max())))
    size = size * guard_band(resolution, margin)
    slack = 1e-3 * max(float(high[2] - low[2]), float(size.max()), 1e-6)
    near, far = -high[2] - slack, -low[2] + slack
    view = rotation.copy()
    view[:2, 3] = -(low[:2] + high[:2]) / 2
    view[2, 3] = near  # move the near plane to the box
    width, height = size / 2
    projection = orthographic(-width, width, -height, height, 0.0, far - near)
    return ViewMatrices(view, projection, (resolution, resolution), 0.0, float(far - near))


def cone_view(
    eye: ArrayLike, direction: ArrayLike, half_angle: float, near: float, far: float, resolution: int, margin: float = 0
) -> ViewMatrices:
    """Return a square perspective view around a cone, with `margin` texels around it."""
    wider = math.atan(math.tan(half_angle) * guard_band(resolution, margin))
    projection = perspective(2 * wider, 1.0, near, far)
    return ViewMatrices(view_along(direction, eye=eye), projection, (resolution, resolution), near, far)


def narrowed_view(
    view: ViewMatrices, low: ArrayLike, high: ArrayLike, near: float, far: float, margin: float = 0.0
) -> ViewMatrices:
    """Return a narrower perspective view from the same position: a rectangle of slopes, with a margin of texels.

    Args:
        view: the original view, whose axis may lie outside the rectangle.
        low, high: minimum and maximum of x and y over the distance along the axis, shape (2,).
        near, far: metres.
        margin: texels around the rectangle.
    """
    low, high = np.asarray(low, np.float64), np.asarray(high, np.float64)
    middle = (low + high) / 2
    half = np.maximum(high - middle, 1e-6) * guard_band(view.size[0], margin)
    (left, bottom), (right, top) = (middle - half) * near, (middle + half) * near
    return ViewMatrices(view.view, frustum(left, right, bottom, top, near, far), view.size, near, far)


def cube_views(
    eye: ArrayLike, near: float, far: float, resolution: int, margin: float = 0.0
) -> tuple[ViewMatrices, ...]:
    """Return the six views around a point, in the order of a cube map's faces (+x, -x, +y, -y, +z, -z).

    Each covers 90° and `margin` texels around. The axes within a face are those of `view_along`, not of a cube map.
    """
    directions = [sign * axis for axis in np.eye(3) for sign in (1.0, -1.0)]
    return tuple(cone_view(eye, along, math.pi / 4, near, far, resolution, margin) for along in directions)


# --- frusta ----------------------------------------------------------------------------------------------------------


def frustum_planes(view: ViewMatrices) -> Points:
    """Return planes (a, b, c, d) with a x + b y + c z + d >= 0 inside, shape (n, 4), without a far plane that float64
    cannot distinguish from infinity."""
    rows = view.projection @ view.view
    planes = np.array([rows[3] + sign * rows[axis] for axis in (0, 1, 2) for sign in (1.0, -1.0)])
    lengths = np.linalg.norm(planes[:, :3], axis=1, keepdims=True)
    last = 5 if math.isinf(view.far) or lengths[5, 0] == 0.0 else 6
    return np.asarray(planes[:last] / lengths[:last])


def box_planes(box: ArrayLike) -> Points:
    """Return the planes (a, b, c, d) of a box, as in `frustum_planes`, shape (6, 4)."""
    low, high = np.asarray(box, np.float64)
    axes = np.eye(3)
    return np.concatenate([np.column_stack([axes, -low]), np.column_stack([-axes, high])])


def region_corners(planes: Points) -> Points:
    """Return the corners of the convex region inside all planes, shape (n, 3), where three planes meet.

    A corner in more than three planes occurs more than once; an unbounded region has few corners, or none.
    """
    triples = np.array(list(combinations(range(len(planes)), 3)))
    systems, right = planes[triples, :3], -planes[triples, 3]
    meet = np.abs(np.linalg.det(systems)) > 1e-9
    points: Points = np.asarray(np.linalg.solve(systems[meet], right[meet][..., np.newaxis])[..., 0], np.float64)
    slack = 1e-9 * (1.0 + np.abs(points).max(axis=1, initial=0.0) + np.abs(planes[:, 3]).max(initial=0.0))
    return points[np.all(points @ planes[:, :3].T + planes[:, 3] >= -slack[:, np.newaxis], axis=1)]


def sphere_bounds(
    view: ViewMatrices, center: ArrayLike, radius: float
) -> tuple[tuple[int, int, int, int], tuple[float, float]]:
    """Return the part of a view's picture that a sphere covers: x, y, width, height in texels, and depth bounds.

    A plane x = k w of the view touches the sphere if `(P - k Q)² = r² |A - k B|²`, with P, Q the rows of x and w
    applied to its centre and A, B their directions: the sphere lies between the two solutions k. They are exact for any
    projection. A sphere that reaches behind the eye may cover everything; one outside the picture has no width or
    height.
    """
    rows = view.projection @ view.view
    reversed_z = (rows[3] - rows[2]) / 2  # as stored in the depth texture
    point = np.append(np.asarray(center, np.float64), 1.0)
    w, b = rows[3] @ point, rows[3, :3]
    if w < -radius * np.linalg.norm(b):
        return (0, 0, 0, 0), (0.0, 1.0)
    a2 = w * w - radius * radius * (b @ b)
    found = []
    for row, least in ((rows[0], -1.0), (rows[1], -1.0), (reversed_z, 0.0)):
        low, high = least, 1.0
        if w > 0 and a2 > 0:  # entirely in front of the eye
            p, a = row @ point, row[:3]
            half = p * w - radius * radius * (a @ b)
            root = math.sqrt(max(half * half - a2 * (p * p - radius * radius * (a @ a)), 0.0))
            low, high = max(low, (half - root) / a2), min(high, (half + root) / a2)
        found.append((low, high))
    (left, right), (bottom, top), (farthest, nearest) = found
    if left >= right or bottom >= top or farthest >= nearest:
        return (0, 0, 0, 0), (0.0, 1.0)
    width, height = view.size
    x, y = math.floor((left + 1) / 2 * width), math.floor((bottom + 1) / 2 * height)
    rectangle = x, y, math.ceil((right + 1) / 2 * width) - x, math.ceil((top + 1) / 2 * height) - y
    return rectangle, (farthest * (1 - 1e-6), min(nearest * (1 + 1e-6), 1.0))


def frustum_corners(view: ViewMatrices, near: float | None = None, far: float | None = None) -> Points:
    """Return the eight corners of a view's frustum, or of its part between two distances along the axis, shape (8, 3).

    The four at `near` come first; in each four, left before right and bottom before top, x fastest.

    Raises:
        ValueError: the far plane is infinite, and `far` is not given.
    """
    near, far = view.near if near is None else near, view.far if far is None else far
    if math.isinf(far):
        raise ValueError("the view reaches to infinity; give the distance of the far corners")
    inverse = np.linalg.inv(view.projection @ view.view)
    corners = []
    for distance in (near, far):
        _, _, z, w = view.projection @ np.array([0.0, 0.0, -distance, 1.0])
        corners += [inverse @ np.array([x * w, y * w, z, w]) for y in (-1.0, 1.0) for x in (-1.0, 1.0)]
    return np.array([corner[:3] / corner[3] for corner in corners])


def box_corners(box: ArrayLike) -> Points:
    """Return the eight corners of a box, shape (8, 3), z fastest."""
    box = np.asarray(box, np.float64)
    return np.array([[box[x, 0], box[y, 1], box[z, 2]] for x in (0, 1) for y in (0, 1) for z in (0, 1)])


def clip_polygon(polygon: Points, planes: Points) -> Points:
    """Return the part of a convex polygon inside all planes (Sutherland and Hodgman 1974), shape (n, 3).

    It may be empty; a corner in a plane may occur twice.
    """
    corners = np.asarray(polygon, np.float64).reshape(-1, 3).tolist()
    for x, y, z, w in np.asarray(planes, np.float64).tolist():  # for so few numbers, Python is faster than NumPy
        kept: list[list[float]] = []
        distances = [x * corner[0] + y * corner[1] + z * corner[2] + w for corner in corners]
        for number, (a, da) in enumerate(zip(corners, distances, strict=True)):
            b, db = corners[number + 1 - len(corners)], distances[number + 1 - len(corners)]
            if da >= 0:
                kept.append(a)
            if (da >= 0) != (db >= 0):
                along = da / (da - db)
                kept.append([p + (q - p) * along for p, q in zip(a, b, strict=True)])
        corners = kept
    return np.array(corners, np.float64).reshape(-1, 3)


def visible_part(view: ViewMatrices, box: ArrayLike) -> Points:
    """Return points whose convex hull is the visible part of a box, shape (n, 3); none if it is not visible."""
    return region_corners(np.concatenate([frustum_planes(view), box_planes(box)]))
