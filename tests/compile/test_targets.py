"""Mips, layers, cubes, samples, stencil, read-only depth: everything a step can be drawn into and tested with."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rendergraph.api import Any as AnyTexel
from rendergraph.api import (
    Depth,
    Input,
    Internal,
    Luminance,
    Node,
    Output,
    Radiance,
    State,
    Stencil,
    StencilFace,
    Steps,
    define,
    full_mip_count,
)

if TYPE_CHECKING:
    from collections.abc import Callable

    import rendergraph as rg

    Draw = Callable[..., rg.Frame]

TRIANGLE = """vec2 corners[3] = vec2[](vec2(-1, -1), vec2(1, -1), vec2(-1, 1));
uniform float height;
void main() { gl_Position = vec4(corners[gl_VertexID % 3], height, 1.0); }"""
"""The lower left half of the picture."""


class Columns(Node):
    """1, 2, 3, … by column."""

    color = Output(Luminance, format="r32f", doc="Column number.")


class Mean(Node):
    """The mean of a texture, down its own mip chain."""

    source = Input(AnyTexel, size="any", doc="What to average.")
    mean = Output(Luminance, format="r32f", size=(1, 1), doc="The mean.")
    chain = Internal(format="r32f", size="source", mips=0)

    def record(self, steps: Steps) -> None:
        width, height = steps.facts.viewport
        levels = full_mip_count(width, height)
        steps.fullscreen("copy.frag", source=self.source, out=self.chain.mip(0))
        for level in range(1, levels):
            steps.fullscreen("halve.frag", source=self.chain.mip(level - 1), out=self.chain.mip(level))
        steps.fullscreen("copy.frag", source=self.chain.mip(levels - 1), out=self.mean)


MEAN = {
    "columns.frag": "out float color; void main() { color = floor(gl_FragCoord.x) + 1.0; }",
    "copy.frag": "uniform sampler2D source; out float r; void main() { r = texelFetch(source, ivec2(gl_FragCoord.xy), 0).r; }",
    "halve.frag": """uniform sampler2D source; out float r; void main() {
        ivec2 p = 2 * ivec2(gl_FragCoord.xy), last = textureSize(source, 0) - 1;
        r = 0.25 * (texelFetch(source, min(p, last), 0).r + texelFetch(source, min(p + ivec2(1, 0), last), 0).r
            + texelFetch(source, min(p + ivec2(0, 1), last), 0).r + texelFetch(source, min(p + 1, last), 0).r); }""",
}


def test_mips_are_targets_and_sources_of_one_texture(draw: Draw) -> None:
    text = "nodes: {c: {type: columns}, m: {type: mean, inputs: {source: c.color}}}\noutputs: {image: m.mean}"
    frame = draw(text, Columns, Mean, shaders=MEAN, size=(16, 8))
    np.testing.assert_allclose(frame.arrays["image"], [[[8.5]]])


def test_the_drivers_mip_chain(draw: Draw) -> None:
    class Chain(Node):
        """The same by one step."""

        source = Input(AnyTexel, size="any", doc="What to average.")
        mean = Output(Luminance, format="r32f", size=(1, 1), doc="The mean.")
        chain = Internal(format="r32f", size="source", mips=0)

        def record(self, steps: Steps) -> None:
            steps.fullscreen("copy.frag", source=self.source, out=self.chain.mip(0))
            steps.mipmaps(self.chain)
            steps.fullscreen("copy.frag", source=self.chain.mip(4), out=self.mean)

    text = "nodes: {c: {type: columns}, m: {type: chain, inputs: {source: c.color}}}\noutputs: {image: m.mean}"
    np.testing.assert_allclose(draw(text, Columns, Chain, shaders=MEAN, size=(16, 8)).arrays["image"], [[[8.5]]])


class Layers(Node):
    """A number in each layer, one step a layer."""

    array = Output(AnyTexel, kind="texture2d_array", format="r32f", layers=3, size=(4, 2), doc="10, 11, 12.")

    def record(self, steps: Steps) -> None:
        for layer in range(3):
            steps.fullscreen("number.frag", out=self.array.layer(layer), number=10.0 + layer)


NUMBER = {"number.frag": "uniform float number; out float r; void main() { r = number; }"}


def test_layers_of_an_array_are_targets(draw: Draw) -> None:
    frame = draw("nodes: {l: {type: layers}}\noutputs: {image: l.array}", Layers, shaders=NUMBER)
    assert frame.arrays["image"].shape == (3, 2, 4, 1)
    assert (
        [layer.min() for layer in frame.arrays["image"]]
        == [layer.max() for layer in frame.arrays["image"]]
        == [10, 11, 12]
    )


def test_faces_of_a_cube_are_targets_and_looked_up_by_direction(draw: Draw) -> None:
    class Cube(Node):
        """The face's number on each face."""

        cube = Output(AnyTexel, kind="texture_cube", format="r32f", size=(4, 4), doc="0 to 5.")

        def record(self, steps: Steps) -> None:
            for face in range(6):
                steps.fullscreen("number.frag", out=self.cube.layer(face), number=float(face))

    class Look(Node):
        """Looks along the axes, a pixel each."""

        cube = Input(AnyTexel, kind="texture_cube", size="any", doc="What to look at.")
        seen = Output(AnyTexel, format="r32f", size=(6, 1), doc="+x -x +y -y +z -z.")

    look = """uniform samplerCube cube; out float seen;
        void main() {
            vec3 axes[6] = vec3[](vec3(1,0,0), vec3(-1,0,0), vec3(0,1,0), vec3(0,-1,0), vec3(0,0,1), vec3(0,0,-1));
            seen = texture(cube, axes[int(gl_FragCoord.x)]).r;
        }"""
    text = "nodes: {c: {type: cube}, l: {type: look, inputs: {cube: c.cube}}}\noutputs: {image: l.seen}"
    frame = draw(text, Cube, Look, shaders=NUMBER | {"look.frag": look})
    np.testing.assert_array_equal(frame.arrays["image"][0, :, 0], np.arange(6))


def test_a_geometry_shader_draws_to_all_layers_at_once(draw: Draw) -> None:
    class Layered(Node):
        """A triangle into every layer by `gl_Layer`."""

        array = Output(AnyTexel, kind="texture2d_array", format="r32f", layers=4, size=(4, 4), clear=-1.0, doc="Layer.")

        def record(self, steps: Steps) -> None:
            steps.draw(
                "layer.frag", vertex="triangle.vert", geometry="layers.geom", vertices=3, out=self.array, height=0.0
            )

    shaders = {
        "triangle.vert": TRIANGLE,
        "layers.geom": """layout(triangles) in; layout(triangle_strip, max_vertices = 12) out; flat out int v_layer;
            void main() {
                for (int layer = 0; layer < 4; ++layer) {
                    for (int i = 0; i < 3; ++i) {
                        gl_Layer = layer; v_layer = layer; gl_Position = gl_in[i].gl_Position; EmitVertex();
                    }
                    EndPrimitive();
                }
            }""",
        "layer.frag": "flat in int v_layer; out float r; void main() { r = float(v_layer); }",
    }
    image = draw("nodes: {l: {type: layered}}\noutputs: {image: l.array}", Layered, shaders=shaders).arrays["image"]
    assert [image[layer, -1, 0, 0] for layer in range(4)] == [0, 1, 2, 3]
    assert np.all(image[:, 0, -1, 0] == -1)  # the upper right corner lies outside the triangle


def test_multisampled_textures_are_drawn_and_read_per_sample(draw: Draw) -> None:
    class Sampled(Node):
        """A triangle with four samples a pixel."""

        color = Output(AnyTexel, format="r32f", samples=4, clear=0.0, doc="1 inside.")

        def record(self, steps: Steps) -> None:
            steps.draw("one.frag", vertex="triangle.vert", vertices=3, out=self.color, height=0.0)

    class Resolve(Node):
        """The mean of the samples."""

        source = Input(AnyTexel, samples="multi", doc="Samples.")
        color = Output(AnyTexel, format="r32f", doc="Mean.")

    shaders = {
        "triangle.vert": TRIANGLE,
        "one.frag": "out float r; void main() { r = 1.0; }",
        "resolve.frag": """uniform sampler2DMS source; out float color; void main() {
            for (int i = 0; i < 4; ++i) color += 0.25 * texelFetch(source, ivec2(gl_FragCoord.xy), i).r; }""",
    }
    shaders["resolve.frag"] = shaders["resolve.frag"].replace("void main() {", "void main() { color = 0.0;")
    text = "nodes: {s: {type: sampled}, r: {type: resolve, inputs: {source: s.color}}}\noutputs: {image: r.color}"
    image = draw(text, Sampled, Resolve, shaders=shaders, size=(8, 8)).arrays["image"][..., 0]
    assert image[-1, 0] == 1.0
    assert image[0, -1] == 0.0
    assert abs(image.mean() - 0.5) < 0.02  # half the picture, which one sample a pixel misses by 1/16
    assert set(np.unique(image)) - {0.0, 1.0}


def test_stencil_marks_where_the_next_step_draws(draw: Draw) -> None:
    class Marked(Node):
        """A triangle marks the stencil, a full-screen pass draws where the mark is, another where it is not."""

        color = Output(AnyTexel, format="r32f", clear=0.0, doc="1 inside, 2 outside.")
        marks = Internal(Depth, format="depth24_stencil8", clear=0.0)

        def record(self, steps: Steps) -> None:
            mark = StencilFace(func="always", reference=1, depth_pass="replace")
            steps.draw(
                None,
                vertex="triangle.vert",
                vertices=3,
                out=self.marks,
                height=0.0,
                state=State(stencil=Stencil(mark), depth_write=False),
            )
            for value, func in ((1.0, "equal"), (2.0, "notequal")):
                test = State(stencil=Stencil(StencilFace(func=func, reference=1)))  # type: ignore[arg-type]
                steps.fullscreen(
                    "number.frag", out={"color": self.color, "marks": self.marks}, state=test, number=value
                )

    shaders = NUMBER | {"triangle.vert": TRIANGLE}
    image = draw("nodes: {m: {type: marked}}\noutputs: {image: m.color}", Marked, shaders=shaders, size=(8, 8)).arrays[
        "image"
    ]
    assert image[-1, 0, 0] == 1.0
    assert image[0, -1, 0] == 2.0
    assert set(np.unique(image)) == {1.0, 2.0}


def test_stencil_is_cleared_whatever_mask_the_frame_before_has_left(draw: Draw) -> None:
    class Guarded(Node):
        """Counts up in the stencil, then draws where it counts one, with the stencil guarded against writing."""

        color = Output(AnyTexel, format="r32f", clear=0.0, doc="1 where the stencil is 1.")
        marks = Internal(Depth, format="depth32f_stencil8", clear=0.0)

        def record(self, steps: Steps) -> None:
            count = State(stencil=Stencil(StencilFace(func="always", depth_pass="incr")), depth_write=False)
            steps.draw(None, vertex="triangle.vert", vertices=3, out=self.marks, height=0.0, state=count)
            once = State(stencil=Stencil(StencilFace(func="equal", reference=1, write_mask=0)))
            steps.fullscreen("number.frag", out={"color": self.color, "marks": self.marks}, state=once, number=1.0)

    shaders = NUMBER | {"triangle.vert": TRIANGLE}
    text = "nodes: {m: {type: guarded}}\noutputs: {image: m.color}"
    image = draw(text, Guarded, shaders=shaders, size=(8, 8), frames=range(1, 4)).arrays["image"]
    assert image[-1, 0, 0] == 1.0
    assert image[0, -1, 0] == 0.0


def test_depth_of_another_node_is_tested_and_not_written(draw: Draw) -> None:
    class Near(Node):
        """A triangle at window depth 0.5."""

        depth = Output(Depth, format="depth32f", clear=0.0, doc="Depth.")

        def record(self, steps: Steps) -> None:
            steps.draw(None, vertex="triangle.vert", vertices=3, height=0.5)

    class Behind(Node):
        """Draws the whole picture behind and before that triangle."""

        depth = Input(Depth, use="depth_test", doc="Tested.")
        color = Output(AnyTexel, format="r32f", clear=0.0, doc="Where it is seen.")

        def record(self, steps: Steps) -> None:
            steps.draw("number.frag", vertex="whole.vert", vertices=3, height=0.25, number=1.0)

    whole = """uniform float height; void main() {
        vec2 p = vec2((gl_VertexID << 1) & 2, gl_VertexID & 2); gl_Position = vec4(p * 2.0 - 1.0, height, 1.0); }"""
    shaders = NUMBER | {"triangle.vert": TRIANGLE, "whole.vert": whole}
    text = (
        "nodes: {n: {type: near}, b: {type: behind, inputs: {depth: n.depth}}}\noutputs: {image: b.color, d: n.depth}"
    )
    frame = draw(text, Near, Behind, shaders=shaders, size=(8, 8))
    assert frame.arrays["image"][-1, 0, 0] == 0.0
    assert frame.arrays["image"][0, -1, 0] == 1.0
    assert set(np.unique(frame.arrays["d"])) == {0.0, 0.5}


def test_scissor_mask_and_blend(draw: Draw) -> None:
    from rendergraph.api import MULTIPLY

    class Stated(Node):
        """Fixed function of several kinds."""

        color = Output(Radiance, format="rgba32f", clear=(1.0, 2.0, 3.0, 4.0), doc="Colour.")

        def record(self, steps: Steps) -> None:
            steps.fullscreen("ten.frag", state=State(color_mask=(False, True, False, False)))
            steps.fullscreen("ten.frag", state=State(scissor=(0, 0, 4, 4), blend=MULTIPLY))

    shaders = {"ten.frag": "out vec4 color; void main() { color = vec4(10.0); }"}
    image = draw("nodes: {s: {type: stated}}\noutputs: {image: s.color}", Stated, shaders=shaders, size=(8, 8))["image"]
    np.testing.assert_array_equal(image[0, 0], [1, 10, 3, 4])
    np.testing.assert_array_equal(image[-1, 0], [10, 100, 30, 40])
    np.testing.assert_array_equal(image[-1, 7], [1, 10, 3, 4])


def test_signed_normalised_texels_keep_their_sign_and_16_bits(draw: Draw) -> None:
    class Signed(Node):
        """Values between -1 and 1."""

        color = Output(AnyTexel, format="rgba16_snorm", doc="Four numbers.")

    shaders = {"signed.frag": "out vec4 color; void main() { color = vec4(-1.0, -0.3, 0.7, 2.0); }"}
    image = draw("nodes: {s: {type: signed}}\noutputs: {image: s.color}", Signed, shaders=shaders)["image"]
    np.testing.assert_allclose(image[0, 0], [-1, -0.3, 0.7, 1], atol=1 / 32767 + 1e-7)  # GPUs may round either way


class Levels(Node):
    """Draws mip 0, and nothing into mip 1."""

    color = Output(AnyTexel, format="r32f", mips=2, clear=3.0, doc="Two levels.")
    shown = Output(AnyTexel, format="r32f", doc="Mip 1.")

    def record(self, steps: Steps) -> None:
        steps.fullscreen("one.frag", out={"r": self.color})
        steps.fullscreen("none.frag", out={"r": self.color.mip(1)})
        steps.fullscreen("first.frag", source=self.color.mip(1), out={"r": self.shown})


def test_a_mip_that_is_drawn_to_first_is_cleared_like_the_port_says(draw: Draw) -> None:
    shaders = {
        "one.frag": "out float r; void main() { r = 1.0; }",
        "none.frag": "out float r; void main() { discard; }",
        "first.frag": "uniform sampler2D source; out float r; void main() { r = texelFetch(source, ivec2(0), 0).r; }",
    }
    image = draw("nodes: {a: {type: levels}}\noutputs: {image: a.shown}", Levels, shaders=shaders, poison=True).arrays[
        "image"
    ]
    assert np.all(image == 3)


class Drawn(Node):
    """A quarter, drawn."""

    color = Output(AnyTexel, format="srgb8_a8", doc="A quarter.")


class Cleared(Node):
    """A quarter, by a step that clears."""

    color = Output(AnyTexel, format="srgb8_a8", doc="A quarter.")

    def record(self, steps: Steps) -> None:
        steps.clear(self.color, 0.25)


def test_srgb_texels_are_linear_however_they_come_about(draw: Draw) -> None:
    shaders = {"drawn.frag": "out vec4 color; void main() { color = vec4(0.25); }"}
    for node in (Drawn, Cleared):
        text = f"nodes: {{a: {{type: {node.__name__.lower()}}}}}\noutputs: {{image: a.color}}"
        np.testing.assert_allclose(draw(text, node, shaders=shaders)["image"], 0.25, atol=0.004)


def test_srgb_texels_are_read_back_linear(draw: Draw) -> None:
    class Encoded(Node):
        """Linear values into a format that stores them encoded."""

        color = Output(Radiance, format="srgb8_a8", doc="Four numbers.")

    shaders = {"encoded.frag": "out vec4 color; void main() { color = vec4(0.5, 0.05, 0.001, 0.5); }"}
    image = draw("nodes: {s: {type: encoded}}\noutputs: {image: s.color}", Encoded, shaders=shaders)["image"]
    np.testing.assert_allclose(image[0, 0], [0.5, 0.05, 0.001, 0.5], atol=0.005)
    assert abs(image[0, 0, 2] - 0.001) < 2e-4  # linear near black: a step is 1/255/12.92


class Filled(Node):
    """Textures of one value."""

    color = Output(AnyTexel, format="rgba32f", doc="Colour.")
    ids = Output(AnyTexel, format="r32ui", doc="Numbers.")

    def record(self, steps: Steps) -> None:
        steps.clear(self.color, (1, 2, 3))
        steps.clear(self.ids, -1)


def test_a_clear_fills_missing_channels_with_zero_and_stays_in_range(draw: Draw) -> None:
    frame = draw("nodes: {f: {type: filled}}\noutputs: {image: f.color, ids: f.ids}", Filled)
    np.testing.assert_array_equal(frame["image"][0, 0], [1, 2, 3, 0])
    assert frame.arrays["ids"].max() == 0


class Slope(Node):
    """Depth that a shader computes, farther to the right."""

    slope = Output(Depth, format="depth32f", clear=0.25, doc="Depth.")

    tested: bool = define(default=False, doc="Whether the depth that is there counts.")

    def record(self, steps: Steps) -> None:
        state = State(depth_test=True) if self.tested else State()
        steps.fullscreen("slope.frag", out=self.slope, state=state)


def test_a_fullscreen_step_writes_the_depth_it_computes(draw: Draw) -> None:
    shaders = {"slope.frag": "void main() { gl_FragDepth = 1.0 - gl_FragCoord.x / 16.0; }"}
    expected = np.broadcast_to(1 - (np.arange(16, dtype=np.float32) + 0.5) / 16, (8, 16))
    text = "nodes: {s: {type: slope, params: {tested: %s}}}\noutputs: {depth: s.slope}\n"
    np.testing.assert_array_equal(draw(text % "false", Slope, shaders=shaders).arrays["depth"][..., 0], expected)
    kept = np.maximum(expected, 0.25)
    np.testing.assert_array_equal(draw(text % "true", Slope, shaders=shaders).arrays["depth"][..., 0], kept)
