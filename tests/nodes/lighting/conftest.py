"""Pictures of one shared session, and when two of them are the same."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest

import rendergraph as rg

Floats = npt.NDArray[np.float64]


@pytest.fixture
def radiance(session: rg.Session) -> Callable[..., Floats]:
    """`radiance(pipeline, scene, *sets, size=…)`: scene-linear RGBA as float64, top row first."""

    def draw(pipeline: str, scene: Path | str, *sets: str, size: tuple[int, int] = (120, 90)) -> Floats:
        frame = session.render(rg.load(pipeline, scene=scene, size=size, sets=sets), outputs=["radiance"])
        return np.asarray(frame["radiance"], np.float64)

    return draw


@pytest.fixture
def steps_off() -> Callable[[Floats, Floats], Floats]:
    """Per pixel, how many times farther two pictures lie apart than 1e-4 of the value or one step of a half float."""

    def measure(a: Floats, b: Floats) -> Floats:
        assert np.isfinite(a).all()
        assert b[..., :3].mean() > 1e-3, "a black picture agrees with anything black"
        value = np.maximum(np.abs(a[..., :3]), np.abs(b[..., :3]))
        step = 2.0 ** (np.floor(np.log2(np.maximum(value, 2.0**-14))) - 10)
        return np.asarray((np.abs(a - b)[..., :3] / np.maximum(step, 1e-4 * value)).max(axis=-1))

    return measure
