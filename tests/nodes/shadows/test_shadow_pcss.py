"""Soft shadows against lights with a size, sampled by ray casting in NumPy."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest

import rendergraph as rg
from rendergraph.scene.cameras import view_matrices

Floats = npt.NDArray[np.float64]
SIZE = (160, 120)
LOW, HIGH = np.array([-0.6, 0.5, -0.4]), np.array([0.4, 0.9, 0.6])
SCENE = """scene: 1
objects:
  floor: {shape: plane, size: [12, 12]}
  box: {shape: box, size: [1, 0.4, 1], at: [-0.1, 0.7, 0.1]}
  post: {shape: box, size: [0.2, 1.2, 0.2], at: [1.2, 0.6, 0]}
lights: {lamp: LIGHT}
cameras: {main: {eye: [0.6, 4.5, 3.5], target: [0.3, 0, -0.2], fov_y_degrees: 40, near: 0.1, far: 60}}
"""
BOXES = ((LOW, HIGH), (np.array([1.1, 0, -0.1]), np.array([1.3, 1.2, 0.1])))
LAMP = np.array([-0.8, 4.0, 1.0])
LIGHTS = {
    "spot": "{type: spot, at: [-0.8, 4, 1], direction: [0.25, -1, -0.3], intensity: 40, outer_degrees: 40}",
    "point": "{type: point, at: [-0.8, 4, 1], intensity: 40}",
    "directional": "{type: directional, direction: [0.5, -1, -0.4], intensity: 2}",
}
DIRECTION = np.array([0.5, -1, -0.4]) / np.linalg.norm([0.5, -1, -0.4])


def disc(count: int) -> Floats:
    """Points evenly spread in the unit disc."""
    k = np.arange(count) + 0.5
    turn = np.pi * (3 - 5**0.5) * k
    return np.stack([np.cos(turn), np.sin(turn)], -1) * np.sqrt(k / count)[:, None]


def blocked(start: Floats, way: Floats) -> npt.NDArray[np.bool_]:
    """Whether the boxes cut the ways from the starts, (n, 3) each (the slabs of Kay and Kajiya 1986)."""
    cut = np.zeros(len(start), bool)
    for low, high in BOXES:
        with np.errstate(divide="ignore"):
            first, second = (low - start) / way, (high - start) / way
        enters, leaves = np.minimum(first, second).max(axis=1), np.maximum(first, second).min(axis=1)
        cut |= (enters < leaves) & (leaves > 1e-6) & (enters < 1)
    return cut


def truth(points: Floats, kind: str, width: float, count: int = 256) -> Floats:
    """Share of a disc light that each point sees; it faces the middle of what it shines on."""
    towards = -DIRECTION if kind == "directional" else LAMP - np.array([0.2, 0, -0.2])
    axis = towards / np.linalg.norm(towards)
    side = np.cross(axis, [0, 0, 1.0])
    side /= np.linalg.norm(side)
    seen = np.zeros(len(points))
    for u, v in disc(count):
        across = u * side + v * np.cross(axis, side)
        if kind == "directional":
            way = np.broadcast_to(50 * (axis + np.tan(width / 2) * across), points.shape)
        else:
            way = LAMP + width / 2 * across - points
        seen += ~blocked(points, way)
    return seen / count


@pytest.mark.nightly(keep=1)
@pytest.mark.parametrize(
    ("kind", "width"), [("spot", 0.5), ("spot", 0.2), ("point", 0.4), ("directional", 0.15), ("directional", 0.05)]
)
def test_against_a_sampled_light(session: rg.Session, tmp_path: Path, kind: str, width: float) -> None:
    lit, points = draw(session, tmp_path, kind, width)
    expected = truth(points, kind, width)
    assert ((expected > 0.1) & (expected < 0.9)).mean() > 0.004
    assert np.sqrt(((lit - expected) ** 2).mean()) < 0.05
    hard = truth(points, kind, 0.0, 1)
    assert np.sqrt(((lit - expected) ** 2).mean()) < 0.6 * np.sqrt(((hard - expected) ** 2).mean())


@pytest.mark.parametrize("kind", list(LIGHTS))
def test_a_light_without_a_size_casts_hard_shadows(session: rg.Session, tmp_path: Path, kind: str) -> None:
    """But for the texel that the disc never falls below."""
    lit, points = draw(session, tmp_path, kind, 0.0)
    expected = truth(points, kind, 0.0, 1)
    assert (np.abs(lit - expected) > 0.01).mean() < 0.01
    narrow, _ = draw(session, tmp_path, kind, 0.02)
    wide, _ = draw(session, tmp_path, kind, 0.2)
    assert np.abs(lit - expected).mean() <= np.abs(narrow - expected).mean() < np.abs(wide - expected).mean()


def draw(session: rg.Session, folder: Path, kind: str, width: float) -> tuple[Floats, Floats]:
    """Visibility at the floor's pixels, and where they lie."""
    (folder / "scene.yaml").write_text(SCENE.replace("LIGHT", LIGHTS[kind]))
    sets = (
        "shadows.type=shadow_pcss",
        f"shadows.size={width}",
        f"shadows.angle={width}",
        "shadows.max_radius=200",
        "shadows.samples=64",
        "shadows.searches=64",
    )
    loaded = rg.load("forward-prepass", scene=folder / "scene.yaml", size=SIZE, sets=sets)
    frame = session.render(loaded, outputs=(), taps=("shadows.visibility", "prepass.depth"), warm_up=False)
    view = view_matrices(next(iter(loaded.link().scene.cameras.values())), SIZE)
    lit, depth = (np.asarray(frame.arrays[tap], np.float64) for tap in ("shadows.visibility", "prepass.depth"))
    x, y = np.meshgrid((np.arange(SIZE[0]) + 0.5) / SIZE[0] * 2 - 1, 1 - (np.arange(SIZE[1]) + 0.5) / SIZE[1] * 2)
    clip = np.stack([x, y, 1 - 2 * depth[..., 0], np.ones_like(x)], -1)
    world = clip @ np.linalg.inv(view.projection @ view.view).T
    world = world[..., :3] / world[..., 3:]
    floor = (depth[..., 0] > 0) & (np.abs(world[..., 1]) < 1e-3) & (np.abs(world[..., 0]) < 3)
    return lit[0, ..., 0][floor], world[floor]
