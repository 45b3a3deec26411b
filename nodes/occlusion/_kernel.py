"""Points spread evenly over a sphere."""

from __future__ import annotations

import math
from functools import cache

import numpy as np
import numpy.typing as npt

ITERATIONS = 100


@cache
def spread_points(count: int) -> npt.NDArray[np.float64]:
    """Return unit vectors that are evenly spread over the sphere, shape (count, 3).

    They minimise the electrostatic energy, the sum of 1/d over all pairs (Thomson 1904). Starting from a spiral, each
    iteration moves the points along the sum of the repulsive forces 1/d², and projects them back onto the sphere. The
    points are the same in every run.
    """
    number = np.arange(count) + 0.5
    z = 1 - 2 * number / count
    azimuth = number * math.pi * (3 - math.sqrt(5))
    points = np.stack([np.sqrt(1 - z**2) * np.cos(azimuth), np.sqrt(1 - z**2) * np.sin(azimuth), z], axis=1)
    for _ in range(ITERATIONS):
        squared_distances = 2 - 2 * points @ points.T
        np.fill_diagonal(squared_distances, np.inf)
        forces = squared_distances**-1.5
        points = points + 6 / count**1.5 * (points * forces.sum(axis=1, keepdims=True) - forces @ points)
        points /= np.sqrt((points * points).sum(axis=1, keepdims=True))
    points.setflags(write=False)
    return points
