"""A graph as cards with ports, for all diagrams, and as text for terminals, DOT, Mermaid and JSON."""

from __future__ import annotations

from collections.abc import Iterable
from html import escape
from itertools import groupby
from typing import Any

from msgspec import Struct, to_builtins

from rendergraph.declare import Function, InOut, Input, Port, TextureInfo, Views
from rendergraph.formatting import table
from rendergraph.link import Endpoint, Graph
from rendergraph.textures import TextureDesc


class Socket(Struct, frozen=True):
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
        return f"{self.type} (unknown)" if self.unknown else self.type


class Link(Struct, frozen=True):
    """From an output to an input; `previous` carries last frame's value, and `back` closes a cycle of nodes."""

    source: str
    source_port: str
    target: str
    target_port: str
    previous: bool = False
    back: bool = False


def format_texture(desc: TextureDesc) -> str:
    """Return `rgba16f 1280×720`, with layers, mips and samples if there are several."""
    several = f" {desc.layers} layer{'s' if desc.layers != 1 else ''}"
    layers = {"texture_cube": " cube", "texture3d": f"×{desc.layers}", "texture2d_array": several}.get(desc.kind, "")
    mips = f" {desc.mips} mips" if desc.mips > 1 else ""
    samples = f" {desc.samples} samples" if desc.samples > 1 else ""
    return f"{desc.format} {desc.width}×{desc.height}{layers}{mips}{samples}"


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
    place = {id: at for at, id in enumerate(graph.reading_order())} if graph.cyclic else {}
    return [
        Link(end.node, end.port, node.id, port, end.previous, bool(place and place[end.node] >= place[node.id]))
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


def text(graph: Graph) -> str:
    """Return the nodes in reading order with their inputs (←) and outputs (→), for a terminal."""
    width, height = graph.size
    card_of = {card.id: card for card in cards(graph)}
    rows: list[tuple[str, ...]] = [(graph.name, f"{width}×{height}")]
    for id in graph.reading_order():
        card = card_of[id]
        rows += [("",), (f"  {id}", card.kind)]
        rows += [(f"    ← {name}", str(end)) for name, ends in graph[id].inputs.items() for end in ends]
        for socket in card.outputs:
            facts = (socket.carries or socket.semantic) + ("" if socket.used else "  (unused)")
            rows.append((f"    → {socket.name}", facts))
    rows += [("",), ("  outputs",)] if graph.outputs else []
    rows += [(f"    {name}", str(end)) for name, end in graph.outputs.items()]
    return table(rows) + "\n"


def dot(graph: Graph) -> str:
    """Return the graph in Graphviz's language, ports as cells of a table."""
    lines = [
        f"digraph {_dot(graph.name)} {{",
        "  rankdir=LR;",
        '  node [shape=plaintext, fontname="Helvetica", fontsize=11];',
        '  edge [color="#7d8590", arrowsize=0.7];',
    ]
    for card in cards(graph):
        lines.append(f"  {_dot(card.id)} [label=<{_dot_table(card)}>];")
    for name, end in graph.outputs.items():
        lines.append(f"  {_dot('output ' + name)} [shape=box, style=rounded, label={_dot(name)}];")
        lines.append(f"  {_dot(end.node)}:{_dot('out ' + end.port)}:e -> {_dot('output ' + name)};")
    for link in links(graph):
        style = ' [style=dashed, constraint=false, label="previous"]' if link.previous else ""
        source = f"{_dot(link.source)}:{_dot('out ' + link.source_port)}:e"
        lines.append(f"  {source} -> {_dot(link.target)}:{_dot('in ' + link.target_port)}:w{style};")
    return "\n".join([*lines, "}"]) + "\n"


def _dot(word: str) -> str:
    # In a DOT string a backslash always starts an escape.
    return '"' + word.replace("\\", "\\\\").replace('"', '\\"').replace("\n", "\\n") + '"'


def _dot_table(card: Card) -> str:
    cells = [f'<tr><td bgcolor="#dfe4ea" align="left"><b>{escape(card.id)}</b>  {escape(card.kind)}</td></tr>']
    for socket in card.outputs:
        carries = f'<font color="#57606a">{escape(socket.carries)}</font>  ' if socket.carries else ""
        name = escape(socket.name)
        cells.append(f'<tr><td port="out {name}" align="right">{carries}{name}</td></tr>')
    for socket in card.inputs:
        name = escape(socket.name)
        cells.append(f'<tr><td port="in {name}" align="left">{name}</td></tr>')
    return f'<table border="1" color="#7d8590" cellborder="0" cellspacing="0" cellpadding="4">{"".join(cells)}</table>'


def mermaid(graph: Graph) -> str:
    """Return the graph as a Mermaid flowchart; links between the same nodes are one arrow with all ports on it."""
    number = {node.id: place for place, node in enumerate(graph.nodes)}  # ids such as `end` are keywords of Mermaid
    lines = ["flowchart LR"]
    for card in cards(graph):
        lines.append(f'  n{number[card.id]}["<b>{_mermaid(card.id)}</b><br/>{_mermaid(card.kind)}"]')
    for place, (name, end) in enumerate(graph.outputs.items()):
        lines.append(f'  o{place}(["{_mermaid(name)}"])')
        lines.append(f'  n{number[end.node]} -->|"{_mermaid(end.port)}"| o{place}')

    def ends(link: Link) -> tuple[int, int, bool]:
        return number[link.source], number[link.target], link.previous

    for (source, target, previous), group in groupby(sorted(links(graph), key=ends), ends):
        ports = dict.fromkeys(
            link.source_port if link.source_port == link.target_port else f"{link.source_port} → {link.target_port}"
            for link in group
        )
        label = "<br/>".join(map(_mermaid, ports))
        lines.append(f'  n{source} {"-.->" if previous else "-->"}|"{label}"| n{target}')
    return "\n".join(lines) + "\n"


def _mermaid(word: str) -> str:
    # Mermaid's entities are `#` and the code point; everything that may have a meaning in Mermaid or HTML is escaped.
    return "".join(c if c.isalnum() or c in " _-.,/→×" else f"#{ord(c)};" for c in word)


def svg_document(width: float, height: float, parts: Iterable[str]) -> str:
    font = "ui-monospace,'DejaVu Sans Mono',Menlo,Consolas,monospace"
    size = f'viewBox="0 0 {width:.0f} {height:.0f}" width="{width:.0f}" height="{height:.0f}"'
    head = f'<svg xmlns="http://www.w3.org/2000/svg" {size} font-family="{font}" font-size="11">'
    return "\n".join([head, *parts, "</svg>"]) + "\n"


def element(name: str, content: str | None = None, /, **attributes: object) -> str:
    """Return an element of SVG with markup in it; lengths have one decimal, and None leaves an attribute out."""
    given = {key.rstrip("_").replace("_", "-"): value for key, value in attributes.items() if value is not None}
    texts = [f'{key}="{value:.1f}"' if isinstance(value, float) else f'{key}="{value}"' for key, value in given.items()]
    head = " ".join([name, *texts])
    return f"<{head}/>" if content is None else f"<{head}>{content}</{name}>"


def title(text: str) -> str:
    return f"<title>{escape(text)}</title>"


def texture_json(desc: TextureDesc) -> dict[str, Any]:
    return {
        "format": desc.format,
        "size": [desc.width, desc.height],
        "layers": desc.layers,
        "mips": desc.mips,
        "samples": desc.samples,
    }


def graph_json(graph: Graph) -> dict[str, Any]:
    """Return the graph as plain JSON values: `nodes`, `links`, `outputs`."""
    return {
        "name": graph.name,
        "size": list(graph.size),
        "nodes": [_node_json(graph, card) for card in cards(graph)],
        "links": [{key: value for key, value in link.items() if key != "back"} for link in to_builtins(links(graph))],
        "outputs": {name: str(end) for name, end in graph.outputs.items()},
    }


def _node_json(graph: Graph, card: Card) -> dict[str, Any]:
    outputs: dict[str, Any] = {}
    for socket in card.outputs:
        info = info_of(graph, card.id, socket.name)
        facts: dict[str, Any] = {"kind": socket.kind, "semantic": socket.semantic, "used": socket.used}
        if info is not None and info.desc is not None:
            facts |= texture_json(info.desc)
            facts |= {"bytes": info.desc.bytes, "view": info.view, "lights": list(info.lights)}
        elif info is not None and info.bytes:
            facts["bytes"] = info.bytes
        outputs[socket.name] = facts
    node = graph[card.id]
    return {
        "id": card.id,
        "type": card.type,
        "unknown": card.unknown,
        "family": node.type.family,
        "inputs": {name: [str(end) for end in ends] for name, ends in node.inputs.items()},
        "outputs": outputs,
        "parameters": dict(node.node),
    }
