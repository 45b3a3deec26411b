"""What a node may give to a step, checked while the author's own line is still on the stack."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from typing import Any

from rendergraph.errors import Misuse, nearest, suggestion
from rendergraph.ports import Made, Part, Port
from rendergraph.steps.model import UniformValue
from rendergraph.textures import BufferDesc, TextureDesc

_MACRO = re.compile(r"[A-Za-z_]\w*\Z")
_ATTRIBUTE = re.compile(r"[1-4]?[fiu][1248]?(?:/[vi])?\Z")
_PADDING = re.compile(r"\d+x[1248]?(?:/[vi])?\Z")


def shown(value: object) -> str:
    """A value as messages quote it."""
    if isinstance(value, Port):
        return f"the {type(value).__name__} '{value.name}'"
    text = repr(value)
    return text if len(text) <= 60 else text[:57] + "..."


def own_port(ports: Mapping[str, Port], value: object, what: str) -> Port:
    """A port that the node itself declares.

    Args:
        ports: those that it declares, by name.
        value: what its author gives.
        what: what that is given as, for messages.

    Raises:
        Misuse: it is something else, or the port of another class.
    """
    if isinstance(value, Part):
        value = value.port
    if not isinstance(value, Port):
        if isinstance(value, str):
            near = f", self.{value}" if value in ports else suggestion(value, ports)
            raise Misuse(f"{what} is the text '{value}'; give the port itself{near}")
        raise Misuse(f"{what} is {shown(value)}, not a port")
    if ports.get(value.name) is not value:
        if not value.name:
            made = f"{what} is an {type(value).__name__} made in place; declare it as an attribute of the class"
            raise Misuse(made, "RG424")
        hint = suggestion(value.name, ports)
        raise Misuse(f"{what} is port '{value.name}' of {value.owner}, which this node does not have{hint}", "RG424")
    return value


def part_of(ports: Mapping[str, Port], value: object, what: str) -> Part:
    """A port of the node, or a part of one."""
    port = own_port(ports, value, what)
    part = value if isinstance(value, Part) else Part(port)
    for name, number in (("mip", part.mip), ("layer", part.layer)):
        if number is not None and (isinstance(number, bool) or not isinstance(number, int) or number < 0):
            raise Misuse(f"{what} is {name} {shown(number)} of '{port.name}'; they are counted from 0")
    return part


def within(part: Part, desc: TextureDesc | BufferDesc) -> None:
    """Refuse a mip or layer that a texture does not have."""
    if part.mip is None and part.layer is None:
        return
    if isinstance(desc, BufferDesc):
        raise Misuse(f"'{part.port.name}' is a buffer, which has no mips and no layers")
    for name, number, count in (("mip", part.mip, desc.mips), ("layer", part.layer, desc.layers)):
        if number is not None and number >= count:
            last = f"0 to {count - 1}" if count > 1 else "only 0"
            raise Misuse(f"'{part.port.name}' has no {name} {number}; it has {last}")


def targets(ports: Mapping[str, Port], out: object) -> dict[str, Part]:
    """What `out` names: the shader's name to what is written."""
    if isinstance(out, Port | Part):
        part = part_of(ports, out, "out")
        found = {part.port.name: part}
    elif isinstance(out, Mapping):
        if not out:
            raise Misuse("out is empty; name what the step writes, or leave it out for every output that is used")
        for name in out:
            if not isinstance(name, str) or not name.isidentifier():
                raise Misuse(f"out has the key {shown(name)}; the keys are the shader's names")
        found = {name: part_of(ports, value, f"out[{name!r}]") for name, value in out.items()}
    else:
        part_of(ports, out, "out")  # says what it is instead
        raise AssertionError
    for name, part in found.items():
        if not isinstance(part.port, Made):
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
    """A uniform's value as plain numbers; arrays and nested lists become one tuple.

    Raises:
        Misuse: it is no number.
    """
    if hasattr(value, "tolist"):  # NumPy's scalars and arrays
        value = value.tolist()
    if isinstance(value, bool | int | float):
        return value
    numbers = tuple(_flat(value)) if isinstance(value, list | tuple) else ()
    if not numbers or not all(isinstance(number, bool | int | float) for number in numbers):
        hint = "; give the port itself" if isinstance(value, str) else ""
        raise Misuse(f"{name}={shown(value)}: a step takes ports, numbers and lists of numbers{hint}")
    return numbers


def _flat(value: Any) -> list[Any]:
    return [n for part in value for n in _flat(part)] if isinstance(value, list | tuple) else [value]


def macro(name: str, value: object) -> str:
    """A macro's value as program text.

    Raises:
        Misuse: its name is none, or the value is no number, switch or text.
    """
    if not isinstance(name, str) or not _MACRO.match(name):
        raise Misuse(f"defines has the name {shown(name)}, which cannot be a macro's")
    if isinstance(value, float) and not math.isfinite(value):
        raise Misuse(f"defines gives {name} the value {value}, which GLSL cannot write")
    if not isinstance(value, int | float | str) or "\n" in str(value):
        raise Misuse(f"defines gives {name} the value {shown(value)}; a macro is a number, True, False or text")
    return define_text(value)


def define_text(value: object) -> str:
    """A Python value as macro text."""
    if isinstance(value, bool):
        return "1" if value else "0"
    return repr(value) if isinstance(value, float) else str(value)


def shader_files(files: Mapping[str, object], required: str) -> tuple[tuple[str, str], ...]:
    """Stage to file of the stages that a step has; one of them it cannot do without."""
    for stage, file in files.items():
        missing = file is None and stage != required
        if not missing and (not isinstance(file, str) or not file):
            raise Misuse(f"the {stage} shader is {shown(file)}, not the name of a file")
    return tuple((stage, str(file)) for stage, file in files.items() if file is not None)


def choice(name: str, value: object, known: tuple[str, ...]) -> None:
    """Refuse a word that is none of those there are."""
    if not isinstance(value, str) or value not in known:
        raise Misuse(f"{name} is {shown(value)}{suggestion(value if isinstance(value, str) else '', known, most=99)}")


def whole(name: str, value: object, least: int = 0) -> None:
    """Refuse what is not a whole number from `least` up."""
    if isinstance(value, bool) or not isinstance(value, int) or value < least:
        hint = "; divide with //" if isinstance(value, float) else ""
        raise Misuse(f"{name} is {shown(value)}, not a whole number from {least}{hint}")


def counts(name: str, value: object, most: int = 3) -> tuple[int, int, int]:
    """Up to three whole numbers from 1, filled up with 1."""
    given: tuple[Any, ...] = tuple(value) if isinstance(value, tuple | list) else (value,)
    if not 1 <= len(given) <= most:
        raise Misuse(f"{name} is {shown(value)}, not one to three whole numbers")
    for number in given:
        if isinstance(number, bool) or not isinstance(number, int) or number < 1:
            hint = "; divide with //" if isinstance(number, float) else ""
            raise Misuse(f"{name} is {shown(value)}; each is a whole number from 1{hint}")
    x, y, z = (*given, 1, 1)[:3]
    return x, y, z


def objects(value: object) -> str | tuple[str, ...]:
    """Which objects a geometry step draws."""
    known = ("all", "opaque", "transparent", "casters")
    if isinstance(value, str):
        near = nearest(value, known)
        if near is not None and near != value:  # a name this close to a word is given as a list
            raise Misuse(f"objects is '{value}'; did you mean '{near}'? An object of this name is ['{value}']")
        return value if near == value else (value,)
    if not isinstance(value, list | tuple | set | frozenset) or not all(isinstance(name, str) for name in value):
        raise Misuse(f"objects is {shown(value)}; it is {', '.join(known)} or a list of objects' names")
    return tuple(value)


def attributes(ports: Mapping[str, Port], value: object) -> dict[str, Port]:
    """Layouts of a draw step's buffers: `3f 2f in_position in_uv` to the buffer's port."""
    if value is None:
        return {}
    if not isinstance(value, Mapping):
        raise Misuse(f"attributes is {shown(value)}, not a mapping from layouts to buffers")
    found = {}
    for layout, port in value.items():
        example = "it reads like '3f 2f in_position in_uv'"
        words = layout.split() if isinstance(layout, str) else []
        formats = [word for word in words if _ATTRIBUTE.match(word) or _PADDING.match(word)]
        names = words[len(formats) :]
        wanted = sum(not _PADDING.match(word) for word in formats)
        ordered = words[: len(formats)] == formats and all(name.isidentifier() for name in names)
        if not names or not formats or not ordered:
            raise Misuse(f"attributes has the layout {shown(layout)}; {example}")
        if wanted != len(names):
            raise Misuse(f"attributes has the layout {shown(layout)}: {wanted} formats, {len(names)} names; {example}")
        found[layout] = buffer(own_port(ports, port, f"attributes[{layout!r}]"), f"attributes[{layout!r}]")
    return found


def unconnected(port: Port) -> Misuse:
    """What to say of an input that nothing is linked to, where a step cannot do without."""
    return Misuse(f"input '{port.name}' is not connected; ask `steps.connected` first")


def buffer(port: Port, what: str) -> Port:
    """A port that is a buffer."""
    if getattr(port, "kind", "") != "buffer":
        raise Misuse(f"{what} is {shown(port)}, which is no buffer")
    return port


def macros(value: object) -> dict[str, str]:
    """A step's own macros as program text."""
    if value is None:
        return {}
    if not isinstance(value, Mapping):
        raise Misuse(f"defines is {shown(value)}, not a mapping from macros to values")
    return {name: macro(name, text) for name, text in value.items()}
