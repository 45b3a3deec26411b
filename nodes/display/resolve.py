"""Resolve of multisampled radiance."""

from __future__ import annotations

from typing import Literal

from rendergraph.api import ExposureGain, Input, Node, Output, Radiance, Steps, define, param


class Resolve(Node):
    """Average the samples of each texel after tone mapping, and convert the mean back to radiance.

    A plain mean of radiance leaves jagged edges between bright and dark: one sample of a lamp, a hundred times brighter
    than white, makes the mean with three samples of a wall white. The mean of tone-mapped samples is smooth on the
    display. `karis` weights each sample by `1 / (1 + luminance)` (Karis 2013); `curve` maps each channel by x/(1+x) and
    back; `plain` is the device's own mean. To average with the display's own curve, connect `tonemap` directly, which
    then maps each sample.
    """

    source = Input(Radiance, samples="multi", doc="Scene-linear radiance with several samples per texel.")
    gain = Input(ExposureGain, size="any", optional=True, doc="Exposure applied before the weights.")
    radiance = Output(like="source", samples=1, doc="Radiance with one sample.")

    average: Literal["karis", "curve", "plain"] = define(
        default="karis", doc="Weighted by luminance, by a curve of each channel, or the plain mean."
    )
    exposure: float = param(default=0.0, unit="EV", min=-32, max=32, doc="Stops applied before the weights.")

    def record(self, steps: Steps) -> None:
        """Record one step; the device's own resolve for the plain mean."""
        if self.average == "plain":
            steps.resolve(self.source, self.radiance)
        else:
            steps.fullscreen("resolve.frag")
