"""Fast heuristics for orders: byte-weighted post-order and memory-delta list schedules; random and program order."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from heapq import heappop, heappush

from rendergraph.link.graph import depth_first, upstream_first
from rendergraph.schedule.model import Model


def seeds(model: Model) -> Iterator[list[int]]:
    """Yield legal orders to start from: the reading order, the post-order, both list schedules."""
    yield list(range(len(model)))
    yield post_order(model)
    yield list_schedule(model)
    yield list(reversed(list_schedule(model, backwards=True)))


def post_order(model: Model) -> list[int]:
    """Return the order depth first from the sinks, where the input that needs most and leaves least comes first.

    This is the rule of R. Sethi and J. D. Ullman ("The Generation of Optimal Code for Arithmetic Expressions", 1970)
    with bytes in place of registers. It is optimal on trees; a step with several readers counts for each of them.
    """
    count = len(model)
    leaves = [0] * count  # bytes of the resources that a step creates and another touches, or the end of the frame
    for (first, *_), size, touchers in zip(model.touchers, model.sizes, model.toucher_count, strict=True):
        leaves[first] += size if touchers > 1 else 0
    need = [0] * count
    children: list[list[int]] = [[]] * count

    def sequence(steps: Sequence[int]) -> tuple[list[int], int, int]:
        ordered = sorted(steps, key=lambda step: (leaves[step] - need[step], step))
        held = most = 0
        for step in ordered:
            most = max(most, held + need[step])
            held += leaves[step]
        return ordered, most, held

    for step in range(count):
        children[step], most, held = sequence(model.before[step])
        need[step] = max(most, held + model.born[step])
    roots, _, _ = sequence([step for step in range(count) if not model.after[step]])
    return depth_first(dict(enumerate(children)), roots)


def list_schedule(model: Model, *, backwards: bool = False) -> list[int]:
    """Always run the ready step that leaves the fewest live bytes; backwards, choose among steps that may come last.

    A waiting step is queued again whenever it becomes the last to touch a resource, because its gain then changes.
    """
    count = len(model)
    before, after = (model.after, model.before) if backwards else (model.before, model.after)
    left = list(model.toucher_count)
    begun = bytearray(len(model.sizes))
    if backwards:  # the end of the frame comes first
        for resource in model.shown:
            begun[resource] = 1
            left[resource] -= 1
    waiting: list[list[int]] = [[] for _ in model.sizes]  # ready steps that touch a resource
    missing = [len(steps) for steps in before]
    done = bytearray(count)

    def entry(step: int) -> tuple[int, int]:
        change = 0
        for resource in model.touched[step]:
            change += 0 if begun[resource] else model.sizes[resource]
            change -= model.sizes[resource] if left[resource] == 1 else 0
        return change, -step if backwards else step

    queue: list[tuple[int, int]] = []

    def release(step: int) -> None:
        for resource in model.touched[step]:
            waiting[resource].append(step)
        heappush(queue, entry(step))

    for step in range(count):
        if not missing[step]:
            release(step)
    order: list[int] = []
    while queue:
        change, signed = heappop(queue)
        step = abs(signed)
        if done[step] or (change, signed) != entry(step):
            continue
        done[step] = 1
        order.append(step)
        for resource in model.touched[step]:
            left[resource] -= 1
            fresh = not begun[resource]
            begun[resource] = 1
            if fresh or left[resource] == 1:
                waiting[resource] = [other for other in waiting[resource] if not done[other]]
                for other in waiting[resource]:
                    heappush(queue, entry(other))
        for other in after[step]:
            missing[other] -= 1
            if not missing[other]:
                release(other)
    return order


def random_order(model: Model, seed: int) -> list[int]:
    import random  # rarely needed

    rank = list(range(len(model)))
    random.Random(seed).shuffle(rank)
    return program_order(model, rank)


def program_order(model: Model, rank: Sequence[int]) -> list[int]:
    """Return the order of `rank`, the position of each step in the program, as far as it is legal."""
    return upstream_first({step: model.before[step] for step in sorted(range(len(model)), key=rank.__getitem__)})
