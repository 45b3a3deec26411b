"""A difference for a terminal, for a program, and as a picture."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from html import escape
from typing import Any

from rendergraph.diff.structure import GraphDiff, PlanFigures, value_text
from rendergraph.link import Graph
from rendergraph.schedule.reasons import mebibytes
from rendergraph.views import Mark, svg

# Each at least 3:1 against white and against near-black; the signs carry it for those who cannot tell them apart.
ADDED, REMOVED, CHANGED, RENAMED = "#2c9163", "#d0453e", "#b7791f", "#3b7dd8"
_TITLE = 34.0
_LEGEND = 34.0
_STYLE = """
.title{fill:#1f2328;font-size:14px;font-weight:600}.word{fill:#57606a}
@media (prefers-color-scheme:dark){.title{fill:#e6edf3}.word{fill:#9aa4af}}
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
    return name, mebibytes(was), mebibytes(now), f"{sign}{mebibytes(abs(change))}" if change else "="


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
    """Both graphs, one above the other, with what differs in colour, as a stand-alone SVG document."""
    pictures = [svg(a, _marks_of_old(difference)), svg(b, _marks_of_new(difference))]
    sizes = [_size(picture) for picture in pictures]
    width = max(max(w for w, _ in sizes), 520.0)
    height = sum(h for _, h in sizes) + 2 * _TITLE + _LEGEND
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width:.0f} {height:.0f}" width="{width:.0f}" '
        f'height="{height:.0f}" font-family="system-ui,\'DejaVu Sans\',sans-serif" font-size="12">',
        f"<title>{escape(a.name)} and {escape(b.name)}</title>",
        f"<style>{_STYLE}</style>",
    ]
    y = 0.0
    for graph, picture, (_, tall) in zip((a, b), pictures, sizes, strict=True):
        parts.append(f'<text class="title" x="24" y="{y + 24:.0f}">{escape(graph.name)}</text>')
        parts.append(picture.replace("<svg ", f'<svg y="{y + _TITLE:.0f}" ', 1).rstrip())
        y += tall + _TITLE
    parts.append(_legend(y))
    return "\n".join([*parts, "</svg>"]) + "\n"


def _size(picture: str) -> tuple[float, float]:
    found = re.search(r'viewBox="0 0 (\d+) (\d+)"', picture)
    assert found
    return float(found[1]), float(found[2])


def _marks_of_old(difference: GraphDiff) -> dict[str, Mark]:
    back = {new: old for old, new in difference.nodes.items()}
    marks = {old: Mark(RENAMED, (f"→ {new}",)) for old, new in difference.renamed.items()}
    inputs = _inputs(difference, old=True)
    marks |= {back[node]: Mark(CHANGED, inputs=inputs.get(node, frozenset())) for node in difference.changed()}
    for node in difference.removed:
        word = "disabled" if node in difference.disabled else "removed"
        marks[node] = Mark(REMOVED, (f"− {word}",), _EVERY)
    return marks


def _marks_of_new(difference: GraphDiff) -> dict[str, Mark]:
    marks = {new: Mark(RENAMED, (f"was {old}",)) for old, new in difference.renamed.items()}
    inputs = _inputs(difference, old=False)
    for node, notes in difference.changed().items():
        marks[node] = Mark(CHANGED, tuple(notes), inputs.get(node, frozenset()))
    return marks | {node: Mark(ADDED, ("+ added",), _EVERY) for node in difference.added}


class _Everything(frozenset[str]):
    """All of a node's inputs, whatever their names."""

    def __contains__(self, item: object) -> bool:
        return True


_EVERY = _Everything()


def _inputs(difference: GraphDiff, *, old: bool) -> Mapping[str, frozenset[str]]:
    table: dict[str, frozenset[str]] = {}
    for change in difference.links:
        if change.old if old else change.new:
            table[change.node] = table.get(change.node, frozenset()) | {change.port}
    return table


def _legend(y: float) -> str:
    parts, x = [], 24.0
    for hue, word in ((ADDED, "+ added"), (REMOVED, "− removed"), (CHANGED, "~ changed"), (RENAMED, "→ renamed")):
        parts.append(f'<rect x="{x:.0f}" y="{y + 6:.0f}" width="14" height="14" rx="3" fill="{hue}"/>')
        parts.append(f'<text class="word" x="{x + 20:.0f}" y="{y + 17:.0f}">{word}</text>')
        x += 120
    return "\n".join(parts)
