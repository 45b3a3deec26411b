"""A complete pipeline that uses a node type, for `explain` and the reference.

If shipped pipelines use the type, the shortest of them is the example. Otherwise the node is inserted into a shipped
pipeline: every required input gets a port that fits, and the first output goes to a node that accepts it. The result
is linked to make sure that it is valid.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from functools import cache
from typing import Any

from rendergraph.catalog import Catalog, NodeType
from rendergraph.declare import Function, InOut, Input, LightFacts, Port
from rendergraph.document import parse
from rendergraph.errors import InputError
from rendergraph.link import link
from rendergraph.link.check import port_kind
from rendergraph.link.graph import Endpoint, Graph, GraphNode, depth_first
from rendergraph.resolve import resolve
from rendergraph.resources import shipped_pipelines

_LIGHTS = (LightFacts("sun", "directional"),)

Links = dict[str, str]
"""Input or group to its connection, as written in a file."""


def example_text(node_type: NodeType, catalog: Catalog) -> str:
    """Return `example_file`; or, where there is none, the node's entry with gaps for the inputs that it must have."""
    text = example_file(node_type, catalog)
    if text is not None:
        return text.rstrip()
    links, groups = {}, node_type.cls.groups()
    for name, port in node_type.cls.inputs().items():
        group = next((group for group, members in groups.items() if name in members), None)
        if not port.optional and not getattr(port, "takes_scene", False):
            links[group or name] = "NODE" if group else f"NODE.{name}"
    inputs = f", inputs: {_flow(links)}" if links else ""
    return f"{node_type.word}: {{type: {node_type.name}{inputs}}}"


def example_file(node_type: NodeType, catalog: Catalog) -> str | None:
    """Return a whole pipeline file with a node of a type; None where no shipped pipeline has what the node needs."""
    uses = re.compile(rf"\btype: {re.escape(node_type.name)}\b")
    texts = _shipped_texts()
    if users := sorted((text for text in texts if uses.search(text)), key=len):
        text = next((text for text in users if _takes_part(node_type, text, catalog)), users[0])
        # Files that a shipped pipeline names by relative path are not beside a copy of it.
        return f"extends: {texts[text]}\n" if "type: ./" in text else text
    for base in _bases():
        for text in _patches(node_type, base):
            if _linked(text, catalog) is not None:
                return text
    return None


def _shipped_texts() -> dict[str, str]:
    return {file.read_text(encoding="utf-8"): name for name, file in shipped_pipelines().items()}


@cache
def _bases() -> tuple[Graph, ...]:
    """The shipped pipelines: those that extend no other first, then the smallest, then the most extended."""
    catalog = Catalog.discover()
    names = {name: text for text, name in _shipped_texts().items()}
    graphs = [link(resolve(name, catalog=catalog), catalog, _LIGHTS) for name in names]
    extended = re.findall(r"^extends: (.*)$", "\n".join(names.values()), re.MULTILINE)

    def rank(graph: Graph) -> tuple[bool, int, int]:
        return "\nextends: " in names[graph.name], len(graph.nodes), -extended.count(graph.name)

    return tuple(sorted(graphs, key=rank))


def _linked(text: str, catalog: Catalog) -> Graph | None:
    try:
        return link(resolve(parse(text, "example.yaml"), catalog=catalog), catalog, _LIGHTS)
    except InputError:
        return None


def _takes_part(node_type: NodeType, text: str, catalog: Catalog) -> bool:
    """Whether an output depends on a node of the type; some are in a file only for users to connect."""
    graph = _linked(text, catalog)
    if graph is None:
        return False
    sources = {node.id: [end.node for ends in node.inputs.values() for end in ends] for node in graph.nodes}
    used = depth_first(sources, [end.node for end in graph.outputs.values()])
    return any(graph[node].type.name == node_type.name for node in used)


# --- patches on a shipped pipeline -----------------------------------------------------------------------------------


def _patches(node_type: NodeType, base: Graph) -> Iterator[str]:
    """Files to try, best first: with the inputs that outputs need and a reader, with fewer inputs, without a reader."""
    needed = {name for port in node_type.cls.outputs().values() for name in getattr(port, "needs", ())}
    tried = []
    for optional in (needed, set[str]()):
        links = _links(node_type, base, optional)
        if links is not None and links not in tried:
            tried.append(links)
            for reader in _readers(node_type, base, links):
                yield _text(node_type, base, links, reader)
    for links in tried:
        yield _text(node_type, base, links, None)


def _links(node_type: NodeType, base: Graph, optional: set[str]) -> Links | None:
    """Connections of the required inputs, and of the given optional ones where something fits."""
    links: Links = {}
    groups = node_type.cls.groups()
    for name, port in node_type.cls.inputs().items():
        if port.optional and name not in optional:
            continue
        group = next((group for group, members in groups.items() if name in members), None)
        if group is None:
            end = _best_end(base, name, port)
        else:
            end = next((node.id for node in base.nodes if set(groups[group]) <= node.type.cls.outputs().keys()), None)
        if end:
            links[group or name] = end
        elif not port.optional and not getattr(port, "takes_scene", False):
            return None
    return links


def _best_end(base: Graph, name: str, port: Input | InOut) -> str | None:
    """The port of the base that fits an input best: of the same name, else the radiance output, else any."""
    kind, meaning = getattr(port, "kind", "texture2d"), _meaning(port)
    ends = [end for end, given, means in _ends(base) if given == kind and meaning in ("any", means)]
    if isinstance(port, Input) and port.samples == "multi":
        ends = [end for end in ends if (desc := base.textures[end].desc) is not None and desc.samples > 1]
    ends.sort(key=lambda end: (end.port != name, end != base.outputs.get("radiance")))
    return str(ends[0]) if ends else None


def _ends(base: Graph) -> Iterator[tuple[Endpoint, str, str]]:
    for node in base.nodes:
        for name, port in node.type.cls.outputs().items():
            end = Endpoint(node.id, name)
            if isinstance(port, Function):
                yield end, "function", port.signature.name
            elif (info := base.textures.get(end)) is not None:
                yield end, port_kind(port, info), info.semantic.name


def _meaning(port: Port) -> str:
    if isinstance(port, Function):
        return port.signature.name
    semantic: Any = getattr(port, "semantic", None)
    return semantic.name if semantic else ""


def _readers(node_type: NodeType, base: Graph, links: Links) -> Iterator[tuple[str, str, str]]:
    """Node, input and our output that it could read: first inputs that read what we change, then unconnected ones."""
    inputs, replaced = node_type.cls.inputs(), set(links.values())
    ranked = []
    for rank, (name, port) in enumerate(node_type.cls.outputs().items()):
        like = getattr(port, "like", None)
        meaning = _meaning(inputs[like]) if like and not _meaning(port) else _meaning(port)
        for node in base.nodes:
            for input_name, other in node.type.cls.inputs().items():
                ends = {str(end) for end in node.inputs.get(input_name, ())}
                instead = bool(ends & replaced)
                fits = instead if meaning == "any" else _meaning(other) == meaning
                if fits and _has_effect(base, node, input_name):
                    ranked.append(((not instead, bool(ends), rank), (node.id, input_name, name)))
    return (reader for _, reader in sorted(ranked, key=lambda entry: entry[0]))


def _has_effect(base: Graph, node: GraphNode, name: str) -> bool:
    """Whether an output that depends on the input is used: some inputs are needed by one of the outputs only."""
    used = {data["source_port"] for _, _, data in base.dag.out_edges(node.id, data=True)}
    used |= {end.port for end in base.outputs.values() if end.node == node.id}
    needy = {out for out, port in node.type.cls.outputs().items() if name in getattr(port, "needs", ())}
    return not needy or bool(needy & used)


def _text(node_type: NodeType, base: Graph, links: Links, reader: tuple[str, str, str] | None) -> str:
    id_ = node_type.word if all(node.id != node_type.word for node in base.nodes) else "example"
    inputs = f", inputs: {_flow(links)}" if links else ""
    lines = [f"extends: {base.name}", "nodes:", f"  {id_}: {{type: {node_type.name}{inputs}}}"]
    textures = {
        name: port
        for name, port in node_type.cls.outputs().items()
        if str(getattr(port, "kind", "")).startswith("texture") and not isinstance(port, Function)
    }
    replaced = _replaced_outputs(textures, base, links)
    outputs = {name: f"{id_}.{out}" for name, out in replaced.items()}
    if reader is not None:
        node, port, out = reader
        lines.append(f"  {node}: {{inputs: {_flow({port: f'{id_}.{out}'})}}}")
    else:
        others = [name for name in textures if name not in replaced.values() and name not in outputs]
        outputs |= {name: f"{id_}.{name}" for name in others}
    return "\n".join([*lines, *([f"outputs: {_flow(outputs)}"] if outputs else [])]) + "\n"


def _replaced_outputs(textures: Mapping[str, Port], base: Graph, links: Links) -> Links:
    """Outputs of the base that the node changes, each with the output of the node that has the result."""
    changed: Links = {}
    for name, end in base.outputs.items():
        inputs = [ours for ours, theirs in links.items() if theirs == str(end)]
        meaning = base.textures[end].semantic.name if end in base.textures else ""
        like = [out for out, port in textures.items() if out in inputs or getattr(port, "like", None) in inputs]
        alike = [out for out, port in textures.items() if inputs and _meaning(port) == meaning]
        if like or alike:
            changed[name] = (like or alike)[0]
    return changed


def _flow(table: Mapping[str, str]) -> str:
    return "{" + ", ".join(f"{key}: {value}" for key, value in table.items()) + "}"
