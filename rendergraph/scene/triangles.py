"""The triangles of a mesh: their edges, for silhouettes and shadow volumes, and an order for the vertex cache.

The order ranks vertices by connected component and then along a Morton curve; triangles are sorted by their
lowest-ranked vertex, so that neighbours on the surface are neighbours in the list. This takes a few vectorised sorts,
where the usual greedy optimisers process one triangle at a time. A list that is already better stays unchanged.
"""

from __future__ import annotations

from typing import Any, TypeAlias, TypeVar

import numpy as np
import numpy.typing as npt
from msgspec import Struct

Floats: TypeAlias = npt.NDArray[np.float32]
Indices: TypeAlias = npt.NDArray[np.uint32]
Numbers: TypeAlias = npt.NDArray[np.int64]
T = TypeVar("T", bound=np.floating[Any])

_BATCH = 32  # triangles whose vertices a GPU typically shades together
_SAMPLED = 4096  # number of batches that suffices to compare two orders


def extremes(points: npt.NDArray[T]) -> tuple[npt.NDArray[T], npt.NDArray[T]]:
    """Return the minimum and maximum of each coordinate of points (n, 3), (3,) each."""
    columns = np.ascontiguousarray(points.T)  # along rows of three, NumPy takes thirty times as long
    return columns.min(axis=1), columns.max(axis=1)


class Edges(Struct, frozen=True, eq=False):
    """The edges of a closed mesh: t triangles, e edges. Vertices with equal positions count as one.

    Attributes:
        triangles: int64 (t, 3), vertices of the triangles, without those that have two equal corners.
        beyond: int64 (t, 3), for each corner the vertex across the edge to the next corner.
        ends: int64 (e, 2), vertices of each edge, in the direction of its first triangle.
        sides: int64 (e, 2), the two triangles of each edge.
        gap: a description of where the mesh is not closed, with empty arrays; empty if it is closed.
    """

    triangles: Numbers
    beyond: Numbers
    ends: Numbers
    sides: Numbers
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


def _places(positions: Floats) -> tuple[Numbers, int]:
    """Return a number for each vertex, equal for equal positions, and the count of distinct numbers."""
    x, y, z = np.ascontiguousarray(positions + np.float32(0.0)).view(np.uint32).T  # + 0 turns -0 into 0
    order = np.lexsort((x, y, z))
    x, y, z = x[order], y[order], z[order]
    new = np.ones(len(order), np.int64)
    new[1:] = (x[1:] != x[:-1]) | (y[1:] != y[:-1]) | (z[1:] != z[:-1])
    place = np.empty(len(order), np.int64)
    place[order] = np.cumsum(new) - 1
    return place, int(new.sum())


# Order for the vertex cache -------------------------------------------------------------------------------------------


def ordered(positions: Floats, triangles: Indices) -> Indices:
    """Return the triangles, sorted if that lowers the number of shaded vertices."""
    if len(triangles) <= _BATCH:
        return triangles
    rank = np.empty(len(positions), np.min_scalar_type(len(positions)))  # NumPy uses a radix sort for 16 bits
    key = (parts(triangles, len(positions)).astype(np.uint64) << np.uint64(30)) | morton(positions)
    rank[np.argsort(key, kind="stable")] = np.arange(len(positions), dtype=rank.dtype)
    lowest = np.minimum(np.minimum(rank[triangles[:, 0]], rank[triangles[:, 1]]), rank[triangles[:, 2]])
    sorted_ = triangles[np.argsort(lowest, kind="stable")]
    return sorted_ if batch_acmr(sorted_) < batch_acmr(triangles) else triangles


def first_use(triangles: Indices, count: int) -> tuple[Numbers, Indices]:
    """Renumber used vertices by first use; return their old numbers and the new triangles."""
    corners = triangles.reshape(-1)
    first = np.full(count, -1, np.int64)
    first[corners[::-1]] = np.arange(len(corners) - 1, -1, -1)  # the last assignment to an element wins
    used = np.flatnonzero(first >= 0)
    old = used[np.argsort(first[used])]
    new = np.empty(count, np.uint32)
    new[old] = np.arange(len(old), dtype=np.uint32)
    return old, new[triangles]


def batch_acmr(triangles: Indices) -> float:
    """Return the number of distinct vertices per triangle, in batches of 32, as a GPU that shades in batches needs.

    The minimum is 0.5 for large closed meshes, the maximum 3. Long lists are sampled evenly.
    """
    batches = len(triangles) // _BATCH
    if not batches:
        return len(np.unique(triangles)) / max(1, len(triangles))
    table = triangles[: batches * _BATCH].reshape(batches, -1)[:: max(1, batches // _SAMPLED)]
    table = np.sort(table, axis=1)
    return float(1 + (np.diff(table, axis=1) != 0).sum(axis=1).mean()) / _BATCH


def morton(points: Floats) -> npt.NDArray[np.uint64]:
    """Return the 30-bit Morton code of each point within the box of all points."""
    low, high = extremes(points)
    with np.errstate(over="ignore"):
        extent = max(float((high - low).max()), 1e-30)
    if not np.isfinite(extent):  # the box exceeds single precision
        return np.zeros(len(points), np.uint64)
    code = np.zeros(len(points), np.uint32)
    for axis in range(3):
        bits = ((points[:, axis] - low[axis]) * np.float32(1023 / extent)).astype(np.uint32)
        for shift, mask in ((16, 0x030000FF), (8, 0x0300F00F), (4, 0x030C30C3), (2, 0x09249249)):
            bits = (bits | (bits << np.uint32(shift))) & np.uint32(mask)
        code |= bits << np.uint32(axis)
    return code.astype(np.uint64)


def parts(triangles: Indices, count: int) -> Numbers:
    """Return a number for each vertex that is equal within a connected component.

    Roots hook onto a lower neighbouring root and trees are flattened by pointer jumping, until no edge joins two trees.
    """
    label = np.arange(count)
    a = np.concatenate([triangles[:, 0], triangles[:, 1]]).astype(np.int64)
    b = np.concatenate([triangles[:, 1], triangles[:, 2]]).astype(np.int64)
    while True:
        root_a, root_b = label[a], label[b]
        apart = root_a != root_b
        if not apart.any():
            return label
        a, b, root_a, root_b = a[apart], b[apart], root_a[apart], root_b[apart]
        label[np.maximum(root_a, root_b)] = np.minimum(root_a, root_b)
        while True:
            above = label[label]
            if (above == label).all():
                break
            label = above
