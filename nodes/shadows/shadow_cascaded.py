"""Cascaded shadow maps."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from rendergraph.api import Frame, ViewMatrices, param, structural

from ._cascades import cascade_view, farthest_seen, overlapping_spans, slice_sphere, split_distances
from ._light_views import casting_points
from .shadow_map import ShadowMapNode


class ShadowCascaded(ShadowMapNode):
    """Depth seen from lights, in several maps a directional light: small ones near the eye, large ones far off.

    The distances that the camera sees are parted (Zhang, Sun, Xu and Lun 2006) and each part has a layer of its own, so
    that texels near the eye are fine and those at the horizon suffice. Whatever filters a `shadow_map` filters this
    one. Layers are chosen by a point's distance, and where parts meet they are blended. Texels stand still in the world
    while the camera moves: a layer has the size of the ball around its part, however that is turned, and moves by whole
    texels (Valient, "Stable Rendering of Cascaded Shadow Maps", 2008). Spot and point lights have what `shadow_map`
    gives them.
    """

    cascades: int = structural(default=4, min=1, max=8, doc="Parts of the distance, a layer each.")
    weight: float = param(
        default=0.9, min=0, max=1, doc="Splits of equal length (0), logarithmic splits (1), or a mix of both."
    )
    blend: float = param(default=0.1, min=0, max=0.5, doc="Share of each part over which the next is blended in.")
    reach: float = param(
        default=0.0, unit="m", min=0, doc="How far from the eye parts go; 0 is as far as anything of the scene is seen."
    )

    def layers(self, kind: str) -> int:
        """How many layers a light of a kind has."""
        return self.cascades if kind == "directional" else super().layers(kind)

    def light_views(self, light: Any, frame: Frame) -> Sequence[ViewMatrices]:
        """One view a part of a directional light."""
        if light.type != "directional":
            return super().light_views(light, frame)
        camera, box = self.eye(frame), np.asarray(frame.scene.bounds, np.float64)
        far = max(self.reach, 2 * camera.near) if self.reach else farthest_seen(camera, box)
        distances = split_distances(camera.near, far, self.cascades, self.weight)
        spans = overlapping_spans(distances, self.blend)
        casting = casting_points(frame.scene, light.direction)
        views = []
        for span, end in zip(spans, distances[1:], strict=True):
            ball = slice_sphere(camera, max(span[0], camera.near), end)
            views.append(replace(cascade_view(light.direction, ball, box, casting, self.resolution), span=span))
        return views
