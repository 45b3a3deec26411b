"""Assign textures of any description to shared blocks of memory.

A block is as large as its largest member, and all members begin at its start: drivers ignore other offsets
(docs/decisions/memory-objects.md). This is weighted interval colouring, which minimises the sum over colours of the
largest weight and is NP-hard; largest first is within 1 % of the optimum on most small cases, and restarts improve it.
"""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from functools import lru_cache

from msgspec import Struct

# In comparisons of pairs, so that all machines find the same blocks. 40 textures get 6 restarts, 10 get 100.
WORK = 10_000
RESTARTS = 100


class HeapItem(Struct, frozen=True, gc=False):
    """A texture to place: bytes, first and last position in the schedule, and its kind."""

    bytes: int
    first: int
    last: int
    kind: Hashable = None


@lru_cache(64)  # most changes of a pipeline do not change the items
def share_blocks(items: tuple[HeapItem, ...]) -> tuple[tuple[int, ...], ...]:
    """Return the numbers of the items in each block, in time order, with few bytes in total.

    Largest first, each into the block that grows least; ties go to a block with its kind, then to the tightest. Then
    seeded restarts with perturbed sizes, until the bound is reached.
    """
    numbers = range(len(items))
    alive = [(1 << item.last + 1) - (1 << item.first) for item in items]  # a bit for each position
    best, least = _placed(items, alive, sorted(numbers, key=lambda n: (-items[n].bytes, items[n].first, n)))
    bound = least_bytes(items)
    if least > bound:
        import random  # the first order is usually optimal

        chooser = random.Random(0)
        for _ in range(min(RESTARTS, WORK // max(1, len(items)) ** 2)):
            weights = [item.bytes * chooser.uniform(0.5, 1.5) for item in items]
            other, taken = _placed(items, alive, sorted(numbers, key=lambda n: (-weights[n], n)))
            if taken < least:
                best, least = other, taken
            if least == bound:
                break
    return tuple([tuple(sorted(block, key=lambda n: items[n].first)) for block in best])


def least_bytes(items: Sequence[HeapItem]) -> int:
    """Return a lower bound on bytes: the n-th largest block must hold the n-th largest item at every moment."""
    most = [0] * len(items)
    ordered = sorted([(item.bytes, item.first, item.last) for item in items], reverse=True)
    for now in {item.first for item in items}:
        live = [bytes for bytes, first, last in ordered if first <= now <= last]
        most[: len(live)] = map(max, most, live)
    return sum(most)


def _placed(items: Sequence[HeapItem], alive: Sequence[int], order: Sequence[int]) -> tuple[list[list[int]], int]:
    blocks: list[list[int]] = []
    sizes: list[int] = []
    taken: list[int] = []  # per block, the positions at which one of its items is alive
    kinds: list[set[object]] = []
    for number in order:
        bytes, kind, now = items[number].bytes, items[number].kind, alive[number]
        found, least = -1, (bytes, False, 0)
        for place, other in enumerate(taken):
            if not other & now:
                more = bytes - sizes[place]
                cost = (max(0, more), kind not in kinds[place], abs(more))
                if cost < least:
                    found, least = place, cost
                if cost == (0, False, 0):
                    break
        if found < 0:
            blocks.append([number])
            sizes.append(bytes)
            taken.append(now)
            kinds.append({kind})
        else:
            blocks[found].append(number)
            sizes[found] = max(sizes[found], bytes)
            taken[found] |= now
            kinds[found].add(kind)
    return blocks, sum(sizes)
