"""A scene on the GPU: packed once into buffers, its images decoded and uploaded once."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Callable, Hashable
from contextlib import ExitStack
from functools import cached_property
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import moderngl
import numpy as np
import numpy.typing as npt
from msgspec import Struct, field
from msgspec.structs import replace

from rendergraph.compile.programs import ProgramCache
from rendergraph.errors import Problem, RenderError
from rendergraph.expand import SCENE_DATA
from rendergraph.gl import textures
from rendergraph.gl.device import Device
from rendergraph.gl.programs import Program
from rendergraph.gl.textures import GpuTexture
from rendergraph.program.variants import FIXED_BLOCKS, light_macros, scene_macros, storage_blocks
from rendergraph.scene import pack, scene_data
from rendergraph.scene.animate import moving_plugin_keys
from rendergraph.scene.facts import Decode
from rendergraph.scene.model import ImageSource, MadeImage, Scene, Texture, changed_objects
from rendergraph.scene.pack import PackedScene, Records
from rendergraph.scene.scene_data import BORDER, Stored, TextureArrays
from rendergraph.scene.tree_data import MeshTrees, mesh_trees, object_rows
from rendergraph.textures import Sampler, TextureDesc, full_mip_count

if TYPE_CHECKING:
    from rendergraph.compile.posing import Posing

COMMAND = np.dtype(
    [(name, np.uint32) for name in ("count", "instances", "first_index")]
    + [("base_vertex", np.int32), ("base_instance", np.uint32)]
)
"""DrawElementsIndirectCommand."""

DecodeLight = Callable[[ImageSource | MadeImage], npt.NDArray[Any]]
"""Decodes the environment map of a scene."""

_ANISOTROPY = 8  # maximum anisotropy of material textures
_STREAMS = {
    "in_position": ("positions", "3f"),
    "in_normal": ("normals", "3f"),
    "in_tangent": ("tangents", "4f"),
    "in_uv0": ("uv0", "2f"),
    "in_uv1": ("uv1", "2f"),
    "in_color": ("colors", "4f"),
}
"""Vertex attributes with the arrays of `PackedScene` and moderngl's formats."""
_POSED = ("in_position", "in_normal", "in_tangent")
_ABSENT = {"in_tangent": (0.0, 0.0, 0.0, 0.0), "in_uv0": (0.0, 0.0), "in_uv1": (0.0, 0.0), "in_color": (1.0,) * 4}
"""Values of attributes that no mesh of the scene has; `pack` uses the same for a mesh that lacks one."""
_INSTANCE_FORMAT = (("in_object0", "4f"), ("in_object1", "4f"), ("in_object2", "4f"), ("in_ids", "2i"))
_PREVIOUS_FORMAT = (("in_previous0", "4f"), ("in_previous1", "4f"), ("in_previous2", "4f"), ("", "2i"))
"""The same rows in the previous frame."""
_PREVIOUS_POSITION = "in_previous_position"
PREVIOUS_ATTRIBUTES = (*(name for name, _ in _PREVIOUS_FORMAT if name), _PREVIOUS_POSITION)
SCENE_ATTRIBUTES = {
    **{name: layout for name, (_, layout) in _STREAMS.items()},
    **dict(_INSTANCE_FORMAT),
    **{name: layout for name, layout in _PREVIOUS_FORMAT if name},
    _PREVIOUS_POSITION: "3f",
}
"""Attributes that a vertex shader may read when it draws the scene, with moderngl's formats."""
VERTICES, INSTANCES, TREE = "scene_vertex_texels", "scene_instance_block", "scene_tree"
_INSTANCE_TEXELS = "scene_instance_texels"
TEXELS = frozenset({VERTICES, _INSTANCE_TEXELS, TREE})
"""Buffers of which `scene.glsl` fetches texels, and which `ray_query.glsl` loads as an image."""
_ARRAY = "scene_array_"
"""Prefix of the arrays' names in `scene.glsl`."""
_SECTIONS = {"objects": "instances", "materials": "material_block", "lights": "light_block"}
"""Sections of scene files, with the source that changes if values of plugins' keys change."""
_MOST_RUNS = 32  # of consecutive records uploaded separately; if there are more, everything between is uploaded too
_PADDING = {"4f": "16x", "2i": "8x"}


class MeshIndices(Struct, frozen=True, eq=False):
    buffer: moderngl.Buffer
    commands: Records
    mode: int


class SceneBuffers(Struct, frozen=True, eq=False):
    """The buffers and texture arrays behind inputs of `SceneData`.

    Attributes:
        buffers: the buffers by their names in `scene.glsl`; the indices are those of geometry passes.
        texels: textures that fetch from them, by name.
        instances: the records that the instance buffer holds.
        arrays: the location of each texture in the arrays.
        textures: texture arrays by their names in `scene.glsl`; all use the same `sampler`.
    """

    buffers: dict[str, moderngl.Buffer]
    texels: dict[str, int]
    instances: Records
    arrays: TextureArrays
    textures: dict[str, GpuTexture]
    sampler: int


class GpuScene(Struct, eq=False, dict=True):
    """The buffers, material textures and macros of a scene.

    Attributes:
        changes: how often each block, the `instances` and those of the previous frame have been uploaded again, or the
            `camera` has changed.
    """

    device: Device
    scene: Scene
    packed: PackedScene
    decode: Decode
    decode_light: DecodeLight
    changes: Counter[str] = field(default_factory=Counter)
    _streams: dict[str, tuple[moderngl.Buffer, str]] = {}
    _constants: dict[str, moderngl.Buffer] = {}
    _images: dict[tuple[ImageSource, bool], GpuTexture] = {}
    _sampled: set[tuple[ImageSource, bool]] = set()
    _samplers: dict[tuple[str, ...], int] = {}
    _blocks: dict[str, moderngl.Buffer] = {}
    _stored: set[str] = set()  # the blocks that are storage blocks
    _environment: GpuTexture | None = None
    _before: moderngl.Buffer | None = None
    _data: SceneBuffers | None = None
    _tree: tuple[MeshTrees, moderngl.Buffer] | None = None
    _posing: Posing | None = None
    _stale_instances: set[int] = set()  # objects that have moved since the previous frame was saved
    _owned: ExitStack = field(default_factory=ExitStack)

    def __post_init__(self) -> None:
        packed = self.packed
        for name, (field_name, layout) in _STREAMS.items():
            array = getattr(packed, field_name)
            if array is not None and array.size:
                self._streams[name] = (self._buffer(array.tobytes()), layout)
        self._indices = {"triangles": self._mesh_indices(packed.indices, packed.meshes, moderngl.TRIANGLES)}
        self._instances = self._buffer(packed.instances.tobytes() or bytes(64))
        for block, records in pack.blocks(packed).items():
            if records.size:
                self._blocks[block] = self._buffer(records.tobytes())
        self._stored = self._blocks.keys() & storage_blocks(packed, self.device.limits["uniform_block"])
        if packed.vertex_orders:
            from rendergraph.compile.posing import Posing  # only for animated meshes

            streams = {_STREAMS[name][0]: buffer for name, (buffer, _) in self._streams.items() if name in _POSED}
            self._posing = Posing.make(self.device, self.scene, packed, streams)
            self._owned.callback(self._posing.release)

    def _buffer(self, content: bytes) -> moderngl.Buffer:
        buffer = self.device.ctx.buffer(content)
        self._owned.callback(buffer.release)
        return buffer

    def _mesh_indices(self, indices: npt.NDArray[Any], meshes: Records, mode: int) -> MeshIndices:
        """Return an index buffer, with the commands that draw each object; `meshes` locates its indices."""
        packed = self.packed
        commands = np.zeros(len(packed.object_mesh), COMMAND)
        for name in ("count", "first_index", "base_vertex"):
            commands[name] = meshes[packed.object_mesh][name]
        commands["instances"], commands["base_instance"] = 1, np.arange(len(commands))
        return MeshIndices(self._buffer(indices.tobytes() or bytes(4)), commands, mode)

    @property
    def light_defines(self) -> dict[str, str]:
        return light_macros(self.scene, self._stored)

    @property
    def defines(self) -> dict[str, str]:
        """Macros about objects and materials, for geometry steps."""
        return scene_macros(self.scene, self.packed, self._stored)

    def bind(self) -> None:
        """Bind lights and materials to their binding points; once per frame."""
        for name, buffer in self._blocks.items():
            if name in self._stored:
                buffer.bind_to_storage_buffer(FIXED_BLOCKS[name])
            else:
                self.device.bind_block(buffer, FIXED_BLOCKS[name])

    def update(self, scene: Scene) -> bool:
        """Update to an animated scene's lights, transforms and poses; the meshes stay.

        Returns:
            Whether vertices have been posed, which binds buffers to binding points that steps use.
        """
        packed, has_posed = pack.update(self.packed, self.scene, scene), False
        for block, now, before in (
            ("light_block", packed.lights, self.packed.lights),
            ("material_block", packed.materials, self.packed.materials),
            ("environment_block", packed.environment, self.packed.environment),
        ):
            if block in self._blocks and now is not before and now.tobytes() != before.tobytes():
                self._blocks[block].write(now.tobytes())
                self.changes[block] += 1
        if packed.instances is not self.packed.instances:
            changed = changed_objects(self.scene, scene)
            if self._posing is not None:
                poses = {placed.mesh: placed.pose for n in changed if (placed := scene.objects[n]).pose is not None}
                has_posed = self._posing.update(poses)
            moved = np.array(changed, np.int64)
            if not has_posed:
                moved = moved[packed.instances[moved] != self.packed.instances[moved]]
            if len(moved):
                write_records(self._instances, packed.instances, moved)
                self._stale_instances.update(moved.tolist())
                self.changes["instances"] += 1
                if self._data is not None:
                    scene_data.place_instances(self._data.instances, scene, packed, moved)
                    write_records(self._data.buffers[INSTANCES], self._data.instances, moved)
                if self._tree is not None:
                    trees, buffer = self._tree
                    if has_posed:
                        trees = self._mesh_trees()
                        buffer.write(trees.rows.tobytes(), offset=buffer.size - trees.rows.nbytes)
                    buffer.write(object_rows(packed, self.data.instances["flags"], trees).tobytes())
                    self._tree = trees, buffer
        for section in moving_plugin_keys(scene) & _SECTIONS.keys():
            pairs = zip(getattr(self.scene, section), getattr(scene, section), strict=True)
            self.changes[_SECTIONS[section]] += any(before.extra != now.extra for before, now in pairs)
        if scene.camera is not self.scene.camera:
            self.changes["camera"] += 1
        self.scene, self.packed = scene, packed
        return has_posed

    def advance(self) -> None:
        """Make the current positions of objects those of the previous frame, for programs that read these."""
        if self._before is not None and self._stale_instances:
            write_records(self._before, self.packed.instances, np.array(sorted(self._stale_instances), np.int64))
            self.changes["instances before"] += 1
        if self._posing is not None and self._posing.advance():
            self.changes["instances before"] += 1
        self._stale_instances.clear()

    @property
    def data(self) -> SceneBuffers:
        """The scene's data, uploaded on first use."""
        if self._data is None:
            self._data = self._upload_data()
            if self._posing is not None:
                vertices = self._data.buffers[VERTICES]
                self._posing.fill(vertices, vertices.size // (4 * len(self.packed.positions)))
        return self._data

    def _upload_data(self) -> SceneBuffers:
        """Upload the buffers that only `SceneData` needs, and copy the images into arrays."""
        device, scene, packed, used = self.device, self.scene, self.packed, scene_data.used_textures(self.scene)
        self.load_images(list(used.values()))
        images = {key: self._images[texture.image, texture.srgb] for key, texture in used.items()}
        instances = scene_data.instance_data(scene, packed)
        arrays = scene_data.texture_arrays({key: image.desc for key, image in images.items()})
        sizes = {key: image.desc.size for key, image in images.items()}
        slots = scene_data.texture_data(scene, sizes, arrays).tobytes() if sizes else b""
        contents = {
            VERTICES: scene_data.vertex_data(packed).tobytes(),
            INSTANCES: instances.tobytes() + slots,
            "scene_emitter_block": scene_data.emitter_data(scene, packed).tobytes(),
        }
        for name, content in contents.items():
            _check_size(device, name, len(content), texel=16 * (name in (VERTICES, INSTANCES)))
        buffers = {name: self._buffer(content or bytes(128)) for name, content in contents.items()}
        texels = {
            VERTICES: self._texel_buffer(buffers[VERTICES], "rgba32f"),
            _INSTANCE_TEXELS: self._texel_buffer(buffers[INSTANCES], "rgba32i"),
        }
        buffers["scene_index_block"] = self._indices["triangles"].buffer
        made: dict[str, GpuTexture] = {}
        for number, desc in enumerate(arrays.arrays):
            made[f"{_ARRAY}{number}"] = array = textures.create(device, desc, "an array of the scene's textures")
            self._owned.callback(textures.delete, device, array)
        for key, (number, layer) in arrays.places.items():
            _copy_with_border(device, images[key], made[f"{_ARRAY}{number}"], layer, key)
        sampler = textures.create_sampler(device, Sampler("linear"))
        self._owned.callback(device.raw.delete, "glDeleteSamplers", sampler)
        return SceneBuffers(buffers, texels, instances, arrays, made, sampler)

    def _texel_buffer(self, buffer: moderngl.Buffer, format: str) -> int:
        texture = textures.create_texel_buffer(self.device, buffer.glo, format)
        self._owned.callback(self.device.raw.delete, "glDeleteTextures", texture)
        return texture

    def tree(self) -> moderngl.Buffer:
        """The trees for `trace.glsl`, built on first use."""
        if self._tree is None:
            trees = self._mesh_trees()
            rows = object_rows(self.packed, self.data.instances["flags"], trees)
            _check_size(self.device, TREE, rows.nbytes + trees.rows.nbytes, texel=16)
            self._tree = trees, self._buffer(rows.tobytes() + trees.rows.tobytes())
        return self._tree[1]

    @cached_property
    def tree_image(self) -> int:
        """The GL texture with which shaders load from the trees."""
        return self._texel_buffer(self.tree(), "rgba32i")

    def _mesh_trees(self) -> MeshTrees:
        packed = self.packed
        if self._posing is not None:
            packed = replace(packed, positions=self._posing.positions())
        before = None if self._tree is None else self._tree[0]
        return mesh_trees(self.scene, packed, self.data.instances["flags"], before)

    @property
    def data_defines(self) -> dict[str, str]:
        """Macros for steps that read the scene's data."""
        return {**self.defines, **scene_data.data_macros(self.scene, self.packed, self.data.arrays)}

    def drop_unused_images(self) -> None:
        """Free the images that were needed only for the texture arrays of the scene's data; call it after compiling."""
        for key in self._images.keys() - self._sampled:
            textures.delete(self.device, self._images.pop(key))

    def indices(self, topology: str) -> MeshIndices:
        """Return the indices of `triangles`, or of `triangles_adjacency`, which are computed on first use."""
        if topology not in self._indices:
            indices, meshes = pack.with_adjacency(self.packed)
            self._indices[topology] = self._mesh_indices(indices, meshes, moderngl.TRIANGLES_ADJACENCY)
        return self._indices[topology]

    def vertex_array(self, programs: ProgramCache, program: Program, topology: str) -> Any:
        """Return a vertex array with the streams that a program uses, transforms per instance, and the index buffer."""
        names = set(program.object)
        content: list[tuple[Any, ...]] = [(*stream, name) for name, stream in self._streams.items() if name in names]
        content += [(*self._constant(name), name) for name in _ABSENT if name in names and name not in self._streams]
        for formats in (_INSTANCE_FORMAT, _PREVIOUS_FORMAT):
            used = [name for name, _ in formats if name in names]
            if used:
                layout = " ".join(f if name in names else _PADDING[f] for name, f in formats)
                buffer = self._instances if formats is _INSTANCE_FORMAT else self.previous()
                content.append((buffer, f"{layout}/i", *used))
        if _PREVIOUS_POSITION in names:
            content.append((self.previous_positions(), "3f", _PREVIOUS_POSITION))
        return programs.vertex_array(program, (id(self), "scene", topology), content, self.indices(topology).buffer)

    def previous(self) -> moderngl.Buffer:
        """Transforms of objects in the previous frame, stored from the first use on."""
        if self._before is None:
            self._stale_instances.clear()
            self._before = self._buffer(self.packed.instances.tobytes() or bytes(64))
        return self._before

    def previous_positions(self) -> moderngl.Buffer:
        """Object-space vertex positions in the previous frame, likewise; the current ones if no mesh is posed."""
        return self._posing.previous() if self._posing is not None else self._streams["in_position"][0]

    def _constant(self, name: str) -> tuple[moderngl.Buffer, str]:
        """Return a buffer with one value per instance: draws start at the object's instance, so one would not do."""
        if name not in self._constants:
            values = np.tile(np.array(_ABSENT[name], np.float32), (max(1, len(self.packed.instances)), 1))
            self._constants[name] = self._buffer(values.tobytes())
        return self._constants[name], f"{SCENE_ATTRIBUTES[name]}/i"

    def texture(self, texture: Texture) -> tuple[int, int]:
        """Return the GL names of a material texture and its sampler."""
        image = self._images[texture.image, texture.srgb].glo
        self._sampled.add((texture.image, texture.srgb))
        key = (texture.min_filter, texture.mag_filter, texture.wrap_s, texture.wrap_t)
        if key not in self._samplers:
            is_trilinear = texture.min_filter == "linear_mipmap_linear"
            steps = min(_ANISOTROPY, self.device.limits["anisotropy"]) if is_trilinear else 1
            made = self._samplers[key] = textures.create_gl_sampler(self.device, *key, steps)
            self._owned.callback(self.device.raw.delete, "glDeleteSamplers", made)
        return image, self._samplers[key]

    def load_images(self, wanted: list[Texture]) -> None:
        """Decode and upload missing images; decoding runs on all cores."""
        missing = dict.fromkeys((t.image, t.srgb) for t in wanted if (t.image, t.srgb) not in self._images)
        if not missing:
            return
        from concurrent.futures import ThreadPoolExecutor  # only for scenes with images

        with ThreadPoolExecutor() as pool:
            decoding = {key: pool.submit(self.decode, *key) for key in missing if key[0].generated is None}
            for key in missing:  # generated images need this thread's context
                pixels = decoding[key].result() if key in decoding else self.decode(*key)
                self._images[key] = self._upload(pixels, srgb=key[1])

    def environment(self) -> GpuTexture:
        """Return the scene's environment map, decoded and uploaded on first use."""
        if self._environment is None:
            assert self.scene.environment is not None  # called only for scenes that have one
            self._environment = self._upload(self.decode_light(self.scene.environment.image), srgb=True)
            self._owned.callback(textures.delete, self.device, self._environment)
        return self._environment

    def resource(self, id: str) -> GpuTexture | moderngl.Buffer:
        """Return a resource of the scene: its environment, or one buffer that stands for all its data."""
        return self.data.buffers["scene_instance_block"] if id == SCENE_DATA.port else self.environment()

    @property
    def environment_content(self) -> Hashable:
        """Return what the environment map is decoded from: equal values give the same texels, also for two scenes."""
        assert self.scene.environment is not None  # as above
        image = self.scene.environment.image
        return image, None if isinstance(image, MadeImage) else self.scene.files.get(os.path.abspath(image.path))

    def _upload(self, pixels: npt.NDArray[Any], *, srgb: bool) -> GpuTexture:
        height, width = pixels.shape[:2]
        bytes_format, is_bytes = "srgb8_a8" if srgb else "rgba8", pixels.dtype == np.uint8
        format_name = bytes_format if is_bytes else "rgba32f" if pixels.dtype == np.float32 else "rgba16f"
        desc = TextureDesc("texture2d", format_name, width, height, mips=full_mip_count(width, height))
        made = textures.create(self.device, desc, "a material texture")
        textures.upload(self.device, made, pixels)
        if is_bytes:
            self.device.raw.glGenerateTextureMipmap(made.glo)
        else:
            textures.fill_mips(self.device, made)
        return made

    def release(self, programs: ProgramCache) -> None:
        programs.forget(id(self))
        for image in self._images.values():
            textures.delete(self.device, image)
        self._owned.close()


def write_records(buffer: moderngl.Buffer, records: Records, numbers: npt.NDArray[np.int64]) -> None:
    """Upload some of a table's records, by ascending number, in runs; if there are many runs, all between them."""
    ends = np.flatnonzero(np.diff(numbers, prepend=-2, append=-2) != 1)
    if len(ends) > _MOST_RUNS:
        first = int(numbers[0])
        buffer.write(records[first : int(numbers[-1]) + 1].tobytes(), offset=first * records.itemsize)
        return
    for begin, end in pairwise(ends.tolist()):
        first = int(numbers[begin])
        buffer.write(records[first : first + end - begin].tobytes(), offset=first * records.itemsize)


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


def _check_size(device: Device, name: str, size: int, *, texel: int = 0) -> None:
    """Refuse a scene buffer that is larger than shaders can access; `texel`: bytes of one fetch."""
    most = texel * device.limits["texture_buffer"] if texel else device.limits["storage_block"]
    if size > most:
        kind = "texture buffer" if texel else "storage block"
        text = f"the scene's '{name}' takes {size} bytes, a {kind} of this device holds {most}"
        raise RenderError(Problem("RG435", text))
