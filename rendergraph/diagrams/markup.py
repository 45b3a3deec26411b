"""A graph as text for terminals, DOT, Mermaid and JSON."""

from __future__ import annotations

from html import escape
from typing import Any

from rendergraph.diagrams.cards import Card, cards, info_of, link_counts, links
from rendergraph.link import Graph


def text(graph: Graph) -> str:
    """Nodes in reading order with what they take (←) and make (→), for a terminal."""
    width, height = graph.size
    table = {card.id: card for card in cards(graph)}
    rows: list[tuple[str, str, str]] = [(graph.name, f"{width}×{height}", "")]
    for id in graph.reading_order():
        card = table[id]
        rows += [("", "", ""), (f"  {id}", card.kind, "")]
        for name, ends in graph[id].inputs.items():
            rows += [(f"    ← {name}", str(end), "") for end in ends]
        for socket in card.outputs:
            rows.append((f"    → {socket.name}", socket.carries or socket.semantic, "" if socket.used else "(unused)"))
    rows += [("", "", ""), ("  outputs", "", "")] if graph.outputs else []
    rows += [(f"    {name}", str(end), "") for name, end in graph.outputs.items()]
    column = max(len(first) for first, _, _ in rows) + 2
    return "".join(f"{first:{column}}{second}  {third}".rstrip() + "\n" for first, second, third in rows)


def dot(graph: Graph) -> str:
    """The graph in Graphviz's language, ports as cells of a table."""
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
    # In a DOT string a backslash starts an escape of its own even where it is no quote's.
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
    """The graph as a Mermaid flowchart; links between the same nodes are one arrow with all ports on it."""
    found = cards(graph)
    number = {card.id: f"n{place}" for place, card in enumerate(found)}  # ids such as `end` are words of the language
    lines = ["flowchart LR"]
    for card in found:
        lines.append(f'  {number[card.id]}["<b>{_mermaid(card.id)}</b><br/>{_mermaid(card.kind)}"]')
    for place, (name, end) in enumerate(graph.outputs.items()):
        lines.append(f'  o{place}(["{_mermaid(name)}"])')
        lines.append(f'  {number[end.node]} -->|"{_mermaid(end.port)}"| o{place}')
    pairs = link_counts(links(graph))
    place_of = {card.id: place for place, card in enumerate(found)}
    for source, target, previous in sorted(pairs, key=lambda pair: (place_of[pair[0]], place_of[pair[1]], pair[2])):
        group = pairs[source, target, previous]
        ports = dict.fromkeys(
            link.source_port if link.source_port == link.target_port else f"{link.source_port} → {link.target_port}"
            for link in group
        )
        label = "<br/>".join(_mermaid(port) for port in ports)
        lines.append(f'  {number[source]} {"-.->" if previous else "-->"}|"{label}"| {number[target]}')
    return "\n".join(lines) + "\n"


def _mermaid(word: str) -> str:
    # Mermaid's own entities: `#` and the code point. Everything that could mean something to it or to HTML goes.
    return "".join(c if c.isalnum() or c in " _-.,/→×" else f"#{ord(c)};" for c in word)


def graph_json(graph: Graph) -> dict[str, Any]:
    """The graph as plain JSON values: `nodes`, `links`, `outputs`."""
    nodes = []
    for card in cards(graph):
        node = graph[card.id]
        outputs: dict[str, Any] = {}
        for socket in card.outputs:
            info = info_of(graph, card.id, socket.name)
            made: dict[str, Any] = {"kind": socket.kind, "semantic": socket.semantic, "used": socket.used}
            if info is not None and info.desc is not None:
                desc = info.desc
                made |= {
                    "format": desc.format,
                    "size": [desc.width, desc.height],
                    "layers": desc.layers,
                    "mips": desc.mips,
                    "samples": desc.samples,
                    "bytes": desc.bytes,
                    "view": info.view,
                    "lights": list(info.lights),
                }
            elif info is not None and info.bytes:
                made["bytes"] = info.bytes
            outputs[socket.name] = made
        nodes.append(
            {
                "id": card.id,
                "type": card.type,
                "unknown": card.unknown,
                "family": node.type.family,
                "inputs": {name: [str(end) for end in ends] for name, ends in node.inputs.items()},
                "outputs": outputs,
                "parameters": dict(node.node),
            }
        )
    return {
        "name": graph.name,
        "size": list(graph.size),
        "nodes": nodes,
        "links": [
            {
                "source": link.source,
                "source_port": link.source_port,
                "target": link.target,
                "target_port": link.target_port,
                "previous": link.previous,
            }
            for link in links(graph)
        ],
        "outputs": {name: str(end) for name, end in graph.outputs.items()},
    }
