"""What a render asks for of a texture: a layer, a mip, the stencil, resolved samples; and what it may not ask for."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any as Anything

import numpy as np
import numpy.typing as npt
import pytest

import rendergraph as rg
from rendergraph.api import Any, Depth, Internal, Node, Output, State, Stencil, StencilFace, Steps
from rendergraph.errors import InputError
from rendergraph.session.values import figures

NUMBER = "uniform float number; out float r; void main() { r = number; }"
TRIANGLE = """vec2 corners[3] = vec2[](vec2(-1, -1), vec2(1, -1), vec2(-1, 1));
void main() { gl_Position = vec4(corners[gl_VertexID % 3], 0.5, 1.0); }"""
SHADERS = {"number.frag": NUMBER, "triangle.vert": TRIANGLE}


class Cube(Node):
    """Ten times the face plus the mip."""

    radiance = Output(Any, kind="texture_cube", format="r32f", size=(8, 8), mips=0, doc="Face and mip.")

    def record(self, steps: Steps) -> None:
        for face in range(6):
            for mip in range(4):
                steps.fullscreen("number.frag", out=self.radiance.layer(face).at_mip(mip), number=10.0 * face + mip)


class Marks(Node):
    """A triangle, the lower left half, in depth and stencil, with four samples a texel or one; its colour is 1."""

    color = Output(Any, format="r32f", clear=0.0, samples=4, doc="Inside 1.")
    count = Output(Any, format="r32ui", clear=0, samples=4, doc="Inside 7.")
    depth = Output(Depth, format="depth32f_stencil8", clear=0.0, samples=4, doc="Inside 0.5, stencil 165.")
    alone = Internal(Depth, format="depth24_stencil8", clear=0.0)

    def record(self, steps: Steps) -> None:
        state = State(stencil=Stencil(StencilFace(func="always", reference=165, depth_pass="replace")))
        steps.draw(
            "marks.frag",
            vertex="triangle.vert",
            vertices=3,
            out={"color": self.color, "count": self.count, "depth": self.depth},
            state=state,
        )
        steps.draw(None, vertex="triangle.vert", vertices=3, out=self.alone, state=state)


MARKS = "out float color; out uint count; void main() { color = 1.0; count = 7u; }"
TEXT = "nodes: {cube: {type: cube}, marks: {type: marks}}\noutputs: {image: cube.radiance}"


@pytest.fixture
def tap(draw: Callable[..., rg.Frame]) -> Callable[..., rg.Frame]:
    """Taps of a cube with mips and of a triangle with depth, stencil and samples, at 8×8."""

    def tapped(*names: str) -> rg.Frame:
        shaders = SHADERS | {"marks.frag": MARKS}
        return draw(TEXT, Cube, Marks, shaders=shaders, size=(8, 8), outputs=(), taps=names)

    return tapped


def _one(array: npt.NDArray[np.float32]) -> float:
    (value,) = np.unique(array)
    return float(value)


def test_a_layer_a_mip_and_both_are_read_alone(tap: Callable[..., rg.Frame]) -> None:
    parts = ("cube.radiance[2,mip=3]", "cube.radiance[4]", "cube.radiance[mip=1]", "cube.radiance")
    frame = tap(*parts)
    assert [frame.arrays[name].shape for name in parts] == [(1, 1, 1), (8, 8, 1), (6, 4, 4, 1), (6, 8, 8, 1)]
    assert [frame[name].shape for name in parts] == [(1, 1), (8, 8), (6, 4, 4), (6, 8, 8)]
    assert (_one(frame.arrays[parts[0]]), _one(frame.arrays[parts[1]])) == (23.0, 40.0)
    np.testing.assert_array_equal(frame.arrays[parts[2]][:, 0, 0, 0], [1, 11, 21, 31, 41, 51])
    assert [frame.info(name).kind for name in parts] == ["texture2d", "texture2d", "texture_cube", "texture_cube"]


def test_the_stencil_is_read_beside_the_depth(tap: Callable[..., rg.Frame]) -> None:
    frame = tap("marks.alone:stencil", "marks.alone")
    stencil, depth = frame.arrays["marks.alone:stencil"], frame.arrays["marks.alone"]
    assert stencil.dtype == np.uint32
    assert (stencil[-1, 0, 0], stencil[0, -1, 0]) == (165, 0)
    np.testing.assert_array_equal(stencil == 165, depth > 0)
    np.testing.assert_allclose(np.unique(depth), [0.0, 0.5], atol=1e-6)
    assert (frame.info("marks.alone:stencil").semantic, frame.info("marks.alone").semantic) == ("stencil", "depth")


def test_samples_are_resolved(tap: Callable[..., rg.Frame]) -> None:
    frame = tap("marks.color", "marks.count", "marks.depth", "marks.depth:stencil")
    color = frame.arrays["marks.color"]
    assert (color[-1, 0, 0], color[0, -1, 0]) == (1.0, 0.0)
    assert set(np.unique(color)) <= {0.0, 0.25, 0.5, 0.75, 1.0}
    assert set(np.unique(color)) - {0.0, 1.0}, "colours are the mean of the samples"
    inside = frame.arrays["marks.count"] == 7
    assert set(np.unique(frame.arrays["marks.count"])) == {0, 7}, "whole numbers are those of one sample"
    np.testing.assert_array_equal(np.unique(frame.arrays["marks.depth"]), [0.0, 0.5])
    np.testing.assert_array_equal(frame.arrays["marks.depth"] == 0.5, inside)
    np.testing.assert_array_equal(frame.arrays["marks.depth:stencil"] == 165, inside)


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("cube.radiance[6]", "'cube.radiance' has no layer 6; it has 0 to 5"),
        ("cube.radiance[mip=4]", "'cube.radiance' has no mip 4; it has 0 to 3"),
        ("cube.radiance[2,mip=9]", "'cube.radiance' has no mip 9; it has 0 to 3"),
        ("marks.color[1]", "'marks.color' has no layer 1; it has only 0"),
        ("cube.radiance:stencil", "'cube.radiance' has no stencil: its format is r32f"),
        ("cube.radiance[mip:1]", "the part of a texture is [LAYER], [mip=N], [LAYER,mip=N] or :stencil"),
        ("cube.radiance[]", "the part of a texture is"),
        ("cube.radianc[1]", "node 'cube' has no output 'radianc'; did you mean 'radiance'?"),
    ],
)
def test_a_part_that_is_not_there_is_said_with_what_there_is(
    tap: Callable[..., rg.Frame], name: str, text: str
) -> None:
    with pytest.raises(InputError) as error:
        tap(name)
    assert f"RG206 --tap {name}: {text}" in str(error.value)


def test_resolving_between_two_frames_changes_neither(draw: Callable[..., rg.Frame]) -> None:
    shaders = SHADERS | {"marks.frag": MARKS}
    names = ("marks.color", "marks.depth")
    first = draw(TEXT, Cube, Marks, shaders=shaders, size=(8, 8), taps=names)
    later = draw(TEXT, Cube, Marks, shaders=shaders, size=(8, 8), taps=names, frames=range(1, 4))
    for name in ("image", *names):
        np.testing.assert_array_equal(first.arrays[name], later.arrays[name])


class Figures(Node):
    """One texel of bytes, one of two floats, and two texels."""

    share = Output(Any, format="r8", size=(1, 1), doc="A share.")
    pair = Output(Any, format="rg32f", size=(1, 1), doc="Two numbers.")
    texels = Output(Any, format="r32f", size=(2, 1), doc="Two texels.")

    def record(self, steps: Steps) -> None:
        for port, value in ((self.share, 0.2), (self.pair, (0.5, 3.0)), (self.texels, 1.0)):
            if steps.used(port):
                steps.clear(port, value)


def test_outputs_of_one_texel_are_figures(bench: Anything) -> None:
    text = "nodes: {f: {type: figures}}\noutputs: {share: f.share, pair: f.pair, image: f.texels}"
    pipeline = bench.pipeline(text, Figures)
    assert figures(pipeline.link().graph) == ("share", "pair")
    frame = bench.session.render(pipeline)
    assert frame.figures == {"share": pytest.approx(0.2), "pair": [0.5, 3.0]}
    assert frame.as_json()["figures"] == frame.figures
