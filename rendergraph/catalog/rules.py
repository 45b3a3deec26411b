"""What a header says of sizes and counts, as the rules that ports take."""

from __future__ import annotations

import math
from typing import Any

from rendergraph.declare import Facts, Ruled, SizeRule
from rendergraph.document import Value


def number_rule(value: Value) -> Ruled[int]:
    """A whole number, or the value of a structural parameter."""
    if not isinstance(value.data, str):
        return int(value.data)  # type: ignore[arg-type]  # the header's reader saw a number
    name = value.data[1:]
    return lambda node, facts: int(getattr(node, name))


def word_rule(value: Value) -> Any:
    """A word, or the choice of a structural parameter."""
    word = str(value.data)
    return (lambda node, facts: str(getattr(node, word[1:]))) if word.startswith("$") else word


def size_rule(value: Value) -> SizeRule:
    """A factor of the picture, an input, `[input, factor]` or `[width, height]`; factors may be parameters."""
    data = value.data
    first, second = data if isinstance(data, list) else (None, value)
    factor = second.data
    if isinstance(factor, str) and factor.startswith("$"):
        base = str(first.data) if first is not None else None

        def rule(node: Any, facts: Facts) -> tuple[int, int]:
            size = facts.viewport
            if base is not None and facts.connected(base):
                desc = facts.input(base).desc
                size = desc.size if desc is not None else size
            scale = float(getattr(node, factor[1:]))
            width, height = (max(1, math.ceil(side * scale - 1e-9)) for side in size)
            return width, height

        return rule
    if first is not None and isinstance(first.data, str):
        return first.data, float(factor)  # type: ignore[arg-type]  # the header's reader saw a number
    if first is not None:
        return int(first.data), int(factor)  # type: ignore[arg-type]
    return factor if isinstance(factor, str) else float(factor)  # type: ignore[arg-type]
