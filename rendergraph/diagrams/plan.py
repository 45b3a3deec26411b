"""A plan as text for terminals and as JSON."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from rendergraph.allocate import ResourcePlan
from rendergraph.diagrams.cards import describe
from rendergraph.formatting import format_bytes
from rendergraph.schedule import step_names
from rendergraph.steps import Resource, Step
from rendergraph.textures import TextureDesc

# A matrix wider than this is no longer read; lifetimes are then given as numbers.
MOST_COLUMNS = 160
MOST_NAMES = 3


def desc_text(resource: Resource) -> str:
    """Format and size, or bytes of a buffer."""
    return describe(resource.desc) if isinstance(resource.desc, TextureDesc) else f"buffer {resource.desc.bytes} B"


def live_bytes(plan: ResourcePlan) -> list[int]:
    """Bytes alive at each step: history at all of them, outputs from their first write on."""
    change = [0] * (len(plan.schedule.steps) + 1)
    for id, life in plan.lifetimes.items():
        if plan.schedule.steps:
            change[life.first] += plan.bytes(id)
            change[life.last + 1] -= plan.bytes(id)
    live = []
    total = 0
    for difference in change[:-1]:
        total += difference
        live.append(total)
    return live


def use_of(step: Step, id: str) -> str:
    """How a step touches a resource: `R` reads, `W` writes, `B` both, `P` reads last frame's value, or nothing."""
    wrote = any(write.resource == id for write in step.writes)
    reads = [read for read in step.all_reads if read.resource == id]
    if wrote and reads:
        return "B"
    if wrote:
        return "W"
    if reads:
        return "P" if all(read.previous for read in reads) else "R"
    return ""


def rows_by_memory(plan: ResourcePlan) -> list[str]:
    """Resource ids so that what shares memory stands together, in the order of time."""
    return sorted(plan.resources, key=lambda id: (plan.placement[id], plan.lifetimes[id].first, id))


def plan_text(plan: ResourcePlan) -> str:
    """Order with reads, writes and reasons; lifetimes; who shares; what is culled; bytes."""
    parts = [_order_text(plan), _lifetimes_text(plan), _sharing_text(plan)]
    if plan.schedule.culled:
        rows = [(f"  {node}", reason) for node, reason in sorted(plan.schedule.culled.items())]
        parts.append("not run\n" + _table(rows))
    parts.append("memory\n" + _table(_memory_rows(plan)))
    return "\n".join(part for part in parts if part)


def plan_json(plan: ResourcePlan) -> dict[str, Any]:
    """The plan as plain JSON values: `order`, `resources`, `physicals`, `memory`, `culled`.

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
        "resources": [_resource_json(plan, id) for id in rows_by_memory(plan)],
        "physicals": [
            {"index": physical.index, "bytes": physical.bytes, "members": list(physical.members)}
            for physical in plan.physicals
        ],
        "memory": plan.memory.as_json(),
        "culled": dict(sorted(schedule.culled.items())),
    }


def _resource_json(plan: ResourcePlan, id: str) -> dict[str, Any]:
    resource, life = plan.resources[id], plan.lifetimes[id]
    found: dict[str, Any] = {"id": id, "role": resource.role, "bytes": plan.bytes(id)}
    if isinstance(resource.desc, TextureDesc):
        desc = resource.desc
        found |= {
            "kind": desc.kind,
            "format": desc.format,
            "size": [desc.width, desc.height],
            "layers": desc.layers,
            "mips": desc.mips,
            "samples": desc.samples,
        }
    else:
        found["kind"] = "buffer"
    return found | {
        "first": life.first,
        "last": life.last,
        "physical": list(plan.placement[id]),
        "reason": plan.reasons[id],
    }


def _order_text(plan: ResourcePlan) -> str:
    names = step_names(plan.schedule.steps)
    live = live_bytes(plan)
    rows = [("  #", "step", "reads", "writes", "live", "why here")]
    for position, step in enumerate(plan.schedule.steps):
        continued = {read.resource for read in step.reads if read.use == "attach"}  # kept, and not looked at
        reads = [
            read.resource + ("@previous" if read.previous else "") for read in step.all_reads if read.use != "attach"
        ]
        writes = [w.resource + (" (continued)" if w.resource in continued else "") for w in step.writes]
        rows.append(
            (
                f"{position + 1:3}",
                names[step.key],
                _ids(reads),
                _ids(writes),
                format_bytes(live[position]),
                plan.schedule.reasons.get(step.key, ""),
            )
        )
    return "order\n" + _table(rows, right=(4,))


def _ids(ids: Sequence[str]) -> str:
    """The first few, each once; the matrix beneath has all of them."""
    found = list(dict.fromkeys(ids))
    return (
        ", ".join(found[:MOST_NAMES]) + (f", {len(found) - MOST_NAMES} more" if len(found) > MOST_NAMES else "") or "-"
    )


def _lifetimes_text(plan: ResourcePlan) -> str:
    steps = plan.schedule.steps
    if not plan.resources:
        return ""
    numbers = [str(position + 1) for position in range(len(steps))]
    deep = max((len(number) for number in numbers), default=0)
    wide = len(steps) <= MOST_COLUMNS
    rows: list[tuple[str, ...]] = []
    if wide:
        rows += [("", "".join(number.rjust(deep)[digit] for number in numbers), "") for digit in range(deep)]
    for id in rows_by_memory(plan):
        life = plan.lifetimes[id]
        if wide:
            cells = (use_of(step, id) or ("─" if life.first <= p <= life.last else "·") for p, step in enumerate(steps))
            span = "".join(cells)
        else:
            span = f"{life.first + 1}–{life.last + 1}"
        rows.append((f"  {id}", span, _home(plan, id), format_bytes(plan.bytes(id)), desc_text(plan.resources[id])))
    legend = "W writes, R reads, B both, P reads last frame's, ─ kept" if wide else "first and last step"
    return f"lifetimes ({legend})\n" + _table(rows, right=(3,))


def _home(plan: ResourcePlan, id: str) -> str:
    word = "texture" if isinstance(plan.resources[id].desc, TextureDesc) else "buffer"
    word = "block" if plan.physicals[plan.placement[id][0]].block else word
    return f"{word} {'+'.join(str(index) for index in plan.placement[id])}"


def _sharing_text(plan: ResourcePlan) -> str:
    return (
        "sharing\n" + _table([(f"  {id}", plan.reasons[id]) for id in rows_by_memory(plan)]) if plan.resources else ""
    )


def _memory_rows(plan: ResourcePlan) -> list[tuple[str, ...]]:
    memory = plan.memory
    gap = memory.least_peak_bytes - memory.lower_bound_bytes
    proof = "no order needs less" if memory.proven else f"the least found is {format_bytes(gap)} above it"
    rows: list[tuple[str, ...]] = [
        ("  no reuse", format_bytes(memory.no_reuse_bytes), "every resource its own"),
        ("  allocated", format_bytes(memory.allocated_bytes), f"shared by {memory.tier}"),
        ("  lower bound", format_bytes(memory.lower_bound_bytes), f"of the peak of live bytes: {proof}"),
    ]
    if memory.peak_node is not None:
        rows.insert(
            2, ("  peak", format_bytes(plan.schedule.peak_bytes), f"of live bytes in this order, at {memory.peak_node}")
        )
    if memory.next_tier is not None and memory.next_tier_bytes is not None:
        rows.append(("  next tier", format_bytes(memory.next_tier_bytes), f"shared by {memory.next_tier}"))
    return rows


def _table(rows: Sequence[Sequence[str]], right: Sequence[int] = ()) -> str:
    widths: dict[int, int] = {}
    for row in rows:
        for column, cell in enumerate(row):
            widths[column] = max(widths.get(column, 0), len(cell))
    lines = []
    for row in rows:
        cells = [cell.rjust(widths[i]) if i in right else cell.ljust(widths[i]) for i, cell in enumerate(row)]
        lines.append("  ".join(cells).rstrip())
    return "\n".join(lines) + "\n"
