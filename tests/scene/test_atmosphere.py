"""The atmosphere against float64 ray marching, the conservation of energy, and published values of clear skies."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import numpy.typing as npt
import pytest
from rendergraph.pipelines.environments import atmosphere
from rendergraph.pipelines.environments.atmosphere import GROUND, TOP, VIEWER, Atmosphere

Floats = npt.NDArray[np.float64]


def densities(height: Floats) -> tuple[Floats, Floats, Floats]:
    """Of air, aerosols and ozone, relative to those on the ground and in the middle of the layer."""
    return np.exp(-height / 8), np.exp(-height / 1.2), np.maximum(0, 1 - abs(height - 25) / 15)


def depth(origin: Floats, ahead: Floats, length: float, haze: float, steps: int = 400) -> Floats:
    """Optical depth (3,) by the midpoint rule."""
    t = (np.arange(steps) + 0.5) / steps * length
    air, aerosol, ozone = densities(np.linalg.norm(origin + t[:, None] * ahead, axis=1) - GROUND)
    rayleigh, absorbed = np.array([5.802e-3, 13.558e-3, 33.1e-3]), np.array([0.650e-3, 1.881e-3, 0.085e-3])
    extinction = air[:, None] * rayleigh + haze * 4.44e-3 * aerosol[:, None] + ozone[:, None] * absorbed
    return np.asarray(extinction.sum(axis=0) * length / steps)


def exit_of(origin: Floats, ahead: Floats, sphere: float, *, near: bool = False) -> float:
    b = float(origin @ ahead)
    root = b * b - float(origin @ origin) + sphere**2
    if root < 0:
        return math.inf
    t = -b + (-1 if near else 1) * math.sqrt(root)
    return t if t > 0 else math.inf


def single_scattering(ahead: Floats, to_sun: Floats, haze: float) -> Floats:
    """Radiance (3,) of sunlight that is scattered once, with a march to the sun from each of 160 points."""
    eye = np.array([0, GROUND + VIEWER, 0])
    length = min(exit_of(eye, ahead, TOP), exit_of(eye, ahead, GROUND, near=True))
    cosine, g = float(ahead @ to_sun), 0.8
    rayleigh = 3 / (16 * np.pi) * (1 + cosine**2)
    mie = 3 / (8 * np.pi) * (1 - g * g) * (1 + cosine**2) / ((2 + g * g) * (1 + g * g - 2 * g * cosine) ** 1.5)
    edges = np.linspace(0, 1, 161) ** 2 * length
    light, passed = np.zeros(3), np.zeros(3)
    for begin, end in pairwise(edges):
        here = eye + (begin + end) / 2 * ahead
        air, aerosol, _ = densities(np.array([np.linalg.norm(here) - GROUND]))
        span = depth(eye + begin * ahead, ahead, end - begin, haze, steps=2)
        sunlight = np.zeros(3)
        if exit_of(here, to_sun, GROUND, near=True) == math.inf:
            sunlight = np.exp(-depth(here, to_sun, exit_of(here, to_sun, TOP), haze, steps=60))
        scattered = air * np.array([5.802e-3, 13.558e-3, 33.1e-3]) * rayleigh + haze * 3.996e-3 * aerosol * mie
        light += scattered * sunlight * np.exp(-passed - span / 2) * (end - begin)
        passed += span
    return light


@pytest.mark.parametrize(("elevation", "haze"), [(60.0, 6.0), (8.0, 0.0), (8.0, 6.0)])
def test_single_scattering(elevation: float, haze: float) -> None:
    angle = math.radians(elevation)
    to_sun = np.array([math.cos(angle), math.sin(angle), 0])
    black = Atmosphere(haze, 0.0, atmosphere.atmosphere(haze).transmittance, np.zeros((2, 2, 3), np.float32))
    rays = np.array([[0, 1, 0], [-1, 0.4, 0.3], [1, 0.05, -0.4]])
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    up, cosine = rays[:, 1].astype(np.float32), (rays @ to_sun).astype(np.float32)
    found = atmosphere.sky_radiance(black, up, cosine, angle)
    expected = np.array([single_scattering(ray, to_sun, haze) for ray in rays])
    np.testing.assert_allclose(found, expected, rtol=0.03)


@pytest.mark.parametrize("elevation", [90.0, 40.0])
def test_air_that_absorbs_nothing_loses_no_light(monkeypatch: pytest.MonkeyPatch, elevation: float) -> None:
    """What reaches a black ground and what leaves the top add up to what comes in, over all orders of scattering."""
    monkeypatch.setattr(atmosphere, "_OZONE", np.zeros(3))
    monkeypatch.setattr(atmosphere, "_MIE_ABSORBED", 0.0)
    air, angle = atmosphere.atmosphere(haze=10.0, albedo=0.0), math.radians(elevation)
    z, around = np.meshgrid((np.arange(32) + 0.5) / 32, (np.arange(32) + 0.5) / 32 * 2 * np.pi, indexing="ij")
    z = z**2  # dense at the horizon
    weight = 2 * np.sqrt(z) / 32 * (2 * np.pi / 32)

    def flux(sign: float, height: float) -> Floats:
        up = (sign * z).astype(np.float32)
        cosine = up * math.sin(angle) + np.sqrt(1 - z**2) * np.cos(around) * math.cos(angle)
        light = atmosphere.sky_radiance(air, up, cosine.astype(np.float32), angle, height)
        return np.asarray((light * (z * weight)[..., None]).sum(axis=(0, 1)), np.float64)

    direct = atmosphere.sun_color(10.0, angle, 0.01) * math.sin(angle)
    total = flux(1, 0.01) + flux(-1, TOP - GROUND - 0.1) + direct
    np.testing.assert_allclose(total, math.sin(angle), rtol=0.05)


def test_sunlight_on_the_ground() -> None:
    """Through a vertical column: the closed form of exponential and triangular layers."""
    column = (
        np.array([5.802e-3, 13.558e-3, 33.1e-3]) * 8 + 2 * 4.44e-3 * 1.2 + np.array([0.650e-3, 1.881e-3, 0.085e-3]) * 15
    )
    np.testing.assert_allclose(atmosphere.sun_color(2.0, math.pi / 2, 0.0), np.exp(-column), rtol=1e-3)


def test_a_clear_sky_is_like_those_that_were_measured() -> None:
    """Of the light on level ground a fifth to a tenth comes from the sky at a high sun (Iqbal 1983); the zenith is
    bluer than daylight, and the horizon several times brighter than the zenith (CIE S 011).
    """
    air, angle = atmosphere.atmosphere(haze=6.0), math.radians(60)
    z, around = np.meshgrid((np.arange(32) + 0.5) / 32, (np.arange(32) + 0.5) / 32 * 2 * np.pi, indexing="ij")
    cosine = z * math.sin(angle) + np.sqrt(1 - z**2) * np.cos(around) * math.cos(angle)
    light = atmosphere.sky_radiance(air, z.astype(np.float32), cosine.astype(np.float32), angle)
    luminance = np.array([0.2126, 0.7152, 0.0722])
    diffuse = float((light * z[..., None]).mean(axis=(0, 1)) @ luminance * 2 * np.pi)
    direct = float(atmosphere.sun_color(6.0, angle) @ luminance) * math.sin(angle)
    assert 0.08 < diffuse / (diffuse + direct) < 0.2
    away = np.cos(around) < -0.9
    horizon, zenith = light[2][away[2]].mean(axis=0), light[-1].mean(axis=0)
    assert 2 < (horizon @ luminance) / (zenith @ luminance) < 8
    assert zenith[2] > 2.5 * zenith[0]


def test_the_sun_sets_gradually() -> None:
    dip = -math.acos(GROUND / (GROUND + VIEWER))
    seen = [float(atmosphere.sun_color(1.0, dip + math.radians(angle))[0]) for angle in (-0.3, -0.1, 0.1, 0.3)]
    assert seen[0] == 0
    assert np.all(np.diff(seen) > 0)
