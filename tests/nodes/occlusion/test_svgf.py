"""Variance-guided filtering: the error against more samples, what a still picture converges to, and what it keeps."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest

import rendergraph as rg

Floats = npt.NDArray[np.float64]

ROOM = """scene: 1
objects:
  floor: {shape: plane, size: [6, 6], material: grey}
  wall: {shape: plane, size: [6, 6], rotate_degrees: [90, 0, 0], at: [0, 1, -2], material: red}
  ball: {shape: sphere, radius: 0.6, at: [0, 0.6, -0.5], material: white}
materials:
  grey: {base_color: [0.5, 0.5, 0.5], roughness: 1}
  red: {base_color: [0.7, 0.1, 0.1], roughness: 1}
  white: {base_color: [0.9, 0.9, 0.9], roughness: 0.6}
lights: {sun: {type: directional, direction: [-0.5, -1, -0.6], intensity: 2}}
cameras: {main: {eye: [0, 1.2, 4], target: [0, 0.8, 0], fov_y_degrees: 40, near: 0.1, far: 20}}
"""
SIZE = (40, 24)


@pytest.fixture(scope="module")
def room(tmp_path_factory: pytest.TempPathFactory) -> Path:
    file = tmp_path_factory.mktemp("room") / "scene.yaml"
    file.write_text(ROOM)
    return file


def frames(session: rg.Session, room: Path, count: int, *sets: str, still: int | None = 1) -> list[dict[str, Floats]]:
    """The smooth and the raw picture of each frame, RGB, and the variance before the filter."""
    ports = {"smooth": "filter.denoised", "raw": "light.radiance", "variance": "filter.variance"}
    patch = {"outputs": {"image": None, "radiance": None, **ports}}
    pipeline = rg.load(
        "path-traced-denoised",
        scene=room,
        size=SIZE,
        sets=("light.ambient=0.4", "light.max_bounces=1", "light.environment=null", *sets),
        patches=[patch],
    )
    shown = session.frames(pipeline, frames=range(1, count + 1), outputs=tuple(ports), warm_up=False, still=still)
    return [{name: np.asarray(frame.arrays[name], np.float64)[..., :3] for name in ports} for frame in shown]


@pytest.fixture(scope="module")
def still(session: rg.Session, room: Path) -> Sequence[dict[str, Floats]]:
    """64 frames in which nothing moves."""
    return frames(session, room, 64)


@pytest.fixture(scope="module")
def short(session: rg.Session, room: Path) -> Sequence[dict[str, Floats]]:
    """The first 16 of them."""
    return frames(session, room, 16)


@pytest.fixture(scope="module")
def truth(session: rg.Session, room: Path) -> Floats:
    return frames(session, room, 1, "light.samples=256", "light.seed=5")[0]["raw"]


def error(found: Floats, truth: Floats) -> float:
    return float(np.sqrt(np.mean((found - truth) ** 2)))


def test_the_filter_takes_noise(short: Sequence[dict[str, Floats]], truth: Floats) -> None:
    """Where there is little noise, a filtered picture is as good as one of four times as many samples."""
    first, sixteen = short[0], short[15]
    assert error(first["smooth"], truth) < 0.5 * error(first["raw"], truth)
    assert error(sixteen["smooth"], truth) < 0.6 * error(sixteen["raw"], truth)
    assert first["smooth"].mean() == pytest.approx(truth.mean(), rel=0.05)


@pytest.mark.nightly
def test_a_still_picture_converges_to_the_mean_of_its_samples(still: Sequence[dict[str, Floats]]) -> None:
    away = [error(frame["smooth"], frame["raw"]) for frame in (still[3], still[15], still[63])]
    assert away[1] < 0.7 * away[0]
    assert away[2] < 0.7 * away[1]
    assert away[2] < 0.04 * still[63]["raw"].mean()


def test_the_mean_is_that_of_the_samples_without_the_filter(session: rg.Session, room: Path) -> None:
    """Samples are recovered from the source's mean, and nothing is lost by the division by albedo."""
    last = frames(session, room, 8, "filter.luminance_tolerance=0")[-1]
    np.testing.assert_allclose(last["smooth"], last["raw"], rtol=0.03, atol=2e-3)


@pytest.mark.nightly
def test_the_variance_falls_with_the_number_of_frames(still: Sequence[dict[str, Floats]], truth: Floats) -> None:
    """It is that of the mean: a quarter after four times as many frames, and what the errors are on average."""
    early, late = (still[number]["variance"][..., 0].mean() for number in (15, 63))
    assert early / late == pytest.approx(4, rel=0.2)
    albedo = np.maximum(np.array([0.5, 0.5, 0.5]), 0.05)
    floor = slice(16, 24)  # grey, so luminance over albedo is twice the value
    found = (((still[15]["raw"] - truth)[floor, :, 0] / albedo[0]) ** 2).mean()
    assert still[15]["variance"][floor, :, 0].mean() == pytest.approx(found, rel=0.35)


@pytest.mark.nightly
def test_a_plate_that_glows_leaves_no_trail_on_the_floor_in_its_plane(session: rg.Session, room: Path) -> None:
    """The floor that it uncovers begins anew, and the plate goes on; without the objects' numbers it is smeared."""
    moving = room.with_name("moving.yaml")
    plate = "  plate: {shape: box, size: [1, 0.01, 1], material: lamp}\n"
    lamp = "  lamp: {base_color: [0.5, 0.5, 0.5], roughness: 1, emissive: [2, 2, 2]}\n"
    keys = "keyframes: {objects.plate.at: {0: [-2, 0.006, 0.5], 1: [4, 0.006, 0.5]}}\n"
    text = ROOM.replace("  ball:", f"{plate}  ball:").replace("lights:", f"{lamp}lights:")
    moving.write_text(text.replace("cameras:", f"{keys}cameras:"))
    pictures = {}
    for instance in ("light.instance", "null"):
        *_, before, last = frames(
            session, moving, 8, "filter.luminance_tolerance=0", f"filter.instance={instance}", still=None
        )
        pictures[instance] = last["smooth"]
        left = (before["raw"][..., 0] > 2) & (last["raw"][..., 0] < 2)  # what the plate has just uncovered
    assert left.sum() > 5
    floor, stays = last["raw"], (before["raw"][..., 0] > 2) & (last["raw"][..., 0] > 2)
    np.testing.assert_allclose(pictures["light.instance"][left], floor[left], rtol=0.03, atol=2e-3)
    assert pictures["null"][left].mean() > 1.6 * floor[left].mean()
    assert np.abs(pictures["light.instance"] - floor)[stays].max() > 0.01  # it is a mean, not the last frame
