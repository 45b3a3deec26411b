"""What is drawn into shadow maps."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

import rendergraph as rg

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
    lit = frame["shadows.visibility"][0, ..., 0]
    assert lit[20, 30] == 0
    assert lit[38, 30] == 1


def test_a_wide_cone_wastes_no_texels(session: rg.Session) -> None:
    """In the Cornell box, whose lamp shines over 85° to all sides, against shadow volumes: they know no texels."""
    sizes: dict[str, Any] = {"scene": "cornell_box", "size": (160, 120)}
    found = []
    for name, sets in (("shadow-volumes-auto", ()), ("shadow-map", ("sun.resolution=512",))):
        taps = ("shadows.visibility",)
        frame = session.render(rg.load(name, sets=sets, **sizes), outputs=(), taps=taps, warm_up=False)
        found.append(frame["shadows.visibility"][0, ..., 0])
    assert (found[0] < 0.5).mean() > 0.05
    assert ((found[0] < 0.5) != (found[1] < 0.5)).mean() < 1.5e-3  # 0.7 % without a fit
