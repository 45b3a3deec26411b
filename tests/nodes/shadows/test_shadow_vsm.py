"""Variance shadow maps: the bound on given moments, the whole chain in NumPy, two casters over one another."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

Floats = npt.NDArray[np.float64]


def test_the_bound_on_given_moments(glsl_function: Callable[..., float], shared: Path) -> None:
    cases = json.loads((shared / "reference" / "b7_post" / "values.json").read_text())["vsm"]["cases"]
    assert any(0 < case["p_reduced"] < 1 for case in cases)
    for case in cases:
        call = f"chebyshev_bound(vec2({case['mean']!r}, {case['mean_square']!r}), {case['receiver']!r})"
        for bleeding, expected in ((0.0, case["p"]), (case["p_min"], case["p_reduced"])):
            found = glsl_function(
                "shadow_vsm.glsl", "chebyshev_bound", call, min_variance=case["min_variance"], light_bleeding=bleeding
            )
            assert found == pytest.approx(expected, rel=2e-3, abs=1e-5)


def test_the_filter_is_the_reference(shared: Path, boxed: Callable[[Floats, int], Floats]) -> None:
    maps = np.load(shared / "reference" / "b7_post" / "shadow_maps.npz")
    for power in (1, 2):
        expected = maps["vsm_moments_box15_clamp"][..., power - 1]
        np.testing.assert_allclose(boxed(maps["vsm_depth"] ** power, 7), expected, atol=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("scene", "radius"), [("shadow_study", 7), ("shadow_study", 2), ("shadow_study", 0), ("cornell_box", 4)]
)
def test_the_whole_chain_in_numpy(look: Any, boxed: Any, bilinear: Any, scene: str, radius: int) -> None:
    """Moments of the map that was drawn, blurred, interpolated, bounded: under a sun and under a spot light."""
    seen = look(
        "shadow-vsm",
        f"shadows.radius={radius}",
        "shadows.min_variance=1e-4",
        "shadows.light_bleeding=0.2",
        scene=scene,
        resolution=512,
    )
    there = (seen.depth < 1).astype(float)
    u, v, t = seen.places[..., 0], seen.places[..., 1], seen.receiver
    mean, square, covered = (
        bilinear(boxed(each, radius), u, v) for each in (there * seen.fraction, there * seen.fraction**2, there)
    )
    mean, square = mean + (1 - covered) * t, square + (1 - covered) * t**2
    variance = np.maximum(square - mean**2, 1e-4)
    share = np.where(t <= mean, 1.0, variance / (variance + (t - mean) ** 2))
    expected = np.clip((share - 0.2) / 0.8, 0, 1)
    inside = seen.seen & np.all((seen.places[..., :2] > 0) & (seen.places[..., :2] < 1), axis=-1)
    assert np.mean(expected[inside] < 0.05) > 0.01
    assert np.mean((expected[inside] > 0.05) & (expected[inside] < 0.95)) > 0.01
    wrong = np.abs(seen.visibility - expected)[inside]
    assert np.quantile(wrong, 0.995) < 0.01
    assert wrong.mean() < 1e-3


TWO_CASTERS = """scene: 1
objects:
  floor: {shape: plane, size: [8, 8], casts_shadow: false}
  lower: {shape: box, size: [4, 0.02, 4], at: [0, 1, 0]}
  upper: {shape: box, size: [4, 0.02, 4], at: [2, 3, 0]}
lights:
  sun: {type: directional, direction: [0, -1, 0], intensity: 1}
cameras:
  main: {eye: [0, 0.5, 5], target: [0, 0, 0], fov_y_degrees: 25, near: 0.1, far: 30}
"""


def test_light_bleeds_under_two_casters_as_much_as_it_must(look: Any, tmp_path: Path) -> None:
    """The upper plate's edge over the middle of the lower one: all beneath is dark, and yet the bound is not 0.

    Where a share a of the filter sees the upper plate, D above the lower, which is h above the floor, the bound is
    a (1 - a) D² / (a (1 - a) D² + (h + a D)²).
    """
    (tmp_path / "two.yaml").write_text(TWO_CASTERS)

    def beneath(bleeding: float) -> Floats:
        seen = look(
            "shadow-vsm",
            f"shadows.light_bleeding={bleeding}",
            "shadows.radius=7",
            size=(240, 60),
            scene=tmp_path / "two.yaml",
            resolution=256,
        )
        floor = (
            seen.seen & (np.abs(seen.position[..., 1]) < 1e-3) & np.all(np.abs(seen.position[..., ::2]) < 1, axis=-1)
        )
        assert floor.sum() > 200
        return np.asarray(seen.visibility[floor])

    a = np.linspace(0, 1, 10001)
    between, height = 2.0, 1.01  # tops of the plates, and of the lower one over the floor
    spread = a * (1 - a) * between**2
    worst = float((spread / (spread + (height + a * between) ** 2)).max())
    assert beneath(0.0).max() == pytest.approx(worst, rel=0.03)
    assert worst > 0.2
    assert beneath(0.1).max() == pytest.approx((worst - 0.1) / 0.9, rel=0.04)
    assert beneath(worst + 0.01).max() == 0


def test_one_flat_caster_is_exact(look: Any, tmp_path: Path) -> None:
    """What is not drawn in the map counts as the receiver: the penumbra is as wide and as dark as PCF's."""
    (tmp_path / "one.yaml").write_text("\n".join(line for line in TWO_CASTERS.split("\n") if "upper" not in line))
    options: dict[str, Any] = {"scene": tmp_path / "one.yaml", "size": (160, 60), "resolution": 128}
    vsm = look("shadow-vsm", "shadows.light_bleeding=0", "shadows.radius=7", **options)
    pcf = look("shadow-pcf", "shadows.taps=15", **options)
    floor = vsm.seen & (np.abs(vsm.position[..., 1]) < 1e-3)
    soft = floor & (pcf.visibility > 0.02) & (pcf.visibility < 0.98)
    assert soft.sum() > 30
    np.testing.assert_allclose(vsm.visibility[floor], pcf.visibility[floor], atol=2e-3)
