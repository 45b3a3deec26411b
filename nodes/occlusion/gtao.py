"""Ambient occlusion by horizons, weighted as light is."""

from __future__ import annotations

from rendergraph.api import Normal, Output, Port, Steps, param

from ._arms import RefinedArms


class GTAO(RefinedArms):
    """How open each surface is, and where to: the share of a white sky's light that reaches it.

    Ground-truth ambient occlusion (Jiménez, Wu, Pesce and Jarabo, "Practical Real-Time Strategies for Accurate Indirect
    Occlusion", 2016). The depth is taken for a landscape, and the hemisphere for a fan of slices through the eye: in
    each the two horizons are looked for, and the light between them has a closed form. Where the picture shows
    everything, that is what ray tracing finds.

    Light that surfaces send one another brightens corners. `albedo` adds that by the paper's fit, as if all around had
    this colour.
    """

    bent_normal = Output(
        Normal,
        format="rgba16_snorm",
        size="depth",
        doc="Unit direction from where most of the sky's light comes, world space; 0 where nothing is.",
    )

    albedo: float = param(default=0.0, min=0, max=1, doc="Grey albedo of the surroundings; 0: they send no light on.")

    def record(self, steps: Steps) -> None:
        """Surfaces, arcs between horizons, the neighbours' mean, full size."""
        out: dict[str, Port] = {port.name: port for port in (self.occlusion, self.bent_normal) if steps.used(port)}
        bent = "bent_normal" in out
        self.look(steps, "gtao.frag", out, four=bent, defines={"MULTI_BOUNCE": 1})
