"""Log-average luminance, the exposure that follows, and its adaptation over frames."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

import rendergraph as rg

Floats = npt.NDArray[Any]
Draw = Callable[..., rg.Frame]
Frames = Callable[..., list[rg.Frame]]
Noise = Callable[..., Floats]

RELATIVE = 3e-6  # float32 sums of a few thousand logarithms


def nodes(*, previous: bool = False, **params: object) -> str:
    before = ", before: eye.luminance@previous" if previous else ""
    return (
        f"  eye: {{type: exposure, inputs: {{radiance: picture.radiance{before}}}, params: {json.dumps(params)}}}\n"
        "outputs: {luminance: eye.luminance, gain: eye.gain}"
    )


def luminance(picture: Floats) -> Floats:
    return np.asarray(picture[..., :3].astype(np.float64) @ [0.2126, 0.7152, 0.0722])


def log_average(picture: Floats, delta: float = 1e-4) -> float:
    return float(np.exp(np.log(delta + luminance(picture)).mean()))


@pytest.mark.parametrize("delta", [1e-4, 1e-3])
def test_reference_picture(draw: Draw, reference: dict[str, Floats], shared: Path, delta: float) -> None:
    values = json.loads((shared / "reference/b7_post/values.json").read_text())["images"]["image_96x64"]
    frame = draw(reference["picture"], nodes(delta=delta))
    expected = values[f"log_average_delta_{delta}"]
    np.testing.assert_allclose(frame.arrays["luminance"], [[[expected]]], rtol=RELATIVE)
    np.testing.assert_allclose(frame.arrays["gain"], [[[values["key"] / expected]]], rtol=RELATIVE)


@pytest.mark.parametrize(
    "size",
    [(1, 1), (2, 1), (1, 7), (3, 3), (5, 4), (16, 8), (31, 17), (97, 61), (255, 3)],
    ids=lambda s: f"{s[0]}x{s[1]}",
)
def test_every_pixel_counts_the_same_at_any_size(draw: Draw, noise: Noise, size: tuple[int, int]) -> None:
    picture = noise(*size)
    frame = draw(picture, nodes(key=0.5))
    np.testing.assert_allclose(frame.arrays["luminance"], [[[log_average(picture)]]], rtol=RELATIVE)
    np.testing.assert_allclose(frame.arrays["gain"], [[[0.5 / log_average(picture)]]], rtol=RELATIVE)


def test_one_bright_pixel_weighs_the_same_wherever_it_is(draw: Draw) -> None:
    """13 × 7: every level of the chain has an odd side, where a mean of 2 × 2 would drop or double the border."""
    black = np.zeros((7, 13, 3), np.float32)
    for y, x in ((0, 0), (6, 12), (3, 6), (6, 0), (2, 11)):
        picture = black.copy()
        picture[y, x] = 100.0
        expected = log_average(picture)
        np.testing.assert_allclose(draw(picture, nodes()).arrays["luminance"], [[[expected]]], rtol=RELATIVE)


def metered(picture: Floats, low: float, high: float, center: float) -> float:
    """The average that `method: histogram` finds, by sorting: stops in bins of 1/8, weights in steps of 1/15."""
    height, width = picture.shape[:2]
    y, x = np.meshgrid(
        (np.arange(height) + 0.5) / height * 2 - 1, (np.arange(width) + 0.5) / width * 2 - 1, indexing="ij"
    )
    weights = np.floor(15 * (1 - center + center * np.exp(-2 * (x * x + y * y))) + 0.5).reshape(-1)
    stops = np.clip(np.floor((np.log2(luminance(picture)).reshape(-1) + 16) * 8), 0, 255)
    order = np.argsort(stops, kind="stable")
    ends = np.cumsum(weights[order])
    begins = ends - weights[order]
    share = np.minimum(ends, high / 100 * ends[-1]) - np.maximum(begins, low / 100 * ends[-1])
    share = np.maximum(share, 0)
    return float(2 ** ((share * (stops[order] + 0.5)).sum() / share.sum() / 8 - 16))


@pytest.mark.parametrize(("low", "high", "center"), [(0, 100, 0), (50, 95, 0.5), (20, 60, 1)])
def test_histogram(draw: Draw, low: float, high: float, center: float) -> None:
    picture = np.exp(np.random.default_rng(3).normal(-1, 2, (37, 53, 3))).astype(np.float32)
    params: dict[str, Any] = {"low_percentile": low, "high_percentile": high, "center_weight": center}
    frame = draw(picture, nodes(method="histogram", **params))
    expected = metered(picture, low, high, center)
    np.testing.assert_allclose(frame.arrays["luminance"], [[[expected]]], rtol=1e-4)
    np.testing.assert_allclose(frame.arrays["gain"], [[[0.18 / expected]]], rtol=1e-4)


def test_black_surroundings_and_a_lamp_do_not_decide(draw: Draw) -> None:
    """A grey card that fills the upper half of the histogram comes out as the key, whatever is around it."""
    picture = np.full((20, 20, 3), 0.3, np.float32)
    picture[:, :8] = 0
    picture[0, 8:12] = 1e4
    gain = (
        draw(picture, nodes(method="histogram", center_weight=0, low_percentile=50, high_percentile=95))
        .arrays["gain"]
        .item()
    )
    assert gain * 0.3 == pytest.approx(0.18, rel=2 ** (1 / 16) - 1)


def test_limit_and_compensation(draw: Draw, noise: Noise) -> None:
    for factor, expected in ((1e-6, 2**1.5), (1e6, 2**-1.5)):
        frame = draw(noise(9, 9) * np.float32(factor), nodes(limit=1.5, compensation=1, delta=1e-9))
        np.testing.assert_allclose(frame.arrays["gain"], [[[2 * expected]]], rtol=1e-6)


def test_a_brighter_scene_has_that_much_more_and_looks_the_same(draw: Draw, reference: dict[str, Floats]) -> None:
    picture = reference["picture"].astype(np.float32)
    once = draw(picture, nodes(delta=1e-7))
    lit = luminance(picture) > 1e-6
    for factor in (1 / 16, 64):  # powers of two: the pictures themselves are exact
        more = draw(picture * np.float32(factor), nodes(delta=1e-7 * factor))
        np.testing.assert_allclose(more.arrays["luminance"], once.arrays["luminance"] * factor, rtol=RELATIVE)
        exposed = picture[lit] * once.arrays["gain"][0, 0]
        np.testing.assert_allclose(picture[lit] * factor * more.arrays["gain"][0, 0], exposed, rtol=2 * RELATIVE)


def test_only_what_is_covered_counts(draw: Draw, noise: Noise) -> None:
    picture = np.concatenate([noise(24, 10), np.zeros((10, 24, 1), np.float32)], axis=-1)
    rng = np.random.default_rng(3)
    picture[..., 3] = np.where(rng.random((10, 24)) < 0.3, rng.random((10, 24)), 0)
    logs, weights = np.log(1e-4 + luminance(picture)), picture[..., 3].astype(np.float64)
    covered = np.exp((logs * weights).sum() / weights.sum())
    np.testing.assert_allclose(draw(picture, nodes()).arrays["luminance"], [[[covered]]], rtol=RELATIVE)
    everything = draw(picture, nodes(meter="all")).arrays["luminance"]
    np.testing.assert_allclose(everything, [[[log_average(picture)]]], rtol=RELATIVE)


def test_nothing_to_see_leaves_the_exposure_alone(draw: Draw) -> None:
    frame = draw(np.zeros((4, 6, 4), np.float32), nodes())
    assert frame.arrays["gain"] == 1
    black = draw(np.zeros((4, 6, 3), np.float32), nodes(delta=0.01))
    np.testing.assert_allclose(black.arrays["luminance"], [[[0.01]]], rtol=RELATIVE)


@pytest.mark.parametrize("broken", [np.nan, -5.0])
def test_a_broken_pixel_counts_as_black(draw: Draw, noise: Noise, broken: float) -> None:
    picture = noise(12, 9)
    black = picture.copy()
    picture[2, 3], black[2, 3] = broken, 0
    np.testing.assert_allclose(draw(picture, nodes()).arrays["luminance"], [[[log_average(black)]]], rtol=RELATIVE)


def test_an_infinite_pixel_is_only_very_bright(draw: Draw, noise: Noise) -> None:
    picture = noise(12, 9)
    picture[2, 3] = np.inf
    assert 0 < draw(picture, nodes()).arrays["luminance"] < 1e3


# --- over frames ------------------------------------------------------------------------------------------------------


def grey(value: float) -> Floats:
    return np.full((3, 5, 3), value, np.float32)


def over_frames(frames: Frames, picture: Any, text: str, count: int, **options: Any) -> Floats:
    drawn = frames(picture, text, frames=range(1, count + 1), **options)
    return np.array([float(frame.arrays["luminance"][0, 0, 0]) for frame in drawn])


def test_reference_adaptation(frames: Frames, shared: Path) -> None:
    case = json.loads((shared / "reference/b7_post/values.json").read_text())["images"]["adaptation"]
    text = nodes(previous=True, start=case["start"], seconds_to_light=case["tau"], seconds_to_dark=9, delta=1e-9)
    seen = over_frames(frames, grey(case["target"]), text, len(case["values"]), fps=1 / case["dt"])
    np.testing.assert_allclose(seen, case["values"], rtol=5e-6)


@pytest.mark.parametrize(("start", "target", "seconds"), [(0.01, 4.0, 0.3), (4.0, 0.01, 1.2)])
@pytest.mark.parametrize("fps", [10.0, 60.0])
def test_the_eye_follows_exponentially(frames: Frames, start: float, target: float, seconds: float, fps: float) -> None:
    """`target + (start - target) exp(-t / seconds)` with the time constant of the direction, at any frame rate."""
    text = nodes(previous=True, start=start, seconds_to_light=0.3, seconds_to_dark=1.2, delta=1e-9)
    count = 1 + int(fps)
    seen = over_frames(frames, grey(target), text, count, fps=fps)
    time = np.arange(count) / fps
    np.testing.assert_allclose(seen, target + (start - target) * np.exp(-time / seconds), rtol=1e-5)


def test_light_goes_on_and_off(frames: Frames) -> None:
    """The first frame is at once; then the light goes on for ten frames, and off again."""
    rooms = [0.1] * 5 + [10.0] * 10 + [0.1] * 10
    text = nodes(previous=True, seconds_to_light=0.2, seconds_to_dark=0.8, delta=1e-9)
    seen = over_frames(frames, lambda frame: grey(rooms[frame - 1]), text, len(rooms))
    expected = [rooms[0]]
    for room in rooms[1:]:
        old, seconds = expected[-1], 0.2 if room > expected[-1] else 0.8
        expected.append(room + (old - room) * np.exp(-1 / 30 / seconds))
    np.testing.assert_allclose(seen, expected, rtol=1e-5)


def test_no_time_constant_is_at_once(frames: Frames) -> None:
    rooms = [0.1, 10.0, 0.3]
    text = nodes(previous=True, seconds_to_light=0, seconds_to_dark=0, delta=1e-9)
    seen = over_frames(frames, lambda frame: grey(rooms[frame - 1]), text, 3)
    np.testing.assert_allclose(seen, rooms, rtol=RELATIVE)


def test_without_last_frame_it_adapts_at_once(frames: Frames) -> None:
    seen = over_frames(frames, lambda frame: grey(float(frame)), nodes(start=50, delta=1e-9), 3)
    np.testing.assert_allclose(seen, [1, 2, 3], rtol=RELATIVE)


@pytest.mark.slow
def test_shipped_pipelines(session: rg.Session) -> None:
    """`adaptation` is `hdr` from its first frame on; an eye that comes from the light begins dark and ends there."""
    taps = ["exposure.luminance"]
    settled = session.render(rg.load("hdr", size=(48, 32)), taps=taps)
    first = session.render(rg.load("adaptation", size=(48, 32)), taps=taps)
    np.testing.assert_array_equal(first["image"], settled["image"])
    coming = rg.load("adaptation", size=(48, 32), sets=["exposure.start=2"])
    shown = [session.render(coming, frames=range(1, n + 1), fps=10, taps=taps) for n in (1, 11, 200)]
    assert [frame["image"].mean() for frame in shown] == sorted(frame["image"].mean() for frame in shown)
    assert shown[0].arrays["exposure.luminance"] == 2
    at_once, start = float(settled.arrays["exposure.luminance"][0, 0, 0]), 2.0
    after = at_once + (start - at_once) * np.exp(-1 / 1.6)  # one second towards the dark
    np.testing.assert_allclose(shown[1].arrays["exposure.luminance"], after, rtol=1e-5)
    assert np.abs(shown[2]["image"].astype(int) - settled["image"]).max() <= 1
