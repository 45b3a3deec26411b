"""Parameters as program text and as uniforms."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from rendergraph.declare import Choice, Node
from rendergraph.steps import UniformValue, define_text


def define_parameters(node: Node, plugged: Mapping[str, Choice]) -> Iterator[tuple[str, str]]:
    """Macros of a node's `define` parameters: numbers and switches as they are, a choice as one of its numbers.

    Args:
        node: the node.
        plugged: parameters whose choice is a plugin's; other choices of plugins leave the text as it is.
    """
    for name, parameter in node.parameters().items():
        if parameter.role != "define":
            continue
        value = getattr(node, name)
        if isinstance(value, str):
            choices = [*parameter.words, *([value] if name in plugged else [])]
            for number, choice in enumerate(choices):
                yield f"{name}_{choice}".upper().replace("-", "_"), str(number)
            for need in plugged[name].needs if name in plugged else ():
                yield f"NEEDS_{need}".upper(), "1"
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
