"""The pipeline `full`: each of its parts shows in the picture, and its eye adapts."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import rendergraph as rg

SIZE = (80, 45)


@pytest.mark.nightly(keep=1)
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


CLEAR = """scene: 1
objects:
  floor: {shape: plane, size: [6, 6], material: red}
  wall: {shape: box, size: [4, 3, 0.2], at: [0, 1.5, -1], material: white}
  pane: {shape: plane, size: [8, 8], at: [0, 1, 2], rotate_degrees: [90, 0, 0], material: nothing, hidden: %s}
materials:
  red: {base_color: [0.8, 0.05, 0.05], roughness: 1}
  white: {base_color: 0.8, roughness: 1}
  nothing: {base_color: 1, transmission: 1, ior: 1, specular: 0, roughness: 0}
lights: {sun: {type: directional, direction: [0, -1, -0.3], intensity: 3, casts_shadow: false}}
cameras: {main: {eye: [0, 1.5, 5], target: [0, 1, 0]}}
"""


@pytest.mark.slow
def test_indirect_light_is_seen_through_what_is_clear(session: rg.Session, tmp_path: Path) -> None:
    """A pane that neither refracts nor reflects nor absorbs leaves the picture, its red light on the wall included."""
    drawn = []
    for hidden in ("false", "true"):
        (tmp_path / "scene.yaml").write_text(CLEAR % hidden)
        pipeline = rg.load("full", scene=tmp_path / "scene.yaml", size=SIZE, sets=["ao.enabled=false"])
        drawn.append(np.asarray(session.render(pipeline, outputs=["radiance"])["radiance"], np.float64)[..., :3])
    np.testing.assert_allclose(drawn[0], drawn[1], rtol=0.01, atol=2e-3)
    pipeline = rg.load("full", scene=tmp_path / "scene.yaml", size=SIZE, sets=["ao.enabled=false", "gi.enabled=false"])
    without = np.asarray(session.render(pipeline, outputs=["radiance"])["radiance"], np.float64)[..., :3]
    assert np.abs(drawn[0] - without).max() > 0.05
