"""Means of samples against NumPy."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

import rendergraph as rg
from rendergraph.errors import InputError

Floats = npt.NDArray[np.float64]
FACTORS = np.array([0.125, 1.0, 7.0, 40.0])[:, None, None, None]

SAMPLED = "  samples: {type: sampled, inputs: {source: picture.radiance}}\n"
RESOLVED = "  one: {{type: resolve, inputs: {{source: samples.radiance}}, params: {{{}}}}}\noutputs: {{radiance: one.radiance}}"


def resolved(params: str) -> str:
    return SAMPLED + RESOLVED.format(params)


def karis(samples: Floats, exposure: float) -> Floats:
    weight = 1 / (1 + 2**exposure * (samples @ [0.2126, 0.7152, 0.0722])[..., None])
    return np.asarray((samples * weight).sum(axis=0) / weight.sum(axis=0))


def curve(samples: Floats, exposure: float) -> Floats:
    scaled = samples * 2**exposure
    mean = (scaled / (1 + scaled)).mean(axis=0)
    return np.asarray(mean / (1 - mean) / 2**exposure)


def plain(samples: Floats, exposure: float) -> Floats:
    return np.asarray(samples.mean(axis=0))


@pytest.mark.parametrize("exposure", [0.0, -2.0, 3.0])
@pytest.mark.parametrize("average", [karis, curve, plain])
def test_samples_are_averaged_as_they_look(
    draw: Any, noise: Any, average: Callable[[Floats, float], Floats], exposure: float
) -> None:
    picture = np.minimum(noise(9, 7), 50.0)
    params = f"average: {average.__name__}, exposure: {exposure}"
    shown = draw(picture, resolved(params))["radiance"]
    right = average(FACTORS * picture.astype(np.float64), exposure)
    # Back from x/(1+x) the last bits of what is near 1 count as often as the radiance is above 1.
    tolerance = 3e-4 if average is curve else 2e-6
    np.testing.assert_allclose(shown[..., :3], right, rtol=tolerance, atol=1e-7)
    assert (shown[..., 3] == 1).all()


def test_the_plain_mean_is_the_devices(draw: Any, noise: Any) -> None:
    frame = draw(noise(9, 7), resolved("average: plain"))
    assert "one" in {entry["node"] for entry in frame.passes}


def test_the_display_takes_the_mean_by_its_own_curve(draw: Any, noise: Any) -> None:
    picture = noise(9, 7)
    text = SAMPLED + "  show: {type: float_tonemap, inputs: {radiance: samples.radiance}, params: {curve: aces}}\n"
    shown = draw(picture, text + "outputs: {image: show.color}")["image"][..., :3]
    c = FACTORS * picture.astype(np.float64)
    mean = np.clip(c * (2.51 * c + 0.03) / (c * (2.43 * c + 0.59) + 0.14), 0, 1).mean(axis=0)
    right = np.where(mean > 0.0031308, 1.055 * mean ** (1 / 2.4) - 0.055, 12.92 * mean)
    np.testing.assert_allclose(shown, right, atol=2e-6)


def test_one_sample_is_refused_by_name() -> None:
    forward = {"exposure": {"type": "exposure", "inputs": {"radiance": "light.radiance"}}}
    pipeline = rg.load("forward", sets=["light.samples=4"], patches=[{"nodes": forward}])
    said = (
        r"RG214 'exposure.radiance' expects one sample per texel, .* has 4 samples per texel; .*'resolve' between them"
    )
    with pytest.raises(InputError, match=said):
        pipeline.check()
