"""What is above a luminance, against the reference and the formula."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

import rendergraph as rg

Floats = npt.NDArray[Any]
Draw = Callable[..., rg.Frame]
TEXT = """  bright: {{type: bright_pass, inputs: {{radiance: picture.radiance}}, params: {{threshold: {0}}}}}
outputs: {{image: bright.bright}}"""
EXPOSED = """  eye: {type: exposure, inputs: {radiance: picture.radiance}}
  bright: {type: bright_pass, inputs: {radiance: picture.radiance, gain: eye.gain}, params: {threshold: 1.5}}
outputs: {image: bright.bright, gain: eye.gain}"""


def bright(picture: Floats, threshold: float) -> Floats:
    luminance = (picture.astype(np.float64) @ [0.2126, 0.7152, 0.0722])[..., None]
    return np.asarray(picture * np.maximum(luminance - threshold, 0) / np.maximum(luminance, 1e-4))


def test_reference_picture(draw: Draw, reference: dict[str, Floats]) -> None:
    image = draw(reference["picture"], TEXT.format(1.0))["image"]
    np.testing.assert_allclose(image[..., :3], reference["bright_pass"], rtol=1e-6, atol=1e-5)
    assert np.all(image[..., 3] == 1)


def test_the_threshold_is_measured_after_exposure(draw: Draw, noise: Callable[..., Floats]) -> None:
    """What is left is still scene-linear: it is added to radiance that is exposed later."""
    picture = noise(33, 20)
    frame = draw(picture, EXPOSED)
    np.testing.assert_allclose(
        frame["image"][..., :3], bright(picture, 1.5 / frame.arrays["gain"][0, 0, 0]), rtol=1e-5, atol=1e-6
    )
    assert 0.1 < (frame["image"][..., 1] > 0).mean() < 0.9


def test_no_threshold_is_the_picture(draw: Draw, noise: Callable[..., Floats]) -> None:
    picture = noise(9, 5)
    np.testing.assert_allclose(draw(picture, TEXT.format(0.0))["image"][..., :3], picture, rtol=1e-7)


def test_what_is_no_number_goes_out(draw: Draw) -> None:
    picture = np.full((3, 4, 3), 5.0, np.float32)
    picture[1, 2] = np.nan, 5.0, 5.0
    image = draw(picture, TEXT.format(1.0))["image"]
    assert np.all(image[1, 2, :3] == 0)
    assert np.isfinite(image).all()
