"""Plain scalars by YAML 1.2's core schema: `1e-3` is a number, `no` is text."""

from __future__ import annotations

import math
import re

from rendergraph.document.values import Scalar

_NULL = frozenset(["", "~", "null", "Null", "NULL"])
_BOOL = {"true": True, "True": True, "TRUE": True, "false": False, "False": False, "FALSE": False}
_INT = re.compile(r"[-+]?[0-9]+\Z")
_BASED = re.compile(r"0o[0-7]+\Z|0x[0-9a-fA-F]+\Z")
_FLOAT = re.compile(r"[-+]?(?:\.[0-9]+|[0-9]+(?:\.[0-9]*)?)(?:[eE][-+]?[0-9]+)?\Z")
# Few values begin like a number and are none: this is compiled where one does.
_SPECIAL = r"([-+]?)\.(?:inf|Inf|INF)\Z|\.(?:nan|NaN|NAN)\Z"
_MOST_WHOLE = 2**63


def scalar(text: str) -> Scalar:
    """What a plain scalar means in YAML 1.2's core schema.

    Raises:
        ValueError: a number that no float, or a whole number that no 64 bits can hold.
    """
    if text in _NULL:
        return None
    if text in _BOOL:
        return _BOOL[text]
    if text[0] not in "+-.0123456789":
        return text
    if _INT.match(text):
        return _whole(text, 10)
    if _BASED.match(text):
        return _whole(text[2:], 8 if text[1] == "o" else 16)
    if _FLOAT.match(text):
        number = float(text)
        if math.isinf(number):
            raise ValueError("the number is too large; infinity is written .inf")
        return number
    special = re.match(_SPECIAL, text)
    if special is None:
        return text
    if special[1] is None:
        return math.nan
    return -math.inf if special[1] == "-" else math.inf


def _whole(digits: str, base: int) -> int:
    number = int(digits, base) if len(digits) < 100 else _MOST_WHOLE
    if not -_MOST_WHOLE <= number < _MOST_WHOLE:
        raise ValueError("the whole number needs more than 64 bits; write a smaller one, or one with a point")
    return number
