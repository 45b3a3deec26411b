"""Traced shadows against rays in NumPy and against the closed form of a half-plane under a disc of light."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest

import rendergraph as rg
from rendergraph.scene.cameras import view_matrices

Floats = npt.NDArray[np.float64]
SIZE = (96, 64)
LOW, HIGH = np.array([-0.6, 0.5, -0.4]), np.array([0.4, 0.9, 0.6])
SCENE = """scene: 1
objects:
  floor: {shape: plane, size: [12, 12]}
  box: {shape: box, size: [1, 0.4, 1], at: [-0.1, 0.7, 0.1]}
  ghost: {shape: box, size: [0.5, 0.5, 0.5], at: [1.2, 1.2, 0], casts_shadow: false}
lights: {LIGHTS}
cameras: {main: {eye: [0.6, 4.5, 3.5], target: [0.1, 0, -0.2], fov_y_degrees: 40, near: 0.1, far: 60}}
"""
LAMP, DIRECTION = np.array([-0.8, 4.0, 1.0]), np.array([0.5, -1, -0.4]) / np.linalg.norm([0.5, -1, -0.4])
LIGHTS = {
    "point": "lamp: {type: point, at: [-0.8, 4, 1], intensity: 40}",
    "directional": "sun: {type: directional, direction: [0.5, -1, -0.4], intensity: 2}",
}


def draw(session: rg.Session, folder: Path, lights: str, *sets: str) -> tuple[Floats, Floats]:
    """Return visibility, (layers, height, width), and world positions; NaN where there is nothing."""
    (folder / "scene.yaml").write_text(SCENE.replace("LIGHTS", lights))
    pipeline = rg.load("deferred", scene=folder / "scene.yaml", size=SIZE, sets=("shadows.type=traced_shadows", *sets))
    frame = session.render(pipeline, outputs=(), taps=("shadows.visibility", "gbuffer.depth"))
    visibility = np.asarray(frame.arrays["shadows.visibility"], np.float64)[..., 0].reshape(-1, SIZE[1], SIZE[0])
    window = np.asarray(frame.arrays["gbuffer.depth"], np.float64)[..., 0]
    camera = view_matrices(next(iter(pipeline.link().scene.cameras.values())), SIZE)
    y, x = np.mgrid[0 : SIZE[1], 0 : SIZE[0]]
    clip = np.stack(
        [2 * (x + 0.5) / SIZE[0] - 1, 1 - 2 * (y + 0.5) / SIZE[1], 1 - 2 * window, np.ones(window.shape)], -1
    )
    world = clip @ np.linalg.inv(camera.projection @ camera.view).T
    points = world[..., :3] / world[..., 3:]
    return visibility, np.where(window[..., None] > 0, points, np.nan)


def is_blocked(start: Floats, way: Floats) -> npt.NDArray[np.bool_]:
    """Return whether the box lies on ways from starts, (n, 3) each (slabs: Kay and Kajiya 1986)."""
    with np.errstate(divide="ignore", invalid="ignore"):
        first, second = (LOW - start) / way, (HIGH - start) / way
    enters, leaves = np.minimum(first, second).max(axis=1), np.maximum(first, second).min(axis=1)
    return np.asarray((enters < leaves) & (leaves > 1e-4) & (enters < 1))


def expected_visibility(points: Floats, kind: str, width: float, count: int) -> Floats:
    """Return the part of a disc light that each point on the floor sees; the disc faces the point."""
    number = np.arange(count) + 0.5
    turn, away = np.pi * (3 - 5**0.5) * number, np.sqrt(number / count)
    if kind == "directional":
        towards = np.broadcast_to(-DIRECTION, points.shape)
        radius = np.full(len(points), np.tan(width / 2))
    else:
        towards = LAMP - points
        radius = np.full(len(points), width / 2)
    length = np.linalg.norm(towards, axis=1, keepdims=True)
    side = np.cross(towards, [0.0, 0.0, 1.0])
    side /= np.linalg.norm(side, axis=1, keepdims=True)
    other = np.cross(towards / length, side)
    open_ = np.zeros(len(points))
    for a, r in zip(turn, away, strict=True):
        way = towards + (radius * r)[:, None] * (np.cos(a) * side + np.sin(a) * other)
        open_ += ~is_blocked(points, 50 * way if kind == "directional" else way)
    return open_ / count


@pytest.mark.parametrize("kind", list(LIGHTS))
def test_hard_shadows_are_those_of_rays(session: rg.Session, tmp_path: Path, kind: str) -> None:
    visibility, points = draw(session, tmp_path, LIGHTS[kind])
    on_floor = np.abs(points[..., 1]) < 1e-3
    expected = expected_visibility(points[on_floor], kind, 0.0, 1)
    assert (expected == 0).sum() > 100
    assert (np.abs(visibility[0][on_floor] - expected) > 1e-3).mean() < 0.002  # rays that graze the box
    assert (visibility[0][points[..., 1] > 0.899] == 1).mean() > 0.99  # the top of the box sees the light


def test_what_lies_behind_a_lamp_casts_no_shadow(session: rg.Session, tmp_path: Path) -> None:
    below = "lamp: {type: point, at: [-0.1, 0.3, 0.1], intensity: 4}"  # between the floor and the box
    visibility, points = draw(session, tmp_path, below)
    on_floor = np.abs(points[..., 1]) < 1e-3
    assert visibility[0][on_floor].min() == 1.0


@pytest.mark.parametrize(("kind", "width", "rays"), [("point", 0.8, 64), ("directional", 0.3, 160)])
def test_soft_shadows_are_the_mean_over_a_disc(
    session: rg.Session, tmp_path: Path, kind: str, width: float, rays: int
) -> None:
    """Also if the rays take several steps."""
    setting = f"shadows.{'angle' if kind == 'directional' else 'size'}={width}"
    visibility, points = draw(session, tmp_path, LIGHTS[kind], setting, f"shadows.samples={rays}")
    on_floor = np.abs(points[..., 1]) < 1e-3
    expected = expected_visibility(points[on_floor], kind, width, 256)
    error = visibility[0][on_floor] - expected
    penumbra = (expected > 0.02) & (expected < 0.98)
    assert penumbra.sum() > 60
    assert np.sqrt((error[penumbra] ** 2).mean()) < 0.03  # far below 0.06 of 64 random rays
    assert abs(error[penumbra].mean()) < 0.005


def test_a_half_plane_under_a_disc_of_light_has_the_area_of_a_segment(session: rg.Session, tmp_path: Path) -> None:
    """The part of the disc that is open at a distance x from the edge's foot, at the height h, is a segment's."""
    height, angle = 1.0, 0.5
    (tmp_path / "scene.yaml").write_text(
        "scene: 1\nobjects:\n  floor: {shape: plane, size: [9, 9]}\n"
        f"  roof: {{shape: box, size: [60, 0.002, 60], at: [-30, {height}, 0]}}\n"
        "lights: {sun: {type: directional, direction: [0, -1, 0], intensity: 2}}\n"
        "cameras: {main: {eye: [0, 0.5, 0], target: [0, 0, 0], up: [0, 0, 1], height: 0.5, near: 0.1, far: 2}}\n"
    )
    sets = ("shadows.type=traced_shadows", f"shadows.angle={angle}", "shadows.samples=256")
    pipeline = rg.load("deferred", scene=tmp_path / "scene.yaml", size=(32, 8), sets=sets)
    frame = session.render(pipeline, outputs=(), taps=("shadows.visibility",))
    lit = np.asarray(frame.arrays["shadows.visibility"], np.float64).reshape(8, 32).mean(axis=0)
    lit = lit[::-1] if lit[0] > lit[-1] else lit  # which side of the picture the roof is on is not the matter here
    x = (np.arange(32) + 0.5 - 16) / 32 * 2.0
    c = np.clip(x / (height * np.tan(angle / 2)), -1, 1)
    expected = 1 - (np.arccos(c) - c * np.sqrt(1 - c * c)) / np.pi
    assert np.abs(lit - expected).max() < 0.02


def test_both_forms_give_one_picture(session: rg.Session, tmp_path: Path) -> None:
    (tmp_path / "scene.yaml").write_text(SCENE.replace("LIGHTS", LIGHTS["point"]))
    sets = ("shadows.type=traced_shadows",)
    pictures = [
        session.render(rg.load(name, scene=tmp_path / "scene.yaml", size=SIZE, sets=sets))["image"].astype(int)
        for name in ("forward", "forward-prepass")
    ]
    assert (np.abs(pictures[0] - pictures[1]) > 1).any(axis=-1).mean() <= 0.001


def test_the_lights_are_those_of_the_map_that_it_replaces(session: rg.Session, tmp_path: Path) -> None:
    both = f"{LIGHTS['point']}, {LIGHTS['directional']}"
    (tmp_path / "scene.yaml").write_text(SCENE.replace("LIGHTS", both))
    sets = ("sun.light=[lamp, sun]", "shadows.type=traced_shadows")
    pipeline = rg.load("deferred", scene=tmp_path / "scene.yaml", size=SIZE, sets=sets)
    frame = session.render(pipeline, outputs=(), taps=("shadows.visibility",))
    layers = frame.arrays["shadows.visibility"]
    assert layers.shape[0] == 2
    assert not np.array_equal(layers[0], layers[1])
    assert "sun" in frame.culled  # no map is drawn
    alone, _ = draw(session, tmp_path, both, "shadows.shadow_map=null", "shadows.light=sun")
    assert np.array_equal(alone[0], layers[1, ..., 0])


def test_rays_differ_from_frame_to_frame_if_animated(session: rg.Session, tmp_path: Path) -> None:
    (tmp_path / "scene.yaml").write_text(SCENE.replace("LIGHTS", LIGHTS["point"]))
    for animated in (True, False):
        sets = ("shadows.type=traced_shadows", "shadows.size=0.5", f"shadows.animated={str(animated).lower()}")
        pipeline = rg.load("deferred", scene=tmp_path / "scene.yaml", size=SIZE, sets=sets)
        first, second = (
            session.render(pipeline, outputs=(), taps=("shadows.visibility",), frames=range(n, n + 1)) for n in (1, 2)
        )
        assert np.array_equal(first.arrays["shadows.visibility"], second.arrays["shadows.visibility"]) != animated
