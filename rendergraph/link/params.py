"""Parameter values to a node's instance, and what is wrong with them in words a user knows."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from rendergraph.catalog import NodeType
from rendergraph.declare import Extensions, Node, Parameter
from rendergraph.declare.blame import happened
from rendergraph.declare.mistakes import complaint
from rendergraph.document import Value, said, shown
from rendergraph.errors import InputError, Problem, is_interruption, node_named, suggestion
from rendergraph.glsl.source import needs, needs_place
from rendergraph.keys import MOST_PROBLEMS
from rendergraph.resolve import NodeSpec


def instance(spec: NodeSpec, node_type: NodeType) -> tuple[Node, list[Problem]]:
    """The node with its parameter values, defaults for those that are wrong, and what is wrong.

    Values go through pydantic as JSON: as Python values its strict mode refuses a list for a tuple, and its lax mode
    takes `'1.5'` and `true` for numbers.
    """
    values = {name: value.plain() for name, value in spec.params.items()}
    cls = node_type.cls
    problems: list[Problem] = []
    for name in [name for name in values if name not in cls.parameters()]:
        del values[name]
        if len(problems) < MOST_PROBLEMS:
            problems.append(_unknown(spec.params[name], name, node_type))
    try:
        return cls.model_validate_json(json.dumps(values)), problems
    except BaseException as error:  # validators are the author's code
        if is_interruption(error):
            raise
        if not isinstance(error, ValidationError):
            text = f"{node_named(spec.id, node_type.name)}: its own checks fail: {happened(error, cls)}"
            return cls.model_construct(), [*problems, spec.value.problem("RG209", text, key=True)]
        for name, details in _by_parameter(error).items():
            values.pop(name, None)
            problems.append(_wrong(spec, node_type, name, details))
    try:
        return cls.model_validate_json(json.dumps(values)), problems
    except BaseException as error:  # a rule between parameters fails, and has been said
        if is_interruption(error):
            raise
        return cls.model_construct(), problems


def choice_files(
    spec: NodeSpec, node_type: NodeType, node: Node, extensions: Extensions
) -> tuple[dict[str, Path], list[Problem]]:
    """The includes of the parameters that plugins add choices to, the node's own choices and theirs alike.

    Plugins are asked for words that the node does not know, and for no others.
    """
    found: dict[str, Path] = {}
    problems: list[Problem] = []
    for name, parameter in node.parameters().items():
        chosen, value, open_name = getattr(node, name), spec.params.get(name), parameter.open_name
        if not open_name or not isinstance(chosen, str):
            continue
        try:
            if chosen in parameter.words:
                file: Path | None = node_type.choice_file(open_name, chosen)
            else:
                added = extensions.choice(open_name, chosen)
                file = added.value if added is not None else None
            if file is None:
                known = tuple(added.name for added in extensions.choices(open_name))
                text = f"'{spec.id}.{name}' takes {parameter.takes(known)}, this is '{shown(chosen, 40)}'"
                hint = suggestion(chosen, (*parameter.words, *known), most=0)
                problems += [(value or spec.value).problem("RG104", text + hint), *extensions.problems]
            else:
                found[name] = file
                problems += _unmet(parameter, file)
        except InputError as error:
            problems += error.problems
    return found, problems


def _unmet(parameter: Parameter, file: Path) -> list[Problem]:
    """What the include of a choice needs and its parameter does not offer."""
    text = "'{}' offers no '{}' to need{}"
    return [
        Problem("RG495", text.format(parameter.name, need, suggestion(need, parameter.needs)), *needs_place(file))
        for need in needs(file)
        if need not in parameter.needs
    ]


def _by_parameter(error: ValidationError) -> dict[str, list[Any]]:
    table: dict[str, list[Any]] = {}
    for detail in error.errors(include_url=False):
        table.setdefault(str(detail["loc"][0]) if detail["loc"] else "", []).append(detail)
    return table


def _unknown(value: Value, name: str, node_type: NodeType) -> Problem:
    cls = node_type.cls
    if name in cls.inputs() or name in cls.groups():
        hint = f"; '{name}' is an input, move it to `inputs`"
    else:
        hint = suggestion(name, cls.parameters()) if cls.parameters() else "; it takes none"
    return value.problem("RG103", f"node type '{node_type.name}' has no param '{shown(name)}'{hint}", key=True)


def _wrong(spec: NodeSpec, node_type: NodeType, name: str, details: list[Any]) -> Problem:
    value = spec.params.get(name)
    detail = details[0]
    message = complaint(detail)
    if value is None:  # a rule between parameters
        return spec.value.problem("RG104", f"node '{spec.id}': {message}", key=True)
    if detail["type"] in ("value_error", "assertion_error"):
        text = f"'{spec.id}.{name}' is {said(value)}, it {message}"
        return value.problem("RG104", text)
    parameter = node_type.cls.parameters()[name]
    hint = suggestion(value.data, parameter.words, most=0) if isinstance(value.data, str) else ""
    return value.problem("RG104", f"'{spec.id}.{name}' takes {parameter.takes()}, this is {said(value)}{hint}")
