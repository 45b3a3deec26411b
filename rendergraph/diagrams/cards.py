"""What every view of a graph shows of a node: its ports with what they carry, and the links between them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby

from rendergraph.declare import Function, InOut, Input, Port, TextureInfo, Views
from rendergraph.link import Endpoint, Graph
from rendergraph.textures import TextureDesc


@dataclass(frozen=True)
class Socket:
    """One port of a card.

    Attributes:
        name: the port's.
        kind: `texture2d`, `function`, …
        semantic: what it means; the signature's name for a function.
        carries: format and size in short, empty for an input.
        used: whether something is linked to it, or it is one of the pipeline's outputs.
    """

    name: str
    kind: str
    semantic: str
    carries: str = ""
    used: bool = True


@dataclass(frozen=True)
class Card:
    """One node as it is drawn.

    Attributes:
        id: the node's id.
        type: its type's name.
        inputs: connected inputs.
        outputs: everything it offers.
        notes: lines beneath the ports.
        unknown: nobody has the type.
    """

    id: str
    type: str
    inputs: tuple[Socket, ...]
    outputs: tuple[Socket, ...]
    notes: tuple[str, ...] = ()
    unknown: bool = False

    @property
    def kind(self) -> str:
        """The type as it is shown."""
        return f"{self.type} (unknown)" if self.unknown else self.type


@dataclass(frozen=True)
class Link:
    """From an output to an input; `previous` carries last frame's value."""

    source: str
    source_port: str
    target: str
    target_port: str
    previous: bool = False


def describe(desc: TextureDesc) -> str:
    """A texture in short: `rgba16f 1280×720`, with layers, mips and samples where there are several."""
    text = f"{desc.format} {desc.width}×{desc.height}"
    if desc.kind == "texture_cube":
        text += " cube"
    elif desc.kind == "texture2d_array":
        text += f" {desc.layers} layer{'s' if desc.layers != 1 else ''}"
    if desc.mips > 1:
        text += f" {desc.mips} mips"
    if desc.samples > 1:
        text += f" {desc.samples} samples"
    return text


def info_of(graph: Graph, node: str, port: str) -> TextureInfo | None:
    """What a port carries; a continued texture is its source's."""
    seen: set[tuple[str, str]] = set()
    while (node, port) not in seen:
        seen.add((node, port))
        info = graph.textures.get(Endpoint(node, port))
        if info is not None:
            return info
        links = graph[node].inputs.get(port, ())
        if not links:
            return None
        node, port = links[0].node, links[0].port
    return None


def cards(graph: Graph) -> list[Card]:
    """A card for every node, in the file's order."""
    used = {(link.source, link.source_port) for link in links(graph)}
    used |= {(end.node, end.port) for end in graph.outputs.values()}
    return [
        Card(
            node.id,
            node.type.name,
            tuple(_input(graph, node.id, name, node.node.inputs()[name]) for name in node.inputs),
            tuple(
                _output(graph, node.id, name, port, (node.id, name) in used)
                for name, port in node.node.outputs().items()
                if not isinstance(port, InOut) or node.inputs.get(name) or (node.id, name) in used
            ),
            unknown=node.type.missing,
        )
        for node in graph.nodes
    ]


def links(graph: Graph) -> list[Link]:
    """Every link, in the order of nodes and ports."""
    return [
        Link(end.node, end.port, node.id, port, end.previous)
        for node in graph.nodes
        for port, ends in node.inputs.items()
        for end in ends
    ]


def generations(nodes: Sequence[str], found: Sequence[Link]) -> list[list[str]]:
    """Node ids in layers: everything a node waits for lies in layers before its own."""
    import networkx as nx  # takes longer than checking a pipeline

    dag: nx.DiGraph[str] = nx.DiGraph()
    dag.add_nodes_from(nodes)
    dag.add_edges_from((link.source, link.target) for link in found if not link.previous)
    place = {node: number for number, node in enumerate(nodes)}
    return [sorted(layer, key=place.__getitem__) for layer in nx.topological_generations(dag)]


def link_counts(found: list[Link]) -> dict[tuple[str, str, bool], list[Link]]:
    """Links between the same two nodes together: source, target and whether they carry last frame's value."""

    def key(link: Link) -> tuple[str, str, bool]:
        return link.source, link.target, link.previous

    return {pair: list(group) for pair, group in groupby(sorted(found, key=key), key)}


def _input(graph: Graph, node: str, name: str, port: Port) -> Socket:
    info = info_of(graph, graph[node].inputs[name][0].node, graph[node].inputs[name][0].port)
    kind, semantic = _meaning(port, info)
    return Socket(name, kind, semantic)


def _output(graph: Graph, node: str, name: str, port: Port, used: bool) -> Socket:
    info = info_of(graph, node, name)
    kind, semantic = _meaning(port, info)
    carries = ""
    if isinstance(port, Function):
        carries = f"function {port.signature.name}"
    elif isinstance(port, Views):
        carries = "view"
    elif info is not None and info.desc is not None:
        carries = describe(info.desc) if info.desc.layers else "no layers"
    elif info is not None and info.bytes:
        carries = f"buffer {info.bytes} B"
    return Socket(name, kind, semantic, carries, used)


def _meaning(port: Port, info: TextureInfo | None) -> tuple[str, str]:
    if isinstance(port, Function):
        return "function", port.signature.name
    if isinstance(port, Input) and port.kind == "function":
        return "function", port.semantic.name
    if isinstance(port, Views):
        return "view", "view"
    kind = getattr(port, "kind", "texture2d")
    if info is None:
        semantic = getattr(port, "semantic", None)
        return kind, semantic.name if semantic is not None else "any"
    return (info.desc.kind if info.desc else kind), info.semantic.name
