"""Temporal accumulation of noisy pictures."""

from __future__ import annotations

from typing import Any

from rendergraph.api import Any as AnyTexel
from rendergraph.api import Depth, History, Input, Node, Normal, Output, Steps, Velocity, param

from ._layers import layers_of


class Accumulate(Node):
    """Average a noisy picture over frames, with each surface reprojected to the previous frame.

    Of the four nearest texels there, only those that showed the same surface count: in the same plane, with a similar
    normal (the temporal half of Schied et al., "Spatiotemporal Variance-Guided Filtering", 2017). Where none did,
    because the surface was hidden or outside the picture, the mean restarts. The noise of the source must differ
    between frames (`animated` of the occlusion nodes). If the light on a surface changes, the mean follows within as
    many frames as it averages.
    """

    source = Input(AnyTexel, layered=True, doc="The noisy picture, or several as layers.")
    depth = Input(Depth, doc="Window depth; positions come from it and its view.")
    normal = Input(Normal, doc="Unit normal, world space.")
    velocity = Input(Velocity, optional=True, doc="Motion vectors. Unconnected: only the camera moves.")
    accumulated = Output(like="source", doc="The mean; the source for background.")
    mean = History(like="source")
    surfaces = History(format="rgba16f")

    frames: int = param(default=16, min=1, max=256, doc="Frames that are averaged while anything moves.")
    frames_at_rest: int = param(default=64, min=1, max=256, doc="Frames that are averaged while nothing moves.")
    tolerance: float = param(
        default=0.02, min=1e-6, max=1, doc="How far from its plane a surface may have been, relative to its distance."
    )
    facing: float = param(default=0.9, min=-1, max=1, doc="Least cosine between a surface's normals in both frames.")

    def record(self, steps: Steps) -> None:
        """Record one pass over each layer of the picture; the first one stores the surfaces for the next frame."""
        reads: dict[str, Any] = {"depth": self.depth, "normal": self.normal}
        if steps.connected(self.velocity):
            reads["velocity"] = self.velocity
        reads["previous_surfaces"] = self.surfaces.previous
        layers = [layers_of(steps, part) for part in (self.source, self.accumulated, self.mean, self.mean.previous)]
        for number, (source, accumulated, mean, previous) in enumerate(zip(*layers, strict=True)):
            out: dict[str, Any] = {"accumulated": accumulated, "mean": mean}
            if number == 0:
                out["surfaces"] = self.surfaces
            steps.fullscreen("accumulate.frag", out=out, source=source, previous_mean=previous, **reads)
