"""A camera view with a guard band around the picture."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from rendergraph.api import Facts, Frame, Node, Steps, Views, structural


def _size(node: GuardBand, facts: Facts) -> tuple[int, int]:
    return node.padded_size(facts.viewport)


class GuardBand(Node):
    """Provide the camera's view with a guard band around the picture, for screen-space techniques.

    A G-buffer with this view is larger, and so is everything that is computed from it per texel. Its centre is the
    picture, with bit-identical rays; `crop` cuts it out. Geometry just outside the picture can then occlude surfaces
    near the border, or light them.
    """

    view = Views(size=_size, doc="The camera's view, extended on all sides.")

    width: float = structural(
        default=0.25, min=0, max=2, doc="Width of the band on each side, as a fraction of the picture."
    )

    def record(self, steps: Steps) -> None:
        """Record nothing; other nodes draw with the view."""

    def update(self, frame: Frame) -> None:
        """Set the camera's view with a projection extended by the band."""
        camera = frame.camera
        size = self.padded_size(camera.size)
        scale = [small / large for small, large in zip(camera.size, size, strict=True)]
        projection = np.diag([*scale, 1.0, 1.0]) @ camera.projection
        jitter = (camera.jitter[0] * scale[0], camera.jitter[1] * scale[1])  # the same in texels
        frame.set_views(self.view, [replace(camera, projection=projection, size=size, jitter=jitter)])

    def padded_size(self, size: tuple[int, int]) -> tuple[int, int]:
        """Return the size of a picture with the band around it."""
        width, height = (side + 2 * math.ceil(self.width * side) for side in size)
        return width, height
