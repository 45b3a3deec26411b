"""A pipeline that shows a node type at work: for `explain` and the reference, complete and ready to run.

A type that shipped pipelines use is shown by the shortest of those files in which one takes part. For any other a patch
on a shipped pipeline is put together: every input it must have gets a port that fits, and its first output goes to a
node that can take it. Whatever is put together is linked, so that what is shown is legal.
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
from rendergraph.link.graph import Endpoint, Graph, GraphNode
from rendergraph.resolve import resolve
from rendergraph.resources import shipped_pipelines

_LIGHTS = (LightFacts("sun", "directional"),)

Links = dict[str, str]
"""Input or group to what is connected, as a file says it."""


def example(found: NodeType, catalog: Catalog) -> str | None:
    """A whole pipeline file with a node of this type; None where no shipped pipeline has what it needs.

    Args:
        found: the type.
        catalog: where the type and the shipped pipelines' types are found.
    """
    uses = re.compile(rf"\btype: {re.escape(found.name)}\b")
    texts = {file.read_text(encoding="utf-8"): name for name, file in shipped_pipelines().items()}
    if shown := sorted((text for text in texts if uses.search(text)), key=len):
        text = next((text for text in shown if _takes_part(found, text, catalog)), shown[0])
        # What a shipped file names beside it does not lie beside a copy.
        return f"extends: {texts[text]}\n" if "type: ./" in text else text
    for base in _bases():
        for text in _patches(found, base):
            if _linked(text, catalog) is not None:
                return text
    return None


@cache
def _bases() -> tuple[Graph, ...]:
    """The shipped pipelines: those that stand alone first, then the smallest, then those that others extend most."""
    catalog = Catalog.discover()
    graphs = [link(resolve(name, catalog=catalog), catalog, _LIGHTS) for name in shipped_pipelines()]
    texts = {name: file.read_text(encoding="utf-8") for name, file in shipped_pipelines().items()}
    extended = re.findall(r"^extends: (.*)$", "\n".join(texts.values()), re.MULTILINE)
    stands = {name: "\nextends: " not in text for name, text in texts.items()}
    return tuple(
        sorted(graphs, key=lambda graph: (not stands[graph.name], len(graph.nodes), -extended.count(graph.name)))
    )


def _linked(text: str, catalog: Catalog) -> Graph | None:
    """The pipeline that a text is; None where it is wrong."""
    try:
        return link(resolve(parse(text, "example.yaml"), catalog=catalog), catalog, _LIGHTS)
    except InputError:
        return None


def _takes_part(found: NodeType, text: str, catalog: Catalog) -> bool:
    """Whether an output of the pipeline depends on a node of the type; one may stand there for a user to link."""
    graph = _linked(text, catalog)
    if graph is None:
        return False
    used, stack = set[str](), [end.node for end in graph.outputs.values()]
    while stack:
        if (node := stack.pop()) not in used:
            used.add(node)
            stack += [end.node for ends in graph[node].inputs.values() for end in ends]
    return any(graph[node].type.name == found.name for node in used)


# --- putting one together --------------------------------------------------------------------------------------------


def _patches(found: NodeType, base: Graph) -> Iterator[str]:
    """Files to try, the best first: with what the outputs need, somebody reading one; with less; read by nobody."""
    needed = {name for port in found.cls.outputs().values() for name in getattr(port, "needs", ())}
    tried = []
    for wanted in (needed, set[str]()):
        links = _links(found, base, wanted)
        if links is not None and links not in tried:
            tried.append(links)
            for reader in _readers(found, base, links):
                yield _text(found, base, links, reader)
    for links in tried:
        yield _text(found, base, links, None)


def _links(found: NodeType, base: Graph, wanted: set[str]) -> Links | None:
    """What the inputs it must have are connected to, and those that are wanted where something fits."""
    links: Links = {}
    groups = found.cls.groups()
    for name, port in found.cls.inputs().items():
        group = next((group for group, members in groups.items() if name in members), None)
        if port.optional and name not in wanted:
            continue
        if group is not None:
            end = _node_with(base, groups[group])
            links |= {group: end} if end else {}
        else:
            end = _end_for(base, name, port)
            links |= {name: end} if end else {}
        if end is None and not port.optional:
            return None
    return links


def _node_with(base: Graph, members: tuple[str, ...]) -> str | None:
    return next((node.id for node in base.nodes if set(members) <= node.type.cls.outputs().keys()), None)


def _end_for(base: Graph, name: str, port: Input | InOut) -> str | None:
    """The port of the base that fits an input best: of its name, else what is shown, else the last."""
    kind, meaning = getattr(port, "kind", "texture2d"), _meaning(port)
    shown = base.outputs.get("radiance")
    ends = [end for end, given, means in _ends(base) if given == kind and meaning in ("any", means)]
    if isinstance(port, Input) and port.samples == "multi":
        ends = [end for end in ends if (desc := base.textures[end].desc) is not None and desc.samples > 1]
    ends.sort(key=lambda end: (end.port != name, end != shown))
    return str(ends[0]) if ends else None


def _ends(base: Graph) -> Iterator[tuple[Endpoint, str, str]]:
    """Every output of a graph, its kind and what it means."""
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


def _readers(found: NodeType, base: Graph, links: Links) -> Iterator[tuple[str, str, str]]:
    """Node, input and our output that it could read: first who reads what we change, then who reads nothing yet."""
    taken = set(links.values())
    ranked = []
    for rank, (name, port) in enumerate(found.cls.outputs().items()):
        like = getattr(port, "like", None)
        meaning = _meaning(found.cls.inputs()[like]) if like and not _meaning(port) else _meaning(port)
        for node in base.nodes:
            for theirs, other in node.type.cls.inputs().items():
                now = {str(end) for end in node.inputs.get(theirs, ())}
                instead = bool(now & taken)
                if (instead if meaning == "any" else _meaning(other) == meaning) and _has_effect(base, node, theirs):
                    ranked.append(((not instead, bool(now), rank), (node.id, theirs, name)))
    return (reader for _, reader in sorted(ranked, key=lambda entry: entry[0]))


def _has_effect(base: Graph, node: GraphNode, name: str) -> bool:
    """Whether somebody uses what the node makes of an input: some are needed by one of the outputs only."""
    wanted = {data["source_port"] for _, _, data in base.dag.out_edges(node.id, data=True)}
    wanted |= {end.port for end in base.outputs.values() if end.node == node.id}
    needy = {out for out, port in node.type.cls.outputs().items() if name in getattr(port, "needs", ())}
    return not needy or bool(needy & wanted)


def _text(found: NodeType, base: Graph, links: Links, reader: tuple[str, str, str] | None) -> str:
    id_ = found.word if all(node.id != found.word for node in base.nodes) else "example"
    inputs = f", inputs: {_flow(links)}" if links else ""
    lines = [f"extends: {base.name}", "nodes:", f"  {id_}: {{type: {found.name}{inputs}}}"]
    through = _through(found, base, links)
    outputs = {name: f"{id_}.{out}" for name, out in through.items()}
    if reader is not None:
        node, port, out = reader
        lines.append(f"  {node}: {{inputs: {_flow({port: f'{id_}.{out}'})}}}")
    else:
        others = {name: port for name, port in found.cls.outputs().items() if name not in through.values()}
        outputs |= {name: f"{id_}.{name}" for name, port in others.items() if _shows(port) and name not in outputs}
    return "\n".join([*lines, *([f"outputs: {_flow(outputs)}"] if outputs else [])]) + "\n"


def _through(found: NodeType, base: Graph, links: Links) -> Links:
    """Outputs of the base that the node changes, and as which of its own they leave it."""
    changed: Links = {}
    ports = {name: port for name, port in found.cls.outputs().items() if _shows(port)}
    for name, end in base.outputs.items():
        taken = [ours for ours, theirs in links.items() if theirs == str(end)]
        like = [out for out, port in ports.items() if out in taken or getattr(port, "like", None) in taken]
        means = base.textures[end].semantic.name if end in base.textures else ""
        alike = [out for out, port in ports.items() if taken and _meaning(port) == means]
        if like or alike:
            changed[name] = (like or alike)[0]
    return changed


def _shows(port: Port) -> bool:
    return not isinstance(port, Function) and str(getattr(port, "kind", "")).startswith("texture")


def _flow(table: Mapping[str, str]) -> str:
    return "{" + ", ".join(f"{key}: {value}" for key, value in table.items()) + "}"
