"""Node types that nobody has: what to say, and what stands in for them where a graph is only looked at."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from rendergraph.catalog import Catalog, NodeType
from rendergraph.declare import Input, Node, Output, Parameter
from rendergraph.document import Value, shown
from rendergraph.errors import nearest, shown_file
from rendergraph.resolve import NodeSpec, PipelineSpec
from rendergraph.settings import nearest as nearest_settings
from rendergraph.textures import Any as AnyTexture

_LINK = re.compile(r"([^.@]+)(?:\.([^.@]+))?(?:@previous)?\Z")


def unknown_type(spec: PipelineSpec, catalog: Catalog, name: str) -> str:
    """That there is no such type, and the way out."""
    if name in spec.unrun:
        return f"node type '{name}' is Python, which no pipeline file runs; say --plugin {spec.unrun[name]}"
    text = f"there is no node type '{shown(name)}'"
    near = nearest(name, catalog.names())
    if near is not None:
        text += f"; did you mean '{near}'?"
    if spec.missing:
        return f"{text}; it may come with what is not installed: {', '.join(spec.missing)}"
    project = nearest_settings(spec.path.parent) if spec.path is not None else None
    if project is not None and project.plugins and not Path.cwd().resolve().is_relative_to(project.folder):
        return f"{text}; {shown_file(project.file)} names plugins, but only for those who stand in its folder"
    if near is not None:
        return text
    return f"{text}; install the plugin that brings it, or name its file: --plugin; explain RG102 has all ways"


def stand_in(spec: PipelineSpec, node: NodeSpec) -> NodeType:
    """A type that takes what the file gives it and makes what the file asks of it; it can be drawn, not run."""
    taken = {name: Input(AnyTexture, optional=True, many=_is_list(value)) for name, value in node.inputs.items()}
    made = {name: Output(AnyTexture) for name in _asked_of(spec, node.id)}
    ports = {name: port for name, port in {**taken, **made}.items() if not hasattr(Node, name)}
    params = {
        name: Parameter("structural", None, type=Any)
        for name in node.params
        if name.isidentifier() and not name.startswith("_") and not hasattr(Node, name) and name not in ports
    }
    about = {"__module__": __name__, "__doc__": "A node of unknown type."}
    cls = type("Unknown", (Node,), {**about, **ports, **params})
    return NodeType(node.type, "", cls, Path(), Path(), "", missing=True)


def _is_list(value: Value) -> bool:
    return isinstance(value.data, list)


def _asked_of(spec: PipelineSpec, wanted: str) -> list[str]:
    """The ports of a node that links and outputs of the file name."""
    found: dict[str, None] = {}
    for scope, name, value in _links(spec):
        for part in value.data if isinstance(value.data, list) else [value]:
            match = _LINK.match(part.data) if isinstance(part.data, str) else None
            if match is not None and f"{scope}{match[1]}" == wanted:
                found[match[2] or name] = None
    return list(found)


def _links(spec: PipelineSpec) -> Iterator[tuple[str, str, Value]]:
    """Everything that may name a port: the scope it stands in, the port it is for, the value."""
    tables: list[tuple[str, Mapping[str, Value]]] = [("", spec.outputs)]
    tables += [(node.scope, node.inputs) for node in spec.nodes.values()]
    for scope, inner in spec.scopes.items():
        tables += [(inner.parent, inner.links), (scope, inner.outputs)]
    for scope, table in tables:
        for name, value in table.items():
            yield scope, name, value
