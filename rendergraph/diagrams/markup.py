"""A graph as text for terminals, DOT, Mermaid and JSON."""

from __future__ import annotations

from html import escape
from itertools import groupby
from typing import Any

from msgspec import to_builtins

from rendergraph.diagrams.cards import Card, Link, cards, info_of, links
from rendergraph.formatting import table
from rendergraph.link import Graph
from rendergraph.textures import TextureDesc


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
    # In a DOT string a backslash starts an escape even where it precedes no quote.
    return '"' + word.replace("\\", "\\\\").replace('"', '\\"').replace("\n", "\\n") + '"'


def _dot_table(card: Card) -> str:
    cells = [f'<tr><td bgcolor="#dfe4ea" align="left"><b>{escape(card.id)}</b>  {escape(card.kind)}</td></tr>']
    for socket in card.outputs:
        carries = f'<font color="#57606a">{escape(socket.carries)}</font>  ' if socket.carries else ""
        cells.append(
            f'<tr><td port="{escape("out " + socket.name)}" align="right">{carries}{escape(socket.name)}</td></tr>'
        )
    for socket in card.inputs:
        cells.append(f'<tr><td port="{escape("in " + socket.name)}" align="left">{escape(socket.name)}</td></tr>')
    return f'<table border="1" color="#7d8590" cellborder="0" cellspacing="0" cellpadding="4">{"".join(cells)}</table>'


def mermaid(graph: Graph) -> str:
    """Return the graph as a Mermaid flowchart; links between the same nodes are one arrow with all ports on it."""
    number = {node.id: place for place, node in enumerate(graph.nodes)}  # ids such as `end` are words of the language
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
        "links": to_builtins(links(graph)),
        "outputs": {name: str(end) for name, end in graph.outputs.items()},
    }


def _node_json(graph: Graph, card: Card) -> dict[str, Any]:
    outputs: dict[str, Any] = {}
    for socket in card.outputs:
        info = info_of(graph, card.id, socket.name)
        found: dict[str, Any] = {"kind": socket.kind, "semantic": socket.semantic, "used": socket.used}
        if info is not None and info.desc is not None:
            found |= texture_json(info.desc)
            found |= {"bytes": info.desc.bytes, "view": info.view, "lights": list(info.lights)}
        elif info is not None and info.bytes:
            found["bytes"] = info.bytes
        outputs[socket.name] = found
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
