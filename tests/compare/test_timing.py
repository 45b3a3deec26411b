"""Times of steps: what `bench --steps` shows, with the labels that authors give."""

from __future__ import annotations

from typing import Any

import pytest

from rendergraph.api import Any as AnyTexel
from rendergraph.api import Internal, Node, Output, Steps
from rendergraph.compare.timing import step_times
from rendergraph.errors import InputError
from rendergraph.schedule import step_names


class Twice(Node):
    """A step without a label and one with it."""

    half = Internal(format="r32f")
    color = Output(AnyTexel, format="r32f", doc="One.")

    def record(self, steps: Steps) -> None:
        steps.clear(self.half, 0.5)
        steps.fullscreen("add.frag", source=self.half, out=self.color, label="double")


SHADERS = {
    "add.frag": "uniform sampler2D source; out float r; void main() { r = 2.0 * texelFetch(source, ivec2(0), 0).r; }"
}
TEXT = "nodes: {t: {type: twice}}\noutputs: {image: t.color}"


def test_each_step_has_its_times_and_the_label_that_its_author_gave(bench: Any) -> None:
    frame = bench.draw(TEXT, Twice, shaders=SHADERS, frames=range(1, 4), timed=True)
    found = step_times(frame.times)
    assert [(step["node"], step["step"], step["label"]) for step in found] == [("t", 0, ""), ("t", 1, "double")]
    assert all(step["cpu_ms"]["min"] <= step["cpu_ms"]["median"] <= step["cpu_ms"]["max"] for step in found)
    assert sum(step["cpu_ms"]["min"] for step in found) <= frame.passes[0]["cpu_ms"]


def test_plans_name_steps_by_number_and_label(bench: Any) -> None:
    steps = bench.pipeline(TEXT, Twice, shaders=SHADERS).plan().schedule.steps
    assert list(step_names(steps).values()) == ["t[0]", "t[1 double]"]


def test_a_label_is_a_text(bench: Any) -> None:
    class Wrong(Twice):
        """A number for a label."""

        def record(self, steps: Steps) -> None:
            steps.fullscreen("add.frag", source=self.half, out=self.color, label=1)  # type: ignore[arg-type]

    with pytest.raises(InputError, match="label is 1"):
        bench.draw("nodes: {t: {type: wrong}}\noutputs: {image: t.color}", Wrong, shaders=SHADERS)
