"""What is drawn into shadow maps."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

import rendergraph as rg
from rendergraph.scene.model import Mesh

SHEET = """scene: 1
objects:
  floor: {shape: plane, size: [8, 8]}
  sheet: {shape: plane, size: [2, 2], at: [0, 1.5, 0], rotate_degrees: [TURN, 0, 0]}
lights: {lamp: LIGHT}
cameras: {main: {eye: [0, 0.7, 6], target: [0, 0, 0], fov_y_degrees: 30, near: 0.1, far: 60}}
"""


@pytest.mark.parametrize("turn", [0, 180])
@pytest.mark.parametrize(
    "light", ["{type: directional, direction: [0, -1, 0], intensity: 1}", "{type: point, at: [0, 4, 0], intensity: 30}"]
)
def test_what_has_one_side_casts_from_both(session: rg.Session, tmp_path: Path, light: str, turn: int) -> None:
    """A sheet whose material is single-sided, its face to the light and away from it: the floor below is dark."""
    scene = tmp_path / "sheet.yaml"
    scene.write_text(SHEET.replace("TURN", str(turn)).replace("LIGHT", light))
    sets = ("sun.light=all", "sun.resolution=256")
    frame = session.render(
        rg.load("forward-prepass", scene=scene, size=(60, 40), sets=sets), taps=("shadows.visibility",)
    )
    lit = frame.arrays["shadows.visibility"][0, ..., 0]
    assert lit[20, 30] == 0
    assert lit[38, 30] == 1


def test_a_wide_cone_wastes_no_texels(session: rg.Session) -> None:
    """In the Cornell box, whose lamp shines over 85° to all sides, against shadow volumes: they know no texels."""
    sizes: dict[str, Any] = {"scene": "cornell_box", "size": (160, 120)}
    found = []
    for name, sets in (("shadow-volumes-auto", ()), ("shadow-map", ("sun.resolution=512",))):
        taps = ("shadows.visibility",)
        frame = session.render(rg.load(name, sets=sets, **sizes), outputs=(), taps=taps, warm_up=False)
        found.append(frame.arrays["shadows.visibility"][0, ..., 0])
    assert (found[0] < 0.5).mean() > 0.05
    assert ((found[0] < 0.5) != (found[1] < 0.5)).mean() < 1.5e-3  # 0.7 % without a fit


SOLIDS = """scene: 1
objects:
  floor: {shape: plane, size: [8, 8]}
  ball: {shape: sphere, radius: 1, at: [-2, 1.2, 0]}
  knot: {shape: torus_knot, at: [0, 1.5, 0], scale: [-1, 1, 1]}
  fence: {shape: box, at: [2, 0.8, 0], material: holes}
  sheet: {shape: plane, size: [1, 1], at: [0, 3, 2], rotate_degrees: [200, 0, 0]}
materials: {holes: {alpha_mode: mask, base_color: [1, 1, 1, 0.4]}}
lights: {sun: {type: directional, direction: [-0.4, -1, -0.3], intensity: 1}}
cameras: {main: {eye: [0, 4, 9], target: [0, 0, 0], fov_y_degrees: 50, near: 0.1, far: 60}}
"""


def test_of_what_is_solid_the_sun_sees_the_same_by_its_front_faces_alone(
    session: rg.Session, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    maps = []
    for name in ("front", "both"):
        (tmp_path / f"{name}.yaml").write_text(SOLIDS)
        pipeline = rg.load("forward", scene=tmp_path / f"{name}.yaml", size=(32, 20), sets=["sun.resolution=256"])
        drawn = session.render(pipeline, outputs=(), taps=("sun.shadow_map",), warm_up=False)
        maps.append(drawn.arrays["sun.shadow_map"])
        made: Any = session.cache.active
        drawn_apart = next(step.draws for step in made.steps[0] if step.step.node == "sun")
        assert len(drawn_apart) == (4 if name == "front" else 3)  # the mirrored knot and the mask are apart in any case
        monkeypatch.setattr(Mesh, "solid", False)
    assert (maps[0] > 0).mean() > 0.2
    assert (maps[0] != maps[1]).mean() < 1e-3  # where a ball's edge rounds to one face or the other


def test_a_lamp_within_a_solid_globe_lights_nothing(session: rg.Session, tmp_path: Path) -> None:
    light = "{type: point, at: [0, 2, 0], intensity: 30}"
    scene = SHEET.replace("LIGHT", light).replace("shape: plane, size: [2, 2]", "shape: sphere, radius: 0.8")
    (tmp_path / "globe.yaml").write_text(scene.replace("TURN", "0"))
    sets = ("sun.light=all", "sun.resolution=64")
    pipeline = rg.load("forward-prepass", scene=tmp_path / "globe.yaml", size=(24, 16), sets=sets)
    lit = session.render(pipeline, outputs=(), taps=("shadows.visibility",), warm_up=False).arrays["shadows.visibility"]
    assert lit[0, 14].max() == 0
