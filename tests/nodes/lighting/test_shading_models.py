"""The shading includes against NumPy in float64 and against independent reference values."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

Floats = npt.NDArray[np.float64]
SET = """Surface s; s.normal = n; s.view_dir = v; s.tangent = t; s.bitangent = b; s.base_color = base;
s.metallic = surface.x; s.roughness = surface.y; s.anisotropy = surface.z; s.exponent = surface.w;
s.diffuse = base * (1.0 - s.metallic); s.f0 = mix(vec3(0.04), base, s.metallic); s.f90 = 1.0;
ReflectedLight r = shade(s, l);"""
DIFFUSE = SET + "result.rgb = r.diffuse;"
SPECULAR = SET + "result.rgb = r.specular;"


def directions(count: int, seed: int) -> Floats:
    found = np.random.default_rng(seed).normal(size=(count, 3))
    return np.asarray(found / np.linalg.norm(found, axis=1, keepdims=True))


def columns(count: int = 4000, seed: int = 1, low: float = 0.1) -> dict[str, Floats]:
    """Random frames and directions above the surface, random materials."""
    rng = np.random.default_rng(seed)
    n, v, light, t = (directions(count, seed + k) for k in range(4))
    v *= np.sign((n * v).sum(1, keepdims=True))
    light *= np.sign((n * light).sum(1, keepdims=True))
    t -= n * (n * t).sum(1, keepdims=True)
    t /= np.linalg.norm(t, axis=1, keepdims=True)
    surface = np.stack(
        [rng.uniform(0, 1, count), rng.uniform(low, 1, count), rng.uniform(0, 1, count), rng.uniform(1, 40, count)], 1
    )
    return {
        "n": n,
        "v": v,
        "l": light,
        "t": t,
        "b": np.cross(n, t),
        "base": rng.uniform(0, 1, (count, 3)),
        "surface": surface,
    }


def dot(a: Floats, b: Floats) -> Floats:
    return np.asarray((a * b).sum(1, keepdims=True))


def half_way(c: dict[str, Floats]) -> Floats:
    h = c["l"] + c["v"]
    return np.asarray(h / np.linalg.norm(h, axis=1, keepdims=True))


def cook_torrance(c: dict[str, Floats], *, fast: bool) -> tuple[Floats, Floats]:
    """Diffuse and specular with the cosine, by the formulas of the papers."""
    a = c["surface"][:, 1:2] ** 2
    n_l, n_v, h = dot(c["n"], c["l"]), np.maximum(dot(c["n"], c["v"]), 1e-4), half_way(c)
    d = a**2 / (np.pi * (dot(c["n"], h) ** 2 * (a**2 - 1) + 1) ** 2)
    if fast:
        visible = 0.5 / (2 * n_l * n_v * (1 - a) + a * (n_l + n_v))
    else:
        visible = 0.5 / (n_l * np.sqrt(n_v**2 * (1 - a**2) + a**2) + n_v * np.sqrt(n_l**2 * (1 - a**2) + a**2))
    metallic = c["surface"][:, :1]
    f0 = 0.04 * (1 - metallic) + c["base"] * metallic
    f = f0 + (1 - f0) * (1 - dot(c["v"], h)) ** 5
    return (1 - metallic) * c["base"] / np.pi * n_l, d * visible * f * n_l


@pytest.mark.parametrize("smith", [0, 1])
def test_pbr_is_the_formula(evaluate: Any, shading_defines: Callable[..., Any], smith: int) -> None:
    given = columns()
    macros = shading_defines("pbr", SMITH=smith)
    diffuse, specular = cook_torrance(given, fast=smith == 1)
    np.testing.assert_allclose(evaluate("shading.glsl", given, DIFFUSE, macros)[:, :3], diffuse, rtol=2e-5, atol=1e-6)
    # Near the peak of a smooth surface float32 has few digits of 1 - (N.H)^2 left.
    np.testing.assert_allclose(evaluate("shading.glsl", given, SPECULAR, macros)[:, :3], specular, rtol=5e-3, atol=1e-5)


@pytest.mark.parametrize("smith", [0, 1])
def test_pbr_is_reciprocal(evaluate: Any, shading_defines: Callable[..., Any], smith: int) -> None:
    given = columns(low=0.3)
    turned = given | {"v": given["l"], "l": given["v"]}
    macros = shading_defines("pbr", SMITH=smith)
    there = evaluate("shading.glsl", given, SPECULAR, macros)[:, :3] / dot(given["n"], given["l"])
    back = evaluate("shading.glsl", turned, SPECULAR, macros)[:, :3] / dot(given["n"], given["v"])
    seen = np.minimum(dot(given["n"], given["l"]), dot(given["n"], given["v"]))[:, 0] > 1e-3
    np.testing.assert_allclose(there[seen], back[seen], rtol=2e-3, atol=1e-5)


@pytest.mark.parametrize("shading", ["pbr", "anisotropic"])
def test_no_white_surface_reflects_more_than_it_gets(
    evaluate: Any, shading_defines: Callable[..., Any], shading: str
) -> None:
    """The white furnace of a smooth-to-rough white metal: the hemisphere's integral stays at or below 1."""
    cells = 256
    u, w = (np.stack(np.meshgrid(*[(np.arange(cells) + 0.5) / cells] * 2), -1).reshape(-1, 2)).T
    z, phi = u, 2 * np.pi * w  # uniform over the hemisphere
    light = np.stack([np.sqrt(1 - z**2) * np.cos(phi), np.sqrt(1 - z**2) * np.sin(phi), z], 1)
    for roughness in (0.4, 0.7, 1.0):
        for cosine in (0.2, 0.6, 1.0):
            ones = np.ones((len(light), 1))
            given = {
                "n": ones * [0.0, 0, 1],
                "v": ones * [np.sqrt(1 - cosine**2), 0, cosine],
                "l": light,
                "t": ones * [1.0, 0, 0],
                "b": ones * [0.0, 1, 0],
                "base": ones * [1.0, 1, 1],
                "surface": ones * [1.0, roughness, 0.7, 1],
            }
            found = evaluate("shading.glsl", given, SPECULAR, shading_defines(shading))[:, 0]
            assert found.mean() * 2 * np.pi < 1.002


def test_anisotropic_at_zero_is_pbr(evaluate: Any, shading_defines: Callable[..., Any]) -> None:
    given = columns()
    given["surface"][:, 2] = 0
    with_grain = evaluate("shading.glsl", given, SPECULAR, shading_defines("anisotropic"))
    plain = evaluate("shading.glsl", given, SPECULAR, shading_defines("pbr"))
    np.testing.assert_allclose(with_grain, plain, rtol=1e-2, atol=1e-5)


def with_grain(c: dict[str, Floats]) -> Floats:
    """Specular with the cosine by Heitz' slopes and Lambdas (2014), for the roughnesses of KHR_materials_anisotropy."""
    across = c["surface"][:, 1:2] ** 2
    along = across + (1 - across) * c["surface"][:, 2:3] ** 2

    def slopes(w: Floats) -> Floats:
        return np.asarray((along * dot(c["t"], w)) ** 2 + (across * dot(c["b"], w)) ** 2)

    n_l, n_v, h = dot(c["n"], c["l"]), np.maximum(dot(c["n"], c["v"]), 1e-4), half_way(c)
    stretched = (dot(c["t"], h) / along) ** 2 + (dot(c["b"], h) / across) ** 2 + dot(c["n"], h) ** 2
    d = 1 / (np.pi * along * across * stretched**2)
    hidden = sum((np.sqrt(1 + slopes(w) / cosine**2) - 1) / 2 for w, cosine in ((c["l"], n_l), (c["v"], n_v)))
    f0 = 0.04 * (1 - c["surface"][:, :1]) + c["base"] * c["surface"][:, :1]
    f = f0 + (1 - f0) * (1 - dot(c["v"], h)) ** 5
    return np.asarray(f * d / (1 + hidden) / (4 * n_l * n_v) * n_l)


@pytest.mark.parametrize("shading", ["pbr", "anisotropic"])
def test_a_grain_is_the_formula(evaluate: Any, shading_defines: Callable[..., Any], shading: str) -> None:
    given = columns(low=0.2)
    macros = shading_defines(shading, ANISOTROPIC=1)
    found = evaluate("shading.glsl", given, SPECULAR, macros)[:, :3]
    np.testing.assert_allclose(found, with_grain(given), rtol=5e-3, atol=1e-5)


def test_pbr_without_a_grain_is_pbr(session: Any, evaluate: Any, shading_defines: Callable[..., Any]) -> None:
    given = columns()
    given["surface"][:, 2] = 0
    found, plain = (
        evaluate("shading.glsl", given, SPECULAR, shading_defines("pbr", **more)) for more in ({"ANISOTROPIC": 1}, {})
    )
    # To the bit, but GPUs' compilers may sum in another order.
    np.testing.assert_allclose(found, plain, rtol=0 if session.device.software else 1e-6, atol=0)


def test_phong_and_blinn_phong_are_the_formulas(evaluate: Any, shading_defines: Callable[..., Any]) -> None:
    given = columns()
    exponent, n_l = given["surface"][:, 3:4], dot(given["n"], given["l"])
    ks = 0.04 + (given["base"] - 0.04) * given["surface"][:, :1]
    mirrored = 2 * n_l * given["n"] - given["l"]
    phong = ks * np.maximum(dot(mirrored, given["v"]), 0) ** exponent
    blinn = ks * np.maximum(dot(given["n"], half_way(given)), 0) ** (4 * exponent)
    np.testing.assert_allclose(
        evaluate("shading.glsl", given, SPECULAR, shading_defines("phong"))[:, :3], phong, rtol=1e-3, atol=2e-6
    )
    np.testing.assert_allclose(
        evaluate("shading.glsl", given, SPECULAR, shading_defines("blinn_phong"))[:, :3], blinn, rtol=1e-3, atol=2e-6
    )
    diffuse = given["base"] * (1 - given["surface"][:, :1]) * n_l
    np.testing.assert_allclose(
        evaluate("shading.glsl", given, DIFFUSE, shading_defines("phong"))[:, :3], diffuse, rtol=1e-4, atol=1e-6
    )


@pytest.mark.parametrize("shading", ["phong", "blinn_phong", "pbr", "anisotropic"])
def test_nothing_comes_from_behind(evaluate: Any, shading_defines: Callable[..., Any], shading: str) -> None:
    given = columns()
    given["l"] = -given["l"]
    for statements in (DIFFUSE, SPECULAR):
        assert np.all(evaluate("shading.glsl", given, statements, shading_defines(shading)) == 0)


def test_terms_equal_the_reference_vectors(evaluate: Any, shading_defines: Callable[..., Any], shared: Path) -> None:
    cases = json.loads((shared / "reference/b6_math/vectors.json").read_text())["brdf"]["cases"]
    given = {name: np.array([case[name] for case in cases]) for name in ("n", "v", "l", "t", "b", "base")}
    given["surface"] = np.array([[case["metallic"], case["roughness"], case["anisotropy"], 1] for case in cases])
    lit = [
        i for i, case in enumerate(cases) if np.dot(case["n"], case["l"]) > 1e-3 and np.dot(case["n"], case["v"]) > 1e-3
    ]
    assert len(lit) > 5
    n_l = dot(given["n"], given["l"])
    for smith, name in ((0, "f_exact"), (1, "f_fast")):
        macros = shading_defines("pbr", SMITH=smith)
        found = sum(evaluate("shading.glsl", given, statements, macros)[:, :3] for statements in (DIFFUSE, SPECULAR))
        expected = np.array([case[name] for case in cases]) + np.array([case["f_diffuse"] for case in cases])
        exclusive = np.array([case[name] for case in cases])
        close = [np.allclose(found[lit] / n_l[lit], e[lit], rtol=2e-3, atol=1e-6) for e in (expected, exclusive)]
        assert any(close)
    specular = evaluate("shading.glsl", given, SPECULAR, shading_defines("anisotropic"))[:, :3] / n_l
    aniso = np.array([np.multiply(case["F"], case["D_aniso"] * case["V_aniso"]) for case in cases])
    np.testing.assert_allclose(specular[lit], aniso[lit], rtol=2e-3, atol=1e-6)
