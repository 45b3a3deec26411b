"""The least peak: a beam and a best-first search over the sets of steps that can have run."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from heapq import heappop, heappush, nsmallest
from typing import NamedTuple

from msgspec import Struct

from rendergraph.schedule.model import Model

BEAM, LAST_BEAM = 64, 256
"""States that a beam keeps after each step, before the search and when its budget has ended."""


class Found(Struct, frozen=True):
    """What a search came to.

    Attributes:
        order: a legal order with a lower peak than asked, None where none was found.
        bound: no legal order has a lower peak than this, or than what was asked where that is less.
    """

    order: list[int] | None
    bound: int


class _State(NamedTuple):
    """A set of steps that can have run, and the best known way there."""

    peak: int
    live: int
    place: int
    done: int
    ready: tuple[int, ...]


def search(model: Model, *, below: int, bound: int, budget: int) -> Found:
    """A legal order of least peak, if one is below a given peak; the best that the budget finds.

    States are sets of steps closed under what they wait for. A beam first follows the most promising ones to the end,
    and what it finds is beaten from then on. Then the cheapest peak so far is expanded first, and among equals the one
    that got furthest, so that the first complete order is a least one. When the budget ends before, the cheapest state
    that is left is a bound, and wider beams complete it and begin anew. Three rules keep the search small, none of
    which loses the optimum:

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
    moves = _Moves(model)
    start = _State(bound, model.constant, 0, 0, moves.first)
    order, moves.below = None, below
    if budget:
        order = moves.beam(start, BEAM)
    if moves.below <= bound:
        return Found(order, bound)
    # peak, minus the number of steps run, live bytes, place: no two places are equal, so no states are compared
    heap: list[tuple[int, int, int, int, int, _State]] = [(bound, 0, model.constant, 0, 0, start)]
    reached = {0: bound}
    base_live = model.constant
    while heap:
        peak, depth, live, _, key, state = heappop(heap)
        if peak > reached[key] or peak >= moves.below:
            continue
        if state.done == moves.full:
            return Found(moves.path(state.place), peak)
        if moves.made > budget:
            for begun in (start, state) if budget else ():
                order = moves.beam(begun, LAST_BEAM) or order
            return Found(order, peak)
        if live <= base_live and state.done:
            base_live = live
            heap.clear()
            reached.clear()
        for child, key in moves.after(state):
            if reached.get(key, moves.below) > child.peak:
                reached[key] = child.peak
                heappush(heap, (child.peak, depth - 1, child.live, child.place, key, child))
    return Found(order, moves.below)


class _Moves:
    """From one set of steps to the next.

    Attributes:
        below: states whose peak reaches it are dropped.
        made: steps tried so far.
        full: the set of all steps.
        first: the steps that wait for nothing.
    """

    def __init__(self, model: Model) -> None:
        count = len(model)
        self.below, self.made, self.full = 0, 0, (1 << count) - 1
        self._needs = [sum(1 << other for other in earlier) for earlier in model.before]
        self.first = tuple(step for step in range(count) if not self._needs[step])
        masks = [1 << count if resource in model.shown else 0 for resource in range(len(model.sizes))]
        for step, resources in enumerate(model.touched):
            for resource in resources:
                masks[resource] |= 1 << step
        # Per step: masks and sizes of what it touches; a resource dies with the step that completes its mask.
        self._ends = [[(masks[r], model.sizes[r]) for r in resources] for resources in model.touched]
        self._born, self._after = model.born, model.after
        self._twins = twin_branches(model)
        self._price = sum(len(branch) for group in self._twins for branch in group) // 12
        self._parents: list[tuple[int, int]] = [(-1, -1)]

    def after(self, state: _State) -> list[tuple[_State, int]]:
        """The states one step on, each with the canonical form of its set."""
        peak, live, done, below = state.peak, state.live, state.done, self.below
        found: list[tuple[int, int, int, int]] = []
        for step in state.ready:
            self.made += 1
            top = live + self._born[step]
            if top >= below:
                continue
            now = done | 1 << step
            rest = top
            for mask, size in self._ends[step]:
                if not mask & ~now:
                    rest -= size
            found.append((top if top > peak else peak, rest, step, now))
            if top <= peak and rest <= live:
                found = found[-1:]
                break
        needs, result = self._needs, []
        for top, rest, step, now in found:
            self.made += self._price
            following = tuple(other for other in state.ready if other != step) + tuple(
                other for other in self._after[step] if not needs[other] & ~now
            )
            self._parents.append((state.place, step))
            child = _State(top, rest, len(self._parents) - 1, now, following)
            result.append((child, canonical(now, self._twins) if self._twins else now))
        return result

    def beam(self, start: _State, width: int) -> list[int] | None:
        """An order below `below`, which falls to its peak: at each step only so many states are followed further.

        They are those of least peak, and then of least alive. None where all of them come to nothing.
        """
        states = [start]
        while states and states[0].done != self.full:
            best: dict[int, _State] = {}
            for state in states:
                for child, key in self.after(state):
                    known = best.get(key)
                    if known is None or child.peak < known.peak:
                        best[key] = child
            states = nsmallest(width, best.values(), key=lambda state: (state.peak, state.live, state.place))
        if not states:
            return None
        self.below = states[0].peak
        return self.path(states[0].place)

    def path(self, place: int) -> list[int]:
        """The steps on the way to a state."""
        order: list[int] = []
        while place:
            place, step = self._parents[place]
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
    colours = _colours(model)
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


def _colours(model: Model) -> list[int]:
    count = len(model)
    signature: list[object] = [
        (model.born[step], tuple(sorted((model.sizes[r], model.toucher_count[r]) for r in model.touched[step])))
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
    looks = {r: (model.sizes[r], model.toucher_count[r]) for r in near}
    before = sorted((looks[r], tuple(sorted(touchers[r]))) for r in near)
    after = sorted((looks[r], tuple(sorted(swap.get(step, step) for step in touchers[r]))) for r in near)
    return before == after
