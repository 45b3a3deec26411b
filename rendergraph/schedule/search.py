"""Find orders of steps that need little memory.

Fast heuristics give the first orders: byte-weighted post-order and memory-delta list schedules. Beam searches of
growing width over the possible sets of executed steps then look for the least peak of live bytes.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from heapq import heappop, heappush
from itertools import pairwise

from rendergraph.link.graph import depth_first, upstream_first
from rendergraph.schedule.model import Cost, Model

FIRST_WIDTH = 4
MOST_REFINEMENTS = 32
"""Rounds of colour refinement; twins that differ from others only at a larger distance are not found."""


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

    steps = list(range(len(model)))
    random.Random(seed).shuffle(steps)
    return upstream_first({step: model.before[step] for step in steps})


def search(model: Model, *, below: int, bound: int, budget: int) -> tuple[list[int] | None, int]:
    """Return an order with a lower peak than the best known, or None, and a lower bound on the peak of all orders.

    States are sets of steps closed under dependencies. A beam extends all its states by one step at a time and keeps
    only the most promising ones; each beam is four times as wide as the previous one and must beat its result. A beam
    that drops nothing has seen every order that matters, so its result is optimal. The states that it drops bound what
    it can have missed. Two rules keep the number of states small without losing the optimum:

    - A step that raises neither the peak nor the live bytes runs at once. Whatever the order of the rest, moving that
      step forward raises nothing: what it frees now is freed in every larger set as well.
    - Branches that an automorphism of the graph exchanges run in the order of their numbers (`twin_chains`).

    Args:
        below: peak of the best order known; states that reach it are dropped.
        bound: a lower bound on the peak; states up to it count as equal.
        budget: resources to visit before giving up; a count, so that the result does not depend on the machine.
    """
    beams = _Beams(model, budget)
    order, width = None, FIRST_WIDTH
    while below > bound:
        better, passed_over = beams.run(width, below, bound)
        if beams.budget <= 0:
            break
        if better is not None:
            order, below = better
        if passed_over >= below:
            return order, below
        bound, width = max(bound, passed_over), 4 * width
    return order, bound


Path = tuple["Path | None", int]
"""The path to a state: the path to the previous state, and the last step."""


class _Beams:
    """Beams over one model; `budget` is the number of resources that may still be visited."""

    def __init__(self, model: Model, budget: int) -> None:
        self.budget = budget
        self._constant, self._born = model.constant, model.born
        before, after = list(map(list, model.before)), list(map(list, model.after))
        for one, other in twin_chains(model):
            before[other].append(one)
            after[one].append(other)
        self._needs = [sum(1 << earlier for earlier in set(steps)) for steps in before]
        self._after = after
        end = 1 << len(model)
        masks = [sum(1 << step for step in touchers) for touchers in model.touchers]
        for resource in model.shown:
            masks[resource] |= end
        # Per step: masks and sizes of its resources; a resource's lifetime ends with the step that completes its mask.
        self._ends = [[(masks[r], model.sizes[r]) for r in resources] for resources in model.touched]

    def run(self, width: int, below: int, bound: int) -> tuple[tuple[list[int], int] | None, int]:
        """Return an order below `below` with its peak, if found, and the least peak of the dropped states."""
        first = tuple(step for step, needs in enumerate(self._needs) if not needs)
        level: list[tuple[int, int, int, tuple[int, ...], Path | None]] = [(bound, self._constant, 0, first, None)]
        passed_over = below
        for _ in self._needs:
            best: dict[int, tuple[int, int, int, int, tuple[int, ...], Path | None]] = {}
            for peak, live, done, ready, path in level:
                for top, rest, step in self._moves(peak, live, done, ready, below):
                    now = done | 1 << step
                    if now not in best or top < best[now][0]:
                        best[now] = top, rest, now, step, ready, path
                if self.budget <= 0:
                    return None, bound
            ranked = sorted(best.values(), key=lambda state: state[:2])
            if len(ranked) > width:
                passed_over = min(passed_over, ranked[width][0])
            level = [
                (peak, live, now, self._ready(ready, step, now), (path, step))
                for peak, live, now, step, ready, path in ranked[:width]
            ]
        if not level:
            return None, passed_over
        peak, _, _, _, path = level[0]
        order = []
        while path:
            path, step = path
            order.append(step)
        return (order[::-1], peak), passed_over

    def _moves(self, peak: int, live: int, done: int, ready: Sequence[int], below: int) -> list[tuple[int, int, int]]:
        """Return peak and live bytes after each step that can run, and the step."""
        moves = []
        for step in ready:
            self.budget -= 1 + len(self._ends[step])
            top = live + self._born[step]
            if top >= below:
                continue
            now = done | 1 << step
            rest = top
            for mask, size in self._ends[step]:
                if not mask & ~now:
                    rest -= size
            if top <= peak and rest <= live:
                return [(peak, rest, step)]
            moves.append((max(peak, top), rest, step))
        return moves

    def _ready(self, ready: Sequence[int], step: int, done: int) -> tuple[int, ...]:
        following = [other for other in self._after[step] if not self._needs[other] & ~done]
        return (*[other for other in ready if other != step], *following)


def improve(model: Model, order: Sequence[int], *, pool_bound: int, budget: int) -> tuple[list[int], Cost]:
    """Move single steps to other legal positions while that makes the order cheaper.

    Stops at `pool_bound`, because no order has a smaller pool, or when the budget of visited resources is spent.
    """
    best, cost = list(order), model.cost(order)
    price = max(1, sum(model.toucher_count))
    improved = True
    while improved and budget > 0 and cost.pool > pool_bound:
        improved = False
        for step in list(best):
            place = best.index(step)
            early, late = _window(model, best, place)
            for target in (*range(place - 1, early - 1, -1), *range(place + 1, late + 1)):
                other = best.copy()
                del other[place]
                other.insert(target, step)
                budget -= price
                found = model.cost(other)
                if found < cost:
                    best, cost, improved = other, found, True
                    break
                if budget <= 0:
                    return best, cost
            if cost.pool <= pool_bound:
                break
    return best, cost


def _window(model: Model, order: Sequence[int], place: int) -> tuple[int, int]:
    """Return the first and last position that a step may move to while the others keep their order."""
    before, after = set(model.before[order[place]]), set(model.after[order[place]])
    early = next((at + 1 for at in range(place - 1, -1, -1) if order[at] in before), 0)
    late = next((at - 1 for at in range(place + 1, len(order)) if order[at] in after), len(order) - 1)
    return early, late


def twin_chains(model: Model) -> Iterator[tuple[int, int]]:
    """Yield pairs of steps of which the first may run first without loss: corresponding steps of equivalent chains.

    Steps are coloured by their own and their neighbours' properties; a step with a unique colour is fixed. Connected
    components of the others are branches, and two branches are twins if exchanging them is an automorphism of steps and
    resources, which is checked. If the branches are chains, any order can be relabelled so that the n-th step of a
    branch runs before the n-th of the next.
    """
    colours = _colours(model)
    shared = Counter(colours)
    placed = [shared[colour] == 1 for colour in colours]
    last: dict[tuple[int, ...], list[int]] = {}
    for start in range(len(model)):
        if placed[start]:
            continue
        branch, stack = [], [start]
        placed[start] = True
        while stack:
            step = stack.pop()
            branch.append(step)
            for other in (*model.before[step], *model.after[step]):
                if not placed[other]:
                    placed[other] = True
                    stack.append(other)
        branch.sort()
        if all(one in model.before[other] for one, other in pairwise(branch)):
            look = tuple(colours[step] for step in branch)
            if look in last and _exchangeable(model, last[look], branch):
                yield from zip(last[look], branch, strict=True)
            last[look] = branch


def _colours(model: Model) -> list[int]:
    signature: list[object] = [
        (model.born[step], tuple(sorted((model.sizes[r], model.toucher_count[r]) for r in model.touched[step])))
        for step in range(len(model))
    ]
    colours = _numbered(signature)
    for _ in range(MOST_REFINEMENTS):
        signature = [
            (
                colours[step],
                tuple(sorted(colours[other] for other in model.before[step])),
                tuple(sorted(colours[other] for other in model.after[step])),
            )
            for step in range(len(model))
        ]
        finer = _numbered(signature)
        if max(finer, default=0) == max(colours, default=0):
            break
        colours = finer
    return colours


def _numbered(signatures: Sequence[object]) -> list[int]:
    numbers: dict[object, int] = {}
    return [numbers.setdefault(signature, len(numbers)) for signature in signatures]


def _exchangeable(model: Model, one: Sequence[int], other: Sequence[int]) -> bool:
    swap = dict(zip(one, other, strict=True)) | dict(zip(other, one, strict=True))
    for step, image in swap.items():
        for neighbours in (model.before, model.after):
            if {swap.get(s, s) for s in neighbours[step]} != set(neighbours[image]):
                return False
    near = sorted({resource for step in swap for resource in model.touched[step]})
    looks = {r: (model.sizes[r], model.toucher_count[r]) for r in near}
    before = sorted((looks[r], model.touchers[r]) for r in near)
    after = sorted((looks[r], tuple(sorted(swap.get(step, step) for step in model.touchers[r]))) for r in near)
    return before == after
