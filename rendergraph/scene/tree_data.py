"""The buffer behind `trace.glsl`: BVHs over the triangles of meshes, and one over the objects. No GL.

Objects that never move share one tree over all their triangles in world space, because a ray must traverse overlapping
objects one after the other. The shared tree counts as one more object in the tree over objects. Other objects use the
tree of their mesh.

The buffer consists of rows of four 32-bit words. Boxes are rounded outwards to a 16-bit grid over the box of their
tree: a node with the boxes of both children has 32 bytes; a ray is transformed to the grid once per tree. An object
that is scaled to a plane, whose matrix has no inverse, is traced as a very thin one.

| rows | content |
| --- | --- |
| 2 | grid of the tree over objects: origin and root reference, scale and the row where triangles begin |
| 5 per object | rows of the world-to-object matrix; grid of its mesh: origin and root reference, scale and flags |
| 5 | the same for the shared tree, whose flags are -1 |
| 2 per node | minimum corners of both boxes and the left reference, maximum corners and the right one |
| 3 per triangle | its corners; its number within the mesh; in the shared tree its object and its flags, else -1 |

Corners of two boxes share words; the left one has the lower 16 bits. A reference is a row, or a leaf if below 0:
`-1 - object` in the tree over objects, and `leaf(first, count)` of triangles otherwise.
"""

from __future__ import annotations

from collections import Counter
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt
from msgspec import Struct

from rendergraph.scene.bvh import LEAF, Tree, build, refit, triangle_boxes
from rendergraph.scene.model import Floats, Matrix, Scene
from rendergraph.scene.pack import Ints, PackedScene

_CELLS = 65533  # cells of a grid, with room for rounding
_MARGIN = 0.02  # cells by which boxes are enlarged, for the rounding of rays
_HEADER, _OBJECT, _NODE, _TRIANGLE = 2, 5, 2, 3  # rows
_NOTHING = 0x7FFFFFFF  # the root reference of an empty tree
_THINNEST = 1e-6  # thickness of an object that is scaled to a plane, relative to its size
_FINEST = 8  # minimum size of an object's triangles in the shared tree, in cells of its grid
_MOST_COPIES = 1 << 17  # limit of copied triangles in the shared tree

_Shape: TypeAlias = tuple[Floats, npt.NDArray[np.uint32]]
"""Positions (v, 3) and triangles (t, 3)."""


class MeshTrees(Struct, frozen=True, eq=False):
    """The part of the buffer that does not change while objects move. The shared tree follows those of m meshes.

    Attributes:
        rows: nodes and triangles of all trees.
        grids: float32 (m + 1, 2, 3), origin and scale of each tree's grid.
        roots: int32 (m + 1,), references to each tree's root.
        triangles_at: the first row of triangles in the buffer.
        shared: bool (n,), which objects are in the shared tree.
        box: float32 (2, 3), the corners of the shared tree's box.
        tree: the shared tree.
    """

    rows: Ints
    grids: Floats
    roots: Ints
    triangles_at: int
    shared: npt.NDArray[np.bool_]
    box: Floats
    tree: Tree


def first_rows(objects: int) -> int:
    """Return the number of rows before those of meshes."""
    return _HEADER + _OBJECT * (objects + 1) + _NODE * objects


def _most_triangles(scene: Scene) -> int:
    """Return an upper bound on the number of triangles in all trees, of which the shared one has copies."""
    uses = Counter(placed.mesh for placed in scene.objects)
    copies = sum(len(scene.meshes[mesh].indices) * count for mesh, count in uses.items() if count > 1)
    return sum(len(mesh.indices) for mesh in scene.meshes) + min(copies, _MOST_COPIES)


def most_bytes(scene: Scene) -> int:
    """Return an upper bound on the buffer's bytes, known before any tree is built."""
    return 16 * (first_rows(len(scene.objects)) + (_NODE + _TRIANGLE) * _most_triangles(scene))


def _moving(scene: Scene) -> set[int]:
    """Return the objects whose position or shape changes over time."""
    names = {name for section, name, _ in scene.tracks if section == "objects"}
    names |= {name for rig in scene.rigs for name, _ in rig.placements}
    return {number for name in names for number in scene.parts_of(name)}


def _shared(scene: Scene, packed: PackedScene) -> npt.NDArray[np.bool_]:
    """Return which objects share a tree (n,): those that do not move and are large enough for its grid.

    Meshes with several objects are copied, smallest first, up to the limit.
    """
    counts = packed.meshes["count"][packed.object_mesh] // 3
    found = ~packed.hidden & (counts > 0)
    found[list(_moving(scene))] = False
    found[[placed.pose is not None for placed in scene.objects]] = False
    if found.any():
        low, high = packed.centers - packed.extents, packed.centers + packed.extents
        cell = float((high[found].max(axis=0) - low[found].min(axis=0)).max()) / _CELLS
        found &= packed.extents.max(axis=1) * 2 >= _FINEST * cell * np.sqrt(counts)
    uses = np.bincount(packed.object_mesh, minlength=len(scene.meshes))[packed.object_mesh]
    several = np.flatnonzero(found & (uses > 1))
    ranked = several[np.argsort(counts[several], kind="stable")]
    found[ranked[np.cumsum(counts[ranked]) > _MOST_COPIES]] = False
    return found


def mesh_trees(scene: Scene, packed: PackedScene, flags: Ints, before: MeshTrees | None = None) -> MeshTrees:
    """Build all missing trees at once, and lay all trees out; meshes cache their trees.

    `packed` has the current positions, `flags` (n,) are those of each object's `SceneInstance`, and `before` is the
    result for an earlier pose of animated meshes.
    """
    shared = _shared(scene, packed)
    held: list[dict[str, Any]] = [vars(mesh) for mesh in scene.meshes]
    held.append({} if before is None else {"tree": before.tree})
    shapes: list[_Shape] = []
    for record in packed.meshes:
        indices = packed.indices[record["first_index"] :][: record["count"]].reshape(-1, 3)
        shapes.append((packed.positions[record["base_vertex"] :][: record["vertices"]], indices))
    numbers = np.flatnonzero(shared)
    needed = {*packed.object_mesh[~shared & ~packed.hidden].tolist(), *([len(scene.meshes)] if len(numbers) else [])}
    shapes.append(_in_world(packed, shapes, numbers))
    missing = [number for number in needed if "tree" not in held[number]]
    if missing:
        boxes = np.concatenate([triangle_boxes(*shapes[number]) for number in missing], axis=1)
        built = build(boxes, [len(shapes[number][1]) for number in missing])
        for number, tree in zip(missing, built, strict=True):
            held[number]["tree"] = tree
    empty = Tree(np.zeros((0, 2, 6), np.float32), np.zeros((0, 2), np.int32), np.zeros(0, np.int32), 0, 0)
    trees: list[Tree] = [one["tree"] if n in needed else empty for n, one in enumerate(held)]
    for number in packed.vertex_orders.keys() & needed:  # the pose of animated meshes may have changed
        trees[number] = refit(trees[number], triangle_boxes(*shapes[number]))
    at, first = first_rows(len(scene.objects)), 0
    parts, grids, roots = [np.zeros((0, 4), np.int32)], np.ones((len(trees), 2, 3), np.float32), []
    for number, tree in enumerate(trees):
        grids[number] = _grid(tree.boxes)
        parts.append(_node_rows(tree.boxes, _references(tree.children, at, first), grids[number]))
        roots.append(int(_references(np.array(tree.root), at, first)))
        at, first = at + len(parts[-1]), first + len(tree.order)
    counts = packed.meshes["count"][packed.object_mesh[numbers]].astype(np.int64) // 3
    for number, (tree, (positions, triangles)) in enumerate(zip(trees, shapes, strict=True)):
        rows = np.full((len(tree.order), _TRIANGLE, 4), -1, np.int32)
        rows[:, :, :3] = positions[triangles[tree.order]].view(np.int32)
        rows[:, 0, 3] = tree.order
        if number == len(scene.meshes):
            rows[:, 0, 3] -= np.repeat(np.cumsum(counts) - counts, counts)[tree.order]
            rows[:, 1, 3] = np.repeat(numbers, counts)[tree.order]
            rows[:, 2, 3] = flags[rows[:, 1, 3]]
        parts.append(rows.reshape(-1, 4))
    corners = shapes[-1][0]
    box = np.stack([corners.min(axis=0), corners.max(axis=0)]) if len(corners) else np.zeros((2, 3), np.float32)
    return MeshTrees(np.concatenate(parts), grids, np.array(roots, np.int32), at, shared, box, trees[-1])


def _in_world(packed: PackedScene, shapes: list[_Shape], objects: npt.NDArray[np.int64]) -> _Shape:
    """Return all triangles of some objects in world space, object by object."""
    positions, triangles, first = [np.zeros((0, 3), np.float32)], [np.zeros((0, 3), np.uint32)], 0
    for number in objects:
        local, indices = shapes[packed.object_mesh[number]]
        rows = packed.instances["rows"][number].astype(np.float64)
        positions.append((local @ rows[:, :3].T + rows[:, 3]).astype(np.float32))
        triangles.append(indices + np.uint32(first))
        first += len(local)
    return np.concatenate(positions), np.concatenate(triangles)


def object_rows(packed: PackedScene, flags: Ints, trees: MeshTrees) -> Ints:
    """Return the rows before those of meshes, with a tree over the objects at their current positions.

    `flags` (n,) are those of each object's `SceneInstance`.
    """
    count = len(packed.object_mesh)
    rows = np.zeros((first_rows(count), 4), np.int32)
    inverse, has_extent = _inverses(packed)
    objects = rows[_HEADER : _HEADER + _OBJECT * (count + 1)].reshape(count + 1, _OBJECT, 4)
    objects[:, :3] = np.concatenate([inverse, np.eye(3, 4)[None]]).astype(np.float32).view(np.int32)
    tree_of = np.append(packed.object_mesh, len(trees.roots) - 1)
    objects[:, 3:, :3] = trees.grids[tree_of].view(np.int32)
    objects[:, 3, 3], objects[:, 4, 3] = trees.roots[tree_of], np.append(flags, -1)
    is_used = has_extent & ~packed.hidden & (packed.meshes["count"][packed.object_mesh] > 0) & ~trees.shared
    used = np.flatnonzero(np.append(is_used, trees.shared.any()))
    low, high = packed.centers - packed.extents - packed.slack, packed.centers + packed.extents + packed.slack
    low, high = np.concatenate([low, trees.box[:1]]), np.concatenate([high, trees.box[1:]])
    boxes = np.concatenate([low[used], -high[used]], axis=1).T
    rounded = np.ascontiguousarray(np.nextafter(boxes.astype(np.float32), np.float32(-np.inf)))
    (tree,) = build(rounded, [len(used)], 1)
    at = _HEADER + _OBJECT * (count + 1)
    grid = _grid(tree.boxes)
    rows[at : at + _NODE * len(tree.boxes)] = _node_rows(tree.boxes, _objects(tree.children, at, tree, used), grid)
    rows[:_HEADER, :3] = grid.view(np.int32)
    rows[0, 3] = _objects(np.array(tree.root), at, tree, used) if len(used) else _NOTHING
    rows[1, 3] = trees.triangles_at
    return rows


def _references(children: Ints, at: int, first: int) -> Ints:
    """Return references of a mesh's tree within the buffer: nodes begin at a row, triangles at a number."""
    return np.where(children < 0, children - LEAF * first, at + _NODE * children)


def _objects(children: Ints, at: int, tree: Tree, objects: npt.NDArray[np.int64]) -> Ints:
    """Return references of the tree over objects, whose leaves have one object each."""
    leaves = -1 - objects[tree.order[np.maximum(-1 - children, 0) // LEAF]]
    return np.where(children < 0, leaves, at + _NODE * children).astype(np.int32)


def _grid(boxes: Floats) -> Floats:
    """Return origin and scale, float32 (2, 3), of the grid over all boxes (n, 2, 6)."""
    if not len(boxes):
        return np.stack([np.zeros(3, np.float32), np.ones(3, np.float32)])
    low = boxes[:, :, :3].min(axis=(0, 1)).astype(np.float64)
    extent = boxes[:, :, 3:].max(axis=(0, 1)) - low
    extent = np.maximum(extent, max(float(extent.max()) * 1e-6, 1e-30))
    return np.stack([np.nextafter(low.astype(np.float32), np.float32(-np.inf)), (_CELLS / extent).astype(np.float32)])


def _node_rows(boxes: Floats, children: Ints, grid: Floats) -> Ints:
    """Return rows of nodes with their boxes (n, 2, 6), rounded outwards, and references (n, 2)."""
    low, scale = grid.astype(np.float64)
    rows = np.zeros((len(boxes), _NODE, 4), np.uint32)
    for row, corner, rounded, margin in ((0, slice(0, 3), np.floor, -_MARGIN), (1, slice(3, 6), np.ceil, _MARGIN)):
        cells = rounded((boxes[:, :, corner] - low) * scale + margin)
        left, right = np.moveaxis(np.clip(cells, 0, 0xFFFF).astype(np.uint32), 1, 0)
        rows[:, row, :3] = left | right << np.uint32(16)
    signed = rows.view(np.int32)
    signed[:, :, 3] = children
    return signed.reshape(-1, 4)


def _inverses(packed: PackedScene) -> tuple[Matrix, npt.NDArray[np.bool_]]:
    """Return rows of the world-to-object matrices, float64 (n, 3, 4), and whether an object has any extent (n,)."""
    rows = packed.instances["rows"].astype(np.float64)
    linear = rows[:, :, :3]
    size = np.abs(linear).max(axis=(1, 2), initial=0.0)
    is_flat = np.abs(np.linalg.det(linear)) <= _THINNEST**2 * size**3
    if is_flat.any():
        u, values, v = np.linalg.svd(linear[is_flat])
        linear[is_flat] = u * np.maximum(values, np.maximum(values[:, :1], 1e-30) * _THINNEST)[:, None] @ v
    inverse = np.linalg.inv(linear).astype(np.float64, copy=False)
    return np.concatenate([inverse, -(inverse @ rows[:, :, 3:])], axis=2), size > 0
