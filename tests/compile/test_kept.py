"""Kept values: made when they are new or out of date, and then not again."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import pytest

import rendergraph as rg
from rendergraph.api import (
    ADD,
    Depth,
    Frame,
    History,
    InOut,
    Input,
    Internal,
    Node,
    Output,
    Radiance,
    State,
    Steps,
    param,
    structural,
)
from rendergraph.errors import InputError

Draw = Callable[..., rg.Frame]

SHADERS = {
    "fill.frag": "uniform float value; out vec4 table; void main() { table = vec4(value); }",
    "twice.frag": "uniform sampler2D table; out vec4 doubled; void main() { doubled = 2.0 * texelFetch(table, ivec2(0), 0); }",
    "show.frag": "uniform sampler2D table; uniform float gain; out vec4 color;"
    "void main() { color = gain * texelFetch(table, ivec2(0), 0); }",
    "eye.frag": "out vec4 table;\nvec4 seen() { return camera.eye; }\nvoid main() { table = seen(); }",
    "blind.frag": "out vec4 table; vec4 seen() { return camera.eye; } void main() { table = vec4(1.0); }",
    "time.frag": "#include <frame.glsl>\nout vec4 table;\n#define NOW time\nvoid main() { table = vec4(NOW); }",
    "lights.frag": "#include <lights.glsl>\nout vec4 table;\nvoid main() { table = lights[0].color; }",
    "depth.frag": "uniform sampler2D depth;\nout vec4 table;\nvoid main() { table = texelFetch(depth, ivec2(0), 0); }",
    "two.frag": "out vec4 table, color; void main() { table = color = vec4(1.0); }",
    "plain.frag": "out vec4 color; void main() { color = vec4(1.0); }",
}


class Table(Node):
    """A value in a texture that outlives the frame, and twice that."""

    table = Output(Radiance, format="rgba32f", size=(4, 4), kept=True, doc="The value.")
    doubled = Output(Radiance, format="rgba32f", size=(2, 2), kept=True, doc="Twice that.")
    value: float = param(default=1.0, min=-100, max=100, doc="Value.")

    def record(self, steps: Steps) -> None:
        steps.fullscreen("fill.frag", out=self.table)
        steps.fullscreen("twice.frag", table=self.table, out=self.doubled)


class Show(Node):
    """A table as a picture."""

    table = Input(Radiance, size="any", doc="Table.")
    color = Output(Radiance, doc="Picture.")
    gain: float = param(default=1.0, min=-100, max=100, doc="Factor.")

    def record(self, steps: Steps) -> None:
        steps.fullscreen("show.frag")


TEXT = """
nodes:
  a: {type: table, params: {value: 3}}
  b: {type: show, inputs: {table: a.doubled}}
outputs: {image: b.color}
"""


@pytest.fixture(autouse=True)
def nothing_made(gl: rg.Session) -> None:
    """What another test has made is not taken over."""
    with gl.device.current():
        gl.cache.clear_scene()
        gl.cache.kept.release()


@pytest.fixture
def draw(bench: Any) -> Draw:
    """Draws with each step measured: so the frame knows which ran."""
    return partial(bench.draw, timed=True)


def ran(frame: rg.Frame) -> list[list[str]]:
    """The nodes of each frame's steps."""
    return [[step.node for step in times.steps] for times in frame.times]


def test_a_kept_value_is_made_once(draw: Draw) -> None:
    frame = draw(TEXT, Table, Show, shaders=SHADERS, frames=range(1, 4), warm_up=False)
    assert (frame["image"] == 6.0).all()
    assert ran(frame) == [["a", "a", "b"], ["b"], ["b"]]
    assert frame.passes[0]["node"] == "a"


def test_the_warm_up_frame_pays(draw: Draw) -> None:
    frame = draw(TEXT, Table, Show, shaders=SHADERS)
    assert [entry["node"] for entry in frame.passes] == ["b"]


def test_a_session_keeps_it_between_renders(bench: Any) -> None:
    pipeline = bench.pipeline(TEXT, Table, Show, shaders=SHADERS)
    bench.session.render(pipeline, warm_up=False, timed=True)
    assert ran(bench.session.render(pipeline, warm_up=False, timed=True)) == [["b"]]
    gained = bench.session.render(pipeline.set("b.gain", 2.0), warm_up=False, timed=True)
    assert ran(gained) == [["b"]]
    assert (gained["image"] == 12.0).all()


def test_a_changed_value_makes_it_and_what_reads_it_again(bench: Any) -> None:
    pipeline = bench.pipeline(TEXT, Table, Show, shaders=SHADERS)
    bench.session.render(pipeline, warm_up=False, timed=True)
    again = bench.session.render(pipeline.set("a.value", 5.0), frames=range(1, 3), warm_up=False, timed=True)
    assert ran(again) == [["a", "a", "b"], ["b"]]
    assert (again["image"] == 10.0).all()
    assert (bench.session.render(pipeline, warm_up=False, timed=True)["image"] == 6.0).all()


def test_a_change_downstream_leaves_what_is_before_it(bench: Any) -> None:
    class Later(Node):
        """A table from another."""

        source = Input(Radiance, size="any", doc="Table.")
        table = Output(Radiance, format="rgba32f", size=(4, 4), kept=True, doc="The same times a gain.")
        gain: float = param(default=1.0, min=-100, max=100, doc="Factor.")

        def record(self, steps: Steps) -> None:
            steps.fullscreen("show.frag", table=self.source, out={"color": self.table})

    text = """
nodes:
  a: {type: table, params: {value: 3}}
  c: {type: later, inputs: {source: a.table}}
  b: {type: show, inputs: {table: c.table}}
outputs: {image: b.color}
"""
    pipeline = bench.pipeline(text, Table, Show, Later, shaders=SHADERS)
    first = bench.session.render(pipeline, warm_up=False, timed=True)
    assert ran(first) == [["a", "c", "b"]]
    again = bench.session.render(pipeline.set("c.gain", 2.0), warm_up=False, timed=True)
    assert ran(again) == [["c", "b"]]
    assert (again["image"] == 6.0).all()
    assert ran(bench.session.render(pipeline.set("a.value", 1.0).set("c.gain", 2.0), warm_up=False, timed=True)) == [
        ["a", "c", "b"]
    ]


class Summed(Node):
    """A kept texture that two steps make, of which the second adds."""

    table = Output(Radiance, format="rgba32f", size=(4, 4), clear=0.0, kept=True, doc="1 and a value.")
    value: float = param(default=1.0, min=-100, max=100, doc="Value.")

    def record(self, steps: Steps) -> None:
        steps.clear(self.table, 1.0)
        steps.fullscreen("fill.frag", out=self.table, state=State(blend=ADD))


def test_what_is_drawn_onto_is_made_again_with_what_is_drawn(bench: Any) -> None:
    text = TEXT.replace("type: table", "type: summed").replace("a.doubled", "a.table")
    pipeline = bench.pipeline(text, Summed, Show, shaders=SHADERS)
    assert (bench.session.render(pipeline, warm_up=False, timed=True)["image"] == 4.0).all()
    again = bench.session.render(pipeline.set("a.value", 5.0), warm_up=False, timed=True)
    assert ran(again) == [["a", "a", "b"]]
    assert (again["image"] == 6.0).all()


class Overdrawn(Node):
    """A kept table that is drawn onto after another has been made of it."""

    table = Output(Radiance, format="rgba32f", size=(4, 4), kept=True, doc="The value, and once more.")
    middle = Output(Radiance, format="rgba32f", size=(4, 4), kept=True, doc="The first value times a gain.")
    value: float = param(default=3.0, min=-100, max=100, doc="Value.")
    gain: float = structural(default=1.0, min=-100, max=100, doc="Factor, in one step alone.")

    def record(self, steps: Steps) -> None:
        steps.fullscreen("fill.frag", out=self.table, label="fill")
        out = {"color": self.middle}
        steps.fullscreen("show.frag", table=self.table, out=out, label="middle", gain=self.gain)
        steps.fullscreen("fill.frag", out=self.table, state=State(blend=ADD), label="add")


def test_what_was_read_before_it_was_drawn_over_is_made_again_first(bench: Any) -> None:
    text = """
nodes:
  a: {type: overdrawn}
  b: {type: show, inputs: {table: a.middle}}
  c: {type: show, inputs: {table: a.table}}
outputs: {image: b.color, table: c.color}
"""
    pipeline = bench.pipeline(text, Overdrawn, Show, shaders=SHADERS)
    first = bench.session.render(pipeline, warm_up=False, timed=True)
    assert ((first["image"] == 3.0) & (first["table"] == 6.0)).all()
    again = bench.session.render(pipeline.set("a.gain", 2.0), warm_up=False, timed=True)
    assert [step.label for step in again.times[0].steps if step.label] == ["fill", "middle", "add"]
    assert ((again["image"] == 6.0) & (again["table"] == 6.0)).all()


class Trail(Node):
    """Last frame's picture and this one's, so that frames alternate between two copies."""

    color = Input(Radiance, doc="Picture.")
    trail = History(Radiance, format="rgba32f", doc="Sum so far.")
    summed = Output(Radiance, format="rgba32f", doc="Sum.")

    def record(self, steps: Steps) -> None:
        steps.fullscreen("sum.frag", color=self.color, before=self.trail.previous, out={"summed": self.trail})
        steps.fullscreen("show.frag", table=self.trail, out={"color": self.summed}, gain=1.0)


def test_modes_and_frames_change_no_bit(draw: Draw) -> None:
    text = TEXT.replace(
        "outputs: {image: b.color}", "  t: {type: trail, inputs: {color: b.color}}\noutputs: {image: t.summed}"
    )
    total = "uniform sampler2D color, before; out vec4 summed; void main() {"
    shaders = SHADERS | {
        "sum.frag": total
        + "ivec2 at = ivec2(gl_FragCoord.xy); summed = texelFetch(color, at, 0) + texelFetch(before, at, 0); }"
    }
    options: dict[str, Any] = {"shaders": shaders, "frames": range(1, 4)}
    plain = draw(text, Table, Show, Trail, **options)
    assert (plain["image"] == 18.0).all()
    for mode in ({"poison": True}, {"shuffle": 5}, {"poison": True, "shuffle": 9}, {"alias": False}):
        assert np.array_equal(draw(text, Table, Show, Trail, **options, **mode)["image"], plain["image"])
    assert (draw(text, Table, Show, Trail, shaders=shaders, frames=range(1, 2))["image"] == 6.0).all()


def test_a_tapped_kept_value_stays_kept(draw: Draw) -> None:
    frame = draw(TEXT, Table, Show, shaders=SHADERS, taps=["a.table"], frames=range(1, 3), warm_up=False)
    assert ran(frame) == [["a", "a", "b"], ["b"]]
    assert (frame["a.table"] == 3.0).all()


def test_kept_memory_is_in_the_plan(bench: Any) -> None:
    plan = bench.pipeline(TEXT, Table, Show, shaders=SHADERS).plan()
    assert plan.resources["a.table"].role == plan.resources["a.doubled"].role == "kept"
    lives = {id: (life.first, life.last) for id, life in plan.lifetimes.items()}
    assert lives == {"a.table": (0, 2), "a.doubled": (0, 2), plan.schedule.outputs["image"]: (2, 2)}
    assert plan.memory.allocated_bytes == 16 * 16 + 4 * 16 + 16 * 8 * 8
    assert plan.memory.lower_bound_bytes == plan.memory.allocated_bytes
    assert plan.reasons["a.table"].startswith("it outlives the frame")
    assert len(plan.physicals) == 3
    assert not plan.released


def test_kept_memory_is_freed_with_its_executable(bench: Any) -> None:
    session = bench.session
    session.render(bench.pipeline(TEXT, Table, Show, shaders=SHADERS))
    with session.device.current():
        memory = session.cache.active.memory
        names = [texture.glo for texture in memory.physicals]
        session.cache.clear_scene()
        assert not any(session.device.raw.glIsTexture(name) for name in names)


# What it may not depend on -------------------------------------------------------------------------------------------


class Made(Node):
    """Makes the table that the subclass records."""

    depth = Input(Depth, optional=True, doc="Depth.")
    table = Output(Radiance, format="rgba32f", kept=True, doc="Table.")
    color = Output(Radiance, doc="Not kept.")


class Eyed(Made):
    """Looks at the camera."""

    def record(self, steps: Steps) -> None:
        steps.fullscreen("eye.frag", out=self.table)


class Blind(Made):
    """Could look at the camera, and does not."""

    def record(self, steps: Steps) -> None:
        steps.fullscreen("blind.frag", out=self.table)


class Timed(Made):
    """Looks at the time."""

    def record(self, steps: Steps) -> None:
        steps.fullscreen("time.frag", out=self.table)


class Lit(Made):
    """Looks at the lights."""

    def record(self, steps: Steps) -> None:
        steps.fullscreen("lights.frag", out=self.table)


class Deep(Made):
    """Reads what is not kept."""

    def record(self, steps: Steps) -> None:
        steps.fullscreen("depth.frag", depth=self.depth, out=self.table)


class Defaults(Made):
    """Names nothing, and its shader reads what is not kept."""

    def record(self, steps: Steps) -> None:
        steps.fullscreen("depth.frag", out=self.table)


class Both(Made):
    """Writes what is kept and what is not at once."""

    def record(self, steps: Steps) -> None:
        steps.fullscreen("two.frag", out={"table": self.table, "color": self.color})


class Scenic(Made):
    """Draws the scene."""

    def record(self, steps: Steps) -> None:
        steps.geometry("plain.frag", out={"color": self.table})


class Remembering(Made):
    """Reads last frame's value."""

    last = History(Radiance, doc="Last.")

    def record(self, steps: Steps) -> None:
        steps.fullscreen("plain.frag", out=self.last)
        steps.fullscreen("depth.frag", depth=self.last.previous, out=self.table)


class Uploads(Made):
    """Fills a kept buffer in each frame."""

    numbers = Internal(kind="buffer", bytes=16, kept=True)

    def record(self, steps: Steps) -> None:
        steps.clear(self.numbers)
        steps.fullscreen("blind.frag", out=self.table)
        steps.fullscreen("buffer.frag", numbers=self.numbers, out=self.color)

    def update(self, frame: Frame) -> None:
        frame.write(self.numbers, np.zeros(4, np.float32))


class DepthMaker(Node):
    """Depth that is not kept."""

    depth = Output(Depth, format="depth32f", clear=0.0, doc="Depth.")

    def record(self, steps: Steps) -> None:
        steps.clear(self.depth, 1.0)


class Continues(Node):
    """Adds to a picture."""

    color = InOut(Radiance, doc="Picture.")

    def record(self, steps: Steps) -> None:
        steps.fullscreen("plain.frag", out=self.color, state=State(blend=ADD))


WRONG = """
nodes:
  d: {type: depth_maker}
  a: {type: NAME, inputs: {depth: d.depth}}
  b: {type: show, inputs: {table: a.table}}
outputs: {image: b.color}
"""


@pytest.mark.parametrize(
    ("cls", "said"),
    [
        (
            Eyed,
            r"eye.frag:2:22: RG439 node 'a' \(eyed\): \S+: it makes 'a.table', which is kept, but uses the camera",
        ),
        (Timed, r"RG439 .* 'a.table', which is kept, but uses the frame's time and number \('time'\)"),
        (Lit, r"lights.frag:3:23: RG439 .* 'a.table', which is kept, but uses the scene's lights"),
        (Deep, r"RG439 .* it makes 'a.table', which is kept, from 'd.depth', which is not; keep that too"),
        (Defaults, r"depth.frag:1:19: RG439 .* it makes 'a.table', which is kept, but samples 'depth', which is not"),
        (Both, r"RG439 .* it makes 'a.table', which is kept, and 'a.color', which is not; make them in two steps"),
        (Scenic, r"RG439 .* it makes 'a.table', which is kept, from the scene's objects, which may move"),
        (Remembering, r"RG439 .* which is kept, from last frame's 'a.last', which changes every frame"),
    ],
)
def test_check_says_what_a_kept_value_depends_on(bench: Any, cls: type[Node], said: str) -> None:
    text = WRONG.replace("NAME", cls.__name__.lower())
    pipeline = bench.pipeline(text, cls, DepthMaker, Show, shaders=SHADERS)
    with pytest.raises(InputError, match=said):
        pipeline.check()
    with pytest.raises(InputError, match=said):
        bench.session.render(pipeline)


def test_what_main_does_not_come_to_does_not_count(draw: Draw) -> None:
    frame = draw(WRONG.replace("NAME", "blind"), Blind, DepthMaker, Show, shaders=SHADERS)
    assert (frame["image"] == 1.0).all()


def test_nobody_goes_on_with_a_kept_value(bench: Any) -> None:
    text = """
nodes:
  a: {type: table}
  c: {type: continues, inputs: {color: a.table}}
outputs: {image: c.color}
"""
    pipeline = bench.pipeline(text, Table, Continues, shaders=SHADERS)
    with pytest.raises(InputError, match=r"RG439 node 'c' .* continues 'a.table', which is kept from frame to frame"):
        pipeline.check()


def test_a_kept_value_has_no_last_frame(bench: Any) -> None:
    pipeline = bench.pipeline(TEXT.replace("a.doubled", "a.doubled@previous"), Table, Show, shaders=SHADERS)
    with pytest.raises(InputError, match=r"RG127 'a.doubled@previous' has no effect: the texture is kept"):
        pipeline.check()


def test_update_fills_nothing_that_is_kept(bench: Any) -> None:
    shaders = SHADERS | {
        "buffer.frag": "layout(std430) readonly buffer numbers { vec4 all_numbers; }; out vec4 color;"
        "void main() { color = all_numbers; }"
    }
    text = WRONG.replace("NAME", "uploads").replace("a.table}", "a.color}")
    with pytest.raises(InputError, match=r"it writes 'numbers', which is kept, in each frame"):
        bench.session.render(bench.pipeline(text, Uploads, DepthMaker, Show, shaders=shaders))
