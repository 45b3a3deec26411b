"""The shipped environments: the sky against Preetham's formulas written down once more, the studio's boxes."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest

from rendergraph.scene import environments

Floats = npt.NDArray[np.float64]
SRGB_TO_XYZ = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]])


def direction(row: npt.ArrayLike, column: npt.ArrayLike) -> Floats:
    """Of the middle of a texel of 512×256; components first."""
    azimuth = (np.asarray(column, np.float64) + 0.5) / 512 * 2 * np.pi - np.pi
    polar = (np.asarray(row, np.float64) + 0.5) / 256 * np.pi
    return np.array([np.sin(polar) * np.cos(azimuth), np.cos(polar) + 0 * azimuth, np.sin(polar) * np.sin(azimuth)])


def preetham(ahead: Floats, to_sun: Floats, t: float) -> Floats:
    """Yxy of a direction, Y in kcd/m²: appendix A of the paper, angles in radians."""
    theta, gamma = float(np.arccos(ahead[1])), float(np.arccos(ahead @ to_sun))
    sun = float(np.arccos(to_sun[1]))
    a, b, c, d, e = np.array(
        [
            [0.1787 * t - 1.4630, -0.0193 * t - 0.2592, -0.0167 * t - 0.2608],
            [-0.3554 * t + 0.4275, -0.0665 * t + 0.0008, -0.0950 * t + 0.0092],
            [-0.0227 * t + 5.3251, -0.0004 * t + 0.2125, -0.0079 * t + 0.2102],
            [0.1206 * t - 2.5771, -0.0641 * t - 0.8989, -0.0441 * t - 1.6537],
            [-0.0670 * t + 0.3703, -0.0033 * t + 0.0452, -0.0109 * t + 0.0529],
        ]
    )

    def perez(theta: float, gamma: float) -> Floats:
        found: Floats = (1 + a * np.exp(b / np.cos(theta))) * (1 + c * np.exp(d * gamma) + e * np.cos(gamma) ** 2)
        return found

    powers = np.array([sun**3, sun**2, sun, 1])
    x_rows = [[0.00166, -0.00375, 0.00209, 0], [-0.02903, 0.06377, -0.03202, 0.00394]]
    x_rows += [[0.11693, -0.21196, 0.06052, 0.25886]]
    y_rows = [[0.00275, -0.00610, 0.00317, 0], [-0.04214, 0.08970, -0.04153, 0.00516]]
    y_rows += [[0.15346, -0.26756, 0.06670, 0.26688]]
    turbidity = np.array([t * t, t, 1])
    luminance = (4.0453 * t - 4.9710) * np.tan((4 / 9 - t / 120) * (np.pi - 2 * sun)) - 0.2155 * t + 2.4192
    zenith = np.array([luminance, turbidity @ x_rows @ powers, turbidity @ y_rows @ powers])
    found: Floats = zenith * perez(theta, gamma) / perez(0.0, sun)
    return found


@pytest.mark.parametrize("turbidity", [2.0, 5.0])
def test_the_sky_is_preethams(turbidity: float) -> None:
    """Luminance and chromaticity, where the colour is one that a display has."""
    to_sun = np.array([0.5, 0.7, 0.4]) / np.linalg.norm([0.5, 0.7, 0.4])
    picture = environments.sky((-0.5, -0.7, -0.4), turbidity, shines=False).astype(np.float64)
    for row, column in ((10, 40), (60, 100), (90, 300), (100, 480), (40, 256)):
        luminance, x, y = preetham(direction(row, column), to_sun, turbidity)
        rgb = picture[row, column, :3]
        assert rgb.min() > 0
        xyz = SRGB_TO_XYZ @ rgb
        assert xyz[1] == pytest.approx(luminance / environments.KCD_PER_UNIT, rel=3e-3)
        assert (xyz[:2] / xyz.sum()) == pytest.approx([x, y], abs=1e-3)


@pytest.mark.parametrize("to_sun", [(0.5, 0.7, 0.4), (-0.6, 0.5, 0.3)])
def test_the_sun_stands_where_its_light_comes_from(to_sun: tuple[float, float, float]) -> None:
    """As bright as said on a surface that faces it, where it shines from the picture."""
    rows, columns = np.mgrid[:256, :512]
    ahead = direction(rows, columns)
    weight = np.sin((rows + 0.5) / 256 * np.pi) * (np.pi / 256) * (2 * np.pi / 512)
    unit = np.array(to_sun) / np.linalg.norm(to_sun)
    negative = (-to_sun[0], -to_sun[1], -to_sun[2])
    dim, full = (environments.sky(negative, 3.0, shines=on).astype(np.float64)[..., 1] for on in (False, True))
    peak = np.unravel_index(int(full.argmax()), full.shape)
    assert direction(*peak) @ unit > np.cos(np.radians(1))
    near = np.einsum("iyx,i->yx", ahead, unit) > np.cos(np.radians(2))
    around = np.median(full[near])
    lux = ((full - around) * weight)[near].sum()
    assert lux == pytest.approx(environments.SUN_LUX * 0.94, rel=0.03)  # of its green
    assert dim.max() < 60


def test_the_studios_light_comes_from_above() -> None:
    """Neutral; the box overhead is the brightest, the floor the darkest."""
    picture = environments.studio().astype(np.float64)
    np.testing.assert_array_equal(picture[..., 0], picture[..., 2])
    assert picture[:40].max() == pytest.approx(3.6, rel=1e-3)
    assert picture[200:, :, 0].mean() < 0.2 < picture[:, :, 0].mean() < picture[:56, :, 0].mean()
