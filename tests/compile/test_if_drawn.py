"""Steps that the device leaves out where an earlier one drew nothing."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import rendergraph as rg
from rendergraph.api import ADD, Internal, Node, Output, Radiance, State, Steps, param
from rendergraph.errors import InputError
from rendergraph.gl.queries import OcclusionQuery

TEXT = "nodes: {a: {type: peels}}\noutputs: {image: a.color}"
SHADERS = {
    "below.frag": "uniform float height; out float found; void main() { if (gl_FragCoord.y > height) discard; found = 1.0; }",
    "count.frag": "uniform sampler2D found; out float color; void main() { color = 1.0; }",
}


class Peels(Node):
    """Something that may draw nothing, what depends on it, and what depends on that."""

    color = Output(Radiance, format="r32f", clear=5.0, doc="How many steps were drawn, and 5.")
    found = Internal(format="r32f", clear=0.0)
    height: float = param(default=0.0, doc="Where the first is cut off.")

    def record(self, steps: Steps) -> None:
        steps.fullscreen("below.frag", out={"found": self.found}, label="first", height=self.height)
        for after in ("first", "second"):
            label = "second" if after == "first" else ""
            state = State(blend=ADD)
            steps.fullscreen("count.frag", out=self.color, state=state, if_drawn=after, label=label, found=self.found)


@pytest.mark.parametrize(("height", "expected"), [(0.0, 5.0), (0.6, 7.0), (9.0, 7.0)])
def test_it_is_drawn_where_any_sample_passed_and_its_target_is_cleared_anyway(
    draw: Callable[..., rg.Frame], height: float, expected: float
) -> None:
    text = TEXT.replace("peels}", f"peels, params: {{height: {height}}}}}")
    for options in ({}, {"poison": True}, {"frames": range(1, 4)}):
        frame = draw(text, Peels, shaders=SHADERS, **options)
        np.testing.assert_array_equal(frame.arrays["image"], expected)


def test_what_has_changed_since_is_asked_anew(bench: Any) -> None:
    pipeline = bench.pipeline(TEXT, Peels, shaders=SHADERS)
    for height, expected in ((9, 7), (0, 5), (9, 7)):
        assert bench.session.render(pipeline.set("a.height", height)).arrays["image"].mean() == expected


@pytest.mark.parametrize("method", ["stop", "end_conditional"])
def test_what_is_broken_off_leaves_nothing_out_later(bench: Any, monkeypatch: pytest.MonkeyPatch, method: str) -> None:
    end, ended = getattr(OcclusionQuery, method), []

    def interrupted(query: OcclusionQuery) -> None:
        ended.append(query)
        if len(ended) == 1:  # as if Ctrl-C came while something is counted, or left out
            raise KeyboardInterrupt
        end(query)

    monkeypatch.setattr(OcclusionQuery, method, interrupted)
    with pytest.raises(KeyboardInterrupt):
        bench.draw(TEXT, Peels, shaders=SHADERS)
    assert (
        bench.draw(TEXT.replace("peels}", "peels, params: {height: 9}}"), Peels, shaders=SHADERS).arrays["image"].mean()
        == 7
    )


class Misnamed(Peels):
    """Asks for a step that is not there."""

    def record(self, steps: Steps) -> None:
        steps.fullscreen("below.frag", out={"found": self.found}, label="first", height=1.0)
        steps.fullscreen("count.frag", out=self.color, if_drawn="frist", found=self.found)


class Apart(Peels):
    """Asks for a step that might as well run later."""

    def record(self, steps: Steps) -> None:
        steps.fullscreen("below.frag", out={"found": self.found}, label="first", height=1.0)
        steps.fullscreen("count.frag", out=self.color, if_drawn="first", scale=1.0)


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        (Misnamed, "if_drawn is 'frist', but no earlier step has that label; did you mean 'first'?"),
        (Apart, "if_drawn is 'first', but it neither reads nor continues what that step writes"),
    ],
)
def test_a_step_asks_for_one_that_it_follows(bench: Any, wrong: type[Node], said: str) -> None:
    with pytest.raises(InputError, match=said.replace("?", r"\?")):
        bench.pipeline(TEXT.replace("peels", wrong.__name__.lower()), wrong, shaders=SHADERS).check()
