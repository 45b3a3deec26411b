"""A plan as an SVG picture: steps across, resources down, grouped by the memory they share."""

from __future__ import annotations

from html import escape

from rendergraph.allocate import ResourcePlan
from rendergraph.diagrams.plan import format_resource, ids_by_memory, live_bytes, memory_name, use_of
from rendergraph.formatting import format_bytes
from rendergraph.schedule import step_names

CELL, ROW, CHARACTER, MARGIN = 22.0, 20.0, 6.65, 20.0
GROUP_GAP = 6.0
BARS = 72.0  # height of the chart of live bytes

# Read green and write red are what people know from other viewers; the letters carry it for those who cannot tell.
USES = {
    "R": ("#2c9163", "reads"),
    "W": ("#d0453e", "writes"),
    "B": ("#c2851c", "reads and writes"),
    "P": ("#3b7dd8", "reads last frame's value"),
}
STYLE = """
svg:root{max-width:100%;height:auto}
.ink{fill:#1f2328}.fact{fill:#57606a}.band{fill:#7d8590;opacity:.12}.alive{fill:#7d8590;opacity:.45}.bar{fill:#7d8590}
.peak{fill:#d0453e}.bound{stroke:#2c9163;stroke-dasharray:4 3}.use{fill:#ffffff;font-weight:600}
@media (prefers-color-scheme:dark){.ink{fill:#e6edf3}.fact{fill:#9aa4af}}
"""


def lifetimes_svg(plan: ResourcePlan) -> str:
    """Return lifetimes and memory as a stand-alone SVG document, for light and dark pages.

    One row per resource, in a band with those in the same texture; below, the bytes alive at each step and the least
    peak; then the nodes that do not run.
    """
    steps, names = plan.schedule.steps, step_names(plan.schedule.steps)
    ids = ids_by_memory(plan)
    label = CHARACTER * max((len(id) for id in ids), default=8) + 10
    left = MARGIN + max(label, CHARACTER * len("live bytes") + 10)
    right = left + CELL * len(steps)
    facts = {
        id: f"{memory_name(plan, id)} · {format_resource(plan.resources[id])} · {format_bytes(plan.bytes(id))}"
        for id in ids
    }
    top = MARGIN + 26 + CHARACTER * max((len(name) for name in names.values()), default=0) * 0.94 + 8
    memory = plan.memory
    proof = "" if memory.proven else f" (bound {format_bytes(memory.lower_bound_bytes)})"
    caption = (
        f"allocated {format_bytes(memory.allocated_bytes)} of {format_bytes(memory.no_reuse_bytes)} without reuse · "
        f"least peak {format_bytes(memory.least_peak_bytes)}{proof} · shared by {memory.tier}"
    )
    parts = [f'<text class="ink" x="{MARGIN}" y="{MARGIN + 8}" font-weight="600">{escape(caption)}</text>']
    for number, step in enumerate(steps):
        x = left + CELL * (number + 0.5)
        parts.append(
            f'<text class="ink" transform="translate({x + 4:.1f} {top - 8:.1f}) rotate(-90)">{escape(names[step.key])}'
            f"<title>{escape(plan.schedule.reasons.get(step.key, ''))}</title></text>"
        )
    y = top
    group: tuple[int, ...] | None = None
    for id in ids:
        if plan.placement[id] != group:
            group = plan.placement[id]
            members = sum(1 for other in ids if plan.placement[other] == group)
            y += GROUP_GAP
            height = ROW * members
            parts.append(
                f'<rect class="band" x="{left:.1f}" y="{y:.1f}" width="{right - left:.1f}" height="{height}" rx="4"/>'
            )
        parts.append(_row(plan, id, left, right, y, facts[id]))
        y += ROW
    y = _chart(parts, plan, left, right, y + 16)
    for node, reason in sorted(plan.schedule.culled.items()):
        y += ROW
        parts.append(
            f'<text x="{MARGIN}" y="{y:.1f}" class="fact"><tspan text-decoration="line-through">{escape(node)}</tspan>'
            f"  {escape(reason)}</text>"
        )
    y = _legend(parts, y + ROW + 6)
    widest = max((len(text) for text in facts.values()), default=0)
    width = max(right + 14 + CHARACTER * widest, MARGIN + CHARACTER * 1.1 * len(caption)) + MARGIN
    head = (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width:.0f} {y + MARGIN:.0f}" width="{width:.0f}" '
        f'height="{y + MARGIN:.0f}" font-family="ui-monospace,\'DejaVu Sans Mono\',Menlo,Consolas,monospace" '
        f'font-size="11">\n<style>{STYLE}</style>'
    )
    return "\n".join([head, *parts, "</svg>"]) + "\n"


def _row(plan: ResourcePlan, id: str, left: float, right: float, y: float, fact: str) -> str:
    life = plan.lifetimes[id]
    middle = y + ROW / 2 + 4
    why = f"<title>{escape(plan.reasons[id])}</title>"
    parts = [
        f'<text class="ink" x="{left - 8:.1f}" y="{middle:.1f}" text-anchor="end">{escape(id)}</text>',
        f'<text class="fact" x="{right + 10:.1f}" y="{middle:.1f}">{escape(fact)}{why}</text>',
        f'<rect class="alive" x="{left + CELL * life.first + 2:.1f}" y="{y + 7:.1f}" '
        f'width="{CELL * (life.last - life.first + 1) - 4:.1f}" height="{ROW - 14:.1f}" rx="3"/>',
    ]
    for position, step in enumerate(plan.schedule.steps):
        use = use_of(step, id)
        if not use:
            continue
        colour, word = USES[use]
        x = left + CELL * position
        parts.append(
            f'<rect x="{x + 2:.1f}" y="{y + 2:.1f}" width="{CELL - 4:.1f}" height="{ROW - 4:.1f}" rx="3" '
            f'fill="{colour}">'
            f"<title>{escape(f'{step.node} {word} {id}')}</title></rect>"
            f'<text class="use" x="{x + CELL / 2:.1f}" y="{middle:.1f}" text-anchor="middle">{use}</text>'
        )
    return "\n".join(parts)


def _chart(parts: list[str], plan: ResourcePlan, left: float, right: float, y: float) -> float:
    live = live_bytes(plan)
    most = max([*live, plan.memory.least_peak_bytes, 1])
    base = y + BARS
    for position, count in enumerate(live):
        height = BARS * count / most
        kind = "peak" if count == max(live) else "bar"
        parts.append(
            f'<rect class="{kind}" x="{left + CELL * position + 2:.1f}" y="{base - height:.1f}" width="{CELL - 4:.1f}" '
            f'height="{height:.1f}"><title>{format_bytes(count)}</title></rect>'
        )
    bound = base - BARS * plan.memory.lower_bound_bytes / most
    parts.append(f'<text class="fact" x="{left - 8:.1f}" y="{base:.1f}" text-anchor="end">live bytes</text>')
    parts.append(f'<path class="bound" d="M{left:.1f} {bound:.1f}H{right:.1f}"/>')
    parts.append(
        f'<text class="fact" x="{right + 10:.1f}" y="{bound + 4:.1f}">lower bound '
        f"{format_bytes(plan.memory.lower_bound_bytes)}</text>"
    )
    return base


def _legend(parts: list[str], y: float) -> float:
    x = MARGIN
    for use, (colour, word) in USES.items():
        parts.append(f'<rect x="{x:.1f}" y="{y - 10:.1f}" width="14" height="14" rx="3" fill="{colour}"/>')
        parts.append(f'<text class="use" x="{x + 7:.1f}" y="{y + 1:.1f}" text-anchor="middle">{use}</text>')
        parts.append(f'<text class="fact" x="{x + 20:.1f}" y="{y + 1:.1f}">{escape(word)}</text>')
        x += 20 + CHARACTER * len(word) + 18
    return y
