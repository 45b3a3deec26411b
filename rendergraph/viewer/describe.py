"""Describe a pipeline for the page: graph, parameters with their ranges and choices, plan, cameras."""

from __future__ import annotations

from collections.abc import Mapping, Sequence, Set
from pathlib import Path
from typing import Any

from rendergraph.declare import FileContent, InOut, Input, Parameter
from rendergraph.diagrams import graph_json, plan_json
from rendergraph.document import Value
from rendergraph.errors import InputError
from rendergraph.link import GraphNode
from rendergraph.read import entries
from rendergraph.scene.animate import moves
from rendergraph.session.values import Linked, Planned
from rendergraph.typecheck import accepts


def describe(planned: Planned) -> dict[str, Any]:
    """Return everything but pictures and times, as plain JSON values."""
    linked = planned.linked
    graph, spec, families = linked.graph, linked.spec, linked.catalog.families()
    ends = [end for reader in graph.nodes for links in reader.inputs.values() for end in links]
    ends += graph.outputs.values()
    written = entries(spec.tree, "nodes")
    nodes = {
        node.id: {
            "type": node.type.name,
            "base": _base(written[node.id], spec.path) if node.id in written else "",
            "doc": (node.type.cls.__doc__ or "").strip().partition("\n\n")[0].replace("\n", " "),
            **_types(linked, node, {end.port for end in ends if end.node == node.id}, families),
            "parameters": {name: _parameter(linked, node, one) for name, one in node.node.parameters().items()},
            "inputs": {
                name: _input(node, name, port)
                for name, port in node.node.inputs().items()
                if isinstance(port, Input | InOut)
            },
        }
        for node in graph.nodes
    }
    parameters = {
        name: {"value": each.value, "doc": each.doc, "min": each.min, "max": each.max, "kind": _kind(each.value)}
        for name, each in spec.parameters.items()
    }
    return {
        "name": graph.name,
        "description": spec.description,
        "size": list(graph.size),
        "nodes": nodes,
        "graph": graph_json(graph),
        "parameters": parameters,
        "disabled": list(graph.disabled),
        "plan": plan_json(planned.plan),
        "cameras": [name for name in linked.scene.cameras if not name.startswith("--")],  # without one given as text
        "outputs": list(graph.outputs),
        "scene": spec.scene_name,
        "environment": str(linked.selection.environment or ""),
        "views": list(entries(spec.tree, "views")),
        "moves": moves(linked.scene),
        "warnings": [problem.as_json() for problem in linked.warnings],
    }


def _base(node: Value, own: Path | None) -> str:
    """Return the name of the file that a node is inherited from; empty if the opened file or a setting changes it."""
    leaves, files = [node], set[Path | None]()
    while leaves:
        value = leaves.pop()
        below = list(value.mapping.values()) if isinstance(value.data, dict) else []
        leaves += below
        if not below:
            files.add(value.source.path)
    found = node.mapping["type"].source.path if "type" in node.mapping else None
    return "" if found is None or files & {own, None} else found.stem


def _types(
    linked: Linked, node: GraphNode, read: Set[str], families: Mapping[str, Sequence[str]]
) -> dict[str, list[str]]:
    """Return the types of a node's family: those that fit its links, of outputs that are `read`, and the others."""
    types: dict[str, list[str]] = {"types": [], "other_types": []}
    for name in families.get(node.type.family, ()):
        try:
            cls = linked.catalog.get(name).cls
        except InputError:  # a plugin that cannot be imported
            continue
        scene = {port for port, one in cls.inputs().items() if isinstance(one, Input) and one.takes_scene}
        needed = {port for port, one in cls.inputs().items() if not one.optional} - scene
        types["types" if read <= cls.outputs().keys() and needed <= node.inputs.keys() else "other_types"].append(name)
    return types


def _parameter(linked: Linked, node: GraphNode, parameter: Parameter) -> dict[str, Any]:
    value, extensions = getattr(node.node, parameter.name), linked.catalog.extensions
    added = tuple(one.name for one in extensions.choices(parameter.open_name)) if parameter.open_name else ()
    choices = [*parameter.choices, *added]
    return {
        "value": value,
        "default": parameter.default,
        "role": parameter.role,
        "doc": parameter.doc,
        "unit": parameter.unit,
        "min": parameter.limits.low,
        "max": parameter.limits.high,
        "choices": choices,
        "kind": "choice" if choices else "color" if parameter.glsl == "vec3" else _kind(value, parameter.type),
        "takes": parameter.takes(added),
        "idle": parameter.unless if node.inputs.get(parameter.unless) else "",
    }


def _kind(value: Any, annotation: Any = None) -> str:
    if accepts(annotation, FileContent):
        return "text"
    kinds: tuple[tuple[type, str], ...] = ((bool, "boolean"), (int, "integer"), (float, "number"), (str, "text"))
    return next((name for kind, name in kinds if isinstance(value, kind)), "json")


def _input(node: GraphNode, name: str, port: Input | InOut) -> dict[str, Any]:
    return {
        "doc": port.doc,
        "kind": port.kind,
        "semantic": getattr(port.semantic, "name", "any"),
        "optional": port.optional,
        "many": getattr(port, "many", False),
        "links": [str(end) for end in node.inputs.get(name, ())],
    }
