"""Shadow maps rendered in a single layered pass."""

from __future__ import annotations

from rendergraph.api import State, Steps

from .shadow_map import ShadowMapNode


class ShadowCube(ShadowMapNode):
    """Render depth from lights into all layers in one pass; a point light has six layers.

    A geometry shader projects each triangle into every view and emits it to the layers that it may intersect, so
    vertices are fetched and transformed once instead of six times. The map equals that of `shadow_map`.
    """

    def record(self, steps: Steps) -> None:
        """Record one layered pass over the casters."""
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
