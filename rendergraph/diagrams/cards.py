"""What every diagram of a graph shows of a node: its ports with what they carry, and the links between them."""

from __future__ import annotations

from msgspec import Struct

from rendergraph.declare import Function, InOut, Input, Port, TextureInfo, Views
from rendergraph.link import Endpoint, Graph
from rendergraph.textures import TextureDesc


class Socket(Struct, frozen=True):
    """One port of a card."""

    name: str
    kind: str  # `texture2d`, `function`, …
    semantic: str  # the signature's name for a function
    carries: str = ""  # format and size of an output
    used: bool = True  # it is linked, or an output of the pipeline


class Card(Struct, frozen=True):
    """One node: its connected inputs and all outputs. A card without type is an output of the pipeline."""

    id: str
    type: str
    inputs: tuple[Socket, ...]
    outputs: tuple[Socket, ...]
    notes: tuple[str, ...] = ()  # lines beneath the ports
    unknown: bool = False  # no such type is installed

    @property
    def kind(self) -> str:
        """The type as it is shown."""
        return f"{self.type} (unknown)" if self.unknown else self.type


class Link(Struct, frozen=True):
    """From an output to an input; `previous` carries last frame's value."""

    source: str
    source_port: str
    target: str
    target_port: str
    previous: bool = False


def format_texture(desc: TextureDesc) -> str:
    """Return `rgba16f 1280×720`, with layers, mips and samples where there are several."""
    text = f"{desc.format} {desc.width}×{desc.height}"
    if desc.kind == "texture_cube":
        text += " cube"
    elif desc.kind == "texture3d":
        text += f"×{desc.layers}"
    elif desc.kind == "texture2d_array":
        text += f" {desc.layers} layer{'s' if desc.layers != 1 else ''}"
    if desc.mips > 1:
        text += f" {desc.mips} mips"
    if desc.samples > 1:
        text += f" {desc.samples} samples"
    return text


def info_of(graph: Graph, node: str, port: str) -> TextureInfo | None:
    """Return what a port carries; a port that continues a texture carries its source's."""
    visited: set[tuple[str, str]] = set()
    while (node, port) not in visited:
        visited.add((node, port))
        info = graph.textures.get(Endpoint(node, port))
        links = graph[node].inputs.get(port, ())
        if info is not None or not links:
            return info
        node, port = links[0].node, links[0].port
    return None


def cards(graph: Graph) -> list[Card]:
    """Return a card for every node, in the file's order."""
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
    """Return every link, in the order of nodes and ports."""
    return [
        Link(end.node, end.port, node.id, port, end.previous)
        for node in graph.nodes
        for port, ends in node.inputs.items()
        for end in ends
    ]


def _input(graph: Graph, node: str, name: str, port: Port) -> Socket:
    end = graph[node].inputs[name][0]
    return Socket(name, *_meaning(port, info_of(graph, end.node, end.port)))


def _output(graph: Graph, node: str, name: str, port: Port, used: bool) -> Socket:
    info = info_of(graph, node, name)
    carries = ""
    if isinstance(port, Function):
        carries = f"function {port.signature.name}"
    elif isinstance(port, Views):
        carries = "view"
    elif info is not None and info.desc is not None:
        carries = format_texture(info.desc) if info.desc.layers else "no layers"
    elif info is not None and info.bytes:
        carries = f"buffer {info.bytes} B"
    return Socket(name, *_meaning(port, info), carries, used)


def _meaning(port: Port, info: TextureInfo | None) -> tuple[str, str]:
    """Kind and semantic."""
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
