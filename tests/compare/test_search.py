"""Searching axes: it finds known minima, goes on where it was interrupted, and says what is wrong before it draws."""

from __future__ import annotations

import math
import sys
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import rendergraph as rg
from rendergraph.compare.optimiser import BATCH_SIZE, check_search, search
from rendergraph.compare.report import sweep_page
from rendergraph.compare.results import pareto_front
from rendergraph.compare.space import Space
from rendergraph.compare.store import read_results
from rendergraph.errors import InputError, UsageError

pytest.importorskip("optuna")

BOWL = """// A bowl: how far two parameters are from a point, as light.
/*---
outputs:
  color: {semantic: radiance, format: rgba32f, doc: The distance.}
params:
  x: {default: 0, min: -10, max: 10, doc: Across.}
  y: {default: 1, min: 0.001, max: 1000, doc: Along.}
  n: {default: 3, min: 0, max: 9, doc: Which.}
---*/
uniform float x, y;
uniform int n;
out vec4 color;
void main() {
    float far = abs(x - 3.0) / 10.0 + abs(log(y / 50.0)) / 10.0 + abs(float(n) - 7.0) / 10.0;
    color = vec4(vec3(0.25 * far), 1.0);
}
"""
AXES: dict[str, Any] = {"bowl.x": "-10.0:10", "bowl.y": "log:0.001:1000", "bowl.n": "0:9:1"}


@pytest.fixture
def base(tmp_path: Path) -> rg.Pipeline:
    (tmp_path / "bowl.frag").write_text(BOWL)
    (tmp_path / "p.yaml").write_text(
        "rendergraph: 1\nsize: [8, 8]\nnodes: {bowl: {type: bowl}}\noutputs: {radiance: bowl.color}\n"
    )
    return rg.load(tmp_path / "p.yaml", plugins=[tmp_path / "bowl.frag"])


@pytest.fixture
def least(base: rg.Pipeline) -> rg.Pipeline:
    """The bottom of the bowl: black."""
    return base.set("bowl.x", 3.0).set("bowl.y", 50.0).set("bowl.n", 7)


def test_a_search_comes_nearer_than_chance(
    base: rg.Pipeline, least: rg.Pipeline, gl: rg.Session, tmp_path: Path
) -> None:
    out = tmp_path / "out"
    found = search(base, AXES, out, least, minimise=["rmse"], budget=48, frames=1, session=gl)
    assert found.search is not None
    asked = [found.search.values[name][0] for name in found.search.order if name]
    assert len(asked) == 48
    (best,) = {found.search.values[name][0] for name in found.search.front}
    assert best == min(asked)
    assert sum(sorted(asked[24:])[:12]) < 0.6 * sum(sorted(asked[:24])[:12])  # it has learned
    for result in found.comparison.results:  # what it was told is the closed form
        x, y, n = (float(result.settings[f"bowl.{name}"]) for name in "xyn")
        far = abs(x - 3) / 10 + abs(math.log(y / 50)) / 10 + abs(n - 7) / 10
        assert result.metrics.rmse == pytest.approx(0.25 * far, rel=1e-4, abs=1e-6)
    page = sweep_page(found, "rendergraph sweep")
    assert "Best runs of the search" in page
    assert len(read_results(out)[0]) == len(found.comparison.results)
    assert found.as_json()["search"]["front"] == list(found.search.front)


def test_a_search_that_was_interrupted_ends_where_it_would_have(
    base: rg.Pipeline, least: rg.Pipeline, gl: rg.Session, tmp_path: Path
) -> None:
    options: dict[str, Any] = {"minimise": ["rmse"], "frames": 1, "session": gl, "seed": 5}
    whole = search(base, AXES, tmp_path / "whole", least, budget=20, **options)

    def interrupt(done: int, budget: int) -> None:
        if done == BATCH_SIZE:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        search(base, AXES, tmp_path / "out", least, budget=20, progress=interrupt, **options)
    less = search(base, AXES, tmp_path / "out", least, budget=11, resume=True, **options)
    again = search(base, AXES, tmp_path / "out", least, budget=20, resume=True, **options)
    assert less.resumed == BATCH_SIZE
    assert again.resumed == 11
    assert whole.search
    assert less.search
    assert again.search
    assert again.search == whole.search
    assert again.search.order[:11] == less.search.order
    with pytest.raises(InputError, match="it has results of a sweep; --resume adds"):
        search(base, AXES, tmp_path / "out", least, budget=20, **options)


def test_several_things_have_a_front(base: rg.Pipeline, least: rg.Pipeline, gl: rg.Session, tmp_path: Path) -> None:
    axes = {"bowl.x": "-10.0:10", "bowl.y": [0.1, 50.0], "bowl.n": [3, 7]}
    space = Space.of(axes, zipped=[("bowl.y", "bowl.n")])
    options: dict[str, Any] = {"budget": 10, "frames": 1, "session": gl, "kept": "best"}
    found = search(base, space, tmp_path / "o", least, minimise=["rmse", "bytes"], **options)
    assert found.search is not None
    assert {result.settings["bowl.n"] for result in found.comparison.results} <= {"3", "7"}
    assert all((r.settings["bowl.y"] == "50.0") == (r.settings["bowl.n"] == "7") for r in found.comparison.results)
    (best,) = found.search.front  # all take the same memory
    assert found.search.values[best][0] == min(values[0] for values in found.search.values.values())
    assert [file.parent.name for file in (tmp_path / "o").glob("*/radiance.exr")] == [best]


def test_no_run_is_asked_for_twice_and_all_there_are_is_enough(
    base: rg.Pipeline, least: rg.Pipeline, gl: rg.Session, tmp_path: Path
) -> None:
    options: dict[str, Any] = {"minimise": ["rmse"], "frames": 1, "session": gl}
    found = search(base, {"bowl.n": "0:9:1"}, tmp_path / "o", base.set("bowl.n", 7), budget=30, **options)
    assert found.search is not None
    assert sorted(result.settings["bowl.n"] for result in found.comparison.results) == list("0123456789")
    assert len(found.search.order) == 10
    assert found.search.front == ("bowl.n=7",)
    again = search(base, {"bowl.n": "0:9:1"}, tmp_path / "o", base.set("bowl.n", 7), budget=30, resume=True, **options)
    assert (again.resumed, again.search) == (10, found.search)


@pytest.mark.slow
@settings(deadline=None, max_examples=60)
@given(st.dictionaries(st.text(max_size=3), st.tuples(*[st.integers(0, 5)] * 3), max_size=12))
def test_the_front_is_what_none_beats(values: dict[str, tuple[int, ...]]) -> None:
    front = pareto_front(values)
    for name, own in values.items():
        beaten = any(all(a <= b for a, b in zip(o, own, strict=True)) and o != own for o in values.values())
        assert (name in front) == (not beaten)


@pytest.mark.parametrize(
    ("axes", "minimise", "message"),
    [
        ({"bowl.x": "0.0:1"}, ["flpi"], "RG524 unknown objective 'flpi'; did you mean 'flip'?"),
        ({"bowl.z": "0.0:1"}, ["flip"], "-x bowl.z=0.0: RG103 node 'bowl' .* has no param or input 'z'"),
        ({"bowl.x": "0.0:20"}, ["flip"], "-x bowl.x=20.0: RG104 'bowl.x' is 20.0, it must be at most 10"),
        ({"bowl.x": [1, 2, 99]}, ["flip"], "-x bowl.x=99: RG104"),
        ({}, ["flip"], "RG524 the sweep has no axis"),
    ],
)
def test_mistakes_are_told_before_anything_is_drawn(
    base: rg.Pipeline, least: rg.Pipeline, axes: dict[str, Any], minimise: list[str], message: str
) -> None:
    with pytest.raises(InputError, match=message):
        check_search(base, Space.of(axes), least, minimise, None)


def test_a_search_wants_a_reference(base: rg.Pipeline) -> None:
    with pytest.raises(InputError, match="RG524 a search needs a reference to measure its runs against: --reference"):
        check_search(base, Space.of(AXES), None, ["ms"], None)


def test_without_the_extra_it_says_what_to_install(
    base: rg.Pipeline, least: rg.Pipeline, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "optuna", None)
    with pytest.raises(UsageError, match=r"RG500 --minimise needs optuna; pip install 'rendergraph\[search\]'"):
        search(base, AXES, tmp_path / "out", least, minimise=["flip"])
    assert not (tmp_path / "out").exists()
