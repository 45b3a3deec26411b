"""Volumes to look at: how many faces lie over each pixel, and where the silhouettes run."""

from __future__ import annotations

from pathlib import Path

import numpy as np

import rendergraph as rg
from rendergraph.scene.cameras import view_matrices
from rendergraph.scene.pack import reversed_projection

SIZE = (120, 80)
SCENE = """scene: 1
objects:
  floor: {shape: plane, size: [8, 8], material: white, casts_shadow: false}
  ball: {shape: sphere, radius: 0.7, segments: 64, rings: 48, at: [0.2, 1.4, 0], material: white}
materials: {white: {base_color: [0.9, 0.9, 0.9]}}
lights: {sun: {type: directional, direction: [0.5, -1, -0.3], intensity: 2}}
cameras: {main: {eye: [0.5, 3, 6], target: [0, 0.8, 0], fov_y_degrees: 40, near: 0.1, far: 50}}
"""


def test_an_odd_number_of_faces_lies_before_what_is_in_shadow(session: rg.Session, tmp_path: Path) -> None:
    """Each halves the picture: before the lit floor lie 0 or 2 of them, before the shadowed floor 1."""
    (tmp_path / "s.yaml").write_text(SCENE)
    sets = ("light.ambient=0.9", "display.dither=false")
    loaded = rg.load("shadow-volumes-shown", scene=tmp_path / "s.yaml", size=SIZE, sets=sets)
    halving = loaded.set("volumes.parts", "volumes").set("volumes.tint", (0, 0, 0)).set("volumes.opacity", 0.5)
    frame = session.render(halving, taps=["display.color", "shadows.visibility", "gbuffer.depth"])
    before, after = frame["display.color"][..., 0].astype(float), frame["image"][..., 0].astype(float)
    seen = (frame.arrays["gbuffer.depth"][..., 0] > 0) & (before > 60)
    faces = np.round(np.log2(before[seen] / np.maximum(after[seen], 1)))
    lit = frame.arrays["shadows.visibility"][0, ..., 0][seen] > 0.5
    assert set(faces) == {0, 1, 2}
    assert (faces == 2).sum() > 10
    assert np.array_equal(faces % 2 == 1, ~lit)


def test_silhouettes_run_where_light_grazes(session: rg.Session, tmp_path: Path) -> None:
    (tmp_path / "s.yaml").write_text(SCENE)
    loaded = rg.load("shadow-volumes-shown", scene=tmp_path / "s.yaml", size=SIZE, sets=("volumes.parts=silhouettes",))
    frame = session.render(loaded, taps=["display.color", "gbuffer.depth"])
    drawn = (frame["image"] != frame["display.color"]).any(axis=-1)
    camera = view_matrices(next(iter(loaded.link().scene.cameras.values())), SIZE)
    y, x = np.mgrid[0 : SIZE[1], 0 : SIZE[0]]
    depth = frame.arrays["gbuffer.depth"][..., 0].astype(float)
    clip = np.stack([(x + 0.5) / SIZE[0] * 2 - 1, 1 - (y + 0.5) / SIZE[1] * 2, depth, np.ones_like(depth)], -1)
    world = clip[drawn & (depth > 0)] @ np.linalg.inv(reversed_projection(camera) @ camera.view).T
    from_middle = world[:, :3] / world[:, 3:] - (0.2, 1.4, 0)
    on_ball = np.abs(np.linalg.norm(from_middle, axis=1) - 0.7) < 0.02
    sun = np.array([0.5, -1, -0.3]) / np.linalg.norm([0.5, -1, -0.3])
    assert on_ball.sum() > 20
    assert on_ball.mean() > 0.9
    assert np.abs(from_middle[on_ball] @ sun).max() < 0.12
