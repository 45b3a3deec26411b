"""Reflections of objects in the ground under them, a shadow catcher."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from rendergraph.api import Frame, ViewMatrices


def ground_height(frame: Frame) -> float:
    """Return the y coordinate of the ground, the scene's last shadow catcher, in metres."""
    return float(frame.scene.corners[frame.scene.catchers[-1]][:, 1].max())


def mirrored_view(view: ViewMatrices, height: float) -> ViewMatrices:
    """Return the view of a camera at the mirror image of the eye in a horizontal plane.

    It sees what the plane mirrors. Its picture is flipped left to right, because a reflected view matrix would reverse
    the winding of triangles. Apart from this flip, points of the plane are at the same place in both pictures.

    Args:
        view: the view of the picture, perspective or orthographic.
        height: y coordinate of the plane, in metres.
    """
    mirror = np.diag([1.0, -1.0, 1.0, 1.0])
    mirror[1, 3] = 2 * height
    flip = np.diag([-1.0, 1.0, 1.0, 1.0])
    return replace(
        view,
        view=flip @ view.view @ mirror,
        projection=flip @ view.projection @ flip,
        jitter=(-view.jitter[0], view.jitter[1]),
    )
