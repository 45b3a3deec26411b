"""Trapezoidal shadow maps: matrices, what the map holds, motion, pictures against ray casting."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from rendergraph.nodes.shadows._trapezoid import apex_distance, trapezoid_around, trapezoid_to_square, warp_view

import rendergraph as rg
from rendergraph.api import ViewMatrices, projection

Floats = npt.NDArray[np.float64]
BOX = np.array([[-40.0, 0, -120], [40, 4, 20]])
SUN = (-0.6, -0.65, 0.3)


def test_the_map_of_a_trapezoid_is_the_reference(shared: Path) -> None:
    for case in json.loads((shared / "reference/b6_math/vectors.json").read_text())["trapezoidal"]["cases"]:
        corners = np.array(case["trapezoid"])
        found = trapezoid_to_square(corners)
        placed = np.append(corners, np.ones((4, 1)), axis=1) @ found.T
        np.testing.assert_allclose(placed[:, :2] / placed[:, 2:], [(-1, -1), (1, -1), (1, 1), (-1, 1)], atol=1e-9)
        expected = np.array(case["homography"])
        np.testing.assert_allclose(found / np.linalg.norm(found) * np.sign(found[2, 2]), expected, atol=1e-9)


def test_four_fifths_go_to_what_is_in_focus() -> None:
    """A line across the trapezoid at the focus comes to lie at -0.6 where the top is at 1 and the base at -1."""
    points = np.array([(-1.0, 2), (1, 2), (-9, 22), (9, 22)])
    corners = trapezoid_around(points, np.zeros(2), np.array([0.0, 1]), 0.3)
    assert corners is not None
    matrix = trapezoid_to_square(corners)
    for height, expected in ((2, 1), (8, -0.6), (22, -1)):
        place = matrix @ (0.3, height, 1)
        assert place[1] / place[2] == pytest.approx(expected)
    inside = np.append(points, np.ones((4, 1)), axis=1) @ matrix.T
    assert np.abs(inside[:, :2] / inside[:, 2:]).max() <= 1 + 1e-12
    assert apex_distance(20, 16) == math.inf
    assert trapezoid_around(points, np.zeros(2), np.array([0.0, 1]), 0.9) is None


def camera(eye: Any, target: Any) -> ViewMatrices:
    view = projection.inverse_rigid(projection.look_at(eye, target))
    return ViewMatrices(view, projection.perspective(0.8, 1.6, 0.1, 300), (320, 200), 0.1, 300.0)


def uniform(seen: ViewMatrices) -> tuple[ViewMatrices, Floats]:
    """A parallel view around what a camera sees of the box."""
    rotation = projection.view_along(SUN)
    points = projection.visible_part(seen, BOX)
    across = points @ rotation[:3, :3].T
    along = projection.box_corners(BOX) @ rotation[2, :3]
    low, high = np.append(across.min(0)[:2], along.min()), np.append(across.max(0)[:2], along.max())
    return projection.orthographic_view(rotation, low, high, 1024, 8), points


def clip(view: ViewMatrices, points: Floats) -> Floats:
    homogeneous = np.concatenate([points, np.ones((len(points), 1))], 1) @ (view.projection @ view.view).T
    return np.asarray(homogeneous[:, :3] / homogeneous[:, 3:])


@pytest.mark.parametrize("eye", [(0, 2, 18), (15, 12, 10), (-20, 1, -30)])
@pytest.mark.parametrize("focus", [0.05, 0.2])
def test_what_is_seen_is_in_the_map(eye: Any, focus: float) -> None:
    seen = camera(eye, (0, 0, -60))
    plain, points = uniform(seen)
    made = warp_view(plain, points, seen, focus, 8)
    assert not np.array_equal(made.projection, plain.projection)
    assert np.abs(clip(made, points)).max() <= 1 - 16 / 1024 * 0.99
    casters = np.random.default_rng(0).uniform(BOX[0], BOX[1], (2000, 3))
    casters = casters[np.all(np.abs(clip(made, casters)[:, :2]) <= 1, axis=1)]
    assert np.abs(clip(made, casters)[:, 2]).max() <= 1  # what casts into it is not cut away
    forward = -seen.view[2, :3]
    near, step = np.array(eye) + 4 * forward, np.array([0.01, 0, 0])
    pair = np.array([near, near + step])
    finer = [np.linalg.norm(np.diff(clip(view, pair)[:, :2], axis=0)) for view in (plain, made)]
    assert finer[1] > 1.5 * finer[0]


def test_texels_change_smoothly_with_the_camera() -> None:
    """Walking and turning, texels at a point ahead never change their size by more than a few per cent a frame."""
    sizes = []
    for frame in range(200):
        eye = np.array([0.05 * frame, 2, 18 - 0.1 * frame])
        target = eye + (12 * math.sin(0.02 * frame), -1, -30)
        seen = camera(eye, target)
        plain, points = uniform(seen)
        made = warp_view(plain, points, seen, 0.1, 8)
        here = eye + 6 * (target - eye) / np.linalg.norm(target - eye)
        steps = [
            np.diff(clip(made, np.array([here, here + 0.01 * axis]))[:, :2], axis=0)[0] for axis in np.eye(3)[[0, 2]]
        ]
        sizes.append(abs(float(np.linalg.det(steps))))
    change = np.abs(np.diff(np.log(sizes)))
    assert change.max() < 0.12


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["shadow_pcf", "shadow_vsm", "shadow_esm"])
def test_a_long_field(session: rg.Session, shared: Path, kind: str) -> None:
    """Better than the uniform map of as many texels by far."""
    here = shared / "reference/b2_shadows/dir_cascades"
    given, masks = json.loads((here / "case.json").read_text())["camera"], np.load(here / "masks.npz")
    judged = np.isin(masks["cls"], (1, 2)) & ~masks["edge"].astype(bool)
    wrong = []
    for sun in (("sun.type=shadow_trapezoidal",), ()):
        sets = (
            f"shadows.type={kind}",
            "sun.resolution=1024",
            *sun,
            *(() if kind == "shadow_pcf" else ("shadows.radius=1",)),
        )
        loaded = rg.load("forward-prepass", scene=here / "scene.glb", size=(given["width"], given["height"]), sets=sets)
        frame = session.render(loaded, outputs=(), taps=("shadows.visibility",), warm_up=False)
        wrong.append(((frame.arrays["shadows.visibility"][0, ..., 0] > 0.5) != (masks["cls"] == 1))[judged].mean())
    assert wrong[0] < 0.002
    assert wrong[0] < 0.5 * wrong[1]


SPOT = """scene: 1
objects:
  floor: {shape: plane, size: [14, 14]}
  near: {shape: box, size: [0.5, 1, 0.5], at: [0.6, 0.5, 3]}
  far: {shape: box, size: [1, 2, 1], at: [-1, 1, -3]}
lights: {lamp: {type: spot, at: [3, 9, 1], direction: [-0.3, -1, -0.1], intensity: 200, outer_degrees: 42}}
cameras: {main: {eye: [0, 1.5, 6], target: [0, 0.5, 0], fov_y_degrees: 45, near: 0.1, far: 40}}
"""


def test_spot_lights_are_warped_too(session: rg.Session, tmp_path: Path) -> None:
    """The same shadow but for its edges, from a map whose texels lie elsewhere."""
    (tmp_path / "spot.yaml").write_text(SPOT)
    seen = []
    for sun in ("shadow_map", "shadow_trapezoidal"):
        sets = (f"sun.type={sun}", "sun.resolution=1024", "shadows.taps=1")
        loaded = rg.load("forward-prepass", scene=tmp_path / "spot.yaml", size=(120, 80), sets=sets)
        frame = session.render(loaded, outputs=(), taps=("shadows.visibility", "sun.shadow_map"), warm_up=False)
        seen.append((frame.arrays["shadows.visibility"][0, ..., 0], frame.arrays["sun.shadow_map"]))
    assert not np.array_equal(seen[0][1], seen[1][1])
    assert (seen[0][0] < 0.5).mean() > 0.02
    assert (np.abs(seen[0][0] - seen[1][0]) > 0.5).mean() < 0.01
