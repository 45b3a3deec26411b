"""From several samples a texel to one."""

from __future__ import annotations

from typing import Literal

from rendergraph.api import ExposureGain, Input, Node, Output, Radiance, Steps, define, param


class Resolve(Node):
    """The mean of the samples of each texel, taken as they look after tone mapping and brought back to radiance.

    A plain mean of radiance leaves steps where bright meets dark: one sample of a lamp, a hundred times brighter than
    white, makes the mean with three of a wall white, and the edge is as hard as before. What is smooth on the display
    is the mean after its curve. `karis` weighs each sample by `1 / (1 + luminance)` (Karis 2013), the mean by x/(1+x)
    of luminance; `curve` takes x/(1+x) of each channel and back; `plain` is the device's own mean. For the mean by the
    display's own curve connect `tonemap` itself, which then maps each sample.
    """

    source = Input(Radiance, samples="multi", doc="Scene-linear radiance with several samples a texel.")
    gain = Input(ExposureGain, size="any", optional=True, doc="Exposure that the weights are taken after.")
    radiance = Output(like="source", samples=1, doc="The same with one.")

    average: Literal["karis", "curve", "plain"] = define(
        default="karis", doc="Weighed by luminance, through a curve of each channel, or the plain mean."
    )
    exposure: float = param(default=0.0, unit="EV", min=-32, max=32, doc="Stops that the weights are taken after.")

    def record(self, steps: Steps) -> None:
        """One step, by the device where the mean is plain."""
        if self.average == "plain":
            steps.resolve(self.source, self.radiance)
        else:
            steps.fullscreen("resolve.frag")
