"""What textures turn out to be: by rules of nodes, each asked once."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from typing import Any

import pytest

from rendergraph.api import Depth, Facts, Input, Node, Output, Radiance, ShadowMap, View, Views
from rendergraph.catalog import Catalog
from rendergraph.declare import LightFacts
from rendergraph.errors import InputError
from rendergraph.expand import ViewTable, expand
from rendergraph.link import Endpoint, link
from rendergraph.read import read
from rendergraph.resolve import resolve
from rendergraph.textures import Sampler

asked: Counter[str] = Counter()


def rule(name: str, value: Any) -> Callable[[Node, Facts], Any]:
    def answer(node: Node, facts: Facts) -> Any:
        asked[name] += 1
        return value

    return answer


LIGHTS = rule("lights", (0, 1))
LAYERS = rule("layers", 2)


class Maps(Node):
    """Shadow maps whose layers and lights are said twice, by one function each."""

    views = Views(count=LAYERS, lights=LIGHTS, doc="The lights' views.")
    maps = Output(
        ShadowMap,
        kind="texture2d_array",
        format=rule("format", "depth32f"),
        size=rule("size", (8, 8)),
        layers=LAYERS,
        lights=LIGHTS,
        samples=rule("samples", 1),
        mips=rule("mips", 1),
        view="views",
        clear=rule("clear", 1.0),
        doc="Depth.",
    )

    def record(self, steps: Any) -> None:
        for layer in range(2):
            steps.geometry(None, out=self.maps.layer(layer), view=self.views, view_index=layer)

    def update(self, frame: Any) -> None:
        """Would set the views."""


class Reads(Node):
    """What reads them."""

    maps = Input(
        ShadowMap, kind="texture2d_array", size="any", filter=rule("filter", "linear"), wrap="border", doc="Maps."
    )
    data = Output(Radiance, kind="buffer", bytes=rule("bytes", 64), doc="A buffer.")
    color = Output(Radiance, doc="Colour.")


def test_every_rule_is_asked_once_until_the_schedule() -> None:
    catalog = Catalog.of(Maps, Reads)
    text = "nodes: {m: {type: maps}, r: {type: reads, inputs: {maps: m.maps}}}\noutputs: {c: r.color, m: m.maps}"
    lights = (LightFacts("sun", "directional"), LightFacts("lamp", "spot"))
    asked.clear()
    graph = link(resolve(read(None, text), catalog=catalog), catalog, lights)
    expansion = expand(graph)
    names = ("lights", "layers", "format", "size", "samples", "mips", "clear", "filter", "bytes")
    assert asked == Counter(dict.fromkeys(names, 1))
    assert graph["m"].clears == {"maps": 1.0}
    assert graph["r"].samplers == {"maps": Sampler("linear", "border")}
    found = graph.textures[Endpoint("m", "maps")]
    assert (found.view, found.lights) == ("m.views", (0, 1))
    assert expansion.views["m.views"] == ViewTable(2, (0, 1))
    reads = [read for step in expansion.steps for read in step.reads if read.resource == "m.maps"]
    assert {read.sampler for read in reads} == {Sampler("linear", "border")}


class Counted(Node):
    """Shadow maps whose lights alone are said."""

    views = Views(lights=LIGHTS, doc="The lights' views.")
    maps = Output(ShadowMap, kind="texture2d_array", format="depth32f", view="views", doc="Depth.")
    lit = Output(ShadowMap, kind="texture2d_array", lights=rule("lit", (0, 1, 1)), doc="Lit.")
    plain = Output(Radiance, kind="texture2d_array", doc="No light's.")
    single = Views(doc="One view.")


def test_there_is_a_view_and_a_layer_for_each_light() -> None:
    catalog = Catalog.of(Counted)
    text = "nodes: {m: {type: counted}}\noutputs: {m: m.maps}"
    lights = (LightFacts("sun", "directional"), LightFacts("lamp", "spot"))
    asked.clear()
    graph = link(resolve(read(None, text), catalog=catalog), catalog, lights)
    assert asked == {"lights": 1, "lit": 1}
    found = {end.port: info.desc.layers if info.desc else info.views for end, info in graph.textures.items()}
    assert found == {"views": 2, "maps": 2, "lit": 3, "plain": 1, "single": 1}


class Wide(Node):
    """A view that is larger than the picture."""

    view = Views(size=lambda node, facts: (facts.viewport[0] + 8, facts.viewport[1] + 4), doc="One view.")

    def record(self, steps: Any) -> None:
        """Nothing."""


class Drawn(Node):
    """What is drawn with a view."""

    view = Input(View, kind="view", optional=True, doc="Seen from.")
    depth = Output(Depth, format="depth32f", doc="Depth.")


class Half(Node):
    """What is made of it, texel by texel, at half its size, and of the picture's."""

    depth = Input(Depth, doc="Depth.")
    radiance = Output(Radiance, doc="Radiance.")
    half = Output(Radiance, size=0.5, doc="Half of it.")
    fixed = Output(Radiance, size=(3, 2), doc="Its own.")

    def record(self, steps: Any) -> None:
        """Nothing."""


class Small(Node):
    """The picture again."""

    source = Input(Radiance, size="any", doc="Radiance.")
    cropped = Output(like="source", size=1.0, doc="Radiance.")


def test_what_is_made_of_a_larger_view_is_as_large() -> None:
    """And knows the view where it is of its size; what takes any size is the picture's again."""
    catalog = Catalog.of(Wide, Drawn, Half, Small)
    nodes = "w: {type: wide}, d: {type: drawn, inputs: {view: w.view}}, h: {type: half, inputs: {depth: d.depth}}"
    text = f"size: [100, 50]\nnodes: {{{nodes}, s: {{type: small, inputs: {{source: h.radiance}}}}}}\noutputs: {{x: s.cropped}}"
    graph = link(resolve(read(None, text), catalog=catalog), catalog)
    found = {str(end): (info.desc.size, info.view) for end, info in graph.textures.items() if info.desc is not None}
    assert found == {
        "d.depth": ((108, 54), "w.view"),
        "h.radiance": ((108, 54), "w.view"),
        "h.half": ((54, 27), None),
        "h.fixed": ((3, 2), None),
        "s.cropped": ((100, 50), "w.view"),
    }


def test_a_port_without_a_rule_is_as_it_says() -> None:
    class Plain(Node):
        """A node."""

        color = Output(Radiance, clear=(0.0, 0.5, 1.0), doc="Colour.")
        rest = Output(Radiance, doc="What is there.")

    catalog = Catalog.of(Plain)
    graph = link(resolve(read(None, "nodes: {a: {type: plain}}\noutputs: {c: a.color}"), catalog=catalog), catalog)
    assert graph["a"].clears == {"color": (0.0, 0.5, 1.0), "rest": None}


def test_a_plain_texture_has_no_layers() -> None:
    class Flat(Node):
        """A node."""

        color = Output(Radiance, layers=3, doc="Colour.")

    catalog = Catalog.of(Flat)
    resolved = resolve(read(None, "nodes: {a: {type: flat}}\noutputs: {c: a.color}"), catalog=catalog)
    with pytest.raises(InputError, match=r"RG208 .* 1 layer, not 3; the kind with layers is texture2d_array"):
        link(resolved, catalog)
