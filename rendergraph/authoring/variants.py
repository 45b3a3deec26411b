"""The variants of a node that a check renders: the default, then one change at a time; and the report about them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Set
from dataclasses import dataclass, field, replace
from typing import Any

from rendergraph.declare import InOut, Input, Node
from rendergraph.errors import Problem

MOST_VARIANTS = 200
"""Maximum number of variants of one node; further ones are not rendered."""


@dataclass(frozen=True)
class Report:
    """The result of a check: the type's name, the rendered variants in order, mistakes and warnings."""

    node: str
    variants: tuple[str, ...]
    problems: tuple[Problem, ...]

    @property
    def mistakes(self) -> tuple[Problem, ...]:
        return tuple(problem for problem in self.problems if problem.severity == "error")


@dataclass(frozen=True)
class NodeVariant:
    """One way to use a node; its name says how it differs from the default, whose name is empty."""

    name: str
    params: Mapping[str, Any] = field(default_factory=dict)
    unconnected: frozenset[str] = frozenset()
    outputs: tuple[str, ...] = ()
    multisampled: bool = False
    is_range_end: bool = False

    def without(self, cls: type[Node], inputs: Set[str]) -> NodeVariant:
        unconnected = self.unconnected | inputs
        usable = _usable(cls, unconnected)
        return replace(self, unconnected=unconnected, outputs=tuple(name for name in self.outputs if name in usable))


def variants(cls: type[Node]) -> list[NodeVariant]:
    seen: list[NodeVariant] = []
    for variant in _all(cls):
        if variant.outputs and variant not in seen and len(seen) < MOST_VARIANTS:
            seen.append(variant)
    return seen


def _all(cls: type[Node]) -> Iterator[NodeVariant]:
    everything = _usable(cls, frozenset())
    yield NodeVariant("", outputs=everything)
    for name, value, is_end in _values(cls):
        text = f"{name}={value}"
        yield NodeVariant(
            text.lower() if isinstance(value, bool) else text, {name: value}, outputs=everything, is_range_end=is_end
        )
    optional = [name for name, port in cls.inputs().items() if isinstance(port, Input | InOut) and port.optional]
    for name in optional:
        yield NodeVariant(f"without {name}", unconnected=frozenset({name}), outputs=_usable(cls, frozenset({name})))
    if len(optional) > 1:
        yield NodeVariant(
            "without optional inputs", unconnected=frozenset(optional), outputs=_usable(cls, frozenset(optional))
        )
    if any(isinstance(port, Input) and port.samples == "any" for port in cls.inputs().values()):
        yield NodeVariant("several samples", outputs=everything, multisampled=True)
    if len(everything) > 1:
        for name in everything:
            yield NodeVariant(f"{name} alone", outputs=(name,))


def _usable(cls: type[Node], unconnected: Set[str]) -> tuple[str, ...]:
    return tuple(name for name, port in cls.outputs().items() if not unconnected & set(getattr(port, "needs", ())))


def _values(cls: type[Node]) -> Iterator[tuple[str, Any, bool]]:
    """Yield parameters that shape the program or plan, each value to try, and whether it is the end of a range."""
    for name, parameter in cls.parameters().items():
        if parameter.role == "param":
            continue
        default = parameter.default
        if parameter.type is bool:
            yield name, not default, False
        for choice in parameter.choices:
            if choice != default:
                yield name, choice, False
        if parameter.type in (int, float):
            for limit in (parameter.limits.low, parameter.limits.high):
                if limit is not None and limit != default:
                    yield name, parameter.type(limit), True
