"""Moment shadow maps: the bound from four means, two casters over one another, lit faces."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

Floats = npt.NDArray[np.float64]


def bound(b: Floats, t: float) -> float:
    """The least share before t of anything with the means b of z to z^4: of the three points that have them, t one."""
    hankel = np.array([[1, b[0], b[1]], [b[0], b[1], b[2]], [b[1], b[2], b[3]]])
    c = np.linalg.solve(hankel, [1, t, t * t])
    points = np.array([t, *np.sort(np.roots(c[::-1]).real)])
    weights = np.linalg.solve(np.vander(points, 3, increasing=True).T, [1, b[0], b[1]])
    return float(weights[1:][points[1:] < t].sum())


def means(points: Floats, weights: Floats) -> Floats:
    return np.array([(weights * points**power).sum() for power in (1, 2, 3, 4)])


def test_the_bound_from_four_means(glsl_function: Callable[..., float]) -> None:
    rng = np.random.default_rng(2)
    for _ in range(12):
        points, weights = np.sort(rng.uniform(0.05, 0.95, 5)), rng.dirichlet(np.ones(5))
        b, t = means(points, weights), float(rng.uniform(0.1, 0.9))
        call = f"fraction_before(vec4({', '.join(map(repr, b.tolist()))}), {t!r})"
        found = glsl_function("shadow_msm.glsl", "fraction_before", call, moment_bias=0.0)
        assert found == pytest.approx(bound(b, t), abs=3e-3)
        assert found <= weights[points < t].sum() + 3e-3


def test_two_surfaces_are_told_apart_exactly(glsl_function: Callable[..., float]) -> None:
    for share in (0.1, 0.5, 0.8):
        b = means(np.array([0.3, 0.7]), np.array([share, 1 - share]))
        for t, expected in ((0.25, 0.0), (0.5, share), (0.7, share)):
            call = f"fraction_before(vec4({', '.join(map(repr, b.tolist()))}), {t!r})"
            found = glsl_function("shadow_msm.glsl", "fraction_before", call, moment_bias=3e-6)
            assert found == pytest.approx(expected, abs=0.02)


@pytest.mark.parametrize("t", [0.5, 0.5 + 1e-7, -0.5])
def test_two_points_suffice_where_the_polynomial_is_linear(glsl_function: Callable[..., float], t: float) -> None:
    """Then the third point is infinitely far and has no weight; dividing by its coefficient left black pixels."""
    found = glsl_function(
        "shadow_msm.glsl", "fraction_before", f"fraction_before(vec4(0, 0.25, 0, 0.125), {t})", moment_bias=0.0
    )
    assert found == pytest.approx(0.5 if t > 0 else 0, abs=1e-3)


@pytest.mark.slow
def test_it_bleeds_less_than_variance(look: Any, boxed: Any, bilinear: Any) -> None:
    """Against the mean of the tests themselves, on the floor under the knot: nearer to it than two moments are."""
    errors = {}
    for kind in ("shadow_vsm", "shadow_msm"):
        sets = (f"shadows.type={kind}", "shadows.radius=7", "shadows.light_bleeding=0")
        seen = look("shadow-vsm", *sets, size=(192, 128), resolution=512)
        floor = seen.seen & (np.abs(seen.position[..., 1]) < 1e-3)
        u, v, t = seen.places[..., 0], seen.places[..., 1], np.minimum(seen.places[..., 2], 1)
        tests = np.zeros_like(t)
        for dy in range(-7, 8):
            for dx in range(-7, 8):
                tests += bilinear(seen.depth, u + dx / 512, v + dy / 512, t) / 225
        assert ((tests[floor] > 0.1) & (tests[floor] < 0.9)).mean() > 0.02
        assert np.quantile(seen.visibility[floor & (tests > 0.9999)], 0.001) > 0.95  # what is lit is lit
        dark = floor & (tests < 0.1)
        errors[kind] = float(np.quantile((seen.visibility - tests)[dark], 0.99))
    assert errors["shadow_vsm"] > 0.05
    assert errors["shadow_msm"] < 0.7 * errors["shadow_vsm"]


@pytest.mark.slow
def test_over_a_long_range_shadows_stay_dark_and_lit_floors_clean(look: Any, bilinear: Any) -> None:
    """Moments of depths from 0 to 1 leave half of the shadow of this 300 metre road too bright."""
    seen = look("shadow-vsm", "shadows.type=shadow_msm", scene="avenue", size=(192, 108), resolution=2048)
    floor = seen.seen & (np.abs(seen.position[..., 1]) < 1e-3)
    u, v, t = seen.places[..., 0], seen.places[..., 1], np.minimum(seen.places[..., 2], 1)
    offsets = np.arange(-3, 4) / 2048
    tests = np.mean([bilinear(seen.depth, u + x, v + y, t) for x in offsets for y in offsets], axis=0)
    dark, lit = seen.seen & (tests == 0), floor & (tests == 1)
    assert dark.sum() > 20
    assert lit.sum() > 500
    assert (seen.visibility[dark] > 0.1).mean() < 0.05
    assert np.quantile(seen.visibility[lit], 0.002) > 0.95
