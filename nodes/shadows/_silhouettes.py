"""Silhouettes of meshes against lights, on the CPU: edges are found once a mesh, and looked at in every frame."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
import numpy.typing as npt

Points = npt.NDArray[np.float64]

_planes_of: WeakKeyDictionary[Any, Points] = WeakKeyDictionary()


@dataclass(frozen=True)
class Silhouette:
    """What a shadow volume of one object stands on, in world space.

    Attributes:
        sides: (s, 2, 3), the ends of each edge between a face that the light meets and one that it does not: the
            volume's side, as its outside sees it, has them, the first far away and the second far away in a Z.
        lit: (t, 3, 3), the corners of the faces that the light meets, counter-clockwise from outside.
    """

    sides: Points
    lit: Points


def silhouette(mesh: Any, transform: Points, light: Points) -> Silhouette:
    """The silhouette of a closed mesh.

    Args:
        mesh: with `positions` and `edges`.
        transform: object to world, (4, 4).
        light: its place in the world, homogeneous: (x, y, z, 1), or (x, y, z, 0) towards it.
    """
    edges = mesh.edges
    facing = planes(mesh) @ (np.linalg.inv(transform) @ light) > 0
    first, second = facing[edges.sides].T
    split = first != second
    ends = np.where(first[split, None], edges.ends[split, ::-1], edges.ends[split])
    lit = edges.triangles[facing]
    if np.linalg.det(transform[:3, :3]) < 0:  # what runs one way round runs the other way in a mirror
        ends, lit = ends[:, ::-1], lit[:, ::-1]
    points = mesh.positions.astype(np.float64) @ transform[:3, :3].T + transform[:3, 3]
    return Silhouette(points[ends], points[lit])


def planes(mesh: Any) -> Points:
    """The planes of a closed mesh's triangles, shape (t, 4): above 0 in front; found once."""
    if mesh not in _planes_of:
        a, b, c = np.moveaxis(mesh.positions.astype(np.float64)[mesh.edges.triangles], 1, 0)
        normals = np.cross(b - a, c - a)
        _planes_of[mesh] = np.column_stack([normals, -np.einsum("ij,ij->i", normals, a)])
    return _planes_of[mesh]
