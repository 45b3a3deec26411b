"""Blended surfaces as a weighted mean, against the paper's formula in NumPy."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

import rendergraph as rg

Floats = npt.NDArray[np.float64]

# Three panes across the view, seen straight on; their order in the file is shuffled by the test.
PANES = """scene: 1
objects:
{objects}
  post: {{shape: box, size: [0.5, 4, 0.2], at: [0.75, 0, -3], material: post}}
materials:
  red: {{base_color: [0.8, 0.1, 0.05, 0.5], alpha_mode: blend}}
  green: {{base_color: [0.1, 0.6, 0.2, 0.25], alpha_mode: blend}}
  blue: {{base_color: [0.1, 0.2, 0.9, 0.75], alpha_mode: blend}}
  post: {{base_color: [0.4, 0.4, 0.9]}}
cameras: {{main: {{eye: [0, 0, 5], target: [0, 0, 0], height: 2, near: 0.1, far: 10}}}}
"""
PANE = "  {0}: {{shape: plane, size: [{1}, 4], at: [{2}, 0, {3}], rotate_degrees: [90, 0, 0], material: {0}}}"
COLORS = {
    "red": (np.array([0.8, 0.1, 0.05]), 0.5),
    "green": (np.array([0.1, 0.6, 0.2]), 0.25),
    "blue": (np.array([0.1, 0.2, 0.9]), 0.75),
}
DISTANCES = {"red": 3.0, "green": 4.0, "blue": 6.0}
BEHIND, POST = np.array([0.5, 0.25, 0.125]), np.array([0.4, 0.4, 0.9])
UNLIT = ["light.shading=unlit", "transparent.shading=unlit", "light.background=[0.5, 0.25, 0.125]"]

# Equations 7 to 10, before opacity; of an orthographic view d(z) is linear.
WEIGHTS: dict[str, Callable[[float], Any]] = {
    "distance_squared": lambda z: np.clip(10 / (1e-5 + (z / 5) ** 2 + (z / 200) ** 6), 1e-2, 3e3),
    "distance_cubed": lambda z: np.clip(10 / (1e-5 + (z / 10) ** 3 + (z / 200) ** 6), 1e-2, 3e3),
    "distance_fourth": lambda z: np.clip(0.03 / (1e-5 + (z / 200) ** 4), 1e-2, 3e3),
    "window_depth": lambda z: max(1e-2, 3e3 * (1 - (z - 0.1) / 9.9) ** 3),
    "opacity": lambda z: 1.0,
}


def blended(names: list[str], weight: Any, behind: Floats) -> Floats:
    """The paper's equation 6 over what is behind."""
    if not names:
        return behind
    layers = [(*COLORS[name], weight(DISTANCES[name])) for name in names]
    mean = sum(c * a * w for c, a, w in layers) / sum(a * w for _, a, w in layers)
    left = np.prod([1 - a for _, a, _ in layers])
    return np.asarray(mean * (1 - left) + behind * left)


def scene(folder: Path, order: list[str]) -> Path:
    """Red covers the left, green the middle, blue all but the right edge."""
    panes = {
        "red": PANE.format("red", 1, -0.5, 5 - DISTANCES["red"]),
        "green": PANE.format("green", 1, 0, 5 - DISTANCES["green"]),
        "blue": PANE.format("blue", 1.7, -0.15, 5 - DISTANCES["blue"]),
    }
    path = folder / f"{''.join(order)}.yaml"
    path.write_text(PANES.format(objects="\n".join(panes[name] for name in order)))
    return path


@pytest.mark.parametrize("weight", list(WEIGHTS))
def test_the_picture_is_the_papers_mean(radiance: Any, tmp_path: Path, weight: str) -> None:
    at = {4: ["red", "blue"], 24: ["red", "green", "blue"], 40: ["green", "blue"], 52: ["blue"], 60: []}
    pictures = [
        radiance("weighted-blended", scene(tmp_path, order), *UNLIT, f"transparent.weight={weight}", size=(64, 64))
        for order in (["red", "green", "blue"], ["blue", "green", "red"])
    ]
    for x, names in at.items():
        behind = POST if x >= 48 else BEHIND
        expected = blended(names, WEIGHTS[weight], behind)
        np.testing.assert_allclose(pictures[0][32, x, :3], expected, atol=1.5e-3)
    np.testing.assert_allclose(pictures[0], pictures[1], atol=1e-6)


def test_its_unit_is_that_of_distances(radiance: Any, tmp_path: Path) -> None:
    sets = [*UNLIT, "transparent.weight=distance_cubed", "transparent.unit=0.25"]
    picture = radiance("weighted-blended", scene(tmp_path, ["red", "green", "blue"]), *sets, size=(64, 64))
    expected = blended(["red", "green", "blue"], lambda z: WEIGHTS["distance_cubed"](4 * z), BEHIND)
    np.testing.assert_allclose(picture[32, 24, :3], expected, atol=1.5e-3)


def test_samples_of_a_pixel_are_blended_one_by_one(session: rg.Session, tmp_path: Path) -> None:
    """An edge of a pane across a pixel: half of its samples have it."""
    path = scene(tmp_path, ["red", "green", "blue"])
    pipeline = rg.load("weighted-blended", scene=path, size=(63, 63), sets=[*UNLIT, "light.samples=4"])
    resolve = {"type": "resolve", "inputs": {"source": "transparent.radiance"}, "params": {"average": "plain"}}
    patch = {"nodes": {"one": resolve, "display": {"inputs": {"radiance": "one.radiance"}}}}
    picture = session.render(pipeline.patch(patch).patch({"outputs": {"radiance": "one.radiance"}}))["radiance"]
    sides = [
        blended(names, WEIGHTS["distance_cubed"], BEHIND) for names in (["red", "green", "blue"], ["green", "blue"])
    ]
    np.testing.assert_allclose(picture[31, 31, :3], np.mean(sides, axis=0), atol=2e-3)


def test_memory_is_shared_poisoned_and_shuffled_without_a_trace(session: rg.Session) -> None:
    sets = ["sun.resolution=64", "light.environment=null", "transparent.environment=null"]
    pipeline = rg.load("weighted-blended", size=(48, 32), sets=sets)
    plain = session.render(pipeline, alias=False)["radiance"]
    assert np.isfinite(plain).all()
    assert plain[..., :3].mean() > 0.05
    for options in ({}, {"poison": True}, {"poison": True, "shuffle": 3}):
        np.testing.assert_array_equal(session.render(pipeline, **options)["radiance"], plain)
