"""A difference as text, as JSON and as a picture."""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Sequence
from html import escape
from typing import Any

from msgspec import to_builtins
from msgspec.structs import asdict, replace

from rendergraph.diagrams import Link, Mark, Sheet, draw, sheet
from rendergraph.diff.structure import GraphDiff, PlanFigures
from rendergraph.formatting import format_bytes, format_value, jsonable, table
from rendergraph.link import Graph
from rendergraph.link.graph import depth_first

Plans = tuple[PlanFigures, PlanFigures]

# Each at least 3:1 against white and against near-black; the signs carry it for people who cannot tell them apart.
ADDED, REMOVED, CHANGED, RENAMED = "#2c9163", "#d0453e", "#b7791f", "#3b7dd8"
_LEGEND = 34.0
_STYLE = """
.word{fill:#57606a}
@media (prefers-color-scheme:dark){.word{fill:#9aa4af}}
"""


def diff_text(difference: GraphDiff, plans: Plans | None = None) -> str:
    """Return the difference in lines that begin with `+`, `-` or `~`, then the effect on the plan."""
    old, new = difference.names
    disabled = {id: f" (disabled in {new if id in difference.removed else old})" for id in difference.disabled}
    lines = [f"{old} → {new}"]
    lines += [f"  - {node}{disabled.get(node, '')}" for node in difference.removed]
    lines += [f"  + {node}{disabled.get(node, '')}" for node in difference.added]
    lines += [f"  ~ {was} is called {now}" for was, now in difference.renamed.items()]
    lines += [f"  ~ {change.node}: {change}" for change in difference.retyped]
    changes: list[tuple[str, str, str]] = [
        *((f"{one.node}.{one.name}", format_value(one.old), format_value(one.new)) for one in difference.parameters),
        *((f"{one.node}.{one.port}", _ends(one.old), _ends(one.new)) for one in difference.links),
        *((f"output {one.name}", one.old or "none", one.new or "none") for one in difference.outputs),
    ]
    lines += [f"  ~ {name}: {was} → {now}" for name, was, now in changes]
    if difference.sizes is not None:
        lines.append("  ~ size " + " → ".join(f"{width}×{height}" for width, height in difference.sizes))
    if not difference:
        lines.append("  no difference")
    if plans is not None:
        lines += ["", "plan", _plan_text(*plans)]
    return "\n".join(lines) + "\n"


def _ends(ends: Sequence[str]) -> str:
    return ", ".join(ends) or "nothing"


def _plan_text(a: PlanFigures, b: PlanFigures) -> str:
    rows = []
    for name in ("passes", "steps", "allocated_bytes", "no_reuse_bytes", "peak_bytes"):
        was, now = getattr(a, name), getattr(b, name)
        change = now - was
        if name.endswith("_bytes"):
            texts = format_bytes(was), format_bytes(now), f"{'+' if change > 0 else '−'}{format_bytes(abs(change))}"
        else:
            texts = str(was), str(now), f"{change:+d}"
        rows.append((name.removesuffix("_bytes").replace("_", " "), *texts[:2], texts[2] if change else "="))
    rows.append(("peak at", a.peak_node or "–", b.peak_node or "–", ""))
    left, right = (max(len(row[column]) for row in rows) for column in (1, 2))
    return table([(f"  {name}", f"{was:>{left}} → {now:>{right}}", change) for name, was, now, change in rows])


def diff_json(difference: GraphDiff, plans: Plans | None = None) -> dict[str, Any]:
    fields = asdict(difference)
    a, b = fields.pop("names")
    del fields["nodes"]
    found = {"a": a, "b": b, "equal": not difference, **fields}
    if plans is not None:
        found["plan"] = {"a": plans[0], "b": plans[1]}
    result: dict[str, Any] = jsonable(to_builtins(found))  # with lists for tuples
    return result


# --- the picture -----------------------------------------------------------------------------------------------------


def diff_svg(a: Graph, b: Graph, difference: GraphDiff) -> str:
    """Return the second graph with the removed parts of the first, differences in colour, as an SVG document."""
    picture = draw(*_both(a, b, difference))
    size = re.search(r'viewBox="0 0 (\d+) (\d+)"', picture)
    assert size
    tall = float(size[2])
    width, height = max(float(size[1]), 620.0), tall + _LEGEND
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width:.0f} {height:.0f}" width="{width:.0f}" '
        f'height="{height:.0f}" font-family="system-ui,\'DejaVu Sans\',sans-serif" font-size="12">',
        f"<title>{escape(a.name)} and {escape(b.name)}</title>",
        f"<style>{_STYLE}</style>",
        picture.rstrip(),
        *_legend(tall),
    ]
    return "\n".join([*parts, "</svg>"]) + "\n"


def _both(a: Graph, b: Graph, difference: GraphDiff) -> tuple[Sheet, dict[str, Mark], dict[Link, str]]:
    """Return both graphs as one, with marks on nodes and links that only one of them has."""
    old, new = sheet(a), sheet(b)
    names = {node.id: difference.nodes.get(node.id, node.id) for node in a.nodes}
    for node in difference.removed:
        while names[node] in b:
            names[node] += "′"
    cards = {card.id: card for card in new.cards}
    cards |= {names[card.id]: replace(card, id=names[card.id]) for card in old.cards if card.id in difference.removed}
    old_links = [replace(link, source=names[link.source], target=names[link.target]) for link in old.links]
    old_cards = {names[card.id]: card for card in old.cards}
    removed = [_backwards(link, new.links) for link in old_links if link not in new.links]
    for link in removed:  # a node of another type may lack the port that was linked
        for id, ports, name in ((link.source, "outputs", link.source_port), (link.target, "inputs", link.target_port)):
            sockets = getattr(cards[id], ports)
            if all(socket.name != name for socket in sockets):
                own = next(socket for socket in getattr(old_cards[id], ports) if socket.name == name)
                cards[id] = replace(cards[id], **{ports: (*sockets, own)})
    highlights = {link: ADDED for link in new.links if link not in old_links} | dict.fromkeys(removed, f"-{REMOVED}")
    marks = {new: Mark(RENAMED, (f"was {old}",)) for old, new in difference.renamed.items()}
    marks |= {change.node: Mark(CHANGED) for change in difference.links if change.node in cards}
    marks |= {node: Mark(CHANGED, tuple(notes)) for node, notes in difference.changed(links=False).items()}
    marks |= {node: Mark(ADDED, ("+ added",)) for node in difference.added}
    for node in difference.removed:
        marks[names[node]] = Mark(REMOVED, ("− disabled" if node in difference.disabled else "− removed",))
    return Sheet(new.title, list(cards.values()), [*new.links, *removed], new.outputs), marks, highlights


def _backwards(link: Link, present: Sequence[Link]) -> Link:
    """Return a link of the first graph, which leads back if its ends have the opposite order in the second graph."""
    following = defaultdict[str, list[str]](list)
    for other in present:
        if not other.previous:
            following[other.source].append(other.target)
    return replace(link, previous=link.previous or link.source in depth_first(following, [link.target]))


def _legend(y: float) -> list[str]:
    entries = ((ADDED, "+ added"), (REMOVED, "− removed"), (CHANGED, "~ changed"), (RENAMED, "→ renamed"))
    parts = []
    for number, (color, word) in enumerate(entries):
        x = 24 + 120 * number
        parts.append(f'<rect x="{x}" y="{y + 6:.0f}" width="14" height="14" rx="3" fill="{color}"/>')
        parts.append(f'<text class="word" x="{x + 20}" y="{y + 17:.0f}">{word}</text>')
    return parts
