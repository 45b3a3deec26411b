"""Ambient occlusion by horizons, cosine-weighted."""

from __future__ import annotations

from rendergraph.api import Normal, Output, Port, Steps, param

from ._directional import RefinedDirectionalSampling


class GTAO(RefinedDirectionalSampling):
    """Compute cosine-weighted ambient occlusion, and bent normals, from horizons.

    Ground-truth ambient occlusion (Jiménez, Wu, Pesce and Jarabo, "Practical Real-Time Strategies for Accurate Indirect
    Occlusion", 2016). Depth is interpreted as a height field, and the hemisphere is divided into slices through the
    view direction. Each slice has two horizons, and the light between them has a closed form. Where the picture shows
    all occluders, the result is that of ray tracing.

    Occluders count in full up to the radius, and not at all beyond it. A `falloff` fades them out gradually, which
    hides the edge of the radius on large surfaces.

    Interreflection brightens corners. `albedo` approximates it by the paper's fit, for surroundings of this colour.
    """

    bent_normal = Output(
        Normal,
        format="rgba16_snorm",
        size="depth",
        doc="Unit vector, the mean unoccluded direction, world space; 0 for background.",
    )

    falloff: float = param(
        default=0.0, min=0, max=1, doc="Share of the radius, at its end, over which occluders fade out."
    )
    albedo: float = param(default=0.0, min=0, max=1, doc="Grey albedo of the surroundings; 0: they reflect no light.")

    def record(self, steps: Steps) -> None:
        """Record sampling and filtering."""
        out: dict[str, Port] = {port.name: port for port in (self.occlusion, self.bent_normal) if steps.used(port)}
        self.sample_and_filter(steps, "gtao.frag", out, has_vector="bent_normal" in out, defines={"MULTI_BOUNCE": 1})
