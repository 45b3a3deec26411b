"""Last frame's values: `@previous` in the file, `History` in the node."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from rendergraph.api import ADD, Depth, History, InOut, Input, Internal, Luminance, Node, Output, State, Steps
from rendergraph.api import Any as AnyTexel
from rendergraph.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import Any

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


def test_previous_starts_with_the_first_value_and_goes_on(bench: Any) -> None:
    text = "nodes: {a: {type: increment, inputs: {before: a.after@previous}}}\noutputs: {image: a.after}"
    frames = bench.frames(text, Increment, shaders=SHADERS, frames=range(1, 6))
    assert [float(frame.arrays["image"].mean()) for frame in frames] == [101, 102, 103, 104, 105]


def test_two_nodes_that_read_each_others_last_frame(draw: Draw) -> None:
    text = """nodes:
  a: {type: increment, inputs: {before: b.after@previous}}
  b: {type: increment, inputs: {before: a.after}}
outputs: {image: b.after}"""
    assert np.all(draw(text, Increment, shaders=SHADERS, frames=range(1, 5)).arrays["image"] == 108)


def test_history_that_is_read_before_it_is_written_has_one_texture(bench: Any) -> None:
    text = """nodes:
  a: {type: increment, inputs: {before: b.after@previous}}
  b: {type: increment, inputs: {before: a.after}}
outputs: {image: b.after}"""
    pipeline = bench.pipeline(text, Increment, shaders=SHADERS)
    assert len(pipeline.plan().placement["b.after"]) == 1
    for options in ({}, {"alias": False}, {"poison": True}):
        frames = list(bench.session.frames(pipeline, frames=range(1, 5), **options))
        assert [frame.arrays["image"].mean() for frame in frames] == [102, 104, 106, 108]


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


@pytest.mark.parametrize("units", [None, 24])
def test_history_goes_back_a_frame_whichever_are_looked_at_and_however_few_units_there_are(
    bench: Any, gl: rg.Session, monkeypatch: pytest.MonkeyPatch, units: int | None
) -> None:
    if units is not None:
        monkeypatch.setitem(gl.device.limits, "units", units)
    text = "nodes: {c: {type: counter}}\noutputs: {image: c.color}"
    size = (8, 8 if units is None else 9)  # another plan, so that it is compiled anew
    frames = bench.frames(text, Counter, shaders=SHADERS, size=size, frames=range(2, 9, 2))
    assert [frame["image"][0, 0].tolist() for frame in frames] == [[7, 6], [9, 8], [11, 10], [13, 12]]


def test_a_frame_is_the_same_whichever_others_are_looked_at(bench: Any) -> None:
    text = "nodes: {c: {type: counter}}\noutputs: {image: c.color}"
    for frames in (range(7, 8), range(3, 8, 2), range(7, 4, -1), range(1, 9)):
        drawn = bench.frames(text, Counter, shaders=SHADERS, frames=frames)
        assert [frame["image"][0, 0, 0] for frame in drawn] == [5 + frame.number for frame in drawn]


def test_nothing_leads_up_to_a_frame_that_remembers_nothing(bench: Any) -> None:
    frame = bench.draw(
        "nodes: {o: {type: ones}}\noutputs: {image: o.color}", Ones, shaders=CONTINUED, frames=range(10**9, 10**9 + 1)
    )
    assert frame.number == 10**9


class Halve(Node):
    """Half of what comes in."""

    old = Input(AnyTexel, doc="What to halve.")
    color = Output(AnyTexel, format="r32f", doc="Half.")


class Plus(Node):
    """Adds 1."""

    color = InOut(AnyTexel, doc="One more.")

    def record(self, steps: Steps) -> None:
        steps.fullscreen("plus.frag", out=self.color, state=State(blend=ADD))


CONTINUED = {
    "halve.frag": """uniform sampler2D old; out float color;
        void main() { color = texelFetch(old, ivec2(gl_FragCoord.xy), 0).r * 0.5; }""",
    "plus.frag": "out float color; void main() { color = 1.0; }",
}


def test_the_last_frame_of_a_texture_that_nodes_further_down_continue(draw: Draw) -> None:
    text = """nodes:
  half: {type: halve, inputs: {old: plus.color@previous}}
  plus: {type: plus, inputs: {color: half.color}}
outputs: {image: plus.color}"""
    assert np.all(draw(text, Halve, Plus, shaders=CONTINUED, frames=range(1, 4)).arrays["image"] == 1.75)


class PlusFrom(Plus):
    """The same, starting from 4."""

    color = InOut(AnyTexel, first=4.0, doc="One more.")


def test_the_first_frame_of_a_continued_texture_is_what_its_reader_s_source_says(draw: Draw) -> None:
    text = """nodes:
  half: {type: halve, inputs: {old: plus.color@previous}}
  plus: {type: plus_from, inputs: {color: half.color}}
outputs: {image: plus.color}"""
    assert np.all(draw(text, Halve, PlusFrom, shaders=CONTINUED).arrays["image"] == 3)


class Blends(Node):
    """Halves last frame's value and adds one onto what it continues."""

    old = Input(AnyTexel, doc="Last frame's.")
    color = InOut(AnyTexel, doc="What is added to.")

    def record(self, steps: Steps) -> None:
        steps.fullscreen("halve.frag", old=self.old, out=self.color, state=State(blend=ADD))


def test_whoever_overwrites_a_texture_does_not_read_its_last_frame_s_value(bench: Any) -> None:
    text = """nodes:
  one: {type: ones}
  blend: {type: blends, inputs: {old: one.color@previous, color: one.color}}
outputs: {image: blend.color}"""
    said = r"5:39: RG127 'blend.color' \(line 5\) overwrites 'one.color', last frame's value too; read 'blend.color@previous'"
    with pytest.raises(InputError, match=said):
        bench.pipeline(text, Ones, Blends, shaders=CONTINUED).check()
    mended = text.replace("one.color@previous", "blend.color@previous")
    frames = [
        bench.draw(mended, Ones, Blends, shaders=CONTINUED, frames=range(1, count + 1)).arrays["image"]
        for count in (1, 2, 3)
    ]
    assert [float(frame.max()) for frame in frames] == [1.0, 1.5, 1.75]


class Ones(Node):
    """One everywhere."""

    color = Output(AnyTexel, format="r32f", doc="1.")

    def record(self, steps: Steps) -> None:
        steps.fullscreen("plus.frag", out=self.color)


class Silent(Node):
    """Has nothing to add to what it continues."""

    color = InOut(AnyTexel, doc="What it continues.")

    def record(self, steps: Steps) -> None:
        pass


def test_a_node_that_records_nothing_passes_on_what_it_continues(draw: Draw) -> None:
    text = """nodes:
  one: {type: ones}
  silent: {type: silent, inputs: {color: one.color}}
  last: {type: plus, inputs: {color: silent.color}}
outputs: {image: last.color, between: silent.color}"""
    frame = draw(text, Ones, Silent, Plus, shaders=CONTINUED)
    assert np.all(frame.arrays["image"] == 2)
    assert np.all(frame.arrays["between"] == 1)
    assert frame.culled["silent"] == "it recorded no step"


class Nothing(Node):
    """An array of no layers."""

    layers = Output(AnyTexel, kind="texture2d_array", layers=lambda node, facts: 0, doc="None.")


class Needy(Node):
    """Continues a texture, or makes one, where there are layers to read."""

    layers = Input(AnyTexel, kind="texture2d_array", size="any", doc="Layers.")
    color = InOut(AnyTexel, optional=True, format="r32f", first=8.0, doc="What it continues.")

    def record(self, steps: Steps) -> None:
        steps.fullscreen("plus.frag", layers=self.layers, out=self.color)


def test_a_node_with_nothing_to_read_passes_on_what_it_would_continue(draw: Draw) -> None:
    text = """nodes:
  none: {type: nothing}
  first: {type: plus}
  idle: {type: needy, inputs: {layers: none.layers, color: first.color}}
  last: {type: plus, inputs: {color: idle.color}}
outputs: {image: last.color, between: idle.color}"""
    plain = text.replace("{type: plus}", "{type: halve, inputs: {old: last.color@previous}}")
    frame = draw(plain, Nothing, Halve, Plus, Needy, shaders=CONTINUED, frames=range(1, 3))
    assert np.all(frame.arrays["image"] == 1.5)
    assert np.all(frame.arrays["between"] == 0.5)
    assert frame.culled["idle"] == "none.layers has no layers: there is nothing to read"


def test_last_frame_s_value_of_a_node_that_does_nothing_is_its_first(draw: Draw) -> None:
    text = """nodes:
  none: {type: nothing}
  idle: {type: needy, inputs: {layers: none.layers}}
  half: {type: halve, inputs: {old: idle.color@previous}}
outputs: {image: half.color}"""
    assert np.all(draw(text, Nothing, Halve, Needy, shaders=CONTINUED, frames=range(1, 3)).arrays["image"] == 4)


class Walkers(Node):
    """Two points that step one texel to the right in each frame, kept in a buffer and drawn from it."""

    color = Output(AnyTexel, format="r32f", clear=0.0, doc="1 where a walker is.")
    walkers = History(kind="buffer", bytes=16)

    def record(self, steps: Steps) -> None:
        steps.compute("walk.comp", groups=(1, 1, 1), before=self.walkers.previous, out=self.walkers)
        steps.draw(
            "walker.frag",
            vertex="walker.vert",
            vertices=2,
            topology="points",
            attributes={"2f in_position": self.walkers},
            before=self.walkers.previous,
        )


class Tally(Node):
    """Counts frames in a buffer that another node hands back."""

    before = Input(AnyTexel, kind="buffer", doc="The count before.")
    count = Output(AnyTexel, kind="buffer", bytes=4, doc="The count.")
    color = Output(Luminance, format="r32f", doc="The count.")

    def record(self, steps: Steps) -> None:
        steps.compute("tally.comp", groups=(1, 1, 1), out=self.count, before=self.before)
        steps.fullscreen("count.frag", out=self.color, count=self.count)


def test_a_buffer_keeps_last_frames_values(bench: Any) -> None:
    shaders = {
        "walk.comp": """layout(local_size_x = 2) in;
            layout(std430) readonly buffer before { vec2 old[]; };
            layout(std430) buffer walkers { vec2 position[]; };
            void main() {
                uint i = gl_GlobalInvocationID.x;  // all begins as 0
                position[i] = old[i] + vec2(1.0, i);
            }""",
        "walker.vert": """in vec2 in_position;
            void main() {
                gl_Position = vec4((in_position + 0.5) / vec2(8.0, 4.0) - 1.0, 0.5, 1.0);
                gl_PointSize = 1.0;
            }""",
        "walker.frag": """layout(std430) readonly buffer before { vec2 old[]; };
            out float color; void main() { color = 1.0 + old[0].x; }""",
    }
    frames = bench.frames(
        "nodes: {a: {type: walkers}}\noutputs: {image: a.color}",
        Walkers,
        shaders=shaders,
        frames=range(1, 5),
    )
    for number, frame in enumerate(frames, 1):
        rows, columns = np.nonzero(frame.arrays["image"][::-1, :, 0])
        assert set(zip(columns.tolist(), rows.tolist(), strict=True)) == {(number, 0), (number, number)}
        assert frame.arrays["image"].max() == number


def test_a_buffer_is_handed_back_from_the_last_frame(bench: Any) -> None:
    shaders = {
        "tally.comp": """layout(local_size_x = 1) in;
            layout(std430) readonly buffer before { uint old; };
            layout(std430) buffer count { uint now; };
            void main() { now = old + 1u; }""",
        "count.frag": """layout(std430) readonly buffer count { uint now; };
            out float color; void main() { color = float(now); }""",
    }
    text = "nodes: {a: {type: tally, inputs: {before: a.count@previous}}}\noutputs: {image: a.color}"
    for reuse in (False, True):
        frames = bench.frames(text, Tally, shaders=shaders, frames=range(1, 4), reuse=reuse)
        assert [float(frame.arrays["image"].mean()) for frame in frames] == [1, 2, 3]
    for mode in ({"alias": False}, {"poison": True, "shuffle": 3}):
        assert bench.draw(text, Tally, shaders=shaders, frames=range(1, 4), **mode).arrays["image"].mean() == 3


class Seen(Node):
    """Depth of the scene."""

    depth = Output(Depth, format="depth32f", clear=0.0, doc="From the camera.")

    def record(self, steps: Steps) -> None:
        steps.geometry(None, vertex="<depth.vert>", out=self.depth, materials="none")


class LastSurfaces(Node):
    """World-space places of what the last frame's depth holds, by the view that belongs to it and by this frame's."""

    depth = Input(Depth, doc="Last frame's.")
    now = Input(Depth, doc="This frame's.")
    there = Output(AnyTexel, format="rgba32f", doc="Height by last frame's view, by this one's, twice the former; 1.")


def test_what_was_drawn_last_frame_has_last_frame_s_view(draw: Draw) -> None:
    """A plane at a height of 0 under a camera that turns and sinks: each depth with its own view lies in it."""
    scene = (
        "objects: {plane: {shape: plane, size: [90, 90]}}\n"
        "cameras: {main: {eye: [0, 3, 5], target: [0, 0, 0]}}\n"
        "keyframes: {cameras.main.eye: {0: [0, 3, 5], 1: [2, 1, 4]}}\n"
    )
    shader = """uniform sampler2D depth; uniform sampler2D now; in vec2 v_uv; out vec4 there; void main() {
        ivec2 p = ivec2(gl_FragCoord.xy);
        float d = texelFetch(depth, p, 0).r;
        there = vec4(world_position(depth_views[0], v_uv, d).y, world_position(now_views[0], v_uv, d).y,
            world_position(previous_now_views[0], v_uv, d).y, is_nothing(d) ? 0.0 : 1.0); }"""
    text = """nodes:
  seen: {type: seen}
  a: {type: last_surfaces, inputs: {depth: seen.depth@previous, now: seen.depth}}
outputs: {image: a.there}"""
    options: Any = {"frames": range(1, 9), "scene": scene}
    found = draw(text, Seen, LastSurfaces, shaders={"last_surfaces.frag": shader}, **options)["image"]
    places = found[found[..., 3] == 1]
    assert len(places) > 50
    assert np.abs(places[:, [0, 2]]).max() < 1e-3
    assert np.abs(places[:, 1]).max() > 0.02


class Fragments(Node):
    """Counts an object's fragments, and shows this frame's and last frame's count."""

    color = Output(Luminance, format="rg32f", doc="Now and before.")
    depth = Internal(Depth, format="depth32f", clear=0.0)
    count = History(kind="buffer", bytes=4, clear=0)

    def record(self, steps: Steps) -> None:
        steps.geometry(fragment="count.frag", out={"depth": self.depth, "count": self.count})
        steps.fullscreen("counts.frag", now=self.count, before=self.count.previous, out=self.color)


def test_geometry_that_stores_into_a_history_takes_turns_with_it(bench: Any) -> None:
    shaders = {
        "count.frag": "layout(std430) buffer count { uint value; }; void main() { atomicAdd(value, 1u); }",
        "counts.frag": """layout(std430) readonly buffer now { uint a; }; layout(std430) readonly buffer before { uint b; };
            out vec2 color; void main() { color = vec2(a, b); }""",
    }
    scene = "objects: {a: {shape: box, size: [9, 9, 1]}}\ncameras: {main: {eye: [0, 0, 5], target: [0, 0, 0]}}\n"
    text = "nodes: {f: {type: fragments}}\noutputs: {image: f.color}"
    frames = bench.frames(text, Fragments, shaders=shaders, scene=scene, frames=range(1, 5))
    counts = [tuple(frame["image"][0, 0]) for frame in frames]
    full = counts[0][0]
    assert full > 0
    assert counts == [(full, 0), *[(full, full)] * 3]
