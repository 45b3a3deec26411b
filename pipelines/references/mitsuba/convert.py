"""A scene and a camera as arrays and plain values, which the process with Mitsuba reads.

All objects are merged in world space: into one mesh of what emits no light, and one for each emissive material.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import groupby
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt
from msgspec.structs import asdict

from rendergraph.scene.animate import baked
from rendergraph.scene.model import ImageSource, MadeImage, Scene
from rendergraph.scene.pack import SLOTS, PackedScene, pack
from rendergraph.steps import ViewMatrices

Array: TypeAlias = npt.NDArray[Any]
Decode: TypeAlias = Callable[[ImageSource | MadeImage, bool], Array]
"""Return an image's linear values, (height, width, 4); the flag says whether its texels are sRGB encoded."""

_ROWS = ("base_color", "emissive", "surface", "specular", "extra")
_MODES = {"repeat": 0, "mirror": 1, "clamp": 2, "linear": 0, "nearest": 1, "opaque": 0, "mask": 1, "blend": 2}


def scene_values(scene: Scene, decode: Decode) -> tuple[dict[str, Any], dict[str, Array]]:
    """Return lights, meshes and environment; and the arrays of vertices, triangles, materials and images.

    A mesh has its emissive material, or -1, and the number of its first vertex and triangle, and of all of them.
    """
    scene = baked(scene)
    packed = pack(scene)
    arrays = {f"material.{name}": packed.materials[name] for name in _ROWS} | _textures(scene, packed, decode)
    for number, surface in enumerate(scene.materials):
        if surface.unlit:  # it emits its base colour and reflects nothing
            arrays["material.emissive"][number, :3] = surface.base_color[:3]
            arrays["material.base_color"][number, :3] = arrays["material.specular"][number, :] = 0
            if "slot.base_color" in arrays:
                slot = arrays.setdefault("slot.emissive", np.zeros_like(arrays["slot.base_color"]))
                slot[number] = arrays["slot.base_color"][number]
    glowing = np.any(arrays["material.emissive"][:, :3] > 0, axis=1)
    group_of = [one.material if glowing[one.material] else -1 for one in scene.objects]
    shown = sorted((n for n, one in enumerate(scene.objects) if not one.hidden), key=group_of.__getitem__)
    geometry, counts = _geometry(scene, packed, shown)
    meshes, first = [], np.zeros(2, np.int64)
    for material, group in groupby(zip(shown, counts, strict=True), lambda entry: group_of[entry[0]]):
        size = sum((count for _, count in group), np.zeros(2, np.int64))
        if size[1]:
            meshes.append({"material": material, "first": first.tolist(), "size": size.tolist()})
        first = first + size
    environment = None
    if scene.environment is not None:
        arrays["environment"] = decode(scene.environment.image, True)
        environment = {"rotate": scene.environment.rotate, "intensity": scene.environment.intensity}
    lights = [asdict(light) for light in scene.lights]
    return {"meshes": meshes, "lights": lights, "environment": environment}, arrays | geometry


def _geometry(scene: Scene, packed: PackedScene, shown: list[int]) -> tuple[dict[str, Array], Array]:
    """Return streams of vertices and triangles in world space, and each object's numbers of them, (n, 2).

    Streams of vertices are four floats wide: `position`, `normal`, `uv` of both sets, and where the scene has them
    `tangent` and `color`. Streams of triangles: `corners`, and `flags`: material, mode of alpha, double-sided, casts
    shadow.
    """
    records = packed.meshes[packed.object_mesh[shown]]
    counts = np.stack([records["vertices"], records["count"] // 3], axis=1).astype(np.int64)
    owner, face_owner = (np.repeat(np.arange(len(shown)), column) for column in counts.T)
    vertex, index = _ranges(records["base_vertex"], counts[:, 0]), _ranges(records["first_index"], 3 * counts[:, 1])
    transforms = np.array([scene.objects[number].transform for number in shown], np.float64).reshape(-1, 4, 4)
    linear = transforms[:, :3, :3]
    x, y, z = linear.swapaxes(0, 1)
    cofactors = np.stack([np.cross(y, z), np.cross(z, x), np.cross(x, y)], axis=1)
    sign = np.where(np.linalg.det(linear) < 0, -1.0, 1.0)
    normals = _applied(cofactors * sign[:, None, None], owner, packed.normals[vertex])
    streams = {
        "position": _applied(linear, owner, packed.positions[vertex]) + transforms[owner, :3, 3],
        "normal": normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-30),
    }
    if packed.tangents is not None:
        tangents = packed.tangents[vertex]
        handed = tangents[:, 3:] * sign[owner, None]
        streams["tangent"] = np.concatenate([_applied(linear, owner, tangents[:, :3]), handed], axis=1)
    if packed.colors is not None:
        streams["color"] = packed.colors[vertex]
    uvs = [np.zeros((len(vertex), 2)) if uv is None else uv[vertex] for uv in (packed.uv0, packed.uv1)]
    streams["uv"] = np.concatenate(uvs, axis=1)
    arrays: dict[str, Array] = {f"vertex.{name}": _padded(values) for name, values in streams.items()}
    first = np.cumsum(counts[:, 0]) - counts[:, 0]
    corners = (packed.indices[index].astype(np.int64) + np.repeat(first, 3 * counts[:, 1])).reshape(-1, 3)
    mirrored = (sign < 0)[face_owner]
    corners[mirrored] = corners[mirrored][:, [0, 2, 1]]
    flags = [
        [one.material, _MODES[scene.materials[one.material].alpha_mode], packed.double_sided[number], one.casts_shadow]
        for number, one in ((number, scene.objects[number]) for number in shown)
    ]
    arrays["corners"] = corners.astype(np.uint32)
    arrays["flags"] = np.array(flags, np.uint32).reshape(-1, 4)[face_owner]
    return arrays, counts


def _textures(scene: Scene, packed: PackedScene, decode: Decode) -> dict[str, Array]:
    """Return images, and for each slot a record of 16 floats for each material.

    Its fields: whether there is a texture, image, wrap modes of u and v, nearest, uv set, 2 unused, and the two rows of
    the transform of texture coordinates.
    """
    arrays: dict[str, Array] = {}
    numbers: dict[tuple[int, bool], int] = {}
    for number, material in enumerate(scene.materials):
        for slot, texture in material.textures.items():
            if slot == "occlusion":
                continue
            image = numbers.setdefault((id(texture.image), texture.srgb), len(numbers))
            if f"image.{image}" not in arrays:
                arrays[f"image.{image}"] = decode(texture.image, texture.srgb)
            modes = [_MODES[mode] for mode in (texture.wrap_s, texture.wrap_t, texture.mag_filter)]
            records = arrays.setdefault(f"slot.{slot}", np.zeros((len(scene.materials), 16), np.float32))
            records[number, :6] = 1, image, *modes, texture.uv
            records[number, 8:] = packed.material_uvs[number, 2 * SLOTS.index(slot) :][:2].ravel()
    return arrays


def camera_values(view: ViewMatrices) -> dict[str, Any]:
    """Return the rays of a view: `origin` and `direction` are three vectors (a, b, c) each, for a + b x + c y.

    x and y are 0 to 1 from the picture's left and top. Directions have length 1 along the view's axis.
    """
    to_world = np.linalg.inv(view.view)
    corners = np.array([[-1.0, 1, -1, 1], [1, 1, -1, 1], [-1, -1, -1, 1]])  # upper left, upper right, lower left
    points = corners @ np.linalg.inv(view.projection).T
    points = points[:, :3] / points[:, 3:]  # in the near plane
    if view.projection[3, 3]:  # parallel lines of sight
        origins, directions = points * [1, 1, 0], np.tile([0.0, 0, -1], (3, 1))
    else:
        origins, directions = np.zeros((3, 3)), points / -points[:, 2:]
    rows = origins @ to_world[:3, :3].T + to_world[:3, 3], directions @ to_world[:3, :3].T
    origin, direction = (np.concatenate([row[:1], row[1:] - row[0]]).tolist() for row in rows)
    return {"size": view.size, "origin": origin, "direction": direction, "near": view.near, "far": min(view.far, 1e30)}


def _ranges(first: Array, counts: Array) -> npt.NDArray[np.int64]:
    """Return the numbers of several ranges, one after the other."""
    starts = np.cumsum(counts) - counts
    return np.asarray(np.arange(int(counts.sum())) + np.repeat(first.astype(np.int64) - starts, counts), np.int64)


def _applied(matrices: Array, owner: Array, vectors: Array) -> Array:
    return np.asarray(np.einsum("nij,nj->ni", matrices[owner], vectors))


def _padded(values: Array) -> npt.NDArray[np.float32]:
    return np.pad(values, ((0, 0), (0, 4 - values.shape[1]))).astype(np.float32)
