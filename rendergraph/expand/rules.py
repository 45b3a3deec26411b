"""Rules of ports that are asked while recording: first contents, samplers, numbers of views."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, get_args

from rendergraph.declare import Facts, Input, Made, Port, Views
from rendergraph.declare.blame import happened
from rendergraph.errors import InputError, Mistake
from rendergraph.expand.model import ViewTable
from rendergraph.link import GraphNode
from rendergraph.textures import Filter


def cleared_to(node: GraphNode, port: Made) -> float | tuple[float, ...] | None:
    """What a texture first holds, None for whatever is there."""
    value = _asked(node, port, "clear", port.clear, node.node)
    numbers = value if isinstance(value, tuple) else () if value is None else (value,)
    if len(numbers) > 4 or not all(isinstance(number, int | float) for number in numbers):
        raise _wrong(node, port, "clear", value, "a number, up to four, or None")
    return value  # type: ignore[no-any-return]  # a stranger's rule, now looked at


def filter_of(node: GraphNode, port: Input) -> Filter:
    """How an input is filtered."""
    value = _asked(node, port, "filter", port.filter, node.node)
    if value not in get_args(Filter):
        raise _wrong(node, port, "filter", value, f"one of {', '.join(get_args(Filter))}")
    return value  # type: ignore[no-any-return]  # as above


def view_table(node: GraphNode, port: Views, facts: Facts) -> ViewTable:
    """How many views a table has, and whose."""
    count = _asked(node, port, "count", port.count, node.node, facts)
    if not isinstance(count, int) or count < 0:
        raise _wrong(node, port, "count", count, "a whole number from 0")
    lights = _asked(node, port, "lights", port.lights, node.node, facts) if port.lights else ()
    if not isinstance(lights, Sequence) or not all(isinstance(light, int) for light in lights):
        raise _wrong(node, port, "lights", lights, "the indices of lights")
    return ViewTable(count, tuple(lights))


def _asked(node: GraphNode, port: Port, what: str, rule: Any, *arguments: object) -> Any:
    if not callable(rule):
        return rule
    try:
        return rule(*arguments)
    except (Exception, SystemExit) as error:  # the author's function
        mistake = replace(happened(error, type(node.node)), subject=port.name)
        who = f"'{node.id}.{port.name}' ({node.type.name}): the rule for its {what} fails"
        raise InputError(mistake.problem("RG209", who, node.place)) from error


def _wrong(node: GraphNode, port: Port, what: str, value: object, wanted: str) -> InputError:
    mistake = Mistake(port.name, f"the rule for its {what} gives {value!r}, not {wanted}")
    return InputError(mistake.problem("RG209", f"'{node.id}.{port.name}' ({node.type.name})", node.place))
