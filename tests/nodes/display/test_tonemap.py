"""Tone curves against NumPy."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from rendergraph.nodes.display import _aces2

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


def luminance(c: Floats) -> Floats:
    return np.asarray((c @ [0.2126, 0.7152, 0.0722])[..., None])


def extended(c: Floats, white: float = 4.0) -> Floats:
    y = luminance(c)
    return np.asarray(c * (1 + y / white**2) / (1 + y))


def hable(c: Floats) -> Floats:
    """((x(Ax + CB) + DE) / (x(Ax + B) + DF)) - E/F, twice the input, over the same at 11.2."""

    def film(x: Any) -> Any:
        return (x * (0.15 * x + 0.05) + 0.004) / (x * (0.15 * x + 0.5) + 0.06) - 0.02 / 0.30

    return np.asarray(film(2 * c) / film(11.2))


def agx(c: Floats) -> Floats:
    """AgX as its generator has it: one sigmoid with separate constants for toe and shoulder, in Rec. 2020."""
    to_2020 = np.array([[0.627404, 0.329283, 0.043313], [0.069097, 0.919540, 0.011362], [0.016391, 0.088013, 0.895595]])
    inset = np.array(
        [
            [0.856627153315983, 0.0951212405381588, 0.0482516061458583],
            [0.137318972929847, 0.761241990602591, 0.101439036467562],
            [0.11189821299995, 0.0767994186031903, 0.811302368396859],
        ]
    )
    outset = np.array(
        [
            [1.1271005818144368, -0.11060664309660323, -0.016493938717834573],
            [-0.1413297634984383, 1.157823702216272, -0.016493938717834257],
            [-0.14132976349843826, -0.11060664309660294, 1.2519364065950405],
        ]
    )
    stops = (np.log2(np.maximum(c @ (inset @ to_2020).T, 1e-10)) + 12.47393118833) / 16.5
    stops = np.clip(stops, 0, 1)
    above = stops > 10 / 16.5
    a, b = np.where(above, 46.1410501578, -58.3373219772), np.where(above, -27.9642728229, 35.3559527134)
    curved = 0.4894370896 + 2.4 * (stops - 10 / 16.5) / (1 + 0.0196130869 * np.abs(b + a * stops) ** 1.5) ** (1 / 1.5)
    return np.asarray(np.maximum(np.maximum(curved, 0) ** 2.4 @ (np.linalg.inv(to_2020) @ outset).T, 0))


def aces2(c: Floats) -> Floats:
    """ACES 2.0 without a table; OpenColorIO gives display values, the curves here are linear."""
    encoded = _aces2.displayed(c.reshape(1, -1, 3)).astype(np.float64).reshape(c.shape)
    return np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)


CURVES: dict[str, Any] = {
    "agx": agx,
    "aces2": aces2,
    "neutral": neutral,
    "aces": aces,
    "reinhard": lambda c: c / (1 + c),
    "none": lambda c: c,
    "hable": hable,
    "reinhard_luminance": lambda c: c / (1 + luminance(c)),
    "reinhard_extended": extended,
}


def srgb(c: Floats) -> Floats:
    c = np.clip(c, 0, 1)
    return np.where(c <= 0.0031308, 12.92 * c, 1.055 * c ** (1 / 2.4) - 0.055)


@pytest.mark.nightly(keep=8)
@pytest.mark.parametrize("curve", CURVES)
@pytest.mark.parametrize("exposure", [0.0, *(pytest.param(stops, marks=pytest.mark.slow) for stops in (-2.0, 3.0))])
def test_curve(session: rg.Session, curve: str, exposure: float) -> None:
    sets = [f"display.curve={curve}", f"display.exposure={exposure}", "light.ambient=0.4", "display.dither=false"]
    frame = rg.load("forward", scene="spheres", size=(64, 48), sets=sets).render(session=session)
    scene = frame["radiance"][..., :3].astype(np.float64)
    expected = srgb(CURVES[curve](np.maximum(scene, 0) * 2.0**exposure)) * 255
    error = np.abs(frame["image"][..., :3] - expected)
    # `aces2` interpolates in a table, and GPUs round to 8 bits within 0.6 steps.
    assert error.max() <= (3 if curve == "aces2" else 0.52 if session.device.software else 0.6)
    assert np.percentile(error, 99) < 1.3
    assert np.all(frame["image"][..., 3] == 255)


def test_grey_below_the_shoulder_stays_what_it_is() -> None:
    """Neutral keeps a base colour under light that adds the 4 % of a dielectric: c + 0.04 comes out as c."""
    grey = np.linspace(0.05, 0.7, 20)[:, None] * np.ones(3)
    np.testing.assert_allclose(neutral(grey + 0.04), grey, atol=1e-12)


# --- with floats, exposed by the picture's own average ----------------------------------------------------------------

EXPOSED = """  eye: {{type: exposure, inputs: {{radiance: picture.radiance}}}}
  display: {{type: float_tonemap, inputs: {{radiance: picture.radiance, gain: eye.gain}}, params: {{{0}}}}}
outputs: {{image: display.color}}"""
PLAIN = """  display: {{type: float_tonemap, inputs: {{radiance: picture.radiance}}, params: {{{0}}}}}
outputs: {{image: display.color}}"""
REFERENCE = {
    "reinhard": "reinhard_channel",
    "reinhard_luminance": "reinhard_luminance",
    "aces": "aces_fit",
    "hable": "hable",
    "reinhard_extended": "reinhard_extended_luminance",
    "none": "exposed",
}


@pytest.mark.parametrize("curve", REFERENCE)
def test_reference_picture(draw: Callable[..., rg.Frame], reference: dict[str, npt.NDArray[Any]], curve: str) -> None:
    """Log average, key, curve and transfer function of the reference picture at once, to float32's few digits."""
    image = draw(reference["picture"], EXPOSED.format(f"curve: {curve}, white: 3"))["image"]
    expected = srgb(reference[REFERENCE[curve]].astype(np.float64))
    np.testing.assert_allclose(image[..., :3], expected, atol=5e-6)
    if curve == "reinhard_luminance":
        np.testing.assert_allclose(image[..., :3], reference["srgb_of_reinhard_luminance"], atol=5e-6)


@pytest.mark.parametrize("curve", CURVES)
def test_a_brighter_scene_looks_the_same_under_automatic_exposure(draw: Callable[..., rg.Frame], curve: str) -> None:
    rng = np.random.default_rng(5)
    picture = np.exp(rng.normal(0, 2, (12, 20, 3))).astype(np.float32)
    text = EXPOSED.replace("}}}}\n  display", "}}, params: {{delta: 1e-9}}}}\n  display").format(f"curve: {curve}")
    once, more = (draw(picture * np.float32(factor), text)["image"] for factor in (1, 50))
    np.testing.assert_allclose(more, once, atol=1e-5)


@pytest.mark.nightly(keep=4)
@pytest.mark.parametrize("curve", CURVES)
def test_more_light_is_never_darker_and_never_past_white(draw: Callable[..., rg.Frame], curve: str) -> None:
    ramp = np.concatenate([[0], np.geomspace(1e-4, 1e9, 255)]).reshape(1, 256, 1)
    image = draw(ramp, PLAIN.format(f"curve: {curve}"))["image"][0, :, 0]
    assert abs(image[0]) < 1e-6
    assert np.all(np.diff(image) >= -2e-7)
    assert 0.99 < image[-1] <= 1


def test_the_white_point_becomes_white(draw: Callable[..., rg.Frame]) -> None:
    greys = np.array([0.5, 1.99, 2.0, 9.0]).reshape(1, 4, 1)
    text = PLAIN.format("curve: reinhard_extended, white: 2")
    image = draw(greys, text)["image"][0, :, 0]
    np.testing.assert_allclose(image[2:], 1, atol=1e-6)
    assert image[1] < 1 - 1e-3


def test_gain_multiplies_beside_the_stops(draw: Callable[..., rg.Frame]) -> None:
    """A grey picture comes out at the key, and one stop more at twice the key."""
    text = EXPOSED.replace("}}}}\n  display", "}}, params: {{key: 0.2, delta: 1e-9}}}}\n  display")
    for stops in (0, 1, -3):
        image = draw(np.full((5, 9, 1), 37.5), text.format(f"curve: none, exposure: {stops}"))["image"]
        np.testing.assert_allclose(image[..., :3], srgb(np.full((5, 9, 3), 0.2 * 2.0**stops)), rtol=1e-5)


def test_eight_bits_are_dithered_about_the_right_value(session: rg.Session, draw: Any) -> None:
    """A ramp of 24 steps over 256 columns: its mean follows the line between the steps, and whole steps are left alone."""
    width, height, low, high = 256, 64, 60, 84
    display = np.linspace(low, high, width) / 255
    linear = np.where(display > 0.04045, ((display + 0.055) / 1.055) ** 2.4, display / 12.92)
    ramp = np.tile(linear[None, :, None], (height, 1, 1)).astype(np.float32)
    text = "  show: {{type: tonemap, inputs: {{radiance: picture.radiance}}, params: {{curve: none, dither: {}}}}}\n"
    text += "outputs: {{image: show.color}}"
    plain, dithered = (draw(ramp, text.format(word))["image"][..., 0].astype(float) for word in ("false", "true"))
    right = display * 255
    assert (plain == np.round(right)).all() or (not session.device.software and np.abs(plain - right).max() <= 0.6)
    assert np.abs(dithered - right).max() < (1 if session.device.software else 1.1)
    assert np.abs(plain.mean(axis=0) - right).max() > 0.45
    assert np.abs(dithered.mean(axis=0) - right).max() < 0.1
    for level in (0, 1):
        whole = draw(np.full_like(ramp, level), text.format("true"))["image"][..., :3]
        assert (whole == 255 * level).all()
    again = [draw(ramp, text.format("true"))["image"] for _ in range(2)]
    np.testing.assert_array_equal(*again)


# --- grading ----------------------------------------------------------------------------------------------------------


def blackbody(kelvin: float) -> Floats:
    """CIE XYZ of luminance 1 from Planck's law and the colour matching functions (fits of Wyman et al. 2013)."""
    nm = np.arange(380, 781, 1.0)
    power = nm**-5 / np.expm1(1.438776877e7 / (nm * kelvin))

    def lobe(height: float, mean: float, below: float, above: float) -> Floats:
        return np.asarray(height * np.exp(-0.5 * ((nm - mean) * np.where(nm < mean, below, above)) ** 2))

    x = lobe(0.362, 442.0, 0.0624, 0.0374) + lobe(1.056, 599.8, 0.0264, 0.0323) - lobe(0.065, 501.1, 0.0490, 0.0382)
    y = lobe(0.821, 568.8, 0.0213, 0.0247) + lobe(0.286, 530.9, 0.0613, 0.0322)
    z = lobe(1.217, 437.0, 0.0845, 0.0278) + lobe(0.681, 459.0, 0.0385, 0.0725)
    xyz = np.array([(power * each).sum() for each in (x, y, z)])
    return np.asarray(xyz / xyz[1])


@pytest.mark.parametrize("kelvin", [2000.0, 3200.0, 5000.0, 12000.0])
def test_light_of_the_chosen_temperature_looks_like_daylight(draw: Callable[..., rg.Frame], kelvin: float) -> None:
    """A grey card under a blackbody gets the colour that it has under one of 6500 K."""
    to_rgb = np.linalg.inv([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]])
    lit, wanted = 0.1 * to_rgb @ blackbody(kelvin), 0.1 * to_rgb @ blackbody(6500)
    text = PLAIN.format(f"curve: none, white_balance: {kelvin}")
    image = draw(np.broadcast_to(lit, (1, 4, 3)), text)["image"][0, 0, :3]
    np.testing.assert_allclose(image, srgb(wanted), atol=0.02)


def test_contrast_and_saturation(draw: Callable[..., rg.Frame]) -> None:
    colors = np.array([[[0.18, 0.18, 0.18], [0.36, 0.09, 0.18], [0.02, 0.7, 0.3]]])
    image = draw(colors, PLAIN.format("curve: none, contrast: 1.5, saturation: 0.5"))["image"][..., :3]
    steep = 0.18 * (colors / 0.18) ** 1.5
    np.testing.assert_allclose(image, srgb((steep + luminance(steep)) / 2), atol=1e-5)
    grey = draw(colors, PLAIN.format("curve: none, saturation: 0"))["image"][..., :3]
    np.testing.assert_allclose(grey, srgb(np.broadcast_to(luminance(colors), colors.shape)), atol=1e-5)
