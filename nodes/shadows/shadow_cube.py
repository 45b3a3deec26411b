"""Depth as lights see it on all sides, in one pass."""

from __future__ import annotations

from rendergraph.api import State, Steps

from .shadow_map import ShadowMapNode


class ShadowCube(ShadowMapNode):
    """Depth seen from lights, every layer in one pass over the geometry: made for point lights and their six.

    A geometry shader sees each triangle from every view and sends it to the layers that it is not outside of, so that
    the scene's vertices are fetched and placed once instead of six times. The map is `shadow_map`'s.
    """

    def record(self, steps: Steps) -> None:
        """One layered pass over what casts."""
        if steps.desc(self.shadow_map).layers:
            steps.geometry(
                "<depth.frag>",
                vertex="shadow_cube.vert",
                geometry="shadow_cube.geom",
                out=self.shadow_map,
                view=self.views,
                view_index=None,
                in_place=True,
                objects="casters",
                materials="alpha",
                state=State(cull="none", polygon_offset=(-self.slope_bias, 0.0) if self.slope_bias else None),
            )
