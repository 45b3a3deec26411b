"""Edge adjacency of a mesh, computed once per mesh, for silhouettes and shadow volumes."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
import numpy.typing as npt
from msgspec import Struct

Floats: TypeAlias = npt.NDArray[np.float32]
Indices: TypeAlias = npt.NDArray[np.int64]


class Edges(Struct, frozen=True, eq=False):
    """The edges of a closed mesh: t triangles, e edges. Vertices with equal positions count as one.

    Attributes:
        triangles: int64 (t, 3), vertices of the triangles, without those that have two equal corners.
        beyond: int64 (t, 3), for each corner the vertex across the edge to the next corner.
        ends: int64 (e, 2), vertices of each edge, in the direction of its first triangle.
        sides: int64 (e, 2), the two triangles of each edge.
        gap: a description of where the mesh is not closed, with empty arrays; empty if it is closed.
    """

    triangles: Indices
    beyond: Indices
    ends: Indices
    sides: Indices
    gap: str = ""


def is_solid(positions: Floats, triangles: npt.NDArray[np.integer]) -> bool:
    """Return whether a mesh is closed and encloses a volume, so that its front faces hide its back faces from outside.

    It is closed if triangles use each edge equally often in both directions. With a random number for each position,
    the sum of u v (u - v) over all edges from u to v is then 0, and otherwise almost never: with 64 random bits, a
    single missing triangle gives 0 once in 2⁴¹. Over the edges of one triangle it is (a - b) (b - c) (a - c).
    """
    first, second, third = triangles.T
    x, y, z = (positions + np.float32(0)).view(np.uint32).astype(np.uint64).T  # -0 is 0
    place = _mixed(_mixed(_mixed(x + np.uint64(1)) + y) + z)
    a, b, c = place[first], place[second], place[third]
    if ((a - b) * (b - c) * (a - c)).sum(dtype=np.uint64) != 0:
        return False
    x, y, z = positions.astype(np.float64).T
    around_x = y[second] * z[third] - z[second] * y[third]  # the cross product of two corners
    around_y = z[second] * x[third] - x[second] * z[third]
    around_z = x[second] * y[third] - y[second] * x[third]
    return float((x[first] * around_x + y[first] * around_y + z[first] * around_z).sum()) > 0  # six times the volume


def _mixed(values: npt.NDArray[np.uint64]) -> npt.NDArray[np.uint64]:
    """Return hashes with bits that depend on all input bits (Stafford, variant 13 of MurmurHash3's finaliser, 2011)."""
    values = (values ^ (values >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    values = (values ^ (values >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return values ^ (values >> np.uint64(31))


def find_edges(positions: Floats, triangles: npt.NDArray[np.integer]) -> Edges:
    """Return the edges of a mesh; in a closed mesh, two triangles use each edge, in opposite directions."""
    place, count = _places(positions)
    corners = triangles.astype(np.int64)
    at = place[corners]
    corners = corners[(at[:, 0] != at[:, 1]) & (at[:, 1] != at[:, 2]) & (at[:, 2] != at[:, 0])]
    if not len(corners):
        return _open("no triangle has an area")
    start, stop = corners.reshape(-1), np.roll(corners, -1, axis=1).reshape(-1)  # half-edge 3 t + k of triangle t
    forth, back = place[start] * count + place[stop], place[stop] * count + place[start]
    order = np.argsort(forth, kind="stable")
    ranked = forth[order]
    found = np.minimum(np.searchsorted(ranked, back), len(ranked) - 1)
    twice = np.zeros(len(order), bool)
    twice[order[1:]] = ranked[1:] == ranked[:-1]
    torn = np.flatnonzero(twice | (ranked[found] != back))
    if len(torn):
        first = int(torn[0])
        a, b = ("({:g}, {:g}, {:g})".format(*positions[vertex].tolist()) for vertex in (start[first], stop[first]))
        forth_and_back = int((forth == forth[first]).sum()), int((forth == back[first]).sum())
        meet = {(1, 0): "only one triangle has", (2, 0): "two triangles turn the same way round at"}.get(
            forth_and_back, f"{sum(forth_and_back)} triangles share"
        )
        return _open(f"{meet} the edge from {a} to {b}")
    twin = order[found]
    opposite = twin // 3 * 3 + (twin % 3 + 2) % 3  # the corner opposite the edge
    once = np.flatnonzero(np.arange(len(twin)) < twin)
    return Edges(
        corners,
        start[opposite].reshape(-1, 3),
        np.stack([start[once], stop[once]], axis=1),
        np.stack([once // 3, twin[once] // 3], axis=1),
    )


def _open(gap: str) -> Edges:
    none = np.zeros((0, 3), np.int64)
    return Edges(none, none, none[:, :2], none[:, :2], gap)


def _places(positions: Floats) -> tuple[Indices, int]:
    """Return a number for each vertex, equal for equal positions, and the count of distinct numbers."""
    x, y, z = np.ascontiguousarray(positions + np.float32(0.0)).view(np.uint32).T  # + 0 turns -0 into 0
    order = np.lexsort((x, y, z))
    x, y, z = x[order], y[order], z[order]
    new = np.ones(len(order), np.int64)
    new[1:] = (x[1:] != x[:-1]) | (y[1:] != y[:-1]) | (z[1:] != z[:-1])
    place = np.empty(len(order), np.int64)
    place[order] = np.cumsum(new) - 1
    return place, int(new.sum())
