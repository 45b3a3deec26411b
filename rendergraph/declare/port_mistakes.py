"""What can be wrong with the ports that a node declares."""

from __future__ import annotations

from collections.abc import Iterator
from math import inf
from typing import Any, get_args

from rendergraph.declare.node import Node
from rendergraph.errors import Mistake, suggestion
from rendergraph.ports import Function, History, InOut, Input, Internal, Made, Output, Part, Port, Views
from rendergraph.textures import FORMATS, TEXTURE_KINDS, Filter, Kind, Semantic, Signature, Wrap


def port_mistakes(cls: type[Node]) -> list[Mistake]:
    """What is wrong with a node's ports."""
    found: list[Mistake] = []
    for name, port in cls.ports().items():
        texts: list[str] = []
        if isinstance(port, Input):
            texts += _input(name, port)
        elif isinstance(port, Made):
            texts += _made(name, port, cls.ports())
        elif isinstance(port, Views):
            texts += _views(name, port)
        elif isinstance(port, Function):
            texts += _function(name, port)
        texts += _named(name, port, cls.ports())
        found += [Mistake(name, text) for text in texts]
    return found


def _word(name: str, what: str, value: object, known: tuple[str, ...]) -> Iterator[str]:
    if not isinstance(value, str) or value not in known:
        near = suggestion(value if isinstance(value, str) else "", known, most=len(known))
        yield f"port '{name}' has {what} {value!r}{near}"


def _switches(name: str, port: Port, *flags: str) -> Iterator[str]:
    for flag in flags:
        if not isinstance(getattr(port, flag), bool):
            yield f"port '{name}' has {flag}={getattr(port, flag)!r}; it is True or False"


def _whole(name: str, what: str, value: object, least: int) -> Iterator[str]:
    if value is None or callable(value):
        return
    if isinstance(value, bool) or not isinstance(value, int) or value < least:
        yield f"port '{name}' has {what}={value!r}; it is a whole number from {least}, or a function of node and facts"


def _input(name: str, port: Input) -> Iterator[str]:
    yield from _word(name, "kind", port.kind, get_args(Kind))
    if not isinstance(port.kind, str):
        return
    wanted = Signature if port.kind == "function" else Semantic
    if not isinstance(port.semantic, wanted):
        yield f"port '{name}' has the semantic {port.semantic!r}; it is a {wanted.__name__}, such as " + (
            "ShadowLookup" if wanted is Signature else "Radiance"
        )
    yield from _word(name, "size", port.size, ("same", "any"))
    if not callable(port.filter):
        yield from _word(name, "filter", port.filter, get_args(Filter))
    yield from _word(name, "wrap", port.wrap, get_args(Wrap))
    yield from _word(name, "samples", port.samples, ("single", "multi", "any"))
    yield from _word(name, "use", port.use, ("sample", "depth_test", "image"))
    yield from _whole(name, "anisotropy", port.anisotropy, 1)
    yield from _switches(name, port, "compare", "optional", "many")
    if port.group is not None and not isinstance(port.group, str):
        yield f"port '{name}' has group={port.group!r}; it is the group's name"


def _made(name: str, port: Made, ports: dict[str, Port]) -> Iterator[str]:
    yield from _word(name, "kind", port.kind, (*sorted(TEXTURE_KINDS), "buffer"))
    if not isinstance(port.kind, str):
        return
    if port.semantic is not None and not isinstance(port.semantic, Semantic):
        yield f"port '{name}' has the semantic {port.semantic!r}; it is a Semantic, such as Radiance"
    elif port.semantic is None and port.like is None and not isinstance(port, Internal | History):
        yield f"port '{name}' has neither a semantic nor `like`"
    if isinstance(port.format, str) and port.format not in FORMATS:
        yield f"port '{name}' has an unknown format '{port.format}'{suggestion(port.format, FORMATS)}"
    elif port.format is not None and not isinstance(port.format, str) and not callable(port.format):
        yield f"port '{name}' has format={port.format!r}; it is the name of one, such as 'rgba16f'"
    yield from _whole(name, "mips", port.mips, 0)
    yield from _whole(name, "layers", port.layers, 0)
    yield from _whole(name, "samples", port.samples, 1)
    yield from _size(name, port.size, ports)
    if port.kind == "buffer":
        yield from _whole(name, "bytes", port.bytes, 1)
        if isinstance(port, History):
            yield f"'{name}' is a History of a buffer; only textures keep last frame's values"
        if not callable(port.clear) and not (port.clear is None or (_is_texel(port.clear) and port.clear == 0)):
            yield f"port '{name}' is a buffer, which is cleared to 0 alone, not to {port.clear!r}"
    elif not callable(port.clear) and port.clear is not None and not _is_texel(port.clear):
        yield f"port '{name}' has clear={port.clear!r}; it is a number, up to four of them, or None"
    if port.kind != "buffer" and not (isinstance(port.bytes, int) and port.bytes == 0):
        yield f"port '{name}' has bytes={port.bytes!r}, but is no buffer; say kind='buffer'"
    if isinstance(port, InOut):
        yield from _switches(name, port, "optional")
    if isinstance(port, Output | Internal):
        yield from _switches(name, port, "kept")
    if port.first is not None and (isinstance(port.first, bool) or not isinstance(port.first, int | float)):
        yield f"port '{name}' has first={port.first!r}; it is a number, for every channel"


def _is_texel(value: object) -> bool:
    numbers = value if isinstance(value, tuple) else (value,)
    return 1 <= len(numbers) <= 4 and all(isinstance(number, int | float) for number in numbers)


def _size(name: str, rule: Any, ports: dict[str, Port]) -> Iterator[str]:
    """A size is a factor, width and height, an input's name, that with a factor, or a function."""
    if rule is None or callable(rule):
        return
    source = rule if isinstance(rule, str) else rule[0] if isinstance(rule, tuple) and len(rule) == 2 else None
    if isinstance(source, str):
        if not isinstance(ports.get(source), Input | InOut):
            yield f"port '{name}' has the size of '{source}', which is no input{_near(source, ports)}"
        factor = rule[1] if isinstance(rule, tuple) else 1.0
        if isinstance(factor, bool) or not isinstance(factor, int | float) or not 0 < factor < inf:
            yield f"port '{name}' has the size of '{source}' times {factor!r}; a factor is a number above 0"
    elif isinstance(rule, tuple):
        if len(rule) != 2 or not all(isinstance(n, int) and not isinstance(n, bool) and n > 0 for n in rule):
            yield f"port '{name}' has size={rule!r}; width and height are whole numbers from 1"
    elif isinstance(rule, bool) or not isinstance(rule, int | float) or not 0 < rule < inf:
        yield f"port '{name}' has size={rule!r}; a factor of the viewport is a number above 0"


def _views(name: str, port: Views) -> Iterator[str]:
    yield from _whole(name, "count", port.count, 0)
    yield from _switches(name, port, "public")
    if port.lights is not None and not callable(port.lights):
        yield f"port '{name}' has lights={port.lights!r}; it is a function of node and facts"


def _function(name: str, port: Function) -> Iterator[str]:
    if not isinstance(port.signature, Signature):
        yield f"port '{name}' has the signature {port.signature!r}; it is a Signature, such as ShadowLookup"
    if not isinstance(port.shader, str) or not port.shader:
        yield f"port '{name}' has shader={port.shader!r}; it is the name of the file with its text"
    for read in port.reads if isinstance(port.reads, tuple | list) else (port.reads,):
        if not isinstance(read, str | Part) or isinstance(port.reads, str):
            yield f"port '{name}' reads {read!r}; `reads` holds names of ports, or ports with `.sampled(…)`"


def _named(name: str, port: Port, ports: dict[str, Port]) -> Iterator[str]:
    """Rules that name other ports of the node."""
    takes: tuple[tuple[str, tuple[type, ...], str], ...] = (
        ("like", (Input, InOut), "no input"),
        ("view", (Input, InOut, Views), "no input and no table of views"),
        ("lights", (Input, InOut, Views), "no input and no table of views"),
    )
    for rule, kinds, otherwise in takes:
        target = getattr(port, rule, None)
        if target is None or (rule == "lights" and callable(target)) or isinstance(port, Views):
            continue
        if not isinstance(target, str):
            yield f"port '{name}' has {rule}={target!r}; it is the name of another port"
        elif target not in ports:
            yield f"port '{name}' is {rule} '{target}', which is no port{_near(target, ports)}"
        elif not isinstance(ports[target], kinds):
            yield f"port '{name}' is {rule} '{target}', which is {otherwise}"
    needs = getattr(port, "needs", ())
    for target in needs if isinstance(needs, tuple | list) else (needs,):
        if not isinstance(target, str) or isinstance(needs, str):
            yield f"port '{name}' has needs={needs!r}; it is a tuple of inputs' names"
        elif target not in ports:
            yield f"port '{name}' needs '{target}', which is no port{_near(target, ports)}"
        elif not isinstance(ports[target], Input | InOut):
            yield f"port '{name}' needs '{target}', which is no input"
    reads = getattr(port, "reads", ())
    for read in reads if isinstance(reads, tuple | list) else ():
        target = read.port.name if isinstance(read, Part) else read
        if isinstance(target, str) and not isinstance(ports.get(target), Input | Made):
            yield f"port '{name}' reads '{target}', which is no port{_near(target, ports)}"


def _near(name: str, ports: dict[str, Port]) -> str:
    return suggestion(name, ports, most=0) if name not in ports else ""
