"""The results that nothing beats."""

from __future__ import annotations

import math
from collections.abc import Sequence

from rendergraph.compare.values import Result


def pareto(results: Sequence[Result]) -> list[Result]:
    """The results than which none is both quicker and better, quickest first; quality is FLIP.

    Pictures that hold NaN or infinity are none of them.
    """
    found: list[Result] = []
    for result in sorted(results, key=lambda r: (r.times.headline.median, r.metrics.flip)):
        flip = result.metrics.flip
        if math.isfinite(flip) and not result.not_finite and (not found or flip < found[-1].metrics.flip):
            found.append(result)
    return found
