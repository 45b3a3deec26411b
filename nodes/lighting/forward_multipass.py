"""Lighting while the geometry is drawn, once a light."""

from __future__ import annotations

from rendergraph.api import ADD, Depth, Output, Port, Radiance, State, Steps

from ._lighting import GeometryLighting


class ForwardMultipass(GeometryLighting):
    """Radiance of the scene, drawn once for what needs no light and once more for each light, added up.

    How many lights became possible before shaders could loop: every light costs all the geometry again and every
    fragment that is seen, L (V + F). Passes after the first are drawn where depth is equal to what the first left.
    Surfaces with alpha blending cannot be added up light by light; they come last, under all lights at once.
    """

    radiance = Output(
        Radiance,
        format="rgba32f",
        clear=lambda node, facts: (*node.background_rgb, 0.0),
        doc="Scene-linear radiance, float32: half floats would lose a step with every light. Alpha is coverage.",
    )
    surface_depth = Output(
        Depth, format="depth32f", clear=1.0, doc="Depth of the nearest opaque surface, where no pre-pass is connected."
    )

    def record(self, steps: Steps) -> None:
        """Ambient and emitted light first, then each light, then what is blended."""
        out: dict[str, Port] = {"radiance": self.radiance}
        if not steps.connected(self.depth):
            out["surface_depth"] = self.surface_depth
        reads = self.opaque_reads(steps)
        steps.geometry("forward_multipass.frag", out=out, objects="opaque", defines={"FIRST_PASS": 1}, **reads)
        added = State(blend=ADD, depth_func="equal", depth_write=False)
        for light in range(len(steps.lights) if self.wants_lights(steps) else 0):
            steps.geometry(
                "forward_multipass.frag", out=out, objects="opaque", state=added, per_light=light, light=light, **reads
            )
        self.blend_after(steps, out)
