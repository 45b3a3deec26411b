"""Parameters as program text and as uniforms."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path

from rendergraph.declare import Node
from rendergraph.glsl.source import needs
from rendergraph.steps import UniformValue, define_text


def define_parameters(node: Node, choices: Mapping[str, Path]) -> Iterator[tuple[str, str]]:
    """Macros of a node's `define` parameters: numbers and switches as they are, a choice as one of its numbers.

    Args:
        node: the node.
        choices: parameters whose choice is an include; what it needs, the macros say.
    """
    for name, parameter in node.parameters().items():
        if parameter.role != "define":
            continue
        value = getattr(node, name)
        if name in choices:
            for need in needs(choices[name]):
                yield f"NEEDS_{need}".upper(), "1"
        elif isinstance(value, str):
            for number, choice in enumerate(parameter.words):
                yield f"{name}_{choice}".upper().replace("-", "_"), str(number)
            yield name.upper(), f"{name}_{value}".upper().replace("-", "_")
        else:
            yield name.upper(), define_text(value)


def param_uniforms(node: Node) -> Iterator[tuple[str, UniformValue]]:
    """Names and values of a node's `param` parameters; a number given for a vector fills it."""
    for name, parameter in node.parameters().items():
        if parameter.role != "param":
            continue
        value = getattr(node, name)
        if parameter.glsl.startswith("vec") and not isinstance(value, tuple):
            value = (float(value),) * int(parameter.glsl[3])
        yield name, value
