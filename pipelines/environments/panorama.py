"""Equirectangular pictures: 512×256, float16 radiance with an alpha of 1.

Column `u = 0.5 + atan2(z, x) / 2π`, row `v = acos(y) / π` from the top.
"""

from __future__ import annotations

from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

SIZE = (512, 256)
Plane: TypeAlias = npt.NDArray[np.float32]


def directions() -> Plane:
    """The unit vector of each texel's middle, (256, 512, 3)."""
    width, height = SIZE
    around = (np.arange(width, dtype=np.float32) + 0.5) / width * (2 * np.pi) - np.pi
    down = (np.arange(height, dtype=np.float32) + 0.5) / height * np.pi
    flat = np.sin(down)[:, None]
    up = np.broadcast_to(np.cos(down)[:, None], (height, width))
    return np.stack([flat * np.cos(around), up, flat * np.sin(around)], axis=-1).astype(np.float32)


def picture(light: npt.NDArray[Any]) -> npt.NDArray[np.float16]:
    made = np.ones((*light.shape[:2], 4), np.float16)
    made[..., :3] = np.minimum(light, 65504.0)
    return made
