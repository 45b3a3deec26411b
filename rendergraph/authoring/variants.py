"""The variants of a node that are tried: the default, then one thing changed at a time."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Set
from dataclasses import dataclass, field, replace
from typing import Any

from rendergraph.declare import InOut, Input, Node

MOST = 200
"""Variants of one node; what has more is tried in the first of them."""


@dataclass(frozen=True)
class Variant:
    """One way to use a node.

    Attributes:
        name: what differs from the default, for messages; empty for the default.
        params: parameters that differ.
        left_out: optional inputs that are not connected.
        outputs: the outputs that somebody reads.
        multisampled: whether inputs that take one sample a texel or several are given several.
        end: whether it takes a number to an end of its range, where the node must do all that it does otherwise.
    """

    name: str
    params: Mapping[str, Any] = field(default_factory=dict)
    left_out: frozenset[str] = frozenset()
    outputs: tuple[str, ...] = ()
    multisampled: bool = False
    end: bool = False

    def without(self, cls: type[Node], inputs: Set[str]) -> Variant:
        """The same with more inputs left out, and the outputs that need them."""
        left_out = self.left_out | inputs
        usable = _usable(cls, left_out)
        return replace(self, left_out=left_out, outputs=tuple(name for name in self.outputs if name in usable))


def variants(cls: type[Node]) -> list[Variant]:
    """All variants of a type: choices, switches and limits of what shapes program or plan, inputs, outputs."""
    seen: list[Variant] = []
    for variant in _all(cls):
        if variant.outputs and variant not in seen and len(seen) < MOST:
            seen.append(variant)
    return seen


def _all(cls: type[Node]) -> Iterator[Variant]:
    everything = _usable(cls, frozenset())
    yield Variant("", outputs=everything)
    for name, value, end in _values(cls):
        text = f"{name}={value}"
        yield Variant(text.lower() if isinstance(value, bool) else text, {name: value}, outputs=everything, end=end)
    optional = [name for name, port in cls.inputs().items() if isinstance(port, Input | InOut) and port.optional]
    for name in optional:
        yield Variant(f"without {name}", left_out=frozenset({name}), outputs=_usable(cls, frozenset({name})))
    if len(optional) > 1:
        yield Variant(
            "without optional inputs", left_out=frozenset(optional), outputs=_usable(cls, frozenset(optional))
        )
    if any(isinstance(port, Input) and port.samples == "any" for port in cls.inputs().values()):
        yield Variant("several samples", outputs=everything, multisampled=True)
    if len(everything) > 1:
        for name in everything:
            yield Variant(f"{name} alone", outputs=(name,))


def _usable(cls: type[Node], left_out: Set[str]) -> tuple[str, ...]:
    """The outputs that can be asked for without some inputs."""
    return tuple(name for name, port in cls.outputs().items() if not left_out & set(getattr(port, "needs", ())))


def _values(cls: type[Node]) -> Iterator[tuple[str, Any, bool]]:
    """Parameters that change the program or the plan, with each value to try and whether it is the end of a range."""
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
