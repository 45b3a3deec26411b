"""Temporal antialiasing."""

from __future__ import annotations

from typing import Any

from rendergraph.api import Depth, DisplayColor, History, Input, Node, Output, Steps, Velocity, param, structural

_FIRST_INDEX = 1897
"""The start of the sequence. Of the first 2,500 indices, it is the one for which the first 8 and 16 frames, together
with the unjittered one, estimate the coverage of half planes with the least error."""


class Taa(Node):
    """Smooth edges by averaging frames with different sample positions.

    The camera is jittered by less than a pixel in each frame (a Halton sequence in bases 2 and 3). The history is
    reprojected (by `velocity`, or the motion of the camera alone) and averaged with the new frame. While anything
    moves, it is first clipped to the colours of the neighbourhood in YCoCg (Karis 2014; Salvi 2016), which removes
    surfaces that are no longer visible. While nothing moves, it is a plain mean: n frames have n samples per pixel. The
    first frame is unchanged.

    The node comes after the display transform, where averages match perception, and replaces `fxaa`.
    """

    source = Input(DisplayColor, doc="The finished picture, display-referred.")
    depth = Input(Depth, doc="Window depth; edges move with the nearer surface.")
    velocity = Input(Velocity, optional=True, doc="Motion vectors. Unconnected: only the camera moves.")
    color = Output(like="source", doc="The picture with smooth edges; alpha of this frame, or its mean.")
    history = History(format="rgba16f")
    coverage = History(format="r16f")

    frames: int = param(default=8, min=1, max=256, doc="Frames that are averaged while anything moves.")
    frames_at_rest: int = param(default=64, min=1, max=1024, doc="Frames that are averaged while nothing moves.")
    tolerance: float = param(
        default=1.0,
        min=0,
        max=16,
        doc="How far the history may differ from the mean of the neighbourhood, in standard deviations.",
    )
    transparent: bool = structural(default=False, doc="Average alpha, too; colours are premultiplied by it.")

    def record(self, steps: Steps) -> None:
        """Record one pass over the picture."""
        reads: dict[str, Any] = {"source": self.source, "depth": self.depth}
        if steps.connected(self.velocity):
            reads["velocity"] = self.velocity
        reads["previous_history"] = self.history.previous.sampled("linear")
        out: dict[str, Any] = {"color": self.color, "history": self.history}
        if self.transparent:
            out["coverage"] = self.coverage
            reads["previous_coverage"] = self.coverage.previous.sampled("linear")
        steps.fullscreen("taa.frag", out=out, defines={"TRANSPARENT": int(self.transparent)}, **reads)

    def camera_jitter(self, frame: int) -> tuple[float, float]:
        """Return the sample position of a frame: the centre in the first, then a Halton sequence."""
        return (_halton(frame + _FIRST_INDEX, 2), _halton(frame + _FIRST_INDEX, 3)) if frame else (0.0, 0.0)


def _halton(index: int, base: int) -> float:
    """Return a number of the Halton sequence (1960), the radical inverse of its index, minus ½."""
    value, digit = 0.0, 1.0
    while index:
        digit /= base
        value += digit * (index % base)
        index //= base
    return value - 0.5
