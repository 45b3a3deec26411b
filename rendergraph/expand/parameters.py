"""Parameters as program text and as uniforms."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from rendergraph.declare import Node
from rendergraph.glsl.source import needs
from rendergraph.steps import UniformValue, define_text


def define_parameters(node: Node, choices: Mapping[str, Path]) -> tuple[tuple[str, str], ...]:
    """Macros of a node's `define` parameters: numbers and switches as they are, a choice as one of its numbers.

    Args:
        node: the node.
        choices: parameters whose choice is an include; what it needs, the macros say.
    """
    macros: list[tuple[str, str]] = []
    for name, parameter in node.parameters().items():
        if parameter.role != "define":
            continue
        value = getattr(node, name)
        if name in choices:
            macros += [(f"NEEDS_{need}".upper(), "1") for need in needs(choices[name])]
        elif isinstance(value, str):
            words = [f"{name}_{choice}".upper().replace("-", "_") for choice in parameter.words]
            macros += [(word, str(number)) for number, word in enumerate(words)]
            macros.append((name.upper(), f"{name}_{value}".upper().replace("-", "_")))
        else:
            macros.append((name.upper(), define_text(value)))
    return tuple(macros)


def param_uniforms(node: Node) -> tuple[tuple[str, UniformValue], ...]:
    """Names and values of a node's `param` parameters; a number given for a vector fills it."""
    uniforms: list[tuple[str, UniformValue]] = []
    for name, parameter in node.parameters().items():
        if parameter.role == "param":
            value = getattr(node, name)
            if parameter.glsl.startswith("vec") and not isinstance(value, tuple):
                value = (float(value),) * int(parameter.glsl[3])
            uniforms.append((name, value))
    return tuple(uniforms)
