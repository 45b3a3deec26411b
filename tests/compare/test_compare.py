"""Pipelines against each other."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import rendergraph as rg
from rendergraph.compare.engine import compare
from rendergraph.compare.space import unique_names
from rendergraph.compare.timing import Spread, times_of
from rendergraph.errors import InputError, UsageError
from rendergraph.execute import FrameTimes, StepTime
from rendergraph.images import write
from rendergraph.metrics import SAME

SIZE = (48, 27)


def test_nothing_cannot_be_compared(gl: rg.Session) -> None:
    with pytest.raises(UsageError, match="no pipeline to compare"):
        compare([], session=gl)


@pytest.mark.slow
def test_one_pipeline_and_a_reference_by_their_names(gl: rg.Session, tmp_path: Path) -> None:
    found = compare(rg.load("overdraw", size=(8, 8)), "overdraw", frames=1, session=gl)
    assert [result.metrics for result in found.results] == [SAME]
    assert found.reference.name == "overdraw"
    for name, message in (("overdrw", "RG015 .* did you mean 'overdraw'"), ("none.png", "none.png: RG350 ")):
        with pytest.raises(InputError, match=message):
            compare("overdraw", name)
        with pytest.raises(InputError, match=message):
            rg.sweep("overdraw", {"overdraw.top": 3}, tmp_path / "out", name)


def test_a_pipeline_against_itself_is_nothing_but_zeros(gl: rg.Session) -> None:
    found = compare([rg.load("forward", size=SIZE), "forward"], frames=1, session=gl)
    assert [result.name for result in found.results] == ["forward", "forward-2"]
    for result in found.results:
        assert result.metrics == SAME
        assert result.radiance_rmse == 0
        assert result.first is None
        assert not result.difference


@pytest.mark.slow
def test_variants_are_measured_against_the_first(gl: rg.Session) -> None:
    base = rg.load("forward", size=SIZE)
    others = [base.set("display.curve", "aces"), rg.load("forward-prepass", size=SIZE)]
    found = compare([base, *others], frames=3, session=gl)
    told = json.loads(json.dumps(found.as_json()))
    first, curve, prepass = told["variants"]
    assert (first["rmse"], first["psnr"], first["ssim"], first["flip"]) == (0, None, 1, 0)
    assert curve["flip"] > 0.01
    assert curve["radiance_rmse"] == 0
    assert curve["first_difference"]["node"] == "display"
    assert curve["diff"]["parameters"] == [{"node": "display", "name": "curve", "old": "neutral", "new": "aces"}]
    assert prepass["diff"]["added"] == ["prepass"]
    assert prepass["pass_count"] == first["pass_count"] + 2
    assert [entry["node"] for entry in first["passes"]] == ["sun", "light", "display"]
    for variant in told["variants"]:
        assert variant["frames"] == 3
        spread = variant["frame_ms"]
        assert 0 < spread["min"] <= spread["p10"] <= spread["median"] <= spread["p90"] <= spread["max"]
        assert variant["memory"]["allocated_bytes"] > 0
    assert told["device"]["renderer"]
    assert told["size"] == list(SIZE)


def test_a_comparison_is_told_in_a_line_and_shown_in_a_notebook(gl: rg.Session) -> None:
    base = rg.load("forward", size=(32, 18))
    found = compare([base, base.set("display.curve", "aces")], frames=1, session=gl)
    assert repr(found).startswith("<Comparison on shapes, 32×18, FLIP against forward: forward 0.0000, forward-2 0.")
    assert all(len(repr(value)) < 100 for value in (found.reference, *found.results, found.results[1].first))
    page = found._repr_html_()
    assert page.count("data:image/png;base64,") == 3  # two pictures, one map
    assert f"FLIP {found.results[1].metrics.flip:.4f}" in page
    assert "<button" not in page


def test_all_stand_on_the_stage_of_the_first(gl: rg.Session) -> None:
    other = rg.load("forward-prepass", size=(20, 10), scene="spheres")
    found = compare([rg.load("forward", size=SIZE), other], frames=1, session=gl)
    assert found.notes == (
        "'forward-prepass' is rendered with the scene of 'forward': shapes",
        "'forward-prepass' is rendered at the size of 'forward': 48×27",
    )
    assert np.asarray(found.results[1].pixels).shape[:2] == (27, 48)
    assert found.results[1].metrics.flip < 0.01


def test_a_picture_is_a_reference(gl: rg.Session, tmp_path: Path) -> None:
    base = rg.load("forward", size=SIZE)
    frame = gl.render(base)
    frame.save(tmp_path / "truth.png")
    frame.save(tmp_path / "truth.exr")
    shown = compare([base.set("display.exposure", 1), base], tmp_path / "truth.png", frames=1, session=gl)
    assert shown.results[0].metrics.flip > 0.01
    assert shown.results[1].metrics == SAME
    assert shown.reference.kind == "file"
    light = compare([base], tmp_path / "truth.exr", frames=1, session=gl)
    assert light.reference.output == "radiance"
    assert light.results[0].metrics.rmse < 1e-3


def test_another_pipeline_is_a_reference(gl: rg.Session) -> None:
    base = rg.load("forward", size=SIZE)
    found = compare([base.set("shadows.taps", 1)], base.set("shadows.taps", 4), frames=1, session=gl)
    (result,) = found.results
    assert found.reference.kind == "pipeline"
    assert result.metrics.rmse > 0
    assert result.difference
    assert result.first is not None


def test_a_picture_of_another_size_is_refused_and_both_are_named(gl: rg.Session, tmp_path: Path) -> None:
    write(tmp_path / "small.png", np.zeros((4, 6, 3), np.uint8))
    with pytest.raises(InputError, match=r"RG520 'forward' has 48×27 pixels, but '.*small\.png' has 6×4 pixels"):
        compare([rg.load("forward", size=SIZE)], tmp_path / "small.png", frames=1, session=gl)


def test_pipelines_without_the_picture_are_refused(make: Any, gl: rg.Session, tmp_path: Path) -> None:
    write(tmp_path / "truth.png", np.zeros((8, 8, 3), np.uint8))
    pipeline = make({"p": {"type": "pattern"}}, "p.color")
    with pytest.raises(InputError, match=r"RG522 pipeline 'v1' has no output 'image' to compare; available: radiance"):
        compare([pipeline], tmp_path / "truth.png", frames=1, session=gl)
    assert compare([pipeline, pipeline], frames=1, session=gl).reference.output == "radiance"


def test_later_frames_are_compared_with_what_came_before_them(make: Any, gl: rg.Session) -> None:
    nodes = {"p": {"type": "pattern"}, "t": {"type": "trail", "inputs": {"source": "p.color"}}}
    base = make(nodes, "t.color")
    errors = [
        compare([base, base.set("t.weight", 0.9)], frames=1, frame=frame, session=gl).results[1].metrics.rmse
        for frame in (1, 12)
    ]
    assert errors[0] > errors[1]


def test_names_are_made_unique() -> None:
    assert unique_names(["a", "a", "b", "a-2", "a"]) == ["a", "a-3", "b", "a-2", "a-4"]


def test_times_are_sums_of_steps_and_medians_of_frames() -> None:
    frames = [
        FrameTimes(10.0 + n, (StepTime("a", 1.0 + n, 2.0 + n), StepTime("b", 1.0, 1.0), StepTime("a", 1.0, None)))
        for n in range(3)
    ]
    found = times_of(frames, {"a": "x", "b": "y"})
    assert found.frame_ms is not None
    assert found.frame_ms.median == 11
    assert found.gpu_ms == Spread(4.0, 3.0, 5.0, 3.2, 4.8)
    assert [(p.node, p.type, p.cpu_ms.median) for p in found.passes] == [("a", "x", 3.0), ("b", "y", 1.0)]
    part = times_of(frames, {"first": "x", "second": "x"}, {"first": "a", "second": "a", "gone": "c"})
    assert part.frame_ms is None
    assert part.cpu_ms.median == 6
    assert [p.node for p in part.passes] == ["first", "second"]
