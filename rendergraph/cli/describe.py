"""A node type in plain values: what `nodes`, `explain` and the reference pages show."""

from __future__ import annotations

import inspect
from types import UnionType
from typing import TYPE_CHECKING, Any, Literal, Union, get_args, get_origin

if TYPE_CHECKING:
    from rendergraph.catalog import NodeType
    from rendergraph.declare import Extensions


def summary(found: NodeType) -> str:
    """The first line of its docs."""
    return (inspect.getdoc(found.cls) or "").partition("\n")[0]


def describe(found: NodeType, extensions: Extensions | None = None) -> dict[str, Any]:
    """Everything its declaration says, as plain JSON values.

    Args:
        found: the type.
        extensions: where the choices come from that plugins add.
    """
    from rendergraph.declare import NO_EXTENSIONS, History, Internal

    cls = found.cls
    groups = {member: group for group, members in cls.groups().items() for member in members}
    outputs = cls.outputs()
    internal = {n: p for n, p in cls.ports().items() if isinstance(p, Internal | History) and n not in outputs}
    return {
        "name": found.name,
        "family": found.family,
        "plugin": found.plugin,
        "file": str(found.file),
        "doc": inspect.getdoc(cls) or "",
        "inputs": [_input(name, port) | _group(groups.get(name)) for name, port in cls.inputs().items()],
        "outputs": [_output(name, port) for name, port in outputs.items()],
        "internal": [_made(name, port) for name, port in internal.items()],
        "parameters": [_parameter(cls, name, extensions or NO_EXTENSIONS) for name in cls.parameters()],
    }


def _group(group: str | None) -> dict[str, str]:
    return {"group": group} if group else {}


def _input(name: str, port: Any) -> dict[str, Any]:
    if not hasattr(port, "use"):  # an InOut: it continues what is connected
        return _made(name, port) | {"optional": port.optional, "continues": True}
    return {
        "name": name,
        "kind": port.kind,
        "semantic": port.semantic.name,
        "optional": port.optional,
        "many": port.many,
        "size": port.size,
        "filter": port.filter if isinstance(port.filter, str) else _COMPUTED,
        "doc": port.doc,
    }


_COMPUTED = "computed"


def _output(name: str, port: Any) -> dict[str, Any]:
    from rendergraph.declare import Function, Views

    if isinstance(port, Views):
        return {"name": name, "kind": "view", "semantic": "view", "doc": port.doc}
    if isinstance(port, Function):
        signature = port.signature
        found = {"name": name, "kind": "function", "semantic": signature.name, "declaration": signature.declaration}
        return found | {"needs": list(port.needs), "doc": port.doc}
    return _made(name, port)


def _made(name: str, port: Any) -> dict[str, Any]:
    semantic = port.semantic.name if port.semantic else None
    found = {"name": name, "kind": port.kind, "semantic": semantic, "like": port.like, "doc": port.doc}
    if port.like is None and port.kind != "buffer":
        found |= {"format": _constant(port.format or "rgba16f"), "size": _size(1.0 if port.size is None else port.size)}
        found |= {
            key: _constant(getattr(port, key))
            for key in ("mips", "layers", "samples")
            if getattr(port, key) not in (None, 1)
        }
    if getattr(port, "needs", ()):
        found["needs"] = list(port.needs)
    return found


def _constant(value: Any) -> Any:
    return _COMPUTED if callable(value) else value


def _size(rule: Any) -> str:
    if callable(rule):
        return _COMPUTED
    if isinstance(rule, str):
        return f"as {rule}"
    if isinstance(rule, tuple):
        return f"as {rule[0]} × {rule[1]:g}" if isinstance(rule[0], str) else f"{rule[0]}×{rule[1]}"
    return "viewport" if rule == 1 else f"viewport × {rule:g}"


def _parameter(cls: Any, name: str, extensions: Extensions) -> dict[str, Any]:
    from rendergraph.declare import closed, open_name

    info = cls.parameters()[name]
    added = extensions.choices(open_name(info)) if open_name(info) else []
    annotation = closed(info, tuple(one.name for one in added))
    extra = info.json_schema_extra if isinstance(info.json_schema_extra, dict) else {}
    found: dict[str, Any] = {
        "name": name,
        "type": type_words(annotation),
        "default": list(info.default) if isinstance(info.default, tuple) else info.default,
        "role": cls.role_of(name),
        "unit": extra.get("unit", ""),
        "doc": info.description or "",
    }
    if choices := _choices(annotation):
        found["choices"] = choices
    if open_name(info):
        found["open"] = open_name(info)
        found["added"] = [
            {"name": one.name, "plugin": one.plugin, "doc": one.value.doc, "needs": list(one.value.needs)}
            for one in added
        ]
    found |= {word: extra[key] for word, key in (("min", "minimum"), ("max", "maximum")) if key in extra}
    return found


def _choices(annotation: Any) -> list[Any]:
    return list(get_args(annotation)) if get_origin(annotation) is Literal else []


def type_words(annotation: Any) -> str:
    """A type as the YAML file shows it: `number`, `[number, number]`, `neutral | aces`."""
    origin, args = get_origin(annotation), get_args(annotation)
    if origin is Literal:
        return " | ".join(str(arg) for arg in args)
    if origin in (Union, UnionType):
        return " | ".join(dict.fromkeys(type_words(arg) for arg in args))
    if origin in (tuple, list):
        if origin is list or (len(args) == 2 and args[1] is Ellipsis):
            return f"[{type_words(args[0])}, …]"
        return "[" + ", ".join(type_words(arg) for arg in args) + "]"
    names = {float: "number", int: "whole number", bool: "true | false", str: "text", type(None): "null"}
    return names.get(annotation, getattr(annotation, "__name__", str(annotation)))


def example(described: dict[str, Any]) -> str:
    """A node of this type in a pipeline file, with every input it must have."""
    needed = [port for port in described["inputs"] if not port.get("optional")]
    groups = list(dict.fromkeys(port["group"] for port in needed if port.get("group")))
    links = [f"{group}: NODE" for group in groups]
    links += [f"{p['name']}: NODE.{p['name']}" for p in needed if not p.get("group")]
    parts = [f"type: {described['name']}"] + ([f"inputs: {{{', '.join(links)}}}"] if links else [])
    return f"{described['name']}: {{{', '.join(parts)}}}"
