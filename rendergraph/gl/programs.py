"""Programs: compiled through moderngl; queried and set by raw calls.

moderngl does not know samplers of shadow arrays and rebinds storage blocks wrongly, so the active interface is queried
from the driver, and uniforms are written by location.
"""

from __future__ import annotations

import ctypes
import re
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

import moderngl
import numpy as np
from msgspec import Struct, field

from rendergraph.gl.device import Device
from rendergraph.gl.raw import RawGL

if TYPE_CHECKING:
    from rendergraph.steps import UniformValue

_UNIFORM, _UNIFORM_BLOCK, _OUTPUT, _STORAGE_BLOCK = 0x92E1, 0x92E2, 0x92E4, 0x92E6
_NAME_LENGTH, _TYPE, _ARRAY_SIZE, _BLOCK_INDEX, _LOCATION = 0x92F9, 0x92FA, 0x92FB, 0x92FD, 0x930E
_ACTIVE, _BUFFER_DATA_SIZE, _BUFFER_VARIABLE, _OFFSET = 0x92F5, 0x9303, 0x92E5, 0x92FC
_LINK_STATUS = 0x8B82

_VALUES = {  # GL type: name in GLSL, ending of the `glProgramUniform…` that writes it
    0x1406: ("float", "1fv"), 0x8B50: ("vec2", "2fv"), 0x8B51: ("vec3", "3fv"), 0x8B52: ("vec4", "4fv"),
    0x1404: ("int", "1iv"), 0x8B53: ("ivec2", "2iv"), 0x8B54: ("ivec3", "3iv"), 0x8B55: ("ivec4", "4iv"),
    0x1405: ("uint", "1uiv"), 0x8DC6: ("uvec2", "2uiv"), 0x8DC7: ("uvec3", "3uiv"), 0x8DC8: ("uvec4", "4uiv"),
    0x8B56: ("bool", "1iv"), 0x8B57: ("bvec2", "2iv"), 0x8B58: ("bvec3", "3iv"), 0x8B59: ("bvec4", "4iv"),
    0x8B5A: ("mat2", "Matrix2fv"), 0x8B5B: ("mat3", "Matrix3fv"), 0x8B5C: ("mat4", "Matrix4fv"),
}  # fmt: skip
_SAMPLERS = {
    0x8B5D: "sampler1D", 0x8B5E: "sampler2D", 0x8B5F: "sampler3D", 0x8B60: "samplerCube", 0x8B62: "sampler2DShadow",
    0x8DC1: "sampler2DArray", 0x8DC4: "sampler2DArrayShadow", 0x8DC5: "samplerCubeShadow", 0x8DCA: "isampler2D",
    0x8DCB: "isampler3D", 0x8DD3: "usampler3D", 0x8DD0: "isamplerBuffer", 0x905C: "iimageBuffer",
    0x8DCC: "isamplerCube", 0x8DCF: "isampler2DArray", 0x8DD2: "usampler2D", 0x8DD4: "usamplerCube",
    0x8DD7: "usampler2DArray", 0x9108: "sampler2DMS", 0x9109: "isampler2DMS", 0x910A: "usampler2DMS",
    0x910B: "sampler2DMSArray", 0x910C: "isampler2DMSArray", 0x910D: "usampler2DMSArray",
}  # fmt: skip

UNIFORM_BLOCK = re.compile(r"\blayout\(std140\) uniform (\w+)")
ProgramError = moderngl.Error


class Uniform(Struct, frozen=True):
    name: str
    type: int
    size: int
    location: int

    @property
    def glsl(self) -> str:
        return _SAMPLERS.get(self.type, "an opaque type") if self.is_opaque else _VALUES[self.type][0]

    @property
    def number_count(self) -> int:
        ending = _VALUES[self.type][1]
        return int(ending[-3]) ** 2 if "Matrix" in ending else int(ending[0])

    @property
    def is_integer(self) -> bool:
        return not self.is_opaque and not _VALUES[self.type][1].endswith("fv")

    @property
    def is_opaque(self) -> bool:
        return self.type not in _VALUES


class Program(Struct, eq=False):
    """A linked program with its active interface.

    Attributes:
        object: moderngl's Program or ComputeShader.
        blocks, storage: active uniform and storage blocks, name to index.
        storage_bytes: the least that a storage block's buffer holds, an array without a size counted as one element.
    """

    device: Device
    object: Any
    texts: Mapping[str, str] = field(default_factory=dict)
    uniforms: dict[str, Uniform] = field(default_factory=dict)
    blocks: dict[str, int] = field(default_factory=dict)
    storage: dict[str, int] = field(default_factory=dict)
    storage_bytes: dict[str, int] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.blocks |= {name: index for index, (name, _) in enumerate(_resources(self, _UNIFORM_BLOCK))}
        for index, (name, (least,)) in enumerate(_resources(self, _STORAGE_BLOCK, _BUFFER_DATA_SIZE)):
            self.storage[name], self.storage_bytes[name] = index, least
        properties = _TYPE, _ARRAY_SIZE, _BLOCK_INDEX, _LOCATION
        for name, (kind, size, block, location) in _resources(self, _UNIFORM, *properties):
            if block == -1:
                name = name.removesuffix("[0]")
                self.uniforms[name] = Uniform(name, kind, size, location)

    @property
    def glo(self) -> int:
        return int(self.object.glo)

    @property
    def block_names(self) -> list[str]:
        return [*self.storage, *self.blocks]

    @property
    def local_size(self) -> tuple[int, int, int]:
        values = (ctypes.c_int * 3)()
        self.device.raw.glGetProgramiv(self.glo, 0x8267, ctypes.byref(values))
        return values[0], values[1], values[2]

    def writer(self, name: str, value: UniformValue) -> Callable[[], None] | None:
        """Return a call that writes one uniform, None if the program does not use it."""
        if (uniform := self.uniforms.get(name)) is None:
            return None
        if uniform.is_opaque:
            return partial(self.device.raw.glProgramUniform1i, self.glo, uniform.location, int(value))  # type: ignore[arg-type]
        function = f"glProgramUniform{_VALUES[uniform.type][1]}"
        dtype = np.float32 if not uniform.is_integer else np.uint32 if function.endswith("uiv") else np.int32
        data = np.ascontiguousarray(value, dtype).ravel()
        count = max(1, data.size // uniform.number_count)
        transposed = (0,) if "Matrix" in function else ()
        member = self.object.get(name, None) if count == uniform.size == 1 else None
        if isinstance(member, moderngl.Uniform) and data.itemsize == 4:
            return partial(member.write, data.tobytes())  # half the time of a call through ctypes
        where = self.glo, uniform.location, min(count, uniform.size)
        write = partial(getattr(self.device.raw, function), *where, *transposed, data.ctypes.data)
        write.data = data  # type: ignore[attr-defined]  # the array travels with the call: its address stays good
        return write

    def bind_block(self, name: str, binding: int) -> None:
        if name in self.blocks:
            self.device.raw.glUniformBlockBinding(self.glo, self.blocks[name], binding)
        elif name in self.storage:
            self.device.raw.glShaderStorageBlockBinding(self.glo, self.storage[name], binding)

    def release(self) -> None:
        self.object.release()


def link(
    device: Device, texts: Mapping[str, str], outputs: Sequence[str] = (), stored: Collection[str] = ()
) -> Program:
    """Compile and link the stages; fragment outputs get locations in the order of `outputs`.

    Uniform blocks named in `stored` become storage blocks.

    Raises:
        ProgramError: the driver's message, as moderngl wraps it.
    """
    before = device.raw.glCreateProgram()
    final = {stage: _in_storage(text, stored) for stage, text in texts.items()} if stored else texts
    try:
        if "compute" in final:
            made: Any = device.ctx.compute_shader(final["compute"])
        else:
            made = device.ctx.program(
                vertex_shader=final["vertex"],
                geometry_shader=final.get("geometry"),
                fragment_shader=final.get("fragment"),
                fragment_outputs={name: number for number, name in enumerate(outputs)},
            )
    except ProgramError:
        if device.owned:  # in a borrowed context the objects may be the owner's
            _delete_leftovers(device.raw, before)
        raise
    finally:
        device.raw.glDeleteProgram(before)
    return Program(device, made, texts)


def _in_storage(text: str, blocks: Collection[str]) -> str:
    """Return a text with some of its uniform blocks as storage blocks with the same member offsets."""
    return UNIFORM_BLOCK.sub(lambda m: f"layout(std430) readonly buffer {m[1]}" if m[1] in blocks else m[0], text)


def _delete_leftovers(raw: RawGL, before: int) -> None:
    """Delete what moderngl leaves behind when a stage does not compile: the unlinked program and the other stages."""
    after = raw.glCreateProgram()
    linked = ctypes.c_int()
    for name in range(before + 1, after):
        if raw.glIsShader(name):
            raw.glDeleteShader(name)
        elif raw.glIsProgram(name):
            raw.glGetProgramiv(name, _LINK_STATUS, ctypes.byref(linked))
            if not linked.value:
                raw.glDeleteProgram(name)
    raw.glDeleteProgram(after)


def driver_message(error: Exception) -> tuple[str | None, str]:
    """Return stage (`vertex`, … or None for linking) and the driver's own text from moderngl's error."""
    text = str(error)
    if match := re.search(r"(vertex|fragment|geometry|compute)_shader\s*\n=+\n(.*)", text, re.DOTALL):
        return match[1], match[2].strip()
    return None, re.sub(r"^.*?\n=+\n", "", text, count=1, flags=re.DOTALL).strip()


def outputs_of(program: Program) -> dict[str, str]:
    found = _resources(program, _OUTPUT, _TYPE)
    return {name.removesuffix("[0]"): _VALUES[kind][0] for name, (kind,) in found if not name.startswith("gl_")}


def member_offsets(program: Program, block: str) -> dict[str, int]:
    """Return the byte offsets of the active members of a storage block, by their names as in `sparks[0].age`."""
    found = _resources(program, _BUFFER_VARIABLE, _BLOCK_INDEX, _OFFSET)
    return {name: offset for name, (index, offset) in found if index == program.storage[block]}


def _resources(program: Program, interface: int, *properties: int) -> Iterator[tuple[str, list[int]]]:
    """Yield the name and the properties of each active resource of an interface, by its index."""
    raw, glo, number = program.device.raw, program.glo, len(properties)
    count, name = ctypes.c_int(), ctypes.create_string_buffer(512)
    raw.glGetProgramInterfaceiv(glo, interface, _ACTIVE, ctypes.byref(count))
    asked, values = (ctypes.c_uint * number)(*properties), (ctypes.c_int * number)()
    for index in range(count.value):
        raw.glGetProgramResourceName(glo, interface, index, 512, None, name)
        if properties:
            raw.glGetProgramResourceiv(glo, interface, index, number, asked, number, None, values)
        yield name.value.decode(), list(values)
