"""Images, buffers and atomics in drawing steps, and attributes that advance per instance."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rendergraph.api import Any as AnyTexel
from rendergraph.api import Frame, Input, Internal, Node, Output, Radiance, State, Steps

if TYPE_CHECKING:
    from collections.abc import Callable

    import rendergraph as rg

    Draw = Callable[..., rg.Frame]


class Layers(Node):
    """Counts the fragments of each pixel while drawing nothing, and then halves the counts in place."""

    color = Output(Radiance, format="r32f", doc="Half the counts.")
    counts = Internal(format="r32ui", clear=0)

    def record(self, steps: Steps) -> None:
        everything = State(depth_test=False, cull="none")
        steps.geometry("count.frag", out=self.counts.stored(), state=everything, materials="none")
        steps.fullscreen("half.frag", out=self.color, counts=self.counts.stored())


class Histogram(Node):
    """A drawn gradient, and how many of its pixels are bright: a color target, a buffer and an image in one step."""

    color = Output(Radiance, format="r32f", doc="A gradient.")
    bins = Output(AnyTexel, kind="buffer", bytes=8, clear=0, doc="Dark and bright pixels.")
    marks = Output(AnyTexel, format="r32f", clear=0, doc="1 at bright pixels.")

    def record(self, steps: Steps) -> None:
        steps.fullscreen("histogram.frag", out={"color": self.color, "bins": self.bins, "marks": self.marks.stored()})


class Copy(Node):
    """Loads its input as an image in a full-screen step."""

    source = Input(AnyTexel, use="image", doc="Anything.")
    color = Output(Radiance, format="r32f", doc="Ten times as much.")


class Instances(Node):
    """Two points, each drawn once per offset of a second buffer."""

    color = Output(Radiance, format="r32f", clear=0.0, doc="The number of the instance, from 1.")
    points = Internal(kind="buffer", bytes=16)
    offsets = Internal(kind="buffer", bytes=48)

    def record(self, steps: Steps) -> None:
        steps.draw(
            "instance.frag",
            vertex="instance.vert",
            vertices=2,
            instances=3,
            topology="points",
            attributes={"2f in_position": self.points, "2f 1f 4x/i in_offset in_value": self.offsets},
            out=self.color,
        )

    def update(self, frame: Frame) -> None:
        frame.write(self.points, np.array([[0, 0], [4, 0]], np.float32))
        frame.write(self.offsets, np.array([[0, 0, 1, 0], [1, 1, 2, 0], [2, 2, 3, 0]], np.float32))


SHADERS = {
    "count.frag": "uniform uimage2D counts; void main() { imageAtomicAdd(counts, ivec2(gl_FragCoord.xy), 1u); }",
    "half.frag": "uniform readonly uimage2D counts; out float color;"
    "void main() { color = 0.5 * float(imageLoad(counts, ivec2(gl_FragCoord.xy)).r); }",
    "histogram.frag": """layout(std430) buffer bins { uint count[2]; };
        uniform writeonly image2D marks;
        out float color;
        void main() {
            color = gl_FragCoord.x / 16.0;
            bool bright = color > 0.25;
            atomicAdd(count[bright ? 1 : 0], 1u);
            if (bright) imageStore(marks, ivec2(gl_FragCoord.xy), vec4(1.0));
        }""",
    "copy.frag": "uniform readonly image2D source; out float color;"
    "void main() { color = 10.0 * imageLoad(source, ivec2(gl_FragCoord.xy)).r; }",
    "instance.vert": """in vec2 in_position; in vec2 in_offset; in float in_value; flat out float v_value;
        void main() {
            gl_Position = vec4((in_position + in_offset + 0.5) / vec2(8.0, 4.0) - 1.0, 0.5, 1.0);
            gl_PointSize = 1.0;
            v_value = in_value;
        }""",
    "instance.frag": "flat in float v_value; out float color; void main() { color = v_value; }",
}


def test_a_geometry_step_counts_with_atomics_and_without_a_target(draw: Draw) -> None:
    planes = ", ".join(
        f"p{n}: {{shape: plane, size: [{8 - 2 * n}, 8], rotate_degrees: [90, 0, 0], at: [{n - 4}, 0, {-n}]}}"
        for n in range(3)
    )
    scene = f"objects: {{{planes}}}\ncameras: {{main: {{eye: [0, 0, 9], target: [0, 0, 0], height: 8, near: 0.1}}}}\n"
    frame = draw("nodes: {a: {type: layers}}\noutputs: {image: a.color}", Layers, shaders=SHADERS, scene=scene)
    x = np.arange(16) + 0.5 - 8.0  # one metre is one pixel
    left = [sum(abs(each - (n - 4)) < (8 - 2 * n) / 2 for n in range(3)) / 2 for each in x]
    np.testing.assert_array_equal(frame.arrays["image"][..., 0], np.broadcast_to(left, (8, 16)))


def test_a_full_screen_step_writes_a_target_a_buffer_and_an_image(draw: Draw) -> None:
    text = "nodes: {h: {type: histogram}, c: {type: copy, inputs: {source: h.marks}}}\noutputs: {image: c.color}"
    for mode in ({}, {"poison": True, "shuffle": 2}, {"alias": False}):
        frame = draw(text, Histogram, Copy, shaders=SHADERS, taps=["h.bins"], frames=range(1, 3), **mode)
        np.testing.assert_array_equal(frame["h.bins"].view(np.uint32), [4 * 8, 12 * 8])
        np.testing.assert_array_equal(frame.arrays["image"][0, :, 0], [0] * 4 + [10] * 12)


def test_attributes_advance_per_instance(draw: Draw) -> None:
    image = draw("nodes: {a: {type: instances}}\noutputs: {image: a.color}", Instances, shaders=SHADERS).arrays["image"]
    found = {(int(x), int(y)): float(image[::-1][y, x, 0]) for y, x in np.argwhere(image[::-1, :, 0])}
    assert found == {(x + n, n): n + 1.0 for x in (0, 4) for n in range(3)}
