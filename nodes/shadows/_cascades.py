"""Views of cascaded shadow maps: the split of the depth range, and the light's view of each cascade."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from rendergraph.api import ViewMatrices, projection

Points = npt.NDArray[np.float64]

_MARGIN = 9.0  # texels around a cascade: eight for filter kernels, one because views move by whole texels
_STEPS_PER_DOUBLING = 4  # of the distance


def split_distances(near: float, far: float, count: int, weight: float) -> list[float]:
    """Return the `count + 1` split distances of a depth range.

    They interpolate between logarithmic splits, which give all cascades texels of equal size on the screen, and uniform
    splits, which leave more texels to far cascades (Zhang, Sun, Xu and Lun, "Parallel-Split Shadow Maps for Large-Scale
    Virtual Environments", 2006).

    Args:
        near, far: metres.
        count: number of cascades.
        weight: weight of the logarithmic splits, 0 to 1.
    """
    fractions = [number / count for number in range(count + 1)]
    return [weight * near * (far / near) ** s + (1 - weight) * (near + s * (far - near)) for s in fractions]


def overlapping_spans(distances: Sequence[float], blend: float) -> list[tuple[float, float]]:
    """Return each cascade's span of distances; it begins in the last fraction `blend` of the previous cascade."""
    begins = [0.0] + [b - blend * (b - a) for a, b in pairwise(distances[:-1])]
    return list(zip(begins, [*distances[1:-1], math.inf], strict=True))


def farthest_visible(camera: ViewMatrices, box: Points) -> float:
    """Return the largest distance along a camera's axis at which it sees a box, in metres, rounded up in coarse steps.

    Without rounding, every movement of the camera would change all splits, and with them every texel of the maps.
    """
    corners = projection.box_corners(box)
    farthest = float((-(corners @ camera.view[2, :3] + camera.view[2, 3])).max())
    steps = math.ceil(_STEPS_PER_DOUBLING * math.log2(max(farthest / camera.near, 2.0)) - 1e-9)
    return float(min(camera.near * 2 ** (steps / _STEPS_PER_DOUBLING), camera.far))


def bounding_sphere(camera: ViewMatrices, begin: float, end: float) -> tuple[Points, float]:
    """Return the centre and radius of a sphere around the part of a camera's frustum between two distances.

    The radius depends only on the projection: it stays bit-identical when the camera moves or rotates.
    """
    corners = projection.frustum_corners(replace(camera, view=np.eye(4)), begin, end)
    first, last = corners[:4].mean(axis=0), corners[4:].mean(axis=0)
    axis = last - first
    # The best centre on the axis has the same distance to the nearest and to the farthest corners.
    near_square, far_square = ((corners[part] - first) ** 2 for part in (slice(4), slice(4, 8)))
    gap = float(far_square.sum(axis=1).max() - near_square.sum(axis=1).max())
    fraction = min(max(gap / (2 * float(axis @ axis)), 0.0), 1.0)
    center = first + fraction * axis
    radius = float(np.sqrt(((corners - center) ** 2).sum(axis=1).max()))
    return (projection.inverse_rigid(camera.view) @ np.append(center, 1.0))[:3], radius


def cascade_view(
    direction: Sequence[float], sphere: tuple[Points, float], box: Points, casting: Points, resolution: int
) -> ViewMatrices:
    """Return a directional light's view around a sphere; its texels stay in place when the sphere moves.

    Its size depends only on the sphere's radius, and it moves by whole texels. If the casters span less than this size,
    the view covers the casters and does not move at all.

    Args:
        direction: direction of the light.
        sphere: centre and radius of the visible part.
        box: the scene's bounds, which are within the view along the light's direction.
        casting: points around the casters, shape (n, 3).
        resolution: texels along a side.
    """
    rotation = projection.view_along(direction)
    center, radius = rotation[:2, :3] @ sphere[0], sphere[1]
    size = np.full(2, 2 * radius * projection.guard_band(resolution, _MARGIN))
    texel = size / resolution
    if len(casting):
        lateral = casting @ rotation[:2, :3].T
        low, high = lateral.min(axis=0), lateral.max(axis=0)
        span = (high - low) * projection.guard_band(resolution, _MARGIN)
        clamped = np.clip(center, np.minimum(low + radius, high), np.maximum(high - radius, low))
        center = np.where(size < span, np.round(clamped / texel) * texel, (low + high) / 2)
        size = np.minimum(size, span)
    else:
        center = np.round(center / texel) * texel
    axial = projection.box_corners(box) @ rotation[2, :3]
    low_corner, high_corner = np.append(center - size / 2, axial.min()), np.append(center + size / 2, axial.max())
    return projection.orthographic_view(rotation, low_corner, high_corner, resolution)
