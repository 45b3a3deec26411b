"""Means over frames: of what stands still plain ones, of what moves those of its own surface and of no other."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import rendergraph as rg

SIZE = (64, 48)
PORTS = {"mean": "steady.accumulated", "raw": "ao.occlusion", "depth": "gbuffer.depth"}


def as_pipeline(samples: int, **options: Any) -> rg.Pipeline:
    text: dict[str, Any] = {"outputs": PORTS, "nodes": {"ao": {"params": {"samples": samples}}}}
    return rg.load("ssao-accumulated", size=SIZE, patches=[text], **options)


def drawn(session: rg.Session, pipeline: rg.Pipeline, first: int, last: int) -> list[dict[str, Any]]:
    frames = session.frames(pipeline, outputs=list(PORTS), frames=range(first, last + 1))
    return [{name: np.asarray(frame.arrays[name][..., 0], np.float64) for name in PORTS} for frame in frames]


def test_of_still_frames_it_is_the_plain_mean(session: rg.Session) -> None:
    frames = drawn(session, as_pipeline(8), 1, 6)
    raw = np.array([frame["raw"] for frame in frames])
    assert raw.std(axis=0).max() > 0.02  # each frame is noisy in another way
    np.testing.assert_array_equal(frames[0]["mean"], raw[0])
    np.testing.assert_allclose(frames[-1]["mean"], raw.mean(axis=0), atol=2e-4)


@pytest.mark.slow
def test_few_samples_in_many_frames_are_many(session: rg.Session) -> None:
    camera = "eye=3.4,2.8,5 target=0,0.8,-0.4 fov=40"
    exact = drawn(session, as_pipeline(128, camera=camera).set("ao.animated", False), 1, 1)[0]["raw"]
    one, many = (drawn(session, as_pipeline(32, camera=camera), frame, frame)[0]["mean"] for frame in (1, 32))
    errors = [float(np.sqrt(((found - exact) ** 2).mean())) for found in (one, many)]
    assert errors[1] < 0.3 * errors[0]
    assert errors[1] < 0.004


SCENE = """scene: 1
objects:
  wall: {shape: box, size: [40, 40, 1], at: [0, 0, -2]}
  floor: {shape: box, size: [40, 0.5, 8], at: [0, -1.2, 0]}
  post: {shape: box, size: [0.4, 4, 0.4], at: [0.9, 0, -1.3]}
  other: {shape: box, size: [0.4, 4, 0.4], at: [-0.9, 0, -1.3]}
  BALL
cameras: {main: {eye: [0, 1, 6], target: [0, 0, 0], fov_y_degrees: 40}}
MOVES
"""


def with_scene(folder: Path, ball: str, moves: str) -> rg.Pipeline:
    (folder / "scene.yaml").write_text(SCENE.replace("BALL", ball).replace("MOVES", moves))
    return as_pipeline(16, scene=folder / "scene.yaml")


def test_what_comes_into_view_begins_anew(session: rg.Session, tmp_path: Path) -> None:
    """Nothing is left of a blue ball where it was in the frame before; what was there all the time goes on."""
    ball = "ball: {shape: sphere, radius: 0.6, material: blue}"
    moves = """keyframes: {objects.ball.at: {0: [-1.5, 0.5, 0.5], 1: [8, 0.5, 0.5]}}
materials: {blue: {base_color: [0.1, 0.1, 0.8]}}"""
    pipeline = with_scene(tmp_path, ball, moves).set("steady.source", "gbuffer.albedo").set("light.occlusion", None)
    hidden, found = drawn(session, pipeline.patch({"outputs": {"raw": "gbuffer.albedo"}}), 5, 6)
    colors = [frame["raw"] for frame in (hidden, found)]
    fresh = (colors[0] < 0.95 * colors[0].max()) & (colors[1] == colors[1].max())
    assert fresh.sum() > 30
    np.testing.assert_array_equal(found["mean"][fresh], found["raw"][fresh])
    noisy = with_scene(tmp_path, ball, moves).set("ao.radius", 2.0)
    before, now = drawn(session, noisy, 5, 6)
    change = [np.abs(now[name] - before[name])[colors[0] == colors[0].max()].mean() for name in ("raw", "mean")]
    assert change[1] < 0.5 * change[0]


def test_surfaces_are_followed_under_a_camera_that_turns(session: rg.Session, tmp_path: Path) -> None:
    """Unfiltered hemispheres of two directions a pixel: as good as many more, without any mean over neighbours."""
    ball = "ball: {shape: sphere, radius: 0.6, at: [0.5, 0, -1]}"
    turning = with_scene(tmp_path, ball, "orbit: {degrees_per_second: 30}")
    noisy = turning.set("ao.type", "ssao_hemisphere").set("ao.samples", 8).set("ao.blur", 0).set("ao.radius", 1.0)
    exact = drawn(session, noisy.set("ao.samples", 128).set("ao.blur", 2).set("ao.animated", False), 12, 12)[0]["raw"]
    for pipeline in (noisy, noisy.set("steady.velocity", None)):
        found = drawn(session, pipeline, 12, 12)[0]
        errors = [float(np.sqrt(((found[name] - exact) ** 2).mean())) for name in ("raw", "mean")]
        assert errors[1] < 0.5 * errors[0]


LAMPS = """lights:
  left: {type: point, at: [-3, 3, 3], intensity: 20}
  right: {type: point, at: [3, 4, 2], intensity: 20}
"""
OUTPUTS = {"raw": "shadows.visibility", "mean": "over_frames.accumulated", "smooth": "smooth.denoised"}


def test_layers_are_averaged_and_smoothed_each_for_itself(session: rg.Session, tmp_path: Path) -> None:
    (tmp_path / "scene.yaml").write_text(SCENE.replace("BALL", "").replace("MOVES", LAMPS))
    surfaces = {"depth": "gbuffer.depth", "normal": "gbuffer.normal"}
    nodes: dict[str, Any] = {
        "sun": None,
        "shadows": {"type": "traced_shadows", "inputs": {"shadow_map": None}, "params": {"size": 1, "samples": 2}},
        "over_frames": {"type": "accumulate", "inputs": {"source": "shadows.visibility", **surfaces}},
        "smooth": {"type": "denoise", "inputs": {"source": "over_frames.accumulated", **surfaces}},
        "light": {"inputs": {"visibility": "smooth.denoised"}},
    }
    pipeline = rg.load(
        "deferred", scene=tmp_path / "scene.yaml", size=SIZE, patches=[{"nodes": nodes, "outputs": OUTPUTS}]
    )

    def frames(light: str) -> list[dict[str, Any]]:
        found = session.frames(pipeline.set("shadows.light", light), outputs=list(OUTPUTS), frames=range(1, 5))
        return [{name: np.asarray(frame.arrays[name][..., 0], np.float64) for name in OUTPUTS} for frame in found]

    both, right = frames("all"), frames("right")
    raw = np.array([frame["raw"] for frame in both])
    assert raw.shape[1] == 2
    assert raw.std(axis=0).max(axis=(1, 2)).min() > 0.1  # both layers are noisy
    np.testing.assert_allclose(both[-1]["mean"], raw.mean(axis=0), atol=1e-4)
    for name in OUTPUTS:  # the second layer is what it is alone
        np.testing.assert_array_equal(both[-1][name][1], np.squeeze(right[-1][name]))
    rough = [np.abs(np.diff(both[-1][name], axis=-1)).mean() for name in ("mean", "smooth")]
    assert rough[1] < 0.9 * rough[0]
