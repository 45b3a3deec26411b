"""Convolution shadow maps: the series on given values, and the whole chain in NumPy."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

Floats = npt.NDArray[np.float64]


def series(sines: Any, cosines: Any, t: Any) -> Any:
    """Of means of sines and cosines by term."""
    c = [np.pi * (2 * k - 1) for k in range(1, len(sines) + 1)]
    return sum(2 / ck * (np.cos(ck * t) * s - np.sin(ck * t) * o) for ck, s, o in zip(c, sines, cosines, strict=True))


def test_given_values(glsl_function: Callable[..., float], shared: Path) -> None:
    cases = json.loads((shared / "reference" / "b7_post" / "values.json").read_text())["csm"]["cases"]
    assert {case["M"] for case in cases} >= {4, 8, 16}
    for case in cases:
        terms = []
        for k in range(1, case["M"] + 1):
            c = np.pi * (2 * k - 1)
            at = f"vec2(sin({c * case['occluder']!r}), cos({c * case['occluder']!r}))"
            terms.append(f"series_term({at}, {c!r}, {case['receiver']!r})")
        found = glsl_function("shadow_convolution.glsl", "series_term", " + ".join(["0.5", *terms]))
        assert found == pytest.approx(case["value"], abs=2e-5)


@pytest.mark.nightly(keep=1)
@pytest.mark.slow
@pytest.mark.parametrize(
    ("scene", "radius", "terms"),
    [("shadow_study", 7, 8), ("shadow_study", 0, 16), ("shadow_study", 2, 5), ("cornell_box", 3, 4)],
)
def test_the_whole_chain_in_numpy(look: Any, boxed: Any, bilinear: Any, scene: str, radius: int, terms: int) -> None:
    sets = (f"shadows.radius={radius}", f"shadows.terms={terms}", "shadows.offset=0.5")
    seen = look("shadow-convolution", *sets, scene=scene, resolution=512)
    there = (seen.depth < 1).astype(float)
    u, v = seen.places[..., 0], seen.places[..., 1]

    def filtered(values: Floats) -> Floats:
        return np.asarray(bilinear(boxed(there * values, radius), u, v))

    c = [np.pi * (2 * k - 1) for k in range(1, terms + 1)]
    sines, cosines = ([filtered(function(ck * seen.fraction)) for ck in c] for function in (np.sin, np.cos))
    full = filtered(np.ones_like(there))
    t = seen.receiver - 0.5 * 0.3 / terms
    expected = np.clip(0.5 * full + series(sines, cosines, t) + 1 - full, 0, 1)
    inside = seen.seen & np.all((seen.places[..., :2] > 0) & (seen.places[..., :2] < 1), axis=-1)
    assert np.mean(expected[inside] < 0.1) > 0.01
    assert np.mean((expected[inside] > 0.1) & (expected[inside] < 0.9)) > 0.01
    wrong = np.abs(seen.visibility - expected)[inside]
    assert np.quantile(wrong, 0.995) < 0.01
    assert wrong.mean() < 1e-3
