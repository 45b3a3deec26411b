"""A difference for a terminal, for a program, and as a picture."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import asdict, replace
from html import escape
from typing import Any, Literal

from rendergraph.diagrams import Card, Link, Mark, Sheet, draw, sheet
from rendergraph.diff.structure import GraphDiff, PlanFigures, value_text
from rendergraph.formatting import format_bytes
from rendergraph.link import Graph

# Each at least 3:1 against white and against near-black; the signs carry it for those who cannot tell them apart.
ADDED, REMOVED, CHANGED, RENAMED = "#2c9163", "#d0453e", "#b7791f", "#3b7dd8"
_LEGEND = 34.0
_STYLE = """
.word{fill:#57606a}
@media (prefers-color-scheme:dark){.word{fill:#9aa4af}}
"""


def diff_text(difference: GraphDiff, plans: tuple[PlanFigures, PlanFigures] | None = None) -> str:
    """The difference in lines that begin with `+`, `-` or `~`, then what it does to the plan."""
    old, new = difference.names
    lines = [f"{old} → {new}"]
    lines += [f"  - {node}{_disabled(node, difference)}" for node in difference.removed]
    lines += [f"  + {node}{_disabled(node, difference)}" for node in difference.added]
    lines += [f"  ~ {was} is called {now}" for was, now in difference.renamed.items()]
    lines += [f"  ~ {change.node}: {change}" for change in difference.retyped]
    lines += [
        f"  ~ {change.node}.{change.name}: {value_text(change.old)} → {value_text(change.new)}"
        for change in difference.parameters
    ]
    lines += [
        f"  ~ {change.node}.{change.port}: {_ends(change.old)} → {_ends(change.new)}" for change in difference.links
    ]
    lines += [
        f"  ~ output {change.name}: {change.old or 'none'} → {change.new or 'none'}" for change in difference.outputs
    ]
    if difference.sizes is not None:
        a, b = difference.sizes
        lines.append(f"  ~ size {a[0]}×{a[1]} → {b[0]}×{b[1]}")
    if not difference:
        lines.append("  no difference")
    if plans is not None:
        lines += ["", "plan", *_plan_lines(plans)]
    return "\n".join(lines) + "\n"


def _disabled(node: str, difference: GraphDiff) -> str:
    return f" (disabled in {difference.names[node in difference.removed]})" if node in difference.disabled else ""


def _ends(ends: Sequence[str]) -> str:
    return ", ".join(ends) or "nothing"


def _plan_lines(plans: tuple[PlanFigures, PlanFigures]) -> list[str]:
    a, b = plans
    rows = [
        ("passes", str(a.passes), str(b.passes), _count(b.passes - a.passes)),
        ("steps", str(a.steps), str(b.steps), _count(b.steps - a.steps)),
        _bytes_row("allocated", a.allocated_bytes, b.allocated_bytes),
        _bytes_row("no reuse", a.no_reuse_bytes, b.no_reuse_bytes),
        _bytes_row("peak", a.peak_bytes, b.peak_bytes),
        ("peak at", a.peak_node or "–", b.peak_node or "–", ""),
    ]
    widths = [max(len(row[column]) for row in rows) for column in range(3)]
    return [
        f"  {name:{widths[0]}}  {was:>{widths[1]}} → {now:>{widths[2]}}  {change}".rstrip()
        for name, was, now, change in rows
    ]


def _count(change: int) -> str:
    return f"{change:+d}" if change else "="


def _bytes_row(name: str, was: int, now: int) -> tuple[str, str, str, str]:
    change = now - was
    sign = "+" if change > 0 else "−"
    return name, format_bytes(was), format_bytes(now), f"{sign}{format_bytes(abs(change))}" if change else "="


def diff_json(difference: GraphDiff, plans: tuple[PlanFigures, PlanFigures] | None = None) -> dict[str, Any]:
    """The difference as plain JSON values."""
    found: dict[str, Any] = {
        "a": difference.names[0],
        "b": difference.names[1],
        "equal": not difference,
        "added": list(difference.added),
        "removed": list(difference.removed),
        "disabled": list(difference.disabled),
        "renamed": dict(difference.renamed),
        "retyped": [asdict(change) for change in difference.retyped],
        "parameters": [asdict(change) for change in difference.parameters],
        "links": [{"node": c.node, "port": c.port, "old": list(c.old), "new": list(c.new)} for c in difference.links],
        "outputs": [asdict(change) for change in difference.outputs],
        "sizes": None if difference.sizes is None else [list(size) for size in difference.sizes],
    }
    if plans is not None:
        found["plan"] = {"a": asdict(plans[0]), "b": asdict(plans[1])}
    return found


# --- the picture -----------------------------------------------------------------------------------------------------


def diff_svg(a: Graph, b: Graph, difference: GraphDiff) -> str:
    """The second graph with what only the first one has, differences in colour, as a stand-alone SVG document."""
    shown, marks, pointed = _both(a, b, difference)
    picture = draw(shown, marks, pointed)
    wide, tall = _size(picture)
    width, height = max(wide, 620.0), tall + _LEGEND
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width:.0f} {height:.0f}" width="{width:.0f}" '
        f'height="{height:.0f}" font-family="system-ui,\'DejaVu Sans\',sans-serif" font-size="12">',
        f"<title>{escape(a.name)} and {escape(b.name)}</title>",
        f"<style>{_STYLE}</style>",
        picture.rstrip(),
        _legend(tall),
    ]
    return "\n".join([*parts, "</svg>"]) + "\n"


def _both(a: Graph, b: Graph, difference: GraphDiff) -> tuple[Sheet, dict[str, Mark], dict[Link, str]]:
    """Both graphs as one, nodes and links that only one of them has marked."""
    old, new = sheet(a), sheet(b)
    names = {node.id: difference.nodes.get(node.id, node.id) for node in a.nodes}
    for node in difference.removed:
        while names[node] in b:
            names[node] += "′"
    table = {card.id: card for card in new.cards}
    table |= {names[card.id]: replace(card, id=names[card.id]) for card in old.cards if card.id in difference.removed}
    was = [replace(link, source=names[link.source], target=names[link.target]) for link in old.links]
    sockets = {names[card.id]: card for card in old.cards}
    removed = [_backwards(link, new.links) for link in was if link not in new.links]
    for link in removed:  # a node of another type may lack the port that was linked
        table[link.source] = _with(table[link.source], "outputs", link.source_port, sockets[link.source])
        table[link.target] = _with(table[link.target], "inputs", link.target_port, sockets[link.target])
    pointed = {link: ADDED for link in new.links if link not in was} | dict.fromkeys(removed, f"-{REMOVED}")
    marks = {new: Mark(RENAMED, (f"was {old}",)) for old, new in difference.renamed.items()}
    marks |= {change.node: Mark(CHANGED) for change in difference.links if change.node in table}
    marks |= {node: Mark(CHANGED, tuple(notes)) for node, notes in difference.changed(links=False).items()}
    marks |= {node: Mark(ADDED, ("+ added",)) for node in difference.added}
    for node in difference.removed:
        marks[names[node]] = Mark(REMOVED, ("− disabled" if node in difference.disabled else "− removed",))
    return Sheet(new.title, list(table.values()), [*new.links, *removed], new.outputs), marks, pointed


def _backwards(link: Link, kept: Sequence[Link]) -> Link:
    """A link of the first graph, drawn as one that leads back where the second has its ends the other way round."""
    reached, waiting = {link.target}, [link.target]
    while waiting:
        at = waiting.pop()
        following = {other.target for other in kept if other.source == at and not other.previous} - reached
        reached |= following
        waiting += following
    return replace(link, previous=link.previous or link.source in reached)


def _with(card: Card, side: Literal["inputs", "outputs"], port: str, old: Card) -> Card:
    """A card that has the socket too."""
    if any(socket.name == port for socket in getattr(card, side)):
        return card
    more = tuple(socket for socket in getattr(old, side) if socket.name == port)
    if side == "inputs":
        return replace(card, inputs=(*card.inputs, *more))
    return replace(card, outputs=(*card.outputs, *more))


def _size(picture: str) -> tuple[float, float]:
    found = re.search(r'viewBox="0 0 (\d+) (\d+)"', picture)
    assert found
    return float(found[1]), float(found[2])


def _legend(y: float) -> str:
    parts, x = [], 24.0
    for hue, word in ((ADDED, "+ added"), (REMOVED, "− removed"), (CHANGED, "~ changed"), (RENAMED, "→ renamed")):
        parts.append(f'<rect x="{x:.0f}" y="{y + 6:.0f}" width="14" height="14" rx="3" fill="{hue}"/>')
        parts.append(f'<text class="word" x="{x + 20:.0f}" y="{y + 17:.0f}">{word}</text>')
        x += 120
    return "\n".join(parts)
