"""The hybrid pipeline: its light against techniques that it approximates with many rays, over frames."""

from __future__ import annotations

import numpy as np
import pytest

import rendergraph as rg


@pytest.mark.nightly
def test_frames_of_few_rays_approach_many_rays(session: rg.Session) -> None:
    """A still picture of 8 frames is nearer to one of many rays than the first frame, and as bright."""
    size = (32, 18)
    many = rg.load(
        "hybrid",
        size=size,
        sets=("ao.samples=32", "gi.samples=32", "mirror.samples=32", "shadows.samples=32", "gi.scale=1"),
    )
    truth = np.asarray(session.render(many, outputs=["radiance"])["radiance"], np.float64)[..., :3]
    pipeline = rg.load("hybrid", size=size, sets=("gi.scale=1",))
    frames = [
        np.asarray(frame["radiance"], np.float64)[..., :3]
        for frame in pipeline.frames(session=session, frames=range(1, 9), outputs=("radiance",))
    ]
    off = [np.abs(frame - truth).mean() for frame in (frames[0], frames[-1])]
    assert off[1] < off[0] < 0.1 * truth.mean()
    assert frames[-1].mean() == pytest.approx(truth.mean(), rel=0.02)
