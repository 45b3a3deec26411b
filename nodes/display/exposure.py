"""Automatic exposure from the picture's average luminance."""

from __future__ import annotations

from typing import Literal

from rendergraph.api import ExposureGain, Input, Internal, Luminance, Node, Output, Radiance, Steps, define, param

from ._half_size import half_radiance_size
from ._mip_means import fill_mips

BINS, BINS_PER_STOP, FIRST_STOP = 256, 8, -16
"""The histogram reaches from 2^-16 to 2^16; values outside it count in the first or last bin."""


class Exposure(Node):
    """Compute the exposure that maps the picture's average luminance to the key, adapting over time like an eye.

    `method: histogram` meters as cameras do. It averages the stops of the pixels between two percentiles of luminance,
    so that neither black surroundings nor small lamps dominate, and can weight the centre more.

    With `method: log_average`, the average is `exp(mean(log(delta + L)))` (Reinhard, Stark, Shirley and Ferwerda 2002),
    in which a few very bright pixels have little weight. The mean is the last level of a mip chain of exact area means
    (Guthe and Heckbert 2005).

    With `before` connected to this node's own `luminance@previous`, the adapted luminance follows the picture's
    exponentially (`L += (target - L) (1 - exp(-dt / seconds))`; Pattanaik et al. 2000), faster towards light than
    towards dark. In the first frame it is `start`, or the picture's own luminance.
    """

    radiance = Input(Radiance, size="any", doc="Scene-linear radiance; alpha is coverage.")
    before = Input(
        Luminance,
        size="any",
        optional=True,
        doc="Adapted luminance: this node's `luminance@previous`. Unconnected: adapts at once.",
    )
    luminance = Output(Luminance, format="r32f", size=(1, 1), doc="Adapted luminance; one texel.")
    gain = Output(
        ExposureGain, format="r32f", size=(1, 1), doc="`key / luminance`, limited and compensated; one texel."
    )
    logarithms = Internal(format="rg32f", size=half_radiance_size, mips=0)
    histogram = Internal(kind="buffer", bytes=4 * BINS)

    method: Literal["log_average", "histogram"] = define(
        default="log_average", doc="Average all pixels' logarithms, or those between two percentiles."
    )

    key: float = param(
        default=0.18, min=0.001, max=16, doc="Value that the average is mapped to; 0.18 is that of a grey card."
    )
    delta: float = param(default=1e-4, min=1e-9, max=1, doc="Added to luminance, so that black has a logarithm.")
    meter: Literal["covered", "all"] = define(
        default="covered", doc="Average pixels weighted by coverage (alpha), or all pixels equally."
    )
    low_percentile: float = param(
        default=30.0,
        unit="%",
        min=0,
        max=100,
        doc="`histogram`: the darkest pixels, up to this share, do not count.",
    )
    high_percentile: float = param(
        default=90.0, unit="%", min=0, max=100, doc="`histogram`: pixels brighter than this share do not count."
    )
    center_weight: float = param(
        default=0.5, min=0, max=1, doc="`histogram`: 0 weights all pixels equally, 1 almost ignores the corners."
    )
    limit: float = param(
        default=32.0, unit="EV", min=0, max=32, doc="Largest deviation of the exposure from a gain of 1."
    )
    compensation: float = param(
        default=0.0, unit="EV", min=-16, max=16, doc="Stops added at the end, as a photographer does for snow."
    )
    transparent: bool = define(default=False, doc="Meter only surfaces: the picture has no background.")
    start: float = param(default=0.0, min=0, doc="Adapted luminance in the first frame; 0: that of the picture.")
    seconds_to_light: float = param(
        default=0.4, unit="s", min=0, max=600, doc="Time constant towards brighter pictures; 0: at once."
    )
    seconds_to_dark: float = param(
        default=1.6, unit="s", min=0, max=600, doc="Time constant towards darker pictures; 0: at once."
    )

    def record(self, steps: Steps) -> None:
        """Record the measurement, which is a mip chain or a histogram, and the adaptation."""
        if self.method == "histogram":
            bins = {"BINS": BINS, "BINS_PER_STOP": float(BINS_PER_STOP), "FIRST_STOP": float(FIRST_STOP)}
            steps.clear(self.histogram)
            steps.compute(
                "luminance_histogram.comp",
                over=self.radiance,
                radiance=self.radiance,
                out=self.histogram,
                defines=bins,
            )
            steps.fullscreen("exposure.frag", histogram=self.histogram, before=self.before, defines=bins)
            return
        steps.fullscreen("log_luminance.frag", radiance=self.radiance, out=self.logarithms.mip(0))
        last = fill_mips(steps, self.logarithms)
        steps.fullscreen("exposure.frag", log_mean=self.logarithms.mip(last), before=self.before)
