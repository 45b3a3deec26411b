"""Visualisation of shadow volumes."""

from __future__ import annotations

from typing import Literal

from rendergraph.api import ALPHA, Depth, DisplayColor, InOut, Input, State, Steps, structural

from ._volumes import Z_FAIL, HasVolumes


class ShowVolumes(HasVolumes):
    """Show shadow volumes over a finished picture as translucent faces, and silhouettes as lines.

    All visible faces of a volume are blended: two for each volume that a ray passes through.
    """

    depth = Input(Depth, use="depth_test", doc="Depth of the opaque surfaces, from the pipeline's camera.")
    color = InOut(DisplayColor, doc="The picture.")

    parts: Literal["all", "volumes", "silhouettes"] = structural(default="all", doc="Parts to draw.")
    tint: tuple[float, float, float] = structural(
        default=(1.0, 0.8, 0.2), min=0, max=1, doc="Colour of volumes and silhouettes, sRGB encoded."
    )
    opacity: float = structural(default=0.15, min=0, max=1, doc="Opacity of each face of a volume.")

    def record(self, steps: Steps) -> None:
        """Record faces, then lines over them."""
        if not self.casters(steps.facts):
            return
        drawn = [("volumes", "shadow_volumes.geom", self.opacity), ("silhouettes", "silhouette_lines.geom", 1.0)]
        state = State(
            depth_func="greater",
            depth_write=False,
            depth_clamp=True,
            polygon_offset=(0.0, -16.0),  # away from the eye: faces of casters are not covered by their caps
            cull="none",
            blend=ALPHA,
        )
        for layer, light in enumerate(self.lights(steps.facts)):
            for part, shader, opacity in drawn:
                if self.parts in ("all", part):
                    self.draw_volumes(
                        steps,
                        layer,
                        Z_FAIL,
                        shader,
                        fragment="show_volumes.frag",
                        out=self.color,
                        depth=self.depth,
                        view=self.depth,
                        state=state,
                        label=f"{part} of {steps.lights[light].name}",
                        face_color=(*self.tint, opacity),
                    )
