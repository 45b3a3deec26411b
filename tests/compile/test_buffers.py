"""Compute, images, buffers, draws over a node's own buffers, and what `update` writes."""

from __future__ import annotations

from itertools import groupby
from typing import TYPE_CHECKING, Any

import moderngl
import numpy as np
import pytest

from rendergraph.api import Any as AnyTexel
from rendergraph.api import Frame, Function, Input, Internal, Node, Output, Radiance, Signature, Steps, param
from rendergraph.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Callable

    import rendergraph as rg

    Draw = Callable[..., rg.Frame]


class Checker(Node):
    """An image written by a compute shader."""

    board = Output(AnyTexel, format="r32f", doc="0 and 1 by turns.")

    def record(self, steps: Steps) -> None:
        width, height = steps.desc(self.board).size
        steps.compute("checker.comp", groups=((width + 7) // 8, (height + 7) // 8, 1))


class Count(Node):
    """How many texels hold 0 and how many 1, counted into a buffer by atomics."""

    source = Input(AnyTexel, doc="What to count.")
    counts = Output(AnyTexel, kind="buffer", bytes=8, clear=0.0, doc="Two 32-bit counts.")

    def record(self, steps: Steps) -> None:
        width, height = steps.facts.viewport
        steps.compute("count.comp", groups=(width, height, 1))


class Show(Node):
    """A buffer's numbers as a texture."""

    counts = Input(AnyTexel, kind="buffer", doc="Two counts.")
    color = Output(Radiance, format="rg32f", doc="Both.")


SHADERS = {
    "checker.comp": """layout(local_size_x = 8, local_size_y = 8) in;
        layout(r32f) uniform writeonly image2D board;
        void main() {
            ivec2 p = ivec2(gl_GlobalInvocationID.xy);
            imageStore(board, p, vec4((p.x + p.y) % 2));
        }""",
    "count.comp": """layout(local_size_x = 1) in;
        uniform sampler2D source;
        layout(std430) buffer counts { uint bins[2]; };
        void main() {
            float value = texelFetch(source, ivec2(gl_GlobalInvocationID.xy), 0).r;
            int bin = value > 0.5 ? 1 : 0;  // chosen in the atomic's argument, it crashes the compiler of NVIDIA 580
            atomicAdd(bins[bin], 1u);
        }""",
    "show.frag": """layout(std430) readonly buffer counts { uint bins[2]; };
        out vec2 color; void main() { color = vec2(bins[0], bins[1]); }""",
}


def test_compute_writes_what_later_steps_read_in_every_frame(draw: Draw) -> None:
    text = """nodes:
  checker: {type: checker}
  count: {type: count, inputs: {source: checker.board}}
  show: {type: show, inputs: {counts: count.counts}}
outputs: {image: show.color, board: checker.board}"""
    frame = draw(text, Checker, Count, Show, shaders=SHADERS, frames=range(1, 4), size=(17, 9))
    np.testing.assert_array_equal(frame["image"][0, 0], [77, 76])
    assert frame.arrays["board"][-1, 0, 0] == 0
    assert frame.arrays["board"][-1, 1, 0] == 1


def test_buffers_are_cleared_without_waiting_for_who_reads_them(draw: Draw, monkeypatch: pytest.MonkeyPatch) -> None:
    """moderngl's clear maps the buffer; a count that starts at other than 0 would be another's."""
    monkeypatch.setattr(moderngl.Buffer, "clear", lambda *_, **__: pytest.fail("a buffer is mapped"))
    text = """nodes:
  checker: {type: checker}
  count: {type: count, inputs: {source: checker.board}}
  show: {type: show, inputs: {counts: count.counts}}
outputs: {image: show.color}"""
    frame = draw(text, Checker, Count, Show, shaders=SHADERS, frames=range(1, 6), size=(7, 3))
    np.testing.assert_array_equal(frame["image"][0, 0], [11, 10])


class Quads(Node):
    """A square whose corners the CPU computes each frame."""

    color = Output(AnyTexel, format="r32f", clear=0.0, doc="1 in the square.")
    corners = Internal(kind="buffer", bytes=4 * 2 * 4)
    half: float = param(default=0.5, min=0, max=1, doc="Half the side.")

    def record(self, steps: Steps) -> None:
        steps.draw(
            "one.frag",
            vertex="square.vert",
            vertices=4,
            topology="triangle_strip",
            attributes={"2f in_corner": self.corners},
        )

    def update(self, frame: Frame) -> None:
        h = self.half * frame.index
        frame.write(self.corners, np.array([[-h, -h], [h, -h], [-h, h], [h, h]], np.float32))


QUADS = {
    "square.vert": "in vec2 in_corner; void main() { gl_Position = vec4(in_corner, 0.0, 1.0); }",
    "one.frag": "out float r; void main() { r = 1.0; }",
}


def test_a_draw_over_a_buffer_that_update_writes_each_frame(draw: Draw) -> None:
    text = "nodes: {q: {type: quads, params: {half: 0.25}}}\noutputs: {image: q.color}"
    for frames, share in ((range(1, 2), 1 / 16), (range(1, 3), 1 / 4)):
        assert draw(text, Quads, shaders=QUADS, size=(16, 16), frames=frames).arrays["image"].mean() == share


def test_an_update_that_writes_too_much_is_named(draw: Draw) -> None:
    class TooMuch(Quads):
        """Writes more than it declared."""

        def update(self, frame: Frame) -> None:
            frame.write(self.corners, np.zeros(9, np.float32))

    text = "nodes: {q: {type: too_much}}\noutputs: {image: q.color}"
    with pytest.raises(
        InputError, match=r"RG432 node 'q' .*test_buffers\.py:\d+: it writes 36 bytes into 'corners', which holds 32"
    ):
        draw(text, TooMuch, shaders=QUADS)


def test_a_draw_whose_count_a_compute_shader_decides(draw: Draw) -> None:
    class Indirect(Node):
        """As many points as a compute shader says."""

        color = Output(AnyTexel, format="r32f", clear=0.0, doc="1 where a point is.")
        command = Internal(kind="buffer", bytes=20)

        def record(self, steps: Steps) -> None:
            steps.compute("command.comp", groups=(1, 1, 1), out=self.command)
            steps.draw("one.frag", vertex="points.vert", vertices=self.command, topology="points", out=self.color)

    shaders = QUADS | {
        "command.comp": """layout(local_size_x = 1) in; layout(std430) buffer command { uint c[5]; };
            void main() { c[0] = 5u; c[1] = 1u; c[2] = 0u; c[3] = 0u; c[4] = 0u; }""",
        "points.vert": """void main() { gl_PointSize = 1.0;
            gl_Position = vec4((float(gl_VertexID) + 0.5) / 8.0 - 1.0, 1.0 / 8.0 - 1.0, 0.0, 1.0); }""",
    }
    image = draw(
        "nodes: {i: {type: indirect}}\noutputs: {image: i.color}", Indirect, shaders=shaders, size=(16, 8)
    ).arrays["image"]
    assert image.sum() == 5


class Commands(Node):
    """Two of three draw commands that the CPU writes."""

    color = Output(AnyTexel, format="r32f", clear=0.0, doc="1 at every point.")
    commands = Internal(kind="buffer", bytes=3 * 20)

    def record(self, steps: Steps) -> None:
        for command in (0, 2):
            steps.draw("one.frag", vertex="points.vert", vertices=self.commands, command=command, topology="points")

    def update(self, frame: Frame) -> None:
        frame.write(self.commands, np.array([[2, 1, 0, 0, 0], [4, 1, 2, 0, 0], [3, 1, 6, 0, 0]], np.int32))


def test_a_draw_takes_one_of_several_commands(draw: Draw) -> None:
    shaders = {
        "one.frag": "out float r; void main() { r = 1.0; }",
        "points.vert": """void main() { gl_PointSize = 1.0;
            gl_Position = vec4((float(gl_VertexID) + 0.5) / 8.0 - 1.0, 1.0 / 8.0 - 1.0, 0.0, 1.0); }""",
    }
    image = draw("nodes: {c: {type: commands}}\noutputs: {image: c.color}", Commands, shaders=shaders, size=(16, 8))
    assert np.flatnonzero(image.arrays["image"][-1, :, 0]).tolist() == [0, 1, 6, 7, 8]


class Fill(Node):
    """A buffer that holds one number."""

    values = Output(AnyTexel, kind="buffer", bytes=4 * 128, doc="The number.")
    value: float = param(default=1.0, doc="The number.")

    def record(self, steps: Steps) -> None:
        steps.compute("fill.comp", over=128)


class Shown(Node):
    """A buffer's numbers, and the mean of those far away."""

    values = Input(AnyTexel, kind="buffer", doc="What is shown.")
    color = Output(Radiance, format="r32f", doc="The numbers.")


FILL = {
    "fill.comp": """layout(local_size_x = 64) in; layout(std430) buffer values { float v[]; };
        uniform float value;
        void main() { v[gl_GlobalInvocationID.x] = value; }""",
    "shown.frag": """layout(std430) readonly buffer values { float v[]; }; out float color;
        void main() {
            int at = int(gl_FragCoord.y) * 16 + int(gl_FragCoord.x);
            for (int i = 0; i < 64; i++) color += v[(at + i * i) % 128] / 64.0;
        }""",
}


def test_a_buffer_is_not_filled_again_before_who_reads_it_is_done(bench: Any) -> None:
    """A draw that reads it may not have run when the next shader that stores there begins."""
    text = """nodes:
  a: {type: fill, params: {value: 1}}
  b: {type: fill, params: {value: 2}}
  one: {type: shown, inputs: {values: a.values}}
  two: {type: shown, inputs: {values: b.values}}
outputs: {image: one.color, other: two.color}"""
    pipeline = bench.pipeline(text, Fill, Shown, shaders=FILL)
    plan = pipeline.plan()
    assert plan.placement["a.values"] == plan.placement["b.values"]
    frame = bench.session.render(pipeline)
    assert (frame.arrays["image"] == 1).all()
    assert (frame.arrays["other"] == 2).all()


class Redrawn(Node):
    """Drawn, looked at, and drawn again; after another target's turn a compute shader looks at it."""

    color = Output(Radiance, format="r32f", doc="What the compute shader found.")
    first = Output(Radiance, format="r32f", doc="What was there at first.")
    twice = Internal(format="r32f", clear=0.0)
    other = Internal(format="r32f", clear=0.0)
    values = Internal(kind="buffer", bytes=4 * 128)

    def record(self, steps: Steps) -> None:
        steps.fullscreen("number.frag", out={"c": self.twice}, number=1.0)
        steps.fullscreen("look.frag", out={"c": self.first}, source=self.twice)
        steps.fullscreen("number.frag", out={"c": self.twice}, number=2.0)
        steps.fullscreen("number.frag", out={"c": self.other}, number=3.0)
        steps.compute("look.comp", over=128, out=self.values, source=self.twice, other=self.other)
        steps.fullscreen("shown.frag", out=self.color, values=self.values)


def test_a_compute_shader_sees_what_was_drawn_last(bench: Any) -> None:
    """Mesa's software rasteriser gave it what an earlier draw had left."""
    shaders = FILL | {
        "number.frag": """uniform float number; out float c;
            void main() { for (int i = 0; i < 4096; i++) c += number / 4096.0; }""",
        "look.frag": "uniform sampler2D source; out float c;"
        "void main() { c = texelFetch(source, ivec2(gl_FragCoord.xy), 0).r; }",
        "look.comp": """layout(local_size_x = 64) in; uniform sampler2D source; uniform sampler2D other;
            layout(std430) buffer values { float v[]; };
            void main() {
                int i = int(gl_GlobalInvocationID.x);
                ivec2 p = ivec2(i % 16, i / 16);
                v[i] = texelFetch(source, p, 0).r;
            }""",
    }
    text = "nodes: {r: {type: redrawn}}\noutputs: {image: r.color, first: r.first}"
    for frame in bench.frames(text, Redrawn, shaders=shaders, size=(64, 64), frames=range(1, 9)):
        assert (frame.arrays["first"] == 1).all()
        assert (frame.arrays["image"] == 2).all()


class Filled(Node):
    """Filled twice, then looked at."""

    color = Output(Radiance, format="r32f", doc="What is there.")
    values = Internal(kind="buffer", bytes=4 * 128)

    def record(self, steps: Steps) -> None:
        steps.compute("fill.comp", over=128, out=self.values, value=1.0)
        steps.compute("fill.comp", over=128, out=self.values, value=2.0)
        steps.fullscreen("shown.frag", out=self.color, values=self.values)


def test_one_barrier_stands_between_two_steps_that_store(bench: Any) -> None:
    pipeline = bench.pipeline("nodes: {f: {type: filled}}\noutputs: {image: f.color}", Filled, shaders=FILL)
    with bench.session.current():
        (steps,) = bench.session.compile(pipeline).executable.lists
        barrier = bench.session.device.raw.glMemoryBarrier
        flat = [getattr(call, "func", None) is barrier for step in steps for call in step.calls]
    assert [len(list(run)) for is_barrier, run in groupby(flat) if is_barrier] == [1, 1, 1]
    assert (bench.session.render(pipeline).arrays["image"] == 2).all()


class Seeded(Node):
    """A number that `update` writes each frame, doubled by a compute shader in the same buffer."""

    color = Output(AnyTexel, format="r32f", doc="Twice the frame's number.")
    number = Internal(kind="buffer", bytes=16)

    def record(self, steps: Steps) -> None:
        steps.compute("double.comp", groups=(1, 1, 1), out=self.number)
        steps.fullscreen("number.frag", number=self.number, out=self.color)

    def update(self, frame: Frame) -> None:
        frame.write(self.number, np.full(4, frame.index, np.float32))


def test_a_buffer_that_update_fills_and_a_step_changes_is_never_shared(bench: Any) -> None:
    shaders = {
        "double.comp": """layout(local_size_x = 1) in; layout(std430) buffer number { float values[4]; };
            void main() { values[0] *= 2.0; }""",
        "number.frag": """layout(std430) readonly buffer number { float values[4]; };
            out float color; void main() { color = values[0]; }""",
    }
    text = "nodes: {a: {type: seeded}, b: {type: seeded}}\noutputs: {image: a.color, other: b.color}"
    pipeline = bench.pipeline(text, Seeded, shaders=shaders)
    plan = pipeline.plan()
    assert plan.placement["a.number"] != plan.placement["b.number"]
    frame = bench.session.render(pipeline, frames=range(1, 4))
    assert frame.arrays["image"].mean() == frame.arrays["other"].mean() == 6.0


class Offers(Node):
    """A function of numbers that only `update` writes."""

    level = Function(
        Signature("level", "float level(int n)", ("n",), "+", "0.0", "A number."),
        shader="level.glsl",
        reads=("numbers",),
        doc="Level.",
    )
    numbers = Internal(kind="buffer", bytes=8)

    def record(self, steps: Steps) -> None:
        """No step: the function is all."""

    def update(self, frame: Frame) -> None:
        frame.write(self.numbers, np.array([3, 4], np.float32))


class Takes(Node):
    """Calls it."""

    level = Input(Offers.level.signature, kind="function", doc="Level.")
    color = Output(Radiance, format="r32f", doc="The level.")


def test_a_function_reads_what_only_update_writes(draw: Draw) -> None:
    shaders = {
        "level.glsl": "layout(std430) readonly buffer numbers { float values[]; };\nfloat level(int n) { return values[n]; }\n",
        "takes.frag": "out float color; void main() { color = level(1); }",
    }
    text = "nodes: {o: {type: offers}, t: {type: takes, inputs: {level: o.level}}}\noutputs: {image: t.color}"
    assert draw(text, Offers, Takes, shaders=shaders).arrays["image"].max() == 4
