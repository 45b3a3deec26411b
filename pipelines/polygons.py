"""Polygons cut into triangles, for shapes and for readers."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from rendergraph.scene.geometry import Doubles

Ints = npt.NDArray[np.int64]

MOST_CORNERS = 2000
"""Corners of a concave polygon that ear clipping takes on: its time grows with their square."""


def triangulate(positions: Doubles, corners: Ints, sizes: Ints) -> tuple[Ints, Ints]:
    """Triangles of polygons, without new vertices and with the polygons' winding.

    Args:
        positions: (n, 3).
        corners: vertex of each corner, one polygon after the other.
        sizes: corners of each polygon, at least 3.

    Returns:
        (m, 3) indices into `corners`, and (m,) the polygon of each triangle.

    Raises:
        ValueError: a concave polygon has more than `MOST_CORNERS` corners; the argument is its number.
    """
    starts = np.cumsum(sizes) - sizes
    tables, owners = [], []
    for size in np.unique(sizes):
        faces = np.flatnonzero(sizes == size)
        places = starts[faces, None] + np.arange(size)
        if size > 3:
            concave = ~_convex(positions[corners[places]])
            for face in faces[concave]:
                if size > MOST_CORNERS:
                    raise ValueError(int(face))
                table = clip_ears(positions[corners[starts[face] : starts[face] + size]]) + starts[face]
                tables.append(table)
                owners.append(np.full(len(table), face))
            faces, places = faces[~concave], places[~concave]
        fan = np.stack([np.broadcast_to(places[:, :1], (len(faces), size - 2)), places[:, 1:-1], places[:, 2:]], axis=2)
        tables.append(fan.reshape(-1, 3))
        owners.append(np.repeat(faces, size - 2))
    table, owner = np.concatenate(tables), np.concatenate(owners)
    order = np.argsort(owner, kind="stable")
    return table[order], owner[order]


def newell(points: Doubles) -> Doubles:
    """Normals of polygons by Newell's sum, twice their area long; points (..., n, 3)."""
    ahead = np.roll(points, -1, axis=-2)
    total: Doubles = np.cross(points, ahead).sum(axis=-2)
    return total


def _convex(points: Doubles) -> npt.NDArray[np.bool_]:
    """Which of the polygons (f, n, 3) can be cut as a fan from their first corner.

    Every triangle of the fan must face as the polygon does; that holds for convex polygons and for some concave ones.
    """
    local = points - points[:, :1]
    normal = newell(local)
    turns = np.einsum("fni,fi->fn", np.cross(local[:, 1:-1], local[:, 2:]), normal)
    return np.asarray((turns >= 0).all(axis=1))


def clip_ears(points: Doubles) -> Ints:
    """Triangles of one simple polygon (n, 3) by ear clipping, as corner numbers (n-2, 3).

    Polygons that cross themselves still get n-2 triangles: where no ear is found the least bad corner is cut off.
    """
    normal = newell(points - points[0])
    drop = int(np.abs(normal).argmax())
    keep = [axis for axis in range(3) if axis != drop]
    flat = points[:, keep] * ((1, -1) if (normal[drop] < 0) != (drop == 1) else (1, 1))
    ring = list(range(len(points)))
    triangles = []
    at = 0
    misses = 0
    while len(ring) > 3:
        count = len(ring)
        a, b, c = ring[at - 1], ring[at % count], ring[(at + 1) % count]
        if misses >= count or _is_ear(flat, ring, a, b, c):
            triangles.append((a, b, c))
            del ring[at % count]
            at = at % len(ring) if at < len(ring) else 0
            misses = 0
        else:
            at = (at + 1) % count
            misses += 1
    triangles.append((ring[0], ring[1], ring[2]))
    return np.array(triangles, np.int64)


def _is_ear(flat: Doubles, ring: list[int], a: int, b: int, c: int) -> bool:
    pa, pb, pc = flat[a], flat[b], flat[c]
    if _cross(pb - pa, pc - pa) <= 0:
        return False
    others = flat[[v for v in ring if v not in (a, b, c)]]
    others = others[(others != pa).any(axis=1) & (others != pb).any(axis=1) & (others != pc).any(axis=1)]
    inside = (
        (_cross(pb - pa, others - pa) >= 0) & (_cross(pc - pb, others - pb) >= 0) & (_cross(pa - pc, others - pc) >= 0)
    )
    return not bool(inside.any())


def _cross(u: Doubles, v: Doubles) -> Doubles:
    result: Doubles = u[..., 0] * v[..., 1] - u[..., 1] * v[..., 0]
    return result
