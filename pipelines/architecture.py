"""Shapes of buildings and gardens: arches, groin vaults, columns with base and capital, and plants."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import TypeAlias

import numpy as np
import numpy.typing as npt
from rendergraph.pipelines.meshes import cap, grid, joined, lathe, side_mesh
from rendergraph.pipelines.polygons import clip_ears

from rendergraph.projection import unit
from rendergraph.scene.model import Mesh

Doubles: TypeAlias = npt.NDArray[np.float64]
Profile: TypeAlias = list[tuple[float, float, float, float]]


def arch(size: Sequence[float], span: float, spring: float, segments: int) -> Mesh:
    """A wall of `size` with an opening from its foot up: `span` wide, straight up to `spring`, and round above."""
    width, height, depth = size
    radius = min(span, 0.99 * width) / 2
    low = -height / 2
    center = low + max(0.0, min(spring, 0.99 * height - radius))
    angle = np.pi * np.arange(segments + 1) / segments
    turn = np.stack([radius * np.cos(angle), center + radius * np.sin(angle)], axis=1)
    into = -np.stack([np.cos(angle), np.sin(angle)], axis=1)
    if center > low:
        turn = np.concatenate([[[radius, low]], turn, [[-radius, low]]])
        into = np.concatenate([into[:1], into, into[-1:]])
    turn[0, 1] = turn[-1, 1] = low
    outer = np.array([[-width, -height], [-width, height], [width, height], [width, -height]]) / 2
    outline = np.concatenate([turn, outer])
    front = np.column_stack([outline, np.full(len(outline), depth / 2)])
    ears = clip_ears(front)
    uv = np.stack([outline[:, 0] / width + 0.5, 0.5 - outline[:, 1] / height], axis=1)
    parts = [_side(front * (1, 1, z), ears, (0, 0, z), uv) for z in (1, -1)]
    along = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(turn, axis=0), axis=1))])
    parts.append(_strip(turn, depth, into, along / along[-1]))
    for a, b in pairwise([turn[-1], *outer, turn[0]]):
        parts.append(_strip(np.stack([a, b]), depth, np.array([a[1] - b[1], b[0] - a[0]])[None], np.array([0.0, 1.0])))
    return joined("arch", parts)


def _strip(line: Doubles, depth: float, normals: Doubles, along: Doubles) -> Mesh:
    """A line in the XY plane drawn out along Z, with normals in the plane; `along` is v, or u where it is level."""
    points = np.stack([np.column_stack([line, np.full(len(line), z)]) for z in (-depth / 2, depth / 2)])
    flat = np.broadcast_to(np.column_stack([normals, np.zeros(len(normals))]), points.shape)
    v, u = np.meshgrid(along, (0.0, 1.0))
    level = len(line) == 2 and line[0, 1] == line[1, 1]
    uv = np.stack([v, u] if level else [u, v], axis=-1).reshape(-1, 2)
    return _side(points.reshape(-1, 3), grid(len(line) - 1, 1), flat.reshape(-1, 3), uv)


def _side(points: Doubles, triangles: npt.NDArray[np.int64], normals: npt.ArrayLike, uv: Doubles) -> Mesh:
    """A side from triangles of any winding, and coordinates that may be mirrored: normals say what is outside."""
    points = np.round(points, 7)
    a, b, c = (points[triangles[:, k]] for k in range(3))
    kept = np.linalg.norm(np.cross(b - a, c - a), axis=1) > 1e-9
    used, numbers = np.unique(triangles[kept], return_inverse=True)
    triangles, points, uv = numbers.reshape(-1, 3), points[used], np.array(uv[used])
    each = unit(np.asarray(normals, np.float64))
    each = each[used] if each.ndim == 2 else np.broadcast_to(each, points.shape)
    a, b, c = (points[triangles[:, k]] for k in range(3))
    facing = np.einsum("ni,ni->n", np.cross(b - a, c - a), each[triangles].sum(axis=1)) > 0
    triangles = np.where(facing[:, None], triangles, triangles[:, ::-1])
    edges = points[triangles[:, 1:]] - points[triangles[:, :1]]
    steps = uv[triangles[:, 1:]] - uv[triangles[:, :1]]
    areas = steps[:, 0, 0] * steps[:, 1, 1] - steps[:, 0, 1] * steps[:, 1, 0]
    if areas.sum() > 0:  # v runs downwards
        uv[:, 0], steps[..., 0], areas = 1 - uv[:, 0], -steps[..., 0], -areas
    tangents = np.zeros(points.shape)
    growing = (edges[:, 0] * steps[:, 1:, 1] - edges[:, 1] * steps[:, :1, 1]) * np.sign(areas)[:, None]
    np.add.at(tangents, triangles, growing[:, None])
    tangents -= (tangents * each).sum(axis=1, keepdims=True) * each
    return side_mesh("side", points, triangles, each, uv, unit(tangents))


def vault(size: Sequence[float], segments: int) -> Mesh:
    """A block of `size` whose underside is a groin vault: two barrels that cross, with groins along the diagonals."""
    width, height, depth = size
    half = np.array([width / 2, depth / 2])
    rise, low, top = 0.94 * height, -height / 2, height / 2
    reach = np.sin(np.pi / 2 * np.arange(segments + 1) / segments)  # equal steps along the arcs
    r, c = np.meshgrid(reach, np.concatenate([-reach[:0:-1], reach]), indexing="ij")
    q = np.clip(c, -r, r)  # a web is a triangle from the crown to one side
    drop = np.sqrt(np.maximum(1 - q**2, 0))
    triangles = grid(2 * segments, segments)
    parts = []
    for axis, side in ((0, 1.0), (0, -1.0), (2, 1.0), (2, -1.0)):
        out, across = (half[0], half[1]) if axis == 0 else (half[1], half[0])
        under, inward = np.empty((*q.shape, 3)), np.zeros((*q.shape, 3))
        under[..., axis], under[..., 2 - axis], under[..., 1] = side * r * out, q * across, low + rise * drop
        inward[..., 1], inward[..., 2 - axis] = -drop / rise, -q / across
        arc = np.arcsin(np.clip(q, -1, 1)) / np.pi + 0.5
        web_uv = np.stack([0.5 + 0.5 * side * r, arc], axis=-1).reshape(-1, 2)
        parts.append(_side(under.reshape(-1, 3), triangles, inward.reshape(-1, 3), web_uv))
        lid = np.where([True, False, True], under, top).reshape(-1, 3)
        parts.append(_side(lid, triangles, (0, 1, 0), lid[:, ::2] / (width, depth) + 0.5))
        edge = np.stack([np.where([True, False, True], under[-1], top), under[-1]]).reshape(-1, 3)
        edge_uv = np.stack([edge[:, 2 - axis] / (2 * across) + 0.5, (top - edge[:, 1]) / height], axis=-1)
        parts.append(_side(edge, grid(2 * segments, 1), side * np.eye(3)[axis], edge_uv))
    return joined("vault", parts)


def column(radius: float, height: float, segments: int) -> Mesh:
    """A round column with an Attic base and a plain capital; the base reaches 1.4 times the radius of the foot."""
    r, top, foot = radius, height / 2, -height / 2
    quarter = np.linspace(0, np.pi / 2, 9)

    def moulding(center: float, tube: float, at: float, last: float) -> Profile:
        """A rounded edge from straight up, outwards and down."""
        return [
            (at + tube * np.sin(a), center + tube * np.cos(a), np.sin(a), np.cos(a)) for a in np.linspace(0, last, 17)
        ]

    def band(at: float, high: float, low: float) -> Profile:
        return [(at, high, 1.0, 0.0), (at, low, 1.0, 0.0)]

    def ledge(first: float, last: float, y: float) -> Profile:
        return [(at, y, 0.0, 1.0 if last > first else -1.0) for at in (first, last)]

    hollow = [
        (1.16 * r - 0.3 * r * np.sin(a), top - 0.22 * r - 0.3 * r * (1 - np.cos(a)), np.sin(a), -np.cos(a))
        for a in quarter
    ]
    swelling = np.linspace(1, 0, 13)
    shaft = [
        (r * (1 - 0.14 * t**2), foot + 0.88 * r + t * (height - 1.5 * r), 1.0, 0.28 * t * r / height) for t in swelling
    ]
    pieces: list[Profile] = [
        moulding(top - 0.12 * r, 0.12 * r, 1.12 * r, np.pi / 2),
        band(1.24 * r, top - 0.12 * r, top - 0.22 * r),
        ledge(1.24 * r, 1.16 * r, top - 0.22 * r),
        hollow,
        band(0.86 * r, top - 0.52 * r, top - 0.62 * r),
        shaft,
        ledge(r, 1.08 * r, foot + 0.88 * r),
        moulding(foot + 0.74 * r, 0.14 * r, 1.08 * r, np.pi),
        band(1.08 * r, foot + 0.6 * r, foot + 0.5 * r),
        ledge(1.08 * r, 1.2 * r, foot + 0.5 * r),
        moulding(foot + 0.3 * r, 0.2 * r, 1.2 * r, np.pi),
        band(1.2 * r, foot + 0.1 * r, foot),
    ]
    sides = [lathe("side", [tuple(np.round(row, 7).tolist()) for row in piece], segments) for piece in pieces]
    lids = [cap(round(1.12 * r, 7), top, True, segments), cap(round(1.2 * r, 7), foot, False, segments)]
    return joined("column", [*sides, *lids])


def plant(leaves: int, length: float, width: float, crown: Sequence[float], droop: float, seed: int) -> Mesh:
    """Leaves that bend down: from one point for a crown of no size, else from points within an ellipsoid, outwards."""
    random = np.random.default_rng(seed)
    rows = 4
    ways = random.normal(size=(leaves, 3))
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    is_rosette = not any(crown)
    if is_rosette:
        turn = np.arange(leaves) * 2.39996 + random.uniform(-0.3, 0.3, leaves)
        rise = np.sqrt((np.arange(leaves) + 0.5) / leaves)
        lean = np.radians(8 + 62 * rise + random.uniform(-7, 7, leaves))
        ways = np.stack([np.sin(lean) * np.cos(turn), np.cos(lean), np.sin(lean) * np.sin(turn)], axis=1)
    roots = ways * np.asarray(crown) / 2 * random.uniform(0.55, 1.0, (leaves, 1)) ** 0.5
    roots -= ways * (0.0 if is_rosette else 0.5 * length)
    ways = ways if is_rosette else unit(ways + random.normal(scale=0.45, size=ways.shape))
    sizes = length * random.uniform(0.65, 1.1, leaves)
    up = np.array([0.0, 1.0, 0.0])
    side = np.cross(ways, up) + random.normal(scale=0.12 if is_rosette else 0.5, size=ways.shape)
    side = unit(side - (side * ways).sum(axis=1, keepdims=True) * ways)
    t = np.linspace(0, 1, rows + 1)
    angle = np.radians(droop) * t[None, :] * random.uniform(0.6, 1.2, (leaves, 1))
    over = np.cross(side, ways)
    over *= np.where(over[:, 1:2] < 0, -1, 1)
    ahead = ways[:, None] * np.cos(angle)[..., None] - over[:, None] * np.sin(angle)[..., None]
    normals = ways[:, None] * np.sin(angle)[..., None] + over[:, None] * np.cos(angle)[..., None]
    middle = roots[:, None] + np.concatenate(
        [np.zeros((leaves, 1, 3)), np.cumsum((ahead[:, :-1] + ahead[:, 1:]) / 2, axis=1)], axis=1
    ) * (sizes[:, None, None] / rows)
    right = np.cross(ahead, normals)
    half = 0.5 * width * (sizes / length)[:, None, None] * right
    points = np.stack([middle - half, middle + half], axis=2)  # (leaves, rows + 1, 2, 3)
    uv = np.broadcast_to(np.stack(np.meshgrid([0.0, 1.0], 1 - t), axis=-1), (leaves, rows + 1, 2, 2))
    one = grid(1, rows)[:, ::-1]
    triangles = (one[None] + (np.arange(leaves) * 2 * (rows + 1))[:, None, None]).reshape(-1, 3)
    both = np.repeat(normals[:, :, None], 2, axis=2)
    along = np.repeat(right[:, :, None], 2, axis=2)
    return side_mesh("plant", points, triangles, both, uv, along)
