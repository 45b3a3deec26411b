"""Layers peeled off one by one, against Porter and Duff's formula, ray casting, and sorted blending where that is right."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

import rendergraph as rg
from rendergraph.resources import shipped_scenes
from rendergraph.scene.load import load

Floats = npt.NDArray[np.float64]

# Two panes that cross in the vertical axis, seen straight on without perspective: left of the axis red is nearer, right of
# it green; and behind both a blue one, across the lower half.
CROSSED = """scene: 1
objects:
  red: {shape: plane, size: [2, 2], rotate_degrees: [90, 60, 0], material: red}
  green: {shape: plane, size: [2, 2], rotate_degrees: [90, -60, 0], material: green}
  blue: {shape: plane, size: [2, 1], at: [0, -0.5, -2], rotate_degrees: [90, 0, 0], material: blue}
materials:
  red: {base_color: [0.8, 0.1, 0.05, 0.5], alpha_mode: blend, double_sided: true}
  green: {base_color: [0.1, 0.6, 0.2, 0.25], alpha_mode: blend, double_sided: true}
  blue: {base_color: [0.1, 0.2, 0.9, 0.75], alpha_mode: blend}
cameras: {main: {eye: [0, 0, 5], target: [0, 0, 0], height: 2, near: 0.1, far: 10}}
"""
RED, GREEN, BLUE = ([0.8, 0.1, 0.05], 0.5), ([0.1, 0.6, 0.2], 0.25), ([0.1, 0.2, 0.9], 0.75)
BEHIND = ([0.5, 0.25, 0.125], 1.0)
PLAIN = ["sun.resolution=64", "light.environment=null"]
UNLIT = ["light.shading=unlit", "transparent.shading=unlit", "light.background=[0.5, 0.25, 0.125]"]


def over(*layers: tuple[list[float], float]) -> Floats:
    """Colour of layers from near to far, each with its opacity (Porter and Duff 1984)."""
    color, left = np.zeros(3), 1.0
    for rgb, opacity in layers:
        color = color + left * opacity * np.array(rgb)
        left *= 1 - opacity
    return color


@pytest.fixture
def crossed(tmp_path: Path) -> Path:
    (tmp_path / "crossed.yaml").write_text(CROSSED)
    return tmp_path / "crossed.yaml"


def test_crossing_panes_have_the_order_of_each_pixel(radiance: Any, crossed: Path) -> None:
    orders = {
        (8, 24): (RED, GREEN, BEHIND),
        (8, 40): (GREEN, RED, BEHIND),
        (56, 24): (RED, GREEN, BLUE, BEHIND),
        (56, 40): (GREEN, RED, BLUE, BEHIND),
        (56, 8): (BLUE, BEHIND),
        (8, 8): (BEHIND,),
    }
    every = radiance("depth-peeling", crossed, *UNLIT, size=(64, 64))
    two = radiance("depth-peeling", crossed, *UNLIT, "transparent.layers=2", size=(64, 64))
    for place, layers in orders.items():
        np.testing.assert_allclose(every[place][:3], over(*layers), atol=1e-3)
        np.testing.assert_allclose(two[place][:3], over(*layers[:-1][:2], BEHIND), atol=1e-3)
    one_order = radiance("forward-transparent", crossed, *UNLIT, size=(64, 64))
    right = [np.allclose(one_order[place][:3], over(*layers), atol=1e-3) for place, layers in orders.items()]
    assert right.count(False) == 2, "sorting by centres is wrong on one side of the axis"


def test_it_draws_what_sorting_draws_where_that_is_right(session: rg.Session, steps_off: Any, tmp_path: Path) -> None:
    """Under a light and its shadows, over forward and deferred shading, with one sample a pixel and with several."""
    text = shipped_scenes()["glass"].read_text()
    text = text.replace("at: [-0.4, 0.95, 0.5]", "at: [-0.4, 0.95, 0.9]")  # no pane cuts another, or the ball
    lines = text.splitlines(keepends=True)
    (tmp_path / "apart.yaml").write_text("".join(line for line in lines if not line.startswith("  green_pane")))
    links = {"radiance": "light.radiance", "depth": "light.surface_depth", "lookup": "shadows.lookup"}
    patch = {
        "nodes": {"transparent": {"type": "depth_peeling", "inputs": links}, "light": {"params": {"blended": False}}},
        "outputs": {"radiance": "transparent.radiance"},
    }
    for pipeline, sets, more in (
        ("forward", [], []),
        ("forward", ["light.samples=4"], []),
        ("deferred", [], ["transparent.depth=gbuffer.depth"]),
    ):
        loaded = rg.load(pipeline, scene=tmp_path / "apart.yaml", size=(96, 72), sets=[*sets, *PLAIN])
        peeled = loaded.patch(patch)
        for change in more:
            peeled = peeled.set(*change.split("="))
        a, b = (session.render(one, outputs=["radiance"])["radiance"] for one in (peeled, loaded))
        # Half floats are rounded once a layer in one, and once in the other.
        assert (steps_off(a, b) > 3).mean() <= 1e-3, (pipeline, sets)
        without = session.render(loaded.set("light.blended", False), outputs=["radiance"])["radiance"]
        assert (steps_off(a, without) > 50).mean() > 0.1


def test_memory_is_shared_poisoned_and_shuffled_without_a_trace(session: rg.Session) -> None:
    patch = {"outputs": {"peeled": "transparent.peeled"}}
    pipeline = rg.load("depth-peeling", size=(48, 32), sets=[*PLAIN, "transparent.environment=null"], patches=[patch])
    plain = session.render(pipeline, alias=False)
    assert np.isfinite(plain["radiance"]).all()
    assert plain["peeled"][..., 3].max() > 0.9
    for options in ({}, {"poison": True}, {"poison": True, "shuffle": 3}):
        again = session.render(pipeline, **options)
        for name in ("radiance", "peeled"):
            np.testing.assert_array_equal(again[name], plain[name])


# --- how many passes there are ---------------------------------------------------------------------------------------


def passes(pipeline: rg.Pipeline) -> int:
    return sum(step.node == "transparent" and step.kind == "geometry" for step in pipeline.plan().schedule.steps)


def test_there_are_as_many_passes_as_the_scene_has_surfaces(crossed: Path) -> None:
    assert passes(rg.load("depth-peeling", scene="glass")) == 4  # three panes and a bubble: convex, seen from outside
    assert passes(rg.load("depth-peeling", scene=crossed)) == 3  # flat, so that both sides are one surface
    assert passes(rg.load("depth-peeling", scene=crossed, sets=["transparent.layers=2"])) == 2
    assert passes(rg.load("depth-peeling", scene=crossed, sets=["transparent.layers=60"])) == 3


def test_a_scene_without_such_surfaces_costs_nothing() -> None:
    for pipeline in ("depth-peeling", "weighted-blended"):
        plan = rg.load(pipeline, scene="cornell_box").plan()
        assert plan.schedule.culled["transparent"] == "the scene has no transparent objects: there is nothing to draw"
        assert plan.memory == rg.load("forward", scene="cornell_box").plan().memory


# --- against the reference -------------------------------------------------------------------------------------------


def rays_through(scene: Path, case: dict[str, Any]) -> tuple[npt.NDArray[np.bool_], Floats, Floats]:
    """Where rays meet each triangle, its object's colour and opacity, and the centre of its object's box."""
    loaded = load(scene)
    eye, target, up = (np.array(case["camera"][key]) for key in ("eye", "target", "up"))
    ahead = (target - eye) / np.linalg.norm(target - eye)
    right = np.cross(ahead, up) / np.linalg.norm(np.cross(ahead, up))
    half = np.tan(case["camera"]["yfov_radians"] / 2)
    at = (np.arange(192) + 0.5) / 96 - 1
    rays = ahead + half * (at[None, :, None] * right - at[:, None, None] * np.cross(right, ahead))
    hits, colors, centres = [], [], []
    for placed in loaded.objects:
        mesh = loaded.meshes[placed.mesh]
        corners = (mesh.positions.astype(np.float64) @ placed.transform[:3, :3].T + placed.transform[:3, 3])[
            mesh.indices
        ]
        for a, b, c in corners:  # Möller and Trumbore 1997
            p = np.cross(rays, c - a)
            scale = 1 / (p @ (b - a))
            u = (p @ (eye - a)) * scale
            q = np.cross(eye - a, b - a)
            v = (rays @ q) * scale
            hits.append((u >= 0) & (v >= 0) & (u + v <= 1))
            colors.append(loaded.materials[placed.material].base_color)
            centres.append((corners.min(axis=(0, 1)) + corners.max(axis=(0, 1))) / 2)
    return np.stack(hits), np.array(colors), np.array(centres)


@pytest.mark.slow
def test_the_reference_is_met_layer_by_layer_and_sorting_fails_where_its_order_does(
    session: rg.Session, shared: Path
) -> None:
    folder = shared / "reference" / "b8_transparency"
    case = json.loads((folder / "case.json").read_text())
    expected = np.load(folder / "layers.npz")
    background = np.array(case["background"])
    sets = [*UNLIT[:2], f"light.background={case['background']}"]
    pipeline = rg.load("depth-peeling", scene=folder / "scene.glb", size=(192, 192), sets=sets)
    peeling = pipeline.patch({"outputs": {"peeled": "transparent.peeled"}})
    whole = expected["premultiplied"] + (1 - expected["alpha"][..., None]) * background
    for layers in (1, 2, 3, 4):
        frame = session.render(peeling.set("transparent.layers", layers), outputs=["peeled", "radiance"])
        np.testing.assert_allclose(frame["peeled"], expected["first_layers"][:, :, layers - 1], atol=1e-3)
        few = expected["count"] <= layers
        np.testing.assert_allclose(frame["radiance"][few][:, :3], whole[few], atol=1e-3)
        assert np.abs(frame["radiance"][~few][:, :3] - whole[~few]).max() > 0.02
    np.testing.assert_allclose(session.render(peeling)["radiance"][..., :3], whole, atol=1e-3)

    hits, colors, centres = rays_through(folder / "scene.glb", case)
    ahead = np.array(case["camera"]["target"]) - case["camera"]["eye"]
    color = np.broadcast_to(background, (192, 192, 3))
    for triangle in np.argsort(-(centres @ ahead), kind="stable"):
        opacity = colors[triangle, 3] * hits[triangle][..., None]
        color = color * (1 - opacity) + colors[triangle, :3] * opacity
    wrong = np.abs(color - whole).max(axis=-1) > 2e-3
    sorted_picture = session.render(pipeline.set("transparent.type", "forward_transparent"), outputs=["radiance"])
    off = np.abs(sorted_picture["radiance"][..., :3] - whole).max(axis=-1) > 2e-3
    inside = ~expected["edge"]
    assert 0.03 < wrong[inside].mean() < 0.2
    assert (off == wrong)[inside].mean() > 0.9995
