"""The macros of scene, lights and batches in a step's program: one variant for each kind of batch."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from rendergraph.expand import CAMERA, ViewTable
from rendergraph.scene import pack
from rendergraph.scene.facts import selected
from rendergraph.scene.model import Material, Scene, Texture
from rendergraph.scene.pack import PackedScene
from rendergraph.scene.scene_data import data_macros, expected_arrays
from rendergraph.steps import Step

_BLOCKS = ("camera_block", "frame_block", "light_block", "material_block", "material_uv_block", "environment_block")
FIXED_BLOCKS = {name: binding for binding, name in enumerate(_BLOCKS)}
"""Binding points of the framework's blocks; view tables follow."""
LARGEST_BLOCK = 65536
"""Size of a uniform block in bytes on desktop drivers; OpenGL guarantees 16384."""


def variants(
    step: Step, scene: Scene, packed: PackedScene, views: Mapping[str, ViewTable], largest_block: int = LARGEST_BLOCK
) -> list[dict[str, str]]:
    """Return the `defines` of `stage_texts` for every program of a step.

    They are in the order in which the scene's objects first need them; none for a geometry step that draws nothing.
    Tables of more than `largest_block` bytes are storage blocks.
    """
    stored = storage_blocks(packed, largest_block)
    macros = light_macros(scene, stored)
    if step.kind in ("geometry", "draw"):
        macros["PASS_VIEW_COUNT"] = view_count(step, views)
    if step.reads_scene:
        macros |= scene_macros(scene, packed, stored) | data_macros(scene, packed, expected_arrays(scene))
    if step.kind != "geometry":
        return [macros]
    macros |= scene_macros(scene, packed, stored)
    found = []
    for index in select(scene, step):
        batch, _ = features(scene, index, step.materials)
        if macros | batch not in found:
            found.append(macros | batch)
    return found


def view_count(step: Step, views: Mapping[str, ViewTable]) -> str:
    return str(max(1, views[step.view or CAMERA].count))


def storage_blocks(packed: PackedScene, largest_block: int) -> frozenset[str]:
    """Return the scene's blocks that are too large for a uniform block."""
    return frozenset(name for name, records in pack.blocks(packed).items() if records.nbytes > largest_block)


def light_macros(scene: Scene, stored: Collection[str]) -> dict[str, str]:
    kinds = [light.type for light in scene.lights]
    macros = {"LIGHT_COUNT": str(len(kinds))}
    macros |= {f"LIGHT_{kind.upper()}S": str(kinds.count(kind)) for kind in ("directional", "point", "spot")}
    return macros | ({"LIGHT_STORAGE": "1"} if "light_block" in stored else {})


def scene_macros(scene: Scene, packed: PackedScene, stored: Collection[str]) -> dict[str, str]:
    """Return macros about objects and materials, for geometry steps; unused features are not compiled."""
    moving = {section for section, *_ in scene.tracks}
    textured = {slot for material in scene.materials for slot in material.textures}
    table, default = packed.materials, pack.pack_materials([Material("default")])
    same = (table["specular"] == default["specular"]).all() and (table["extra"] == default["extra"])[:, 0].all()
    slots = pack.slot_count(scene.materials)
    macros: dict[str, Any] = {
        "MATERIAL_COUNT": max(1, len(scene.materials)),
        "SCENE_POSED": bool(packed.vertex_orders),
        "UNIFORM_SCALE": not (moving & {"objects"} or scene.rigs) and _evenly_scaled(packed.instances["rows"]),
        "NO_EMISSIVE": "materials" not in moving and not table["emissive"][:, :3].any(),
        "DEFAULT_SPECULAR": "materials" not in moving and same and not textured & {"specular", "specular_color"},
        "LAYERED_MATERIALS": table.dtype == pack.LAYERED_MATERIAL,
        "MATERIAL_SLOTS": slots if slots > 8 else 0,
        "MATERIAL_STORAGE": "material_block" in stored,
        "MATERIAL_UV_STORAGE": "material_uv_block" in stored,
    }
    return {name: str(int(value)) for name, value in macros.items() if value}


def _evenly_scaled(rows: npt.NDArray[np.float32]) -> bool:
    """Return whether the matrices of all objects, (n, 3, 4), only rotate, translate and scale uniformly."""
    linear = rows[:, :, :3].astype(np.float64)
    products = np.einsum("nij,nkj->nik", linear, linear)
    size = np.trace(products, axis1=1, axis2=2)[:, None, None] / 3
    return bool((np.abs(products - size * np.eye(3)) <= 1e-5 * size).all())


def select(scene: Scene, step: Step) -> list[int]:
    """Return the objects that a step draws, in the scene's order or that of their names."""
    if isinstance(step.objects, str):
        return selected(scene, step.objects)
    names = {placed.name: number for number, placed in enumerate(scene.objects)}
    return [names[name] for name in step.objects]


def features(scene: Scene, index: int, level: str) -> tuple[dict[str, str], dict[str, Texture]]:
    """Return the macros and textures of an object's material for a shader with this `level`, animated or not.

    Only differences matter, so that otherwise equal objects share a batch.
    """
    placed = scene.objects[index]
    material, mesh = scene.materials[placed.material], scene.meshes[placed.mesh]
    defines: dict[str, str] = {}
    if level == "none":
        return defines, {}
    masked, full = material.alpha_mode == "mask", level == "full"
    found: dict[str, Texture] = {}
    for slot, texture in material.textures.items():
        used = full or (masked and slot == "base_color")
        if not used or (mesh.uv1 if texture.uv else mesh.uv0) is None:
            continue
        defines[f"HAS_{slot.upper()}_TEXTURE"] = "1"
        defines[f"{slot.upper()}_UV"] = str(texture.uv)
        defines[f"HAS_UV{texture.uv}"] = "1"
        if texture.transform is not None:
            defines["HAS_UV_TRANSFORM"] = "1"
        found[f"{slot}_texture"] = texture
    flags = {"ALPHA_MASK": masked, "HAS_VERTEX_COLOR": mesh.colors is not None and (masked or full)}
    if full:
        has_grain = scene.has_grain(material)
        is_bumpy = "normal" in material.textures or "clearcoat_normal" in material.textures
        flags |= {"ALPHA_BLEND": material.alpha_mode == "blend", "DOUBLE_SIDED": material.double_sided}
        flags |= {"UNLIT": material.unlit, "ANISOTROPIC": has_grain}
        flags |= {f"HAS_{layer.upper()}": True for layer in scene.layers(material)}
        flags["HAS_TANGENT"] = mesh.tangents is not None and (is_bumpy or has_grain)
    return defines | {name: "1" for name, holds in flags.items() if holds}, found
