"""What can be wrong with the ports that a node declares, beyond what the annotations of their fields say."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from rendergraph.declare.node import Node
from rendergraph.errors import Problem, suggestion
from rendergraph.ports import Function, History, InOut, Input, Internal, Output, Port, Views, WrittenPort
from rendergraph.textures import Semantic, Signature
from rendergraph.typecheck import mistakes_of, quoted


def port_mistakes(cls: type[Node]) -> Iterator[Problem]:
    """What is wrong with a node's ports: first each field by itself, then what fields say of each other."""
    ports = cls.ports()
    for name, port in ports.items():
        wrong = list(mistakes_of(port, f"port '{name}'", name))
        texts = (*_alone(name, port), *_named(name, port, ports))
        yield from wrong or (Problem("RG490", text, subject=name) for text in texts)


def _alone(name: str, port: Port) -> Iterator[str]:
    """Rules between the fields of one port."""
    if isinstance(port, Input):
        wanted, example = (Signature, "ShadowLookup") if port.kind == "function" else (Semantic, "Radiance")
        if not isinstance(port.semantic, wanted):
            yield f"port '{name}': semantic is {quoted(port.semantic)}, not a {wanted.__name__} such as {example}"
    elif isinstance(port, WrittenPort):
        if port.semantic is None and port.like is None and not isinstance(port, Internal | History):
            yield f"port '{name}' has neither a semantic nor `like`"
        if port.kind != "buffer":
            if port.bytes != 0:
                yield f"port '{name}' has bytes={quoted(port.bytes)}, but is no buffer; say kind='buffer'"
            return
        if port.bytes == 0:
            yield f"port '{name}' is a buffer without bytes; say bytes=…, from 1 up"
        if isinstance(port, History):
            yield f"'{name}' is a History of a buffer; only textures keep last frame's values"
        if not callable(port.clear) and port.clear not in (None, 0):
            yield f"port '{name}' is a buffer, which is cleared to 0 alone, not to {port.clear!r}"


def _named(name: str, port: Port, ports: Mapping[str, Port]) -> Iterator[str]:
    """Rules that name other ports of the node."""
    inputs, viewed = (Input, InOut), (Input, InOut, Views)
    made = isinstance(port, WrittenPort)
    size = (port.size[0] if isinstance(port.size, tuple) else port.size) if isinstance(port, WrittenPort) else None
    needs = port.needs if isinstance(port, Output | Function) else ()
    reads = port.read_names if isinstance(port, Function) else ()
    named: list[tuple[str, object, tuple[type[Port], ...], str]] = [
        ("is like", getattr(port, "like", None), inputs, "no input"),
        ("is view", getattr(port, "view", None), viewed, "no input and no table of views"),
        ("is lights", getattr(port, "lights", None) if made else None, viewed, "no input and no table of views"),
        ("has the size of", size, inputs, "no input"),
        *(("needs", target, inputs, "no input") for target in needs),
        *(("reads", target, (Input, WrittenPort), "no texture and no buffer") for target in reads),
    ]
    for rule, target, kinds, otherwise in named:
        if isinstance(target, str) and target not in ports:
            yield f"port '{name}' {rule} '{target}', which is no port{suggestion(target, ports, most=0)}"
        elif isinstance(target, str) and not isinstance(ports[target], kinds):
            yield f"port '{name}' {rule} '{target}', which is {otherwise}"
