"""Last frame's values: `@previous` in the file, `History` in the node."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rendergraph.api import Any as AnyTexel
from rendergraph.api import History, Input, Luminance, Node, Output, Steps

if TYPE_CHECKING:
    from collections.abc import Callable

    import rendergraph as rg

    Draw = Callable[..., rg.Frame]


class Increment(Node):
    """One more than what comes in."""

    before = Input(AnyTexel, doc="What to count on from.")
    after = Output(Luminance, format="r32f", first=100.0, doc="One more.")


class Counter(Node):
    """Counts frames in a texture of its own, and shows this frame's and last frame's count."""

    color = Output(Luminance, format="rg32f", doc="Now and before.")
    count = History(format="r32f", first=5.0)

    def record(self, steps: Steps) -> None:
        steps.fullscreen("increment.frag", before=self.count.previous, out=self.count)
        steps.fullscreen("both.frag", now=self.count, before=self.count.previous, out=self.color)


SHADERS = {
    "increment.frag": """uniform sampler2D before; out float after;
        void main() { after = texelFetch(before, ivec2(gl_FragCoord.xy), 0).r + 1.0; }""",
    "both.frag": """uniform sampler2D now; uniform sampler2D before; out vec2 color; void main() {
        ivec2 p = ivec2(gl_FragCoord.xy); color = vec2(texelFetch(now, p, 0).r, texelFetch(before, p, 0).r); }""",
}


def test_previous_starts_with_the_first_value_and_goes_on(draw: Draw) -> None:
    text = "nodes: {a: {type: increment, inputs: {before: a.after@previous}}}\noutputs: {image: a.after}"
    seen: list[float] = []
    draw(text, Increment, shaders=SHADERS, frames=range(1, 6), on_frame=lambda f: seen.append(float(f["image"].mean())))
    assert seen == [101, 102, 103, 104, 105]


def test_two_nodes_that_read_each_others_last_frame(draw: Draw) -> None:
    text = """nodes:
  a: {type: increment, inputs: {before: b.after@previous}}
  b: {type: increment, inputs: {before: a.after}}
outputs: {image: b.after}"""
    assert np.all(draw(text, Increment, shaders=SHADERS, frames=range(1, 5))["image"] == 108)


def test_history_of_the_nodes_own(draw: Draw) -> None:
    text = "nodes: {c: {type: counter}}\noutputs: {image: c.color}"
    for frames in (1, 2, 3):
        image = draw(text, Counter, shaders=SHADERS, frames=range(1, frames + 1))["image"]
        np.testing.assert_array_equal(image[0, 0], [5 + frames, 4 + frames])


def test_history_starts_afresh_in_every_run(draw: Draw) -> None:
    text = "nodes: {c: {type: counter}}\noutputs: {image: c.color}"
    first = draw(text, Counter, shaders=SHADERS, frames=range(1, 4))["image"]
    again = draw(text, Counter, shaders=SHADERS, frames=range(1, 4))["image"]
    np.testing.assert_array_equal(first, again)
