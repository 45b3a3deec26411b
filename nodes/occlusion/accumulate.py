"""The mean of something noisy over the frames in which its surface was in the picture."""

from __future__ import annotations

from typing import Any

from rendergraph.api import Any as AnyTexel
from rendergraph.api import Depth, History, Input, Node, Normal, Output, Steps, param

from ..geometry._velocity import Velocity


class Accumulate(Node):
    """The mean of a noisy picture over frames, each surface looked up where it was in the last one.

    Of the four texels around that place those count that showed the same surface: in its plane, and facing the same way
    (the temporal half of Schied et al., "Spatiotemporal Variance-Guided Filtering", 2017). Where none did, because
    something has moved away or the place was outside the picture, the mean begins anew. What makes the source must
    be noisy in another way in each frame (`animated` of the occlusions). Light that changes on a surface that stays is
    followed within as many frames as the mean is of.
    """

    source = Input(AnyTexel, doc="What is noisy.")
    depth = Input(Depth, doc="Window depth; positions come from it and its view.")
    normal = Input(Normal, doc="Unit normal, world space.")
    velocity = Input(Velocity, optional=True, doc="How far surfaces have moved; unconnected only the camera moves.")
    accumulated = Output(like="source", doc="The mean; where nothing is, the source.")
    gathered = History(like="source")
    surfaces = History(format="rgba16f")

    frames: int = param(default=16, min=1, max=256, doc="Frames that are put together while things move.")
    frames_at_rest: int = param(default=64, min=1, max=256, doc="Frames that are put together while nothing moves.")
    tolerance: float = param(
        default=0.02, min=1e-6, max=1, doc="How far off its plane a surface may have been, as a share of the distance."
    )
    facing: float = param(default=0.9, min=-1, max=1, doc="Least cosine between its normal now and then.")

    def record(self, steps: Steps) -> None:
        """One pass over the picture."""
        reads: dict[str, Any] = {"source": self.source, "depth": self.depth, "normal": self.normal}
        if steps.connected(self.velocity):
            reads["velocity"] = self.velocity
        reads |= {"before": self.gathered.previous, "surfaces_before": self.surfaces.previous}
        out = {"accumulated": self.accumulated, "gathered": self.gathered, "surfaces": self.surfaces}
        steps.fullscreen("accumulate.frag", out=out, **reads)
