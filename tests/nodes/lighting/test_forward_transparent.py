"""Surfaces with alpha blending: over whatever lit the opaque ones, the picture is the same."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

import rendergraph as rg
from rendergraph.resources import shipped_scenes

Floats = npt.NDArray[np.float64]
Layer = tuple[Floats, float]

BOTH = "objects:\n  {0}\n  {1}\n  post: {{shape: box, size: [0.3, 4, 0.2], at: [-0.75, 0, 0], material: post}}\n"
PANE = "{name}: {{shape: plane, size: [2, 2], at: [{x}, 0, {z}], rotate_degrees: [90, 0, 0], material: {name}}}"
REST = """materials:
  red: {base_color: [0.8, 0.1, 0.05, 0.5], alpha_mode: blend}
  green: {base_color: [0.1, 0.6, 0.2, 0.25], alpha_mode: blend}
  post: {base_color: [0.4, 0.4, 0.9]}
cameras: {main: {eye: [0, 0, 5], target: [0, 0, 0], height: 4, near: 0.1, far: 10}}
"""
RED, GREEN = (np.array([0.8, 0.1, 0.05]), 0.5), (np.array([0.1, 0.6, 0.2]), 0.25)
POST, BEHIND = (np.array([0.4, 0.4, 0.9]), 1.0), (np.array([0.5, 0.25, 0.125]), 1.0)
PIPELINES = ["forward-transparent", "deferred", "deferred-stencil-lights", "forward-prepass"]

# A box in the air, its shadow on a pane under it, and through no pane on the floor under that; the sun is overhead.
SHADED = """scene: 1
objects:
  box: {shape: box, size: [1, 0.2, 1], at: [-0.5, 1, 0], material: grey}
  floor: {shape: plane, size: [4, 4], at: [0, -1, 0], material: grey}
  pane: {shape: plane, size: [2, 4], material: pane}
materials:
  grey: {base_color: [0.5, 0.5, 0.5], roughness: 1, specular: 0}
  pane: {base_color: [0.8, 0.6, 0.4, 0.75], roughness: 1, specular: 0, alpha_mode: blend}
lights: {sun: {type: directional, direction: [0.3, -1, -0.0001], intensity: 3.14159265}}
cameras: {main: {eye: [0, 2, 4], target: [0, 0, 0], height: 3, near: 0.1, far: 20}}
"""


def over(*layers: Layer) -> Floats:
    """Colour of layers from far to near, each with its opacity (Porter and Duff 1984)."""
    color = np.zeros(3)
    for rgb, opacity in layers:
        color = rgb * opacity + color * (1 - opacity)
    return color


def settings(pipeline: str, *values: str) -> list[str]:
    """Settings of the lighting, of both nodes where there are two, and surfaces written down as they are."""
    nodes = ["light", "transparent"] if pipeline == "forward-transparent" else ["light"]
    full = ["gbuffer.precision=full"] if pipeline.startswith("deferred") else []
    return [*full, *(f"{node}.{value}" for value in values for node in nodes)]


@pytest.mark.slow
@pytest.mark.parametrize("pipeline", PIPELINES)
@pytest.mark.parametrize("red_first", [True, False])
@pytest.mark.parametrize("red_nearer", [True, False])
def test_panes_lie_over_each_other_by_distance(
    radiance: Any, tmp_path: Path, pipeline: str, red_first: bool, red_nearer: bool
) -> None:
    """Two panes that overlap, one before a post and one behind it; their order in the file says nothing."""
    red = PANE.format(name="red", x=0, z=1 if red_nearer else -1)
    green = PANE.format(name="green", x=0.5, z=-1 if red_nearer else 1)
    scene = tmp_path / "panes.yaml"
    scene.write_text("scene: 1\n" + BOTH.format(*([red, green] if red_first else [green, red])) + REST)
    sets = settings(pipeline, "shading=unlit")
    picture = radiance(pipeline, scene, *sets, "light.background=[0.5, 0.25, 0.125]", size=(64, 64))
    row = {x: picture[32, int((x + 2) * 16)] for x in (-0.75, -0.55, 0.3, 1.25, 1.8)}
    far, near = (GREEN, RED) if red_nearer else (RED, GREEN)
    np.testing.assert_allclose(row[1.8], [*BEHIND[0], 0], atol=1e-3)
    np.testing.assert_allclose(row[-0.55], [*over(BEHIND, RED), 0.5], atol=1e-3)
    np.testing.assert_allclose(row[1.25], [*over(BEHIND, GREEN), 0.25], atol=1e-3)
    np.testing.assert_allclose(row[0.3], [*over(BEHIND, far, near), 1 - 0.5 * 0.75], atol=1e-3)
    np.testing.assert_allclose(row[-0.75], [*(over(POST, RED) if red_nearer else over(POST)), 1], atol=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize("pipeline", PIPELINES)
def test_shadows_fall_on_panes(radiance: Any, tmp_path: Path, pipeline: str) -> None:
    """A pane takes its own shadow, and not that of the surface behind it."""
    scene = tmp_path / "shaded.yaml"
    scene.write_text(SHADED)
    picture = radiance(pipeline, scene, *settings(pipeline), size=(120, 90))[..., :3]
    light = 1 / np.sqrt(1 + 0.3**2)
    pane, floor = np.array([0.8, 0.6, 0.4]), np.array([0.5, 0.5, 0.5])

    def seen(on_pane: float, on_floor: float) -> Floats:
        return over((floor * (on_floor + 0.03), 1.0), (pane * (on_pane + 0.03), 0.75))

    np.testing.assert_allclose(picture[75, 25], floor * (light + 0.03), atol=2e-3)
    np.testing.assert_allclose(picture[60, 75], seen(light, light), atol=2e-3)
    np.testing.assert_allclose(picture[48, 50], seen(0.0, light), atol=2e-3)  # in the box's shadow on the pane
    np.testing.assert_allclose(picture[70, 60], seen(light, 0.0), atol=2e-3)  # before its shadow on the floor
    if pipeline != "forward-transparent":
        bare = radiance(pipeline, scene, *settings(pipeline), "light.blended_lookup=null", size=(120, 90))
        np.testing.assert_allclose(bare[48, 50, :3], seen(light, light), atol=2e-3)
        np.testing.assert_allclose(bare[70, 60, :3], seen(light, 0.0), atol=2e-3)


def test_occlusion_is_that_of_the_surface_behind(radiance: Any, tmp_path: Path) -> None:
    """An opaque pane that is blended: nothing of what is known of the corners behind it shows."""
    lines = (
        shipped_scenes()["stairs"]
        .read_text()
        .replace(
            "lights:",
            """  sheet: {base_color: [0.5, 0.5, 0.5, 1], alpha_mode: blend}
lights:""",
        )
        .replace(
            "materials:",
            """  sheet: {shape: plane, size: [3, 3], at: [1.7, 1.8, 2.3], rotate_degrees: [90, 34, 0], material: sheet}
materials:""",
        )
    )
    (tmp_path / "sheet.yaml").write_text(lines)
    picture = radiance(
        "ssao-disc", tmp_path / "sheet.yaml", "light.terms=ambient", "gbuffer.precision=full", "light.environment=null"
    )
    sheet = np.abs(picture[..., :3] - 0.015).max(-1) < 1e-5
    assert sheet[40:50, 55:65].all()
    assert (picture[..., 0] < 0.7 * 0.03 * 0.72).mean() > 0.01, "there are corners"


@pytest.mark.nightly(keep=1)
@pytest.mark.slow
@pytest.mark.parametrize("shading", ["unlit", "phong", "blinn_phong", "anisotropic", "pbr"])
def test_every_shading_model_draws_the_forward_picture(radiance: Any, steps_off: Any, shading: str) -> None:
    """But for shadow edges on opaque surfaces, which lie by another normal in screen space."""
    forward, two, deferred = (
        radiance(pipeline, "glass", *settings(pipeline, f"shading={shading}"))
        for pipeline in ("forward", "forward-transparent", "deferred")
    )
    assert np.array_equal(forward, two)
    assert (steps_off(deferred, forward) > 4).mean() <= 1e-3


@pytest.mark.slow
@pytest.mark.parametrize("evaluate", ["vertex", "face"])
def test_forward_draws_blended_surfaces_however_light_is_evaluated(radiance: Any, evaluate: str) -> None:
    picture = radiance("forward", "glass", f"light.evaluate={evaluate}")
    without = radiance("forward", "glass", f"light.evaluate={evaluate}", "light.blended=false")
    assert (picture != without).any(-1).mean() > 0.2


# --- where there is nothing of it ------------------------------------------------------------------------------------


def test_a_scene_without_such_surfaces_costs_nothing() -> None:
    """No step, no texture kept longer, and a node of its own is said to have nothing to draw."""
    for pipeline in ("forward", "deferred", "deferred-stencil-lights", "forward-prepass", "forward-multipass"):
        plans = [rg.load(pipeline, scene="cornell_box", sets=sets).plan() for sets in ([], ["light.blended=false"])]
        assert [step.key for step in plans[0].schedule.steps] == [step.key for step in plans[1].schedule.steps]
        assert plans[0].memory == plans[1].memory
    alone = rg.load("forward-transparent", scene="cornell_box").plan()
    assert alone.schedule.culled["transparent"] == "the scene has no transparent objects: there is nothing to draw"
    assert alone.memory == rg.load("forward", scene="cornell_box").plan().memory


def test_a_scene_with_them_has_one_step_more() -> None:
    plan = rg.load("deferred", scene="glass").plan()
    last = [step for step in plan.schedule.steps if step.node == "light"][-1]
    assert (last.kind, last.objects, last.order) == ("geometry", "transparent", "back_to_front")
    assert {read.resource: read.use for read in last.all_reads}["gbuffer.depth"] == "depth_test"
