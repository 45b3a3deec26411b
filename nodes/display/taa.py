"""Temporal antialiasing."""

from __future__ import annotations

from typing import Any

from rendergraph.api import Depth, DisplayColor, History, Input, Node, Output, Steps, param

from ..geometry._velocity import Velocity

_START = 1897
"""Of the first 2,500 places to start at, that where the first 8 and 16 frames, with the one in the middle, cover half
planes across a pixel with the least error."""


class Taa(Node):
    """Smooth edges from pictures of many frames, each taken at other places within its pixels.

    The camera's picture moves by a part of a pixel from frame to frame (a Halton sequence in 2 and 3). What earlier
    frames have gathered is looked up where each surface was (`velocity`, or the camera's movement alone) and becomes
    the mean with the new frame. While things move it is first clipped to the colours around the pixel, in YCoCg (Karis
    2014; Salvi 2016), so that nothing is kept that is no longer there. While nothing moves it is a plain mean: of n
    frames it has n samples a pixel. A single frame is its picture as it is.

    It comes after the display transform, where the mean is what one sees, and stands in the place of `fxaa`.
    """

    source = Input(DisplayColor, doc="The finished picture, as it is seen.")
    depth = Input(Depth, doc="Window depth of what is in it: edges move as what is nearer does.")
    velocity = Input(Velocity, optional=True, doc="How far surfaces have moved; unconnected only the camera moves.")
    color = Output(like="source", doc="The same with smooth edges; alpha as it is in this frame.")
    gathered = History(format="rgba16f")

    frames: int = param(default=8, min=1, max=256, doc="Frames that are put together while things move.")
    frames_at_rest: int = param(default=64, min=1, max=1024, doc="Frames that are put together while nothing moves.")
    tolerance: float = param(
        default=1.0,
        min=0,
        max=16,
        doc="How far from the mean of the colours around what was gathered may be, in standard deviations.",
    )

    def record(self, steps: Steps) -> None:
        """One pass over the picture."""
        reads: dict[str, Any] = {"source": self.source, "depth": self.depth}
        if steps.connected(self.velocity):
            reads["velocity"] = self.velocity
        before = self.gathered.previous.sampled("linear")
        steps.fullscreen("taa.frag", out={"color": self.color, "gathered": self.gathered}, before=before, **reads)

    def camera_jitter(self, frame: int) -> tuple[float, float]:
        """The frame's place in its pixels: the middle, then Halton's numbers."""
        return (_halton(frame + _START, 2), _halton(frame + _START, 3)) if frame else (0.0, 0.0)


def _halton(index: int, base: int) -> float:
    """A number of the Halton sequence (1960), the digits of its index behind the point turned round, less ½."""
    value, digit = 0.0, 1.0
    while index:
        digit /= base
        value += digit * (index % base)
        index //= base
    return value - 0.5
