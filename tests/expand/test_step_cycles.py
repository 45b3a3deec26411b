"""Nodes that form a cycle although their steps do not: one prepares something before others and composes after them."""

from __future__ import annotations

from itertools import groupby, permutations
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
import yaml
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from rendergraph.api import (
    ADD,
    Function,
    History,
    InOut,
    Input,
    Internal,
    Node,
    Output,
    Radiance,
    ShadowLookup,
    State,
    Steps,
    param,
    structural,
)
from rendergraph.diagrams import markup, picture
from rendergraph.errors import InputError

if TYPE_CHECKING:
    import rendergraph as rg


class Ground(Node):
    """A ramp."""

    color = Output(Radiance, format="rgba32f", doc="A ramp.")
    shader = "ground.frag"


class Bracket(Node):
    """Halves something before others use it, and adds what they make of it afterwards."""

    source = Input(Radiance, doc="Before.")
    lit = Input(Radiance, optional=True, doc="What is made of `prepared`.")
    table = Internal(Radiance, format="rgba32f", size=(4, 1), kept=True)
    half = Internal(like="source")
    trail = History(like="source")
    prepared = Output(like="source", doc="Half.")
    composed = Output(like="source", doc="The sum of all.")

    gain: float = param(default=0.5, doc="Factor.")

    def record(self, steps: Steps) -> None:
        steps.fullscreen("table.frag", out=self.table, label="table", value=2.0)
        steps.fullscreen("scale.frag", source=self.source, out=self.half)
        steps.fullscreen("scale.frag", source=self.half, out=self.prepared)
        if steps.connected(self.lit):
            reads: dict[str, Any] = {
                "lit": self.lit,
                "before_half": self.half,
                "table": self.table,
                "before": self.trail.previous,
            }
            for out in (self.trail, self.composed):
                steps.fullscreen("compose.frag", **reads, out=out, label="compose")


class Continue(Node):
    """Halves something before others use it, and adds to what they make of it, in place."""

    source = Input(Radiance, doc="Before.")
    radiance = InOut(Radiance, doc="After.")
    prepared = Output(like="source", doc="Half.")

    gain: float = param(default=0.5, doc="Factor.")

    def record(self, steps: Steps) -> None:
        steps.fullscreen("scale.frag", source=self.source, out=self.prepared)
        steps.clear(self.radiance.mip(0), 0.25)


class Light(Node):
    """What is made of it: five times as much."""

    prepared = Input(Radiance, doc="Half.")
    radiance = Output(like="prepared", doc="Five times.")
    shader = "light.frag"


class Shade(Node):
    """Provides a function of what was lit, and is lit by that."""

    lit = Input(Radiance, optional=True, doc="What was lit.")
    lookup = Function(ShadowLookup, shader="shade.glsl", reads=("lit",), doc="From what was lit.")
    early = Output(Radiance, format="rgba32f", doc="Reads nothing.")

    def record(self, steps: Steps) -> None:
        steps.fullscreen("table.frag", lit=None, value=3.0, out=self.early)


class Asks(Node):
    """Calls the function."""

    lookup = Input(ShadowLookup, kind="function", doc="What to call.")
    color = Output(Radiance, format="rgba32f", doc="Its value.")
    shader = "asks.frag"


SHADERS = {
    "ground.frag": "out vec4 color; void main() { color = vec4(gl_FragCoord.x); }",
    "table.frag": "uniform float value; out vec4 table; void main() { table = vec4(value); }",
    "scale.frag": """uniform sampler2D source; uniform float gain; out vec4 prepared;
        void main() { prepared = gain * texelFetch(source, ivec2(gl_FragCoord.xy), 0); }""",
    "light.frag": """uniform sampler2D prepared; out vec4 radiance;
        void main() { radiance = 5.0 * texelFetch(prepared, ivec2(gl_FragCoord.xy), 0); }""",
    "compose.frag": """uniform sampler2D lit, table, before, before_half; out vec4 composed;
        void main() { ivec2 p = ivec2(gl_FragCoord.xy); composed = texelFetch(lit, p, 0) + texelFetch(before_half, p, 0)
            + texelFetch(table, ivec2(0), 0) + texelFetch(before, p, 0); }""",
    "shade.glsl": """uniform sampler2D lit;
        float shadow(int light, vec3 position, vec3 normal) { return texelFetch(lit, ivec2(0), 0).x; }""",
    "asks.frag": "out vec4 color; void main() { color = vec4(shadow(0, vec3(0.0), vec3(0.0))); }",
}
NODES = (Ground, Bracket, Continue, Light, Shade, Asks)
TEXT = """nodes:
  bracket: {type: bracket, inputs: {source: ground.color, lit: light.radiance}}
  light: {type: light, inputs: {prepared: bracket.prepared}}
  ground: {type: ground}
outputs: {image: bracket.composed}
"""
X = np.arange(16, dtype=np.float32)[None, :] + 0.5


def steps_of(pipeline: rg.Pipeline) -> list[str]:
    return [node for node, _ in groupby(step.node for step in pipeline.check().plan.schedule.steps)]


@pytest.mark.parametrize("mode", [{}, {"shuffle": 3, "poison": True}, {"alias": False, "reuse": False}])
def test_a_node_stands_before_and_behind_another(bench: Any, gl: rg.Session, mode: dict[str, Any]) -> None:
    pipeline = bench.pipeline(TEXT, *NODES, shaders=SHADERS)
    for number, frame in enumerate(gl.frames(pipeline, frames=range(1, 4), **mode), start=1):
        # 5/4 of the ramp is lit, and half of it and 2 are added; so is the sum of the frame before.
        expected = number * (5 * 0.25 * X + 0.5 * X + 2)
        np.testing.assert_array_equal(frame["image"][..., 0], np.broadcast_to(expected, (8, 16)))


def test_its_picture_follows_its_parameters(bench: Any, gl: rg.Session) -> None:
    pipeline = bench.pipeline(TEXT, *NODES, shaders=SHADERS)
    assert gl.render(pipeline.set("bracket.gain", 1.0))["image"][0, 0, 0] == 5 * 0.5 + 0.5 + 2


def test_it_is_scheduled_drawn_as_a_graph_and_listed(bench: Any) -> None:
    pipeline = bench.pipeline(TEXT, *NODES, shaders=SHADERS)
    assert steps_of(pipeline)[-3:] == ["bracket", "light", "bracket"]
    graph = pipeline.link().graph
    assert graph.reading_order().index("ground") < graph.reading_order().index("bracket")
    assert markup.text(graph).count("light.radiance") == 1
    assert all(node in picture.svg(graph) for node in graph.members)
    assert "back" not in markup.graph_json(graph)["links"][0]


def test_it_continues_what_was_made_of_what_it_prepared(bench: Any, gl: rg.Session) -> None:
    text = """nodes:
  ground: {type: ground}
  around: {type: continue, inputs: {source: ground.color, radiance: light.radiance}}
  light: {type: light, inputs: {prepared: around.prepared}}
  other: {type: light, inputs: {prepared: light.radiance}}
outputs: {image: around.radiance, other: other.radiance}
"""
    frame = gl.render(bench.pipeline(text, *NODES, shaders=SHADERS))
    np.testing.assert_array_equal(frame["image"], np.full((8, 16, 4), 0.25))
    np.testing.assert_array_equal(frame["other"][0, :, 0], 12.5 * X[0])  # which reads it before that


def test_it_provides_a_function_of_what_was_made_of_its_first_step(bench: Any, gl: rg.Session) -> None:
    text = """nodes:
  shade: {type: shade, inputs: {lit: light.radiance}}
  light: {type: light, inputs: {prepared: shade.early}}
  asks: {type: asks, inputs: {lookup: shade.lookup}}
outputs: {image: asks.color}
"""
    assert gl.render(bench.pipeline(text, *NODES, shaders=SHADERS))["image"][0, 0, 0] == 15


def test_a_sub_pipeline_stands_around_others(bench: Any, gl: rg.Session) -> None:
    (bench.folder / "inner.yaml").write_text("""rendergraph: 1
inputs: {source: {semantic: radiance}, lit: {semantic: radiance}}
nodes:
  first: {type: light, inputs: {prepared: inputs.source}}
  second: {type: light, inputs: {prepared: inputs.lit}}
outputs: {early: first.radiance, late: second.radiance}
""")
    text = """nodes:
  ground: {type: ground}
  inner: {type: ./inner.yaml, inputs: {source: ground.color, lit: light.radiance}}
  light: {type: light, inputs: {prepared: inner.early}}
outputs: {image: inner.late}
"""
    frame = gl.render(bench.pipeline(text, *NODES, shaders=SHADERS))
    np.testing.assert_array_equal(frame["image"][0, :, 0], 125 * X[0])


def said(bench: Any, text: str) -> list[str]:
    with pytest.raises(InputError) as caught:
        bench.pipeline(text, *NODES, shaders=SHADERS).check()
    return [str(problem).replace(f"{bench.folder}/", "") for problem in caught.value.problems]


class Careless(Node):
    """Two steps, of which the first reads more than it says."""

    source = Input(Radiance, doc="Before.")
    lit = Input(Radiance, optional=True, doc="What is made of `prepared`.")
    prepared = Output(Radiance, format="rgba32f", doc="Half.")
    composed = Output(Radiance, format="rgba32f", doc="All.")

    def record(self, steps: Steps) -> None:
        steps.fullscreen("scale.frag", out=self.prepared, gain=0.5)
        steps.fullscreen("scale.frag", source=self.lit, out={"prepared": self.composed}, gain=0.5)


class Adding(Node):
    """Adds to a picture, with a step that reads whatever is connected."""

    source = Input(Radiance, doc="Read by nobody.")
    radiance = InOut(Radiance, doc="The picture.")

    def record(self, steps: Steps) -> None:
        steps.fullscreen("scale.frag", out={"prepared": self.radiance}, gain=0.5, state=State(blend=ADD))


def test_a_step_that_reads_what_it_writes_because_it_names_no_input(bench: Any) -> None:
    text = """nodes:
  ground: {type: ground}
  add: {type: adding, inputs: {source: ground.color, radiance: ground.color}}
outputs: {image: add.radiance}
"""
    with pytest.raises(InputError, match=r"RG422 .* names no input reads all: leave it out by source=None; or blend"):
        bench.pipeline(text, *NODES, Adding, shaders=SHADERS).check()


class Thorough(Careless):
    """Names all that it reads, and still reads too much."""

    def record(self, steps: Steps) -> None:
        steps.fullscreen("scale.frag", source=self.source, lit=self.lit, out=self.prepared, gain=0.5)
        steps.fullscreen("scale.frag", source=self.lit, out={"prepared": self.composed}, gain=0.5)


def test_a_step_that_names_all_inputs_is_not_said_to_name_none(bench: Any) -> None:
    with pytest.raises(InputError, match=r"RG117 the steps form a cycle: [^;]*; append '@previous' to a link"):
        bench.pipeline(TEXT.replace("type: bracket", "type: thorough"), *NODES, Thorough, shaders=SHADERS).check()


def test_a_cycle_of_steps_is_named_with_steps_nodes_and_lines(bench: Any) -> None:
    with pytest.raises(InputError) as caught:
        bench.pipeline(TEXT.replace("type: bracket", "type: careless"), *NODES, Careless, shaders=SHADERS).check()
    (problem,) = caught.value.problems
    assert problem.code == "RG117"
    assert problem.place is not None
    assert problem.place.line in (4, 5)
    line = Careless.record.__code__.co_firstlineno + 1
    step = f"step 0 of 'bracket' (test_step_cycles.py:{line})"
    assert f"{step} reads 'light.radiance' (line 4)" in problem.message
    assert "'light' reads 'bracket.prepared' (line 5)" in problem.message
    assert f"{step} names no input, so it reads all: name in `record` what it reads" in problem.message


def test_certain_cycles_are_refused_before_steps_are_recorded(bench: Any) -> None:
    (one,) = said(bench, TEXT.replace("source: ground.color", "source: light.radiance"))  # `prepared` is like it
    assert "RG117 the nodes form a cycle, bracket.prepared → light.radiance → bracket.prepared" in one


def test_a_reader_between_two_steps_of_the_node_that_overwrites(bench: Any) -> None:
    text = """nodes:
  ground: {type: ground}
  around: {type: continue, inputs: {source: other.radiance, radiance: light.radiance}}
  light: {type: light, inputs: {prepared: ground.color}}
  other: {type: light, inputs: {prepared: light.radiance}}
  late: {type: bracket, inputs: {source: around.radiance, lit: light.radiance}}
outputs: {image: late.composed}
"""
    (one,) = said(bench, text)
    assert one.startswith("test.yaml:8:64: RG128 'late.lit' reads 'light.radiance', but 'late' also needs ")


class Twisted(Node):
    """Reads what it overwrites before, and needs what is made of that."""

    radiance = InOut(Radiance, doc="What is overwritten.")
    lit = Input(Radiance, doc="What is made of `first`.")
    first = Output(like="radiance", doc="A copy.")
    last = Output(like="radiance", doc="Another.")

    def record(self, steps: Steps) -> None:
        steps.fullscreen("scale.frag", source=self.radiance, out={"prepared": self.first}, gain=1.0)
        steps.clear(self.radiance.mip(0), 0.25)
        steps.fullscreen("scale.frag", source=self.lit, out={"prepared": self.last}, gain=1.0)


def test_a_reader_of_what_a_step_of_its_source_overwrites(bench: Any, gl: rg.Session) -> None:
    """It runs between the two steps of that node; judged by nodes there would be no order."""
    text = """nodes:
  ground: {type: ground}
  twisted: {type: twisted, inputs: {radiance: ground.color, lit: other.radiance}}
  other: {type: light, inputs: {prepared: twisted.first}}
  third: {type: bracket, inputs: {source: ground.color, lit: other.radiance}}
outputs: {image: twisted.last, third: third.composed}
"""
    frame = gl.render(bench.pipeline(text, *NODES, Twisted, shaders=SHADERS), taps=["twisted.radiance"])
    np.testing.assert_array_equal(frame["image"][0, :, 0], 5 * X[0])
    np.testing.assert_array_equal(frame["third"][0, :, 0], 5 * X[0] + 0.5 * X[0] + 2)
    assert (frame["twisted.radiance"] == 0.25).all()


# --- any graph of steps, in any bundles ------------------------------------------------------------------------------


class Bundle(Node):
    """Up to three steps: each adds two values and a number of its own, in place or not."""

    a0, a1, a2 = (Input(Radiance, optional=True, doc="A value.") for _ in range(3))
    b0, b1, b2 = (Input(Radiance, optional=True, doc="Another.") for _ in range(3))
    c0, c1, c2 = (InOut(Radiance, optional=True, format="r32f", doc="What is added to.") for _ in range(3))
    v0, v1, v2 = (Output(Radiance, format="r32f", doc="The sum.") for _ in range(3))

    order: int = structural(default=0, min=0, max=5, doc="In which order they are recorded.")
    k0: float = param(default=0.0, doc="A number.")
    k1: float = param(default=0.0, doc="A number.")
    k2: float = param(default=0.0, doc="A number.")

    def record(self, steps: Steps) -> None:
        ports = self.ports()
        for i in list(permutations(range(3)))[self.order]:
            a, b, c, v = (ports[f"{letter}{i}"] for letter in "abcv")
            reads: dict[str, Any] = {name: port for name, port in (("a", a), ("b", b)) if steps.connected(port)}
            options: dict[str, Any] = {"defines": {f"HAS_{name.upper()}": 1 for name in reads}}
            if steps.connected(c):
                options |= {"out": {"value": c}, "state": State(blend=ADD)}
            elif steps.used(v):
                options |= {"out": {"value": v}}
            else:
                continue
            unread = {} if reads else dict.fromkeys(self.inputs())
            steps.fullscreen("add.frag", **{**unread, **reads}, number=getattr(self, f"k{i}"), **options)


SHARES = {"a": 0.5, "b": 0.25}
ADD_FRAG = """uniform sampler2D a, b;
uniform float number;
out float value;
void main() {
    value = number;
#ifdef HAS_A
    value += 0.5 * texelFetch(a, ivec2(0), 0).r;
#endif
#ifdef HAS_B
    value += 0.25 * texelFetch(b, ivec2(0), 0).r;
#endif
}
"""


@given(st.data())
@settings(max_examples=25, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_bundles_of_steps_compute_what_the_steps_do(bench: Any, gl: rg.Session, data: st.DataObject) -> None:
    coin = st.booleans()
    count: int = data.draw(st.integers(2, 9))
    values: list[float] = []
    links: list[dict[str, str]] = []
    free: set[int] = set()  # read by nobody yet
    place: list[int] = data.draw(st.permutations(range(count)))  # which step of which node each is
    name = [f"n{at // 3}.{{}}{at % 3}" for at in place]
    ends: list[str] = []
    for step in range(count):
        readable = [earlier for earlier in range(step) if ends[earlier]]
        chosen = {port: data.draw(st.sampled_from(readable)) for port in "ab" if data.draw(coin) and readable}
        value = step + 1.0 + sum(SHARES[port] * values[earlier] for port, earlier in chosen.items())
        links.append({port: ends[earlier] for port, earlier in chosen.items()})
        free -= set(chosen.values())
        ends.append(name[step].format("v"))
        if data.draw(coin) and free:  # adds to what nobody reads, and nobody can from now on
            before = data.draw(st.sampled_from(sorted(free)))
            links[-1]["c"], value = ends[before], value + values[before]
            ends[step], ends[before] = name[step].format("c"), ""
            free.discard(before)
        values.append(value)
        free.add(step)
    nodes: dict[str, Any] = {}
    for step, at in enumerate(place):
        node = nodes.setdefault(f"n{at // 3}", {"type": "bundle", "inputs": {}, "params": {}})
        node["inputs"] |= {f"{port}{at % 3}": end for port, end in links[step].items()}
        node["params"][f"k{at % 3}"] = step + 1.0
    for node in nodes.values():
        node["params"]["order"] = data.draw(st.integers(0, 5))
    outputs = {f"o{step}": end for step, end in enumerate(ends) if end}
    text = yaml.safe_dump({"nodes": nodes, "outputs": outputs})
    frame = gl.render(bench.pipeline(text, Bundle, shaders={"add.frag": ADD_FRAG}, size=(1, 1)))
    for step, value in enumerate(values):
        if ends[step]:
            assert frame.arrays[f"o{step}"].item() == pytest.approx(value, rel=1e-6)
