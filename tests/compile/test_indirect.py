"""Work whose amount a shader decides: dispatches and draws that take their counts from buffers."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from rendergraph.api import Any as AnyTexel
from rendergraph.api import Input, Internal, Node, Output, Radiance, Steps, param, structural
from rendergraph.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import Any

    import rendergraph as rg

    Draw = Callable[..., rg.Frame]


class Chosen(Node):
    """The first shader keeps every second of 16 points, and writes how much work is left for the others."""

    color = Output(Radiance, format="r32f", clear=0.0, doc="Each kept point and its height.")
    heights = Output(AnyTexel, kind="buffer", bytes=64, clear=0, doc="Twice the index of each kept point.")
    kept = Internal(kind="buffer", bytes=64)
    dispatch = Internal(kind="buffer", bytes=24, clear=0)
    commands = Internal(kind="buffer", bytes=60, clear=0)
    indices = Internal(kind="buffer", bytes=64)

    first: int = param(default=0, min=0, max=15, doc="First point.")

    def record(self, steps: Steps) -> None:
        out = {"kept": self.kept, "dispatch": self.dispatch, "commands": self.commands, "indices": self.indices}
        steps.compute("choose.comp", groups=(1, 1, 1), out=out)
        steps.compute("heights.comp", groups=self.dispatch, command=1, kept=self.kept, out=self.heights)
        steps.draw(
            "point.frag",
            vertex="point.vert",
            vertices=self.commands,
            commands=3,
            indices=self.indices,
            topology="points",
            kept=self.kept,
            heights=self.heights,
            out=self.color,
        )


SHADERS = {
    "choose.comp": """layout(local_size_x = 16) in;
        layout(std430) buffer kept { uint points[]; };
        layout(std430) buffer dispatch { uint count[6]; };
        layout(std430) buffer commands { uint command[15]; };
        layout(std430) buffer indices { uint order[]; };
        uniform int first;
        shared uint total;
        void main() {
            uint i = gl_LocalInvocationIndex;
            if (i == 0u) total = 0u;
            barrier();
            if (int(i) >= first && i % 2u == 0u) points[atomicAdd(total, 1u)] = i;
            barrier();
            order[i] = total - 1u - min(i, total - 1u);  // from the last to the first
            if (i > 0u) return;
            count[3] = total;  // the second triple: one group for each point
            count[4] = count[5] = 1u;
            command[0] = total / 2u;  // half of the points by the first of three commands, none by the second
            command[10] = total - total / 2u;
            command[12] = total / 2u;  // the first index
            command[1] = command[11] = 1u;
        }""",
    "heights.comp": """layout(local_size_x = 1) in;
        layout(std430) readonly buffer kept { uint points[]; };
        layout(std430) buffer heights { uint height[]; };
        void main() { height[gl_WorkGroupID.x] = 2u * points[gl_WorkGroupID.x]; }""",
    "point.vert": """layout(std430) readonly buffer kept { uint points[]; };
        layout(std430) readonly buffer heights { uint height[]; };
        flat out float v_height;
        void main() {
            gl_Position = vec4((float(points[gl_VertexID]) + 0.5) / 8.0 - 1.0, 0.5 / 4.0 - 1.0, 0.5, 1.0);
            gl_PointSize = 1.0;
            v_height = float(height[gl_VertexID]) + 1.0;
        }""",
    "point.frag": "flat in float v_height; out float color; void main() { color = v_height; }",
}
TEXT = "nodes: {a: {type: chosen}}\noutputs: {image: a.color}"


@pytest.mark.parametrize("first", [0, 12])
def test_a_shader_decides_how_much_is_dispatched_and_drawn(bench: Any, gl: rg.Session, first: int) -> None:
    pipeline = bench.pipeline(TEXT, Chosen, shaders=SHADERS).set("a.first", first)
    modes: tuple[dict[str, Any], ...] = ({}, {"poison": True, "shuffle": 2})
    for mode in modes:
        frame = gl.render(pipeline, outputs=["image"], taps=["a.heights"], frames=range(1, 3), **mode)
        kept = np.arange(first, 16, 2)
        heights = frame["a.heights"].view(np.uint32)
        assert sorted(heights[: len(kept)]) == list(2 * kept)
        assert not heights[len(kept) :].any()
        drawn = np.zeros(16)
        drawn[kept] = 2 * kept + 1
        np.testing.assert_array_equal(frame.arrays["image"][-1, :, 0], drawn)


class Wrong(Node):
    """Gives a texture where a buffer belongs."""

    color = Output(Radiance, doc="Nothing.")
    texture = Internal(format="r32ui")

    def record(self, steps: Steps) -> None:
        steps.compute("a.comp", groups=self.texture, out=self.color)


def test_groups_come_from_a_buffer(bench: Any) -> None:
    with pytest.raises(InputError, match=r"groups.*'texture'.*buffer"):
        bench.draw("nodes: {a: {type: wrong}}\noutputs: {image: a.color}", Wrong)


class Counted(Node):
    """Draws as many commands, and instances, as buffers say."""

    drawn = Output(Radiance, format="r32f", clear=0.0, doc="1 where a command is drawn.")
    copied = Output(Radiance, format="r32f", clear=0.0, doc="1 where an instance is drawn.")
    commands = Internal(kind="buffer", bytes=20 * 8, clear=0)
    number = Internal(kind="buffer", bytes=4)
    indices = Internal(kind="buffer", bytes=4 * 16)

    many: int = param(default=5, min=0, max=8, doc="How many are drawn.")
    indexed: bool = structural(default=False, doc="Whether with indices.")

    def record(self, steps: Steps) -> None:
        out = {"commands": self.commands, "number": self.number, "indices": self.indices}
        steps.compute("count.comp", groups=(1, 1, 1), out=out, defines={"INDEXED": self.indexed})
        shaders: dict[str, Any] = {"fragment": "one.frag", "topology": "points", "none": 0.0}
        shaders |= {"indices": self.indices} if self.indexed else {}
        steps.draw(
            **shaders, vertex="x.vert", vertices=self.commands, commands=7, command=1, count=self.number, out=self.drawn
        )
        steps.draw(**shaders, vertex="i.vert", vertices=1, instances=self.number, out=self.copied)


COUNTED = {
    "count.comp": """layout(local_size_x = 16) in;
        layout(std430) buffer commands { uint command[40]; };
        layout(std430) buffer number { uint count; };
        layout(std430) buffer indices { uint order[]; };
        uniform int many;
        void main() {
            uint i = gl_LocalInvocationIndex;
            order[i] = INDEXED == 1 ? 15u - i : 0u;
            if (i == 0u) count = uint(many);
            if (i < uint(many) && i < 7u) {
                command[5u * (i + 1u)] = 1u;  // a vertex, an instance, and which one
                command[5u * (i + 1u) + 1u] = 1u;
                command[5u * (i + 1u) + 2u] = i;
            }
        }""",
    "x.vert": """uniform float none; void main() {
        gl_Position = vec4((float(gl_VertexID) + 0.5 + none) / 8.0 - 1.0, 0.0, 0.5, 1.0); gl_PointSize = 1.0; }""",
    "i.vert": """uniform float none; void main() {
        gl_Position = vec4((float(gl_InstanceID) + 0.5 + none) / 8.0 - 1.0, 0.0, 0.5, 1.0); gl_PointSize = 1.0; }""",
    "one.frag": "out float value; void main() { value = 1.0; }",
}


@pytest.mark.parametrize("counts", [True, False])
@pytest.mark.parametrize("indexed", [False, True])
@pytest.mark.parametrize("many", [0, 5])
def test_a_buffer_holds_how_many_commands_and_instances_are_drawn(
    bench: Any, gl: rg.Session, monkeypatch: pytest.MonkeyPatch, many: int, indexed: bool, counts: bool
) -> None:
    if not counts:
        monkeypatch.setitem(gl.device.limits, "counted_draws", 0)
        monkeypatch.setattr("rendergraph.compile.steps.CountedDraw.__call__", None)
    text = "nodes: {a: {type: counted}}\noutputs: {drawn: a.drawn, copied: a.copied}"
    pipeline = bench.pipeline(text, Counted, shaders=COUNTED).set("a.many", many).set("a.indexed", indexed)
    frame = gl.render(pipeline)
    expected = (np.arange(16) < many).astype(np.float32)
    np.testing.assert_array_equal(frame.arrays["copied"][..., 0].max(axis=0), expected)
    np.testing.assert_array_equal(frame.arrays["drawn"][..., 0].max(axis=0), expected[::-1] if indexed else expected)


def test_a_count_leaves_commands_out(bench: Any, gl: rg.Session) -> None:
    if not gl.device.limits["counted_draws"]:
        pytest.skip("no GL_ARB_indirect_parameters")
    shaders = {**COUNTED, "count.comp": COUNTED["count.comp"].replace("count = uint(many)", "count = 2u")}
    text = "nodes: {a: {type: counted}}\noutputs: {drawn: a.drawn}"
    frame = gl.render(bench.pipeline(text, Counted, shaders=shaders))
    assert frame.arrays["drawn"].sum() == 2  # of the five commands that are there


class Makes(Node):
    """Makes a command for others."""

    commands = Output(AnyTexel, kind="buffer", bytes=16, doc="Three points.")

    def record(self, steps: Steps) -> None:
        steps.compute("make.comp", groups=(1, 1, 1), out=self.commands)


class Takes(Node):
    """Draws by it."""

    commands = Input(AnyTexel, kind="buffer", doc="A command.")
    color = Output(Radiance, format="r32f", clear=0.0, doc="1 at points.")

    def record(self, steps: Steps) -> None:
        steps.draw("one.frag", vertex="x.vert", vertices=self.commands, topology="points", none=0.0)


def test_commands_of_another_node(bench: Any, gl: rg.Session) -> None:
    make = "layout(local_size_x = 1) in;\nlayout(std430) buffer commands { uint c[4]; };\n"
    shaders = {**COUNTED, "make.comp": make + "void main() { c[0] = 3u; c[1] = 1u; c[2] = 0u; c[3] = 0u; }"}
    text = "nodes:\n  a: {type: makes}\n  b: {type: takes, inputs: {commands: a.commands}}\noutputs: {color: b.color}"
    frame = gl.render(bench.pipeline(text, Makes, Takes, shaders=shaders))
    np.testing.assert_array_equal(frame.arrays["color"][..., 0].max(axis=0), (np.arange(16) < 3).astype(np.float32))
