"""The way from a selection to pictures: every stage once, in order, and nothing that cannot be sent elsewhere."""

from __future__ import annotations

import inspect
import pickle
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from msgspec.structs import fields, replace

import rendergraph as rg
import rendergraph.allocate
import rendergraph.expand
import rendergraph.link
import rendergraph.resolve
import rendergraph.schedule
from rendergraph.cli import main, options
from rendergraph.compare import Axis, SweepOptions, compare, sweep
from rendergraph.compare.prepare import SweepKeywords
from rendergraph.errors import InputError, RenderError, UsageError
from rendergraph.session import RenderOptions, Selection, gpu_cache, stages
from rendergraph.session.selection import RenderKeywords

IN_ORDER = ["resolve", "scene_of", "link", "requested_outputs", "expand", "schedule", "allocate", "compile_plan"]
SIZE = (16, 12)
DRAWN = Selection("forward", size=SIZE, sets=("sun.resolution=64",))


@pytest.fixture
def gone_through(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Names of the stages' own functions, as they are called."""
    called: list[str] = []

    def told(name: str, do: Any) -> Any:
        def call(*given: Any, **named: Any) -> Any:
            called.append(name)
            return do(*given, **named)

        return call

    places: list[Any] = [rendergraph.resolve, stages, rendergraph.link, stages, rendergraph.expand]
    places += [rendergraph.schedule, rendergraph.allocate, gpu_cache]
    for place, name in zip(places, IN_ORDER, strict=True):
        monkeypatch.setattr(place, name, told(name, getattr(place, name)))
    return called


# --- once each -------------------------------------------------------------------------------------------------------


def test_run_goes_through_each_stage_once(
    gone_through: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    words = "run forward --size 16x12 -s sun.resolution=64 --frames 1-2 -o a.##.png --tap light.radiance=b.##.exr"
    assert main(words.split()) == 0
    assert gone_through == IN_ORDER


@pytest.mark.parametrize(("verb", "last"), [("config", "resolve"), ("graph", "link"), ("plan", "allocate")])
def test_a_verb_stops_where_it_has_enough(
    gone_through: list[str], verb: str, last: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main([verb, "forward"]) == 0
    assert gone_through == IN_ORDER[: IN_ORDER.index(last) + 1]


def test_what_differs_in_uniforms_alone_is_neither_planned_nor_compiled(
    gl: rg.Session, gone_through: list[str]
) -> None:
    pipeline = rg.Pipeline(DRAWN)
    gl.render(pipeline)
    gone_through.clear()
    gl.render(pipeline.set("light.ambient", 0.5))
    assert gone_through == IN_ORDER[:5]
    gone_through.clear()
    gl.render(pipeline, frames=range(1, 4))
    assert gone_through == ["requested_outputs", "expand"]


def test_comparing_plans_each_picture_and_each_look_inside_once(gone_through: list[str]) -> None:
    compare([rg.Pipeline(DRAWN), rg.Pipeline(DRAWN).set("shadows.taps", 1)], frames=3)
    assert Counter(gone_through) == {
        "resolve": 2,
        "scene_of": 2,
        "link": 2,
        **dict.fromkeys(IN_ORDER[3:], 4),
    }


def test_a_sweep_plans_each_run_and_each_batch_once(gl: rg.Session, gone_through: list[str], tmp_path: Path) -> None:
    sweep(rg.Pipeline(DRAWN), [Axis("display.exposure", ("0", "1", "2"))], tmp_path, frames=1, session=gl)
    count = Counter(gone_through)
    assert count["link"] == 3
    assert count["expand"] == count["schedule"] == count["allocate"] == 3 + 1
    assert count["compile_plan"] == 1


# --- values ----------------------------------------------------------------------------------------------------------


def test_a_run_can_be_sent_to_another_process(gl: rg.Session) -> None:
    sent = pickle.dumps((replace(DRAWN, patches=({"size": [8, 8]},)), RenderOptions(range(1, 3), outputs=("image",))))
    selection, asked = pickle.loads(sent)
    frame = stages.draw_last(stages.expand(stages.link(stages.resolve(selection)), asked), gl)
    assert (list(frame), frame.number) == (["image"], 2)
    np.testing.assert_array_equal(pickle.loads(pickle.dumps(frame))["image"], frame["image"])


def test_every_spelling_has_the_same_fields() -> None:
    selected = {field.name for field in fields(Selection)} - {"text"}  # of a file that is being edited
    assert set(inspect.signature(rg.load).parameters) == selected
    assert {"source", *options.SELECTION_OPTIONS} == selected
    assert list(RenderKeywords.__annotations__) == [field.name for field in fields(RenderOptions)]
    assert tuple(SweepKeywords.__annotations__) == SweepOptions.__struct_fields__


def test_keywords_become_options() -> None:
    assert RenderOptions.of({}) == RenderOptions()
    assert RenderOptions.of({"outputs": "image", "taps": ["a.b"]}) == RenderOptions(outputs=("image",), taps=("a.b",))
    assert RenderOptions.of({"outputs": None, "shuffle": None}) == RenderOptions()
    assert RenderOptions.of({"outputs": ()}).outputs == ()
    with pytest.raises(TypeError, match="Unexpected keyword argument 'frame'"):
        rg.load("forward").expand(frame=1)  # type: ignore[call-arg]


@pytest.mark.parametrize("frames", [range(0), range(0, 3), [1, 2]])
def test_frames_are_a_range_from_1(frames: Any) -> None:
    with pytest.raises(UsageError, match="expected a range of numbers from 1"):
        RenderOptions(frames)


def test_a_limit_of_no_name_is_said_at_once() -> None:
    with pytest.raises(UsageError, match="unknown limit 'yaml-dept'; did you mean 'yaml-depth'"):
        Selection("forward", limits=(("yaml-dept", 3),))


def test_a_pipeline_goes_through_a_stage_once_and_a_changed_one_anew() -> None:
    pipeline = rg.load("forward")
    assert pipeline.link() is pipeline.link()
    assert pipeline.check().linked is pipeline.link()
    changed = pipeline.set("light.ambient", 0.5)
    assert changed.link() is not pipeline.link()
    assert changed.link().scene is pipeline.link().scene


def test_a_sketch_is_the_graph_and_what_it_lacks(tmp_path: Path) -> None:
    file = tmp_path / "p.yaml"
    file.write_text("rendergraph: 1\nnodes: {a: {type: nobodys}}\noutputs: {image: a.color}\n")
    resolved = stages.resolve(Selection(str(file)))
    assert [problem.code for problem in stages.sketch(resolved).missing] == ["RG102"]
    with pytest.raises(InputError, match="RG102"):
        stages.link(resolved)


# --- frames ----------------------------------------------------------------------------------------------------------


def test_frames_come_one_by_one_and_are_those_of_render(gl: rg.Session) -> None:
    pipeline = rg.Pipeline(DRAWN)
    frames = list(gl.frames(pipeline, frames=range(2, 5)))
    assert [(frame.number, len(frame.times)) for frame in frames] == [(2, 1), (3, 2), (4, 3)]
    np.testing.assert_array_equal(frames[-1]["image"], gl.render(pipeline, frames=range(2, 5))["image"])


def test_what_is_overtaken_says_so_and_what_is_left_harms_nobody(gl: rg.Session) -> None:
    pipeline = rg.Pipeline(DRAWN)
    frames = gl.frames(pipeline, frames=range(1, 4))
    first = next(frames)
    again = gl.render(pipeline)
    np.testing.assert_array_equal(first["image"], again["image"])
    with pytest.raises(RenderError, match="RG615 the session has started another drawing"):
        next(frames)
    next(gl.frames(pipeline, frames=range(1, 4)))  # nobody asks for the rest
    np.testing.assert_array_equal(gl.render(pipeline)["image"], again["image"])


def test_a_session_of_its_own_ends_with_the_last_frame() -> None:
    frames = rg.Pipeline(DRAWN).frames(frames=range(1, 3))
    assert [frame.number for frame in frames] == [1, 2]


def test_a_mistake_is_said_when_frames_are_asked_for_not_at_the_first(gl: rg.Session) -> None:
    with pytest.raises(InputError, match="RG205 pipeline 'forward' has no output 'imag'"):
        gl.frames("forward", outputs=["imag"])
