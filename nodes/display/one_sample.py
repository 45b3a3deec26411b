"""One sample of each texel."""

from __future__ import annotations

from rendergraph.api import Any, Input, Node, Output, Steps, structural

from ._texels import texel_macros


class OneSample(Node):
    """One sample of each texel, the same one everywhere, for what has no mean: depth, normals, whole numbers.

    A mean of the depths of two surfaces lies on neither of them. What takes one sample a texel, such as occlusion in
    screen space behind a multisampled G-buffer, takes it from here; textures that belong together through nodes of
    equal `index`. Stencil stays behind.
    """

    source = Input(Any, samples="multi", doc="Depth, normals, anything with several samples a texel.")
    chosen = Output(like="source", samples=1, doc="The same with one.")

    index: int = structural(default=0, min=0, max=15, doc="Which one; the last where there are not so many.")

    def record(self, steps: Steps) -> None:
        """One step, whose sampler and target are of the source's kind."""
        desc = steps.desc(self.source)
        defines = {**texel_macros(desc), "INDEX": min(self.index, desc.samples - 1)}
        steps.fullscreen("one_sample.frag", source=self.source, out={"chosen": self.chosen}, defines=defines)
