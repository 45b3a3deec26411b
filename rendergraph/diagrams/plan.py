"""A plan as text for terminals and as JSON."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import accumulate, groupby
from typing import Any

from rendergraph.allocate import ResourcePlan
from rendergraph.diagrams.cards import format_texture
from rendergraph.diagrams.markup import texture_json
from rendergraph.formatting import format_bytes, table
from rendergraph.schedule import step_names
from rendergraph.steps import Resource, Step
from rendergraph.textures import TextureDesc

# A matrix wider than this is unreadable; lifetimes are then given as numbers.
MOST_COLUMNS = 160
MOST_NAMES = 3


def format_resource(resource: Resource) -> str:
    """Return format and size, or the bytes of a buffer."""
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
    """Return resource ids so that those that share memory are together, in the order of time."""
    return sorted(plan.resources, key=lambda id: (plan.placement[id], plan.lifetimes[id].first, id))


def memory_name(plan: ResourcePlan, id: str) -> str:
    """Return `texture 3`, or `texture 3+4` for history."""
    kind = "texture" if isinstance(plan.resources[id].desc, TextureDesc) else "buffer"
    return f"{kind} {'+'.join(map(str, plan.placement[id]))}"


def plan_text(plan: ResourcePlan, *, every_step: bool = False) -> str:
    """Return order with reads, writes and reasons; lifetimes; sharing; culled nodes; bytes.

    Steps in sequence that make kept values of one node share a row, unless `every_step` is asked for.
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
    found: dict[str, Any] = {"id": id, "role": resource.role, "bytes": plan.bytes(id), "kind": "buffer"}
    if isinstance(resource.desc, TextureDesc):
        found |= {"kind": resource.desc.kind, **texture_json(resource.desc)}
    found |= {"first": life.first, "last": life.last}
    return found | {"physical": list(plan.placement[id]), "reason": plan.reasons[id]}


def _groups(plan: ResourcePlan, every_step: bool) -> list[list[int]]:
    """The positions of the steps of each row."""
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
    """The first few, each once; the matrix below has all of them."""
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
    return [(name, format_bytes(count), text) for name, count, text in rows if count is not None]
