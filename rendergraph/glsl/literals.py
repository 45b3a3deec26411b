"""GLSL literals: a number, `true` or `false`, or a vector constructor of numbers."""

from __future__ import annotations

import re
from typing import TypeAlias

Literal: TypeAlias = "bool | int | float | tuple[float, ...]"
"""A scalar, or a vector's components."""

_NUMBER = re.compile(
    r"([-+]?)\s*(?:0[xX](?P<based>[0-9a-fA-F]+)[uU]?|(?P<whole>\d+)[uU]?"
    r"|(?P<real>(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)(?:[fF]|lf|LF)?)\Z"
)
_VECTOR = re.compile(r"([iu]?)vec([234])\s*\(([^()]*)\)\Z")
_SWITCHES = {"true": True, "false": False}
_LARGEST = 3.4028235e38  # what 32 bits hold
_LONGEST = 100


def literal(text: str) -> Literal:
    """Return the value of a literal.

    Raises:
        ValueError: the text is not a literal.
    """
    if vector := _VECTOR.match(text):
        convert = int if vector[1] else float
        count, parts = int(vector[2]), [_number(part.strip()) for part in vector[3].split(",")]
        if len(parts) not in (1, count):
            raise ValueError(f"{vector[1]}vec{count} expected 1 or {count} numbers, got {len(parts)}")
        return tuple(convert(part) for part in (parts if len(parts) == count else parts * count))
    return _SWITCHES[text] if text in _SWITCHES else _number(text)


def _number(text: str) -> int | float:
    found = _NUMBER.match(text) if len(text) <= _LONGEST else None
    if found is None:
        raise ValueError("it is not a literal")
    if found["real"]:
        value: int | float = float(found["real"])
    else:
        value = int(found["based"], 16) if found["based"] else int(found["whole"])
    if value > _LARGEST:  # integers have no limit in Python, and no parameter is infinite
        raise ValueError("it is too large")
    return -value if found[1] == "-" else value
