"""Cameras as matrices, in float64, and what is known of lights before the schedule."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from rendergraph.declare import LightFacts
from rendergraph.scene.geometry import unit
from rendergraph.scene.model import Camera, Matrix, Scene
from rendergraph.steps import ViewMatrices

INFINITE_EPSILON = 2.4e-7
"""How far an infinite far plane stays inside the clip volume: two steps of a float32 at 1 (techniques.md §4)."""


def view_matrices(camera: Camera, size: tuple[int, int]) -> ViewMatrices:
    """The view of a camera drawn at a size in texels; the aspect is the size's.

    An off-centre `frustum` keeps its own left, right, bottom and top.
    """
    width, height = size
    return ViewMatrices(
        inverse_rigid(camera.transform), projection(camera, width / height), size, camera.near, camera.far
    )


def projection(camera: Camera, aspect: float) -> Matrix:
    """View space to OpenGL clip space (z in -w…w) as (4, 4).

    Args:
        camera: what is projected.
        aspect: width over height of the picture.
    """
    near, far = camera.near, camera.far
    if camera.type == "orthographic":
        half_height = camera.height / 2
        half_width = half_height * aspect
        return np.array(
            [
                [1 / half_width, 0, 0, 0],
                [0, 1 / half_height, 0, 0],
                [0, 0, -2 / (far - near), -(far + near) / (far - near)],
                [0, 0, 0, 1],
            ],
            np.float64,
        )
    if camera.type == "frustum" and camera.frustum is not None:
        left, right, bottom, top = camera.frustum
    else:
        top = near * math.tan(camera.fov_y / 2)
        right = top * aspect
        left, bottom = -right, -top
    if math.isinf(far):
        z, w = INFINITE_EPSILON - 1, near * (INFINITE_EPSILON - 2)
    else:
        z, w = -(far + near) / (far - near), -2 * far * near / (far - near)
    return np.array(
        [
            [2 * near / (right - left), 0, (right + left) / (right - left), 0],
            [0, 2 * near / (top - bottom), (top + bottom) / (top - bottom), 0],
            [0, 0, z, w],
            [0, 0, -1, 0],
        ],
        np.float64,
    )


def look_at(eye: npt.ArrayLike, target: npt.ArrayLike, up: npt.ArrayLike = (0.0, 1.0, 0.0)) -> Matrix:
    """Camera to world: at `eye`, looking down -Z at `target`.

    Where `up` is along the line of sight another axis takes its place, so a camera may look straight down.

    Raises:
        ValueError: eye and target coincide.
    """
    eye = np.asarray(eye, np.float64)
    back = unit(eye - np.asarray(target, np.float64))
    if not back.any():
        raise ValueError("eye and target coincide")
    for candidate in (unit(up), np.array([0.0, 0.0, -1.0]), np.array([1.0, 0.0, 0.0])):
        side = np.cross(candidate, back)
        if np.linalg.norm(side) > 1e-9:
            break
    side = unit(side)
    matrix = np.eye(4)
    matrix[:3, 0], matrix[:3, 1], matrix[:3, 2], matrix[:3, 3] = side, np.cross(back, side), back, eye
    return matrix


def inverse_rigid(transform: Matrix) -> Matrix:
    """The inverse of a rotation with a translation, exact where `np.linalg.inv` rounds."""
    rotation = transform[:3, :3].T
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = rotation, -rotation @ transform[:3, 3]
    return matrix


def light_facts(scene: Scene) -> tuple[LightFacts, ...]:
    """What is known of every light before the schedule, in the scene's order."""
    return tuple(LightFacts(light.name, light.type, light.casts_shadow) for light in scene.lights)
