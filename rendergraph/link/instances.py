"""A node's instance from its parameter values, and stand-ins for node types that are missing."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Mapping
from hashlib import sha1
from pathlib import Path
from typing import Any

from msgspec.structs import replace

from rendergraph.catalog import Catalog, NodeType
from rendergraph.declare import Extensions, FileContent, Input, Node, Output, Parameter
from rendergraph.declare.blame import author_problem
from rendergraph.document import Source, Value, describe, shown
from rendergraph.errors import InputError, Problem, is_interruption, nearest, node_named, shown_file, suggestion
from rendergraph.glsl.source import needs, needs_place
from rendergraph.keys import MOST_PROBLEMS
from rendergraph.resolve import NodeSpec, PipelineSpec
from rendergraph.settings import Roots, nearest_settings
from rendergraph.textures import Any as AnyTexture
from rendergraph.typecheck import accepts


def instance(spec: NodeSpec, node_type: NodeType, source_roots: Mapping[Source, Roots]) -> tuple[Node, list[Problem]]:
    """Return the node, with defaults for parameters that are wrong, and the problems.

    `source_roots` are those of the `PipelineSpec`.
    """
    cls, parameters = node_type.cls, node_type.cls.parameters()
    unknown = [name for name in spec.params if name not in parameters]
    problems = [_unknown(spec.params[name], name, node_type) for name in unknown[:MOST_PROBLEMS]]
    values = {name: value.plain() for name, value in spec.params.items() if name in parameters}
    for name, plain in tuple(values.items()):
        if isinstance(plain, str) and accepts(parameters[name].type, FileContent):
            try:
                values[name] = _file(spec.params[name], source_roots)
            except InputError as error:
                problems += error.problems
                del values[name]
    try:
        return cls(**values), problems
    except BaseException as error:  # a node's own check is third-party code
        if is_interruption(error):
            raise
        unfit = dict(_unfit(spec, parameters, values))
        if not unfit:
            return cls(), problems or [_refused(spec, node_type, values, error)]
        fit = {name: value for name, value in spec.params.items() if name in values and name not in unfit}
        return instance(replace(spec, params=fit), node_type, source_roots)[0], [*problems, *unfit.values()]


def _file(value: Value, source_roots: Mapping[Source, Roots]) -> FileContent:
    path = value.source.beside(text := str(value.data))
    roots = source_roots.get(value.source) or Roots.of_file(path)  # the user has typed it
    if mistake := roots.mistake(path, text):
        raise InputError(value.problem(*mistake))
    try:
        return FileContent(path, sha1(path.read_bytes()).hexdigest())
    except OSError as error:
        raise InputError(value.problem("RG011", f"the file '{shown(text)}' cannot be read: {error.strerror}")) from None


def _unfit(
    spec: NodeSpec, parameters: Mapping[str, Parameter], values: Mapping[str, Any]
) -> Iterator[tuple[str, Problem]]:
    for name, plain in values.items():
        value = spec.params[name]
        try:
            parameters[name].convert(plain)
        except TypeError as error:
            hint = suggestion(value.data, parameters[name].words, most=0) if isinstance(value.data, str) else ""
            yield name, value.problem("RG104", f"'{spec.id}.{name}': {error}, got {describe(value)}{hint}")
        except ValueError as error:
            yield name, value.problem("RG104", f"'{spec.id}.{name}' is {describe(value)}, it {error}")


def _refused(spec: NodeSpec, node_type: NodeType, values: Mapping[str, Any], error: BaseException) -> Problem:
    """Report a node's own check at the value without which it passes, if there is exactly one."""
    who = node_named(spec.id, node_type.name)
    if not isinstance(error, ValueError):
        problem = author_problem(error, node_type.cls)
        return spec.value.relocate(problem, key=True, code="RG209", context=f"{who}: its own checks fail")
    guilty = []
    for name in values:
        try:
            node_type.cls(**{other: values[other] for other in values if other != name})
            guilty.append(spec.params[name])
        except BaseException as another:  # as above
            if is_interruption(another):
                raise
    text = f"{who}: {error}"
    return guilty[0].problem("RG104", text) if len(guilty) == 1 else spec.value.problem("RG104", text, key=True)


def choice_files(
    spec: NodeSpec, node_type: NodeType, node: Node, extensions: Extensions
) -> tuple[dict[str, Path], list[Problem]]:
    """Return the includes of extensible choices; plugins are imported only for words that the node does not know."""
    found: dict[str, Path] = {}
    problems: list[Problem] = []
    for name, parameter in node.parameters().items():
        open_name = parameter.open_name
        if not open_name or not isinstance(chosen := getattr(node, name), str):
            continue
        value = spec.params.get(name)
        try:
            if chosen in parameter.words:
                file: Path | None = node_type.choice_file(open_name, chosen)
            else:
                added = extensions.choice(open_name, chosen)
                file = added.value if added is not None else None
            if file is None:
                known = tuple(added.name for added in extensions.choices(open_name))
                text = f"'{spec.id}.{name}': expected {parameter.takes(known)}, got '{shown(chosen, 40)}'"
                hint = suggestion(chosen, (*parameter.words, *known), most=0)
                problems += [(value or spec.value).problem("RG104", text + hint), *extensions.problems]
            else:
                found[name] = file
                problems += _unmet(parameter, file)
        except InputError as error:
            problems += error.problems
    return found, problems


def _unmet(parameter: Parameter, file: Path) -> list[Problem]:
    text = "'{}' offers no '{}' to need{}"
    return [
        Problem("RG495", text.format(parameter.name, need, suggestion(need, parameter.needs)), *needs_place(file))
        for need in needs(file)
        if need not in parameter.needs
    ]


def _unknown(value: Value, name: str, node_type: NodeType) -> Problem:
    cls = node_type.cls
    if name in cls.inputs() or name in cls.groups():
        hint = f"; '{name}' is an input, move it to `inputs`"
    else:
        hint = suggestion(name, cls.parameters()) if cls.parameters() else "; it has none"
    return value.problem("RG103", f"node type '{node_type.name}' has no param '{shown(name)}'{hint}", key=True)


_LINK = re.compile(r"([^.@]+)(?:\.([^.@]+))?(?:@previous)?\Z")


def unknown_type(spec: PipelineSpec, catalog: Catalog, name: str) -> str:
    if name in spec.unrun:
        return f"node type '{name}' is Python, which a pipeline file cannot load; pass --plugin {spec.unrun[name]}"
    file = spec.path.with_name(f"{name}.py") if spec.path is not None else Path()
    if os.path.isfile(file):  # a name may be too long for a file's
        text = f"node type '{name}' is Python beside the file and not loaded by itself"
        return f"{text}; pass --plugin {shown_file(file)}"
    text = f"there is no node type '{shown(name)}'"
    near = nearest(name, catalog.names())
    if near is not None:
        text += f"; did you mean '{near}'?"
    if spec.missing:
        return f"{text}; a missing package may provide it: {', '.join(spec.missing)}"
    project = nearest_settings(spec.path.parent) if spec.path is not None else None
    if project is not None and project.plugins and not Path.cwd().resolve().is_relative_to(project.folder):
        return f"{text}; {shown_file(project.file)} names plugins, but they load only when you work inside its folder"
    if near is not None:
        return text
    return f"{text}; install the plugin that brings it, or name its file: --plugin; explain RG102 has all ways"


def stand_in(spec: PipelineSpec, node: NodeSpec) -> NodeType:
    """Return a type with all inputs and outputs that the file uses; it can be shown, not run."""
    lists = {name: isinstance(value.data, list) for name, value in node.inputs.items()}
    inputs = {name: Input(AnyTexture, optional=True, many=many) for name, many in lists.items()}
    outputs = {name: Output(AnyTexture) for name in _outputs_used(spec, node.id)}
    ports = {name: port for name, port in {**inputs, **outputs}.items() if not hasattr(Node, name)}
    params = {
        name: Parameter("structural", None, type=Any)
        for name in node.params
        if name.isidentifier() and not name.startswith("_") and not hasattr(Node, name) and name not in ports
    }
    about = {"__module__": __name__, "__doc__": "A node of unknown type."}
    cls = type("Unknown", (Node,), {**about, **ports, **params})
    return NodeType(node.type, "", cls, Path(), Path(), "", missing=True)


def _outputs_used(spec: PipelineSpec, id: str) -> list[str]:
    tables: list[tuple[str, Mapping[str, Value]]] = [("", spec.outputs)]
    tables += [(node.scope, node.inputs) for node in spec.nodes.values()]
    for scope, inner in spec.scopes.items():
        tables += [(inner.parent, inner.links), (scope, inner.outputs)]
    found: dict[str, None] = {}
    for scope, name, value in [(scope, name, value) for scope, table in tables for name, value in table.items()]:
        for part in value.data if isinstance(value.data, list) else [value]:
            match = _LINK.match(part.data) if isinstance(part.data, str) else None
            if match is not None and f"{scope}{match[1]}" == id:
                found[match[2] or name] = None
    return list(found)
