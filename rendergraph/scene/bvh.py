"""Bounding volume hierarchies for ray tracing: one tree over the triangles of each mesh, one over the placed objects.

Trees are binary and built top-down by the binned surface-area heuristic (I. Wald, "On fast Construction of
SAH-based Bounding Volume Hierarchies", 2007), on all three axes. All nodes of a level are split at once with NumPy,
for all meshes together, in batches that fit the processor's cache. `trace.glsl` traverses them.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import TypeAlias

import numpy as np
import numpy.typing as npt
from msgspec import Struct
from msgspec.structs import replace

from rendergraph.scene.model import Floats

Ints: TypeAlias = npt.NDArray[np.int64]
References: TypeAlias = npt.NDArray[np.int32]
Bools: TypeAlias = npt.NDArray[np.bool_]

LEAF = 4
"""Maximum number of primitives in a leaf: a reference has two bits for it."""
_BATCH = 1 << 14  # primitives that are split together: their boxes and bins fit a core's own cache
_BINS, _FEW_BINS = 16, 8
_FEW = 6  # primitives per node
_SAMPLING, _ENOUGH = 8, 512  # every eighth primitive of nodes that have more than 8 times 512
_STEP_COST = 0.5  # cost of visiting a node, relative to a primitive test


class Tree(Struct, frozen=True, eq=False):
    """A binary tree over primitives. n inner nodes, p primitives.

    Attributes:
        boxes: float32 (n, 2, 6), the boxes of each node's two children: least xyz, greatest xyz.
        children: int32 (n, 2). An inner node is its number; a leaf is `leaf(first, count)`, which is below 0.
        order: int32 (p,), the primitives in the order in which leaves count them.
        root: the reference of the topmost node; meaningless if there is no primitive.
        depth: the largest number of inner nodes on a path from the root to a leaf.
    """

    boxes: Floats
    children: References
    order: References
    root: int
    depth: int


def leaf(first: npt.NDArray[np.int64] | int, count: npt.NDArray[np.int64] | int) -> npt.NDArray[np.int64] | int:
    """Return the reference to a leaf of `count` primitives from position `first` of the order: below 0."""
    return -1 - (first * LEAF + count - 1)


def depth_limit(primitives: int) -> int:
    """Return the largest depth of a tree over this many primitives, whatever their boxes: 8 more than balanced ones."""
    return min(max(primitives - 1, 0).bit_length() + 8, 30)  # the trail of a ray has 30 levels


def triangle_boxes(positions: Floats, triangles: npt.NDArray[np.uint32]) -> Floats:
    """Return boxes for `build` of triangles (t, 3) over positions (v, 3)."""
    boxes = np.empty((6, len(triangles)), np.float32)
    corners = np.ascontiguousarray(triangles.T)
    for axis in range(3):
        a, b, c = np.ascontiguousarray(positions[:, axis])[corners]
        np.minimum(np.minimum(a, b), c, out=boxes[axis])
        np.negative(np.maximum(np.maximum(a, b), c), out=boxes[3 + axis])
    return boxes


class _Batch(Struct, eq=False):
    """Nodes that are split together: k nodes, and m primitives grouped by node.

    Attributes:
        first, count: int64 (k,), the node's part of the order.
        slot: int64 (k,), where the parent stores the node's reference.
        area: float32 (k,), half the surface area of the node's box.
        level, limit: int64 (k,), the number of inner nodes above, and the maximum number of levels of the node's tree.
        numbers: int64 (m,), the primitives.
        boxes: float32 (6, m), their minimum xyz and negated maximum xyz, so that the union of boxes is a minimum.
        leaf: the maximum number of primitives in a leaf.
    """

    first: Ints
    count: Ints
    slot: Ints
    area: Floats
    level: Ints
    limit: Ints
    numbers: Ints
    boxes: Floats
    leaf: int

    def parts(self) -> Iterator[_Batch]:
        """Yield the same nodes in batches of bounded size; a larger node is alone in its batch."""
        ends = np.cumsum(self.count)
        group = (ends - self.count) // _BATCH
        edges = [0, *(np.flatnonzero(np.diff(group)) + 1).tolist(), len(group)]
        for begin, end in pairwise(edges):
            nodes = slice(begin, end)
            inside = slice(int(ends[begin] - self.count[begin]), int(ends[end - 1]))
            columns = {name: getattr(self, name)[nodes] for name in self.__struct_fields__[:6]}  # those of nodes
            yield _Batch(**columns, numbers=self.numbers[inside], boxes=self.boxes[:, inside], leaf=self.leaf)


def build(boxes: Floats, sizes: Sequence[int], most: int = LEAF) -> list[Tree]:
    """Build trees over groups of primitives.

    Args:
        boxes: float32 (6, p), least xyz and negated greatest xyz of each primitive, finite, group after group.
        sizes: the number of primitives of each group.
        most: the maximum number of primitives in a leaf, up to `LEAF`.
    """
    counts = np.array(sizes, np.int64)
    total, trees = int(counts.sum()), len(counts)
    # Slots 2 i and 2 i + 1 are the children of node i, and the last ones are the roots.
    references = np.full(2 * total + trees, -1, np.int64)
    slot_boxes = np.empty((6, 2 * total), np.float32)
    owner = np.empty(total, np.int64)
    order = np.empty(total, np.int64)
    depths = np.zeros(trees, np.int64)
    node_count = 0
    used = np.flatnonzero(counts)
    first = np.cumsum(counts) - counts
    limits = np.array([depth_limit(size) for size in sizes], np.int64)
    open_batches: list[_Batch] = []
    if len(used):
        area = _half_area(np.minimum.reduceat(boxes, first[used], axis=1))
        levels, numbers = np.zeros(len(used), np.int64), np.arange(total)
        batch = _Batch(first[used], counts[used], 2 * total + used, area, levels, limits[used], numbers, boxes, most)
        open_batches.extend(batch.parts())
    roots = np.repeat(np.arange(trees), counts)
    while open_batches:
        batch = open_batches.pop()
        left, side, is_leaf = _split(batch)
        primitives = np.repeat(is_leaf, batch.count)
        if is_leaf.any():
            begin, count = batch.first[is_leaf], batch.count[is_leaf]
            references[batch.slot[is_leaf]] = leaf(begin, count)
            order[_ranges(begin, count)] = batch.numbers[primitives]
        inner = ~is_leaf
        nodes = int(inner.sum())
        if not nodes:
            continue
        names = np.arange(node_count, node_count + nodes)
        node_count += nodes
        references[batch.slot[inner]] = names
        tree = roots[batch.first[inner]]
        owner[names] = tree
        np.maximum.at(depths, tree, batch.level[inner] + 1)
        rest = np.flatnonzero(~primitives)
        node_of = np.repeat(np.arange(nodes), batch.count[inner])
        keys = 2 * node_of + side[rest]  # NumPy has a radix sort for 16 bits
        rest = rest[np.argsort(keys.astype(np.uint16) if nodes <= 1 << 15 else keys, kind="stable")]
        counts_of = np.stack([left[inner], batch.count[inner] - left[inner]], axis=1)
        starts = np.cumsum(counts_of.reshape(-1)) - counts_of.reshape(-1)
        inside = batch.boxes[:, rest]
        slots = np.arange(2 * int(names[0]), 2 * int(names[-1]) + 2)
        for axis in range(6):
            slot_boxes[axis, slots[0] : slots[-1] + 1] = np.minimum.reduceat(inside[axis], starts)
        below = _Batch(
            np.stack([batch.first[inner], batch.first[inner] + left[inner]], axis=1).reshape(-1),
            counts_of.reshape(-1),
            slots,
            _half_area(slot_boxes[:, slots[0] : slots[-1] + 1]),
            np.repeat(batch.level[inner] + 1, 2),
            np.repeat(batch.limit[inner], 2),
            batch.numbers[rest],
            inside,
            most,
        )
        open_batches.extend(below.parts())
    slot_boxes = slot_boxes[:, : 2 * node_count]
    area = _half_area(slot_boxes)
    slot_boxes[3:] *= -1
    name = _depth_first(references[: 2 * node_count].reshape(-1, 2), area.reshape(-1, 2), references[2 * total :])
    return _separate(references, slot_boxes, owner[:node_count], name, order, depths, counts)


def refit(tree: Tree, boxes: Floats) -> Tree:
    """Return the tree refitted to primitives that have moved: the same nodes with updated boxes."""
    levels = _levels(tree.children, np.array([tree.root])[: len(tree.children)])
    found, primitives = np.empty(tree.boxes.shape, np.float32), boxes.T[tree.order]
    for nodes in reversed(levels):
        children = tree.children[nodes]
        first, more = np.divmod(np.maximum(-1 - children, 0), LEAF)
        leaves = np.minimum.reduce([primitives[first + np.minimum(more, number)] for number in range(LEAF)])
        inner = found[np.maximum(children, 0)].min(axis=2)
        found[nodes] = np.where(children[:, :, None] < 0, leaves, inner)
    found[:, :, 3:] *= -1
    return replace(tree, boxes=found)


def _levels(children: npt.NDArray[np.integer], roots: npt.NDArray[np.integer]) -> list[npt.NDArray[np.integer]]:
    """Return the inner nodes of trees by depth, starting with the roots."""
    levels, references = [], roots
    while len(nodes := references[references >= 0]):
        levels.append(nodes)
        references = children[nodes].reshape(-1)
    return levels


def _depth_first(children: Ints, area: Floats, roots: Ints) -> Ints:
    """Number the nodes of each tree (n,) depth-first, with a node's larger child right after it.

    A ray usually continues with the larger child, which then often shares its cache line: 8 % faster.
    """
    levels = _levels(children, roots)
    sizes = np.zeros(len(children) + 1, np.int64)  # sizes of subtrees; the last entry stands for leaves
    for nodes in reversed(levels):
        sizes[nodes] = 1 + sizes[np.maximum(children[nodes], -1)].sum(axis=1)
    first = np.argmax(np.where(children < 0, -1, area), axis=1)[:, None]
    ordered = np.concatenate([np.take_along_axis(children, first, 1), np.take_along_axis(children, 1 - first, 1)], 1)
    name = np.zeros(len(children) + 1, np.int64)
    for nodes in levels:
        larger, smaller = np.maximum(ordered[nodes], -1).T
        name[larger] = name[nodes] + 1
        name[smaller] = name[nodes] + 1 + sizes[larger]
    return name[:-1]


def _separate(
    references: Ints, boxes: Floats, owner: Ints, name: Ints, order: Ints, depths: Ints, counts: Ints
) -> list[Tree]:
    """Return the trees one by one, with nodes numbered within their own tree by `name`."""
    nodes = np.bincount(owner, minlength=len(counts))
    ends, first = np.cumsum(nodes), np.cumsum(counts) - counts
    node_start = ends - nodes
    by_name = np.empty(len(owner), np.int64)
    by_name[node_start[owner] + name] = np.arange(len(owner))
    children = references[: 2 * len(owner)].reshape(-1, 2)[by_name]
    child_boxes = boxes.T.reshape(-1, 2, 6)[by_name]
    if len(name):
        leaves = children + LEAF * first[owner[by_name]][:, None]
        children = np.where(children < 0, leaves, name[np.maximum(children, 0)])
    found = []
    for number, root in enumerate(references[2 * int(counts.sum()) :].tolist()):
        inside, mine = slice(node_start[number], ends[number]), slice(first[number], first[number] + counts[number])
        own_boxes, own_children = np.ascontiguousarray(child_boxes[inside]), children[inside].astype(np.int32)
        own_order = (order[mine] - first[number]).astype(np.int32)
        root = int(name[root]) if root >= 0 else root + LEAF * int(first[number])
        found.append(Tree(own_boxes, own_children, own_order, root, int(depths[number])))
    return found


def _ranges(first: Ints, count: Ints) -> Ints:
    """Return the concatenated ranges of `count` numbers from each `first`."""
    starts = np.cumsum(count) - count
    return np.repeat(first - starts, count) + np.arange(int(count.sum()))


def _split(batch: _Batch) -> tuple[Ints, Bools, Bools]:
    """Choose the cheapest partition of each node.

    Returns:
        The number of primitives on the left (k,), whether a primitive goes to the right (m,), and whether a node is
        cheaper as a leaf (k,).
    """
    nodes, total = len(batch.count), len(batch.numbers)
    starts = np.cumsum(batch.count) - batch.count
    node_of = np.repeat(np.arange(nodes), batch.count)
    bins = _BINS if total > 16 * nodes else _FEW_BINS
    centers = batch.boxes[:3] - batch.boxes[3:]
    low = np.minimum.reduceat(centers, starts, axis=1)
    extent = np.maximum.reduceat(centers, starts, axis=1) - low
    scale = np.where(extent > 0, np.float32(bins * (1 - 1e-6)) / np.maximum(extent, np.float32(1e-37)), np.float32(0))
    # With few primitives only the longest axis is tried; with many, a sample finds the best split as well.
    longest = np.argmax(extent, axis=0)
    axes: list[int | Ints] = [0, 1, 2] if total > _FEW * nodes else [longest]
    step = _SAMPLING if batch.count.min() >= _SAMPLING * _ENOUGH else 1
    bounds = np.full((len(axes), 6, bins * nodes), np.inf, np.float32)
    counts = np.empty((len(axes), bins, nodes), np.float32)
    for number, axis in enumerate(axes):
        key = _bins_along(axis, node_of[::step], centers[:, ::step], low, scale).astype(np.int64)
        np.minimum(key, bins - 1, out=key)
        key *= nodes
        key += node_of[::step]
        counts[number] = np.bincount(key, minlength=bins * nodes).reshape(bins, nodes)
        for column in range(6):
            np.minimum.at(bounds[number, column], key, batch.boxes[column, ::step])
    costs = _costs(bounds.reshape(-1, 6, bins, nodes), counts).reshape(-1, nodes)
    best = np.argmin(costs, axis=0)
    least = costs[best, np.arange(nodes)] * step
    number, split = np.divmod(best, bins - 1)
    value = _bins_along(number if len(axes) > 1 else longest, node_of, centers, low, scale)
    side = value >= (split + 1)[node_of]
    left = batch.count - np.add.reduceat(side, starts, dtype=np.int64)
    levels = batch.limit - batch.level  # at 0 there are no more primitives than fit into a leaf
    pays = (least + _STEP_COST * batch.area < batch.count * batch.area) & (batch.count > 1) & (levels > 0)
    is_leaf = (batch.count <= batch.leaf) & ~pays
    # Neither child may be empty, or have more primitives than the levels below it can hold.
    room = batch.leaf << np.clip(levels - 1, 0, 40)
    is_halved = ~is_leaf & ~((left > 0) & (left <= room) & (left < batch.count) & (batch.count - left <= room))
    if is_halved.any():
        left = np.where(is_halved, batch.count // 2, left)
        side = np.where(is_halved[node_of], _upper_half(batch, starts, node_of, centers, extent), side)
    return left, side, is_leaf


def _bins_along(axis: Ints | int, node_of: Ints, centers: Floats, low: Floats, scale: Floats) -> Floats:
    """Return the fractional bin of each primitive along an axis, or along an axis per node."""
    if isinstance(axis, int):
        value, first, step = centers[axis], low[axis], scale[axis]
    else:
        nodes = np.arange(len(axis))
        value, first, step = centers[axis[node_of], np.arange(len(node_of))], low[axis, nodes], scale[axis, nodes]
    found: Floats = (value - first[node_of]) * step[node_of]
    return found


def _costs(bounds: Floats, counts: Floats) -> Floats:
    """Return the cost of each split, (a axes, bins - 1, k): summed area times primitives; infinite if a side is empty.

    `bounds` (a, 6, bins, k) are the boxes of the primitives in each bin, and `counts` (a, bins, k) their number.
    """
    bins = bounds.shape[2]
    costs = np.empty((len(bounds), bins - 1, bounds.shape[3]), np.float32)
    with np.errstate(invalid="ignore", over="ignore"):  # sides without primitives
        lower, count = bounds[:, :, 0].copy(), counts[:, 0].copy()
        for number in range(bins - 1):
            if number:
                np.minimum(lower, bounds[:, :, number], out=lower)
                count += counts[:, number]
            np.multiply(_half_area(lower.swapaxes(0, 1)), count, out=costs[:, number])
        upper, count = bounds[:, :, -1].copy(), counts[:, -1].copy()
        for number in range(bins - 2, -1, -1):
            if number < bins - 2:
                np.minimum(upper, bounds[:, :, number + 1], out=upper)
                count += counts[:, number + 1]
            costs[:, number] += _half_area(upper.swapaxes(0, 1)) * count
    costs[np.isnan(costs)] = np.inf
    return costs


def _half_area(boxes: Floats) -> Floats:
    """Return half the surface area of boxes (6, …)."""
    x, y, z = (-(boxes[axis] + boxes[3 + axis]) for axis in range(3))
    area: Floats = x * y + y * z + z * x
    return area


def _upper_half(batch: _Batch, starts: Ints, node_of: Ints, centers: Floats, extent: Floats) -> Bools:
    """Return whether a primitive lies in the upper half of its node, by rank along the node's longest axis."""
    along = centers[np.argmax(extent, axis=0)[node_of], np.arange(len(node_of))]
    ranked = np.lexsort((along, node_of))
    rank = np.empty(len(node_of), np.int64)
    rank[ranked] = np.arange(len(node_of))
    return rank - starts[node_of] >= batch.count[node_of] // 2
