"""Explain the position of each step, and why nodes do not run: one sentence each."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from heapq import heappop, heappush

from rendergraph.formatting import format_bytes
from rendergraph.schedule.dependencies import Versions
from rendergraph.schedule.model import Model
from rendergraph.steps import Step


def step_names(steps: Sequence[Step]) -> dict[tuple[str, int], str]:
    """Return step key to name: the node's id, with number and label if it has several steps; a copy's label."""
    several = {step.node for step in steps if step.index > 0 and step.kind != "copy"}
    names = {
        step.key: f"{step.node}[{f'{step.index} {step.label}'.rstrip()}]" if step.node in several else step.node
        for step in steps
    }
    return names | {step.key: step.label for step in steps if step.kind == "copy"}


def order_reasons(model: Model, order: Sequence[int], chosen: str | None) -> dict[tuple[str, int], str]:
    """Return by step key the reason for its position; `chosen` is how the order was chosen if not by memory."""
    names = step_names(model.steps)
    place = {step: number for number, step in enumerate(order)}
    left = list(model.toucher_count)
    missing = [len(steps) for steps in model.before]
    ready = [step for step, number in enumerate(missing) if not number]
    waiting = len(ready)
    reasons: dict[tuple[str, int], str] = {}
    for number, step in enumerate(order):
        while ready and place[ready[0]] < number:
            heappop(ready)
        freed = []
        for resource in model.touched[step]:
            left[resource] -= 1
            if not left[resource]:
                freed.append(resource)
        release = ""
        if freed:
            largest = max(freed, key=lambda r: model.sizes[r])
            more = f" and {len(freed) - 1} more" if len(freed) > 1 else ""
            release = f"releases {model.names[largest]}{more} ({format_bytes(sum(model.sizes[r] for r in freed))})"
        if waiting == 1:
            text = "nothing else can run yet" if number + 1 < len(order) else "everything else has run"
        elif chosen:
            text = f"{chosen}, of {waiting} that could run"
        elif step == ready[0]:
            text = f"first of {waiting} that could run, reading from the outputs"
        else:
            text = f"before {names[model.steps[ready[0]].key]}, because less memory is held this way"
        reasons[model.steps[step].key] = f"{text}; {release}" if release else text
        waiting -= 1
        for other in model.after[step]:
            missing[other] -= 1
            if not missing[other]:
                heappush(ready, other)
                waiting += 1
    return reasons


def culled_reasons(steps: Sequence[Step], kept: Sequence[Step], versions: Versions) -> Mapping[str, str]:
    """Return by node id why none of its steps runs."""
    running = {step.node for step in kept}
    running |= {step.view.rpartition(".")[0] for step in kept if step.view}  # nodes that only set views
    running |= {function.node for step in kept for function in step.functions}  # nodes whose functions are called
    culled: dict[str, str] = {}
    for node in dict.fromkeys(step.node for step in steps):
        if node in running:
            continue
        ids = list(dict.fromkeys(write.resource for step in steps if step.node == node for write in step.writes))
        readers = {other.node for id in ids for _, other in versions.readers.get(id, ()) if other.node != node}
        if not ids:
            culled[node] = "it writes nothing"
        elif readers:
            be, do = "is" if len(ids) == 1 else "are", "does" if len(readers) == 1 else "do"
            culled[node] = f"{_listed(ids)} {be} read only by {_listed(sorted(readers))}, which {do} not run"
        else:
            culled[node] = f"nothing reads {_listed(ids)}"
    return culled


def _listed(words: Sequence[str]) -> str:
    if len(words) > 3:
        words = [*words[:3], f"{len(words) - 3} more"]
    return words[0] if len(words) == 1 else f"{', '.join(words[:-1])} and {words[-1]}"
