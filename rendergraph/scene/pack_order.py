"""Triangles in an order that a vertex cache likes, vertices in the order of first use.

Vertices are ranked by connected part and then along a Morton curve; triangles follow by their lowest-ranked vertex, so
that neighbours on the surface are neighbours in the list. It is a few vectorised sorts, where the usual greedy
optimisers walk triangle by triangle. A list that is already better stays as it is.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from rendergraph.scene.model import Floats, extremes

Indices = npt.NDArray[np.uint32]
_BATCH = 32  # triangles whose vertices a GPU typically shades together
_SAMPLED = 4096  # batches that are enough to compare two orders


def ordered(positions: Floats, triangles: Indices) -> Indices:
    """The triangles, sorted where that lowers the number of vertices shaded."""
    if len(triangles) <= _BATCH:
        return triangles
    rank = np.empty(len(positions), np.min_scalar_type(len(positions)))  # 16 bits are sorted without comparing
    key = (parts(triangles, len(positions)).astype(np.uint64) << np.uint64(30)) | morton(positions)
    rank[np.argsort(key, kind="stable")] = np.arange(len(positions), dtype=rank.dtype)
    lowest = np.minimum(np.minimum(rank[triangles[:, 0]], rank[triangles[:, 1]]), rank[triangles[:, 2]])
    sorted_ = triangles[np.argsort(lowest, kind="stable")]
    return sorted_ if batch_acmr(sorted_) < batch_acmr(triangles) else triangles


def first_use(triangles: Indices, count: int) -> tuple[npt.NDArray[np.int64], Indices]:
    """Renumber vertices in the order of first use, without unused ones: their old numbers, and the new triangles."""
    corners = triangles.reshape(-1)
    first = np.full(count, -1, np.int64)
    first[corners[::-1]] = np.arange(len(corners) - 1, -1, -1)  # of equal targets the last assignment stays
    used = np.flatnonzero(first >= 0)
    old = used[np.argsort(first[used])]
    new = np.empty(count, np.uint32)
    new[old] = np.arange(len(old), dtype=np.uint32)
    return old, new[triangles]


def batch_acmr(triangles: Indices) -> float:
    """Distinct vertices for each triangle, in batches of 32: what a GPU that shades in batches transforms.

    0.5 is the least for large closed meshes, 3 the most. Long lists are sampled evenly.
    """
    batches = len(triangles) // _BATCH
    if not batches:
        return len(np.unique(triangles)) / max(1, len(triangles))
    table = triangles[: batches * _BATCH].reshape(batches, -1)[:: max(1, batches // _SAMPLED)]
    table = np.sort(table, axis=1)
    return float(1 + (np.diff(table, axis=1) != 0).sum(axis=1).mean()) / _BATCH


def morton(points: Floats) -> npt.NDArray[np.uint64]:
    """30-bit Morton code of each point within the box of all."""
    low, high = extremes(points)
    with np.errstate(over="ignore"):
        extent = max(float((high - low).max()), 1e-30)
    if not np.isfinite(extent):  # a box beyond single precision has no curve
        return np.zeros(len(points), np.uint64)
    code = np.zeros(len(points), np.uint32)
    for axis in range(3):
        bits = ((points[:, axis] - low[axis]) * np.float32(1023 / extent)).astype(np.uint32)
        for shift, mask in ((16, 0x030000FF), (8, 0x0300F00F), (4, 0x030C30C3), (2, 0x09249249)):
            bits = (bits | (bits << np.uint32(shift))) & np.uint32(mask)
        code |= bits << np.uint32(axis)
    return code.astype(np.uint64)


def parts(triangles: Indices, count: int) -> npt.NDArray[np.int64]:
    """A number for each vertex, the same for all that triangles connect.

    Roots hook on to a lower neighbouring root and trees are flattened by pointer jumping, until no edge joins two.
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
