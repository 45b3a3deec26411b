"""A node type as plain JSON values, and its ports in words."""

from __future__ import annotations

import inspect
from typing import TYPE_CHECKING, Any, Literal, get_args, get_origin

from rendergraph.formatting import format_value

if TYPE_CHECKING:
    from rendergraph.catalog import NodeType
    from rendergraph.declare import Extensions, Parameter

_COMPUTED = "computed"


def summary(node_type: NodeType) -> str:
    return (inspect.getdoc(node_type.cls) or "").partition("\n")[0]


def describe_node(node_type: NodeType, extensions: Extensions | None = None) -> dict[str, Any]:
    """Return everything that the declaration of a node type says; `extensions` add choices of plugins."""
    from rendergraph.declare import NO_EXTENSIONS, History, Internal  # `nodes` is loaded for `--help`, too

    cls = node_type.cls
    groups = {member: group for group, members in cls.groups().items() for member in members}
    outputs = cls.outputs()
    internal = {n: p for n, p in cls.ports().items() if isinstance(p, Internal | History) and n not in outputs}
    return {
        "name": node_type.name,
        "family": node_type.family,
        "plugin": node_type.plugin,
        "file": str(node_type.file),
        "doc": inspect.getdoc(cls) or "",
        "twin": cls.twin if cls.twin != node_type.name else None,
        "extends": _import_lines(node_type),
        "inputs": [
            _input(name, port) | ({"group": groups[name]} if name in groups else {})
            for name, port in cls.inputs().items()
        ],
        "outputs": [_output(name, port) for name, port in outputs.items()],
        "internal": [_texture(name, port) for name, port in internal.items()],
        "parameters": [_parameter(one, extensions or NO_EXTENSIONS) for one in cls.parameters().values()],
    }


def _import_lines(node_type: NodeType) -> list[str]:
    """How to import the class and its bases, nearest first; only possible for classes of installed packages."""
    from rendergraph.catalog.catalog import GROUP  # see above
    from rendergraph.declare import Node  # see above
    from rendergraph.installed import entry_points  # see above

    if node_type.is_shader or all(entry.name != node_type.plugin for entry in entry_points(GROUP)):
        return []
    classes = [cls for cls in node_type.cls.__mro__ if issubclass(cls, Node) and cls is not Node]
    return [f"from {cls.__module__} import {cls.__name__}" for cls in classes]


def _input(name: str, port: Any) -> dict[str, Any]:
    if not hasattr(port, "use"):  # an InOut, which continues what is connected
        return _texture(name, port) | {"optional": port.optional, "continues": True}
    keys = ("kind", "optional", "many", "size", "wrap", "border", "compare", "anisotropy", "samples", "use", "doc")
    facts = {"name": name, "semantic": port.semantic.name, "filter": _constant(port.filter), **_element(port)}
    return facts | {key: getattr(port, key) for key in keys}


def _output(name: str, port: Any) -> dict[str, Any]:
    from rendergraph.declare import Function, InOut, Views  # see above

    if isinstance(port, Views):
        return {"name": name, "kind": "view", "semantic": "view", "doc": port.doc}
    if isinstance(port, Function):
        signature = port.signature
        facts = {"name": name, "kind": "function", "semantic": signature.name, "declaration": signature.declaration}
        return facts | {"needs": list(port.needs), "doc": port.doc}
    if isinstance(port, InOut) and not port.optional:  # its texture is the connected one
        return _carried(name, port) | {"continues": True}
    return _texture(name, port)


def _carried(name: str, port: Any) -> dict[str, Any]:
    semantic = port.semantic.name if port.semantic else None
    return {"name": name, "kind": port.kind, "semantic": semantic, "like": port.like, "doc": port.doc}


def _element(port: Any) -> dict[str, Any]:
    return {"element": port.element.name, "fields": dict(port.element.fields)} if port.element is not None else {}


def _texture(name: str, port: Any) -> dict[str, Any]:
    facts = _carried(name, port)
    if port.kind == "buffer" and port.element is not None:
        facts |= {**_element(port), "count": _constant(port.count)}
    elif port.kind == "buffer":
        facts["bytes"] = _constant(port.bytes)
    else:
        defaults = ("rgba16f", 1.0) if port.like is None else (None, None)
        for key, value, default in zip(("format", "size"), (port.format, port.size), defaults, strict=True):
            if (given := default if value is None else value) is not None:
                facts[key] = _size(given) if key == "size" else _constant(given)
    for key in ("mips", "layers", "samples"):
        if getattr(port, key) not in (None, 1):
            facts[key] = _constant(getattr(port, key))
    if port.clear is not None:
        facts["clear"] = _constant(list(port.clear) if isinstance(port.clear, tuple) else port.clear)
    if getattr(port, "needs", ()):
        facts["needs"] = list(port.needs)
    if getattr(port, "kept", False):
        facts["kept"] = True
    return facts


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
    from rendergraph.glsl import about  # only needed for choices of plugins
    from rendergraph.glsl.source import needs  # likewise
    from rendergraph.typecheck import brief  # `nodes` is loaded for `--help`, too

    open_name, default = parameter.open_name, parameter.default
    added = extensions.choices(open_name) if open_name else []
    annotation = parameter.closed(tuple(one.name for one in added))
    facts: dict[str, Any] = {
        "name": parameter.name,
        "type": brief(annotation) + (" | …" if open_name else ""),  # plugins may add to it
        "default": list(default) if isinstance(default, tuple) else default,
        "role": parameter.role,
        "unit": parameter.unit,
        "doc": parameter.doc,
    }
    if get_origin(annotation) is Literal:
        facts["choices"] = list(get_args(annotation))
    if open_name:
        facts["open"] = open_name
        facts["added"] = [
            {"name": one.name, "plugin": one.plugin, "doc": about(one.value), "needs": list(needs(one.value))}
            for one in added
        ]
    limits = {"min": parameter.limits.low, "max": parameter.limits.high}
    return facts | {name: limit for name, limit in limits.items() if limit is not None}


# --- facts of a port in words ----------------------------------------------------------------------------------------


def meaning(port: dict[str, Any]) -> str:
    """Return what a port carries: `radiance`, or `like source`."""
    return str(port["semantic"] or (f"like {port['like']}" if port["like"] else ""))


def input_facts(port: dict[str, Any]) -> list[str]:
    """Return what an input accepts beyond its meaning, where it is not the default."""
    anisotropy = port.get("anisotropy", 1)
    facts = [
        port["optional"] and "optional",
        port.get("many") and "one or a list",
        port.get("continues") and "continued",
        port.get("group") and f"in group {port['group']}",
        port["kind"] not in ("texture2d", port["semantic"]) and port["kind"],
        "element" in port and f"elements {port['element']}",
        port.get("size") == "any" and "any size",
        {"depth_test": "for the depth test only", "image": "as an image"}.get(port.get("use", "")),
        {"multi": "multisampled", "any": "multisampled or not"}.get(port.get("samples", "")),
        {"nearest": "", _COMPUTED: "filter computed"}.get(port.get("filter", ""), port.get("filter")),
        port.get("wrap") != "clamp" and port.get("wrap"),
        port.get("border") is not None and f"border value {format_value(port['border'])}",
        port.get("compare") and "compared",
        anisotropy > 1 and f"anisotropy {anisotropy}",
    ]
    return [fact for fact in facts if fact]


def output_facts(port: dict[str, Any]) -> list[str]:
    sizes = [
        f"{key} computed" if port[key] == _COMPUTED else str(port[key]) for key in ("format", "size") if key in port
    ]
    mips = port.get("mips", 1)
    facts = [
        port["kind"] not in ("texture2d", port["semantic"]) and port["kind"],
        port.get("continues") and "continues the input of its name",
        *sizes,
        "bytes" in port and f"{port['bytes']} bytes",
        "count" in port and f"{port['count']} elements {port['element']}",
        mips != 1 and ("all mips" if mips == 0 else f"{mips} mips"),
        *(f"{port[key]} {key}" for key in ("layers", "samples") if key in port),
        "clear" in port and f"cleared to {format_value(port['clear'])}",
        port.get("kept") and "kept from frame to frame",
        port.get("needs") and f"needs {' and '.join(port['needs'])}",
        port.get("declaration"),
    ]
    return [fact for fact in facts if fact]
