"""One sample of each texel."""

from __future__ import annotations

from rendergraph.api import Any, Input, Node, Output, Steps, structural

from ._texel_types import texel_macros


class OneSample(Node):
    """Select one sample of each texel, for textures that must not be averaged: depth, normals, integers.

    The mean of two depths lies on neither surface. Nodes that need one sample per texel, such as screen-space occlusion
    of a multisampled G-buffer, use this node; textures that belong together need the same `index`. Stencil is not
    copied.
    """

    source = Input(Any, samples="multi", doc="Depth, normals, anything with several samples per texel.")
    chosen = Output(like="source", samples=1, doc="The same texture with one sample.")

    index: int = structural(default=0, min=0, max=15, doc="Number of the sample; limited to the last.")

    def record(self, steps: Steps) -> None:
        """Record one step, with a sampler and target of the source's type."""
        desc = steps.desc(self.source)
        defines = {**texel_macros(desc), "SAMPLE_NUMBER": min(self.index, desc.samples - 1)}
        steps.fullscreen("select_sample.frag", source=self.source, out={"chosen": self.chosen}, defines=defines)
