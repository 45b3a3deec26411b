"""A studio: soft boxes on the walls of a grey room."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from rendergraph.pipelines.environments.panorama import directions, picture

_ROOM = 0.38
# Wall (axis and side), middle and half sides on the room's wall, radiance. The room reaches from -1 to 1.
_BOXES = (
    ((1, 1.0), (0.0, 0.1), (0.55, 0.5), 3.6),  # overhead, along x and z
    ((0, -1.0), (0.25, 0.35), (0.55, 0.6), 2.6),  # left, along y and z
    ((0, 1.0), (0.2, 0.35), (0.75, 0.18), 2.2),  # right, a strip
    ((2, -1.0), (-0.35, 0.45), (0.22, 0.3), 1.8),  # behind, a rim light, along x and y
    ((2, 1.0), (-0.2, 0.5), (0.6, 0.3), 1.5),  # in front, beside the viewer
)
_EDGE = 0.1


def studio() -> npt.NDArray[np.float16]:
    """A grey room with soft boxes on its walls, (256, 512, 4)."""
    ways = np.moveaxis(directions(), -1, 0)
    light = _ROOM * (0.75 + 0.25 * ways[1])  # the floor is darker than the ceiling
    for (axis, side), middle, half, radiance in _BOXES:
        first, second = (plane for at, plane in enumerate(ways) if at != axis)
        ahead = side * ways[axis]
        on_wall = ahead >= np.maximum(abs(first), abs(second))
        ahead = np.where(on_wall, ahead, 1)
        cover = on_wall.astype(np.float32)
        for plane, center, reach in zip((first, second), middle, half, strict=True):
            cover *= np.clip((reach - abs(plane / ahead - center)) / _EDGE, 0, 1)
        light += (radiance - light) * cover
    return picture(np.broadcast_to(light[..., None], (*light.shape, 3)))
