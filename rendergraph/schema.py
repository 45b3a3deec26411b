"""The JSON Schema of pipeline files, for editors: every installed node type with its inputs and parameters."""

from __future__ import annotations

import inspect
from collections.abc import Iterable, Mapping
from typing import Any

from rendergraph.catalog import Catalog
from rendergraph.declare import Function, InOut, Input, Node, Port, Views
from rendergraph.errors import InputError
from rendergraph.read import INPUT_KEYS, NAME, NODE_KEYS, PARAMETER_KEYS, TOP_KEYS, VERSION
from rendergraph.resolve import MOST_SIDE
from rendergraph.textures import Signature

Schema = dict[str, Any]

_NAMES = {"pattern": "^" + NAME.pattern.replace("\\Z", "$")}
_LINK: Schema = {"type": ["string", "null"], "description": "`node.port`, a node's id, or null for nothing."}
_SIDE: Schema = {"type": "integer", "minimum": 1, "maximum": MOST_SIDE}
_OWN_WORDS = ("role", "unit", "glsl", "title")


def schema(catalog: Catalog) -> Schema:
    """A draft-07 schema, which is what editors read.

    A type that cannot be imported is a legal word without further rules: its plugin's mistake is not the file's.
    """
    types: dict[str, type[Node] | None] = {}
    for name in catalog.names():
        try:
            types[name] = catalog.get(name).cls
        except InputError:
            types[name] = None
    properties: Schema = {
        "rendergraph": {"const": VERSION, "description": "Version of the format."},
        "description": {"type": "string", "description": "What the pipeline shows, in a line."},
        "extends": {"type": "string", "description": "A shipped pipeline or a file; the rest is a merge patch on it."},
        "size": {"type": "array", "items": [_SIDE, _SIDE], "minItems": 2, "maxItems": 2,
                 "description": "Width and height in pixels."},
        "scene": {"type": "string", "description": "A shipped scene, a scene file, .obj, .gltf or .glb."},
        "parameters": _mapping({"$ref": "#/definitions/parameter"}, "Knobs of the whole pipeline, used as $name."),
        "inputs": _mapping({"$ref": "#/definitions/input"}, "What the file takes as the type of a node."),
        "nodes": _mapping({"$ref": "#/definitions/node"}, "Nodes by id."),
        "outputs": _mapping(_LINK, "Output name to `node.port`."),
    }  # fmt: skip
    return {
        "$schema": "http://json-schema.org/draft-07/schema#",
        "title": "rendergraph pipeline",
        **_object(TOP_KEYS, properties),
        "definitions": {
            "parameter": _object(PARAMETER_KEYS, {
                "default": {"description": "Its value where nothing sets it."},
                "min": {"type": "number", "description": "Least legal value."},
                "max": {"type": "number", "description": "Greatest legal value."},
                "doc": {"type": "string", "description": "What it does, in a line."},
            }),
            "input": _object(INPUT_KEYS, {
                "semantic": {"type": "string", "description": "What its texels mean, such as `radiance`."},
                "optional": {"type": "boolean", "description": "Whether it may stay unconnected."},
                "doc": {"type": "string", "description": "What it is for, in a line."},
            }),
            "node": _node(types),
        },
    }  # fmt: skip


def _object(keys: Iterable[str], properties: Mapping[str, Schema]) -> Schema:
    """A mapping of known keys."""
    table = {key: _nullable(properties[key]) for key in keys}
    return {"type": ["object", "null"], "additionalProperties": False, "properties": table}


def _mapping(values: Schema, doc: str) -> Schema:
    """A mapping of free names."""
    return {"type": "object", "propertyNames": _NAMES, "additionalProperties": _nullable(values), "description": doc}


def _nullable(values: Schema) -> Schema:
    """The same or null, which removes something in a file that extends another; definitions allow it themselves."""
    if isinstance(values.get("type"), str):
        return {**values, "type": [values["type"], "null"]}
    return values


def _node(types: Mapping[str, type[Node] | None]) -> Schema:
    known: list[Schema] = [
        {"const": name, "description": (inspect.getdoc(cls) or "") if cls else ""} for name, cls in types.items()
    ]
    elsewhere: list[Schema] = [
        {"type": "string", "pattern": "[./]", "description": "A pipeline file whose outputs are the node's."},
        {"$ref": "#"},
    ]
    found = _object(NODE_KEYS, {
        "type": {"anyOf": [*known, *elsewhere, {"type": "null"}], "description": "A node type, or a pipeline file."},
        "inputs": {"type": "object", "description": "Input to `node.port`, to a node's id, or to null for nothing."},
        "params": {"type": "object", "description": "Parameter to value; null is its default."},
    })  # fmt: skip
    found["allOf"] = [
        {
            "if": {"properties": {"type": {"const": name}}, "required": ["type"]},
            "then": {"properties": {"inputs": _inputs(cls), "params": _params(cls)}},
        }
        for name, cls in types.items()
        if cls is not None
    ]
    return found


def _inputs(cls: type[Node]) -> Schema:
    links = {name: _link(port) for name, port in cls.inputs().items()}
    for group, members in cls.groups().items():
        links[group] = {**_LINK, "description": f"The id of a node with {', '.join(members)}."}
    return {"type": ["object", "null"], "additionalProperties": False, "properties": links}


def _link(port: Input | InOut) -> Schema:
    found = {**_LINK, "description": f"{port.doc} ({port_type(port)})"}
    if isinstance(port, Input) and port.many:
        found |= {"type": ["string", "null", "array"], "items": {"type": "string"}}
    return found


def port_type(port: Port) -> str:
    """What a port carries, in a few words: `radiance`, `shadow(), many`, `depth, buffer`."""
    if isinstance(port, Function):
        return f"{port.signature.name}()"
    if isinstance(port, Views):
        return "view"
    semantic = getattr(port, "semantic", None)
    words = [f"{semantic.name}()" if isinstance(semantic, Signature) else semantic.name if semantic else "any"]
    kind = getattr(port, "kind", "texture2d")
    if kind not in ("texture2d", "function", words[0]):
        words.append(kind)
    if getattr(port, "many", False):
        words.append("many")
    if getattr(port, "optional", False):
        words.append("optional")
    return ", ".join(words)


def _params(cls: type[Node]) -> Schema:
    properties: Schema = cls.model_json_schema().get("properties", {})
    return {
        "type": ["object", "null"],
        "additionalProperties": False,
        "properties": {name: _param(found) for name, found in properties.items()},
    }


def _param(found: Schema) -> Schema:
    """One parameter: its own values, null for the default, or a parameter of the pipeline."""
    doc, unit, default = found.get("description", ""), found.get("unit"), found.get("default")
    own = _draft_07({key: value for key, value in found.items() if key not in ("description", "default", *_OWN_WORDS)})
    if "anyOf" in own:  # limits beside alternatives hold for those that are numbers
        limits = {key: own.pop(key) for key in ("minimum", "maximum") if key in own}
        own["anyOf"] = [
            {**part, **limits} if part.get("type") in ("number", "integer") else part for part in own["anyOf"]
        ]
    text = f"{doc} In {unit}." if unit else doc
    reference = {"type": "string", "pattern": "^\\$"}
    return {"description": text, "default": default, "anyOf": [own, {"type": "null"}, reference]}


def _draft_07(value: Any) -> Any:
    """Pydantic writes draft 2020-12, where a list of given length is spelled differently."""
    if isinstance(value, list):
        return [_draft_07(part) for part in value]
    if not isinstance(value, dict):
        return value
    table = {key: _draft_07(part) for key, part in value.items()}
    if "prefixItems" in table:
        table["items"] = table.pop("prefixItems")
    return table
