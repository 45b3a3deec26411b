"""Scenes and cameras as the arrays that the process with Mitsuba reads; no Mitsuba is needed."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from rendergraph.pipelines.references.mitsuba.convert import camera_values, scene_values

from rendergraph.scene.cameras import view_matrices
from rendergraph.scene.load import load
from rendergraph.scene.model import Camera, Scene

SCENE = """scene: 1
objects:
  box: {shape: box, at: [1, 2, 3], rotate_degrees: [10, 20, 30], scale: [1, 2, 0.5], material: paint}
  mirrored: {shape: sphere, at: [-4, 0, 0], scale: [-1, 3, 1], material: paint}
  lamp: {shape: plane, at: [0, 5, 0], material: lamp}
  unlit: {shape: box, at: [9, 0, 0], material: flat}
  hidden: {shape: box, hidden: true}
materials:
  paint: {base_color: [0.5, 0.4, 0.3]}
  lamp: {emissive: [1, 2, 3]}
  flat: {base_color: [0.1, 0.2, 0.3], unlit: true}
"""


def no_images(*_: object) -> npt.NDArray[Any]:
    raise AssertionError("the scene has no images")


@pytest.fixture
def scene(tmp_path: Path) -> Scene:
    (tmp_path / "scene.yaml").write_text(SCENE)
    return load(tmp_path / "scene.yaml")


def test_triangles_keep_their_place_and_their_front(scene: Scene) -> None:
    """Also of mirrored objects: normals point to the side where the corners run counter-clockwise, away from inside."""
    values, arrays = scene_values(scene, no_images)
    position, normal = (arrays[f"vertex.{name}"][:, :3].astype(np.float64) for name in ("position", "normal"))
    corners = position[arrays["corners"]]
    front = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert ((front[:, None] * normal[arrays["corners"]]).sum(axis=-1) > 0).all()
    np.testing.assert_allclose(np.linalg.norm(normal, axis=1), 1, atol=1e-6)
    low, high = np.asarray(scene.bounds)
    np.testing.assert_allclose([position.min(axis=0), position.max(axis=0)], [low, high], atol=1.0)
    ball = (position[:, 0] < -2.5) & (position[:, 0] > -6)
    away = (position[ball] - [-4, 0, 0]) / [1, 3, 1] ** np.array(2)  # the gradient of an ellipsoid
    away /= np.linalg.norm(away, axis=1, keepdims=True)
    np.testing.assert_allclose((away * normal[ball]).sum(axis=1), 1, atol=1e-5)
    assert sum(mesh["size"][1] for mesh in values["meshes"]) == len(arrays["corners"])


def test_each_emissive_material_is_a_mesh(scene: Scene) -> None:
    values, arrays = scene_values(scene, no_images)
    names = [scene.materials[mesh["material"]].name if mesh["material"] >= 0 else "" for mesh in values["meshes"]]
    assert names == ["", "lamp", "flat"]
    for mesh in values["meshes"]:
        first, count = mesh["first"][1], mesh["size"][1]
        if mesh["material"] >= 0:
            assert (arrays["flags"][first : first + count, 0] == mesh["material"]).all()
    flat = next(number for number, material in enumerate(scene.materials) if material.unlit)
    np.testing.assert_allclose(arrays["material.emissive"][flat, :3], [0.1, 0.2, 0.3])
    assert not arrays["material.base_color"][flat, :3].any()


@pytest.mark.parametrize(
    "lens",
    [
        {"fov_y": 0.8, "near": 0.1, "far": 50.0},
        {"fov_y": 0.8, "near": 0.1, "far": float("inf")},
        {"type": "orthographic", "height": 3.0, "near": 0.1, "far": 50.0},
        {"type": "frustum", "frustum": (-0.02, 0.05, -0.01, 0.04), "near": 0.1, "far": 50.0},
    ],
    ids=["perspective", "infinite", "orthographic", "off-centre"],
)
def test_camera_rays_pass_through_the_pixels(lens: dict[str, Any]) -> None:
    """Points along them project to where they begin in the picture, and the near plane is where they begin."""
    rng = np.random.default_rng(1)
    rotation, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    transform = np.eye(4)
    transform[:3, :3], transform[:3, 3] = rotation * np.linalg.det(rotation), [1, 2, 3]
    view = view_matrices(Camera("main", transform, **lens), (32, 18))
    values = camera_values(view)
    x, y = rng.random((2, 20, 1))
    origin, direction = (
        np.asarray(rows[0]) + x * rows[1] + y * rows[2] for rows in (values["origin"], values["direction"])
    )
    for distance in (lens["near"], 7.0):
        points = np.column_stack([origin + direction * distance, np.ones(20)])
        clip = points @ (view.projection @ view.view).T
        np.testing.assert_allclose(clip[:, 0] / clip[:, 3], 2 * x[:, 0] - 1, atol=1e-9)
        np.testing.assert_allclose(clip[:, 1] / clip[:, 3], 1 - 2 * y[:, 0], atol=1e-9)
        assert distance > lens["near"] or np.allclose(clip[:, 2] / clip[:, 3], -1, atol=1e-5)
