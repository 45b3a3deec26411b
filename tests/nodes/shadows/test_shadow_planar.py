"""Planar shadows: the matrix against numbers of others, the picture against rays, what receives and what does not."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from rendergraph.nodes.shadows.shadow_planar import planar_projection

import rendergraph as rg
from rendergraph.api import projection
from rendergraph.errors import InputError

Floats = npt.NDArray[np.float64]
SIZE = (120, 80)
SCENE = """scene: 1
objects:
  floor: {shape: plane, size: [6, 6], at: [0, 0.5, 0], rotate_degrees: [10, 0, 5], material: grey, casts_shadow: false}
  low: {shape: sphere, radius: 0.4, at: [0.6, 1.0, 0.8], material: grey}
  high: {shape: sphere, radius: 0.3, at: [-0.6, 1.9, 0.2], scale: [-1, 1, 1], material: grey}
  above: {shape: sphere, radius: 0.2, at: [0.5, 4.6, 0.4], material: grey}
  below: {shape: sphere, radius: 0.3, at: [-0.7, -0.4, 0.9], material: grey}
EXTRA
materials:
  grey: {base_color: [0.7, 0.7, 0.7]}
lights:
  sun: {type: directional, direction: [0.4, -1, -0.3], intensity: 2}
  lamp: {type: point, at: [0.2, 4, 0.3], intensity: 12}
cameras: {main: {eye: [0.5, 4, 5.5], target: [0, 0.5, 0], fov_y_degrees: 45, near: 0.1, far: 50}}
"""


def drawn(session: rg.Session, folder: Path, *sets: str, extra: str = "", text: str = SCENE) -> tuple[Any, Floats]:
    """Visibility of both lights, and the depth that it was drawn with, top row first."""
    (folder / "s.yaml").write_text(text.replace("EXTRA", extra))
    loaded = rg.load("shadow-planar", scene=folder / "s.yaml", size=SIZE, sets=("shadows.light=[sun, lamp]", *sets))
    frame = session.render(loaded, outputs=(), taps=["shadows.visibility", "gbuffer.depth"], warm_up=False)
    return frame.arrays["shadows.visibility"][..., 0], np.asarray(frame.arrays["gbuffer.depth"], np.float64)[..., 0]


def test_the_matrix_is_the_documents(shared: Path) -> None:
    cases = json.loads((shared / "reference" / "b6_math" / "vectors.json").read_text())["planar_shadow"]["cases"]
    assert cases
    for case in cases:
        made = planar_projection(np.array(case["plane"]), np.array(case["light"]))
        np.testing.assert_allclose(made, case["matrix"], atol=1e-12)


def test_points_fall_on_the_plane_along_the_light() -> None:
    random = np.random.default_rng(2)
    for w in (0.0, 1.0):
        plane, light, point = random.normal(size=4), np.append(random.normal(size=3), w), random.normal(size=3)
        fallen = planar_projection(plane, light) @ np.append(point, 1)
        fallen = fallen[:3] / fallen[3]
        assert abs(plane[:3] @ fallen + plane[3]) < 1e-9
        along = light[:3] - w * point
        np.testing.assert_allclose(np.cross(fallen - point, along), 0, atol=1e-9)


def rays(depth: Floats, light: Any, spheres: list[tuple[Floats, float]]) -> tuple[Any, Floats, Floats]:
    """Whether spheres leave the light free at each seen position, by how much they miss or hit, and the positions."""
    view = projection.inverse_rigid(projection.look_at((0.5, 4, 5.5), (0, 0.5, 0)))
    matrix = projection.perspective(np.radians(45), SIZE[0] / SIZE[1], 0.1, 50)
    matrix[2] = (matrix[3] - matrix[2]) / 2
    y, x = np.mgrid[0 : SIZE[1], 0 : SIZE[0]]
    clip = np.stack([(x + 0.5) / SIZE[0] * 2 - 1, 1 - (y + 0.5) / SIZE[1] * 2, depth, np.ones_like(depth)], -1)
    world = clip @ np.linalg.inv(matrix @ view).T
    world = world[..., :3] / world[..., 3:]
    free = np.ones(depth.shape, bool)
    margin = np.full(depth.shape, np.inf)
    for center, radius in spheres:
        towards = np.broadcast_to(light[:3] - light[3] * world, world.shape) if light[3] else light[:3]
        unit = towards / np.linalg.norm(towards, axis=-1, keepdims=True)
        along = ((center - world) * unit).sum(-1)
        reach = np.linalg.norm(towards, axis=-1) if light[3] else np.inf
        distance = np.linalg.norm(center - world - along[..., None] * unit, axis=-1)
        between = (along > 0) & (along < reach)
        free &= ~((distance < radius) & between)
        margin = np.where(between, np.minimum(margin, np.abs(distance - radius)), margin)
    return free, margin, world


def test_shadows_on_the_plane_are_where_rays_are_stopped(session: rg.Session, tmp_path: Path) -> None:
    """Nothing of what lies behind the plane or the light falls on it; on other surfaces there is no shadow at all."""
    visibility, depth = drawn(session, tmp_path)
    spheres = [(np.array(c), r) for c, r in (((0.6, 1, 0.8), 0.4), ((-0.6, 1.9, 0.2), 0.3), ((0.5, 4.6, 0.4), 0.2))]
    sun = -np.array([0.4, -1, -0.3])
    for layer, light in enumerate((np.append(sun, 0.0), np.array([0.2, 4, 0.3, 1]))):
        free, margin, world = rays(depth, light, spheres)
        rx, rz = np.radians([10, 5])
        normal = np.array([-np.sin(rz) * np.cos(rx), np.cos(rz) * np.cos(rx), np.sin(rx)])
        floor = (depth > 0) & (np.abs((world - (0, 0.5, 0)) @ normal) < 2e-3)
        judged = floor & (margin > 0.06)  # spheres are polyhedra
        assert judged.mean() > 0.2
        assert 0.005 < 1 - free[judged].mean() < 0.5
        assert np.array_equal(visibility[layer][judged] > 0.5, free[judged])
        assert (visibility[layer][~floor & (depth == 0)] == 1).all()
        others = (depth > 0) & (np.abs((world - (0, 0.5, 0)) @ normal) > 0.05)
        assert others.any()
        assert (visibility[layer][others] == 1).all()


def test_a_plane_that_is_not_drawn_receives_on_what_is_seen_there(session: rg.Session, tmp_path: Path) -> None:
    """`ShadowPlaneNS`, small and hidden, lies on the floor: shadows fall within it alone."""
    place = "at: [0, 0.5, 0], rotate_degrees: [10, 0, 5]"
    extra = f"  ShadowPlaneNS: {{shape: plane, size: [1.6, 1.6], {place}, hidden: true, casts_shadow: false}}"
    whole, depth = drawn(session, tmp_path)
    part, same = drawn(session, tmp_path, extra=extra)
    assert np.array_equal(depth, same)
    shadow, within = whole < 0.5, part < 0.5
    assert within.any()
    assert not (within & ~shadow).any()
    assert (shadow & ~within).sum() > 20
    named, _ = drawn(session, tmp_path, "shadows.receiver=floor", extra=extra)
    assert np.array_equal(named, whole)


def test_a_receiver_that_is_none_is_said_by_check(tmp_path: Path) -> None:
    (tmp_path / "s.yaml").write_text(SCENE.replace("EXTRA", ""))
    (tmp_path / "t.yaml").write_text("scene: 1\nobjects: {b: {shape: box}}\n")
    for scene, sets, text in (
        ("s.yaml", ("shadows.receiver=low",), "object 'low' is not flat, so no planar shadow falls on it"),
        ("s.yaml", ("shadows.receiver=flor",), "the scene has no object 'flor' for shadows to fall on"),
        ("t.yaml", (), "no object of the scene is flat; planar shadows need a plane to fall on"),
    ):
        with pytest.raises(InputError, match=rf"RG209 node 'shadows' \(shadow_planar\): {text}"):
            rg.load("shadow-planar", scene=tmp_path / scene, sets=sets).check()


def test_several_layers_of_casters_darken_once(session: rg.Session, tmp_path: Path) -> None:
    """A darker pixel is the ambient light's, whether one caster lies above it or five."""
    extra = "\n".join(
        f"  c{k}: {{shape: box, size: [1, 0.05, 1], at: [0, {1.2 + 0.2 * k}, 0], material: grey}}" for k in range(5)
    )
    visibility, _ = drawn(session, tmp_path, extra=extra)
    assert set(np.unique(visibility)) == {0.0, 1.0}
