"""All layers in one pass: the map that `shadow_map` draws in many, and pictures against ray casting."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import rendergraph as rg

SCENE = """scene: 1
objects:
  floor: {shape: plane, size: [8, 8]}
  box: {shape: box, size: [0.8, 1.6, 0.8], at: [0.6, 0.8, -0.4], rotate_degrees: [0, 30, 0]}
  leaf: {shape: plane, size: [1, 1], at: [-1, 1.2, 0.4], rotate_degrees: [20, 0, 10], material: leaf}
materials:
  leaf: {alpha_mode: mask, base_color_texture: leaf.png}
lights:
  sun: {type: directional, direction: [-1, -2, -0.6], intensity: 1.5}
  lamp: {type: spot, at: [2, 4, 2], direction: [-2, -4, -2], intensity: 30, outer_degrees: 30}
  bulb: {type: point, at: [-1.5, 2.5, 1.5], intensity: 8}
cameras: {main: {eye: [3, 4, 5], target: [0, 0.4, 0], fov_y_degrees: 45, near: 0.1, far: 50}}
"""


def test_one_pass_draws_what_many_do(session: rg.Session, tmp_path: Path) -> None:
    """A directional, a spot and a point light, eight layers; an alpha mask among the casters."""
    iio = pytest.importorskip("OpenImageIO")
    mask = np.full((8, 8, 4), 255, np.uint8)
    mask[::2, ::2, 3] = 0
    out = iio.ImageOutput.create(str(tmp_path / "leaf.png"))
    out.open(str(tmp_path / "leaf.png"), iio.ImageSpec(8, 8, 4, "uint8"))
    out.write_image(mask)
    out.close()
    (tmp_path / "scene.yaml").write_text(SCENE)
    maps = []
    for kind in ("shadow_map", "shadow_cube"):
        sets = (f"sun.type={kind}", "sun.light=all", "sun.resolution=128")
        loaded = rg.load("forward", scene=tmp_path / "scene.yaml", size=(32, 24), sets=sets)
        maps.append(
            session.render(loaded, outputs=(), taps=("sun.shadow_map",), warm_up=False).arrays["sun.shadow_map"]
        )
        passes = [step for step in loaded.plan().schedule.steps if step.node == "sun"]
        assert len(passes) == (8 if kind == "shadow_map" else 1)
    assert maps[0].shape == (8, 128, 128, 1)
    assert sum(layer.max() > 0 for layer in maps[0]) >= 6
    assert np.mean(np.abs(maps[0] - maps[1]) > 1e-5) < 1e-3


@pytest.mark.slow
def test_a_bulb_in_a_room(session: rg.Session, shared: Path) -> None:
    here = shared / "reference/b2_shadows/point_room"
    given, masks = json.loads((here / "case.json").read_text())["camera"], np.load(here / "masks.npz")
    sets = ("sun.type=shadow_cube", "shadows.taps=1")
    loaded = rg.load("forward-prepass", scene=here / "scene.glb", size=(given["width"], given["height"]), sets=sets)
    lit = session.render(loaded, outputs=(), taps=("shadows.visibility",), warm_up=False).arrays["shadows.visibility"]
    judged = np.isin(masks["cls"], (1, 2)) & ~masks["edge"].astype(bool)
    assert ((lit[0, ..., 0] > 0.5) != (masks["cls"] == 1))[judged].mean() <= 2e-4
