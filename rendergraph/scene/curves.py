"""Keyframes: values over time."""

from __future__ import annotations

from typing import Any, Literal, TypeAlias

import numpy as np
import numpy.typing as npt
from msgspec import Struct

from rendergraph.errors import Place

Doubles: TypeAlias = npt.NDArray[np.float64]
Ease: TypeAlias = Literal["linear", "smooth", "step"]


class Curve(Struct, frozen=True, eq=False):
    """The keyframes of one value, which is held before the first and after the last.

    Attributes:
        times: float64 (k,), seconds, increasing.
        values: float64, numbers (k,), vectors (k, n), or unit quaternions x, y, z, w if `turns`.
        ease: between two keys, `linear`; `smooth` starts and ends at rest (3t² - 2t³); `step` holds the first.
        turns: rotations, interpolated along the shorter arc (Shoemake 1985).
        place: their place in the file.
    """

    times: Doubles
    values: Doubles
    ease: Ease = "linear"
    turns: bool = False
    place: Place | None = None

    def at(self, time: float) -> Any:
        """Return the number, the vector as a tuple, or the rotation as a matrix (3, 3), at a time in seconds."""
        if self.ease == "linear" and not self.turns:
            if self.values.ndim == 1:
                return float(np.interp(time, self.times, self.values))
            return tuple(float(np.interp(time, self.times, column)) for column in self.values.T)
        first = min(max(int(np.searchsorted(self.times, time, side="right")) - 1, 0), len(self.times) - 1)
        last = min(first + 1, len(self.times) - 1)
        span = self.times[last] - self.times[first]
        t = min(max(float((time - self.times[first]) / span), 0.0), 1.0) if span else 0.0
        t = {"linear": t, "smooth": t * t * (3 - 2 * t), "step": 0.0}[self.ease]
        a, b = self.values[first], self.values[last]
        if self.turns:
            from rendergraph.scene.rig import placements, slerp  # few scenes have rotations

            rotation = slerp(a[None], b[None], t)
            return placements(np.zeros((1, 3)), rotation, np.ones((1, 3)))[0, :3, :3]
        value = a + t * (b - a)
        return float(value) if self.values.ndim == 1 else tuple(value.tolist())


def quaternion(degrees: Doubles) -> Doubles:
    """Return the unit quaternion x, y, z, w of rotations about X, then Y, then Z, as in `euler_matrix`."""
    (x, y, z), (u, v, w) = np.sin(np.radians(degrees) / 2), np.cos(np.radians(degrees) / 2)
    return np.array(
        [
            x * v * w - u * y * z,
            u * y * w + x * v * z,
            u * v * z - x * y * w,
            u * v * w + x * y * z,
        ]
    )
