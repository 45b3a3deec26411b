"""Meshes of shapes: smooth sides, joined ones, surfaces of revolution, and texture coordinates in metres."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
from msgspec.structs import replace

from rendergraph.projection import unit
from rendergraph.scene.model import Mesh


def in_metres(found: Mesh) -> Mesh:
    """A mesh whose texture coordinates are lengths on its surface, on average over each smooth side of it.

    Around a closed side they are rounded to whole metres, so that a texture whose tile divides a metre has no seam.
    """
    assert found.uv0 is not None  # shapes have them
    side = np.arange(len(found.positions))  # the least vertex of the same side
    while True:
        least = side[found.indices].min(axis=1)
        before = side.copy()
        np.minimum.at(side, found.indices, least[:, None])
        side = side[side]
        if (side == before).all():
            break
    uv = found.uv0.astype(np.float64)
    for first in np.unique(side):
        mine = side == first
        corners = found.indices[mine[found.indices[:, 0]]]
        edges = found.positions[corners[:, 1:]].astype(np.float64) - found.positions[corners[:, :1]]
        steps = uv[corners[:, 1:]] - uv[corners[:, :1]]
        area = np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1)
        inverse = np.linalg.pinv(steps)  # (n, 2, 2): edges = steps @ derivatives
        lengths = np.linalg.norm(inverse @ edges, axis=-1)  # along u and along v
        for axis in (0, 1):
            length = float((area * lengths[:, axis]).sum() / max(area.sum(), 1e-30))
            low, high = (found.positions[mine & (found.uv0[:, axis] == end)] for end in _ends(found.uv0[mine, axis]))
            if len(low) == len(high) > 1 and (np.ptp(low, axis=0) > 0).any() and (low == high).all():
                around = length * float(np.ptp(found.uv0[mine, axis]))
                length *= max(1.0, round(around)) / around
            uv[mine, axis] *= length
    return replace(found, uv0=uv.astype(np.float32))


def _ends(values: npt.NDArray[Any]) -> tuple[Any, Any]:
    return values.min(), values.max()


def side_mesh(
    name: str,
    positions: npt.ArrayLike,
    triangles: npt.ArrayLike,
    normals: npt.ArrayLike,
    uv: npt.ArrayLike,
    along: npt.ArrayLike,
) -> Mesh:
    """A mesh from arrays whose last axis is the vector; one normal or direction of growing u may serve all vertices."""
    points = np.asarray(positions, np.float32).reshape(-1, 3) + np.float32(0)  # no -0: equal positions have equal bits
    shape = points.shape
    tangents = np.ones((len(points), 4), np.float32)
    tangents[:, :3] = np.broadcast_to(unit(along), shape) if np.ndim(along) == 1 else unit(along).reshape(shape)
    each = np.asarray(normals, np.float32)
    each = np.ascontiguousarray(np.broadcast_to(each, shape) if each.ndim == 1 else each.reshape(shape))
    indices = np.asarray(triangles, np.uint32).reshape(-1, 3)
    return Mesh(name, points, indices, each, tangents, np.asarray(uv, np.float32).reshape(-1, 2))


def joined(name: str, meshes: Sequence[Mesh]) -> Mesh:
    starts = np.cumsum([0, *(len(part.positions) for part in meshes)])
    columns = [
        np.concatenate([getattr(part, field) for part in meshes])
        for field in ("positions", "normals", "tangents", "uv0")
    ]
    indices = np.concatenate([part.indices + np.uint32(start) for part, start in zip(meshes, starts, strict=False)])
    return Mesh(name, columns[0], indices, columns[1], columns[2], columns[3])


def grid(columns: int, rows: int, degenerate: tuple[bool, bool] = (False, False)) -> npt.NDArray[np.int64]:
    """Triangles of a grid of (rows+1)×(columns+1) vertices; a degenerate first or last row is a pole."""
    i, j = np.meshgrid(np.arange(columns), np.arange(rows))
    a = j * (columns + 1) + i
    b, c, d = a + columns + 1, a + columns + 2, a + 1
    lower, upper = np.stack([a, b, c], axis=-1), np.stack([a, c, d], axis=-1)
    if degenerate[1]:
        lower = lower[:-1]
        upper[-1, :, 1] = b[-1]
    if degenerate[0]:
        upper = upper[1:]
    return np.concatenate([lower.reshape(-1, 3), upper.reshape(-1, 3)])


def lathe(name: str, profile: Sequence[tuple[float, float, float, float]], segments: int) -> Mesh:
    """A profile of (radius, height, normal's radial part, normal's height) from top to bottom, turned about Y."""
    r, y, nr, ny = np.array(profile, np.float64).T
    rows = len(r) - 1
    i = np.arange(segments + 1)
    phi = 2 * np.pi * (i % segments) / segments  # the seam repeats the first column's bits
    sin, cos = np.sin(phi), np.cos(phi)
    positions = np.stack([np.outer(r, sin), np.repeat(y[:, None], segments + 1, 1), np.outer(r, cos)], axis=-1)
    normals = np.stack([np.outer(nr, sin), np.repeat(ny[:, None], segments + 1, 1), np.outer(nr, cos)], axis=-1)
    u = np.repeat((i / segments)[None], rows + 1, 0)
    turn = np.repeat(phi[None], rows + 1, 0)
    poles = r == 0
    u[poles] += 0.5 / segments  # a pole's vertex belongs to one triangle: it takes the middle of its side
    turn[poles] += np.pi / segments
    uv = np.stack([u, np.repeat(np.linspace(0, 1, rows + 1)[:, None], segments + 1, 1)], axis=-1)
    along = np.stack([np.cos(turn), np.zeros_like(turn), -np.sin(turn)], axis=-1)
    return side_mesh(name, positions, grid(segments, rows, (bool(poles[0]), bool(poles[-1]))), unit(normals), uv, along)


def cap(radius: float, height: float, up: bool, segments: int) -> Mesh:
    """A disc of one fan, its texture as seen from outside."""
    phi = 2 * np.pi * np.arange(segments) / segments
    x, z = radius * np.sin(phi), radius * np.cos(phi)
    positions = np.concatenate([[[0, height, 0]], np.stack([x, np.full(segments, height), z], axis=1)])
    sign = 1.0 if up else -1.0
    uv = 0.5 + 0.5 * positions[:, [0, 2]] / radius * (1, sign)
    ring = np.arange(segments) + 1
    ahead = np.roll(ring, -1)
    center = np.zeros(segments, np.int64)
    triangles = np.stack([center, ring, ahead] if up else [center, ahead, ring], axis=1)
    return side_mesh("cap", positions, triangles, (0, sign, 0), uv, (1, 0, 0))
