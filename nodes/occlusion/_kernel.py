"""Points spread evenly over a sphere."""

from __future__ import annotations

import math
from functools import cache

import numpy as np
import numpy.typing as npt

ROUNDS = 100


@cache
def spread_points(count: int) -> npt.NDArray[np.float64]:
    """Unit vectors that repel one another until they rest, shape (count, 3).

    From a spiral, 100 rounds of a step along the sum of the forces, 1/d² each, back onto the sphere. Rest is the least
    energy, the sum of 1/d over the pairs (Thomson 1904); the same points in every run.
    """
    number = np.arange(count) + 0.5
    up = 1 - 2 * number / count
    around = number * math.pi * (3 - math.sqrt(5))
    points = np.stack([np.sqrt(1 - up**2) * np.cos(around), np.sqrt(1 - up**2) * np.sin(around), up], axis=1)
    for _ in range(ROUNDS):
        squared = 2 - 2 * points @ points.T  # of distances; on a sphere they are what the cosines leave
        np.fill_diagonal(squared, np.inf)
        pushed = squared**-1.5
        points = points + 6 / count**1.5 * (points * pushed.sum(axis=1, keepdims=True) - pushed @ points)
        points /= np.sqrt((points * points).sum(axis=1, keepdims=True))
    points.setflags(write=False)
    return points
