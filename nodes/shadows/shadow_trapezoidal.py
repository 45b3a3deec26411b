"""Trapezoidal shadow maps."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from rendergraph.api import Frame, ViewMatrices, param, projection

from ._trapezoid import warped
from .shadow_map import ShadowMapNode

_MARGIN = 8.0  # texels around what is seen, as for other maps


class ShadowTrapezoidal(ShadowMapNode):
    """Depth seen from lights, its texels crowded where the camera looks closely (Martin and Tan 2004).

    What the camera sees is, in a light's picture, about a trapezoid: narrow near the eye and wide far off. A projective
    map makes it fill the texture, so that the part near the eye, `focus`, takes four fifths of its texels. The
    trapezoid changes smoothly with the camera, and so do shadows' edges; they do not stand still as cascades' do. Where
    the light shines along the view, and for a spot light that the camera sees behind, it is `shadow_map`'s.
    """

    focus: float = param(
        default=0.5,
        min=0.01,
        max=1,
        doc="Share of the visible range, from the eye on, that takes four fifths of the texels.",
    )

    def light_views(self, light: Any, frame: Frame) -> Sequence[ViewMatrices]:
        """The views that `shadow_map` has, those of directional and spot lights warped."""
        views = super().light_views(light, frame)
        if light.type == "point":
            return views
        eye = self.eye(frame)
        seen = projection.visible_part(eye, np.asarray(frame.scene.bounds, np.float64))
        return [warped(view, seen, eye, self.focus, _MARGIN) for view in views]
