"""Samples of a space of parameters: at random, or a Latin hypercube (McKay, Beckman and Conover 1979)."""

from __future__ import annotations

import random
from typing import Literal, TypeAlias

Sampling: TypeAlias = Literal["latin", "random"]
_GRID = 1 << 32


def places(count: int, sampling: Sampling, seed: int, name: str) -> list[tuple[float, float, float]]:
    """Places 0…1 on one axis, each with the two ends of its stratum.

    `latin` has exactly one place in each of `count` equal parts, in an order of chance; `random` has them anywhere. An
    axis's places depend on seed and name alone: another axis beside it changes none of them.

    Args:
        count: how many.
        sampling: how.
        seed: the same one gives the same places, on every machine.
        name: the axis's.
    """
    # The two methods of Random whose results do not change between versions of Python.
    source = random.Random(f"{seed} {name}")

    def anywhere() -> float:
        return (source.getrandbits(32) + 0.5) / _GRID  # neither end: no rounding leads out of a stratum

    if sampling == "random":
        found = [anywhere() for _ in range(count)]
        return [(place, max(0.0, place - 1e-6), min(1.0, place + 1e-6)) for place in found]
    order = sorted(range(count), key=lambda _: source.random())
    return [((part + anywhere()) / count, part / count, (part + 1) / count) for part in order]
