"""The value of a constant expression: literals, constructors, arithmetic, and names whose values are known."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import TypeAlias

Constant: TypeAlias = "bool | int | float | tuple[float, ...]"
"""A scalar, or a vector's components."""

_NUMBER = re.compile(r"(?:0[xX][0-9a-fA-F]+|\d+)[uU]?\Z|(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?(?:[fF]|lf|LF)?\Z")
_BEGUN = re.compile(r"(?!0[xX])[\d.]+[eE]\Z")
_VECTOR = re.compile(r"([iub]?)vec([234])\Z")
_DEEPEST = 100


def constant(words: Sequence[str], known: Mapping[str, Constant] = {}) -> Constant:
    """The value of an expression.

    Args:
        words: its tokens.
        known: values of the names that may stand in it.

    Raises:
        ValueError: it is more than numbers, constructors, `+ - * /` and known names.
    """
    reader = _Reader(_joined(words), known)
    value = reader.sum(0)
    if reader.rest:
        raise ValueError(f"'{reader.rest[0]}' is not expected there")
    return value


def _joined(words: Sequence[str]) -> list[str]:
    """The tokens with `1e`, `-`, `3` put together again."""
    found: list[str] = []
    for word in words:
        if len(found) > 1 and found[-1] in "+-" and _BEGUN.match(found[-2]) and word[:1].isdigit():
            found[-2:] = ["".join(found[-2:]) + word]
        else:
            found.append(str(word))
    return found


class _Reader:
    """Recursive descent over the tokens."""

    def __init__(self, words: list[str], known: Mapping[str, Constant]) -> None:
        self.rest = words
        self.known = known

    def take(self, word: str) -> None:
        if not self.rest or self.rest[0] != word:
            raise ValueError(f"'{word}' is missing")
        self.rest = self.rest[1:]

    def sum(self, depth: int) -> Constant:
        value = self.product(depth)
        while self.rest and self.rest[0] in "+-":
            sign, self.rest = self.rest[0], self.rest[1:]
            value = _combined(sign, value, self.product(depth))
        return value

    def product(self, depth: int) -> Constant:
        value = self.factor(depth)
        while self.rest and self.rest[0] in "*/":
            sign, self.rest = self.rest[0], self.rest[1:]
            value = _combined(sign, value, self.factor(depth))
        return value

    def factor(self, depth: int) -> Constant:
        if depth > _DEEPEST:
            raise ValueError("it is nested too deeply")
        if not self.rest:
            raise ValueError("a value is missing")
        word, self.rest = self.rest[0], self.rest[1:]
        if word in "+-":
            value = self.factor(depth + 1)
            return value if word == "+" else _combined("*", -1, value)
        if word == "(":
            value = self.sum(depth + 1)
            self.take(")")
            return value
        if word in ("true", "false"):
            return word == "true"
        if _NUMBER.match(word):
            return _number(word)
        if (vector := _VECTOR.match(word)) or word in ("float", "int", "uint", "bool"):
            parts = self.arguments(depth + 1)
            if vector:
                return _vector(parts, vector[1], int(vector[2]))
            return _scalar(parts, word)
        if word in self.known:
            return self.known[word]
        raise ValueError(f"the value of '{word}' is not known")

    def arguments(self, depth: int) -> list[float]:
        """The components of everything between a constructor's brackets."""
        self.take("(")
        parts: list[float] = []
        while True:
            value = self.sum(depth)
            parts += value if isinstance(value, tuple) else (value,)
            if self.rest[:1] != [","]:
                break
            self.rest = self.rest[1:]
        self.take(")")
        return parts


def _number(word: str) -> int | float:
    plain = word.lower()
    if plain.startswith("0x"):
        return int(plain.rstrip("u"), 16)
    if plain.rstrip("u").isdigit():
        return int(plain.rstrip("u"))
    return float(plain.rstrip("lf"))


def _vector(parts: list[float], kind: str, count: int) -> tuple[float, ...]:
    parts = parts * count if len(parts) == 1 else parts
    if len(parts) != count:
        raise ValueError(f"{kind}vec{count} takes 1 or {count} numbers, not {len(parts)}")
    convert = {"": float, "i": int, "u": int, "b": bool}[kind]
    return tuple(convert(part) for part in parts)


def _scalar(parts: list[float], kind: str) -> Constant:
    if len(parts) != 1:
        raise ValueError(f"{kind} takes one number, not {len(parts)}")
    value: Constant = {"float": float, "int": int, "uint": int, "bool": bool}[kind](parts[0])
    return value


def _combined(sign: str, a: Constant, b: Constant) -> Constant:
    """Arithmetic as GLSL has it: component by component, a scalar with every component."""
    if isinstance(a, tuple) or isinstance(b, tuple):
        count = len(a) if isinstance(a, tuple) else len(b) if isinstance(b, tuple) else 0
        left = a if isinstance(a, tuple) else (a,) * count
        right = b if isinstance(b, tuple) else (b,) * count
        if len(left) != len(right):
            raise ValueError("vectors of different lengths")
        pairs = zip(left, right, strict=True)
        return tuple(_number_of(_combined(sign, x, y)) for x, y in pairs)
    if isinstance(a, bool) or isinstance(b, bool):
        raise ValueError("no arithmetic with true and false")
    if sign == "/":
        if b == 0:
            raise ValueError("division by 0")
        if isinstance(a, int) and isinstance(b, int):
            return abs(a) // abs(b) * (1 if (a < 0) == (b < 0) else -1)
        return a / b
    return a * b if sign == "*" else a + b if sign == "+" else a - b


def _number_of(value: Constant) -> float:
    if isinstance(value, tuple):
        raise ValueError("a vector of vectors")
    return value
