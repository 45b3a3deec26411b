"""What nodes record, read without GL: steps with resources and versions in place of ports."""

from __future__ import annotations

import pytest

import rendergraph as rg
from rendergraph.api import ADD, InOut, Input, Internal, Node, Output, Radiance, State, Steps, define, param
from rendergraph.catalog import Catalog
from rendergraph.expand import Expansion, expand
from rendergraph.link import Endpoint, link
from rendergraph.read import read
from rendergraph.resolve import resolve


class Source(Node):
    """Two pictures."""

    color = Output(Radiance, doc="One.")
    spare = Output(Radiance, doc="Another.")

    def record(self, steps: Steps) -> None:
        """The other one where somebody reads it."""
        steps.fullscreen("color.frag", out=self.color)
        if steps.used(self.spare):
            steps.fullscreen("spare.frag", out=self.spare)


class Soft(Node):
    """A blur in two steps."""

    source = Input(Radiance, size="any", filter="linear", doc="What.")
    mask = Input(Radiance, optional=True, doc="Where.")
    blurred = Output(like="source", doc="The same, blurred.")
    across = Internal(like="source")
    radius: int = param(default=4, doc="Reach.")
    kernel: int = define(default=3, doc="Taps.")

    def record(self, steps: Steps) -> None:
        """Across, then down."""
        steps.fullscreen("soft.frag", source=self.source, out=self.across, axis=(1, 0))
        steps.fullscreen("soft.frag", source=self.across, out=self.blurred, axis=(0, 1))


class Glow(Node):
    """Adds to what is there."""

    color = InOut(Radiance, optional=True, clear=0.0, doc="Continued.")

    def record(self, steps: Steps) -> None:
        """One step over it."""
        steps.fullscreen("glow.frag", out=self.color, state=State(blend=ADD))


class Aside(Glow):
    """Adds to what is there, and makes something else that needs nothing of it."""

    other = Output(Radiance, clear=0.0, doc="Something else.")

    def record(self, steps: Steps) -> None:
        """What is wanted alone."""
        if steps.used(self.color):
            super().record(steps)
        steps.fullscreen("aside.frag", out=self.other)


def expanded(nodes: str, outputs: str, *wanted: Endpoint) -> Expansion:
    catalog = Catalog.of(Source, Soft, Glow, Aside)
    text = f"size: [64, 32]\nnodes:\n{nodes}\noutputs: {{{outputs}}}\n"
    graph = link(resolve(read(None, text, keep_going=True), catalog=catalog), catalog, ())
    return expand(graph, {str(end): end for end in wanted} if wanted else None)


BLUR = "  s: {type: source}\n  b: {type: soft, inputs: {source: s.color}, params: {radius: 2, kernel: 5}}"


def test_a_node_of_two_steps_reads_its_own_internal_in_the_second() -> None:
    found = expanded(BLUR, "image: b.blurred")
    source, across, down = found.steps
    assert [(step.node, step.index, step.kind) for step in found.steps] == [
        ("s", 0, "fullscreen"),
        ("b", 0, "fullscreen"),
        ("b", 1, "fullscreen"),
    ]
    assert [(r.name, r.resource, r.version) for r in (*across.reads, *down.reads)] == [
        ("source", "s.color", 1),
        ("source", "b.across", 1),
    ]
    assert [(w.name, w.resource, w.version, w.load) for step in found.steps for w in step.writes] == [
        ("color", "s.color", 1, "discard"),
        ("across", "b.across", 1, "discard"),
        ("blurred", "b.blurred", 1, "discard"),
    ]
    assert (source.size, across.size) == ((64, 32), (64, 32))
    assert {id: resource.role for id, resource in found.resources.items()} == {
        "s.color": "transient",
        "s.spare": "transient",
        "b.across": "internal",
        "b.blurred": "output",
    }
    assert found.outputs == {"image": "b.blurred"}


def test_parameters_are_uniforms_and_defines_of_every_step_and_arguments_of_their_own() -> None:
    _, across, down = expanded(BLUR, "image: b.blurred").steps
    assert [dict(step.uniforms) for step in (across, down)] == [
        {"radius": 2, "axis": (1, 0)},
        {"radius": 2, "axis": (0, 1)},
    ]
    for step in (across, down):
        assert dict(step.defines)["KERNEL"] == "5"
        assert dict(step.shaders)["fragment"] == "soft.frag"
    assert across.reads[0].sampler.filter == "linear"


def test_what_is_continued_and_not_touched_need_not_exist() -> None:
    found = expanded("  s: {type: source}\n  a: {type: aside, inputs: {color: s.color}}", "image: a.other")
    assert [step.node for step in found.steps] == ["a"]
    assert "s.color" not in found.resources


@pytest.mark.parametrize("also", [False, True])
def test_an_output_is_recorded_where_somebody_wants_it(also: bool) -> None:
    ends = [Endpoint("s", "color"), *([Endpoint("s", "spare")] if also else [])]
    found = expanded(BLUR, "image: b.blurred", *ends)
    assert [step.shaders[-1][1] for step in found.steps] == ["color.frag", *(["spare.frag"] if also else [])]
    assert found.idle == {"b": "no requested output depends on it"}


def test_who_continues_a_texture_makes_its_next_version() -> None:
    nodes = (
        "  s: {type: source}\n"
        "  b: {type: soft, inputs: {source: s.color}}\n"
        "  one: {type: glow, inputs: {color: s.color}}\n"
        "  two: {type: glow, inputs: {color: one.color}}"
    )
    found = expanded(nodes, "image: two.color, soft: b.blurred")
    writes = {step.key: (w.resource, w.version, w.load) for step in found.steps for w in step.writes}
    assert writes["one", 0] == ("s.color", 2, "load")
    assert writes["two", 0] == ("s.color", 3, "load")
    reads = {step.key: [(r.resource, r.version, r.use) for r in step.reads] for step in found.steps}
    assert reads["b", 0] == [("s.color", 1, "sample")]  # before the light is added
    assert reads["two", 0] == [("s.color", 2, "attach")]
    assert "one.color" not in found.resources
    assert found.outputs["image"] == "s.color"


def test_an_optional_continued_texture_that_is_not_connected_is_the_nodes_own() -> None:
    (step,) = expanded("  g: {type: glow}", "image: g.color").steps
    assert [(w.resource, w.version, w.load, w.clear) for w in step.writes] == [("g.color", 1, "clear", 0.0)]
    assert not step.reads


@pytest.mark.parametrize(
    ("pipeline", "shadows"),
    [
        ("shadow-pcf", "shadows.visibility has no layers: it uses none of the scene's lights (18 point)"),
        ("forward", "sun.shadow_map has no layers: there is nothing to read"),
    ],
)
def test_a_node_that_finds_no_light_says_so(pipeline: str, shadows: str) -> None:
    culled = rg.load(pipeline, scene="many_lights").plan().schedule.culled
    assert culled["sun"] == "sun.shadow_map has no layers: it uses none of the scene's lights (18 point)"
    assert culled["shadows"] == shadows
    apart = [f"light.{name}=null" for name in ("visibility", "lookup", "blended_lookup")]
    rest = rg.load(pipeline, scene="many_lights", sets=apart).plan()
    assert rest.schedule.culled["shadows"] == "no requested output depends on it"
