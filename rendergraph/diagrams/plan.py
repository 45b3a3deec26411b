"""A plan as text for terminals, as JSON, and as an SVG picture: steps across, resources down, grouped by memory."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from itertools import accumulate, groupby
from pathlib import Path
from typing import Any

from rendergraph.allocate import ResourcePlan
from rendergraph.diagrams.markup import format_texture, texture_json
from rendergraph.formatting import format_bytes, table
from rendergraph.schedule import step_names
from rendergraph.steps import Resource, Step
from rendergraph.textures import TextureDesc

# A wider matrix is unreadable, so lifetimes are then given as numbers.
MOST_COLUMNS = 160
MOST_NAMES = 3


def format_resource(resource: Resource) -> str:
    desc = resource.desc
    return format_texture(desc) if isinstance(desc, TextureDesc) else f"buffer {desc.bytes} B"


def live_bytes(plan: ResourcePlan) -> list[int]:
    """Return the bytes alive at each step: history at all of them, outputs from their first write on."""
    change = [0] * (len(plan.schedule.steps) + 1)
    for id, life in plan.lifetimes.items():
        if plan.schedule.steps:
            change[life.first] += plan.bytes(id)
            change[life.last + 1] -= plan.bytes(id)
    return list(accumulate(change[:-1]))


def use_of(step: Step, id: str) -> str:
    """Return how a step uses a resource: `R` reads, `W` writes, `B` both, `P` reads last frame's value, or nothing."""
    reads = [read for read in step.all_reads if read.resource == id]
    if any(write.resource == id for write in step.writes):
        return "B" if reads else "W"
    if not reads:
        return ""
    return "P" if all(read.previous for read in reads) else "R"


def ids_by_memory(plan: ResourcePlan) -> list[str]:
    """Return resource ids grouped by memory, in time order."""
    return sorted(plan.resources, key=lambda id: (plan.placement[id], plan.lifetimes[id].first, id))


def memory_name(plan: ResourcePlan, id: str) -> str:
    """Return `texture 3`, or `texture 3+4` for history."""
    kind = "texture" if isinstance(plan.resources[id].desc, TextureDesc) else "buffer"
    return f"{kind} {'+'.join(map(str, plan.placement[id]))}"


def plan_text(plan: ResourcePlan, *, every_step: bool = False) -> str:
    """Return order with reads, writes and reasons; lifetimes; sharing; culled nodes; bytes.

    Consecutive steps of a node that compute kept values share a row, unless `every_step` is set.
    """
    resources = ids_by_memory(plan)
    groups = _groups(plan, every_step)
    culled = [(f"  {node}", reason) for node, reason in sorted(plan.schedule.culled.items())]
    parts = [
        "order\n" + table(_order_rows(plan, groups), right=(4,)),
        _lifetimes_text(plan, resources, groups) if resources else "",
        "sharing\n" + table([(f"  {id}", plan.reasons[id]) for id in resources]) if resources else "",
        "not run\n" + table(culled) if culled else "",
        "memory\n" + table(_memory_rows(plan)),
    ]
    return "\n\n".join(filter(None, parts)) + "\n"


def plan_json(plan: ResourcePlan) -> dict[str, Any]:
    """Return the plan as plain JSON values: `order`, `resources`, `physicals`, `memory`, `culled`.

    Positions (`first`, `last`) count from 0 in `order`.
    """
    schedule = plan.schedule
    names = step_names(schedule.steps)
    live = live_bytes(plan)
    return {
        "order": [
            {
                "node": step.node,
                "step": step.index,
                "name": names[step.key],
                "kind": step.kind,
                "reads": [
                    {"resource": read.resource, "version": read.version, "previous": read.previous, "use": read.use}
                    for read in step.all_reads
                ],
                "writes": [
                    {"resource": write.resource, "version": write.version, "load": write.load} for write in step.writes
                ],
                "live_bytes": live[position],
                "reason": schedule.reasons.get(step.key, ""),
            }
            for position, step in enumerate(schedule.steps)
        ],
        "resources": [_resource_json(plan, id) for id in ids_by_memory(plan)],
        "physicals": [
            {"index": physical.index, "bytes": physical.bytes, "members": list(physical.members)}
            for physical in plan.physicals
        ],
        "memory": plan.memory.as_json(),
        "culled": dict(sorted(schedule.culled.items())),
    }


def _resource_json(plan: ResourcePlan, id: str) -> dict[str, Any]:
    resource, life = plan.resources[id], plan.lifetimes[id]
    facts: dict[str, Any] = {"id": id, "role": resource.role, "bytes": plan.bytes(id), "kind": "buffer"}
    if isinstance(resource.desc, TextureDesc):
        facts |= {"kind": resource.desc.kind, **texture_json(resource.desc)}
    if resource.role == "scene":
        facts["scene_bytes"] = resource.desc.bytes
    facts |= {"first": life.first, "last": life.last}
    return facts | {"physical": list(plan.placement[id]), "reason": plan.reasons[id]}


def _groups(plan: ResourcePlan, every_step: bool) -> list[list[int]]:
    steps = plan.schedule.steps

    def row(position: int) -> str | int:
        roles = {plan.resources[write.resource].role for write in steps[position].writes}
        return steps[position].node if roles == {"kept"} and not every_step else position

    return [list(group) for _, group in groupby(range(len(steps)), row)]


def _order_rows(plan: ResourcePlan, groups: Sequence[Sequence[int]]) -> list[tuple[str, ...]]:
    names, live = step_names(plan.schedule.steps), live_bytes(plan)
    rows: list[tuple[str, ...]] = [("  #", "step", "reads", "writes", "live", "why here")]
    for group in groups:
        steps = [plan.schedule.steps[position] for position in group]
        own = {write.resource for step in steps[:-1] for write in step.writes}
        taken = [read for step in steps for read in step.all_reads if read.resource not in own]
        reads = [read.resource + ("@previous" if read.previous else "") for read in taken if read.use != "attach"]
        continued = {read.resource for read in taken if read.use == "attach"}  # kept, but not sampled
        written = [write.resource for step in steps for write in step.writes]
        writes = [id + (" (continued)" if id in continued else "") for id in written]
        number, name, reason = f"{group[0] + 1:3}", names[steps[0].key], plan.schedule.reasons.get(steps[0].key, "")
        if len(group) > 1:
            number, name = f"{number}–{group[-1] + 1}", f"{steps[0].node} ({len(group)} steps)"
            reason = "kept: they run when their values are new or out of date"
        most = format_bytes(max(live[position] for position in group))
        rows.append((number, name, _first(reads), _first(writes), most, reason))
    return rows


def _first(ids: Sequence[str]) -> str:
    """Return the first few, each once; the matrix has all of them."""
    unique = list(dict.fromkeys(ids))
    more = [f"{len(unique) - MOST_NAMES} more"] if len(unique) > MOST_NAMES else []
    return ", ".join(unique[:MOST_NAMES] + more) or "-"


def _lifetimes_text(plan: ResourcePlan, resources: Sequence[str], groups: Sequence[Sequence[int]]) -> str:
    is_matrix = len(groups) <= MOST_COLUMNS
    rows: list[tuple[str, ...]] = []
    if is_matrix:
        numbers = [str(group[0] + 1) for group in groups]
        digits = max(map(len, numbers), default=0)
        rows += [("", "".join(number.rjust(digits)[digit] for number in numbers)) for digit in range(digits)]
    for id in resources:
        life = plan.lifetimes[id]
        span = f"{life.first + 1}–{life.last + 1}"
        if is_matrix:
            span = "".join(_use_in(plan, group, id) for group in groups)
        memory = memory_name(plan, id)
        if plan.physicals[plan.placement[id][0]].block:
            memory = f"block {memory.partition(' ')[2]}"
        rows.append((f"  {id}", span, memory, format_bytes(plan.bytes(id)), format_resource(plan.resources[id])))
    legend = "W writes, R reads, B both, P reads last frame's, ─ kept" if is_matrix else "first and last step"
    return f"lifetimes ({legend})\n" + table(rows, right=(3,))


def _use_in(plan: ResourcePlan, group: Sequence[int], id: str) -> str:
    uses = {use_of(plan.schedule.steps[position], id) for position in group} - {""}
    if not uses:
        return "─" if plan.lifetimes[id].first <= group[-1] and group[0] <= plan.lifetimes[id].last else "·"
    return uses.pop() if len(uses) == 1 else "B"


def _memory_rows(plan: ResourcePlan) -> list[tuple[str, ...]]:
    memory = plan.memory
    gap = memory.least_peak_bytes - memory.lower_bound_bytes
    proof = "no order needs less" if memory.proven else f"the best order found needs {format_bytes(gap)} more"
    rows: list[tuple[str, int | None, str]] = [
        ("  no reuse", memory.no_reuse_bytes, "every resource its own"),
        ("  allocated", memory.allocated_bytes, f"shared by {memory.tier}"),
        ("  peak", plan.schedule.peak_bytes, f"of live bytes in this order, at {memory.peak_node}"),
        ("  lower bound", memory.lower_bound_bytes, f"of the peak of live bytes: {proof}"),
        ("  next tier", memory.next_tier_bytes, f"shared by {memory.next_tier}"),
    ]
    if memory.peak_node is None:
        del rows[2]
    taken = sum(resource.desc.bytes for resource in plan.resources.values() if resource.note)
    rows.append(("  scene", taken or None, "of its data, beside the above"))
    return [(name, format_bytes(count), text) for name, count, text in rows if count is not None]


# --- as an SVG picture -----------------------------------------------------------------------------------------------

CELL, ROW, CHARACTER, MARGIN = 22.0, 20.0, 6.65, 20.0
GROUP_GAP = 6.0
BARS = 72.0  # height of the chart of live bytes

# Green for reads and red for writes, as in other viewers; the letters help colour-blind readers.
USES = {
    "R": ("#2c9163", "reads"),
    "W": ("#d0453e", "writes"),
    "B": ("#c2851c", "reads and writes"),
    "P": ("#3b7dd8", "reads last frame's value"),
}
STYLE = "\n" + Path(__file__).with_suffix(".css").read_text(encoding="ascii")


def lifetimes_svg(plan: ResourcePlan) -> str:
    """Return lifetimes and memory as a stand-alone SVG document, for light and dark pages.

    One row per resource, in a band with those in the same texture; below, the live bytes at each step and the least
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
