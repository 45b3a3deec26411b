"""Exponential shadow maps: given values, and the whole chain in NumPy."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest


def test_given_values(glsl_function: Callable[..., float], shared: Path) -> None:
    for case in json.loads((shared / "reference" / "b7_post" / "values.json").read_text())["esm"]["cases"]:
        call = f"share_lit(exp(exponent * {case['occluder']!r}), 0.0, {case['receiver']!r})"
        found = glsl_function("shadow_esm.glsl", "share_lit", call, exponent=case["c"])
        assert found == pytest.approx(case["value"], rel=1e-4)


@pytest.mark.slow
@pytest.mark.parametrize(("scene", "radius"), [("shadow_study", 7), ("shadow_study", 0), ("cornell_box", 3)])
def test_the_whole_chain_in_numpy(look: Any, boxed: Any, bilinear: Any, scene: str, radius: int) -> None:
    seen = look("shadow-esm", f"shadows.radius={radius}", "shadows.exponent=60", scene=scene, resolution=512)
    there = (seen.depth < 1).astype(float)
    u, v = seen.places[..., 0], seen.places[..., 1]
    mean = bilinear(boxed(there * np.exp(60 * seen.fraction), radius), u, v)
    empty = 1 - bilinear(boxed(there, radius), u, v)
    expected = np.minimum(mean * np.exp(-60 * seen.receiver) + empty, 1)
    inside = seen.seen & np.all((seen.places[..., :2] > 0) & (seen.places[..., :2] < 1), axis=-1)
    assert np.mean(expected[inside] < 0.05) > 0.01
    assert np.mean((expected[inside] > 0.05) & (expected[inside] < 0.95)) > 0.01
    wrong = np.abs(seen.visibility - expected)[inside]
    assert np.quantile(wrong, 0.995) < 2e-3
    assert wrong.mean() < 2e-4
