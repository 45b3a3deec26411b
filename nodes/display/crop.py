"""The middle of a larger picture."""

from __future__ import annotations

from rendergraph.api import Any, Input, Node, Output, SceneError, Steps, View

from ..geometry._velocity import Velocity
from ._texels import texel_macros


class Crop(Node):
    """The picture itself of one that was drawn with a band around it.

    Its texels are those of the middle, as they are, but for velocity, which comes out in widths and heights of the
    smaller picture. What it holds is seen with the pipeline's camera again: depth and normals may go on from here, too.
    """

    source = Input(Any, size="any", doc="What was drawn with a `guard_band`: radiance, depth, anything.")
    view = Input(
        View, kind="view", optional=True, doc="What the middle is seen with; the pipeline's camera by default."
    )
    cropped = Output(like="source", size=1.0, view="view", doc="Its middle, of the picture's size.")

    def record(self, steps: Steps) -> None:
        """One step, whose sampler and target are of the source's kind."""
        source, made = steps.desc(self.source), steps.desc(self.cropped)
        if source.width < made.width or source.height < made.height:
            raise SceneError("what is cropped is smaller than the picture; draw it with a `guard_band`", "source")
        band = (source.width - made.width) // 2, (source.height - made.height) // 2
        macros = texel_macros(source)
        if steps.facts.input("source").semantic == Velocity:
            macros["MEANS_VELOCITY"] = 1
        steps.fullscreen("crop.frag", source=self.source, out={"cropped": self.cropped}, band=band, defines=macros)
