"""Work whose amount a shader decides: dispatches and draws that take their counts from buffers."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from rendergraph.api import Any as AnyTexel
from rendergraph.api import Internal, Node, Output, Radiance, Steps, param
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
        np.testing.assert_array_equal(frame["image"][-1, :, 0], drawn)


class Wrong(Node):
    """Gives a texture where a buffer belongs."""

    color = Output(Radiance, doc="Nothing.")
    texture = Internal(format="r32ui")

    def record(self, steps: Steps) -> None:
        steps.compute("a.comp", groups=self.texture, out=self.color)


def test_groups_come_from_a_buffer(bench: Any) -> None:
    with pytest.raises(InputError, match=r"groups.*'texture'.*buffer"):
        bench.draw("nodes: {a: {type: wrong}}\noutputs: {image: a.color}", Wrong)
