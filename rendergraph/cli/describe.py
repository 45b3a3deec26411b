"""A node type in plain values: what `nodes`, `explain` and the reference pages show."""

from __future__ import annotations

import inspect
from types import UnionType
from typing import TYPE_CHECKING, Any, Literal, Union, get_args, get_origin

if TYPE_CHECKING:
    from rendergraph.catalog import Catalog, NodeType
    from rendergraph.declare import Extensions, Parameter


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
        "extends": [_imported(base) for base in (cls, *_bases(cls))] if _is_importable(found) else [],
        "inputs": [_input(name, port) | _group(groups.get(name)) for name, port in cls.inputs().items()],
        "outputs": [_output(name, port) for name, port in outputs.items()],
        "internal": [_made(name, port) for name, port in internal.items()],
        "parameters": [_parameter(one, extensions or NO_EXTENSIONS) for one in cls.parameters().values()],
    }


def _imported(cls: type) -> str:
    return f"from {cls.__module__} import {cls.__name__}"


def _bases(cls: type) -> list[type]:
    """The nodes that a class extends, the nearest first."""
    from rendergraph.declare import Node

    return [base for base in cls.__mro__[1:] if issubclass(base, Node) and base is not Node]


def _is_importable(found: NodeType) -> bool:
    """Whether others get the class by an import: it comes with an installed package."""
    from rendergraph.catalog.catalog import GROUP
    from rendergraph.installed import entry_points

    return not found.is_shader and any(entry.name == found.plugin for entry in entry_points(GROUP))


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
        "filter": _constant(port.filter),
        "wrap": port.wrap,
        "compare": port.compare,
        "anisotropy": port.anisotropy,
        "samples": port.samples,
        "use": port.use,
        "doc": port.doc,
    }


_COMPUTED = "computed"


def _output(name: str, port: Any) -> dict[str, Any]:
    from rendergraph.declare import Function, InOut, Views

    if isinstance(port, InOut) and not port.optional:  # its texture is what is connected
        return {
            "name": name,
            "kind": port.kind,
            "semantic": port.semantic and port.semantic.name,
            "like": port.like,
            "continues": True,
            "doc": port.doc,
        }
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
    if port.kind == "buffer":
        found["bytes"] = _constant(port.bytes)
    elif port.like is None:
        found |= {"format": _constant(port.format or "rgba16f"), "size": _size(1.0 if port.size is None else port.size)}
    else:
        found |= {"format": _constant(port.format)} if port.format is not None else {}
        found |= {"size": _size(port.size)} if port.size is not None else {}
    for key in ("mips", "layers", "samples"):
        if getattr(port, key) not in (None, 1):
            found[key] = _constant(getattr(port, key))
    if port.clear is not None:
        found["clear"] = _constant(list(port.clear) if isinstance(port.clear, tuple) else port.clear)
    if getattr(port, "needs", ()):
        found["needs"] = list(port.needs)
    if getattr(port, "kept", False):
        found["kept"] = True
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


def _parameter(parameter: Parameter, extensions: Extensions) -> dict[str, Any]:
    from rendergraph.glsl import about  # only where a plugin is asked what it adds
    from rendergraph.glsl.source import needs  # likewise

    open_name, default = parameter.open_name, parameter.default
    added = extensions.choices(open_name) if open_name else []
    annotation = parameter.closed(tuple(one.name for one in added))
    found: dict[str, Any] = {
        "name": parameter.name,
        "type": type_words(annotation) + (" | …" if open_name else ""),  # plugins may add to it
        "default": list(default) if isinstance(default, tuple) else default,
        "role": parameter.role,
        "unit": parameter.unit,
        "doc": parameter.doc,
    }
    if get_origin(annotation) is Literal:
        found["choices"] = list(get_args(annotation))
    if open_name:
        found["open"] = open_name
        found["added"] = [
            {"name": one.name, "plugin": one.plugin, "doc": about(one.value), "needs": list(needs(one.value))}
            for one in added
        ]
    limits = {"min": parameter.limits.low, "max": parameter.limits.high}
    return found | {word: limit for word, limit in limits.items() if limit is not None}


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


def in_a_file(found: NodeType, catalog: Catalog) -> str:
    """A pipeline that runs with this node in it; where none can be put together, its entry with gaps to fill in."""
    from rendergraph.example import example

    return (example(found, catalog) or _entry(describe(found))).rstrip()


def _entry(described: dict[str, Any]) -> str:
    """A node of this type in a pipeline file, with every input it must have."""
    from rendergraph.catalog.types import node_word

    needed = [port for port in described["inputs"] if not port.get("optional")]
    groups = list(dict.fromkeys(port["group"] for port in needed if port.get("group")))
    links = [f"{group}: NODE" for group in groups]
    links += [f"{p['name']}: NODE.{p['name']}" for p in needed if not p.get("group")]
    parts = [f"type: {described['name']}"] + ([f"inputs: {{{', '.join(links)}}}"] if links else [])
    return f"{node_word(described['name'])}: {{{', '.join(parts)}}}"


# --- facts of a port in words ----------------------------------------------------------------------------------------


def meaning(port: dict[str, Any]) -> str:
    """What a port carries: `radiance`, or `like source`."""
    return str(port["semantic"] or (f"like {port['like']}" if port["like"] else ""))


def input_facts(port: dict[str, Any]) -> list[str]:
    """What an input takes beyond its meaning, where it is not the usual."""
    words = ["optional"] if port["optional"] else []
    words += ["one or a list"] if port.get("many") else []
    words += ["continued"] if port.get("continues") else []
    words += [f"in group {port['group']}"] if port.get("group") else []
    words += [port["kind"]] if port["kind"] not in ("texture2d", port["semantic"]) else []
    words += ["any size"] if port.get("size") == "any" else []
    words += [{"depth_test": "for the depth test alone", "image": "as an image"}.get(port.get("use", ""), "")]
    words += [{"multi": "multisampled", "any": "multisampled or not"}.get(port.get("samples", ""), "")]
    words += [{"nearest": "", _COMPUTED: "filter computed"}.get(port.get("filter", ""), port.get("filter", ""))]
    words += [{"clamp": ""}.get(port.get("wrap", ""), port.get("wrap", ""))]
    words += ["compared"] if port.get("compare") else []
    words += [f"anisotropy {port['anisotropy']}"] if port.get("anisotropy", 1) > 1 else []
    return [word for word in words if word]


def output_facts(port: dict[str, Any]) -> list[str]:
    """How an output or internal texture is allocated."""
    words = [port["kind"]] if port["kind"] not in ("texture2d", port["semantic"]) else []
    words += ["the input of its name, continued"] if port.get("continues") else []
    for key in ("format", "size"):
        if key in port:
            words.append(f"{key} computed" if port[key] == _COMPUTED else str(port[key]))
    words += [f"{port['bytes']} bytes"] if "bytes" in port else []
    words += ["all mips" if port["mips"] == 0 else f"{port['mips']} mips"] if "mips" in port else []
    words += [f"{port[key]} {key}" for key in ("layers", "samples") if key in port]
    words += [f"cleared to {_number_words(port['clear'])}"] if "clear" in port else []
    words += ["kept from frame to frame"] if port.get("kept") else []
    words += [f"needs {' and '.join(port['needs'])}"] if port.get("needs") else []
    words += [port["declaration"]] if port.get("declaration") else []
    return words


def _number_words(value: Any) -> str:
    if isinstance(value, list):
        return "[" + ", ".join(f"{part:g}" for part in value) + "]"
    return value if isinstance(value, str) else f"{value:g}"
