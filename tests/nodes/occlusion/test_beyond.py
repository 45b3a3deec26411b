"""Light and occlusion from beside the picture: a band around it and a hemicube, against closed forms and path tracing."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

import rendergraph as rg

Floats = npt.NDArray[np.float64]
Draw = Callable[..., Floats]
BEYOND = pytest.mark.parametrize("beyond", [{"ssgi-guard-band": ["band.width=0.5"]}, {"ssgi-hemicube": []}], ids=list)


@pytest.fixture
def draw(tmp_path: Path, session: rg.Session) -> Draw:
    """`draw(pipeline, scene, port, *sets)`: a port's values, shape (height, width, 3), top row first, of the picture alone."""

    def run(
        pipeline: str, scene: str, port: str, *sets: str, size: tuple[int, int] = (64, 64), whole: bool = False
    ) -> Floats:
        (tmp_path / "scene.yaml").write_text("scene: 1\n" + scene)
        patch: dict[str, Any] = {"outputs": {"image": None, "radiance": None, "x": port}}
        if "band" in pipeline and not whole:
            patch["nodes"] = {"small": {"type": "crop", "inputs": {"source": port}}}
            patch["outputs"]["x"] = "small.cropped"
        always = ["light.ambient=0", "gbuffer.precision=full"]
        loaded = rg.load(pipeline, scene=tmp_path / "scene.yaml", size=size, sets=[*always, *sets], patches=[patch])
        return np.asarray(session.render(loaded, outputs=["x"]).arrays["x"], np.float64)[..., :3]

    return run


TAN = math.tan(math.radians(35 / 2))
STUDY = """objects:
  floor: {shape: plane, size: [8, 8]}
  box: {shape: box, size: [1, 1, 1], at: [0.4, 0.5, 0]}
  beside: {shape: box, size: [1, 3, 1], at: [-2.2, 1.5, 0]}
lights: {sun: {type: directional, direction: [2, -1.5, -0.5], intensity: 3}}
cameras: {main: {eye: [0, 1.5, 4], target: [0, 0.5, 0], fov_y_degrees: 35, near: 0.1, far: 60}}
"""


@pytest.mark.nightly(keep=1)
@pytest.mark.parametrize("sun", ["shadow_map", "shadow_cascaded", "shadow_trapezoidal"])
def test_a_guard_band_is_a_wider_picture(draw: Draw, sun: str) -> None:
    """Texel by texel, but where a shadow's edge lies in another texel of another map; its middle is the picture."""
    wider = STUDY.replace("fov_y_degrees: 35", f"fov_y_degrees: {2 * math.degrees(math.atan(1.5 * TAN))}")
    sets = (f"sun.type={sun}", "sun.resolution=512")
    band = draw("ssgi-guard-band", STUDY, "light.radiance", *sets, size=(64, 48), whole=True)
    middle = draw("ssgi-guard-band", STUDY, "light.radiance", *sets, size=(64, 48))
    wide = draw("ssgi", wider, "light.radiance", *sets, size=(96, 72))
    narrow = draw("ssgi", STUDY, "light.radiance", *sets, size=(64, 48))
    np.testing.assert_array_equal(band[12:-12, 16:-16], middle)
    assert wide.std() > 0.1
    assert (np.abs(band - wide) > 1e-3).mean() < 1e-4
    assert (np.abs(middle - narrow) > 1e-3).mean() < 0.03


def test_surfaces_in_the_middle_are_the_pictures(draw: Draw) -> None:
    """An odd size, too."""
    for port, most in (("gbuffer.depth", 2e-7), ("gbuffer.normal", 1e-5)):
        alone, cropped = (draw(name, STUDY, port, size=(61, 45)) for name in ("ssgi", "ssgi-guard-band"))
        assert alone.shape == cropped.shape
        assert (np.abs(alone - cropped).max(axis=-1) > most).mean() < 0.002


BESIDE = """objects:
  floor: {shape: plane, size: [8, 8], material: white}
  wall: {shape: plane, size: [1, 2], rotate_degrees: [0, 0, 90], at: [1.2, 0.5, 0], material: lamp}
materials: {white: {base_color: [1, 1, 1]}, lamp: {base_color: [1, 1, 1], emissive: [1, 1, 1]}}
lights: {none: {type: directional, direction: [0, -1, 0], intensity: 0, casts_shadow: false}}
cameras: {main: {eye: [0, 3, 0.001], target: [0, 0, 0], fov_y_degrees: 36.87, near: 0.1, far: 60}}
"""


@pytest.mark.nightly(keep=1)
@BEYOND
def test_a_wall_beside_the_picture_lights_the_floor(draw: Draw, beyond: dict[str, list[str]]) -> None:
    """A glowing wall 0.2 m outside of the picture: along its middle row what each part of the wall sends, summed."""
    sets = ("gi.samples=128", "gi.denoise=0")
    ((pipeline, more),) = beyond.items()
    found = draw(pipeline, BESIDE, "gi.indirect", *sets, *more)[32, :, 0]
    alone = draw("ssgi", BESIDE, "gi.indirect", *sets)[32, :, 0]
    x = ((np.arange(64) + 0.5) / 64 * 2 - 1)[:, None, None]
    y, z = (np.arange(80) + 0.5)[:, None] / 80, (np.arange(160) + 0.5) / 80 - 1
    squared = (1.2 - x) ** 2 + y**2 + z**2
    expected = ((1.2 - x) * y / (math.pi * squared**2)).sum((1, 2)) / 80**2
    judged = x[:, 0, 0] > -0.8  # all of the wall lies within the radius
    assert alone.max() == 0
    assert expected.max() > 0.25
    assert np.corrcoef(found[judged], expected[judged])[0, 1] > 0.98
    assert found[judged].mean() == pytest.approx(expected[judged].mean(), rel=0.15)


@pytest.mark.parametrize("depths", [["front", "left", "right"], ["front", "front", "left"]], ids=str)
def test_no_layer_is_looked_at_that_nobody_wrote(depths: list[str]) -> None:
    """Not where a view comes without its normals, nor where one comes twice."""
    names = {"beyond_depth": depths, "beyond_normal": ["front", "left"], "beyond_diffuse": depths}
    links = {name: [f"{view}.{name.removeprefix('beyond_')}" for view in views] for name, views in names.items()}
    plan = rg.load("ssgi-hemicube", size=(32, 32), patches=[{"nodes": {"gi": {"inputs": links}}}]).plan()
    writes = [write for step in plan.schedule.steps for write in step.writes]
    assert {write.layer for write in writes if write.resource == "gi.beyond_surfaces"} == {0, 1, 2}
    steps = [step for step in plan.schedule.steps if step.type == "ssgi" and step.reads]
    drawn = {step.writes[0].layer: step.reads[0].resource for step in steps}
    for layer, view in enumerate(depths):
        assert view == "right" or drawn[layer] == f"{view}/gbuffer.depth"


@pytest.mark.nightly
@pytest.mark.slow
def test_the_middle_of_a_room_has_the_light_of_all_of_it(draw: Draw, shared: Path, tmp_path: Path) -> None:
    """One path-traced bounce, of which the picture shows the middle half: its walls and lit floor lie beside it."""
    here = shared / "reference" / "b4_gi" / "point"
    (tmp_path / "room.glb").write_bytes((here / "scene.glb").read_bytes())
    truth = picture(here / "one_bounce.exr")[48:-48, 48:-48]
    surfaces = np.load(here / "gbuffer.npz")
    judged = ((surfaces["object"] > 0) & ~surfaces["edge"])[48:-48, 48:-48]
    angle = 2 * math.degrees(math.atan(0.5 * math.tan(math.radians(20))))
    scene = f"""objects: {{room: {{file: room.glb}}}}
cameras: {{main: {{eye: [-0.041, 1.043, 3.7], target: [0.013, 0.98, 0], fov_y_degrees: {angle}, near: 0.1, far: 100}}}}
"""

    def error(pipeline: str, *sets: str) -> tuple[float, float, float]:
        sets = ("gi.samples=32", "sun.light=all", "sun.resolution=256", *sets)
        found = draw(pipeline, scene, "gi.reflected", *sets, size=(96, 96))[judged]
        away = np.sqrt(np.mean((found - truth[judged]) ** 2)) / truth[judged].mean()
        return away, found.sum() / truth[judged].sum(), np.corrcoef(found.ravel(), truth[judged].ravel())[0, 1]

    alone, band = error("ssgi"), error("ssgi-guard-band", "band.width=0.5")
    cube = error("ssgi-hemicube")
    assert alone[1] < 0.1
    assert band[0] < 0.25 * alone[0]
    assert cube[0] < 0.2 * alone[0]
    assert band[1] == pytest.approx(1, abs=0.2)
    assert cube[1] == pytest.approx(1, abs=0.15)
    assert min(band[2], cube[2]) > 0.9


def picture(file: Path) -> Floats:
    from OpenImageIO import FLOAT, ImageBuf

    return np.asarray(ImageBuf(str(file)).get_pixels(FLOAT), np.float64)[..., :3]
