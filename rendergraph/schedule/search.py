"""The exact least peak: best-first search over the sets of steps that have run."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from heapq import heappop, heappush

from rendergraph.schedule.model import Model


@dataclass(frozen=True)
class Found:
    """What a search came to.

    Attributes:
        order: a legal order with a lower peak than asked, None where there is none or none was found.
        proven: nothing is lower than `order`, or than what was asked where that is None.
        moves: steps tried.
    """

    order: list[int] | None
    proven: bool
    moves: int


def search(model: Model, *, below: int, bound: int, budget: int) -> Found:
    """A legal order of least peak, if one is below a given peak.

    States are sets of steps closed under what they wait for; the cheapest peak so far is expanded first, and among
    equals the one that got furthest, so that the first complete order is a least one. Three rules keep it small, none
    of which loses the optimum:

    - A step that raises neither the peak nor the live bytes is run at once. Whatever order the rest takes, bringing
      that step forward raises nothing: what it frees now is freed in every larger set as well.
    - For the same reason a whole run of steps after which no more is alive than at its start, found without raising
      the peak beyond what every other way needs, is kept, and all other ways from that start are dropped.
    - Branches that an automorphism of the graph exchanges are interchangeable: of states that differ only in that, one
      is looked at.

    Args:
        model: the steps.
        below: peak of the best order known; states that reach it are dropped.
        bound: a peak that no order is below; up to there everything is free.
        budget: steps to try before giving up, where a state costs more the more of it is symmetric. A count and not
            a time, so that the result does not depend on the machine.
    """
    count = len(model)
    full = (1 << count) - 1
    needs = [sum(1 << other for other in earlier) for earlier in model.before]
    touch_masks = [0] * len(model.sizes)
    for step, resources in enumerate(model.touched):
        for resource in resources:
            touch_masks[resource] |= 1 << step
    # Per step: masks and sizes of what it touches; the resource dies with the step that completes the mask.
    ends = [[(touch_masks[r], model.sizes[r]) for r in resources] for resources in model.touched]
    born, after = model.born, model.after
    twins = twin_branches(model)
    price = sum(len(branch) for group in twins for branch in group) // 12
    ready = tuple(step for step in range(count) if not needs[step])
    parents: list[tuple[int, int]] = [(-1, -1)]
    # peak, minus the number of steps run, live bytes, place in `parents`, set, its canonical form, ready steps
    base_live = model.constant
    heap: list[tuple[int, int, int, int, int, int, tuple[int, ...]]] = [(bound, 0, base_live, 0, 0, 0, ready)]
    reached = {0: bound}
    moves = 0
    while heap:
        peak, depth, live, place, done, key, ready = heappop(heap)
        if peak > reached[key]:
            continue
        if done == full:
            return Found(_path(parents, place), True, moves)
        if live <= base_live and done:
            base_live = live
            heap.clear()
            reached.clear()
        children = []
        for step in ready:
            moves += 1
            top = live + born[step]
            if top >= below:
                continue
            now = done | 1 << step
            rest = top
            for mask, size in ends[step]:
                if not mask & ~now:
                    rest -= size
            children.append((top if top > peak else peak, rest, step, now))
            if top <= peak and rest <= live:
                children = children[-1:]
                break
        for top, rest, step, now in children:
            moves += price
            key = canonical(now, twins) if twins else now
            if reached.get(key, below) <= top:
                continue
            reached[key] = top
            parents.append((place, step))
            following = tuple(other for other in ready if other != step) + tuple(
                other for other in after[step] if not needs[other] & ~now
            )
            heappush(heap, (top, depth - 1, rest, len(parents) - 1, now, key, following))
        if moves > budget:
            return Found(None, False, moves)
    return Found(None, True, moves)


def _path(parents: Sequence[tuple[int, int]], place: int) -> list[int]:
    order: list[int] = []
    while place:
        place, step = parents[place]
        order.append(step)
    return order[::-1]


# --- symmetry --------------------------------------------------------------------------------------------------------

Twins = list[list[list[int]]]
"""Groups of interchangeable branches; each branch the numbers of its steps, in corresponding order."""


def canonical(done: int, twins: Twins) -> int:
    """The same number for sets that only exchange twin branches."""
    for group in twins:
        states = []
        for branch in group:
            state = 0
            for place, step in enumerate(branch):
                if done >> step & 1:
                    state |= 1 << place
                    done ^= 1 << step
            states.append(state)
        states.sort(reverse=True)
        for branch, state in zip(group, states, strict=True):
            for place, step in enumerate(branch):
                if state >> place & 1:
                    done |= 1 << step
    return done


def twin_branches(model: Model) -> Twins:
    """Branches that can be exchanged without changing anything an order's peak depends on.

    Steps are coloured by what they and their neighbours look like until nothing changes; a step whose colour nobody
    shares is fixed. What hangs together among the others is a branch, and two branches of one colouring are twins if
    exchanging them maps steps to steps and resources to resources, which is checked.
    """
    count = len(model)
    touchers: list[list[int]] = [[] for _ in model.sizes]
    for step, resources in enumerate(model.touched):
        for resource in resources:
            touchers[resource].append(step)
    colours = _colours(model, touchers)
    shared: dict[int, int] = defaultdict(int)
    for colour in colours:
        shared[colour] += 1
    loose = [shared[colour] > 1 for colour in colours]
    if not any(loose):
        return []
    branches: dict[tuple[int, ...], list[list[int]]] = defaultdict(list)
    placed = bytearray(count)
    for start in range(count):
        if not loose[start] or placed[start]:
            continue
        branch, stack = [], [start]
        placed[start] = 1
        while stack:
            step = stack.pop()
            branch.append(step)
            for other in (*model.before[step], *model.after[step]):
                if loose[other] and not placed[other]:
                    placed[other] = 1
                    stack.append(other)
        branch.sort(key=lambda step: (colours[step], step))
        branches[tuple(colours[step] for step in branch)].append(branch)
    found: Twins = []
    for alike in branches.values():
        group = [alike[0]]
        for branch in alike[1:]:
            if _exchangeable(model, touchers, group[-1], branch):
                group.append(branch)
            else:
                if len(group) > 1:
                    found.append(group)
                group = [branch]
        if len(group) > 1:
            found.append(group)
    return found


def _colours(model: Model, touchers: Sequence[Sequence[int]]) -> list[int]:
    count = len(model)
    signature: list[object] = [
        (model.born[step], tuple(sorted((model.sizes[r], len(touchers[r])) for r in model.touched[step])))
        for step in range(count)
    ]
    colours, classes = _numbered(signature), 0
    while True:
        found = len(set(colours))
        if found in (classes, count):
            return colours
        classes = found
        signature = [
            (
                colours[step],
                tuple(sorted(colours[other] for other in model.before[step])),
                tuple(sorted(colours[other] for other in model.after[step])),
            )
            for step in range(count)
        ]
        colours = _numbered(signature)


def _numbered(signatures: Sequence[object]) -> list[int]:
    numbers: dict[object, int] = {}
    return [numbers.setdefault(signature, len(numbers)) for signature in signatures]


def _exchangeable(model: Model, touchers: Sequence[Sequence[int]], one: Sequence[int], other: Sequence[int]) -> bool:
    swap = dict(zip(one, other, strict=True)) | dict(zip(other, one, strict=True))
    for step in swap:
        image = swap[step]
        if {swap.get(s, s) for s in model.after[step]} != set(model.after[image]):
            return False
        if {swap.get(s, s) for s in model.before[step]} != set(model.before[image]):
            return False
    near = sorted({resource for step in swap for resource in model.touched[step]})
    before = sorted((model.sizes[r], tuple(sorted(touchers[r]))) for r in near)
    after = sorted((model.sizes[r], tuple(sorted(swap.get(step, step) for step in touchers[r]))) for r in near)
    return before == after
