"""The pipeline `full`: each of its parts shows in the picture, and its eye adapts."""

from __future__ import annotations

import numpy as np
import pytest

import rendergraph as rg

SIZE = (80, 45)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("without", "least"),
    [
        ("shadows.angle=0", 0.2),
        ("ao.enabled=false", 0.5),
        ("gi.enabled=false", 0.5),
        ("light.environment=null", 5),
        ("exposure.enabled=false", 5),
        ("bloom.enabled=false", 0.2),
        ("aa.enabled=false", 0.2),
    ],
)
def test_each_part_shows(session: rg.Session, without: str, least: float) -> None:
    """By the mean of what differs, in 255ths."""
    sets = ["sun.resolution=1024", "environment.size=32"]
    whole, less = (
        np.asarray(session.render(rg.load("full", size=SIZE, sets=[*sets, *more]), outputs=["image"])["image"], float)
        for more in ([], [without])
    )
    assert 40 < whole[..., :3].mean() < 200
    assert np.abs(whole - less).mean() > least


@pytest.mark.slow
def test_its_eye_adapts(session: rg.Session) -> None:
    """From dazzled, second by second, to what the picture asks for."""
    sets = ["sun.resolution=256", "environment.size=32", "exposure.start=20", "exposure.limit=8"]
    pipeline = rg.load("full", size=SIZE, sets=sets)
    seen = [frame["image"][..., :3].mean() for frame in session.frames(pipeline, frames=range(1, 7), fps=1.0)]
    assert seen[0] < 0.6 * seen[-1]
    assert np.all(np.diff(seen) >= 0)
