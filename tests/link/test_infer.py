"""What textures turn out to be: by rules of nodes, each asked once."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from typing import Any

from rendergraph.api import Facts, Input, Node, Output, Radiance, ShadowMap, Views
from rendergraph.catalog import Catalog
from rendergraph.declare import LightFacts
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


def test_a_port_without_a_rule_is_as_it_says() -> None:
    class Plain(Node):
        """A node."""

        color = Output(Radiance, clear=(0.0, 0.5, 1.0), doc="Colour.")
        rest = Output(Radiance, doc="What is there.")

    catalog = Catalog.of(Plain)
    graph = link(resolve(read(None, "nodes: {a: {type: plain}}\noutputs: {c: a.color}"), catalog=catalog), catalog)
    assert graph["a"].clears == {"color": (0.0, 0.5, 1.0), "rest": None}
