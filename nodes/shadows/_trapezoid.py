"""The trapezoid around the visible part in a light's picture, and the projective transform that maps it to a square."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from rendergraph.api import ViewMatrices, projection

Matrix = npt.NDArray[np.float64]
Points = npt.NDArray[np.float64]

FOCUS_SHARE = 0.8
"""Fraction of the map that the range in focus takes."""

_SQUARE = np.array([[1.0, 0, 0, 1], [-1, 0, 0, 1], [0, 1, 0, 1], [0, -1, 0, 1]])  # planes of the square from -1 to 1


def apex_distance(length: float, focus: float, share: float = FOCUS_SHARE) -> float:
    """Return how far in front of a trapezoid its sides must meet for the first `focus` of its `length` to fill a share.

    It is infinite if a rectangle does so already, or if the sides would have to diverge (Martin and Tan, "Anti-aliasing
    and Continuity with Trapezoidal Shadow Maps", 2004; their 80 % line is -0.6 in a picture from 1 to -1).
    """
    line = 1 - 2 * share
    rest = length - 2 * focus - length * line
    return length * focus * (1 + line) / rest if rest > 1e-9 * length else np.inf


def trapezoid_to_square(trapezoid: Points) -> Matrix:
    """Return the projective transform of a trapezoid's corners to (-1, -1), (1, -1), (1, 1), (-1, 1), shape (3, 3).

    Args:
        trapezoid: corners, shape (4, 2), the base first, counter-clockwise.
    """
    rows, right = [], []
    for (x, y), (u, v) in zip(trapezoid, ((-1, -1), (1, -1), (1, 1), (-1, 1)), strict=True):
        rows += [[x, y, 1, 0, 0, 0, -u * x, -u * y], [0, 0, 0, x, y, 1, -v * x, -v * y]]
        right += [u, v]
    return np.append(np.linalg.solve(np.array(rows, np.float64), np.array(right, np.float64)), 1.0).reshape(3, 3)


def trapezoid_around(points: Points, start: Points, ahead: Points, focus: float) -> Points | None:
    """Return a trapezoid around points of a picture, with its bases perpendicular to the line of sight, shape (4, 2).

    Args:
        points: the points, shape (n, 2).
        start, ahead: origin and direction of the line of sight, shape (2,).
        focus: fraction of its length, from the eye, that is in focus.

    Returns:
        The corners, counter-clockwise from the base farthest from the eye; None if a rectangle is as good.
    """
    ahead = ahead / np.linalg.norm(ahead)
    side = np.array([ahead[1], -ahead[0]])  # to the right
    axial, lateral = (points - start) @ ahead, (points - start) @ side
    near, far = float(axial.min()), float(axial.max())
    apex = apex_distance(far - near, focus * (far - near))
    if not np.isfinite(apex):
        return None
    center = float(lateral.min() + lateral.max()) / 2
    slopes = (lateral - center) / (axial - near + apex)
    low, high = float(slopes.min()), float(slopes.max())
    far_apex = apex + far - near
    corners = [(far, high * far_apex), (far, low * far_apex), (near, low * apex), (near, high * apex)]
    return np.array([start + a * ahead + (center + s) * side for a, s in corners])


def warp_view(view: ViewMatrices, points: Points, camera: ViewMatrices, focus: float, margin: float) -> ViewMatrices:
    """Return a light's view, warped so that it has more texels near the camera.

    Args:
        view: the light's view.
        points: corners of the visible part of the scene, shape (n, 3).
        camera: the camera's view.
        focus: fraction of the visible range, from the eye, that is in focus.
        margin: texels around the trapezoid.
    """
    matrix = view.projection @ view.view
    camera_to_world = np.linalg.inv(camera.view)
    if not len(points):
        return view
    farthest = float((-(points @ camera.view[2, :3] + camera.view[2, 3])).max())
    line = np.array([camera_to_world @ (0, 0, -distance, 1) for distance in (camera.near, farthest)])
    clip = np.concatenate([np.concatenate([points, np.ones((len(points), 1))], axis=1), line]) @ matrix.T
    if clip[:, 3].min() <= 1e-6 * np.abs(clip[:, 3]).max():
        return view  # a part of it is behind the light
    ndc = clip[:, :2] / clip[:, 3:]
    start, end = ndc[-2:]
    if np.linalg.norm(end - start) < 1e-4:
        return view  # the camera looks along the light's direction
    hull = projection.clip_polygon(np.pad(_convex_hull(ndc[:-2]), ((0, 0), (0, 1))), _SQUARE)[:, :2]
    trapezoid = trapezoid_around(hull, start, end - start, focus) if len(hull) > 2 else None
    if trapezoid is None:
        return view
    warp = trapezoid_to_square(trapezoid)
    # w is at least 1 on the trapezoid, so that nothing leaves the depth range.
    warp /= (warp[2] @ np.append(trapezoid, np.ones((4, 1)), axis=1).T).min()
    warp[:2] /= projection.guard_band(view.size[0], margin)
    matrix = np.eye(4)
    matrix[np.ix_([0, 1, 3], [0, 1, 3])] = warp
    return replace(view, projection=matrix @ view.projection)


def _convex_hull(points: Points) -> Points:
    """Return the corners of the convex hull of points in the plane, counter-clockwise (Andrew 1979)."""
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
