"""Cameras as matrices in float64, and a camera that frames a scene without one as closely as possible."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from rendergraph import projection
from rendergraph.scene.geometry import euler_matrix, vec3
from rendergraph.scene.model import Camera, Matrix, Scene, Vec3
from rendergraph.steps import ViewMatrices

if TYPE_CHECKING:
    from rendergraph.scene.rig import Pose

_AXES = projection.look_at((1.0, 0.6, 1.5), (0.0, 0.0, 0.0))[:3, :3].T
"""Axes of the camera that frames a scene, as rows: right, up, towards the viewer."""
FRAMING_FOV = math.radians(45.0)
WIDE = 16 / 9
MOST_POINTS = 1 << 24
"""Number of placed vertices above which the boxes of their meshes are measured instead."""
_MARGIN = 0.94
"""The fraction of the picture that the framed scene fills in its larger direction."""
_BLOCK = 1 << 16


def view_matrices(camera: Camera, size: tuple[int, int]) -> ViewMatrices:
    """Return the view of a camera at a size in texels; an off-centre `frustum` keeps its own aspect."""
    width, height = size
    view = projection.inverse_rigid(camera.transform)
    return ViewMatrices(view, projection_matrix(camera, width / height), size, camera.near, camera.far)


def projection_matrix(camera: Camera, aspect: float) -> Matrix:
    """Return the matrix (4, 4) from view space to OpenGL clip space (z in -w…w); aspect is width over height."""
    near, far = camera.near, camera.far
    if camera.type == "orthographic":
        top = camera.height / 2
        return projection.orthographic(-top * aspect, top * aspect, -top, top, near, far)
    if camera.type == "frustum" and camera.frustum is not None:
        return projection.frustum(*camera.frustum, near, far)
    return projection.perspective(camera.fov_y, aspect, near, far)


def bounding_sphere(scene: Scene) -> tuple[Vec3, float]:
    low, high = (np.array(corner) for corner in scene.bounds)
    return vec3((low + high) / 2), max(float(np.linalg.norm(high - low)) / 2, 1e-6)


def framing_camera(
    scene: Scene, aspect: float = WIDE, most_points: int = MOST_POINTS, *, around: bool = False
) -> Camera:
    """Return a camera that frames everything drawn, as closely as possible, from direction (1, 0.6, 1.5) with 45° fov.

    It need not look at the centre of the scene if another position is closer. One number determines each side of the
    view: the largest extent of any point towards the side's plane.

    Args:
        aspect: width over height of the picture.
        most_points: number of placed vertices above which the boxes of their meshes are framed.
        around: look at the centre, from a distance at which everything stays in the picture during a full turn.
    """
    center, radius = bounding_sphere(scene)
    tall = math.tan(FRAMING_FOV / 2) * _MARGIN
    wide = tall * aspect
    # Outward normals of the view's four sides, then the direction to the viewer, from camera axes to world axes.
    sides = np.array([[1, 0, wide], [-1, 0, wide], [0, 1, tall], [0, -1, tall], [0, 0, 1]]) @ _AXES
    turns = np.eye(3)[None]
    if around:
        turns = euler_matrix([(0, degrees, 0) for degrees in range(0, 360, 15)])
    reaches = _reaches(scene, (sides @ turns).reshape(-1, 3), np.array(center), most_points).reshape(-1, 5)
    right, left, top, bottom, front = reaches.max(axis=0).tolist()
    if around:
        right, top = left, bottom = max(right, left), max(top, bottom)
    away = max((right + left) / (2 * wide), (top + bottom) / (2 * tall))
    nearest = max(away - front, 1e-3 * radius)  # depth of the nearest point
    away = front + nearest
    transform = np.eye(4)
    transform[:3, :3] = _AXES.T
    transform[:3, 3] = eye = np.array([(right - left) / 2, (top - bottom) / 2, away]) @ _AXES + center
    target = vec3(eye - _AXES[2] * away)
    near = min(0.1 * radius, 0.5 * nearest)
    return Camera("default", transform, fov_y=FRAMING_FOV, near=near, far=20 * radius, target=target)


def lowest_point(scene: Scene) -> float:
    """Return the minimum y of everything drawn, in metres."""
    return -float(_reaches(scene, np.array([(0.0, -1.0, 0.0)]), np.zeros(3), MOST_POINTS)[0])


def _reaches(
    scene: Scene, directions: npt.NDArray[np.float64], center: npt.NDArray[np.float64], most_points: int
) -> npt.NDArray[np.float64]:
    """Return the largest extent of everything drawn along directions (n, 3), from a centre."""
    shown = [entry for entry in scene.objects if not entry.hidden]
    most = np.full(len(directions), -np.inf if shown else 0.5)
    by_mesh: dict[tuple[int, Pose | None], list[npt.NDArray[np.float64]]] = {}
    for entry in shown:
        by_mesh.setdefault((entry.mesh, entry.pose), []).append(entry.transform)
    many = sum(len(scene.meshes[mesh].positions) * len(placed) for (mesh, _), placed in by_mesh.items()) > most_points
    for (mesh, pose), placed in by_mesh.items():
        points = np.asarray(scene.meshes[mesh].positions if pose is None else pose.vertices()["positions"], np.float64)
        if many:
            low, high = (corner.astype(np.float64) for corner in (pose or scene.meshes[mesh]).box)
            corners = np.array(np.meshgrid(*np.stack([low, high], axis=1), indexing="ij"))
            points = corners.reshape(3, -1).T
        transforms = np.array(placed)
        turned = np.einsum("di,nij->ndj", directions, transforms[:, :3, :3])
        moved = (transforms[:, :3, 3] - center) @ directions.T
        step = max(1, _BLOCK // len(points))
        for first in range(0, len(placed), step):
            some = turned[first : first + step]
            reach = np.full(some.shape[:2], -np.inf)
            for start in range(0, len(points), _BLOCK):
                np.maximum(reach, (some @ points[start : start + _BLOCK].T).max(axis=-1), out=reach)
            np.maximum(most, (reach + moved[first : first + step]).max(axis=0), out=most)
    return most
