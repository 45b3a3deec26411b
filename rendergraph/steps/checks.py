"""Checks of a step's arguments, while the author's own line is still on the stack."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping, Sequence
from functools import cache, wraps
from typing import TYPE_CHECKING, Annotated, Any, ParamSpec, TypeAlias

from msgspec.structs import replace

from rendergraph.errors import Misuse, nearest, suggestion
from rendergraph.ports import Part, Port, WrittenPort
from rendergraph.steps.model import UniformValue
from rendergraph.textures import FORMATS, BufferDesc, Normal, TextureDesc
from rendergraph.typecheck import Length, Range, accepts, hints_of, mistakes_in, quoted, test_of

if TYPE_CHECKING:
    import numpy.typing as npt

_ATTRIBUTE = r"[1-4]?[fiu][1248]?(?:/[vi])?\Z"
_PADDING = r"\d+x[1248]?(?:/[vi])?\Z"


_Count: TypeAlias = Annotated[int, Range(1)]
Counts: TypeAlias = Annotated[_Count | Sequence[_Count], Length(1, 3), "one to three whole numbers from 1 up"]
"""Counts along x, y and z; missing ones are 1."""
Macro: TypeAlias = Annotated[bool | int | float | str, "a number, True, False or text"]
P = ParamSpec("P")


def check_argument(name: str, value: object, annotation: Any) -> None:
    """Refuse an argument that does not fit its annotation."""
    for mistake in mistakes_in(name, value, annotation):
        raise Misuse(mistake.text)


def checked(method: Callable[P, None]) -> Callable[P, None]:
    """Check a method's arguments before the call, except those that may be ports, which the method itself checks."""

    @cache
    def tested_parameters() -> tuple[list[str], dict[str, tuple[Any, Callable[[Any], bool]]]]:
        hints = hints_of(method)
        return list(hints), {name: (hint, test_of(hint)) for name, hint in hints.items() if not accepts(hint, Port)}

    @wraps(method)
    def call(*arguments: P.args, **named: P.kwargs) -> None:
        names, tests = tested_parameters()
        for name, value in (*zip(names, arguments[1:], strict=False), *named.items()):
            if name in tests and not tests[name][1](value):
                check_argument(name, value, tests[name][0])
        method(*arguments, **named)

    return call


def declared_port(ports: Mapping[str, Port], value: object, what: str) -> Port:
    """Return a port that the node itself declares; `what` is the argument's name in messages."""
    if isinstance(value, Part):
        value = value.port
    if not isinstance(value, Port):
        if isinstance(value, str):
            near = f", self.{value}" if value in ports else suggestion(value, ports)
            raise Misuse(f"{what} is the text '{value}'; give the port itself{near}")
        raise Misuse(f"{what} is {quoted(value)}, not a port")
    if ports.get(value.name) is not value:
        if not value.name:
            made = f"{what} is an {type(value).__name__} created here; declare it as an attribute of the class"
            raise Misuse(made, "RG424")
        hint = suggestion(value.name, ports)
        raise Misuse(f"{what} is port '{value.name}' of {value.owner}, which this node does not have{hint}", "RG424")
    return value


def part_of(ports: Mapping[str, Port], value: object, what: str) -> Part:
    """Return a port of the node, or a part of one."""
    port = declared_port(ports, value, what)
    return value if isinstance(value, Part) else port.whole


def check_part(part: Part, desc: TextureDesc | BufferDesc) -> None:
    """Refuse a mip or layer that a texture does not have."""
    if part.mip is None and part.layer is None:
        return
    if isinstance(desc, BufferDesc):
        raise Misuse(f"'{part.port.name}' is a buffer, which has no mips and no layers")
    if missing := desc.lacks(part.mip, part.layer):
        raise Misuse(f"'{part.port.name}' {missing}")


def texels(
    name: str, values: object, desc: TextureDesc | BufferDesc | None, mip: int | None = None, layer: int | None = None
) -> npt.NDArray[Any]:
    """Return values for an upload as (layers, height, width, channels), or as the bytes of a buffer.

    Raises:
        Misuse: they are not numbers, or do not fill the texture or fit the buffer.
    """
    import numpy as np  # declaring nodes does not need it

    array = np.asarray(values)
    if array.dtype.kind not in "biuf" and array.dtype != getattr(getattr(desc, "element", None), "dtype", None):
        raise Misuse(f"'{name}' is given {type(values).__name__} of {array.dtype}, not an array of numbers")
    if isinstance(desc, BufferDesc):
        if array.nbytes > desc.bytes:
            raise Misuse(f"'{name}' is given {array.nbytes} bytes, but it holds {desc.bytes}", "RG432")
        return np.frombuffer(array.tobytes().ljust(desc.bytes, b"\0"), np.uint8)
    if desc is None:
        return array
    texel, layers = FORMATS[desc.format], 1 if layer is not None else desc.mip_layers(mip or 0)
    shape = (layers, *desc.mip_size(mip or 0)[::-1], texel.components)
    if desc.samples > 1 or texel.family == "depth_stencil":
        what = f"has {desc.samples} samples per texel" if desc.samples > 1 else f"is {desc.format}"
        raise Misuse(f"'{name}' {what}, which takes no upload; upload a texture without samples and stencil")
    if [side for side in array.shape if side > 1] != [side for side in shape if side > 1]:
        text = f"'{name}' takes {' × '.join(map(str, shape))} numbers (layers, height, width, channels)"
        raise Misuse(f"{text}, got an array of shape {array.shape}", "RG432")
    if texel.is_bytes and array.dtype.kind != "f" and not np.array_equal(array, np.clip(array, 0, 255)):
        given = f"{array.dtype} from {array.min()} to {array.max()}"
        raise Misuse(f"'{name}' takes bytes, or floats from 0 to 1, got {given}")
    if texel.is_bytes and array.dtype.kind == "f":
        array = np.rint(255 * np.clip(array, 0.0, 1.0)).astype(np.uint8)
    return array.reshape(shape)


def targets(ports: Mapping[str, Port], out: object) -> dict[str, Part]:
    """Return the targets of `out`, by their names in the shader."""
    if not isinstance(out, Mapping):
        part = part_of(ports, out, "out")
        found = {part.port.name: part}
    else:
        if not out:
            raise Misuse("out is empty; name what the step writes, or leave it out for every output that is used")
        for name in out:
            if not isinstance(name, str) or not name.isidentifier():
                raise Misuse(f"out has the key {quoted(name)}; the keys are the shader's names")
        given = {name: value for name, value in out.items() if value is not None or name in ports}  # None: dropped
        found = {name: part_of(ports, value, f"out[{name!r}]") for name, value in given.items()}
    for name, part in found.items():
        if not isinstance(part.port, WrittenPort):
            kind = type(part.port).__name__.lower()
            text = f"it writes its {kind} '{part.port.name}'; only outputs, internals and history can be written"
            raise Misuse(text, "RG421")
        if part.previous:
            raise Misuse(f"it writes last frame's value of '{part.port.name}'; write the port itself", "RG421")
        twice = next((other for other, one in found.items() if one == part and other != name), None)
        if twice is not None:
            raise Misuse(f"out writes '{part.port.name}' twice, as '{name}' and as '{twice}'")
    return found


def uniform(name: str, value: Any) -> UniformValue:
    """Return a uniform's value as plain numbers; arrays and nested lists become one tuple."""
    if hasattr(value, "tolist"):  # NumPy's scalars and arrays
        value = value.tolist()
    if isinstance(value, bool | int | float):
        return value
    numbers = tuple(_flat(value)) if isinstance(value, list | tuple) else ()
    if not numbers or not all(isinstance(number, bool | int | float) for number in numbers):
        hint = "; give the port itself" if isinstance(value, str) else ""
        raise Misuse(f"{name}={quoted(value)}: expected a port, a number or a list of numbers{hint}")
    return numbers


def _flat(value: Any) -> list[Any]:
    return [n for part in value for n in _flat(part)] if isinstance(value, list | tuple) else [value]


def macro(name: str, value: Macro) -> str:
    """Return a macro's value as program text."""
    if not re.match(r"[A-Za-z_]\w*\Z", name):
        raise Misuse(f"defines has the name {quoted(name)}, which is not a valid macro name")
    if (isinstance(value, float) and not math.isfinite(value)) or "\n" in str(value):
        raise Misuse(f"defines gives {name} the value {value!r}, which GLSL cannot write")
    return define_text(value)


def define_text(value: object) -> str:
    """Return a Python value as macro text."""
    if isinstance(value, bool):
        return "1" if value else "0"
    return repr(value) if isinstance(value, float) else str(value)


def counts(name: str, given: Counts) -> tuple[int, int, int]:
    """Return three integers, padded with 1."""
    check_argument(name, given, Counts)
    x, y, z = (*(given if isinstance(given, Sequence) else (given,)), 1, 1)[:3]
    return x, y, z


def objects(value: str | Sequence[str]) -> str | tuple[str, ...]:
    """Return which objects a geometry step draws."""
    if not isinstance(value, str):
        return tuple(value)
    near = nearest(value, ("all", "opaque", "transparent", "casters"))
    if near is not None and near != value:  # a name that resembles a keyword must be in a list
        raise Misuse(f"objects is '{value}'; did you mean '{near}'? An object of this name is ['{value}']")
    return value if near == value else (value,)


def attributes(ports: Mapping[str, Port], value: Mapping[str, Port] | None) -> dict[str, Port]:
    """Return layouts of a draw step's buffers: `3f 2f in_position in_uv` to the buffer's port."""
    mapping: Any = Annotated[Mapping[Any, Any], "a mapping from layouts to buffers"]
    check_argument("attributes", value, mapping | None)
    found = {}
    for layout, port in (value or {}).items():
        example = "it reads like '3f 2f in_position in_uv'"
        words = layout.split() if isinstance(layout, str) else []
        formats = [word for word in words if re.match(_ATTRIBUTE, word) or re.match(_PADDING, word)]
        names = words[len(formats) :]
        wanted = sum(not re.match(_PADDING, word) for word in formats)
        ordered = words[: len(formats)] == formats and all(name.isidentifier() for name in names)
        if not names or not formats or not ordered:
            raise Misuse(f"attributes has the layout {quoted(layout)}; {example}")
        if wanted != len(names):
            raise Misuse(f"attributes has the layout {quoted(layout)}: {wanted} formats, {len(names)} names; {example}")
        found[layout] = buffer(ports, port, f"attributes[{layout!r}]")
    return found


def unconnected(port: Port) -> Misuse:
    """Return the misuse of an input that is not connected."""
    return Misuse(f"input '{port.name}' is not connected; check `steps.connected` first")


def buffer(ports: Mapping[str, Port], value: object, what: str) -> Port:
    """Return a port after checking that it is a buffer of the node."""
    port = declared_port(ports, value, what)
    if getattr(port, "kind", "") != "buffer":
        raise Misuse(f"{what} is {quoted(port)}, which is not a buffer")
    if isinstance(value, Part):
        raise Misuse(f"{what} is a part of '{port.name}'; give the port itself, only shaders read last frame's values")
    return port


def check_resolve(source: Port, out: Port, descs: Sequence[TextureDesc | BufferDesc | None]) -> None:
    """Refuse resolves that devices cannot do: one sample, depth, integers, unit vectors, another format or size."""
    source_desc, out_desc = descs
    if source_desc is None:
        raise unconnected(source)
    if not (isinstance(source_desc, TextureDesc) and isinstance(out_desc, TextureDesc)):
        raise Misuse(f"'{source.name}' or '{out.name}' is a buffer; only textures have samples")
    if source_desc.samples == 1:
        raise Misuse(f"source is '{source.name}', which has one sample per texel, so there is nothing to resolve")
    texel = FORMATS[source_desc.format]
    if texel.is_depth or texel.family in ("uint", "int") or getattr(source, "semantic", None) == Normal:
        raise Misuse(f"'{source.name}' has values that cannot be averaged; choose a sample in a shader with texelFetch")
    if replace(source_desc, samples=1) != out_desc:
        raise Misuse(f"'{out.name}' does not match '{source.name}'; declare it like that input, with samples=1")
