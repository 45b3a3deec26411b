"""Automatic exposure from the picture's log-average luminance."""

from __future__ import annotations

from typing import Literal

from rendergraph.api import ExposureGain, Input, Internal, Luminance, Node, Output, Radiance, Steps, define, param

from ._exposure import half_of_radiance
from ._means import halve_down


class Exposure(Node):
    """The factor that brings the picture's log-average luminance to the key, with an eye that needs time to adapt.

    `exp(mean(log(delta + L)))` (Reinhard, Stark, Shirley and Ferwerda 2002): the logarithm keeps a few very bright
    pixels from darkening all others. It goes down a mip chain whose levels are exact area means at any size (Guthe and
    Heckbert 2005).

    With `before` connected to this node's own `luminance@previous` the adapted luminance follows the picture's
    exponentially (`L += (target - L) (1 - exp(-dt / seconds))`; Pattanaik et al. 2000), faster towards light than
    towards the dark. The first frame shows `start`, or the picture's own luminance.
    """

    radiance = Input(Radiance, size="any", doc="Scene-linear radiance; alpha is coverage.")
    before = Input(
        Luminance,
        size="any",
        optional=True,
        doc="What the eye is adapted to: this node's `luminance@previous`; unconnected it adapts at once.",
    )
    luminance = Output(Luminance, format="r32f", size=(1, 1), doc="Luminance the eye is adapted to; one texel.")
    gain = Output(ExposureGain, format="r32f", size=(1, 1), doc="`key / luminance`; one texel.")
    logarithms = Internal(format="rg32f", size=half_of_radiance, mips=0)

    key: float = param(default=0.18, min=0.001, max=16, doc="Where the average goes: 0.18 is a grey card's.")
    delta: float = param(default=1e-4, min=1e-9, max=1, doc="Added to luminance, so that black has a logarithm.")
    meter: Literal["covered", "all"] = define(
        default="covered", doc="What is averaged: pixels by their coverage (alpha), or all alike, empty ones too."
    )
    start: float = param(
        default=0.0, min=0, doc="Luminance the eye is adapted to in the first frame; 0: the picture's."
    )
    seconds_to_light: float = param(
        default=0.4, unit="s", min=0, max=600, doc="Time constant towards brighter pictures; 0 is at once."
    )
    seconds_to_dark: float = param(
        default=1.6, unit="s", min=0, max=600, doc="Time constant towards darker pictures; 0 is at once."
    )

    def record(self, steps: Steps) -> None:
        """Logarithms at half size, their means level by level, then one texel that adapts."""
        steps.fullscreen("log_luminance.frag", radiance=self.radiance, out=self.logarithms.mip(0))
        last = halve_down(steps, self.logarithms)
        steps.fullscreen("exposure.frag", mean=self.logarithms.mip(last), before=self.before)
