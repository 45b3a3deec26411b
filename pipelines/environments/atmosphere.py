"""Sky light by S. Hillaire, "A Scalable and Production Ready Sky and Atmosphere Rendering Technique", EGSR 2020.

Air scatters as Rayleigh found, haze as Mie did, and ozone absorbs. Three tables make it fast: how much sunlight passes
through the air, what all orders of scattering but the first add, and the sky around the viewer. Lengths are in
kilometres, coefficients per kilometre, for light of 680, 550 and 440 nm as red, green and blue. The sun sheds 1 on a
surface outside the atmosphere.
"""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt
from msgspec import Struct

Array: TypeAlias = npt.NDArray[np.floating[Any]]
Numbers: TypeAlias = Array | np.floating[Any]

GROUND, TOP = 6360.0, 6460.0
"""Radii of the ground and of the top of the atmosphere."""
VIEWER = 0.2
"""Height of the viewer, which puts some haze in front of the horizon."""
_RAYLEIGH = np.array([5.802e-3, 13.558e-3, 33.1e-3], np.float32)
_OZONE = np.array([0.650e-3, 1.881e-3, 0.085e-3], np.float32)
_MIE, _MIE_ABSORBED, _ASYMMETRY = 3.996e-3, 0.444e-3, 0.8
_STEPS = 32
CLEAN_AIR_DEPTH = float(8 * _RAYLEIGH[1])
"""Optical depth of the air above the ground, straight up, for green light."""
HAZE_DEPTH = 1.2 * (_MIE + _MIE_ABSORBED)
"""Optical depth of the aerosols, likewise."""


class Atmosphere(Struct, frozen=True, eq=False):
    """The tables of one atmosphere.

    Attributes:
        haze: how much denser the aerosols are than on a clear day.
        albedo: reflectance of the ground, 0 to 1.
        transmittance: (48, 128, 3) by height and cosine to the zenith, as Bruneton and Neyret (2008) space them.
        scattered: (16, 24, 3) by height and the sun's cosine: what further orders of scattering add to a point.
    """

    haze: float
    albedo: float
    transmittance: Array
    scattered: Array


def atmosphere(haze: float = 1.0, albedo: float = 0.2) -> Atmosphere:
    """Return the tables of an atmosphere."""
    made = Atmosphere(haze, albedo, _transmittance_table(haze), np.zeros((16, 24, 3), np.float32))
    return Atmosphere(haze, albedo, made.transmittance, _scattering_table(made))


def sun_color(haze: float, elevation: float, height: float = VIEWER) -> Array:
    """Return the sunlight that arrives at a height, (3,), for an elevation in radians; 0 below the horizon."""
    radius, up = np.float32(GROUND + height), np.float32(math.sin(elevation))
    length = float(_distance_to(TOP, radius, up))
    edges = np.linspace(0, length, 257)
    t = (edges[:-1] + edges[1:]) / 2
    here = np.sqrt(float(radius) ** 2 + t**2 + 2 * float(radius) * t * float(up))
    depth = (_media(haze, here - GROUND)[2] * np.diff(edges)[:, None]).sum(axis=0)
    return np.asarray(np.exp(-depth) * _seen(radius, up), np.float32)


def sky_radiance(air: Atmosphere, up: Array, cosine: Array, elevation: float, height: float = VIEWER) -> Array:
    """Return the radiance of the sky without the sun's disc, and of the ground below the horizon.

    Args:
        up: cosines of the directions to the zenith, of any shape.
        cosine: their cosines to the sun, of the same shape.
        elevation: of the sun in radians.
        height: of the viewer in kilometres.
    """
    light, through, distance = _march(air, np.float32(GROUND + height), up, cosine, math.sin(elevation))
    return light + through * _ground(air, distance, np.float32(GROUND + height), up, cosine, math.sin(elevation))


def _march(
    air: Atmosphere, radius: Numbers, up: Array, cosine: Array, sun_up: float | Numbers
) -> tuple[Array, Array, Array]:
    """Return the radiance scattered along rays, their transmittance, and their distance to the ground or infinity."""
    to_ground = _distance_to(GROUND, radius, up, near=True)
    length = np.where(np.isfinite(to_ground), to_ground, _distance_to(TOP, radius, up))
    rayleigh = 3 / (16 * np.pi) * (1 + cosine**2)
    mie = _mie_phase(cosine)
    light = np.zeros((*up.shape, 3), np.float32)
    through = np.ones_like(light)
    edges = np.linspace(0, 1, _STEPS + 1, dtype=np.float32) ** 2  # air is densest near the viewer
    for begin, end in pairwise(edges):
        t, span = length * (begin + end) / 2, length * (end - begin)
        here = np.sqrt(radius**2 + t**2 + 2 * radius * t * up)
        local_sun_up = (radius * sun_up + t * cosine) / here
        air_scattering, haze_scattering, extinction = _media(air.haze, here - GROUND)
        sunlight = _sunlight(air, here, local_sun_up)
        source = air_scattering * rayleigh[..., None] + (haze_scattering * mie)[..., None]
        source = source * sunlight
        source += (air_scattering + haze_scattering[..., None]) * lookup(
            air.scattered, *_scattered_place(here, local_sun_up)
        )
        step = np.exp(-extinction * span[..., None])
        light += through * source * (1 - step) / np.maximum(extinction, 1e-9)
        through *= step
    return light, through, to_ground


def _ground(
    air: Atmosphere, distance: Array, radius: Numbers, up: Array, cosine: Array, sun_up: float | Numbers
) -> Array:
    """Return the radiance of the ground where rays end on it, from sunlight and from the light of the sky."""
    hits = np.isfinite(distance)
    t = np.where(hits, distance, 0)
    local_sun_up = (radius * sun_up + t * cosine) / np.sqrt(radius**2 + t**2 + 2 * radius * t * up)
    ground = np.full_like(t, GROUND)
    falls = _sunlight(air, ground, local_sun_up) * np.maximum(local_sun_up, 0)[..., None]
    falls = falls + np.pi * lookup(air.scattered, *_scattered_place(ground, local_sun_up))
    return np.asarray(np.where(hits[..., None], air.albedo / np.pi * falls, 0), np.float32)


def _transmittance_table(haze: float) -> Array:
    height, width = 48, 128
    x_r, x_mu = np.meshgrid(np.linspace(0, 1, height), np.linspace(0, 1, width), indexing="ij")
    horizon = math.sqrt(TOP**2 - GROUND**2)
    rho = horizon * x_r
    radius = np.sqrt(rho**2 + GROUND**2)
    nearest, farthest = TOP - radius, rho + horizon
    length = nearest + x_mu * (farthest - nearest)
    up = np.where(length > 0, (horizon**2 - rho**2 - length**2) / np.maximum(2 * radius * length, 1e-9), 1)
    up = np.clip(up, -1, 1)
    depth = np.zeros((height, width, 3))
    for step in range(_STEPS):
        t = length * (step + 0.5) / _STEPS
        here = np.sqrt(radius**2 + t**2 + 2 * radius * t * up)
        depth += _media(haze, here - GROUND)[2] * (length / _STEPS)[..., None]
    return np.exp(-depth).astype(np.float32)


def _scattering_table(air: Atmosphere) -> Array:
    """Further orders of scattering, all taken to be isotropic: the second one and the sum of a geometric series."""
    sun_up = np.linspace(-1, 1, 24, dtype=np.float32)
    radius = GROUND + np.linspace(0.01, TOP - GROUND - 0.01, 16, dtype=np.float32)
    i, j = np.meshgrid(np.arange(8), np.arange(8), indexing="ij")
    z = (1 - 2 * (i + 0.5) / 8).ravel().astype(np.float32)
    around = (2 * np.pi * (j + 0.5) / 8).ravel().astype(np.float32)
    r, s, up = radius[:, None, None], sun_up[None, :, None], z[None, None, :]  # most depends on r and up alone
    cosine = up * s + np.sqrt(np.maximum((1 - up**2) * (1 - s**2), 0)) * np.cos(around)
    # Sunlight scattered once by isotropic phase functions, and how much of any light is scattered on.
    to_ground = _distance_to(GROUND, r, up, near=True)
    length = np.where(np.isfinite(to_ground), to_ground, _distance_to(TOP, r, up))
    light = np.zeros((16, 24, 64, 3), np.float32)
    again, through = (np.full((16, 1, 64, 3), value, np.float32) for value in (0, 1))
    for step in range(_STEPS // 2):
        t, span = length * (step + 0.5) / (_STEPS // 2), length / (_STEPS // 2)
        here = np.sqrt(r**2 + t**2 + 2 * r * t * up)
        air_scattering, haze_scattering, extinction = _media(air.haze, here - GROUND)
        scattering = air_scattering + haze_scattering[..., None]
        passed = np.exp(-extinction * span[..., None])
        gathered = through * scattering * (1 - passed) / np.maximum(extinction, 1e-9)
        light += gathered * _sunlight(air, here, (r * s + t * cosine) / here) / (4 * np.pi)
        again += gathered
        through *= passed
    light += through * _ground(air, to_ground, r, up, cosine, s)
    # The mean over all directions: the phase function's 1/4π times a sphere's 4π.
    second, series = light.mean(axis=2), again.mean(axis=2)
    return np.asarray(second / (1 - series), np.float32)


def _media(haze: float, height: Array) -> tuple[Array, Array, Array]:
    """Return scattering of air (…, 3) and haze (…), and the extinction of all (…, 3), at heights above the ground."""
    height = np.maximum(height, 0).astype(np.float32)
    air = np.exp(-height / 8)[..., None] * _RAYLEIGH
    aerosol = haze * np.exp(-height / 1.2)
    ozone = np.maximum(0, 1 - abs(height - 25) / 15)[..., None] * _OZONE
    return air, _MIE * aerosol, air + ((_MIE + _MIE_ABSORBED) * aerosol)[..., None] + ozone


def _mie_phase(cosine: Array) -> Array:
    """Cornette and Shanks 1992, which reflects more light back than Henyey and Greenstein do."""
    g = _ASYMMETRY
    over = (1 - g * g) * (1 + cosine**2)
    return np.asarray(3 / (8 * np.pi) * over / ((2 + g * g) * (1 + g * g - 2 * g * cosine) ** 1.5), np.float32)


def _sunlight(air: Atmosphere, radius: Numbers, sun_up: Numbers) -> Array:
    """Return the sunlight at a radius; 0 where the ground hides the sun."""
    radius, sun_up = np.asarray(radius, np.float32), np.asarray(sun_up, np.float32)
    horizon = -np.sqrt(np.maximum(1 - (GROUND / radius) ** 2, 0))
    reach = math.sqrt(TOP**2 - GROUND**2)
    rho = np.sqrt(np.maximum(radius**2 - GROUND**2, 0))
    length = np.maximum(_distance_to(TOP, radius, np.maximum(sun_up, horizon)), 0)
    nearest = TOP - radius
    place = (length - nearest) / np.maximum(rho + reach - nearest, 1e-6)
    return np.asarray(lookup(air.transmittance, rho / reach, place) * _seen(radius, sun_up)[..., None], np.float32)


def _seen(radius: Numbers, sun_up: Numbers) -> Array:
    """Return how much of the sun's disc, half a degree wide, is above the horizon."""
    horizon = -np.sqrt(np.maximum(1 - (GROUND / radius) ** 2, 0))
    return np.asarray(np.clip((sun_up - horizon) / math.sin(math.radians(0.53)) + 0.5, 0, 1), np.float32)


def _scattered_place(radius: Array, sun_up: Array) -> tuple[Array, Array]:
    return (radius - GROUND) / (TOP - GROUND), (sun_up + 1) / 2


def _distance_to(sphere: float, radius: Numbers, up: Numbers, *, near: bool = False) -> Array:
    """Return how far a ray goes to a sphere around the planet's centre; infinity if it misses or leads away from it."""
    radius = np.asarray(radius, np.float64)  # differences of squares of thousands of kilometres
    b = radius * up
    inside = b * b - radius**2 + sphere**2
    root = np.sqrt(np.maximum(inside, 0))
    t = -b - root if near else -b + root
    return np.asarray(np.where((inside >= 0) & (t >= 0), t, np.inf), np.float32)


def lookup(table: Array, row: Array, column: Array) -> Array:
    """Return bilinear values of a table at rows and columns from 0 to 1."""
    height, width = table.shape[:2]
    y = np.clip(row, 0, 1) * (height - 1)
    x = np.clip(column, 0, 1) * (width - 1)
    y0, x0 = np.minimum(y.astype(np.int32), height - 2), np.minimum(x.astype(np.int32), width - 2)
    fy, fx = (y - y0)[..., None].astype(np.float32), (x - x0)[..., None].astype(np.float32)
    flat, at = table.reshape(-1, 3), y0 * width + x0
    above = flat.take(at, 0) * (1 - fx) + flat.take(at + 1, 0) * fx
    below = flat.take(at + width, 0) * (1 - fx) + flat.take(at + width + 1, 0) * fx
    return np.asarray(above * (1 - fy) + below * fy, np.float32)
