"""Full-screen passes: bindings by name, uniforms, defines, internals, samplers, several targets."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import pytest

from rendergraph.api import Any as AnyTexel
from rendergraph.api import InOut, Input, Internal, Node, Output, Radiance, Steps, define, param
from rendergraph.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Callable

    import rendergraph as rg

    Draw = Callable[..., rg.Frame]


class Ramp(Node):
    """Red grows to the right, green upwards."""

    color = Output(Radiance, format="rgba32f", doc="The ramp.")
    gain: float = param(default=1.0, doc="Factor.")


class Add(Node):
    """Adds a constant, as a number or a colour, to what is there."""

    source = Input(AnyTexel, doc="What to add to.")
    result = Output(like="source", doc="The sum.")
    amount: float | tuple[float, float, float] = param(default=0.25, glsl="vec3", doc="What to add.")
    sign: Literal["plus", "minus"] = define(default="plus", doc="Direction.")


class Twice(Node):
    """Two steps over an internal texture."""

    source = Input(AnyTexel, doc="What to shift.")
    result = Output(like="source", doc="Shifted by both axes.")
    across = Internal(like="source")

    def record(self, steps: Steps) -> None:
        steps.fullscreen("shift.frag", source=self.source, out=self.across, axis=(1.0, 0.0))
        steps.fullscreen("shift.frag", source=self.across, out=self.result, axis=(0.0, 2.0))


SHADERS = {
    "ramp.frag": "in vec2 v_uv; uniform float gain; out vec4 color; void main() { color = vec4(v_uv * gain, 0.0, 1.0); }",
    "add.frag": """uniform sampler2D source; uniform vec3 amount; out vec4 result;
        void main() {
            vec4 was = texelFetch(source, ivec2(gl_FragCoord.xy), 0);
        #if SIGN == SIGN_PLUS
            result = was + vec4(amount, 0.0);
        #else
            result = was - vec4(amount, 0.0);
        #endif
        }""",
    "shift.frag": """uniform sampler2D source; uniform vec2 axis; out vec4 any_name;
        void main() { any_name = texelFetch(source, ivec2(gl_FragCoord.xy), 0) + vec4(0.0, 0.0, axis); }""",
}


def ramp(size: tuple[int, int]) -> np.ndarray[Any, Any]:
    width, height = size
    x = (np.arange(width) + 0.5) / width
    y = 1 - (np.arange(height) + 0.5) / height  # the top row first
    return np.stack(np.broadcast_arrays(x[None, :], y[:, None], 0.0, 1.0), axis=-1)


def test_a_pass_without_code_draws_its_fragment_shader(draw: Draw) -> None:
    frame = draw("nodes: {a: {type: ramp}}\noutputs: {image: a.color}", Ramp, shaders=SHADERS)
    np.testing.assert_allclose(frame["image"], ramp((16, 8)), atol=1e-6)


def test_a_number_fills_a_vector_and_a_choice_is_program_text(draw: Draw) -> None:
    text = """nodes:
  a: {type: ramp}
  b: {type: add, inputs: {source: a.color}, params: {amount: 0.5}}
  c: {type: add, inputs: {source: b.result}, params: {amount: [0.1, 0.2, 0.3], sign: minus}}
outputs: {image: c.result}"""
    frame = draw(text, Ramp, Add, shaders=SHADERS)
    np.testing.assert_allclose(frame["image"], ramp((16, 8)) + [0.4, 0.3, 0.2, 0.0], atol=1e-6)


def test_programs_shared_by_steps_keep_their_own_uniforms(draw: Draw) -> None:
    text = """nodes:
  a: {type: ramp}
  b: {type: add, inputs: {source: a.color}, params: {amount: 0.5}}
  c: {type: add, inputs: {source: b.result}, params: {amount: 1.0}}
  d: {type: twice, inputs: {source: c.result}}
outputs: {image: d.result}"""
    frame = draw(text, Ramp, Add, Twice, shaders=SHADERS, frames=range(1, 4))
    np.testing.assert_allclose(frame["image"], ramp((16, 8)) + [1.5, 1.5, 1.5 + 1, 2], atol=1e-6)


def test_a_changed_uniform_rebuilds_nothing_and_a_changed_define_one_program(bench: Any) -> None:
    text = "nodes: {a: {type: ramp}, b: {type: add, inputs: {source: a.color}}}\noutputs: {image: b.result}"
    shaders = SHADERS | {"add.frag": SHADERS["add.frag"].replace("was", "own")}  # a text no other test has compiled
    pipeline = bench.pipeline(text, Ramp, Add, shaders=shaders)
    session = bench.session
    session.render(pipeline)
    programs, executable = session.cache.programs.compiled, session.cache.active
    frame = session.render(pipeline.set("b.amount", 2.0).set("a.gain", 0.5))
    np.testing.assert_allclose(frame["image"][..., 0], ramp((16, 8))[..., 0] * 0.5 + 2.0, atol=1e-6)
    assert session.cache.programs.compiled == programs
    assert session.cache.active is executable
    session.render(pipeline.set("b.sign", "minus"))
    assert session.cache.programs.compiled == programs + 1
    session.render(pipeline.with_size((32, 4)))
    assert session.cache.programs.compiled == programs + 1


def test_two_readers_of_one_texture_have_their_own_samplers(draw: Draw) -> None:
    class Two(Node):
        """Two texels."""

        color = Output(Radiance, format="r32f", size=(2, 1), doc="0 and 1.")

    shaders = {
        "two.frag": "out float color; void main() { color = floor(gl_FragCoord.x); }",
        "magnify.frag": """in vec2 v_uv; uniform sampler2D sharp; uniform sampler2D soft; out vec2 color;
            void main() { color = vec2(texture(sharp, v_uv).r, texture(soft, v_uv).r); }""",
    }
    text = "nodes: {t: {type: two}, m: {type: magnify, inputs: {sharp: t.color, soft: t.color}}}\noutputs: {image: m.color}"

    class Magnify(Node):
        """Reads two texels far enlarged."""

        sharp = Input(AnyTexel, size="any", doc="Nearest.")
        soft = Input(AnyTexel, size="any", filter="linear", doc="Linear.")
        color = Output(Radiance, format="rg32f", size=(8, 2), doc="Both.")

    image = draw(text, Two, Magnify, shaders=shaders, size=(8, 2))["image"]
    np.testing.assert_allclose(image[0, :, 0], [0, 0, 0, 0, 1, 1, 1, 1])
    np.testing.assert_allclose(image[0, :, 1], np.clip((np.arange(8) + 0.5) / 4 - 0.5, 0, 1), atol=0.01)


def test_several_targets_go_to_outputs_by_name(draw: Draw) -> None:
    class Split(Node):
        """Two targets of different formats."""

        second = Output(Radiance, format="r32f", doc="2.")
        first = Output(Radiance, format="rgba16f", doc="1.")

    shaders = {
        "split.frag": "out vec4 first; out float second; void main() { first = vec4(1.0); second = 2.0; }",
    }
    both = draw("nodes: {s: {type: split}}\noutputs: {image: s.first, radiance: s.second}", Split, shaders=shaders)
    assert np.all(both["image"] == 1.0)
    assert both.arrays["radiance"].shape == (8, 16, 1)
    assert np.all(both.arrays["radiance"] == 2.0)
    one = draw("nodes: {s: {type: split}}\noutputs: {image: s.second}", Split, shaders=shaders)
    assert np.all(one.arrays["image"] == 2.0)
    assert one.memory["allocated_bytes"] == 16 * 8 * 4  # the target that nobody reads is not made


class Accumulate(Node):
    """Adds a constant into a texture that somebody else made, by blending."""

    color = InOut(Radiance, format="rgba32f", clear=0.0, optional=True, doc="The sum.")
    amount: float = param(default=1.0, doc="What to add.")

    def record(self, steps: Steps) -> None:
        from rendergraph.api import ADD, State

        steps.fullscreen("constant.frag", state=State(blend=ADD))


CONSTANT = {"constant.frag": "uniform float amount; out vec4 color; void main() { color = vec4(amount); }"}


def test_in_out_continues_a_texture_and_old_readers_run_before(draw: Draw) -> None:
    text = """nodes:
  b: {type: accumulate, inputs: {color: a.color}, params: {amount: 10}}
  old: {type: add, inputs: {source: a.color}, params: {amount: 0.5}}
  a: {type: ramp}
outputs: {image: b.color, radiance: old.result}"""
    frame = draw(text, Ramp, Add, Accumulate, shaders=SHADERS | CONSTANT)
    np.testing.assert_allclose(frame["image"], ramp((16, 8)) + 10, atol=1e-5)
    np.testing.assert_allclose(frame["radiance"], ramp((16, 8)) + [0.5, 0.5, 0.5, 0], atol=1e-6)
    nodes = [entry["node"] for entry in frame.passes]
    assert nodes.index("old") < nodes.index("b")


def test_an_unconnected_in_out_is_made_by_the_node(draw: Draw) -> None:
    text = """nodes:
  a: {type: accumulate, params: {amount: 3}}
  b: {type: accumulate, inputs: {color: a.color}, params: {amount: 4}}
outputs: {image: b.color}"""
    assert np.all(draw(text, Accumulate, shaders=CONSTANT)["image"] == 7.0)


def test_a_sampler_that_nothing_is_bound_to_is_named(draw: Draw) -> None:
    class Wrong(Node):
        """Reads what it did not declare."""

        color = Output(Radiance, doc="Nothing good.")

    shader = {
        "wrong.frag": "uniform sampler2D depht; out vec4 color; void main() { color = texelFetch(depht, ivec2(0), 0); }"
    }
    with pytest.raises(InputError, match=r"wrong.frag:1:19: RG430 node 'w' .*'depht', but the step reads no texture"):
        draw("nodes: {w: {type: wrong}}\noutputs: {image: w.color}", Wrong, shaders=shader)


def test_a_shader_error_names_the_authors_line(draw: Draw) -> None:
    shader = {"ramp.frag": "in vec2 v_uv;\nout vec4 color;\nvoid main() {\n  color = vec4(nothing, 1.0);\n}"}
    with pytest.raises(InputError, match=r"ramp\.frag:4:.*RG410 .*nothing"):
        draw("nodes: {a: {type: ramp}}\noutputs: {image: a.color}", Ramp, shaders=shader)


def test_a_tap_in_the_middle_of_a_chain_shows_its_own_version(draw: Draw) -> None:
    text = """nodes:
  a: {type: accumulate, params: {amount: 3}}
  b: {type: accumulate, inputs: {color: a.color}, params: {amount: 4}}
  c: {type: accumulate, inputs: {color: b.color}, params: {amount: 5}}
outputs: {image: c.color}"""
    frame = draw(text, Accumulate, shaders=CONSTANT, taps=["a.color", "b.color"], poison=True)
    assert [float(frame[name].mean()) for name in ("a.color", "b.color", "image")] == [3, 7, 12]


def test_what_is_said_beside_like_wins(bench: Any) -> None:
    class Half(Node):
        """The same at half size in a format of its own, though that is the default one."""

        source = Input(AnyTexel, size="any", doc="What to halve.")
        same = Output(like="source", doc="As the source.")
        own = Output(like="source", format="rgba16f", size=1.0, doc="As the picture.")

        def record(self, steps: Steps) -> None:
            steps.fullscreen("own.frag")

    class Small(Node):
        """A small texture."""

        color = Output(Radiance, format="rgba32f", size=(4, 2), doc="Small.")

    text = "nodes: {a: {type: small}, b: {type: half, inputs: {source: a.color}}}\noutputs: {image: b.same, o: b.own}"
    graph = bench.pipeline(text, Small, Half).link().graph
    described = {end.port: info.desc for end, info in graph.textures.items() if end.node == "b"}
    assert (described["same"].format, described["same"].size) == ("rgba32f", (4, 2))
    assert (described["own"].format, described["own"].size) == ("rgba16f", (16, 8))


def test_a_uniform_that_nothing_sets_is_named(draw: Draw) -> None:
    class Wrong(Node):
        """Looks at a misspelt parameter."""

        color = Output(Radiance, doc="Nothing good.")
        gain: float = param(default=1.0, doc="Factor.")

    shader = {"wrong.frag": "uniform float gian; out vec4 color; void main() { color = vec4(gian); }"}
    with pytest.raises(
        InputError,
        match=r"RG434 node 'w' .*wrong.frag uses uniform 'gian', which nothing sets; did you mean 'gain'",
    ):
        draw("nodes: {w: {type: wrong}}\noutputs: {image: w.color}", Wrong, shaders=shader)
