"""Bytes a single heap would need: placing lifetimes at offsets, largest first, where they fit best."""

from __future__ import annotations

import random
from collections.abc import Sequence

# Comparisons of pairs, not seconds: the same figure on every machine. 40 textures get some 30 restarts, 12 all 300.
WORK = 50_000
RESTARTS = 300
# A figure this close to the bound changes nobody's decision.
GOOD_ENOUGH = 1.005


def heap_bytes(items: Sequence[tuple[int, int, int]], bound: int, *, seed: int = 0) -> int:
    """Height of the best placement found.

    Largest first, each at the lowest offset of the tightest gap among what is alive at the same time; then seeded
    restarts with sizes perturbed, until the bound is nearly met.

    Args:
        items: bytes, first and last position of what is placed.
        bound: bytes no placement is below, the peak of live bytes.
        seed: of the restarts.
    """
    if not items:
        return 0
    ordered = sorted(items, key=lambda item: (-item[0], item[1], item[2]))
    best = _place(ordered)
    chooser = random.Random(seed)
    for _ in range(min(RESTARTS, WORK // len(items) ** 2)):
        if best <= bound * GOOD_ENOUGH:
            break
        shaken = sorted(ordered, key=lambda item: -item[0] * chooser.uniform(0.5, 1.5))
        best = min(best, _place(shaken, best))
    return best


def _place(items: Sequence[tuple[int, int, int]], below: int | None = None) -> int:
    height = 0
    placed: list[tuple[int, int, int, int]] = []  # offset, end, first, last
    for size, first, last in items:
        offset, best, tightest = 0, -1, 0
        for low, high, start, stop in placed:
            if stop < first or start > last:
                continue
            gap = low - offset
            if gap >= size and (best < 0 or gap < tightest):
                best, tightest = offset, gap
            if high > offset:
                offset = high
        if best < 0:
            best = offset
        height = max(height, best + size)
        if below is not None and height >= below:
            return below
        entry = (best, best + size, first, last)
        low_end = 0
        high_end = len(placed)
        while low_end < high_end:
            middle = (low_end + high_end) // 2
            if placed[middle] < entry:
                low_end = middle + 1
            else:
                high_end = middle
        placed.insert(low_end, entry)
    return height
