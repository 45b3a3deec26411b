"""`--set` options to one merge patch."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

from msgspec import Struct

from rendergraph.document import Source, Value, from_plain, parse, shown
from rendergraph.errors import InputError, Option, Place, Problem, UsageError, nearest, suggestion
from rendergraph.read import entries
from rendergraph.resolve.merge import NamesOf, TypeNames

_ID = "[A-Za-z_][A-Za-z0-9_-]*"
_PATH = rf"((?:{_ID}/)*)(?:({_ID})\.)?({_ID})\Z"


class Setting(Struct, frozen=True):
    """One assignment.

    Attributes:
        scope: the sub-pipelines it goes down into, outermost first.
        node: the node, None for a pipeline parameter.
        name: a parameter, an input, `type`, `enabled`, or the pipeline parameter.
        value: what it becomes.
        text: how the user wrote the path.
    """

    scope: tuple[str, ...]
    node: str | None
    name: str
    value: Value
    text: str

    def problem(self, code: str, text: str) -> Problem:
        """A mistake in this assignment."""
        return self.value.problem(code, text)


def settings(sets: Sequence[str] | Mapping[str, object]) -> list[Setting]:
    """Parsed assignments, from `PATH=VALUE` texts or from a mapping of paths to values.

    Raises:
        UsageError: one has no `=`, no such path, or a value that is no YAML; with all of them.
    """
    problems: list[Problem] = []
    found: list[Setting] = []
    given = sets.items() if isinstance(sets, Mapping) else (_split(text) for text in sets)
    for path, raw in given:
        is_text = not isinstance(sets, Mapping)
        source = Source(Option("--set", f"{path}={raw}" if is_text and raw is not None else path))
        match = re.match(_PATH, path)
        if raw is None and is_text:
            problems.append(source.problem("RG120", "a setting is written PATH=VALUE, as in light.ambient=0.1"))
        elif match is None or (match[1] and match[2] is None):
            words = "NODE.PARAM, NODE.INPUT, NODE.type, NODE.enabled or the NAME of a parameter"
            problems.append(source.problem("RG120", f"'{shown(path)}' is no path; write {words}"))
        else:
            try:
                value = _value(str(raw), source) if is_text else from_plain(raw, source)
            except InputError as error:
                problems += [problem.relocate(Place(source.origin), code="RG120") for problem in error.problems]
            else:
                scope = tuple(match[1].split("/")[:-1])
                found.append(Setting(scope, match[2], match[3], value, path))
    if problems:
        raise UsageError(problems)
    return found


def _split(text: str) -> tuple[str, str | None]:
    path, equals, raw = text.partition("=")
    return path.strip(), raw if equals else None


def _value(text: str, source: Source) -> Value:
    if text.lstrip().startswith("#"):
        return Value(text, source)  # a colour, most likely; YAML would see a comment
    return _moved(parse(text, source.origin).root, source)


def _moved(value: Value, source: Source) -> Value:
    """The same value without the lines of the text it was parsed from."""
    data = value.data
    if isinstance(data, dict):
        data = {key: _moved(child, source) for key, child in data.items()}
    elif isinstance(data, list):
        data = [_moved(child, source) for child in data]
    return Value(data, source)


def patch_of(tree: Value, wanted: Sequence[Setting], names_of: NamesOf) -> tuple[Value | None, list[Problem]]:
    """The patch that assignments without a scope make on a pipeline, types first; and what is wrong with them."""
    if not wanted:
        return None, []
    problems: list[Problem] = []
    root = Value({}, wanted[0].value.source)
    nodes = entries(tree, "nodes")
    parameters = entries(tree, "parameters")
    types: dict[str, Value] = {}
    known = []
    for setting in wanted:
        if setting.node is None:
            if setting.name in parameters:
                _put(root, setting.value, "parameters", setting.name, "default")
            else:
                problems.append(_no_parameter(setting, parameters, nodes, names_of))
        elif setting.node not in nodes:
            text = f"there is no node '{setting.node}'{suggestion(setting.node, nodes)}"
            problems.append(setting.problem("RG109", text))
        elif setting.name == "type":
            if isinstance(setting.value.data, str):
                types[setting.node] = setting.value
                _put(root, setting.value, "nodes", setting.node, "type")
            else:
                text = f"'{setting.text}': expected the name of a node type, got {setting.value.kind}"
                problems.append(setting.problem("RG106", text))
        elif setting.name == "enabled":
            if isinstance(setting.value.data, bool | None):
                _put(root, setting.value, "nodes", setting.node, "enabled")
            else:
                text = f"'{setting.text}': expected true or false, got {setting.value.kind}"
                problems.append(setting.problem("RG106", text))
        else:
            known.append(setting)
    for setting in known:
        assert setting.node is not None
        node = nodes[setting.node]
        new_type = types.get(setting.node) or node.get("type")
        names = names_of(new_type) if new_type is not None else None
        if names is None:
            continue  # a type that does not exist is said once, at the type
        part = _part(setting, names)
        if part is None:
            choices = sorted(names.params | names.inputs)
            word = new_type.data if new_type is not None and isinstance(new_type.data, str) else "sub-pipeline"
            text = f"node '{setting.node}' ({word}) has no param or input '{setting.name}'"
            problems.append(setting.problem("RG103", text + suggestion(setting.name, choices)))
        elif part == "inputs" and not _is_link(setting.value):
            text = f"'{setting.text}' takes a link as in 'node.port', a list of links, or null"
            problems.append(setting.problem("RG106", text))
        else:
            _put(root, setting.value, "nodes", setting.node, part, setting.name)
    return root, problems


def _part(setting: Setting, names: TypeNames) -> str | None:
    if setting.name in names.params:
        return "params"
    return "inputs" if setting.name in names.inputs else None


def _is_link(value: Value) -> bool:
    parts = value.data if isinstance(value.data, list) else [value]
    return all(isinstance(part.data, str) for part in parts) or value.data is None


def _no_parameter(
    setting: Setting, parameters: Mapping[str, Value], nodes: Mapping[str, Value], names_of: NamesOf
) -> Problem:
    text = f"the pipeline has no parameter '{setting.name}'"
    if setting.name in ("size", "scene"):
        text += f"; --{setting.name} sets the {setting.name}"
    elif setting.name in nodes:
        text += f"; to set one of node '{setting.name}', write {setting.name}.PARAM=VALUE"
    elif nearest(setting.name, parameters) is None and (meant := _of_nodes(setting.name, nodes, names_of)):
        text += f"; did you mean {' or '.join(meant)}?"
    else:
        text += suggestion(setting.name, parameters)
    return setting.problem("RG119", text)


def _of_nodes(name: str, nodes: Mapping[str, Value], names_of: NamesOf) -> list[str]:
    """Parameters of nodes that are called so, or nearly, as a setting names them."""
    known: dict[str, list[str]] = {}
    for node, value in nodes.items():
        of_type = value.get("type")
        names = names_of(of_type) if of_type is not None else None
        for parameter in sorted(names.params) if names else ():
            known.setdefault(parameter, []).append(f"'{node}.{parameter}'")
    near = nearest(name, known)
    return known[near] if near else []


def _put(root: Value, value: Value, *path: str) -> None:
    """Set the value at a path, making the mappings on the way."""
    found = root
    for step in path[:-1]:
        assert isinstance(found.data, dict)
        found = found.data.setdefault(step, Value({}, value.source))
    assert isinstance(found.data, dict)
    found.data[path[-1]] = value
