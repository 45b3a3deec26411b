"""Normals, triangles and affine matrices, for readers and shapes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from rendergraph.projection import unit
from rendergraph.scene.model import Floats, Matrix, Mesh, Vec3

Doubles = npt.NDArray[np.float64]
Indices = npt.NDArray[np.uint32]


def face_normals(positions: npt.ArrayLike, triangles: npt.NDArray[np.integer]) -> Doubles:
    """Return unit normals `(B-A)×(C-A)` of shape (m, 3); zero for triangles without area."""
    points = np.asarray(positions, np.float64)
    a, b, c = points[triangles[:, 0]], points[triangles[:, 1]], points[triangles[:, 2]]
    return unit(np.cross(b - a, c - a))


def mean_normals(
    normals: Doubles, corners: npt.NDArray[np.integer], faces: npt.NDArray[np.integer], count: int
) -> Doubles:
    """Return unit means of the adjacent face normals (f, 3), `N = Σ Ni / n`, not weighted by area (techniques.md §1).

    `corners` and `faces`, (k,), are vertex and face of each corner; there are `count` vertices.
    """
    total = np.stack([np.bincount(corners, weights=normals[faces, axis], minlength=count) for axis in range(3)], axis=1)
    return unit(total)


def filled_normals(positions: Floats, triangles: Indices, normals: Doubles) -> tuple[Floats, int]:
    """Return unit normals, with zero ones replaced by the mean over adjacent faces, and the number replaced."""
    result = unit(normals)
    zero = ~result.any(axis=1)
    missing = int(zero.sum())
    if missing:
        faces = np.repeat(np.arange(len(triangles)), 3)
        mean = mean_normals(face_normals(positions, triangles), triangles.reshape(-1), faces, len(positions))
        mean[~mean.any(axis=1)] = (0.0, 0.0, 1.0)
        result[zero] = mean[zero]
    return result.astype(np.float32), missing


def flat(mesh: Mesh) -> Mesh:
    """Return the same triangles with a separate vertex for each corner and the face's normal, without tangents."""
    corners = mesh.indices.reshape(-1)
    normals = face_normals(mesh.positions, mesh.indices)
    normals[~normals.any(axis=1)] = (0.0, 0.0, 1.0)
    split = {name: None if (v := getattr(mesh, name)) is None else v[corners] for name in ("uv0", "uv1", "colors")}
    indices = np.arange(len(corners), dtype=np.uint32).reshape(-1, 3)
    return Mesh(mesh.name, mesh.positions[corners], indices, np.repeat(normals, 3, axis=0).astype(np.float32), **split)


def strip_triangles(indices: Indices) -> Indices:
    """Return the triangles of a strip, all with the same winding, without those that have no area."""
    a, b, c = indices[:-2], indices[1:-1], indices[2:]
    odd = (np.arange(len(a)) & 1).astype(bool)
    triangles = np.stack([a, np.where(odd, c, b), np.where(odd, b, c)], axis=1)
    return proper(triangles)


def fan_triangles(indices: Indices) -> Indices:
    first = np.broadcast_to(indices[:1], indices[1:-1].shape)
    return proper(np.stack([first, indices[1:-1], indices[2:]], axis=1))


def proper(triangles: Indices) -> Indices:
    a, b, c = triangles[:, 0], triangles[:, 1], triangles[:, 2]
    keep = (a != b) & (b != c) & (c != a)
    return np.ascontiguousarray(triangles if keep.all() else triangles[keep], np.uint32)


def translation(at: npt.ArrayLike) -> Matrix:
    matrix = np.eye(4)
    matrix[:3, 3] = at
    return matrix


def euler_matrix(degrees: npt.ArrayLike) -> Matrix:
    """Return rotations about X, then Y, then Z (`Rz·Ry·Rx`): (3, 3) of three angles in degrees, (n, 3, 3) of (n, 3)."""
    angles = np.radians(np.asarray(degrees, np.float64).T)
    (cx, cy, cz), (sx, sy, sz) = np.cos(angles), np.sin(angles)
    rows = [
        [cz * cy, cz * sy * sx - sz * cx, cz * sy * cx + sz * sx],
        [sz * cy, sz * sy * sx + cz * cx, sz * sy * cx - cz * sx],
        [-sy, cy * sx, cy * cx],
    ]
    return np.moveaxis(np.array(rows), (0, 1), (-2, -1))


def placement(at: Sequence[float], rotation: Matrix, scale: Sequence[float]) -> Matrix:
    """Return the transform that scales, then rotates, then translates: `T·R·S` as (4, 4)."""
    matrix = translation(at)
    matrix[:3, :3] = rotation * np.asarray(scale, np.float64)
    return matrix


def rigid(matrix: Matrix) -> Matrix:
    """Return a transform without scale and shear, for cameras: -Z keeps its direction, and +Y if possible."""
    back = unit(matrix[:3, 2])
    side = unit(np.cross(matrix[:3, 1], back))
    if not back.any() or not side.any():
        return translation(matrix[:3, 3])
    result = np.eye(4)
    result[:3, 0], result[:3, 1], result[:3, 2], result[:3, 3] = side, np.cross(back, side), back, matrix[:3, 3]
    return result


def vec3(values: npt.ArrayLike) -> Vec3:
    x, y, z = (float(value) for value in np.asarray(values))
    return x, y, z
