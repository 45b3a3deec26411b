"""Order triangles for the vertex cache, and vertices by first use.

Vertices are ranked by connected component and then along a Morton curve; triangles are sorted by their lowest-ranked
vertex, so that neighbours on the surface are neighbours in the list. This takes a few vectorised sorts, where the usual
greedy optimisers process one triangle at a time. A list that is already better stays unchanged.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from rendergraph.scene.model import Floats, extremes

Indices = npt.NDArray[np.uint32]
_BATCH = 32  # triangles whose vertices a GPU typically shades together
_SAMPLED = 4096  # number of batches that suffices to compare two orders


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


def first_use(triangles: Indices, count: int) -> tuple[npt.NDArray[np.int64], Indices]:
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


def parts(triangles: Indices, count: int) -> npt.NDArray[np.int64]:
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
