"""What is brighter than the display's white."""

from __future__ import annotations

from rendergraph.api import Input, Node, Output, Radiance, Steps, param

from ._exposure import ExposureGain


class BrightPass(Node):
    """The part of the picture above a luminance: `rgb max(L - threshold, 0) / L`.

    What is left keeps its hue and begins at black, so nothing pops where a light crosses the threshold.
    """

    radiance = Input(Radiance, doc="Scene-linear radiance.")
    gain = Input(ExposureGain, size="any", optional=True, doc="Exposure that the threshold is measured after.")
    bright = Output(Radiance, like="radiance", doc="What is above the threshold; scene-linear, alpha as it was.")

    threshold: float = param(
        default=1.0, min=0, doc="Luminance, after `gain`, that is taken off; 1 is the display's white."
    )

    def record(self, steps: Steps) -> None:
        """One step at full size."""
        steps.fullscreen("bright_pass.frag", defines={"HALVE": False})
