"""A scene as data for shaders: the buffers behind inputs of `SceneData`, in the layouts of `scene.glsl`. No GL.

An instance is an object of the scene, with the same number. Triangles are numbered within their mesh, in the order of
the packed indices, which is that of `gl_PrimitiveID` in a geometry pass.
"""

from __future__ import annotations

from functools import reduce
from operator import or_

import numpy as np
import numpy.typing as npt

from rendergraph.facts import SceneDataFacts
from rendergraph.scene.model import Scene
from rendergraph.scene.pack import PackedScene, Records

_FLAGS = (
    *("casts_shadow", "hidden", "double_sided", "masked", "blended", "mirrored", "unlit"),
    *("has_tangents", "has_uv0", "has_uv1"),
)
FLAGS = {name: 1 << bit for bit, name in enumerate(_FLAGS)}
"""Bits of an instance's flags, in GLSL `SCENE_CASTS_SHADOW` and so on."""

INSTANCE_DATA = np.dtype(
    [("rows", "<f4", (3, 4))]
    + [(name, "<i4") for name in ("material", "mesh", "flags", "first_index", "base_vertex", "triangles")]
    + [("first_emitter", "<i4"), ("padding", "<i4"), ("box_center", "<f4", 4), ("box_extent", "<f4", 4)]
)
"""`SceneInstance`: rows of the affine object-to-world matrix, indices, flags, where its geometry lies, and its box."""
EMITTER = np.dtype([("instance", "<i4"), ("triangle", "<i4")])

_OPTIONAL = {"tangents": 4, "uv0": 2, "uv1": 2, "colors": 4}
"""Vertex streams that a scene may lack, behind positions and normals, with their widths."""


def scene_data_facts(scene: Scene) -> SceneDataFacts:
    """Return what inputs of `SceneData` bring along in this scene."""
    corners = sum(len(mesh.indices) for mesh in scene.meshes)
    vertices = sum(len(mesh.positions) for mesh in scene.meshes)
    width = 6 + sum(size for name, size in _OPTIONAL.items() if any(getattr(m, name) is not None for m in scene.meshes))
    emitters = sum(len(scene.meshes[scene.objects[number].mesh].indices) for number in emitting_objects(scene))
    return SceneDataFacts(
        bytes=4 * width * vertices
        + 12 * corners
        + INSTANCE_DATA.itemsize * len(scene.objects)
        + EMITTER.itemsize * emitters,
        triangles=sum(len(scene.meshes[placed.mesh].indices) for placed in scene.objects),
        emitters=emitters,
    )


def emitting_objects(scene: Scene) -> list[int]:
    """Return the objects whose triangles emit light in some frame; hidden ones do not."""
    emits = [scene.emits(material) for material in scene.materials]
    return [n for n, placed in enumerate(scene.objects) if emits[placed.material] and not placed.hidden]


def data_macros(scene: Scene, packed: PackedScene) -> dict[str, str]:
    """Return the macros of steps that read the scene's data."""
    facts = scene_data_facts(scene)
    macros = {
        "SCENE_DATA": "1",
        "SCENE_INSTANCE_COUNT": str(len(scene.objects)),
        "SCENE_TRIANGLE_COUNT": str(facts.triangles),
        "SCENE_EMITTER_COUNT": str(facts.emitters),
        **{f"SCENE_{name.upper()}": str(bit) for name, bit in FLAGS.items()},
    }
    macros |= {f"SCENE_{name.upper()}_STREAM": "1" for name in _OPTIONAL if getattr(packed, name) is not None}
    if any(map(scene.has_grain, scene.materials)):
        macros["SCENE_GRAIN"] = "1"
    if packed.material_moved.any():
        macros["HAS_UV_TRANSFORM"] = "1"
    return macros


def vertex_data(packed: PackedScene) -> npt.NDArray[np.float32]:
    """Return the vertices, float32 (v, w): position, normal, and what else some mesh has."""
    found = [getattr(packed, name) for name in ("positions", "normals", *_OPTIONAL)]
    return np.concatenate([stream for stream in found if stream is not None], axis=1)


def instance_data(scene: Scene, packed: PackedScene) -> Records:
    """Return an `INSTANCE_DATA` record for each object."""
    records = np.zeros(len(scene.objects), INSTANCE_DATA)
    records["rows"] = packed.instances["rows"]
    records["material"], records["mesh"] = packed.instances["ids"][:, 0], packed.object_mesh
    records["flags"] = [_flags(scene, number, packed) for number in range(len(scene.objects))]
    meshes = packed.meshes[packed.object_mesh]
    for name in ("first_index", "base_vertex"):
        records[name] = meshes[name]
    records["triangles"] = meshes["count"] // 3
    records["box_center"][:, :3], records["box_extent"][:, :3] = packed.centers, packed.extents + packed.slack
    records["first_emitter"] = -1
    emitting = emitting_objects(scene)
    counts = records["triangles"][emitting]
    records["first_emitter"][emitting] = np.cumsum(counts) - counts
    return records


def _flags(scene: Scene, number: int, packed: PackedScene) -> int:
    placed = scene.objects[number]
    material, mesh = scene.materials[placed.material], scene.meshes[placed.mesh]
    holds = {
        "casts_shadow": placed.casts_shadow,
        "hidden": placed.hidden,
        "double_sided": material.double_sided,
        "masked": material.alpha_mode == "mask",
        "blended": material.alpha_mode == "blend",
        "mirrored": bool(packed.mirrored[number]),
        "unlit": material.unlit,
        # As `features` has it for geometry passes: elsewhere tangents follow from texture coordinates.
        "has_tangents": mesh.tangents is not None and ("normal" in material.textures or scene.has_grain(material)),
        "has_uv0": mesh.uv0 is not None,
        "has_uv1": mesh.uv1 is not None,
    }
    return reduce(or_, (FLAGS[name] for name, yes in holds.items() if yes), 0)


def emitter_data(scene: Scene, packed: PackedScene) -> Records:
    """Return an `EMITTER` record for each triangle that emits light in some frame, those of an object in order."""
    counts = [int(packed.meshes["count"][scene.objects[number].mesh]) // 3 for number in emitting_objects(scene)]
    records = np.zeros(sum(counts), EMITTER)
    records["instance"] = np.repeat(np.array(emitting_objects(scene), np.int32), counts)
    records["triangle"] = np.concatenate([np.zeros(0, np.int32), *(np.arange(n, dtype=np.int32) for n in counts)])
    return records
