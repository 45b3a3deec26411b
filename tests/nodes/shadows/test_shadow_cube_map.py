"""A cube map looked up by direction: pictures against ray casting and six layers, both forms, lights it cannot hold."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

import rendergraph as rg

SIZE = (96, 64)
SCENE = """scene: 1
objects:
  floor: {shape: plane, size: [8, 8]}
  box: {shape: box, size: [0.8, 1.6, 0.8], at: [0.6, 0.8, -0.4], rotate_degrees: [0, 30, 0]}
  ball: {shape: sphere, radius: 0.5, at: [-0.7, 0.5, 0.5]}
lights:
  sun: {type: directional, direction: [-1, -2, -0.6], intensity: 0.5}
  bulb: {type: point, at: [-1.5, 2.5, 1.5], intensity: 8}
cameras: {main: {eye: [3, 4, 5], target: [0, 0.4, 0], fov_y_degrees: 45, near: 0.1, far: 50}}
"""


def visibility(session: rg.Session, name: str, *sets: str, **options: Any) -> npt.NDArray[Any]:
    frame = session.render(rg.load(name, sets=sets, **options), outputs=(), taps=("shadows.visibility",), warm_up=False)
    return np.asarray(frame.arrays["shadows.visibility"][..., 0])


@pytest.mark.slow
def test_a_bulb_in_a_room(session: rg.Session, shared: Path) -> None:
    """Things on all six sides of the light: every face has to lie as samplers want it."""
    here = shared / "reference/b2_shadows/point_room"
    given, masks = json.loads((here / "case.json").read_text())["camera"], np.load(here / "masks.npz")
    options: dict[str, Any] = {"scene": here / "scene.glb", "size": (given["width"], given["height"])}
    lit = visibility(session, "shadow-cube-map", "shadows.taps=1", **options)[0]
    judged = np.isin(masks["cls"], (1, 2)) & ~masks["edge"].astype(bool)
    assert ((lit > 0.5) != (masks["cls"] == 1))[judged].mean() <= 2e-4


def test_it_is_what_six_layers_are(session: rg.Session) -> None:
    """Only pixels at edges differ, and no seam shows where faces meet."""
    sets = ("shadows.taps=2",)
    cube = visibility(session, "shadow-cube-map", "shadows.resolution=256", *sets, size=SIZE)
    layers = visibility(session, "shadow-cube", "sun.resolution=256", *sets, size=SIZE)
    assert cube.shape == layers.shape == (1, 64, 96)
    assert (layers < 0.5).mean() > 0.1
    assert np.mean(np.abs(cube - layers) > 0.3) < 0.01
    assert np.abs(cube - layers).mean() < 0.01


def test_both_forms_give_the_same_picture(session: rg.Session, tmp_path: Path) -> None:
    """Beside a sun, which is not its own."""
    (tmp_path / "scene.yaml").write_text(SCENE)
    pictures = []
    for name in ("forward", "forward-prepass"):
        node = {"type": "shadow_cube_map", "inputs": {"shadow_map": None}, "params": {"resolution": 256}}
        loaded = rg.load(name, scene=tmp_path / "scene.yaml", size=(160, 120)).patch(
            {"nodes": {"sun": None, "shadows": node}}
        )
        pictures.append(session.render(loaded, warm_up=False)["image"].astype(int))
    assert np.mean(np.abs(pictures[0] - pictures[1]).max(-1) > 1) <= 1e-3


def test_a_light_of_another_kind_is_lit(session: rg.Session) -> None:
    frame = session.render(rg.load("shadow-cube-map", scene="shadow_study", size=(32, 24)), warm_up=False)
    bare = rg.load("shadow-cube-map", scene="shadow_study", size=(32, 24), sets=("shadows.enabled=false",))
    np.testing.assert_array_equal(frame["radiance"], session.render(bare, warm_up=False)["radiance"])
