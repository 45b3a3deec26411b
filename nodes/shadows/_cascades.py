"""Views of cascaded shadow maps: how the picture's depth is shared out, and where each share's map lies."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from rendergraph.api import ViewMatrices, projection

Points = npt.NDArray[np.float64]

_MARGIN = 9.0  # texels around a share: eight for filter kernels, one for what is lost by whole steps
_STEP = 4  # a doubling of the distance takes so many steps


def split_distances(near: float, far: float, count: int, weight: float) -> list[float]:
    """Where `count` parts of a depth range begin and end, `count + 1` distances.

    Between the logarithmic split, which gives all parts texels of the same size on the screen, and the even one, which
    leaves more to the far parts (Zhang, Sun, Xu and Lun, "Parallel-Split Shadow Maps for Large-Scale Virtual
    Environments", 2006).

    Args:
        near, far: metres.
        count: of parts.
        weight: of the logarithmic split, 0 to 1.
    """
    shares = [part / count for part in range(count + 1)]
    return [weight * near * (far / near) ** share + (1 - weight) * (near + share * (far - near)) for share in shares]


def overlapping_spans(distances: Sequence[float], blend: float) -> list[tuple[float, float]]:
    """Where each part is looked at: from a share `blend` of the part before; the last has no end."""
    begins = [0.0] + [b - blend * (b - a) for a, b in pairwise(distances[:-1])]
    return list(zip(begins, [*distances[1:-1], math.inf], strict=True))


def farthest_seen(camera: ViewMatrices, box: Points) -> float:
    """How far along its axis a camera sees anything of a box, in metres; rounded up to a few values.

    Else every step of the camera would move all splits, and with them every texel of the maps.
    """
    corners = projection.box_corners(box)
    farthest = float((-(corners @ camera.view[2, :3] + camera.view[2, 3])).max())
    steps = math.ceil(_STEP * math.log2(max(farthest / camera.near, 2.0)) - 1e-9)
    return float(min(camera.near * 2 ** (steps / _STEP), camera.far))


def slice_sphere(camera: ViewMatrices, begin: float, end: float) -> tuple[Points, float]:
    """Centre and radius of a ball around the part of a camera's frustum between two distances.

    The radius depends on the projection alone, to the last bit: it stays as it is when the camera moves and turns.
    """
    corners = projection.frustum_corners(replace(camera, view=np.eye(4)), begin, end)
    first, last = corners[:4].mean(axis=0), corners[4:].mean(axis=0)
    axis = last - first
    # Along the axis the nearest corners and the farthest ones are equally far from the best centre.
    near_square, far_square = ((corners[part] - first) ** 2 for part in (slice(4), slice(4, 8)))
    gap = float(far_square.sum(axis=1).max() - near_square.sum(axis=1).max())
    share = min(max(gap / (2 * float(axis @ axis)), 0.0), 1.0)
    center = first + share * axis
    radius = float(np.sqrt(((corners - center) ** 2).sum(axis=1).max()))
    return (projection.inverse_rigid(camera.view) @ np.append(center, 1.0))[:3], radius


def cascade_view(
    direction: Sequence[float], ball: tuple[Points, float], box: Points, casting: Points, resolution: int
) -> ViewMatrices:
    """A directional light's view around a ball, whose texels stand still when the ball moves.

    Its size follows from the ball's alone, and it moves by whole texels. Where that is more than what casts spans, it
    lies around that, and does not move at all.

    Args:
        direction: of the light.
        ball: centre and radius of what is seen.
        box: around the scene; all of it, along the light, is within the view.
        casting: points around what casts, shape (n, 3).
        resolution: texels along a side.
    """
    rotation = projection.view_along(direction)
    center, radius = rotation[:2, :3] @ ball[0], ball[1]
    size = np.full(2, 2 * radius * projection.guard_band(resolution, _MARGIN))
    texel = size / resolution
    if len(casting):
        across = casting @ rotation[:2, :3].T
        low, high = across.min(axis=0), across.max(axis=0)
        span = (high - low) * projection.guard_band(resolution, _MARGIN)
        within = np.clip(center, np.minimum(low + radius, high), np.maximum(high - radius, low))
        center = np.where(size < span, np.round(within / texel) * texel, (low + high) / 2)
        size = np.minimum(size, span)
    else:
        center = np.round(center / texel) * texel
    along = projection.box_corners(box) @ rotation[2, :3]
    low_corner, high_corner = np.append(center - size / 2, along.min()), np.append(center + size / 2, along.max())
    return projection.orthographic_view(rotation, low_corner, high_corner, resolution)
