"""The buffers and texture arrays behind inputs of `SceneData`, created when a step first reads them."""

from __future__ import annotations

from collections.abc import Mapping

from moderngl import Buffer
from msgspec import Struct

from rendergraph.errors import Problem, RenderError
from rendergraph.gl import textures
from rendergraph.gl.device import Device
from rendergraph.gl.textures import GpuTexture
from rendergraph.scene import scene_data
from rendergraph.scene.model import Scene
from rendergraph.scene.pack import PackedScene, Records
from rendergraph.scene.scene_data import BORDER, Stored, TextureArrays
from rendergraph.textures import Sampler

ARRAY = "scene_array_"
"""Prefix of the arrays' names in `scene.glsl`."""

VERTICES, INSTANCES, TREE = "scene_vertex_texels", "scene_instance_block", "scene_tree"
_INSTANCE_TEXELS = "scene_instance_texels"
TEXELS = frozenset({VERTICES, _INSTANCE_TEXELS, TREE})
"""Buffers that `scene.glsl` and `trace_tree.glsl` fetch as texels."""


class SceneBuffers(Struct, eq=False):
    """The scene's data on the GPU.

    Attributes:
        buffers: the buffers by their names in `scene.glsl`; the indices are those of geometry passes.
        texels: textures that fetch from them, by name.
        instances: the records that the instance buffer holds.
        arrays: the location of each texture in the arrays.
        textures: texture arrays by their names in `scene.glsl`; all use the same `sampler`.
    """

    device: Device
    buffers: dict[str, Buffer]
    texels: dict[str, int]
    instances: Records
    arrays: TextureArrays
    textures: dict[str, GpuTexture]
    sampler: int

    @classmethod
    def make(
        cls, device: Device, scene: Scene, packed: PackedScene, indices: Buffer, images: Mapping[Stored, GpuTexture]
    ) -> SceneBuffers:
        """Upload the missing buffers of a scene, and copy its uploaded images into arrays."""
        instances = scene_data.instance_data(scene, packed)
        found = scene_data.texture_arrays({key: image.desc for key, image in images.items()})
        sizes = {key: image.desc.size for key, image in images.items()}
        contents = {
            VERTICES: scene_data.vertex_data(packed).tobytes(),
            INSTANCES: instances.tobytes() + (scene_data.texture_data(scene, sizes, found).tobytes() if sizes else b""),
            "scene_emitter_block": scene_data.emitter_data(scene, packed).tobytes(),
        }
        for name, content in contents.items():
            check_size(device, name, len(content), texel=16 * (name in (VERTICES, INSTANCES)))
        buffers = {name: device.ctx.buffer(content or bytes(128)) for name, content in contents.items()}
        texels = {
            VERTICES: textures.create_texel_buffer(device, buffers[VERTICES].glo, "rgba32f"),
            _INSTANCE_TEXELS: textures.create_texel_buffer(device, buffers[INSTANCES].glo, "rgba32i"),
        }
        buffers["scene_index_block"] = indices
        made = {
            f"{ARRAY}{number}": textures.create(device, desc, "an array of the scene's textures")
            for number, desc in enumerate(found.arrays)
        }
        for key, (number, layer) in found.places.items():
            _copy_with_border(device, images[key], made[f"{ARRAY}{number}"], layer, key)
        return cls(device, buffers, texels, instances, found, made, textures.create_sampler(device, Sampler("linear")))

    def release(self) -> None:
        for name, buffer in self.buffers.items():
            if name != "scene_index_block":
                buffer.release()
        for texel in self.texels.values():
            self.device.raw.delete("glDeleteTextures", texel)
        for texture in self.textures.values():
            textures.delete(self.device, texture)
        self.device.raw.delete("glDeleteSamplers", self.sampler)


def _copy_with_border(device: Device, image: GpuTexture, array: GpuTexture, layer: int, key: Stored) -> None:
    """Copy an image into the corner of a layer, with a border that matches its wrap modes."""
    columns, rows = (
        [(last if wrap == "repeat" else 0, 0, 1), (0, BORDER, last + 1), (0 if wrap == "repeat" else last, last + 2, 1)]
        for wrap, last in zip(key[2:], (image.desc.width - 1, image.desc.height - 1), strict=True)
    )
    for x, to_x, width in columns:
        for y, to_y, height in rows:
            source = image.glo, image.target, 0, x, y, 0
            target = array.glo, array.target, 0, to_x, to_y, layer
            device.raw.glCopyImageSubData(*source, *target, width, height, 1)


def check_size(device: Device, name: str, size: int, *, texel: int = 0) -> None:
    """Refuse a scene buffer that is larger than shaders can access; `texel`: bytes of one fetch."""
    most = texel * device.limits["texture_buffer"] if texel else device.limits["storage_block"]
    if size > most:
        kind = "texture buffer" if texel else "storage block"
        text = f"the scene's '{name}' takes {size} bytes, a {kind} of this device holds {most}"
        raise RenderError(Problem("RG435", text))
