"""Views of all that lies before the eye."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from rendergraph.api import Frame, Node, SceneError, Steps, Views, projection, structural


def _square(node: Hemicube, _facts: object) -> tuple[int, int]:
    return node.resolution, node.resolution


class Hemicube(Node):
    """Five views from the camera's eye that together see everything before it: half a cube (Cohen and Greenberg 1985).

    `front` looks where the camera does, 90° wide; the others look to the sides, and see the half of their face that
    lies before the eye. A picture is a plane, and goes on beside its border to the end of these views: techniques that
    look along lines of the picture find in them what lies further on.
    """

    front = Views(size=_square, doc="Where the camera looks, 90° wide and high.")
    left = Views(size=_square, doc="What lies between 45° and 90° to the left.")
    right = Views(size=_square, doc="The same to the right.")
    up = Views(size=_square, doc="The same above.")
    down = Views(size=_square, doc="The same below.")

    resolution: int = structural(default=256, unit="texels", min=16, max=8192, doc="Side of each view.")

    def record(self, steps: Steps) -> None:
        """Nothing: others draw with it."""

    def update(self, frame: Frame) -> None:
        """Five frusta that touch one another.

        Raises:
            SceneError: the camera is orthographic: it sees no more to the sides than before it.
        """
        camera = replace(frame.camera, jitter=(0.0, 0.0))  # the eye stands still
        near = camera.near
        if camera.projection[3, 3] == 1:
            raise SceneError("a hemicube stands around an eye, and this camera is orthographic; take `guard_band`")
        to_world = np.linalg.inv(camera.view)
        right, up, forward, eye = to_world[:3, 0], to_world[:3, 1], -to_world[:3, 2], to_world[:3, 3]
        whole = projection.frustum(-near, near, -near, near, near, camera.far)
        half = projection.frustum(0, near, -near, near, near, camera.far)  # x is where the camera looks
        size = self.resolution, self.resolution
        frame.set_views(self.front, [replace(camera, projection=whole, size=size)])
        for port, along in ((self.left, -right), (self.right, right), (self.up, up), (self.down, -up)):
            view = projection.view_along(along, forward, eye)
            frame.set_views(port, [replace(camera, view=view, projection=half, size=size)])
