"""Views: projections, frusta, what a view sees of a box, and views fitted around something.

Conventions are the field's: right-handed, +Y up, a view looks down its own -Z; matrices act on column vectors and are
float64 of shape (4, 4); clip space has z in -w…w. Angles are radians, distances metres, points world space of shape
(n, 3), and a box is its least and its greatest corner, shape (2, 3).
"""

from __future__ import annotations

import math
from itertools import combinations

import numpy as np
import numpy.typing as npt

from rendergraph.steps import ViewMatrices

Matrix = npt.NDArray[np.float64]
Points = npt.NDArray[np.float64]

INFINITE_EPSILON = 2.4e-7
"""How far an infinite far plane stays inside the clip volume: two steps of a float32 at 1."""

BOX_FACES = ((0, 1, 3, 2), (4, 5, 7, 6), (0, 1, 5, 4), (2, 3, 7, 6), (0, 2, 6, 4), (1, 3, 7, 5))
"""The corners of each side of a box, as `box_corners` has them, all around."""


# --- projections: view space to clip space ---------------------------------------------------------------------------


def frustum(left: float, right: float, bottom: float, top: float, near: float, far: float) -> Matrix:
    """A perspective projection by what it sees of the near plane; `far` may be infinite."""
    if math.isinf(far):
        z, w = INFINITE_EPSILON - 1, near * (INFINITE_EPSILON - 2)
    else:
        z, w = (far + near) / (near - far), 2 * far * near / (near - far)
    return np.array(
        [
            [2 * near / (right - left), 0, (right + left) / (right - left), 0],
            [0, 2 * near / (top - bottom), (top + bottom) / (top - bottom), 0],
            [0, 0, z, w],
            [0, 0, -1, 0],
        ],
        np.float64,
    )


def perspective(fov_y: float, aspect: float, near: float, far: float) -> Matrix:
    """A perspective projection by its whole vertical angle and its width over height; `far` may be infinite."""
    matrix = frustum(-1, 1, -1, 1, near, far)
    matrix[1, 1] = 1 / math.tan(fov_y / 2)
    matrix[0, 0] = matrix[1, 1] / aspect
    return matrix


def orthographic(left: float, right: float, bottom: float, top: float, near: float, far: float) -> Matrix:
    """A parallel projection; `near` may be 0 or behind the view."""
    return np.array(
        [
            [2 / (right - left), 0, 0, -(right + left) / (right - left)],
            [0, 2 / (top - bottom), 0, -(top + bottom) / (top - bottom)],
            [0, 0, -2 / (far - near), -(far + near) / (far - near)],
            [0, 0, 0, 1],
        ],
        np.float64,
    )


def widened(projection: Matrix, factor: float) -> Matrix:
    """The projection of a view that reaches farther to all sides, what it saw in the middle `1 / factor` of it."""
    return np.diag([1 / factor, 1 / factor, 1.0, 1.0]) @ projection


def shifted(projection: Matrix, x: float, y: float) -> Matrix:
    """The projection of a picture moved by x and y in clip space's units, 2 / size a texel: jitter."""
    moved = np.eye(4)
    moved[:2, 3] = x, y
    return moved @ projection


def guard_band(resolution: int, texels: float) -> float:
    """How much wider a view becomes by a band of texels around it that are part of its own `resolution` a side.

    At most twice as wide, where there are hardly more texels than the band's.
    """
    return resolution / max(resolution - 2 * texels, 0.5 * resolution)


# --- views: world space to view space --------------------------------------------------------------------------------


def unit(vectors: npt.ArrayLike) -> Points:
    """Vectors along the last axis made unit length; those of length zero stay zero."""
    given = np.asarray(vectors, np.float64)
    rows = given.reshape(math.prod(given.shape[:-1]), given.shape[-1])
    parts = np.ascontiguousarray(rows.T)  # NumPy is slow along short axes
    peak = np.abs(parts).max(axis=0, initial=0.0)
    scaled = parts / np.where(peak > 0, peak, 1.0)  # so that neither tiny nor huge vectors lose their square
    length = np.sqrt((scaled * scaled).sum(axis=0))
    return np.ascontiguousarray((scaled / np.where(length > 0, length, 1.0)).T).reshape(given.shape)


def look_at(eye: npt.ArrayLike, target: npt.ArrayLike, up: npt.ArrayLike = (0.0, 1.0, 0.0)) -> Matrix:
    """View to world, a camera's transform: at `eye`, looking at `target`. `inverse_rigid` of it is the view matrix.

    Where `up` is along the line of sight another axis takes its place, so a camera may look straight down.

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
    """The cross product of two vectors, shape (3,); `np.cross` takes ten times as long for a single pair."""
    (x, y, z), (u, v, w) = a.tolist(), b.tolist()
    return np.array([y * w - z * v, z * u - x * w, x * v - y * u])


def inverse_rigid(transform: Matrix) -> Matrix:
    """The inverse of a rotation with a translation, exact where `np.linalg.inv` rounds."""
    rotation = transform[:3, :3].T
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = rotation, -rotation @ transform[:3, 3]
    return matrix


def view_along(
    direction: npt.ArrayLike, side: npt.ArrayLike | None = None, eye: npt.ArrayLike = (0.0, 0.0, 0.0)
) -> Matrix:
    """World to view: from `eye` along a direction, with `side` towards +x, which is any one by default."""
    forward = np.asarray(direction, np.float64)
    forward = forward / np.linalg.norm(forward)
    side = any_side(direction) if side is None else np.asarray(side, np.float64)
    x = side - forward * (side @ forward)
    x /= np.linalg.norm(x)
    view = np.eye(4)
    view[:3, :3] = np.stack([x, _cross(-forward, x), -forward])
    view[:3, 3] = -view[:3, :3] @ np.asarray(eye, np.float64)
    return view


def any_side(direction: npt.ArrayLike) -> Matrix:
    """The axis of the world that lies most across a direction, shape (3,)."""
    side = np.zeros(3)
    side[int(np.argmin(np.abs(np.asarray(direction, np.float64))))] = 1.0
    return side


# --- views fitted around something -----------------------------------------------------------------------------------


def orthographic_view(
    rotation: Matrix, low: npt.ArrayLike, high: npt.ArrayLike, resolution: int, margin: float = 0.0
) -> ViewMatrices:
    """A parallel view around a box that is given in the axes of a rotation.

    Args:
        rotation: world to view without a place, as `view_along` gives it.
        low, high: least and greatest of what it holds, shape (3,), after the rotation; the view looks from `high` to
            `low` in z. Nothing of it lies at the near or the far plane.
        resolution: texels along a side.
        margin: texels around it.
    """
    low, high = np.asarray(low, np.float64), np.asarray(high, np.float64)
    size = np.maximum(high[:2] - low[:2], 1e-6 * max(1.0, float(np.abs([low[2], high[2]]).max())))
    size = size * guard_band(resolution, margin)
    slack = 1e-3 * max(float(high[2] - low[2]), float(size.max()), 1e-6)
    near, far = -high[2] - slack, -low[2] + slack
    view = rotation.copy()
    view[:2, 3] = -(low[:2] + high[:2]) / 2
    view[2, 3] = near  # the box begins at the near plane
    width, height = size / 2
    projection = orthographic(-width, width, -height, height, 0.0, far - near)
    return ViewMatrices(view, projection, (resolution, resolution), 0.0, float(far - near))


def cone_view(
    eye: npt.ArrayLike,
    direction: npt.ArrayLike,
    half_angle: float,
    near: float,
    far: float,
    resolution: int,
    margin: float = 0.0,
) -> ViewMatrices:
    """A square perspective view that holds a cone, with `margin` texels around it."""
    wider = math.atan(math.tan(half_angle) * guard_band(resolution, margin))
    projection = perspective(2 * wider, 1.0, near, far)
    return ViewMatrices(view_along(direction, eye=eye), projection, (resolution, resolution), near, far)


def narrowed_view(
    view: ViewMatrices, low: npt.ArrayLike, high: npt.ArrayLike, near: float, far: float, margin: float = 0.0
) -> ViewMatrices:
    """A perspective view from the same place that holds less: a rectangle of slopes, with texels around it.

    Args:
        view: along an axis, which may now lie beside the rectangle.
        low, high: least and greatest x and y of what it holds, over the distance along the axis, shape (2,).
        near, far: metres.
        margin: texels around it.
    """
    low, high = np.asarray(low, np.float64), np.asarray(high, np.float64)
    middle = (low + high) / 2
    half = np.maximum(high - middle, 1e-6) * guard_band(view.size[0], margin)
    (left, bottom), (right, top) = (middle - half) * near, (middle + half) * near
    return ViewMatrices(view.view, frustum(left, right, bottom, top, near, far), view.size, near, far)


def cube_views(
    eye: npt.ArrayLike, near: float, far: float, resolution: int, margin: float = 0.0
) -> tuple[ViewMatrices, ...]:
    """The six views around a point, in the order of a cube map's faces (+x, -x, +y, -y, +z, -z).

    Each holds 90° and `margin` texels around that. The axes across a face are those of `view_along`, not a cube map's.
    """
    directions = [sign * axis for axis in np.eye(3) for sign in (1.0, -1.0)]
    return tuple(cone_view(eye, along, math.pi / 4, near, far, resolution, margin) for along in directions)


# --- frusta ----------------------------------------------------------------------------------------------------------


def frustum_planes(view: ViewMatrices) -> Points:
    """Planes (a, b, c, d) with a x + b y + c z + d >= 0 inside, shape (n, 4); without the far one where it is so far
    that float64 does not know it from infinity."""
    rows = view.projection @ view.view
    planes = np.array([rows[3] + sign * rows[axis] for axis in (0, 1, 2) for sign in (1.0, -1.0)])
    lengths = np.linalg.norm(planes[:, :3], axis=1, keepdims=True)
    last = 5 if math.isinf(view.far) or lengths[5, 0] == 0.0 else 6
    found: Points = planes[:last] / lengths[:last]
    return found


def box_planes(box: npt.ArrayLike) -> Points:
    """Planes (a, b, c, d) of a box, as `frustum_planes` has a view's, shape (6, 4)."""
    low, high = np.asarray(box, np.float64)
    axes = np.eye(3)
    return np.concatenate([np.column_stack([axes, -low]), np.column_stack([-axes, high])])


def region_corners(planes: Points) -> Points:
    """Corners of the convex region that lies inside all planes, shape (n, 3): each where three of them meet.

    A corner in more than three planes stands there more than once; a region without end has few corners, or none.
    """
    triples = np.array(list(combinations(range(len(planes)), 3)))
    systems, right = planes[triples, :3], -planes[triples, 3]
    meet = np.abs(np.linalg.det(systems)) > 1e-9
    points: Points = np.asarray(np.linalg.solve(systems[meet], right[meet][..., np.newaxis])[..., 0], np.float64)
    slack = 1e-9 * (1.0 + np.abs(points).max(axis=1, initial=0.0) + np.abs(planes[:, 3]).max(initial=0.0))
    return points[np.all(points @ planes[:, :3].T + planes[:, 3] >= -slack[:, np.newaxis], axis=1)]


def sphere_bounds(
    view: ViewMatrices, center: npt.ArrayLike, radius: float
) -> tuple[tuple[int, int, int, int], tuple[float, float]]:
    """What part of a view's picture a ball covers: x, y, width and height in texels, least and greatest window depth.

    A plane of the view's x = k w touches the ball where `(P - k Q)² = r² |A - k B|²`, with P, Q the rows of x and w
    applied to its centre and A, B their directions: two values of k, between which the ball lies. They are exact for
    any projection. A ball that reaches behind the eye may cover everything; one that lies beside the picture has no
    width or height.
    """
    rows = view.projection @ view.view
    reversed_z = (rows[3] - rows[2]) / 2  # as it is stored
    point = np.append(np.asarray(center, np.float64), 1.0)
    w, b = rows[3] @ point, rows[3, :3]
    if w < -radius * np.linalg.norm(b):
        return (0, 0, 0, 0), (0.0, 1.0)
    a2 = w * w - radius * radius * (b @ b)
    found = []
    for row, least in ((rows[0], -1.0), (rows[1], -1.0), (reversed_z, 0.0)):
        low, high = least, 1.0
        if w > 0 and a2 > 0:  # wholly before the eye
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
    """The eight corners of a view's frustum, or of the part between two distances along its axis, shape (8, 3).

    The four at `near` come first, each time left before right and bottom before top, x fastest.

    Raises:
        ValueError: the far plane is infinite, and `far` is not given.
    """
    near, far = view.near if near is None else near, view.far if far is None else far
    if math.isinf(far):
        raise ValueError("the view reaches to infinity; give the distance of the far corners")
    inverse = np.linalg.inv(view.projection @ view.view)
    corners = []
    for distance in (near, far):
        clip = view.projection @ np.array([0.0, 0.0, -distance, 1.0])
        for y in (-1.0, 1.0):
            for x in (-1.0, 1.0):
                corner = inverse @ np.array([x * clip[3], y * clip[3], clip[2], clip[3]])
                corners.append(corner[:3] / corner[3])
    return np.array(corners)


def box_corners(box: npt.ArrayLike) -> Points:
    """The eight corners of a box, shape (8, 3), z fastest."""
    box = np.asarray(box, np.float64)
    return np.array([[box[x, 0], box[y, 1], box[z, 2]] for x in (0, 1) for y in (0, 1) for z in (0, 1)])


def clip_polygon(polygon: Points, planes: Points) -> Points:
    """The part of a convex polygon inside all planes (Sutherland and Hodgman 1974), shape (n, 3).

    It may be empty; a corner in a plane may stand in it twice.
    """
    corners = np.asarray(polygon, np.float64).reshape(-1, 3).tolist()
    for x, y, z, w in np.asarray(planes, np.float64).tolist():  # of so few numbers Python is faster than NumPy
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


def visible_part(view: ViewMatrices, box: npt.ArrayLike) -> Points:
    """Points whose hull is the part of a box that a view sees, shape (n, 3); none where it sees nothing of it."""
    return region_corners(np.concatenate([frustum_planes(view), box_planes(box)]))
