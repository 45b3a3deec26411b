"""Aliasing changes no picture: unaliased, aliased, poisoned and shuffled runs are bit-identical."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from msgspec.structs import replace

import rendergraph as rg
from rendergraph.api import Any as AnyTexel
from rendergraph.api import Input, Internal, Node, Output, Radiance, Steps, define, param
from rendergraph.resources import shipped_pipelines

if TYPE_CHECKING:
    from collections.abc import Mapping


class Source(Node):
    """A pattern."""

    color = Output(Radiance, format="rgba16f", doc="Pattern.")
    seed: float = param(default=1.0, doc="Variation.")


class Mix(Node):
    """Two inputs and a neighbour, through an internal texture of another format of the same texel class."""

    a = Input(AnyTexel, doc="One.")
    b = Input(AnyTexel, doc="Two.")
    mixed = Output(Radiance, format="rgba16f", doc="Both.")
    scratch = Internal(format="rg32f")
    shift: int = define(default=1, min=0, max=5, doc="How far the neighbour is.")

    def record(self, steps: Steps) -> None:
        steps.fullscreen("narrow.frag", out=self.scratch, a=self.a)
        steps.fullscreen("mix.frag", out=self.mixed, scratch=self.scratch, b=self.b)


class Tally(Node):
    """A neighbour through two buffers: one that a compute shader fills, one that a fragment shader does."""

    a = Input(AnyTexel, doc="One.")
    b = Input(AnyTexel, doc="Two.")
    mixed = Output(Radiance, format="rgba16f", doc="Both.")
    filled = Internal(kind="buffer", bytes=16 * 8 * 16)
    marked = Internal(kind="buffer", bytes=16 * 8 * 16)
    shift: int = define(default=1, min=0, max=5, doc="How far the neighbour is.")

    def record(self, steps: Steps) -> None:
        steps.compute("fill.comp", over=(16, 8, 1), out=self.filled, a=self.a)
        steps.fullscreen("mark.frag", out={"mixed": self.mixed, "marked": self.marked}, filled=self.filled, b=self.b)
        steps.compute("fill.comp", over=(16, 8, 1), out={"filled": self.filled}, a=self.mixed)
        steps.fullscreen("unmark.frag", out=self.mixed, marked=self.marked, filled=self.filled, b=self.b)


class Stamp(Node):
    """Drawn twice and looked at between, then an image that a compute shader stores."""

    a = Input(AnyTexel, doc="One.")
    b = Input(AnyTexel, doc="Two.")
    mixed = Output(Radiance, format="rgba16f", doc="Both.")
    twice = Internal(format="rgba16f")
    before = Internal(format="rgba16f")
    shift: int = define(default=1, min=0, max=5, doc="How far the neighbour is.")

    def record(self, steps: Steps) -> None:
        steps.fullscreen("copy.frag", out={"color": self.twice}, source=self.a)
        steps.fullscreen("copy.frag", out={"color": self.before}, source=self.twice)
        steps.fullscreen("copy.frag", out={"color": self.twice}, source=self.b)
        steps.compute("stamp.comp", out=self.mixed, twice=self.twice, before=self.before)


SHADERS = {
    "copy.frag": "uniform sampler2D source; out vec4 color; void main() { color = texelFetch(source, ivec2(gl_FragCoord.xy), 0); }",
    "fill.comp": """layout(local_size_x = 8, local_size_y = 8) in;
        uniform sampler2D a; layout(std430) writeonly buffer filled { vec4 texels[]; };
        void main() {
            ivec2 p = ivec2(gl_GlobalInvocationID.xy);
            texels[p.y * 16 + p.x] = texelFetch(a, p, 0);
        }""",
    "mark.frag": """uniform sampler2D b; out vec4 mixed;
        layout(std430) readonly buffer filled { vec4 texels[]; };
        layout(std430) writeonly buffer marked { vec4 marks[]; };
        void main() {
            ivec2 p = ivec2(gl_FragCoord.xy);
            mixed = texels[(p.y * 16 + p.x + SHIFT) % 128];
            marks[p.y * 16 + p.x] = texelFetch(b, p, 0);
        }""",
    "unmark.frag": """uniform sampler2D b; out vec4 mixed;
        layout(std430) readonly buffer filled { vec4 texels[]; };
        layout(std430) readonly buffer marked { vec4 marks[]; };
        void main() {
            int at = int(gl_FragCoord.y) * 16 + int(gl_FragCoord.x);
            mixed = texels[at] * 0.5 + marks[(at + SHIFT) % 128] * 0.25 + texelFetch(b, ivec2(gl_FragCoord.xy), 0) * 0.125;
        }""",
    "stamp.comp": """layout(local_size_x = 8, local_size_y = 8) in;
        uniform sampler2D twice; uniform sampler2D before; uniform writeonly image2D mixed;
        void main() {
            ivec2 p = ivec2(gl_GlobalInvocationID.xy);
            imageStore(mixed, p, texelFetch(twice, p, 0) * 0.5 + texelFetch(before, (p + SHIFT) % ivec2(16, 8), 0) * 0.25);
        }""",
    "source.frag": "uniform float seed; out vec4 color; void main() { color = fract(gl_FragCoord.xyxy * vec4(0.13, 0.37, 0.71, 0.29) * seed); }",
    "narrow.frag": "uniform sampler2D a; out vec2 scratch; void main() { scratch = texelFetch(a, ivec2(gl_FragCoord.xy), 0).xz; }",
    "mix.frag": """uniform sampler2D scratch; uniform sampler2D b; out vec4 mixed;
        void main() {
            ivec2 p = ivec2(gl_FragCoord.xy), size = textureSize(b, 0);
            mixed = texelFetch(b, (p + SHIFT) % size, 0) * 0.5 + texelFetch(scratch, p, 0).xyxy * 0.25;
        }""",
}


Parents = list[tuple[str, int, int, int]]
"""Type of each node, its inputs and its neighbour's distance."""


def graph(parents: Parents, outputs: list[int]) -> str:
    """A pipeline of two sources and these."""
    lines = ["nodes:", "  n0: {type: source}", "  n1: {type: source, params: {seed: 2.5}}"]
    for number, (kind, a, b, shift) in enumerate(parents, start=2):
        lines.append(
            f"  n{number}: {{type: {kind}, inputs: {{a: n{a % number}.{_port(a % number)}, b: n{b % number}.{_port(b % number)}}}, "
            f"params: {{shift: {shift}}}}}"
        )
    last = len(parents) + 1
    shown = {last, *(n % (last + 1) for n in outputs)}
    lines += ["outputs:", *(f"  o{n}: n{n}.{_port(n)}" for n in sorted(shown))]
    return "\n".join(lines)


def _port(number: int) -> str:
    return "color" if number < 2 else "mixed"


def _same(a: Mapping[str, Any], b: Mapping[str, Any]) -> None:
    assert list(a) == list(b)
    for name in a:
        assert np.array_equal(a[name], b[name], equal_nan=False), name


KINDS = st.sampled_from(["mix", "tally", "stamp"])


@pytest.mark.slow
@settings(max_examples=8, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture], derandomize=True)
@given(
    parents=st.lists(
        st.tuples(KINDS, st.integers(0, 30), st.integers(0, 30), st.integers(0, 5)), min_size=2, max_size=12
    ),
    outputs=st.lists(st.integers(0, 30), max_size=2),
    seed=st.integers(0, 1000),
)
def test_random_graphs(bench: Any, parents: Parents, outputs: list[int], seed: int) -> None:
    pipeline = bench.pipeline(graph(parents, outputs), Source, Mix, Tally, Stamp, shaders=SHADERS)
    plain = bench.session.render(pipeline, alias=False)
    _same(plain, bench.session.render(pipeline))
    _same(plain, bench.session.render(pipeline, poison=True))
    _same(plain, bench.session.render(pipeline, poison=True, shuffle=seed))


def small(name: str) -> rg.Pipeline:
    """A shipped pipeline with small maps: those of full size take most of a minute."""
    pipeline = rg.load(name, size=(48, 32))
    for node in [node.id for node in pipeline.link().graph.nodes]:
        if node.rpartition("/")[2] == "sun":
            pipeline = pipeline.set(f"{node}.resolution", 256)
        elif node in ("cube", "environment"):
            pipeline = pipeline.set(f"{node}.{'resolution' if node == 'cube' else 'size'}", 32)
    return pipeline


@pytest.mark.nightly(keep=4)
@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(shipped_pipelines()))
def test_shipped_pipelines_draw_the_same_in_another_order_with_poisoned_memory(gl: rg.Session, name: str) -> None:
    plain = gl.render(small(name), alias=False, warm_up=False)
    assert any(array.any() for array in plain.values())
    _same(plain, gl.render(small(name), poison=True, shuffle=1, warm_up=False))


@pytest.mark.nightly
@pytest.mark.parametrize("name", sorted(shipped_pipelines()))
def test_shipped_pipelines_in_every_mode(gl: rg.Session, name: str) -> None:
    plain = gl.render(small(name), alias=False, frames=range(1, 3))
    for seed in (None, 1, 2):
        _same(plain, gl.render(small(name), poison=True, shuffle=seed, frames=range(1, 3)))


def test_a_lifetime_that_ends_too_early_is_caught(bench: Any) -> None:
    """The check of the check: release a texture one step before its last reader, and the poison must show."""
    from rendergraph.compile import TexturePool, compile_plan
    from rendergraph.execute import Runner
    from rendergraph.scene.cameras import view_matrices

    pipeline = bench.pipeline(
        graph([("mix", 0, 1, 1), ("mix", 2, 0, 2), ("mix", 3, 1, 3)], []), Source, Mix, shaders=SHADERS
    )
    session = bench.session
    right = session.render(pipeline, poison=True)["o4"]
    assert np.isfinite(right).all()
    plan, views = pipeline.plan(), pipeline.expand().expansion.views
    types = {node.id: node.type for node in pipeline.link().graph.nodes}
    camera = view_matrices(next(iter(pipeline.link().scene.cameras.values())), (16, 8))
    caught = 0
    cases = [(at, name) for at, names in plan.released.items() for name in names if at > 0]
    for at, name in cases:
        early = {p: tuple(n for n in names if n != name) for p, names in plan.released.items()}
        early[at - 1] = (*early.get(at - 1, ()), name)
        wrong = replace(plan, released=early)
        with session.device.current():
            scene = session.cache.upload(pipeline.link())
            broken = compile_plan(
                wrong,
                types,
                views,
                scene,
                session.cache.programs,
                TexturePool(session.device),
                poison=True,
            )
            runner = Runner(broken, pipeline.link().graph)
            runner.run(1, 0.0, 0.0, pipeline.link().scene, camera)
            caught += not np.array_equal(runner.read("n4.mixed"), right)
            broken.release()
    assert cases
    assert caught == len(cases)
