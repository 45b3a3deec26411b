"""Blocks that items of any size share: against the least of all ways to share them."""

from __future__ import annotations

import random
from collections.abc import Iterator, Sequence

from rendergraph.allocate import HeapItem, least_bytes, share_blocks


def ways(items: list[HeapItem]) -> Iterator[list[list[int]]]:
    """All partitions into blocks whose members are never alive together, by the definition."""

    def extend(number: int, blocks: list[list[int]]) -> Iterator[list[list[int]]]:
        if number == len(items):
            yield blocks
            return
        moments = range(items[number].first, items[number].last + 1)
        for place, block in enumerate(blocks):
            if not any(items[other].first <= moment <= items[other].last for other in block for moment in moments):
                yield from extend(number + 1, [*blocks[:place], [*block, number], *blocks[place + 1 :]])
        yield from extend(number + 1, [*blocks, [number]])

    return extend(0, [])


def blocks_bytes(items: Sequence[HeapItem], blocks: Sequence[Sequence[int]]) -> int:
    return sum(max(items[number].bytes for number in block) for block in blocks)


def drawn(chooser: random.Random) -> list[HeapItem]:
    starts = [chooser.randrange(6) for _ in range(chooser.randint(1, 6))]
    return [HeapItem(chooser.choice((1, 2, 3, 5, 8, 16)), start, start + chooser.randrange(3)) for start in starts]


def test_the_least_of_all_ways_to_share() -> None:
    chooser = random.Random(5)
    for _ in range(200):
        items = drawn(chooser)
        blocks = share_blocks(tuple(items))
        assert sorted(map(sorted, blocks)) in [sorted(way) for way in ways(items)]
        least = min(blocks_bytes(items, way) for way in ways(items))
        assert least_bytes(items) <= least == blocks_bytes(items, blocks)


def test_blocks_can_need_more_than_the_peak() -> None:
    items = [HeapItem(4, 0, 0), HeapItem(3, 1, 1), HeapItem(3, 1, 1)]
    assert blocks_bytes(items, share_blocks(tuple(items))) == least_bytes(items) == 7  # of 6 that live at once
    assert share_blocks(()) == ()


def test_members_are_in_the_order_of_time_and_like_goes_with_like() -> None:
    items = [HeapItem(4, 2, 3, "a"), HeapItem(4, 0, 1, "a"), HeapItem(4, 0, 1, "b"), HeapItem(4, 2, 3, "b")]
    assert sorted(share_blocks(tuple(items))) == [(1, 0), (2, 3)]
