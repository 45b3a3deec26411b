"""Packed arrays: the same triangles in a better order, records as the shaders read them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from msgspec.structs import fields
from rendergraph.pipelines.shapes import mesh

from rendergraph.scene import animate, pack, scene_values
from rendergraph.scene.load import load
from rendergraph.scene.model import ImageSource, Light, Material, Mesh, Object, Scene, Texture
from rendergraph.scene.triangles import batch_acmr, first_use, morton, ordered, parts


def scene_of(meshes: Sequence[Mesh], **more: object) -> Scene:
    objects = tuple(Object(f"o{k}", k, 0, np.eye(4)) for k in range(len(meshes)))
    return Scene("s", objects=objects, meshes=tuple(meshes), materials=(Material("m"),), **more)  # type: ignore[arg-type]  # further fields


def corners(found: Mesh) -> set[tuple[tuple[float, ...], ...]]:
    """Triangles as values, their three vertices with normals, started at the smallest one."""
    table = np.concatenate([found.positions, found.normals], axis=1)[found.indices]
    triangles = [[tuple(vertex) for vertex in row] for row in table.tolist()]
    return {min(tuple(row[k:] + row[:k]) for k in range(3)) for row in triangles}


def unpacked(packed: pack.PackedScene, number: int) -> Mesh:
    """A mesh as a draw would read it."""
    record = packed.meshes[number]
    first, count, base = int(record["first_index"]), int(record["count"]), int(record["base_vertex"])
    rows = slice(base, base + int(record["vertices"]))
    indices = packed.indices[first : first + count].reshape(-1, 3)
    return Mesh("m", packed.positions[rows], indices, packed.normals[rows])


@pytest.mark.slow
def test_triangles_survive_the_new_order() -> None:
    meshes = [mesh("sphere"), mesh("torus_knot"), mesh("box"), mesh("plane")]
    packed = pack.pack(scene_of(meshes))
    for number, found in enumerate(meshes):
        assert corners(unpacked(packed, number)) == corners(found)
    assert packed.positions.shape[0] == sum(len(np.unique(found.indices)) for found in meshes)


def test_vertices_are_in_the_order_of_first_use() -> None:
    packed = pack.pack(scene_of([mesh("torus")]))
    seen = np.unique(packed.indices, return_index=True)[1]
    assert (np.diff(seen) > 0).all()


def test_unused_vertices_drop_out() -> None:
    old, triangles = first_use(np.array([[5, 2, 9]], np.uint32), 10)
    assert old.tolist() == [5, 2, 9]
    assert triangles.tolist() == [[0, 1, 2]]


def test_streams_exist_where_any_mesh_has_them() -> None:
    ball = mesh("sphere")
    plain = Mesh("plain", ball.positions, ball.indices, ball.normals)
    packed = pack.pack(scene_of([plain, ball]))
    assert packed.colors is None
    assert packed.uv1 is None
    assert packed.uv0 is not None
    base = int(packed.meshes["base_vertex"][1])
    assert not packed.uv0[:base].any()
    assert packed.uv0[base:].any()
    assert pack.pack(scene_of([plain])).tangents is None


def test_an_empty_scene_packs() -> None:
    packed = pack.pack(Scene("empty"))
    assert packed.indices.shape == (0,)
    assert packed.positions.shape == (0, 3)
    assert len(packed.instances) == 0


def test_instances_and_object_facts() -> None:
    transform = np.array([[0, 0, -2, 1], [0, 1, 0, 2], [1, 0, 0, 3], [0, 0, 0, 1]], float)
    materials = (Material("a"), Material("b", double_sided=True, alpha_mode="blend"))
    objects = (
        Object("x", 0, 1, transform, casts_shadow=False),
        Object("y", 0, 0, np.diag([-1.0, 1, 1, 1]), hidden=True),
    )
    packed = pack.pack(Scene("s", objects=objects, meshes=(mesh("box"),), materials=materials))
    assert np.allclose(packed.instances["rows"][0], transform[:3])
    assert packed.instances["ids"].tolist() == [[1, 0], [0, 1]]
    assert packed.mirrored.tolist() == [False, True]
    assert packed.casts_shadow.tolist() == [False, True]
    assert packed.hidden.tolist() == [False, True]
    assert packed.double_sided.tolist() == [True, False]
    assert packed.alpha_mode == ("blend", "opaque")
    assert np.allclose(packed.centers[0], (1, 2, 3))


def test_update_changes_what_moves_and_shares_the_rest(tmp_path: Path) -> None:
    path = tmp_path / "a.yaml"
    path.write_text("scene: 1\nobjects: {b: {shape: box}}\nkeyframes: {objects.b.at: {0: [0, 0, 0], 1: [2, 0, 0]}}\n")
    scene = load(path)
    packed = pack.pack(scene)
    moved = pack.update(packed, scene, animate.at(scene, 0.5))
    assert moved.positions is packed.positions
    assert moved.instances["rows"][0, 0, 3] == 1
    assert packed.instances["rows"][0, 0, 3] == 0


def test_what_has_not_moved_is_not_packed_again(tmp_path: Path) -> None:
    path = tmp_path / "a.yaml"
    objects = "".join(f"  o{n}: {{shape: box, at: [{n}, 0, 0], scale: {1 + n % 3}}}\n" for n in range(40))
    moving = "  objects.o7.at: {0: [0, 0, 0], 1: [2, 5, 0]}\n  objects.o31.scale: {0: 1, 1: -2}\n"
    path.write_text(f"scene: 1\nobjects:\n{objects}keyframes:\n{moving}")
    scene = load(path)
    later = animate.at(scene, 1.0)
    whole = pack.pack(later)
    packed = pack.pack(scene)
    moved = pack.update(packed, scene, later)
    for field in fields(pack.PackedScene):
        np.testing.assert_array_equal(getattr(moved, field.name), getattr(whole, field.name), err_msg=field.name)
    assert moved.mirrored[31]
    assert not packed.mirrored.any()
    packed.instances["rows"][:] = 99
    copied = (pack.update(packed, scene, later).instances["rows"] == 99).all(axis=(1, 2))
    assert np.flatnonzero(~copied).tolist() == [7, 31]


def test_lights() -> None:
    lights = (
        Light("d", "directional", direction=(0, -1, 0), color=(1, 0.5, 0), intensity=2),
        Light("p", "point", position=(1, 2, 3), range=4),
        Light("s", "spot", position=(0, 5, 0), direction=(0, 0, -1), inner=0.2, outer=0.5),
    )
    table = pack.pack_lights(lights)
    assert table["position"][0].tolist() == [0, 1, 0, 0]
    assert table["color"][0].tolist() == [2, 1, 0, 0]
    assert table["position"][1].tolist() == [1, 2, 3, 1]
    assert table["color"][1, 3] == 0.25
    assert table["direction"][:, 3].tolist() == [0, 1, 2]
    assert table["cone"][1].tolist() == [0, 1, 0, 0]
    s, offset = table["cone"][2, :2]
    assert math.cos(0.2) * s + offset == pytest.approx(1, abs=1e-5)
    assert math.cos(0.5) * s + offset == pytest.approx(0, abs=1e-5)


def test_materials_in_std140() -> None:
    material = Material("m", (0.1, 0.2, 0.3, 0.4), 0.5, 0.6, (7, 8, 9), 0.8, 0.9, alpha_cutoff=0.25)
    (record,) = pack.pack_materials([material])
    flat = np.frombuffer(record.tobytes(), np.float32)
    assert len(flat) == 32
    assert np.allclose(flat[:12], (0.1, 0.2, 0.3, 0.4, 7, 8, 9, 0.25, 0.5, 0.6, 0.8, 0.9))
    assert flat[16] == pytest.approx(0.04)
    assert np.allclose(record["phong_diffuse"][:3], (0.05, 0.1, 0.15))
    assert np.allclose(record["phong_specular"][:3], 0.5 * 0.04 + 0.5 * np.array([0.1, 0.2, 0.3]))
    assert record["phong_diffuse"][3] == pytest.approx((2 / 0.6**4 - 2) / 4)


def test_uv_transforms() -> None:
    texture = Texture(ImageSource(Path("a.png")), False, transform=(1, 2, 3, 4, 5, 6))
    rows, moved = pack.pack_material_uvs([Material("a"), Material("b", textures={"normal": texture})])
    assert rows.shape == (2, 16, 4)
    assert moved.tolist() == [False, True]
    assert rows[1, 4:6].tolist() == [[1, 2, 3, 0], [4, 5, 6, 0]]
    assert rows[0, 0:2].tolist() == [[1, 0, 0, 0], [0, 1, 0, 0]]


@pytest.mark.parametrize("n", [0.5, 1, 12, 250, 1000])
def test_phong_and_roughness_are_inverse(n: float) -> None:
    assert scene_values.exponent(scene_values.roughness_of(n)) == pytest.approx(n)


def test_phong_of_an_obj_material_is_its_own() -> None:
    own = Material("m", ambient=(1, 0, 0), diffuse=(0, 1, 0), specular_phong=(0, 0, 1), shininess=3)
    assert scene_values.phong_of(own) == ((1, 0, 0), (0, 1, 0), (0, 0, 1), 3)


def shuffled(found: Mesh, seed: int = 0) -> np.ndarray:
    return found.indices[np.random.default_rng(seed).permutation(len(found.indices))]


def fifo_acmr(triangles: np.ndarray, size: int) -> float:
    """Cache misses for each triangle of a first-in first-out vertex cache."""
    entered: dict[int, int] = {}
    misses = 0
    for vertex in triangles.reshape(-1).tolist():
        when = entered.get(vertex)
        if when is None or misses - when >= size:
            entered[vertex] = misses
            misses += 1
    return misses / max(1, len(triangles))


def test_order_lowers_cache_misses() -> None:
    ball = mesh("sphere", segments=128, rings=64)
    mixed = shuffled(ball)
    better = ordered(ball.positions, mixed)
    assert fifo_acmr(mixed, 16) > 2.5
    assert fifo_acmr(better, 16) < 1
    assert fifo_acmr(better, 32) < 0.85
    assert sorted(map(tuple, better.tolist())) == sorted(map(tuple, mixed.tolist()))


def test_an_order_that_is_better_already_stays() -> None:
    ball = mesh("sphere", segments=128, rings=64)
    best = ordered(ball.positions, ball.indices)
    assert ordered(ball.positions, best) is best


def test_order_never_gets_worse_on_assets(shared: Path) -> None:
    for name in ("gltf/DamagedHelmet.glb", "gltf/WaterBottle/WaterBottle.gltf", "obj/bunny.obj", "sponza/Sponza.gltf"):
        for found in load(shared / "assets" / name).meshes:
            assert batch_acmr(ordered(found.positions, found.indices)) <= batch_acmr(found.indices)


def test_batch_acmr_of_known_lists() -> None:
    assert batch_acmr(np.arange(96, dtype=np.uint32).reshape(-1, 3)) == 3
    assert batch_acmr(np.tile(np.array([[0, 1, 2]], np.uint32), (32, 1))) == pytest.approx(3 / 32)


def test_parts_are_what_triangles_connect() -> None:
    rng = np.random.default_rng(5)
    triangles = rng.integers(0, 300, (90, 3)).astype(np.uint32)
    label = parts(triangles, 300)
    graph = {k: {k} for k in range(300)}
    for row in triangles.tolist():
        joined = set().union(*(graph[v] for v in row))
        for v in joined:
            graph[v] = joined
    for a in range(300):
        assert label[a] == min(graph[a])


def test_morton_interleaves_bits() -> None:
    points = np.array([[0, 0, 0], [1023, 0, 0], [0, 1023, 0], [0, 0, 1023], [1, 2, 4]], np.float32)
    codes = morton(points).tolist()
    assert codes[0] == 0
    assert codes[1] == int("001" * 10, 2)
    assert codes[2] == int("010" * 10, 2)
    assert codes[3] == int("100" * 10, 2)
    assert codes[4] == 0b100_010_001
