"""Parameter values to a node's instance, and what is wrong with them in words a user knows."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from msgspec.structs import replace

from rendergraph.catalog import NodeType
from rendergraph.declare import Extensions, Node, Parameter
from rendergraph.declare.blame import happened
from rendergraph.document import Value, said, shown
from rendergraph.errors import InputError, Problem, is_interruption, node_named, suggestion
from rendergraph.glsl.source import needs, needs_place
from rendergraph.keys import MOST_PROBLEMS
from rendergraph.resolve import NodeSpec


def instance(spec: NodeSpec, node_type: NodeType) -> tuple[Node, list[Problem]]:
    """The node with its parameter values, defaults for those that are wrong, and what is wrong."""
    cls, parameters = node_type.cls, node_type.cls.parameters()
    unknown = [name for name in spec.params if name not in parameters]
    problems = [_unknown(spec.params[name], name, node_type) for name in unknown[:MOST_PROBLEMS]]
    values = {name: value.plain() for name, value in spec.params.items() if name in parameters}
    try:
        return cls(**values), problems
    except BaseException as error:  # its own check is the author's code
        if is_interruption(error):
            raise
        unfit = dict(_unfit(spec, parameters, values))
        if not unfit:
            return cls(), problems or [_refused(spec, node_type, values, error)]
        fit = {name: value for name, value in spec.params.items() if name in values and name not in unfit}
        return instance(replace(spec, params=fit), node_type)[0], [*problems, *unfit.values()]


def _unfit(
    spec: NodeSpec, parameters: Mapping[str, Parameter], values: Mapping[str, Any]
) -> Iterator[tuple[str, Problem]]:
    """The values that their parameters do not take."""
    for name, plain in values.items():
        value = spec.params[name]
        try:
            parameters[name].convert(plain)
        except TypeError as error:
            hint = suggestion(value.data, parameters[name].words, most=0) if isinstance(value.data, str) else ""
            yield name, value.problem("RG104", f"'{spec.id}.{name}': {error}, got {said(value)}{hint}")
        except ValueError as error:
            yield name, value.problem("RG104", f"'{spec.id}.{name}' is {said(value)}, it {error}")


def _refused(spec: NodeSpec, node_type: NodeType, values: Mapping[str, Any], error: BaseException) -> Problem:
    """What a node's own check says; at the value without which it would say nothing, where there is one such."""
    who = node_named(spec.id, node_type.name)
    if not isinstance(error, ValueError):
        problem = happened(error, node_type.cls)
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
    """The includes of the parameters that plugins add choices to, the node's own choices and theirs alike.

    Plugins are asked for words that the node does not know, and for no others.
    """
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
    """What the include of a choice needs and its parameter does not offer."""
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
        hint = suggestion(name, cls.parameters()) if cls.parameters() else "; it takes none"
    return value.problem("RG103", f"node type '{node_type.name}' has no param '{shown(name)}'{hint}", key=True)
