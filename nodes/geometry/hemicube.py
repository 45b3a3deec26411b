"""Views of the hemisphere in front of the camera."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from rendergraph.api import Frame, Node, SceneError, Steps, Views, projection, structural


def _square(node: Hemicube, _facts: object) -> tuple[int, int]:
    return node.resolution, node.resolution


class Hemicube(Node):
    """Provide five views from the camera's eye that cover the hemisphere in front of it (Cohen and Greenberg 1985).

    `front` looks along the camera's direction, 90° wide. The others look to the sides, and cover the half of their face
    in front of the eye. The views continue the image plane beyond the picture's border: screen-space techniques that
    march along lines on the screen continue in them.
    """

    front = Views(size=_square, doc="The camera's direction, 90° wide and high.")
    left = Views(size=_square, doc="45° to 90° to the left.")
    right = Views(size=_square, doc="45° to 90° to the right.")
    up = Views(size=_square, doc="45° to 90° upwards.")
    down = Views(size=_square, doc="45° to 90° downwards.")

    resolution: int = structural(default=256, unit="texels", min=16, max=8192, doc="Side of each view.")

    def record(self, steps: Steps) -> None:
        """Record nothing; other nodes draw with the views."""

    def update(self, frame: Frame) -> None:
        """Set five adjacent frusta.

        Raises:
            SceneError: the camera is orthographic, so it has no eye.
        """
        camera = replace(frame.camera, jitter=(0.0, 0.0))  # no jitter
        near = camera.near
        if camera.projection[3, 3] == 1:
            raise SceneError("a hemicube needs a perspective camera, but this camera is orthographic; use `guard_band`")
        to_world = np.linalg.inv(camera.view)
        right, up, forward, eye = to_world[:3, 0], to_world[:3, 1], -to_world[:3, 2], to_world[:3, 3]
        full_frustum = projection.frustum(-near, near, -near, near, near, camera.far)
        half_frustum = projection.frustum(0, near, -near, near, near, camera.far)  # x is the camera's direction
        size = self.resolution, self.resolution
        frame.set_views(self.front, [replace(camera, projection=full_frustum, size=size)])
        for port, direction in ((self.left, -right), (self.right, right), (self.up, up), (self.down, -up)):
            view = projection.view_along(direction, forward, eye)
            frame.set_views(port, [replace(camera, view=view, projection=half_frustum, size=size)])
