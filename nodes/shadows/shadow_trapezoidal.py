"""Trapezoidal shadow maps."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from rendergraph.api import Frame, ViewMatrices, param, projection

from ._light_views import receiving_box
from ._trapezoid import warp_view
from .shadow_map import ShadowMapNode

_MARGIN = 8.0  # texels around the visible part, as for other maps


class ShadowTrapezoidal(ShadowMapNode):
    """Render depth from lights with more texels near the camera (Martin and Tan 2004).

    Seen from a light, the camera's view frustum is roughly a trapezoid, narrow near the eye and wide far away. A
    projective transform maps it to the whole texture, so that the part near the eye, `focus`, takes four fifths of the
    texels. The trapezoid and the shadow edges change smoothly with the camera; unlike with cascades, the edges are not
    stable. If the light shines along the view direction, or the camera sees behind a spot light, the view is that of
    `shadow_map`.
    """

    focus: float = param(
        default=0.5,
        min=0.01,
        max=1,
        doc="Fraction of the visible range, from the eye, that takes four fifths of the texels.",
    )

    def light_views(self, light: Any, frame: Frame) -> Sequence[ViewMatrices]:
        """Return the views of `shadow_map`, with those of directional and spot lights warped."""
        views = super().light_views(light, frame)
        if light.type == "point":
            return views
        eye = self.eye(frame)
        visible = projection.visible_part(eye, receiving_box(frame.scene, light))
        return [warp_view(view, visible, eye, self.focus, _MARGIN) for view in views]
