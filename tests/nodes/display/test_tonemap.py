"""Tone curves against NumPy."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

import rendergraph as rg

Floats = npt.NDArray[np.float64]


def neutral(c: Floats) -> Floats:
    """The Khronos PBR Neutral tone mapper, by its specification's text."""
    out = np.empty_like(c)
    for index, pixel in enumerate(c.reshape(-1, 3)):
        x = pixel.min()
        offset = x - 6.25 * x * x if x < 0.08 else 0.04
        pixel = pixel - offset
        peak = pixel.max()
        if peak >= 0.76:
            d = 1 - 0.76
            new_peak = 1 - d * d / (peak + d - 0.76)
            pixel = pixel * new_peak / peak
            g = 1 - 1 / (0.15 * (peak - new_peak) + 1)
            pixel = pixel * (1 - g) + new_peak * g
        out.reshape(-1, 3)[index] = pixel
    return out


def aces(c: Floats) -> Floats:
    return np.asarray(c * (2.51 * c + 0.03) / (c * (2.43 * c + 0.59) + 0.14))


CURVES: dict[str, Any] = {"neutral": neutral, "aces": aces, "reinhard": lambda c: c / (1 + c), "none": lambda c: c}


def srgb(c: Floats) -> Floats:
    c = np.clip(c, 0, 1)
    return np.where(c <= 0.0031308, 12.92 * c, 1.055 * c ** (1 / 2.4) - 0.055)


@pytest.mark.parametrize("curve", CURVES)
@pytest.mark.parametrize("exposure", [-2.0, 0.0, 3.0])
def test_curve(gl: Any, curve: str, exposure: float) -> None:
    sets = [f"display.curve={curve}", f"display.exposure={exposure}", "light.ambient=0.4"]
    frame = rg.load("forward", scene="spheres", size=(64, 48), sets=sets).render()
    scene = frame["radiance"][..., :3].astype(np.float64)
    expected = srgb(CURVES[curve](np.maximum(scene, 0) * 2.0**exposure)) * 255
    assert np.abs(frame["image"][..., :3] - expected).max() <= 0.51
    assert np.all(frame["image"][..., 3] == 255)


def test_grey_below_the_shoulder_stays_what_it_is() -> None:
    """Neutral keeps a base colour under light that adds the 4 % of a dielectric: c + 0.04 comes out as c."""
    grey = np.linspace(0.05, 0.7, 20)[:, None] * np.ones(3)
    np.testing.assert_allclose(neutral(grey + 0.04), grey, atol=1e-12)
