"""The centre of a larger picture."""

from __future__ import annotations

from rendergraph.api import Any, Input, Node, Output, SceneError, Steps, Velocity, View

from ._texel_types import texel_macros


class Crop(Node):
    """Cut the picture out of one that was drawn with a guard band around it.

    Texels are copied, except for velocity, which is rescaled to the width and height of the smaller picture. The result
    belongs to the pipeline's camera again, so depth and normals can be used by further passes, too.
    """

    source = Input(Any, size="any", doc="A texture drawn with a `guard_band`: radiance, depth, anything.")
    view = Input(View, kind="view", optional=True, doc="The view of the centre; the pipeline's camera by default.")
    cropped = Output(like="source", size=1.0, view="view", doc="Its centre, of the size of the picture.")

    def record(self, steps: Steps) -> None:
        """Record one step, with a sampler and target of the source's type."""
        source, target = steps.desc(self.source), steps.desc(self.cropped)
        if source.width < target.width or source.height < target.height:
            raise SceneError("the source is smaller than the picture; draw it with a `guard_band`", "source")
        band = (source.width - target.width) // 2, (source.height - target.height) // 2
        macros = texel_macros(source)
        if steps.facts.input("source").semantic == Velocity:
            macros["MEANS_VELOCITY"] = 1
        steps.fullscreen("crop.frag", source=self.source, out={"cropped": self.cropped}, band=band, defines=macros)
