"""Values from the CPU: computed once, and again when something that they are made of has changed."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

import rendergraph as rg
from rendergraph.api import Any as AnyTexel
from rendergraph.api import FrameScene, Input, Internal, Node, Output, Radiance, Steps, param
from rendergraph.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Callable

    Draw = Callable[..., rg.Frame]

CALLS: list[str] = []


class Given(Node):
    """A constant table, positions of lights and of objects, and a node's parameter."""

    color = Output(Radiance, format="rgba32f", doc="All of them.")
    table = Internal(format="rgba8", size=(4, 2), kept=True)
    doubled = Internal(format="rgba32f", size=(4, 2), kept=True)
    lights = Internal(kind="buffer", bytes=32, kept=True)
    places = Internal(format="r32f", size=(2, 1))

    gain: float = param(default=1.0, min=0, max=9, doc="A factor of the objects' places.")

    def record(self, steps: Steps) -> None:
        values = np.arange(32).reshape(2, 4, 4) / 255
        steps.upload(self.table, values)
        steps.fullscreen("double.frag", out=self.doubled, table=self.table)
        steps.upload(self.lights, self.light_heights, changes_with=["lights"], label="lights")
        steps.upload(self.places, self.object_places, changes_with=["transforms"])
        steps.fullscreen("all.frag", out=self.color, doubled=self.doubled, lights=self.lights, places=self.places)

    def light_heights(self, scene: FrameScene) -> Any:
        CALLS.append("lights")
        return np.array([light.position[1] for light in scene.lights], np.float32)

    def object_places(self, scene: FrameScene) -> Any:
        CALLS.append("places")
        return self.gain * np.array([[entry.transform[0][3] for entry in scene.objects]])


SHADERS = {
    "double.frag": """uniform sampler2D table; out vec4 color;
        void main() { color = 2.0 * texelFetch(table, ivec2(gl_FragCoord.xy), 0); }""",
    "all.frag": """uniform sampler2D doubled; uniform sampler2D places; out vec4 color;
        layout(std430) readonly buffer lights { float height[]; };
        void main() {
            color = vec4(texelFetch(doubled, ivec2(1, 1), 0).g, height[0], texelFetch(places, ivec2(0), 0).r,
                texelFetch(places, ivec2(1, 0), 0).r);
        }""",
}
SCENE = """
objects:
  a: {shape: box, size: [1, 1, 1], at: [1, 0, 0]}
  b: {shape: box, size: [1, 1, 1], at: [2, 0, 0]}
lights: {lamp: {type: point, at: [0, 3, 0]}}
cameras: {main: {eye: [0, 0, 9], target: [0, 0, 0]}}
"""
TEXT = "nodes: {a: {type: given}}\noutputs: {image: a.color}"
TABLE = 2 * (16 + 4 + 1) / 255


def test_values_are_computed_once(bench: Any) -> None:
    CALLS.clear()
    for mode in ({}, {"poison": True, "shuffle": 2}, {"alias": False}):
        image = bench.draw(TEXT, Given, shaders=SHADERS, scene=SCENE, frames=range(1, 4), **mode)["image"]
        np.testing.assert_allclose(image[0, 0], [TABLE, 3, 1, 2], rtol=1e-6)
    assert len(CALLS) == 6  # three executables


def test_what_moves_computes_what_is_made_of_it(bench: Any) -> None:
    moving = (
        SCENE
        + "keyframes: {lights.lamp.at: {0: [0, 3, 0], 1: [0, 4, 0]}, objects.b.at: {1: [2, 0, 0], 2: [3, 0, 0]}}\n"
    )
    CALLS.clear()
    frames = bench.frames(TEXT, Given, shaders=SHADERS, scene=moving, frames=range(1, 5), fps=1.0)
    heights, places = zip(*[(frame["image"][0, 0, 1], frame["image"][0, 0, 3]) for frame in frames], strict=True)
    assert list(heights) == [3, 4, 4, 4]
    assert list(places) == [2, 2, 3, 3]
    assert sorted(CALLS) == ["lights"] * 2 + ["places"] * 2


def test_a_parameter_computes_again_without_compiling(bench: Any, gl: rg.Session) -> None:
    pipeline = bench.pipeline(TEXT, Given, shaders=SHADERS, scene=SCENE)
    gl.render(pipeline)
    compiled = gl.cache.programs.compiled
    image = gl.render(pipeline.set("a.gain", 2.0))["image"]
    np.testing.assert_allclose(image[0, 0], [TABLE, 3, 2, 4], rtol=1e-6)
    assert gl.cache.programs.compiled == compiled


class Wrong(Node):
    """Values that do not fit."""

    color = Output(AnyTexel, format="r32f", doc="Anything.")
    table = Internal(format="r32f", size=(4, 4), kept=True)

    def record(self, steps: Steps) -> None:
        steps.upload(self.table, np.zeros((4, 3)))


class Failing(Wrong):
    """Values that cannot be computed."""

    def record(self, steps: Steps) -> None:
        steps.upload(self.color, self.made)

    def made(self, scene: FrameScene) -> Any:
        return np.zeros(len(scene.objects)) / scene.nothing  # type: ignore[attr-defined]


@pytest.mark.parametrize(
    ("cls", "said"),
    [
        (Wrong, r"RG432 .*'table' takes 1 × 4 × 4 × 1 numbers \(layers, height, width, channels\), got .* \(4, 3\)"),
        (
            Failing,
            r"RG433 node 'a' \(failing\) failed in the function of an upload: \S*test_uploads.py:\d+: Attribute",
        ),
    ],
)
def test_what_does_not_fit_names_the_authors_line(bench: Any, cls: type[Node], said: str) -> None:
    with pytest.raises(InputError, match=said):
        bench.draw(f"nodes: {{a: {{type: {cls.__name__.lower()}}}}}\noutputs: {{image: a.color}}", cls, scene=SCENE)


class Volume(Node):
    """A layer and a mip of textures with several."""

    color = Output(
        AnyTexel, kind="texture2d_array", format="r8ui", size=(4, 2), layers=2, mips=2, clear=0, doc="Numbers."
    )

    def record(self, steps: Steps) -> None:
        steps.upload(self.color.layer(1), np.arange(8).reshape(2, 4))
        steps.upload(self.color.mip(1), np.array([[[5, 6]], [[7, 8]]]))


class Reads(Node):
    """Reads them."""

    source = Input(AnyTexel, kind="texture2d_array", size="any", doc="Numbers.")
    color = Output(AnyTexel, format="r32f", doc="One.")


def test_a_layer_and_a_mip_are_given_values(draw: Draw) -> None:
    shaders = {
        "reads.frag": "uniform usampler2DArray source; out float color;"
        "void main() { color = float(texelFetch(source, ivec3(2, 1, 1), 0).r + texelFetch(source, ivec3(0, 0, 1), 1).r); }"
    }
    text = "nodes: {a: {type: volume}, b: {type: reads, inputs: {source: a.color}}}\noutputs: {image: b.color}"
    assert draw(text, Volume, Reads, shaders=shaders).arrays["image"].max() == 6 + 7


class Cleared(Node):
    """A buffer that is cleared where nothing else gives it values."""

    color = Output(Radiance, format="rgba32f", doc="Its values.")
    table = Internal(kind="buffer", bytes=16, clear=0)

    def record(self, steps: Steps) -> None:
        steps.upload(self.table, np.arange(4, dtype=np.float32))
        steps.fullscreen("table.frag", out=self.color, table=self.table)


TABLE_SHADER = "layout(std430) readonly buffer table { vec4 value; }; out vec4 color; void main() { color = value; }"


def test_clearing_a_buffer_leaves_what_is_uploaded(draw: Draw) -> None:
    text = "nodes: {a: {type: cleared}}\noutputs: {image: a.color}"
    image = draw(text, Cleared, shaders={"table.frag": TABLE_SHADER})["image"]
    np.testing.assert_array_equal(image[0, 0], [0, 1, 2, 3])


EDITED = """from rendergraph.api import Internal, Node, Output, Radiance, Steps
class Edited(Node):
    '''Values of a method.'''
    color = Output(Radiance, format="rgba32f", doc="Its values.")
    table = Internal(kind="buffer", bytes=16, kept=True)
    def record(self, steps: Steps) -> None:
        steps.upload(self.table, self.values)
        steps.fullscreen("edited.frag", out=self.color, table=self.table)
    def values(self, scene):
        import numpy as np
        return np.full(4, {}, np.float32)
"""


def test_an_edited_method_computes_again(author: Any, gl: rg.Session) -> None:
    author.write(edited__py=EDITED.format(1), edited__frag=TABLE_SHADER)
    first = author.pipeline("nodes: {a: {type: edited}}\noutputs: {image: a.color}", scene=SCENE)
    assert gl.render(first)["image"][0, 0, 0] == 1
    author.write(edited__py=EDITED.format(20))
    again = rg.load(first.selection.source, plugins=first.selection.plugins)
    assert gl.render(again)["image"][0, 0, 0] == 20


class Doubtful(Node):
    """Two functions of the lights, of which the second may fail."""

    color = Output(Radiance, format="rgba32f", doc="The height.")
    table = Internal(kind="buffer", bytes=16)
    other = Internal(kind="buffer", bytes=16)

    def record(self, steps: Steps) -> None:
        steps.upload(
            self.table, lambda scene: np.full(4, scene.lights[0].position[1], np.float32), changes_with=["lights"]
        )
        steps.upload(self.other, self.fails_at_4, changes_with=["lights"])
        steps.fullscreen("both.frag", out=self.color, table=self.table, other=self.other)

    def fails_at_4(self, scene: FrameScene) -> Any:
        height = scene.lights[0].position[1]
        if height == 4 and "fail" in CALLS:
            raise ArithmeticError
        return np.full(4, height, np.float32)


def test_a_function_that_fails_leaves_nothing_out_of_date(bench: Any, gl: rg.Session) -> None:
    shader = "layout(std430) readonly buffer other { vec4 more; };" + TABLE_SHADER.replace("= value", "= value + more")
    moving = SCENE + "keyframes: {lights.lamp.at: {0: [0, 3, 0], 1: [0, 4, 0], 2: [0, 4, 0]}}\n"
    text = "nodes: {a: {type: doubtful}}\noutputs: {image: a.color}"
    pipeline = bench.pipeline(text, Doubtful, shaders={"both.frag": shader}, scene=moving)
    CALLS[:] = ["fail"]
    with gl.current():
        drawing = gl.compile(pipeline, fps=1.0)
        drawing.begin()
        drawing.draw(1)
        with pytest.raises(InputError, match=r"RG433 .*failed in the function of an upload"):
            drawing.draw(2)
        CALLS.clear()
        drawing.draw(2)
        assert drawing.read()["image"][0, 0, 0] == 8


class Table(Node):
    """A kept table."""

    color = Output(Radiance, format="rgba32f", doc="Its values.")
    table = Internal(kind="buffer", bytes=16, kept=True)

    def record(self, steps: Steps) -> None:
        steps.upload(self.table, self.values)
        steps.fullscreen("table.frag", out=self.color, table=self.table)

    def values(self, scene: FrameScene) -> Any:
        CALLS.append("table")
        return np.arange(4, dtype=np.float32)


def test_a_kept_table_is_taken_from_another_pipeline(bench: Any, gl: rg.Session) -> None:
    CALLS.clear()
    text = "nodes: {a: {type: table}}\noutputs: {image: a.color}"
    pipeline = bench.pipeline(text, Table, shaders={"table.frag": TABLE_SHADER}, scene=SCENE)
    for size in ((16, 8), (24, 8), (16, 8)):
        np.testing.assert_array_equal(gl.render(pipeline, size=size)["image"][0, 0], [0, 1, 2, 3])
    assert CALLS == ["table"]
