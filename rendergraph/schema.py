"""The JSON Schema of pipeline files, for editors: every installed node type with its inputs and parameters."""

from __future__ import annotations

import inspect
import json
import os
import re
import shlex
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from rendergraph.catalog import Catalog
from rendergraph.declare import Extensions, Function, InOut, Input, Node, Parameter, Port, Views
from rendergraph.document import shown
from rendergraph.errors import InputError, Place, Problem, shown_file
from rendergraph.glsl import about
from rendergraph.keys import as_markdown, file_schema
from rendergraph.keys import schema as schema_of
from rendergraph.read import NODE, PIPELINE, entries, read, word
from rendergraph.resolve import PipelineSpec, resolve
from rendergraph.resources import shipped_pipelines
from rendergraph.settings import Roots
from rendergraph.textures import Signature
from rendergraph.typecheck import Schema, json_schema

_LINK: Schema = {"type": ["string", "null"], "description": "`node.port`, a node's id, or null for nothing."}
_ROLES = {
    "param": "Changing it rebuilds nothing.",
    "define": "Changing it recompiles a program.",
    "structural": "Changing it changes the plan.",
}
_REFERENCE: Schema = {"type": "string", "pattern": "^\\$", "description": "A parameter of the pipeline."}
_WORDS = {"number": "a number", "integer": "a whole number", "boolean": "true or false", "array": "a list"}

Links = Mapping[str, Mapping[str, Sequence[str]]]
"""The links that fit each input of each node, by id and name, as `link.fitting` returns them."""


def schema(catalog: Catalog, bases: Mapping[str, Mapping[str, str]] = {}, links: Links | None = None) -> Schema:
    """Return a draft-07 schema, which editors support.

    A type that cannot be imported is a legal name without further rules: its plugin's mistake is not the file's.

    Args:
        bases: files that can be extended, as named in `extends`, with the types of their nodes by id.
        links: links that editors suggest; others are legal, too, because the file may have changed since.
    """
    types: dict[str, type[Node] | None] = dict.fromkeys(catalog.names())
    types |= {found.name: found.cls for found in catalog.usable()[0]}
    rules: dict[str, Schema] = {}
    needed: dict[str, Schema] = {}
    for name, cls in types.items():
        if cls is not None:
            own = {param: _param(one, catalog.extensions) for param, one in cls.parameters().items()}
            params = _known_names(own, f"'{name}' has no such param.")
            rules[name] = {"properties": {"inputs": _inputs(name, cls), "params": params}}
            needed[name] = _needed(cls)
    found = file_schema(PIPELINE)
    found["properties"]["nodes"]["additionalProperties"] = {"$ref": "#/definitions/node"}
    whole_node = {"if": _has("enabled", False), "else": {"allOf": _by_type(needed)}}  # all inputs, unless disabled
    found["definitions"] = {"node": _node(types, rules), "whole_node": whole_node}
    whole = {"properties": {"nodes": {"additionalProperties": {"$ref": "#/definitions/whole_node"}}}}
    # Files that extend others, and patches, need not connect everything; they lack one of these keys.
    alone = {"required": ["rendergraph", "nodes", "outputs"], "not": {"required": ["extends"]}}
    conditions: list[Schema] = [{"if": alone, "then": whole}]
    for base, nodes in bases.items():
        known = {id: {"$ref": f"#/definitions/inherited_{name}"} for id, name in nodes.items() if name in rules}
        for name in {*nodes.values()} & {*rules}:  # the type of the node unless the file changes it
            found["definitions"][f"inherited_{name}"] = {"if": {"not": {"required": ["type"]}}, "then": rules[name]}
        conditions.append({"if": _has("extends", base), "then": {"properties": {"nodes": {"properties": known}}}})
    if links:
        offered = {id: {"properties": {"inputs": {"properties": _offered(inputs)}}} for id, inputs in links.items()}
        conditions.append({"properties": {"nodes": {"properties": offered}}})
    marked: Schema = as_markdown({**found, "allOf": conditions})
    return marked


def shipped_bases(catalog: Catalog) -> dict[str, dict[str, str]]:
    """Return the types of the nodes of every shipped pipeline, by name and id."""
    return {name: _types_in(resolve(name, catalog=catalog)) for name in shipped_pipelines()}


def base_of(file: Path, spec: PipelineSpec) -> dict[str, dict[str, str]]:
    """Return the types of the nodes in the file that a pipeline file extends, by its name there; see `schema`."""
    base = word(read(file, keep_going=True).root, "extends")
    return {} if base is None else {base: _types_in(spec)}


def _types_in(spec: PipelineSpec) -> dict[str, str]:
    found = {id: word(node, "type") for id, node in entries(spec.tree, "nodes").items()}
    return {id: name for id, name in found.items() if name is not None}


def _node(types: Mapping[str, type[Node] | None], rules: Mapping[str, Schema]) -> Schema:
    known: list[Schema] = [{"const": name, "description": _about(cls) if cls else ""} for name, cls in types.items()]
    file = f"[./]|^({'|'.join(shipped_pipelines())})$"
    elsewhere: list[Schema] = [
        {"type": "string", "pattern": file, "description": "A pipeline file whose outputs are the node's; a shader."},
        {"$ref": "#"},
    ]
    found = schema_of(NODE)
    properties = found["properties"]
    properties["type"]["anyOf"] = [*known, *elsewhere, {"type": "null"}]
    for part in ("inputs", "params"):  # the node's type defines them
        properties[part] = {"type": ["object", "null"], "description": properties[part]["description"]}
    return {**found, "allOf": _by_type(rules)}


def _by_type(rules: Mapping[str, Schema]) -> list[Schema]:
    return [{"if": _has("type", name), "then": then} for name, then in rules.items() if then]


def _has(key: str, value: Any) -> Schema:
    return {"properties": {key: {"const": value}}, "required": [key]}


def _needed(cls: type[Node]) -> Schema:
    """Require the inputs that a node needs; a group may stand for its members."""
    rules: list[Schema] = []
    for name in [name for name, port in cls.inputs().items() if _is_required(port)]:
        ways = [name, *(group for group, members in cls.groups().items() if name in members)]
        rules += [{"required": ways} if len(ways) == 1 else {"anyOf": [{"required": [way]} for way in ways]}]
    return {"required": ["inputs"], "properties": {"inputs": {"allOf": rules}}} if rules else {}


def _offered(inputs: Mapping[str, Sequence[str]]) -> Schema:
    offers: Schema = {name: {"anyOf": [{"enum": [*links]}, {}]} if links else {} for name, links in inputs.items()}
    return {name: {**offer, "items": offer} for name, offer in offers.items()}


def _about(cls: type[Node]) -> str:
    """Return the docs of a type and its outputs; lines of a paragraph are joined."""
    doc = re.sub(r"(?<!\n)\n(?![\n ])", " ", inspect.getdoc(cls) or "")
    outputs = ""
    for name, port in cls.outputs().items():
        like = getattr(port, "like", None)
        outputs += f"\n- `{name}`: {port.doc} ({f'like `{like}`' if like else _port_type(port)})"
    return f"{doc}\n\nOutputs:\n{outputs}"


def _inputs(type_name: str, cls: type[Node]) -> Schema:
    links = {name: _link(port) for name, port in cls.inputs().items()}
    for group, members in cls.groups().items():
        links[group] = {**_LINK, "description": f"The id of a node with {', '.join(members)}."}
    return _known_names(links, f"'{type_name}' has no such input.")


def _known_names(properties: Schema, message: str) -> Schema:
    """Return a mapping with these properties; others may be null, to drop what the new type of a node lacks."""
    others = {"type": "null", "errorMessage": message}
    return {"type": ["object", "null"], "additionalProperties": others, "properties": properties}


def _link(port: Input | InOut) -> Schema:
    need = ", required" if _is_required(port) else ""
    found = {**_LINK, "description": f"{port.doc} ({_port_type(port)}{need})"}
    if isinstance(port, Input) and port.many:
        found |= {"type": ["string", "null", "array"], "items": {"type": "string"}}
    return found


def _is_required(port: Input | InOut) -> bool:
    return not port.optional and not (isinstance(port, Input) and port.takes_scene)


def _port_type(port: Port) -> str:
    """Return a short description of a port: `radiance`, `shadow(), many`, `depth, buffer`."""
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


def _param(parameter: Parameter, extensions: Extensions) -> Schema:
    """Return the schema of a parameter: its values, null for the default, or a parameter of the pipeline."""
    added = extensions.choices(parameter.open_name) if parameter.open_name else []
    doc = " ".join([parameter.doc, *(f"`{one.name}` ({one.plugin}): {about(one.value)}" for one in added)])
    own = json_schema(parameter.closed(tuple(one.name for one in added)))
    limits = parameter.limits.schema("number")
    common = {"description": _about_param(parameter, doc), "default": json.loads(json.dumps(parameter.default))}
    kind = own.get("type")
    if kind in _WORDS:  # without alternatives, so that editors report the violated limit
        message = f"expected {_WORDS[kind]}, or $name for a parameter of the pipeline"
        found = {"type": [kind, "string", "null"], "pattern": _REFERENCE["pattern"], "patternErrorMessage": message}
        return {**common, **own, **limits, **found}
    alternatives = own.get("anyOf", [own])  # limits beside alternatives apply to numbers
    alternatives = [{**p, **limits} if p.get("type") in ("number", "integer") else p for p in alternatives]
    return {**common, "anyOf": [*alternatives, {"type": "null"}, _REFERENCE]}


def _about_param(parameter: Parameter, doc: str) -> str:
    """Return its documentation, default, range and the cost of changing it."""
    unit = f" {parameter.unit}" if parameter.unit else ""
    limits = f",{parameter.limits}" if str(parameter.limits) else ""
    default = json.dumps(parameter.default, ensure_ascii=False)
    return f"{doc}\n\nDefault {default}{unit}{limits}. {_ROLES[parameter.role]}"


_MODELINE = re.compile(r"#\s*(?:yaml-language-server:\s*)?\$schema=(\S+)\s*$", re.MULTILINE)
_MOST_BYTES = 1 << 24


def outdated(pipeline: Path, roots: Roots, catalog: Catalog, plugins: Iterable[Path] = ()) -> Problem | None:
    """Return a warning if the schema in a pipeline file's modeline is older than a change of its node types.

    A schema outside `roots` is not read. Types that only the schema has are fine: it may include more plugins than this
    run. `plugins` are those of the command line, for the suggested command.
    """
    text = pipeline.read_text(encoding="utf-8", errors="replace")
    found = _MODELINE.search(text)
    if found is None or "://" in found[1]:
        return None
    file = pipeline.parent / found[1]
    try:
        if roots.check(file).stat().st_size > _MOST_BYTES:
            return None
        written = json.loads(file.read_text(encoding="utf-8"))
        then = _rules(written)
    except (OSError, ValueError, TypeError, KeyError, InputError):  # missing, or not one of rendergraph's
        return None
    now = _rules(schema(catalog))
    changed = [f"'{name}' {'has changed' if name in then else 'is new'}" for name in now if now[name] != then.get(name)]
    if not changed:
        return None
    words = [word for plugin in plugins for word in ("--plugin", str(plugin))]
    conditions = [entry["if"] for entry in written.get("allOf", ()) if "properties" in entry.get("if", {})]
    bases = {condition["properties"]["extends"]["const"] for condition in conditions}
    if bases - {*shipped_pipelines()}:  # written for a file that extends another
        words.append(shown_file(pipeline))
    command = shlex.join(["rendergraph", "schema", *words, "-o", shown_file(os.path.normpath(file))])
    way_out = f"`{command}` writes it again"
    # Their plugins are not known here; shader files belong to the pipeline that names them.
    if gone := [f"'{name}'" for name in then if name not in now and "/" not in name]:
        way_out += f", with --plugin for {_first(gone)} too"
    line = text.count("\n", 0, found.start()) + 1
    message = f"the editor's schema '{shown(found[1])}' is out of date: {_first(changed)}; {way_out}"
    return Problem("RG153", message, Place(shown_file(pipeline), line, 1), text.splitlines()[line - 1], "warning")


def _first(words: Sequence[str]) -> str:
    return ", ".join(words[:3]) + (f" and {len(words) - 3} more" if len(words) > 3 else "")


def _rules(found: Any) -> dict[str, Any]:
    node = found["definitions"]["node"]
    rules = {entry["if"]["properties"]["type"]["const"]: entry["then"] for entry in node["allOf"]}
    about = {entry["const"]: entry for entry in node["properties"]["type"]["anyOf"] if "const" in entry}
    return {name: [rules.get(name), entry] for name, entry in about.items()}
