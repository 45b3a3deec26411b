"""Pack a scene into arrays for the GPU: geometry streams, instance records, materials, lights and views.

Layouts are those of the GLSL structs in `shaders/include/` (std140: only vec4 and column-major mat4). Sizes in bytes:
`View` 448, `Light` 64, `MaterialData` 128 (208 with layers), an instance record 56.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt
from msgspec import Struct
from msgspec.structs import asdict, replace

from rendergraph.scene.model import Environment, Floats, Light, Material, Matrix, Mesh, Scene, changed_objects
from rendergraph.scene.scene_values import dielectric_f0, phong_of
from rendergraph.scene.triangles import find_edges, first_use, ordered
from rendergraph.steps import ViewMatrices

Records: TypeAlias = npt.NDArray[np.void]
Bools: TypeAlias = npt.NDArray[np.bool_]
Ints: TypeAlias = npt.NDArray[np.int32]
Doubles: TypeAlias = npt.NDArray[np.float64]

SLOTS = (
    *("base_color", "metallic_roughness", "normal", "occlusion"),
    *("emissive", "anisotropy", "specular", "specular_color"),
    *("clearcoat", "clearcoat_roughness", "clearcoat_normal", "sheen_color", "sheen_roughness"),
    *("iridescence", "iridescence_thickness", "transmission", "thickness"),
)
"""Texture slots in the order of a material's rows in `material_uvs`; slots of layers start at the ninth."""

_VEC4 = ("<f4", (4,))
INSTANCE = np.dtype([("rows", "<f4", (3, 4)), ("ids", "<i4", (2,))])
"""Rows of the affine object-to-world matrix (`in_object0`…`2`), material and object index (`in_ids`)."""
MESH = np.dtype(
    [("first_index", "<u4"), ("count", "<u4"), ("base_vertex", "<i4"), ("vertices", "<u4")]
    + [(name, "<f4", (3,)) for name in ("low", "high")]
)
"""The location of a mesh in the streams: first index, index count, base vertex, vertex count, and its box."""
_MATERIAL_ROWS = "base_color emissive surface specular extra phong_diffuse phong_specular phong_ambient"
MATERIAL = np.dtype([(name, *_VEC4) for name in _MATERIAL_ROWS.split()])
_LAYER_ROWS = "clearcoat sheen iridescence transmission absorption"
LAYERED_MATERIAL = np.dtype([(name, *_VEC4) for name in (*_MATERIAL_ROWS.split(), *_LAYER_ROWS.split())])
"""The records of scenes in which a material has a layer (`LAYERED_MATERIALS`)."""
ENVIRONMENT = np.dtype([(name, *_VEC4) for name in ("environment_transform", "environment_projection")])
LIGHT = np.dtype([(name, *_VEC4) for name in ("position", "color", "direction", "cone")])
_MATRICES = "view projection view_projection inverse_view inverse_projection inverse_view_projection"
_MATRIX = ("<f4", (4, 4))
VIEW = np.dtype(
    [(name, *_MATRIX) for name in _MATRICES.split()]
    + [(name, *_VEC4) for name in ("eye", "viewport", "range", "jitter")]
)
_ROUNDING = 4 * 2.0**-23  # error of a sum of four products in float32, relative to their sizes
_FARTHEST_EYE = 1e9  # metres; a more distant eye is treated as a direction
_WIDTHS = {"positions": 3, "normals": 3, "tangents": 4, "uv0": 2, "uv1": 2, "colors": 4}
_LIGHT_TYPES = {"directional": 0.0, "point": 1.0, "spot": 2.0}


class PackedScene(Struct, frozen=True, eq=False):
    """The arrays of a scene. v vertices, i indices, n objects, m materials.

    Attributes:
        positions, normals: float32 (v, 3).
        tangents: float32 (v, 4), zero for meshes without; None if no mesh has tangents. The same holds for `uv0`,
            `uv1` (v, 2) and `colors` (v, 4), which are white for meshes without.
        indices: uint32 (i,), relative to the mesh's base vertex, three per triangle.
        instances: one per object, in the scene's order; a draw of non-consecutive objects gathers their records.
        material_uvs: float32 (m, 2 s, 4): per material two rows (a, b, c, 0) of the uv transform for each of s =
            `slot_count` slots.
        material_moved: bool (m,), whether any slot's transform is not the identity (`HAS_UV_TRANSFORM`).
        mirrored: bool (n,), the transform reverses the winding (determinant below 0).
        centers, extents: float64 (n, 3), centres and half sizes of world-space bounding boxes.
        slack: float64 (n, 1), metres by which rounding may move an object's vertices on the GPU.
        vertex_orders: by animated mesh, the index in the mesh of each packed vertex.
    """

    positions: Floats
    normals: Floats
    tangents: Floats | None
    uv0: Floats | None
    uv1: Floats | None
    colors: Floats | None
    indices: npt.NDArray[np.uint32]
    meshes: Records
    instances: Records
    materials: Records
    material_uvs: Floats
    material_moved: Bools
    lights: Records
    environment: Records
    object_mesh: Ints
    mirrored: Bools
    casts_shadow: Bools
    hidden: Bools
    double_sided: Bools
    alpha_mode: tuple[str, ...]
    centers: Doubles
    extents: Doubles
    slack: Doubles
    names: tuple[str, ...]
    vertex_orders: Mapping[int, npt.NDArray[np.int64]] = {}


def pack(scene: Scene) -> PackedScene:
    """Pack a scene for the GPU, with triangles in vertex-cache order and vertices in the order of first use."""
    orders = [first_use(ordered(mesh.positions, mesh.indices), len(mesh.positions)) for mesh in scene.meshes]
    vertices = [old for old, _ in orders]
    streams = {name: _stream(scene.meshes, vertices, name, width) for name, width in _WIDTHS.items()}
    records = np.zeros(len(scene.meshes), MESH)
    first, base = 0, 0
    for record, mesh, (old, triangles) in zip(records, scene.meshes, orders, strict=True):
        low, high = mesh.box
        record["first_index"], record["count"], record["base_vertex"] = first, triangles.size, base
        record["vertices"], record["low"], record["high"] = len(old), low, high
        first, base = first + triangles.size, base + len(old)
    indices = np.concatenate([np.zeros(0, np.uint32), *(triangles.reshape(-1) for _, triangles in orders)])
    columns: dict[str, Any] = {**streams, **_materials(scene), **_placed(scene, records)}
    return PackedScene(
        indices=indices,
        meshes=records,
        lights=pack_lights(scene.lights),
        environment=pack_environment(scene.environment),
        vertex_orders={placed.mesh: vertices[placed.mesh] for placed in scene.objects if placed.pose is not None},
        **columns,
    )


def with_adjacency(packed: PackedScene) -> tuple[npt.NDArray[np.uint32], Records]:
    """Return indices of triangles with adjacency, six for each triangle, and the `MESH` records that locate them.

    Each corner's index is followed by that of the vertex across the edge to the next corner. Meshes that are not
    closed have none.
    """
    records = packed.meshes.copy()
    parts = [np.zeros(0, np.uint32)]
    first = 0
    for record in records:
        vertices = packed.positions[record["base_vertex"] :][: record["vertices"]]
        triangles = packed.indices[record["first_index"] :][: record["count"]].reshape(-1, 3)
        edges = find_edges(vertices, triangles)
        parts.append(np.stack([edges.triangles, edges.beyond], axis=2).astype(np.uint32).reshape(-1))
        record["first_index"], record["count"] = first, parts[-1].size
        first += parts[-1].size
    return np.concatenate(parts), records


def blocks(packed: PackedScene) -> dict[str, Records | Floats]:
    """Return the tables that shaders read, by the names of their blocks."""
    tables = {"light_block": packed.lights, "material_block": packed.materials, "environment_block": packed.environment}
    return {**tables, "material_uv_block": packed.material_uvs} if packed.material_moved.any() else {**tables}


def update(packed: PackedScene, before: Scene, scene: Scene) -> PackedScene:
    """Return the packed scene of a later frame: the same geometry with new objects, materials and lights.

    Parts that are identical in the scene `before` are not packed again.
    """
    changed: dict[str, Any] = {}
    if scene.lights is not before.lights:
        changed["lights"] = pack_lights(scene.lights)
    if scene.environment is not before.environment:
        changed["environment"] = pack_environment(scene.environment)
    if scene.materials is not before.materials:
        changed |= _materials(scene)
    if scene.objects is not before.objects:
        changed |= _moved(packed, before, scene)
    return replace(packed, **changed)


def _moved(packed: PackedScene, before: Scene, scene: Scene) -> dict[str, Any]:
    """Return the packed fields of objects: records of moved objects are rebuilt, the others copied."""
    was, now = before.objects, scene.objects
    moved = changed_objects(before, scene)
    free = {"transform": 0, "extra": 0, "pose": 0}
    if any(asdict(was[number]) | free != asdict(now[number]) | free for number in moved):
        return _placed(scene, packed.meshes)
    made = _placed(replace(scene, objects=tuple(now[number] for number in moved)), packed.meshes)
    made["instances"]["ids"][:, 1] = moved
    changed = {}
    for name in ("instances", "mirrored", "centers", "extents", "slack"):
        changed[name] = getattr(packed, name).copy()
        changed[name][moved] = made[name]
    return changed


def _materials(scene: Scene) -> dict[str, Any]:
    uvs, moved = pack_material_uvs(scene.materials)
    layered = any(map(scene.layers, scene.materials))
    return {"materials": pack_materials(scene.materials, layered), "material_uvs": uvs, "material_moved": moved}


def _placed(scene: Scene, meshes: Records) -> dict[str, Any]:
    objects = scene.objects
    mesh = np.array([entry.mesh for entry in objects], np.int32)
    material = np.array([entry.material for entry in objects], np.int32)
    transforms = np.array([entry.transform for entry in objects], np.float64).reshape(-1, 4, 4)
    instances = np.zeros(len(objects), INSTANCE)
    instances["rows"] = transforms[:, :3, :]
    instances["ids"] = np.stack([material, np.arange(len(objects), dtype=np.int32)], axis=1)
    low, high = meshes["low"][mesh].astype(np.float64), meshes["high"][mesh].astype(np.float64)
    for number, entry in enumerate(objects):
        if entry.pose is not None:
            low[number], high[number] = entry.pose.box
    linear, place = transforms[:, :3, :3], transforms[:, :3, 3]
    sizes = np.einsum("nij,nj->ni", np.abs(linear), np.maximum(np.abs(low), np.abs(high))) + np.abs(place)
    return {
        "instances": instances,
        "object_mesh": mesh,
        "mirrored": np.linalg.det(transforms[:, :3, :3]) < 0,
        "casts_shadow": np.array([entry.casts_shadow for entry in objects], bool),
        "hidden": np.array([entry.hidden for entry in objects], bool),
        "double_sided": np.array([scene.materials[entry.material].double_sided for entry in objects], bool),
        "alpha_mode": tuple(scene.materials[entry.material].alpha_mode for entry in objects),
        "centers": np.einsum("nij,nj->ni", linear, (low + high) / 2) + place,
        "extents": np.einsum("nij,nj->ni", np.abs(linear), (high - low) / 2),
        "slack": _ROUNDING * sizes.max(axis=1, keepdims=True),
        "names": tuple(entry.name for entry in objects),
    }


def _stream(meshes: Sequence[Mesh], orders: Sequence[npt.NDArray[np.int64]], name: str, width: int) -> Floats | None:
    """Return one attribute of all meshes, concatenated; None if no mesh has it (positions and normals always exist)."""
    if name not in ("positions", "normals") and all(getattr(mesh, name) is None for mesh in meshes):
        return None
    stream = np.full((sum(map(len, orders)), width), 1.0 if name == "colors" else 0.0, np.float32)
    at = 0
    for mesh, old in zip(meshes, orders, strict=True):
        values = getattr(mesh, name)
        if values is not None:
            np.take(values, old, axis=0, out=stream[at : at + len(old)])
        at += len(old)
    return stream


def slot_count(materials: Sequence[Material]) -> int:
    """Return how many `SLOTS` a scene's tables have: all if a layer has a texture, else the first eight."""
    return len(SLOTS) if any(slot in SLOTS[8:] for material in materials for slot in material.textures) else 8


def pack_materials(materials: Sequence[Material], layered: bool = False) -> Records:
    """Return `MaterialData` records (shaders/include/materials.glsl), with fields of layers if `layered`."""
    table = np.zeros(len(materials), LAYERED_MATERIAL if layered else MATERIAL)
    for record, material in zip(table, materials, strict=True):
        ambient, diffuse, specular, n = phong_of(material)
        record["base_color"] = material.base_color
        record["emissive"] = (*material.emissive, material.alpha_cutoff)
        record["surface"] = (material.metallic, material.roughness, material.occlusion_strength, material.normal_scale)
        record["specular"] = (*material.specular_color, material.specular)
        record["extra"] = (dielectric_f0(material.ior), material.anisotropy_strength, material.anisotropy_rotation, 0.0)
        record["phong_diffuse"] = (*diffuse, n)
        record["phong_specular"] = (*specular, 0.0)
        record["phong_ambient"] = (*ambient, 0.0)
        if layered:
            # Transmittance over a metre is exp(-absorption), which would be infinite for black.
            left = np.maximum(material.attenuation_color, 1e-6)
            record["clearcoat"] = (material.clearcoat, material.clearcoat_roughness, material.clearcoat_normal_scale, 0)
            record["sheen"] = (*material.sheen_color, material.sheen_roughness)
            record["iridescence"] = (material.iridescence, material.iridescence_ior, *material.iridescence_thickness)
            record["transmission"] = (material.transmission, material.thickness, material.dispersion, material.ior)
            record["absorption"][:3] = -np.log(left) / material.attenuation_distance
    return table


def pack_material_uvs(materials: Sequence[Material]) -> tuple[Floats, Bools]:
    """Return two rows (a, b, c, 0) per slot and material, `u' = a·u + b·v + c`, and which materials need them."""
    slots = slot_count(materials)
    rows = np.zeros((len(materials), slots, 2, 4), np.float32)
    rows[:, :, 0, 0] = rows[:, :, 1, 1] = 1.0
    moved = np.zeros(len(materials), bool)
    for number, material in enumerate(materials):
        for slot, texture in material.textures.items():
            if texture.transform is not None:
                rows[number, SLOTS.index(slot), :, :3] = np.reshape(texture.transform, (2, 3))
                moved[number] = True
    return rows.reshape(len(materials), 2 * slots, 4), moved


def pack_lights(lights: Sequence[Light]) -> Records:
    """Return `Light` records (shaders/include/lights.glsl), in the scene's order."""
    table = np.zeros(len(lights), LIGHT)
    if not lights:
        return table
    kinds = np.array([_LIGHT_TYPES[light.type] for light in lights])
    is_directional, is_spot = (kinds == _LIGHT_TYPES[kind] for kind in ("directional", "spot"))
    position, direction, color = (
        np.array([getattr(light, key) for light in lights], np.float64) for key in ("position", "direction", "color")
    )
    table["position"][:, :3] = np.where(is_directional[:, None], -direction, position)
    table["position"][:, 3] = ~is_directional
    table["color"][:, :3] = color * np.array([[light.intensity] for light in lights], np.float64)
    table["color"][:, 3] = [1 / light.range if light.range else 0.0 for light in lights]
    table["direction"][:, :3], table["direction"][:, 3] = direction, kinds
    inner, outer = np.cos(np.array([(light.inner, light.outer) for light in lights], np.float64)).T
    scale = 1 / np.maximum(0.001, inner - outer)
    table["cone"][:, :2] = np.where(is_spot[:, None], np.stack([scale, -outer * scale], axis=-1), (0.0, 1.0))
    return table


def reversed_projection(view: ViewMatrices) -> Matrix:
    """Return a view's projection with reversed z: 0 at the far plane or infinity, and w at the near plane.

    Perspective compresses distant depths near 0, where float32 is most precise (Lapidous and Jiao, "Optimal Depth
    Buffer for Low-Cost Graphics Hardware", 1999).
    """
    matrix = view.projection.copy()
    matrix[2] = (matrix[3] - matrix[2]) / 2
    if math.isinf(view.far):  # a standard projection needs a margin, or rounding would clip at infinity
        matrix[2] -= matrix[3] * (matrix[2, 2] / matrix[3, 2])
    return matrix


def pack_environment(environment: Environment | None) -> Records:
    """Return the `environment_block` (shaders/include/environment.glsl): rotation, factor and projection."""
    turn, intensity = (environment.rotate, environment.intensity) if environment is not None else (0.0, 1.0)
    record = np.zeros(1, ENVIRONMENT)
    record["environment_transform"] = (np.cos(turn), np.sin(turn), intensity, 0.0)
    record["environment_projection"] = environment.projection if environment is not None else 0.0
    return record


def pack_view(view: ViewMatrices) -> bytes:
    """Return a `View` block (shaders/include/view.glsl), 448 bytes, computed in float64."""
    record = np.zeros((), VIEW)
    projection = reversed_projection(view)
    inverse_view, inverse_projection = np.linalg.inv(view.view), np.linalg.inv(projection)
    for name, matrix in (
        ("view", view.view),
        ("projection", projection),
        ("view_projection", projection @ view.view),
        ("inverse_view", inverse_view),
        ("inverse_projection", inverse_projection),
        ("inverse_view_projection", inverse_view @ inverse_projection),
    ):
        record[name] = matrix.T  # column-major
    # View rays meet where x, y and w are 0: at a point, or in a direction if they are parallel.
    center = inverse_view @ inverse_projection[:, 2]
    length = float(np.linalg.norm(center[:3]))
    parallel = abs(center[3]) * _FARTHEST_EYE < length
    record["eye"] = (*(center[:3] / (length if parallel else center[3])), 0.0 if parallel else 1.0)
    width, height = view.size
    record["viewport"] = (width, height, 1 / width, 1 / height)
    record["range"] = (view.near, view.far, *view.span)
    record["jitter"] = (*view.jitter, 0.0, 0.0)
    return record.tobytes()
