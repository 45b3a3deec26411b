"""What an optimiser makes small, and what of it a search has found."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from rendergraph.compare.values import Result

OBJECTIVES: Mapping[str, Callable[[Result], float | None]] = {
    "flip": lambda result: result.metrics.flip,
    "rmse": lambda result: result.metrics.rmse,
    "radiance_rmse": lambda result: result.radiance_rmse,
    "ms": lambda result: result.times.headline.median,
    "bytes": lambda result: float(str(result.memory["allocated_bytes"])),
}
"""What can be minimised beside plugins' metrics and a pipeline's figures."""


@dataclass(frozen=True)
class Search:
    """What an optimiser was asked for, and has found.

    Attributes:
        minimise: what is as small as can be.
        budget: how many runs it could ask for.
        order: the names of those, in the order in which it asked; None of one that could not be drawn.
        values: by name, what each run has of what is minimised.
        front: the names of those than which none is as good in everything and better in something.
    """

    minimise: tuple[str, ...]
    budget: int
    order: tuple[str | None, ...]
    values: Mapping[str, Sequence[float]]
    front: tuple[str, ...]

    def as_json(self) -> dict[str, Any]:
        """All of it; the values in the order in which they were asked for."""
        values = [None if name is None else self.values.get(name) for name in self.order]
        asked = [{"name": name, "values": own} for name, own in zip(self.order, values, strict=True)]
        return {"minimise": list(self.minimise), "budget": self.budget, "asked": asked, "front": list(self.front)}

    def best_after(self) -> list[tuple[int, float]]:
        """Of the first thing that is minimised: after how many runs it became less, and what it was then."""
        found: list[tuple[int, float]] = []
        for number, name in enumerate(self.order, 1):
            own = self.values.get(name) if name is not None else None
            if own is not None and (not found or own[0] < found[-1][1]):
                found.append((number, own[0]))
        return found


def values_of(result: Result | None, minimise: Sequence[str]) -> list[float] | None:
    """What a run has of what is minimised; None where one of it is no number, or the picture is not."""
    if result is None or result.not_finite:
        return None
    found = [OBJECTIVES[name](result) if name in OBJECTIVES else result.columns.get(name) for name in minimise]
    return None if any(one is None or not math.isfinite(one) for one in found) else [float(one or 0.0) for one in found]


def front_of(values: Mapping[str, Sequence[float]]) -> tuple[str, ...]:
    """The names of those than which none is as good in everything and better in something, best in the first first."""

    def beats(one: Sequence[float], other: Sequence[float]) -> bool:
        return tuple(one) != tuple(other) and all(a <= b for a, b in zip(one, other, strict=True))

    best = [name for name, own in values.items() if not any(beats(other, own) for other in values.values())]
    return tuple(sorted(best, key=lambda name: tuple(values[name])))
