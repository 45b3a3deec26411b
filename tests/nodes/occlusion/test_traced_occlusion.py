"""Traced occlusion against closed forms and rays in NumPy."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

import rendergraph as rg

SCENE = """scene: 1
objects:
  floor: {shape: plane, size: [80, 80]}
  wall: {shape: box, size: [2, HEIGHT, 60], at: [-1, HALF, 0]}
lights: {sun: {type: directional, direction: [-0.3, -1, 0], intensity: 2}}
cameras: {main: {eye: [1, 0.9, 0], target: [1, 0, 0], up: [0, 0, -1], height: 1, near: 0.01, far: 2}}
"""
"""A wall along z whose face is x = 0, and a camera over the floor beside it that sees 0 < x < 2."""


def draw(session: rg.Session, folder: Path, height: float, *sets: str, size: tuple[int, int] = (32, 16)) -> Any:
    text = SCENE.replace("HEIGHT", str(height)).replace("HALF", str(height / 2))
    (folder / "scene.yaml").write_text(text)
    pipeline = rg.load("ssao-gtao", scene=folder / "scene.yaml", size=size, sets=("ao.type=traced_occlusion", *sets))
    return session.render(pipeline, outputs=(), taps=("ao.occlusion", "ao.bent_normal"))


def _distances(count: int) -> npt.NDArray[np.float64]:
    return (np.arange(count) + 0.5) / count * 2.0


def test_a_tall_wall_hides_a_segment_of_the_disc_of_directions(session: rg.Session, tmp_path: Path) -> None:
    """Cosine-weighted directions are uniform on the disc below the hemisphere; those with x < -d/R meet the wall."""
    radius = 1.5
    found = draw(session, tmp_path, 40.0, f"ao.radius={radius}", "ao.samples=256").arrays["ao.occlusion"][..., 0]
    c = np.clip(_distances(32) / radius, 0, 1)
    expected = 1 - (np.arccos(c) - c * np.sqrt(1 - c * c)) / np.pi
    assert np.abs(found.mean(axis=0) - expected).max() < 0.006
    assert np.abs(found - expected).max() < 0.05


def test_a_low_wall_hides_its_form_factor(session: rg.Session, tmp_path: Path) -> None:
    """Of a long wall of height h at the distance d, seen without a limit: (1 - d / sqrt(d² + h²)) / 2."""
    found = draw(session, tmp_path, 1.0, "ao.radius=1000", "ao.samples=256").arrays["ao.occlusion"][..., 0]
    d = _distances(32)
    assert np.abs(found.mean(axis=0) - (1 - 0.5 * (1 - d / np.sqrt(d**2 + 1)))).max() < 0.006


def test_bent_normals_are_the_mean_open_direction(session: rg.Session, tmp_path: Path) -> None:
    radius, rng = 1.5, np.random.default_rng(3)
    bent = draw(session, tmp_path, 40.0, f"ao.radius={radius}", "ao.samples=256")["ao.bent_normal"][..., :3]
    u, v = rng.random((2, 200_000))
    x, z = np.sqrt(u) * np.cos(2 * np.pi * v), np.sqrt(u) * np.sin(2 * np.pi * v)
    rays = np.stack([x, np.sqrt(1 - u), z], -1)
    for column in (2, 12, 30):
        expected = rays[x > -_distances(32)[column] / radius].mean(axis=0)
        expected /= np.linalg.norm(expected)
        assert np.abs(bent[:, column].mean(axis=0) - expected).max() < 0.01


def test_frames_have_other_rays_and_a_common_mean(session: rg.Session, tmp_path: Path) -> None:
    exact = draw(session, tmp_path, 1.0, "ao.radius=1000", "ao.samples=1024").arrays["ao.occlusion"][..., 0]
    sets = ("ao.type=traced_occlusion", "ao.radius=1000", "ao.samples=4")
    pipeline = rg.load("ssao-gtao", scene=tmp_path / "scene.yaml", size=(32, 16), sets=sets)
    frames = [
        frame.arrays["ao.occlusion"][..., 0]
        for frame in pipeline.frames(session=session, frames=range(1, 33), outputs=(), taps=("ao.occlusion",))
    ]
    single = np.sqrt(np.mean((frames[0] - exact) ** 2))
    mean = np.sqrt(np.mean((np.mean(frames, axis=0) - exact) ** 2))
    assert single > 0.02
    assert mean < 0.35 * single  # independent frames: 1 / sqrt(32) = 0.18


@pytest.mark.nightly(keep=1)
@pytest.mark.parametrize("output", ["occlusion", "bent_normal"])
def test_a_reduced_scale_is_interpolated(session: rg.Session, tmp_path: Path, output: str) -> None:
    sets = ("ao.radius=1.5", "ao.samples=256")
    whole = draw(session, tmp_path, 40.0, *sets).arrays[f"ao.{output}"]
    half = draw(session, tmp_path, 40.0, *sets, "ao.scale=0.5").arrays[f"ao.{output}"]
    assert np.abs(whole - half)[:, 2:-2].mean() < 0.02


def test_no_ray_of_a_crease_begins_behind_the_other_surface(session: rg.Session, tmp_path: Path) -> None:
    """In a right angle half of the directions are open, whatever the error of positions from depth."""
    (tmp_path / "stairs.yaml").write_text(
        "scene: 1\nobjects:\n  floor: {shape: box, size: [8, 1, 8], at: [0, -0.5, 0]}\n"
        "  step: {shape: box, size: [8, 0.4, 4], at: [0, 0.2, -2]}\n"
        "  upper: {shape: box, size: [8, 0.4, 2], at: [0, 0.6, -3]}\n"
        "cameras: {main: {eye: [1.2, 1.9, 3], target: [0, 0.2, -0.5], fov_y_degrees: 40}}\n"
    )
    sets = ("ao.type=traced_occlusion", "ao.radius=0.6", "ao.samples=64")
    pipeline = rg.load("ssao-gtao", scene=tmp_path / "stairs.yaml", size=(160, 120), sets=sets)
    found = session.render(pipeline, outputs=(), taps=("ao.occlusion", "gbuffer.depth"))
    assert np.asarray(found["ao.occlusion"])[np.asarray(found["gbuffer.depth"]) > 0].min() > 0.4
