"""The buffers behind inputs of `SceneData`, in the layouts of `scene.glsl`. No GL.

An instance is an object of the scene, with the same number. Triangles are numbered within their mesh, in the order of
the packed indices, as in `gl_PrimitiveID` of a geometry pass.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import reduce
from itertools import combinations
from operator import or_
from typing import NamedTuple, TypeAlias

import numpy as np
import numpy.typing as npt

from rendergraph.facts import SceneDataFacts
from rendergraph.scene.model import ImageSource, Scene, Texture
from rendergraph.scene.pack import SLOTS, PackedScene, Records, slot_count
from rendergraph.scene.tree_data import most_bytes
from rendergraph.textures import FORMATS, TextureDesc

_FLAGS = (
    *("casts_shadow", "hidden", "double_sided", "masked", "blended", "mirrored", "unlit"),
    *("has_tangents", "has_uv0", "has_uv1", "transmits", "shadow_catcher"),
)
FLAGS = {name: 1 << bit for bit, name in enumerate(_FLAGS)}
"""Bits of an instance's flags, in GLSL `SCENE_CASTS_SHADOW` and so on."""

INSTANCE_DATA = np.dtype(
    [("rows", "<f4", (3, 4))]
    + [(name, "<i4") for name in ("material", "mesh", "flags", "first_index", "base_vertex", "triangles")]
    + [("first_emitter", "<i4"), ("padding", "<i4"), ("box_center", "<f4", 4), ("box_extent", "<f4", 4)]
)
"""`SceneInstance`: rows of the affine object-to-world matrix, indices, flags, location of the geometry, and box."""
EMITTER = np.dtype([("instance", "<i4"), ("triangle", "<i4")])

_OPTIONAL = {"tangents": 4, "uv0": 2, "uv1": 2, "colors": 4}
"""Optional vertex streams, which follow positions and normals, with their widths."""

MOST_ARRAYS = 5
"""Maximum number of texture arrays of a scene, so that they fit into a stage's 16 units with a step's textures."""
_MOST_ADDED, _MOST_LAYERS = 1 << 22, 2048  # bytes, and layers that all devices have
BORDER = 1
"""Texels of border around an image in its layer, which continue it by its wrap modes, for filtering."""
_WRAPS = ("repeat", "mirror", "clamp")
_LIGHT_FILES = (".hdr", ".exr")

Stored: TypeAlias = tuple[ImageSource, bool, str, str]
"""An image in a layer of its own: the image, whether it is sRGB, and its wrap modes along s and t."""


class TextureArrays(NamedTuple):
    """The arrays for a scene's textures, the array and layer of each, and the number smaller than their layer.

    Textures with the same format and size share an array. Arrays of the same format, all of which shaders sample, are
    joined while this adds at most 4 MiB or there are more than `MOST_ARRAYS`, those first that add the fewest bytes. A
    smaller image fills a corner of its layer.
    """

    arrays: tuple[TextureDesc, ...]
    places: Mapping[Stored, tuple[int, int]]
    smaller: int


def stored(texture: Texture) -> Stored:
    return texture.image, texture.srgb, texture.wrap_s, texture.wrap_t


def used_textures(scene: Scene) -> dict[Stored, Texture]:
    """Return the textures in the arrays: those of all materials that objects use."""
    used = sorted({placed.material for placed in scene.objects})
    return {stored(texture): texture for number in used for texture in scene.materials[number].textures.values()}


def expected_arrays(scene: Scene) -> TextureArrays:
    """Return the arrays that file headers suggest, before anything is decoded.

    Images with more than 8 bits per channel that are not HDR or EXR files, and those of plugins, may differ.
    """
    descs = {}
    for key, texture in used_textures(scene).items():
        light = texture.image.path.suffix.lower() in _LIGHT_FILES
        format_name = "rgba16f" if light else "srgb8_a8" if texture.srgb else "rgba8"
        descs[key] = TextureDesc("texture2d", format_name, *(texture.image.size or (1, 1)))
    return texture_arrays(descs)


def texture_arrays(descs: Mapping[Stored, TextureDesc]) -> TextureArrays:
    """Return arrays for images of these formats and sizes."""
    groups: dict[tuple[str, int, int], list[Stored]] = {}
    for key, desc in descs.items():
        groups.setdefault((desc.format, desc.width, desc.height), []).append(key)
    while pairs := [
        (a, b) for a, b in combinations(groups, 2) if a[0] == b[0] and len(groups[a]) + len(groups[b]) <= _MOST_LAYERS
    ]:
        one, other = min(pairs, key=lambda pair: _added_bytes(pair, groups))
        if len(groups) <= MOST_ARRAYS and _added_bytes((one, other), groups) > _MOST_ADDED:
            break
        joined = groups.pop(one) + groups.pop(other)
        groups.setdefault((one[0], max(one[1], other[1]), max(one[2], other[2])), []).extend(joined)
    arrays = [
        TextureDesc("texture2d_array", name, width + 2 * BORDER, height + 2 * BORDER, layers=len(keys))
        for (name, width, height), keys in groups.items()
    ]
    places = {key: (a, layer) for a, keys in enumerate(groups.values()) for layer, key in enumerate(keys)}
    smaller = sum(descs[key].size != (width, height) for (_, width, height), keys in groups.items() for key in keys)
    return TextureArrays(tuple(arrays), places, smaller)


def _added_bytes(pair: Sequence[tuple[str, int, int]], groups: Mapping[tuple[str, int, int], list[Stored]]) -> int:
    """Return the additional bytes if two groups are merged."""
    (name, a, b), (_, c, d) = pair
    one, other = (len(groups[each]) for each in pair)
    return FORMATS[name].bytes * (max(a, c) * max(b, d) * (one + other) - a * b * one - c * d * other)


def texture_data(scene: Scene, sizes: Mapping[Stored, tuple[int, int]], arrays: TextureArrays) -> npt.NDArray[np.int32]:
    """Return int32 (m, 8, 4) for the slots of each material.

    They are array (-1 without a texture), layer, `width | height << 16`, and bits: UV set, 2 for an unfiltered
    texture, and from the third and fifth bit on the wrap modes along s and t: 0 repeat, 1 mirror, 2 clamp.
    """
    table = np.full((len(scene.materials), slot_count(scene.materials), 4), (-1, 0, 0, 0), np.int32)
    for number, material in enumerate(scene.materials):
        for slot, texture in material.textures.items():
            key = stored(texture)
            if key in arrays.places:
                width, height = sizes[key]
                bits = texture.uv | (texture.mag_filter == "nearest") << 1
                bits |= _WRAPS.index(texture.wrap_s) << 2 | _WRAPS.index(texture.wrap_t) << 4
                table[number, SLOTS.index(slot)] = (*arrays.places[key], width | height << 16, bits)
    return table


def scene_data_facts(scene: Scene, rays: bool = False) -> SceneDataFacts:
    """Return facts about inputs of `SceneData` in this scene, with `rays` if any of them traces."""
    vertices = sum(len(mesh.positions) for mesh in scene.meshes)
    width = _vertex_floats([name for name in _OPTIONAL if any(getattr(m, name) is not None for m in scene.meshes)])
    emitters = sum(len(scene.meshes[scene.objects[number].mesh].indices) for number in emitting_objects(scene))
    textures = expected_arrays(scene)
    trees = most_bytes(scene) if rays else 0
    return SceneDataFacts(
        bytes=16 * -(-width // 4) * vertices
        + INSTANCE_DATA.itemsize * len(scene.objects)
        + EMITTER.itemsize * emitters
        + 16 * slot_count(scene.materials) * len(scene.materials) * bool(textures.arrays)
        + sum(desc.bytes for desc in textures.arrays)
        + trees,
        trees=trees,
        textures=textures.arrays,
        smaller=textures.smaller,
        triangles=sum(len(scene.meshes[placed.mesh].indices) for placed in scene.objects),
        emitters=emitters,
    )


def posing_figures(scene: Scene) -> dict[str, int]:
    """Return the numbers of posed meshes and vertices, and their bytes beyond the streams that steps read.

    The bytes are for the vertices at rest, and for previous positions if a pass reads them.
    """
    deforms = {id(placed.pose): placed.pose.deform for placed in scene.objects if placed.pose is not None}.values()
    arrays = [
        array for one in deforms for array in (*one.rest.values(), *one.targets.values(), one.joints, one.weights)
    ]
    size = sum(array.nbytes for array in arrays) + 12 * sum(len(mesh.positions) for mesh in scene.meshes)
    return {"meshes": len(deforms), "vertices": sum(len(one.joints) for one in deforms), "bytes": size}


def emitting_objects(scene: Scene) -> list[int]:
    """Return the visible objects whose triangles emit light in any frame."""
    emits = [scene.emits(material) for material in scene.materials]
    return [n for n, placed in enumerate(scene.objects) if emits[placed.material] and not placed.hidden]


def data_macros(scene: Scene, packed: PackedScene, arrays: TextureArrays) -> dict[str, str]:
    """Return the macros of steps that read the scene's data."""
    facts = scene_data_facts(scene)
    macros = {
        "SCENE_DATA": "1",
        "SCENE_INSTANCE_COUNT": str(len(scene.objects)),
        "SCENE_TRIANGLE_COUNT": str(facts.triangles),
        "SCENE_EMITTER_COUNT": str(facts.emitters),
        **{f"SCENE_{name.upper()}": str(bit) for name, bit in FLAGS.items()},
    }
    used_streams = [name for name in _OPTIONAL if getattr(packed, name) is not None]
    macros |= {
        f"SCENE_{name.upper()}_STREAM": str(_vertex_floats(used_streams[:number]))  # its first float
        for number, name in enumerate(used_streams)
    }
    macros["SCENE_VERTEX_ROWS"] = str(-(-_vertex_floats(used_streams) // 4))
    if arrays.arrays:
        macros |= {"SCENE_TEXTURES": "1", "SCENE_ARRAY_COUNT": str(len(arrays.arrays))}
    used = dict.fromkeys(SLOTS, 0)
    for material in scene.materials:
        for slot, texture in material.textures.items():
            used[slot] |= 1 << arrays.places[stored(texture)][0] if stored(texture) in arrays.places else 0
    macros |= {f"SCENE_{slot.upper()}_ARRAYS": str(bits) for slot, bits in used.items() if bits}
    if any(map(scene.has_grain, scene.materials)):
        macros["SCENE_GRAIN"] = "1"
    for number in sorted({placed.material for placed in scene.objects}):
        macros |= {f"SCENE_ANY_{layer.upper()}": "1" for layer in scene.layers(scene.materials[number])}
    for mode, name in (("mask", "SCENE_ANY_MASKED"), ("blend", "SCENE_ANY_BLENDED")):
        if mode in packed.alpha_mode:
            macros[name] = "1"
    if packed.material_moved.any():
        macros["HAS_UV_TRANSFORM"] = "1"
    return macros


def vertex_data(packed: PackedScene) -> npt.NDArray[np.float32]:
    """Return the vertices, float32 (v, 4 rows): position, normal, and further streams that any mesh has."""
    found = [getattr(packed, name) for name in ("positions", "normals", *_OPTIONAL)]
    vertices = np.concatenate([stream for stream in found if stream is not None], axis=1)
    return np.pad(vertices, ((0, 0), (0, -vertices.shape[1] % 4)))


def _vertex_floats(streams: Sequence[str]) -> int:
    """Return the number of floats of position, normal and these streams."""
    return 6 + sum(_OPTIONAL[name] for name in streams)


def instance_data(scene: Scene, packed: PackedScene) -> Records:
    """Return an `INSTANCE_DATA` record for each object."""
    records = np.zeros(len(scene.objects), INSTANCE_DATA)
    records["mesh"] = packed.object_mesh
    meshes = packed.meshes[packed.object_mesh]
    for name in ("first_index", "base_vertex"):
        records[name] = meshes[name]
    records["triangles"] = meshes["count"] // 3
    records["first_emitter"] = -1
    emitting = emitting_objects(scene)
    counts = records["triangles"][emitting]
    records["first_emitter"][emitting] = np.cumsum(counts) - counts
    place_instances(records, scene, packed, np.arange(len(records)))
    return records


def place_instances(records: Records, scene: Scene, packed: PackedScene, numbers: npt.NDArray[np.int64]) -> None:
    """Write the fields that depend on these objects' transforms and materials into their `INSTANCE_DATA` records."""
    records["rows"][numbers] = packed.instances["rows"][numbers]
    records["material"][numbers] = packed.instances["ids"][numbers, 0]
    records["flags"][numbers] = [_flags(scene, number, packed) for number in numbers]
    records["box_center"][numbers, :3] = packed.centers[numbers]
    records["box_extent"][numbers, :3] = packed.extents[numbers] + packed.slack[numbers]


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
        # As in `features` for geometry passes: otherwise tangents are derived from texture coordinates.
        "has_tangents": mesh.tangents is not None and ("normal" in material.textures or scene.has_grain(material)),
        "has_uv0": mesh.uv0 is not None,
        "has_uv1": mesh.uv1 is not None,
        "transmits": "transmission" in scene.layers(material),
        "shadow_catcher": material.shadow_catcher,
    }
    return reduce(or_, (FLAGS[name] for name, yes in holds.items() if yes), 0)


def emitter_data(scene: Scene, packed: PackedScene) -> Records:
    """Return an `EMITTER` record for each triangle that emits light in any frame, in order within each object."""
    counts = [int(packed.meshes["count"][scene.objects[number].mesh]) // 3 for number in emitting_objects(scene)]
    records = np.zeros(sum(counts), EMITTER)
    records["instance"] = np.repeat(np.array(emitting_objects(scene), np.int32), counts)
    records["triangle"] = np.concatenate([np.zeros(0, np.int32), *(np.arange(n, dtype=np.int32) for n in counts)])
    return records
