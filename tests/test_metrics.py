"""Metrics against pictures with a known answer, and against other people's programs where those are installed."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
import pytest

from rendergraph import metrics
from rendergraph.errors import InputError
from rendergraph.images import from_srgb, to_srgb

BLACK, WHITE = np.zeros((24, 32, 3)), np.ones((24, 32, 3))


def noise(shape: tuple[int, ...] = (40, 48, 3), seed: int = 1) -> npt.NDArray[np.float64]:
    return np.random.default_rng(seed).random(shape)


def test_equal_pictures_have_no_error() -> None:
    picture = (noise() * 255).astype(np.uint8)
    found, map_ = metrics.measure(picture, picture)
    assert found == metrics.SAME
    assert not map_.any()


def test_black_against_white_is_as_bad_as_can_be() -> None:
    found, map_ = metrics.measure(BLACK, WHITE)
    assert found.rmse == 1
    assert found.psnr == 0
    assert found.ssim < 1e-3
    assert found.flip == pytest.approx(1, abs=0.05)
    assert map_.shape == (24, 32)


def test_light_against_none_is_compared_as_it_is() -> None:
    """HDR-FLIP takes its exposures from the reference, and black has none."""
    for bright in (1.0, 7.0):
        found, _ = metrics.measure(np.full((24, 32, 3), bright, np.float32), np.zeros((24, 32, 3)), encoding="linear")
        assert found.flip == pytest.approx(metrics.measure(WHITE, BLACK)[0].flip, abs=1e-6)
    dim = metrics.measure(np.full((24, 32, 3), 0.01, np.float32), np.zeros((24, 32, 3)), encoding="linear")[0].flip
    assert 0 < dim < found.flip


def test_a_constant_offset_has_that_rmse() -> None:
    found, _ = metrics.measure(np.full((16, 16, 3), 0.5), np.full((16, 16, 3), 0.6))
    assert found.rmse == pytest.approx(0.1)
    assert found.psnr == pytest.approx(20)


def test_alpha_does_not_count_and_grey_is_three_channels() -> None:
    a = np.concatenate([noise(), np.zeros((40, 48, 1))], axis=-1)
    b = a.copy()
    b[..., 3] = 1
    assert metrics.measure(a, b)[0] == metrics.SAME
    grey = noise((20, 20))
    assert metrics.measure(grey, np.repeat(grey[..., None], 3, axis=-1))[0] == metrics.SAME


def test_bytes_are_fractions_of_255() -> None:
    picture = (noise() * 255).astype(np.uint8)
    assert metrics.measure(picture, picture / 255.0)[0].rmse < 1e-12


def test_errors_grow_with_noise() -> None:
    picture = noise()
    found = [
        metrics.measure(np.clip(picture + amount * (noise(seed=2) - 0.5), 0, 1), picture)[0] for amount in (0.1, 0.4)
    ]
    assert found[0].rmse < found[1].rmse
    assert found[0].flip < found[1].flip
    assert found[0].ssim > found[1].ssim


def test_linear_pictures_are_measured_in_light() -> None:
    picture = noise() * 8
    found, _ = metrics.measure(picture + 0.5, picture, encoding="linear")
    assert found.rmse == pytest.approx(0.5)
    assert 0 < found.flip < 1
    assert metrics.measure(picture, picture, encoding="linear")[0] == metrics.SAME


def test_broken_values_are_not_overlooked() -> None:
    picture = noise()
    for value in (math.nan, math.inf, -math.inf):
        broken = picture.copy()
        broken[3, 4] = value
        for pair in ((broken, picture), (picture, broken), (broken, broken + 0)):
            found, _ = metrics.measure(*pair, encoding="linear")
            assert all(map(math.isnan, (found.rmse, found.psnr or 0, found.ssim, found.flip)))


def test_small_pictures_have_a_similarity_too() -> None:
    picture = noise((4, 6, 3))
    assert metrics.ssim(picture, picture) == pytest.approx(1)
    assert metrics.ssim(picture, 1 - picture) < 0.5


def test_sizes_must_agree_and_the_message_names_both() -> None:
    message = r"RG520 'one' has 32×24 pixels, but 'two.png' has 8×8 pixels; render both at one size: --size 8x8"
    with pytest.raises(InputError, match=message):
        metrics.measure(BLACK, np.zeros((8, 8, 3)), names=("one", "two.png"))


def test_similarity_is_scikit_images() -> None:
    other = pytest.importorskip("skimage.metrics")
    a = noise()
    b = np.clip(a + 0.3 * (noise(seed=2) - 0.5), 0, 1)
    options = {
        "channel_axis": -1,
        "data_range": 1,
        "gaussian_weights": True,
        "sigma": 1.5,
        "use_sample_covariance": False,
    }
    assert metrics.ssim(a, b) == pytest.approx(other.structural_similarity(a, b, **options), abs=1e-9)


@pytest.mark.parametrize("encoding", ["display", "linear"])
def test_flip_is_the_authors_own(encoding: metrics.Encoding) -> None:
    evaluator = pytest.importorskip("flip_evaluator")
    a, b = (from_srgb(noise(seed=seed)) for seed in (1, 2))
    found = (
        metrics.flip(to_srgb(a), to_srgb(b)) if encoding == "display" else metrics.flip(4 * a, 4 * b, encoding="linear")
    )
    scale, kind = (1, "LDR") if encoding == "display" else (4, "HDR")
    _, mean, _ = evaluator.evaluate(
        (scale * b).astype(np.float32), (scale * a).astype(np.float32), kind, inputsRGB=False
    )
    assert float(found.mean()) == pytest.approx(mean, abs=1e-4)


def test_what_was_computed_is_recorded() -> None:
    told = metrics.description()
    assert told["flip"]["library"].startswith("OpenImageIO 3.")
    assert told["ssim"]["window"] == 11
