"""What a ground that catches shadows mirrors of the objects on it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from rendergraph.api import Frame, ViewMatrices


def ground_height(frame: Frame) -> float:
    """Return y of the ground in metres: the scene's last shadow catcher."""
    return float(frame.scene.corners[frame.scene.catchers[-1]][:, 1].max())


def mirrored_view(view: ViewMatrices, height: float) -> ViewMatrices:
    """Return the view of a camera at the mirror image of the eye in a horizontal plane.

    It sees what the plane mirrors. Its picture is flipped left to right, as by a camera: a reflected view matrix would
    turn the winding of triangles round. A point of the plane lies at the same place of both pictures but for the flip.

    Args:
        view: the view of the picture, perspective or orthographic.
        height: of the plane, y in metres.
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
