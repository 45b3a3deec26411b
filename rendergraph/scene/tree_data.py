"""The buffer behind `trace.glsl`: trees over the triangles of each mesh, and one over the objects. No GL.

The buffer consists of rows of four 32-bit words. Boxes are rounded outwards to a grid of 16 bits over the box of
their tree: a node with the boxes of both children has 32 bytes; a ray is transformed to the grid once a tree.
An object that is scaled to a plane, whose matrix has no inverse, is traced as a very thin one.

| rows | content |
| --- | --- |
| 2 | grid of the tree over objects: origin and root reference, scale and the row where triangles begin |
| 5 an object | rows of the world-to-object matrix; grid of its mesh: origin and root reference, scale and flags |
| 2 a node | least corners of both boxes and the left reference, greatest corners and the right one |
| 3 a triangle | its corners, and its number within the mesh |

Corners of two boxes share words; the left one has the lower 16 bits. A reference is a row, or below 0 a leaf:
`-1 - object` in the tree over objects, and `leaf(first, count)` of triangles otherwise.
"""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
import numpy.typing as npt
from msgspec import Struct

from rendergraph.scene.bvh import LEAF, Tree, build, depth_limit, refit, triangle_boxes
from rendergraph.scene.model import Floats, Matrix, Scene
from rendergraph.scene.pack import PackedScene

Rows: TypeAlias = npt.NDArray[np.int32]

_CELLS = 65533  # of a grid, with room for rounding
_MARGIN = 0.02  # cells that boxes are larger, for the rounding of rays
_HEADER, _OBJECT, _NODE, _TRIANGLE = 2, 5, 2, 3  # rows
_NOTHING = 0x7FFFFFFF  # the root reference of an empty tree
_THINNEST = 1e-6  # thickness of an object that is scaled to a plane, relative to its size


class MeshTrees(Struct, frozen=True, eq=False):
    """The part of the buffer that stays as it is while objects move.

    Attributes:
        rows: nodes and triangles of all meshes.
        grids: float32 (m, 2, 3), origin and scale of each mesh's grid.
        roots: int32 (m,), references to each mesh's topmost node.
        triangles_at: the row of the buffer where triangles begin.
    """

    rows: Rows
    grids: Floats
    roots: npt.NDArray[np.int32]
    triangles_at: int


def first_rows(objects: int) -> int:
    """Return the number of rows before those of meshes."""
    return _HEADER + _OBJECT * objects + _NODE * max(objects - 1, 0)


def most_bytes(objects: int, triangles: int) -> int:
    """Return a limit of the buffer's bytes, known before any tree is built; `triangles` of all meshes."""
    return 16 * (first_rows(objects) + (_NODE + _TRIANGLE) * triangles)


def stack_size(scene: Scene) -> int:
    """Return how many entries a traversal needs at most, known before any tree is built."""
    largest = max((len(mesh.indices) for mesh in scene.meshes), default=0)
    return depth_limit(len(scene.objects)) + depth_limit(largest) + 3  # the end, the way back to the objects, one more


def mesh_trees(scene: Scene, packed: PackedScene) -> MeshTrees:
    """Build the trees of meshes that have none yet, all at once, and lay all of them out; meshes keep their trees."""
    meshes = scene.meshes
    shapes = []
    for record in packed.meshes:
        indices = packed.indices[record["first_index"] :][: record["count"]].reshape(-1, 3)
        shapes.append((packed.positions[record["base_vertex"] :][: record["vertices"]], indices))
    missing = [number for number, mesh in enumerate(meshes) if "tree" not in mesh.__dict__]
    if missing:
        boxes = np.concatenate([triangle_boxes(*shapes[number]) for number in missing], axis=1)
        built = build(boxes, [len(shapes[number][1]) for number in missing])
        for number, tree in zip(missing, built, strict=True):
            meshes[number].__dict__["tree"] = tree
    trees: list[Tree] = [mesh.__dict__["tree"] for mesh in meshes]
    for number in packed.vertex_orders:  # animated meshes may be in another pose by now
        trees[number] = refit(trees[number], triangle_boxes(*shapes[number]))
    at, first = first_rows(len(scene.objects)), 0
    parts, grids, roots = [np.zeros((0, 4), np.int32)], np.ones((len(trees), 2, 3), np.float32), []
    for number, tree in enumerate(trees):
        grids[number] = _grid(tree.boxes)
        parts.append(_node_rows(tree.boxes, _references(tree.children, at, first), grids[number]))
        roots.append(int(_references(np.array(tree.root), at, first)))
        at, first = at + len(parts[-1]), first + len(tree.order)
    for tree, (positions, triangles) in zip(trees, shapes, strict=True):
        rows = np.zeros((len(tree.order), _TRIANGLE, 4), np.int32)
        rows[:, :, :3] = positions[triangles[tree.order]].view(np.int32)
        rows[:, 0, 3] = tree.order
        parts.append(rows.reshape(-1, 4))
    return MeshTrees(np.concatenate(parts), grids, np.array(roots, np.int32), at)


def object_rows(packed: PackedScene, flags: npt.NDArray[np.int32], trees: MeshTrees) -> Rows:
    """Return the rows before those of meshes, with a tree over the objects where they are now.

    Args:
        packed: the scene.
        flags: int32 (n,), the flags of each object's `SceneInstance`.
        trees: of its meshes.
    """
    count = len(packed.object_mesh)
    rows = np.zeros((first_rows(count), 4), np.int32)
    inverse, has_extent = _inverses(packed)
    objects = rows[_HEADER : _HEADER + _OBJECT * count].reshape(count, _OBJECT, 4)
    objects[:, :3] = inverse.astype(np.float32).view(np.int32)
    grids = trees.grids[packed.object_mesh]
    objects[:, 3:, :3] = grids.view(np.int32)
    objects[:, 3, 3], objects[:, 4, 3] = trees.roots[packed.object_mesh], flags
    used = np.flatnonzero(has_extent & ~packed.hidden & (packed.meshes["count"][packed.object_mesh] > 0))
    low, high = packed.centers - packed.extents - packed.slack, packed.centers + packed.extents + packed.slack
    boxes = np.concatenate([low[used], -high[used]], axis=1).T
    rounded = np.ascontiguousarray(np.nextafter(boxes.astype(np.float32), np.float32(-np.inf)))
    (tree,) = build(rounded, [len(used)], 1)
    at = _HEADER + _OBJECT * count
    grid = _grid(tree.boxes)
    rows[at : at + _NODE * len(tree.boxes)] = _node_rows(tree.boxes, _objects(tree.children, at, tree, used), grid)
    rows[:_HEADER, :3] = grid.view(np.int32)
    rows[0, 3] = _objects(np.array(tree.root), at, tree, used) if len(used) else _NOTHING
    rows[1, 3] = trees.triangles_at
    return rows


def _references(children: npt.NDArray[np.int32], at: int, first: int) -> npt.NDArray[np.int32]:
    """References of a mesh's tree within the buffer: nodes begin at a row, triangles at a number."""
    return np.where(children < 0, children - LEAF * first, at + _NODE * children)


def _objects(
    children: npt.NDArray[np.int32], at: int, tree: Tree, objects: npt.NDArray[np.int64]
) -> npt.NDArray[np.int32]:
    """References of the tree over objects, whose leaves have one each."""
    leaves = -1 - objects[tree.order[np.maximum(-1 - children, 0) // LEAF]]
    return np.where(children < 0, leaves, at + _NODE * children).astype(np.int32)


def _grid(boxes: Floats) -> Floats:
    """Origin and scale, float32 (2, 3), of the grid over all boxes (n, 2, 6)."""
    if not len(boxes):
        return np.stack([np.zeros(3, np.float32), np.ones(3, np.float32)])
    low = boxes[:, :, :3].min(axis=(0, 1)).astype(np.float64)
    extent = boxes[:, :, 3:].max(axis=(0, 1)) - low
    extent = np.maximum(extent, max(float(extent.max()) * 1e-6, 1e-30))
    return np.stack([np.nextafter(low.astype(np.float32), np.float32(-np.inf)), (_CELLS / extent).astype(np.float32)])


def _node_rows(boxes: Floats, children: npt.NDArray[np.int32], grid: Floats) -> Rows:
    """Rows of nodes with their boxes (n, 2, 6), rounded outwards, and references (n, 2)."""
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
    """Rows of the world-to-object matrices, float64 (n, 3, 4), and whether an object has any extent at all (n,)."""
    rows = packed.instances["rows"].astype(np.float64)
    linear = rows[:, :, :3]
    size = np.abs(linear).max(axis=(1, 2), initial=0.0)
    is_flat = np.abs(np.linalg.det(linear)) <= _THINNEST**2 * size**3
    if is_flat.any():
        u, values, v = np.linalg.svd(linear[is_flat])
        linear[is_flat] = u * np.maximum(values, np.maximum(values[:, :1], 1e-30) * _THINNEST)[:, None] @ v
    inverse = np.linalg.inv(linear)
    return np.concatenate([inverse, -(inverse @ rows[:, :, 3:])], axis=2), size > 0
