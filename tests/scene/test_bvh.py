"""Trees over boxes: every primitive is in one leaf, inside all boxes above it, and no tree is deeper than promised."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest

from rendergraph.scene.bvh import LEAF, Tree, build, depth_limit, refit, triangle_boxes
from rendergraph.scene.tree_data import _grid, _node_rows

Mesh = tuple[npt.NDArray[np.float32], npt.NDArray[np.uint32]]


def soup(count: int, size: float = 0.05) -> Mesh:
    """Triangles anywhere in a unit cube."""
    random = np.random.default_rng(count)
    corners = random.random((count, 1, 3)) + random.normal(size=(count, 3, 3)) * size
    return corners.astype(np.float32).reshape(-1, 3), np.arange(3 * count, dtype=np.uint32).reshape(-1, 3)


def sphere(side: int) -> Mesh:
    """A bumpy sphere of 2 side² triangles."""
    u, v = np.meshgrid(np.linspace(0, 2 * np.pi, side + 1), np.linspace(0, np.pi, side + 1), indexing="ij")
    r = 1 + 0.1 * np.sin(9 * u) * np.sin(7 * v)
    positions = np.stack([r * np.cos(u) * np.sin(v), r * np.cos(v), r * np.sin(u) * np.sin(v)], axis=-1)
    i = np.arange((side + 1) ** 2).reshape(side + 1, side + 1)
    a, b, c, d = i[:-1, :-1].ravel(), i[1:, :-1].ravel(), i[:-1, 1:].ravel(), i[1:, 1:].ravel()
    triangles = np.concatenate([np.stack([a, b, c], axis=1), np.stack([c, b, d], axis=1)])
    return positions.reshape(-1, 3).astype(np.float32), triangles.astype(np.uint32)


def series(count: int) -> Mesh:
    """Triangles ever closer to a point: without a limit, every split would take off one of them."""
    scale = np.repeat(2.0 ** -(np.arange(count) % 120), 3)
    positions = np.zeros((3 * count, 3), np.float32)
    positions[:, 0] = scale * np.tile([1, 1.01, 1], count)
    positions[:, 1] = scale * np.tile([0, 0, 0.01], count)
    return positions, np.arange(3 * count, dtype=np.uint32).reshape(-1, 3)


def check(tree: Tree, mesh: Mesh) -> None:
    positions, triangles = mesh
    np.testing.assert_array_equal(np.sort(tree.order), np.arange(len(triangles)))
    if not len(triangles):
        return
    corners = positions[triangles[tree.order]]
    times = np.zeros(len(triangles), int)
    deepest = 0
    todo = [(tree.root, np.full(3, -np.inf), np.full(3, np.inf), 0)]
    while todo:
        reference, low, high, depth = todo.pop()
        deepest = max(deepest, depth)
        if reference < 0:
            first, count = divmod(-1 - reference, LEAF)
            points = corners[first : first + count + 1].reshape(-1, 3)
            assert (points >= low).all()
            assert (points <= high).all()
            times[first : first + count + 1] += 1
            continue
        for box, child in zip(tree.boxes[reference], tree.children[reference].tolist(), strict=True):
            todo.append((child, np.maximum(low, box[:3]), np.minimum(high, box[3:]), depth + 1))
    assert (times == 1).all()
    assert deepest == tree.depth <= depth_limit(len(triangles))


@pytest.mark.parametrize(
    "mesh",
    [soup(1), soup(2), soup(700), sphere(40), series(3000), (np.zeros((9, 3), np.float32), soup(3)[1])],
    ids=["one", "two", "soup", "sphere", "series", "coincident"],
)
def test_every_triangle_is_in_one_leaf(mesh: Mesh) -> None:
    (tree,) = build(triangle_boxes(*mesh), [len(mesh[1])])
    check(tree, mesh)


def test_many_equal_triangles_are_halved() -> None:
    positions, triangles = soup(1)
    mesh = positions, np.repeat(triangles, 4000, axis=0)
    (tree,) = build(triangle_boxes(*mesh), [4000])
    check(tree, mesh)
    assert tree.depth <= 11


def test_the_larger_child_stands_right_behind_its_node() -> None:
    mesh = soup(700)
    (tree,) = build(triangle_boxes(*mesh), [700])
    extent = tree.boxes[:, :, 3:] - tree.boxes[:, :, :3]
    area = (extent * np.roll(extent, 1, axis=2)).sum(axis=2)
    inner = np.flatnonzero((tree.children >= 0).all(axis=1))
    larger = tree.children[inner, np.argmax(area[inner], axis=1)]
    assert len(inner) > 100
    np.testing.assert_array_equal(larger, inner + 1)


def test_huge_and_tiny_triangles_share_a_tree() -> None:
    positions, triangles = soup(400)
    positions[::7] *= 1e12
    positions[1::5] *= 1e-30
    (tree,) = build(triangle_boxes(positions, triangles), [len(triangles)])
    check(tree, (positions, triangles))


def test_trees_of_several_meshes_are_those_of_each() -> None:
    meshes = [soup(300), soup(0), sphere(20), soup(1)]
    boxes = [triangle_boxes(*mesh) for mesh in meshes]
    together = build(np.concatenate(boxes, axis=1), [len(mesh[1]) for mesh in meshes])
    for tree, mesh, box in zip(together, meshes, boxes, strict=True):
        check(tree, mesh)
        (alone,) = build(box, [len(mesh[1])])
        assert alone.depth == tree.depth


def test_objects_are_alone_in_their_leaves() -> None:
    mesh = soup(500)
    (tree,) = build(triangle_boxes(*mesh), [500], 1)
    check(tree, mesh)
    assert len(tree.children) == 499


def test_a_refitted_tree_has_the_boxes_of_what_has_moved() -> None:
    """Every box is that of the triangles below it, where they are now; one that has not moved keeps its boxes."""
    positions, triangles = sphere(12)
    (tree,) = build(triangle_boxes(positions, triangles), [len(triangles)])
    np.testing.assert_array_equal(refit(tree, triangle_boxes(positions, triangles)).boxes, tree.boxes)
    moved = (positions + np.random.default_rng(1).normal(0, 0.3, positions.shape)).astype(np.float32)
    found = refit(tree, triangle_boxes(moved, triangles))

    def below(reference: int) -> list[int]:
        if reference >= 0:
            return [one for child in tree.children[reference] for one in below(int(child))]
        first, more = divmod(-1 - reference, LEAF)
        return [int(triangle) for triangle in tree.order[first : first + more + 1]]

    for node, children in enumerate(tree.children):
        for side, child in enumerate(children):
            corners = moved[triangles[below(int(child))]].reshape(-1, 3)
            np.testing.assert_array_equal(found.boxes[node, side], [*corners.min(axis=0), *corners.max(axis=0)])


def test_boxes_are_rounded_outwards() -> None:
    mesh = sphere(30)
    (tree,) = build(triangle_boxes(*mesh), [len(mesh[1])])
    grid = _grid(tree.boxes)
    rows = _node_rows(tree.boxes, tree.children, grid).reshape(-1, 2, 4).astype(np.int64)
    low, scale = grid.astype(np.float64)
    for side, shift in enumerate((0, 16)):
        cells = (rows[:, :, :3] >> shift) & 0xFFFF
        assert (cells[:, 0] / scale + low < tree.boxes[:, side, :3]).all()
        assert (cells[:, 1] / scale + low > tree.boxes[:, side, 3:]).all()
    np.testing.assert_array_equal(rows[:, :, 3], tree.children)


def surface_cost(tree: Tree) -> float:
    """Expected nodes and triangles that a ray visits which hits the box of all."""
    extent = tree.boxes[..., 3:] - tree.boxes[..., :3]
    area = (extent * np.roll(extent, 1, axis=-1)).sum(axis=-1)
    whole = tree.boxes[tree.root, :, 3:].max(axis=0) - tree.boxes[tree.root, :, :3].min(axis=0)
    counts = np.where(tree.children < 0, (-1 - tree.children) % LEAF + 1, 1)
    return float((area * counts).sum() / (whole * np.roll(whole, 1)).sum())


def test_the_cost_grows_with_the_logarithm_of_the_number() -> None:
    costs = []
    for side in (20, 40, 80, 160):
        mesh = sphere(side)
        (tree,) = build(triangle_boxes(*mesh), [len(mesh[1])])
        costs.append(surface_cost(tree))
    steps = np.diff(costs)  # a fourfold number each
    assert steps.max() < 1.5 * steps.min()
    assert costs[-1] < 50
