"""A plan as text for terminals, as JSON, and as an SVG picture: steps across, resources down, grouped by memory."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from html import escape
from itertools import accumulate, groupby
from pathlib import Path
from typing import Any

from rendergraph.allocate import ResourcePlan
from rendergraph.diagrams.markup import element, format_texture, svg_document, texture_json, title
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
    caption = f"allocated {format_bytes(memory.allocated_bytes)} of {format_bytes(memory.no_reuse_bytes)} without reuse"
    caption += f" · least peak {format_bytes(memory.least_peak_bytes)}{proof} · shared by {memory.tier}"
    parts = [element("text", escape(caption), class_="ink", x=MARGIN, y=MARGIN + 8, font_weight=600)]
    for number, step in enumerate(steps):
        place = f"translate({left + CELL * (number + 0.5) + 4:.1f} {top - 8:.1f}) rotate(-90)"
        text = escape(names[step.key]) + title(plan.schedule.reasons.get(step.key, ""))
        parts.append(element("text", text, class_="ink", transform=place))
    y = top
    for _, group in groupby(ids, plan.placement.__getitem__):
        members = list(group)
        y += GROUP_GAP
        band = {"x": left, "y": y, "width": right - left, "height": ROW * len(members)}
        parts.append(element("rect", class_="band", **band, rx=4))
        for id in members:
            parts += _row(plan, id, left, right, y, facts[id])
            y += ROW
    parts += _chart(plan, left, right, y + 16)
    y += 16 + BARS
    for node, reason in sorted(plan.schedule.culled.items()):
        y += ROW
        text = f"{element('tspan', escape(node), text_decoration='line-through')}  {escape(reason)}"
        parts.append(element("text", text, x=MARGIN, y=y, class_="fact"))
    y += ROW + 6
    parts += _legend(y)
    widest = max((len(text) for text in facts.values()), default=0)
    width = max(right + 14 + CHARACTER * widest, MARGIN + CHARACTER * 1.1 * len(caption)) + MARGIN
    return svg_document(width, y + MARGIN, [f"<style>{STYLE}</style>", *parts])


def _row(plan: ResourcePlan, id: str, left: float, right: float, y: float, fact: str) -> Iterator[str]:
    life = plan.lifetimes[id]
    middle, span = y + ROW / 2 + 4, CELL * (life.last - life.first + 1)
    yield element("text", escape(id), class_="ink", x=left - 8, y=middle, text_anchor="end")
    yield element("text", escape(fact) + title(plan.reasons[id]), class_="fact", x=right + 10, y=middle)
    x = left + CELL * life.first + 2
    yield element("rect", class_="alive", x=x, y=y + 7, width=span - 4, height=ROW - 14, rx=3)
    for position, step in enumerate(plan.schedule.steps):
        if not (use := use_of(step, id)):
            continue
        colour, word = USES[use]
        x, what = left + CELL * position, title(f"{step.node} {word} {id}")
        cell = element("rect", what, x=x + 2, y=y + 2, width=CELL - 4, height=ROW - 4, rx=3, fill=colour)
        yield cell + element("text", use, class_="use", x=x + CELL / 2, y=middle, text_anchor="middle")


def _chart(plan: ResourcePlan, left: float, right: float, y: float) -> Iterator[str]:
    live = live_bytes(plan)
    most = max([*live, plan.memory.least_peak_bytes, 1])
    base = y + BARS
    for position, count in enumerate(live):
        x, height = left + CELL * position + 2, BARS * count / most
        kind = "peak" if count == max(live) else "bar"
        bar = {"x": x, "y": base - height, "width": CELL - 4, "height": height}
        yield element("rect", title(format_bytes(count)), class_=kind, **bar)
    bound = base - BARS * plan.memory.lower_bound_bytes / most
    yield element("text", "live bytes", class_="fact", x=left - 8, y=base, text_anchor="end")
    yield element("path", class_="bound", d=f"M{left:.1f} {bound:.1f}H{right:.1f}")
    text = f"lower bound {format_bytes(plan.memory.lower_bound_bytes)}"
    yield element("text", text, class_="fact", x=right + 10, y=bound + 4)


def _legend(y: float) -> Iterator[str]:
    x = MARGIN
    for use, (colour, word) in USES.items():
        yield element("rect", x=x, y=y - 10, width=14, height=14, rx=3, fill=colour)
        yield element("text", use, class_="use", x=x + 7, y=y + 1, text_anchor="middle")
        yield element("text", escape(word), class_="fact", x=x + 20, y=y + 1)
        x += 20 + CHARACTER * len(word) + 18
