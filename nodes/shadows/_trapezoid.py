"""The trapezoid around what is seen in a light's picture, and the projective map that makes it fill the picture."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from rendergraph.api import ViewMatrices, projection

Matrix = npt.NDArray[np.float64]
Points = npt.NDArray[np.float64]

FOCUS_SHARE = 0.8
"""Of the map that goes to what is in focus."""

_SQUARE = np.array([[1.0, 0, 0, 1], [-1, 0, 0, 1], [0, 1, 0, 1], [0, -1, 0, 1]])  # planes around -1 to 1


def apex_distance(length: float, focus: float, share: float = FOCUS_SHARE) -> float:
    """How far before a trapezoid its sides meet, so that the first `focus` of its `length` fills a share of the map.

    Infinite where it does so already, or its sides would have to part the other way (Martin and Tan, "Anti-aliasing and
    Continuity with Trapezoidal Shadow Maps", 2004; their line at 80 % is -0.6 in a picture from 1 to -1).
    """
    line = 1 - 2 * share
    rest = length - 2 * focus - length * line
    return length * focus * (1 + line) / rest if rest > 1e-9 * length else np.inf


def trapezoid_to_square(trapezoid: Points) -> Matrix:
    """The projective map of a trapezoid's corners to (-1, -1), (1, -1), (1, 1), (-1, 1), shape (3, 3).

    Args:
        trapezoid: (4, 2), the base first, counter-clockwise.
    """
    rows, right = [], []
    for (x, y), (u, v) in zip(trapezoid, ((-1, -1), (1, -1), (1, 1), (-1, 1)), strict=True):
        rows += [[x, y, 1, 0, 0, 0, -u * x, -u * y], [0, 0, 0, x, y, 1, -v * x, -v * y]]
        right += [u, v]
    return np.append(np.linalg.solve(np.array(rows, np.float64), np.array(right, np.float64)), 1.0).reshape(3, 3)


def trapezoid_around(points: Points, start: Points, ahead: Points, focus: float) -> Points | None:
    """A trapezoid around points of a picture, its sides at right angles to the line of sight, shape (4, 2).

    Args:
        points: (n, 2), what it holds.
        start, ahead: (2,), where the line of sight begins, and its direction.
        focus: share of its length, from the eye, that is in focus.

    Returns:
        The base, farthest from the eye, first, counter-clockwise; None where an upright rectangle does as well.
    """
    ahead = ahead / np.linalg.norm(ahead)
    side = np.array([ahead[1], -ahead[0]])  # to the right, looking ahead
    along, across = (points - start) @ ahead, (points - start) @ side
    near, far = float(along.min()), float(along.max())
    apex = apex_distance(far - near, focus * (far - near))
    if not np.isfinite(apex):
        return None
    middle = float(across.min() + across.max()) / 2
    slopes = (across - middle) / (along - near + apex)
    low, high = float(slopes.min()), float(slopes.max())
    widest, least = apex + far - near, apex
    corners = [(far, high * widest), (far, low * widest), (near, low * least), (near, high * least)]
    return np.array([start + a * ahead + (middle + s) * side for a, s in corners])


def warped(view: ViewMatrices, points: Points, camera: ViewMatrices, focus: float, margin: float) -> ViewMatrices:
    """A light's view whose texels go where the camera looks closely.

    Args:
        view: of the light, that holds what is needed.
        points: (n, 3), the corners of what the camera sees.
        camera: what the picture is seen with.
        focus: share of what is seen, from the eye on, that is in focus.
        margin: texels around the trapezoid.
    """
    matrix = view.projection @ view.view
    eye = np.linalg.inv(camera.view)
    if not len(points):
        return view
    farthest = float((-(points @ camera.view[2, :3] + camera.view[2, 3])).max())
    line = np.array([eye @ (0, 0, -distance, 1) for distance in (camera.near, farthest)])
    clip = np.concatenate([np.concatenate([points, np.ones((len(points), 1))], axis=1), line]) @ matrix.T
    if clip[:, 3].min() <= 1e-6 * np.abs(clip[:, 3]).max():
        return view  # something of it is behind the light
    flat = clip[:, :2] / clip[:, 3:]
    start, end = flat[-2:]
    if np.linalg.norm(end - start) < 1e-4:
        return view  # seen along the light
    hull = projection.clip_polygon(np.pad(_hull(flat[:-2]), ((0, 0), (0, 1))), _SQUARE)[:, :2]
    found = trapezoid_around(hull, start, end - start, focus) if len(hull) > 2 else None
    if found is None:
        return view
    small = trapezoid_to_square(found)
    small /= (
        small[2] @ np.append(found, np.ones((4, 1)), axis=1).T
    ).min()  # at least 1: nothing leaves the depth range
    small[:2] /= projection.guard_band(view.size[0], margin)
    warp = np.eye(4)
    warp[np.ix_([0, 1, 3], [0, 1, 3])] = small
    return replace(view, projection=warp @ view.projection)


def _hull(points: Points) -> Points:
    """Corners of the convex hull of points in the plane, counter-clockwise (Andrew 1979)."""
    ordered = np.unique(points, axis=0)
    if len(ordered) < 3:
        return ordered

    def chain(some: Points) -> list[Points]:
        kept: list[Points] = []
        for point in some:
            while len(kept) > 1:
                (ax, ay), (bx, by) = kept[-1] - kept[-2], point - kept[-2]
                if ax * by - ay * bx > 0:
                    break
                kept.pop()
            kept.append(point)
        return kept[:-1]

    return np.array([*chain(ordered), *chain(ordered[::-1])])
