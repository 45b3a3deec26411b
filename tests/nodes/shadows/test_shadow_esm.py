"""Exponential shadow maps: given values, and the whole chain in NumPy."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import rendergraph as rg


def test_given_values(glsl_function: Callable[..., float], shared: Path) -> None:
    for case in json.loads((shared / "reference" / "b7_post" / "values.json").read_text())["esm"]["cases"]:
        call = f"exponential_visibility(exponent * {case['occluder']!r}, 0.0, {case['receiver']!r})"
        found = glsl_function("shadow_esm.glsl", "exponential_visibility", call, exponent=case["c"])
        assert found == pytest.approx(case["value"], rel=1e-4)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("scene", "radius", "exponent"),
    [("shadow_study", 7, 5.0), ("shadow_study", 0, 5.0), ("shadow_study", 3, 200.0), ("cornell_box", 3, 20.0)],
)
def test_the_whole_chain_in_numpy(look: Any, boxed: Any, scene: str, radius: int, exponent: float) -> None:
    """Also where the exponentials themselves are far beyond what a float holds."""
    seen = look("shadow-esm", f"shadows.radius={radius}", f"shadows.exponent={exponent}", scene=scene, resolution=512)
    there = (seen.depth < 1).astype(float)
    z, t = np.longdouble(seen.fraction * seen.metres), seen.receiver * seen.metres
    means, empty = boxed(there * np.exp(exponent * z), radius), 1 - boxed(there, radius)
    x, y = (seen.places[..., axis] * 512 - 0.5 for axis in (0, 1))
    column, row = np.floor(x).astype(int), np.floor(y).astype(int)
    expected = np.zeros_like(t)
    for dy, of_row in ((0, 1 - (y - row)), (1, y - row)):
        for dx, of_column in ((0, 1 - (x - column)), (1, x - column)):
            texel = np.clip(row + dy, 0, 511), np.clip(column + dx, 0, 511)
            lit = np.minimum(np.minimum(means[texel] * np.exp(-exponent * np.longdouble(t)), 1) + empty[texel], 1)
            expected += of_row * of_column * lit.astype(float)
    inside = seen.seen & np.all((seen.places[..., :2] > 0) & (seen.places[..., :2] < 1), axis=-1)
    assert np.mean(expected[inside] < 0.05) > 0.01
    assert np.mean((expected[inside] > 0.05) & (expected[inside] < 0.95)) > 0.003
    wrong = np.abs(seen.visibility - expected)[inside]
    assert np.quantile(wrong, 0.99) < 5e-3
    assert wrong.mean() < 1e-3


def test_a_long_range_costs_nothing(session: rg.Session, shared: Path) -> None:
    """Boxes over 160 metres: shadows are dark, as ray casting has them, where exponentials of the range left 0.57."""
    here = shared / "reference/b2_shadows/dir_cascades"
    camera, masks = json.loads((here / "case.json").read_text())["camera"], np.load(here / "masks.npz")
    sets = ("shadows.type=shadow_esm", "shadows.radius=1")
    loaded = rg.load("forward-prepass", scene=here / "scene.glb", size=(camera["width"], camera["height"]), sets=sets)
    frame = session.render(loaded, outputs=(), taps=("shadows.visibility",), warm_up=False)
    lit = frame.arrays["shadows.visibility"][0, ..., 0]
    away = ~masks["edge"].astype(bool)
    assert lit[away & (masks["cls"] == 2)].mean() < 0.02
    assert lit[away & (masks["cls"] == 1)].mean() > 0.999
