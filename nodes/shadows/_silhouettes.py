"""Silhouettes of meshes seen from lights, on the CPU. A mesh's edges are found once and classified in every frame."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
import numpy.typing as npt

Points = npt.NDArray[np.float64]

_plane_cache: WeakKeyDictionary[Any, Points] = WeakKeyDictionary()


@dataclass(frozen=True)
class Silhouette:
    """The silhouette edges and lit faces of one object in world space, from which its shadow volume is extruded.

    Attributes:
        sides: ends of each edge between a lit and an unlit face, shape (s, 2, 3), ordered so that the triangle strip
            (first, its extrusion, second, its extrusion) faces outwards.
        lit: corners of the faces that face the light, counter-clockwise from outside, shape (t, 3, 3).
    """

    sides: Points
    lit: Points


def silhouette(mesh: Any, transform: Points, light: Points, pose: Any = None) -> Silhouette:
    """Return the silhouette of a closed mesh.

    Args:
        mesh: a mesh with `positions` and `edges`.
        transform: object-to-world matrix, shape (4, 4).
        light: homogeneous world-space position of the light, (x, y, z, 1), or (x, y, z, 0) towards it.
        pose: pose of an animated mesh; its edges are those of the bind pose, in which coincident vertices are merged.
    """
    edges, positions = mesh.edges, (mesh.positions if pose is None else pose.vertices()["positions"]).astype(np.float64)
    facing = (planes(mesh) if pose is None else _planes(positions, edges.triangles)) @ (
        np.linalg.inv(transform) @ light
    ) > 0
    first, second = facing[edges.sides].T
    split = first != second
    ends = np.where(first[split, None], edges.ends[split, ::-1], edges.ends[split])
    lit = edges.triangles[facing]
    if np.linalg.det(transform[:3, :3]) < 0:  # mirroring reverses the winding order
        ends, lit = ends[:, ::-1], lit[:, ::-1]
    points = positions @ transform[:3, :3].T + transform[:3, 3]
    return Silhouette(points[ends], points[lit])


def planes(mesh: Any) -> Points:
    """Return the planes of a closed mesh's triangles, shape (t, 4), positive in front; cached per mesh."""
    if mesh not in _plane_cache:
        _plane_cache[mesh] = _planes(mesh.positions.astype(np.float64), mesh.edges.triangles)
    return _plane_cache[mesh]


def _planes(positions: Points, triangles: npt.NDArray[np.integer]) -> Points:
    a, b, c = np.moveaxis(positions[triangles], 1, 0)
    normals = np.cross(b - a, c - a)
    return np.column_stack([normals, -np.einsum("ij,ij->i", normals, a)])
