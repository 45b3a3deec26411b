"""Cascaded shadow maps."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from rendergraph.api import Frame, ViewMatrices, param, structural

from ._cascades import bounding_sphere, cascade_view, farthest_visible, overlapping_spans, split_distances
from ._light_views import casting_points, receiving_box
from .shadow_map import ShadowMapNode


class ShadowCascaded(ShadowMapNode):
    """Render depth from lights with several cascades per directional light, small near the eye and large far away.

    The visible depth range is split (Zhang, Sun, Xu and Lun 2006), and each cascade has its own layer, so texels are
    fine near the eye and just sufficient at the horizon. All techniques that take a `shadow_map` work with this one.
    The layer is selected by the distance from the camera, and adjacent cascades are blended. Texels are stable in world
    space while the camera moves: a layer has the size of the bounding sphere of its cascade, regardless of the camera's
    orientation, and moves by whole texels (Valient, "Stable Rendering of Cascaded Shadow Maps", 2008). Spot and point
    lights have the same layers as in `shadow_map`.
    """

    cascades: int = structural(default=4, min=1, max=8, doc="Number of cascades, one layer each.")
    weight: float = param(
        default=0.9, min=0, max=1, doc="Splits of equal length (0), logarithmic splits (1), or a mix of both."
    )
    blend: float = param(
        default=0.1, min=0, max=0.5, doc="Fraction of each cascade over which it is blended with the next."
    )
    reach: float = param(
        default=0.0, unit="m", min=0, doc="Distance from the eye that the cascades cover; 0 covers everything visible."
    )

    def layers(self, kind: str) -> int:
        """Return the number of layers of a kind of light."""
        return self.cascades if kind == "directional" else super().layers(kind)

    def light_views(self, light: Any, frame: Frame) -> Sequence[ViewMatrices]:
        """Return the views of one light; a directional light has one per cascade."""
        if light.type != "directional":
            return super().light_views(light, frame)
        camera, box = self.eye(frame), receiving_box(frame.scene, light)
        far = max(self.reach, 2 * camera.near) if self.reach else farthest_visible(camera, box)
        distances = split_distances(camera.near, far, self.cascades, self.weight)
        spans = overlapping_spans(distances, self.blend)
        casting = casting_points(frame.scene, light.direction)
        views = []
        for span, end in zip(spans, distances[1:], strict=True):
            sphere = bounding_sphere(camera, max(span[0], camera.near), end)
            views.append(replace(cascade_view(light.direction, sphere, box, casting, self.resolution), span=span))
        return views
