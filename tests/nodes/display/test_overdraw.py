"""Counts of fragments and lights a pixel against panes, pre-passes and NumPy."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import rendergraph as rg

PANES = """scene: 1
objects:
  a: {shape: plane, size: [2, 2], rotate_degrees: [90, 0, 0], material: pane}
  b: {shape: plane, size: [2, 1], at: [0, 0, 1], rotate_degrees: [90, 0, 0], material: pane}
  wall: {shape: plane, size: [1, 2], at: [-0.5, 0, -1], rotate_degrees: [90, 0, 0]}
  behind: {shape: plane, size: [0.5, 2], at: [0.25, 0, 0.5], rotate_degrees: [90, 0, 0]}
materials: {pane: {base_color: [1, 1, 1, 0.5], alpha_mode: blend, double_sided: true}}
cameras: {main: {eye: [0, 0, 5], target: [0, 0, 0], height: 2, near: 0.1, far: 10}}
"""


def test_each_layer_counts_once_unless_hidden(session: rg.Session, tmp_path: Path) -> None:
    """Panes over all of the picture and over its middle half, a wall at the left, a strip that hides a pane."""
    (tmp_path / "panes.yaml").write_text(PANES)
    frame = session.render(rg.load("overdraw", scene=tmp_path / "panes.yaml", size=(32, 32)), taps=["overdraw.count"])
    y, x = (np.mgrid[0:32, 0:32] + 0.5) / 16 - 1
    strip = (x > 0) & (x < 0.5)
    right = np.where(strip, 0, 1) + (np.abs(y) < 0.5) + (x < 0) + strip
    np.testing.assert_array_equal(frame.arrays["overdraw.count"][..., 0], right)
    assert frame.figures == {"mean": pytest.approx(right.mean()), "maximum": right.max()}


@pytest.mark.nightly(keep=2)
@pytest.mark.parametrize("size", [(1, 1), (7, 5), (33, 19), (64, 48)])
def test_figures_are_of_the_whole_picture(session: rg.Session, size: tuple[int, int]) -> None:
    frame = session.render(rg.load("overdraw", scene="shadow_study", size=size), taps=["overdraw.count"])
    count = frame.arrays["overdraw.count"][..., 0].astype(np.float64)
    assert frame.figures["maximum"] == count.max()
    assert frame.figures["mean"] == pytest.approx(count.mean(), rel=1e-5)


@pytest.mark.nightly
def test_behind_a_pre_pass_what_is_seen_is_drawn_once(session: rg.Session) -> None:
    pipeline = rg.load("overdraw", scene="many_lights", size=(96, 54))
    plain = session.render(pipeline, taps=["overdraw.count"]).arrays["overdraw.count"]
    behind = session.render(pipeline.set("overdraw.depth", "prepass.depth"), taps=["overdraw.count", "prepass.depth"])
    seen = behind.arrays["prepass.depth"] > 0
    assert (behind.arrays["overdraw.count"][seen] >= 1).all()
    assert (behind.arrays["overdraw.count"] > 1).mean() < 0.01  # surfaces that meet
    assert (behind.arrays["overdraw.count"][~seen] == 0).all()
    assert (plain >= behind.arrays["overdraw.count"]).all()
    assert plain.sum() > 1.02 * seen.sum()


def test_lights_count_where_they_reach(session: rg.Session) -> None:
    sets = ["overdraw.depth=prepass.depth", "overdraw.counted=lights"]
    pipeline = rg.load("overdraw", scene="many_lights", size=(48, 27), sets=sets)
    frame = session.render(pipeline, taps=["overdraw.count"])
    lights = len(pipeline.link().graph.facts.lights)
    count = frame.arrays["overdraw.count"]
    assert 2 < count.max() <= lights
    assert len(np.unique(count)) > 3
    alone = rg.load("overdraw", scene="shadow_study", size=(48, 27), sets=sets)  # one directional light
    one = session.render(alone, taps=["overdraw.count", "prepass.depth"])
    np.testing.assert_array_equal(one.arrays["overdraw.count"] == 1, one.arrays["prepass.depth"] > 0)


def test_the_legend_shows_the_colours_of_the_counts(session: rg.Session) -> None:
    frame = session.render(rg.load("overdraw", size=(320, 180)))
    picture = frame["image"]
    steps = [tuple(picture[180 - 4, 2 + 11 * n + 1, :3]) for n in range(8)]  # beside the digits
    assert len(set(steps)) == 8
    assert steps[-1] == (255, 255, 255)
    one = picture[picture.shape[0] // 2, picture.shape[1] // 2, :3]
    assert tuple(one) in steps
