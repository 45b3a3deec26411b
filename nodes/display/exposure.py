"""Automatic exposure from the picture's log-average luminance."""

from __future__ import annotations

from typing import Literal

from rendergraph.api import ExposureGain, Input, Internal, Luminance, Node, Output, Radiance, Steps, define, param

from ._half_size import half_radiance_size
from ._mip_means import fill_mips


class Exposure(Node):
    """Compute the exposure that maps the picture's log-average luminance to the key, with an eye that adapts over time.

    The log-average is `exp(mean(log(delta + L)))` (Reinhard, Stark, Shirley and Ferwerda 2002), in which a few very
    bright pixels have little weight. The mean is the last level of a mip chain of exact area means (Guthe and Heckbert
    2005).

    With `before` connected to this node's own `luminance@previous`, the adapted luminance follows the picture's
    exponentially (`L += (target - L) (1 - exp(-dt / seconds))`; Pattanaik et al. 2000), faster towards light than
    towards the dark. In the first frame it is `start`, or the picture's own luminance.
    """

    radiance = Input(Radiance, size="any", doc="Scene-linear radiance; alpha is coverage.")
    before = Input(
        Luminance,
        size="any",
        optional=True,
        doc="Adapted luminance: this node's `luminance@previous`. Unconnected: adapts at once.",
    )
    luminance = Output(Luminance, format="r32f", size=(1, 1), doc="Adapted luminance; one texel.")
    gain = Output(ExposureGain, format="r32f", size=(1, 1), doc="`key / luminance`; one texel.")
    logarithms = Internal(format="rg32f", size=half_radiance_size, mips=0)

    key: float = param(
        default=0.18, min=0.001, max=16, doc="Value that the average is mapped to; 0.18 is that of a grey card."
    )
    delta: float = param(default=1e-4, min=1e-9, max=1, doc="Added to luminance, so that black has a logarithm.")
    meter: Literal["covered", "all"] = define(
        default="covered", doc="Average pixels weighted by coverage (alpha), or all pixels equally."
    )
    start: float = param(default=0.0, min=0, doc="Adapted luminance in the first frame; 0: that of the picture.")
    seconds_to_light: float = param(
        default=0.4, unit="s", min=0, max=600, doc="Time constant towards brighter pictures; 0: at once."
    )
    seconds_to_dark: float = param(
        default=1.6, unit="s", min=0, max=600, doc="Time constant towards darker pictures; 0: at once."
    )

    def record(self, steps: Steps) -> None:
        """Record logarithms at half size, their mean, and the adaptation."""
        steps.fullscreen("log_luminance.frag", radiance=self.radiance, out=self.logarithms.mip(0))
        last = fill_mips(steps, self.logarithms)
        steps.fullscreen("exposure.frag", log_mean=self.logarithms.mip(last), before=self.before)
