"""A view that sees more than the picture shows."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from rendergraph.api import Facts, Frame, Node, Steps, Views, structural


def _size(node: GuardBand, facts: Facts) -> tuple[int, int]:
    return node.banded(facts.viewport)


class GuardBand(Node):
    """The camera's view with a band around the picture, for techniques that look at no more than is drawn.

    A G-buffer that takes it is larger, and so is all that is made of it, texel by texel: its middle is the picture, to
    the last bit of every ray. `crop` brings that back to size. What a surface near the border has beside it, out of
    sight, is then there to occlude it or to send it light.
    """

    view = Views(size=_size, doc="The camera's, wider to all sides.")

    width: float = structural(default=0.25, min=0, max=2, doc="Of the band to each side, as a share of the picture's.")

    def record(self, steps: Steps) -> None:
        """Nothing: others draw with it."""

    def update(self, frame: Frame) -> None:
        """The camera's eye and axes, and a projection as much wider as the picture is larger."""
        camera = frame.camera
        size = self.banded(camera.size)
        share = [small / large for small, large in zip(camera.size, size, strict=True)]
        projection = np.diag([*share, 1.0, 1.0]) @ camera.projection
        jitter = (camera.jitter[0] * share[0], camera.jitter[1] * share[1])  # as many texels, of a wider picture
        frame.set_views(self.view, [replace(camera, projection=projection, size=size, jitter=jitter)])

    def banded(self, size: tuple[int, int]) -> tuple[int, int]:
        """A picture's size with the band around it."""
        width, height = (side + 2 * math.ceil(self.width * side) for side in size)
        return width, height
