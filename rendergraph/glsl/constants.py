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
_MOST_WORDS = 1000
_LARGEST = 3.4028235e38  # what 32 bits hold


def constant(words: Sequence[str], known: Mapping[str, Constant] = {}) -> Constant:
    """The value of an expression.

    Args:
        words: its tokens.
        known: values of the names that may stand in it.

    Raises:
        ValueError: it is more than numbers, constructors, `+ - * /` and known names.
    """
    if len(words) > _MOST_WORDS:
        raise ValueError("it is too long")
    reader = _Reader(_joined(words), known)
    value = reader.sum(0)
    if reader.next:
        raise ValueError(f"'{reader.next}' is not expected there")
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
        self.words = words
        self.known = known
        self.at = 0

    @property
    def next(self) -> str:
        """The token that comes next, empty at the end."""
        return self.words[self.at] if self.at < len(self.words) else ""

    def taken(self, *signs: str) -> str:
        """The next token if it is one of these, and then it is behind us; empty otherwise."""
        word = self.next
        if word not in signs:
            return ""
        self.at += 1
        return word

    def take(self, word: str) -> None:
        if not self.taken(word):
            raise ValueError(f"'{word}' is missing")

    def sum(self, depth: int) -> Constant:
        value = self.product(depth)
        while sign := self.taken("+", "-"):
            value = _combined(sign, value, self.product(depth))
        return value

    def product(self, depth: int) -> Constant:
        value = self.factor(depth)
        while sign := self.taken("*", "/"):
            value = _combined(sign, value, self.factor(depth))
        return value

    def factor(self, depth: int) -> Constant:
        if depth > _DEEPEST:
            raise ValueError("it is nested too deeply")
        word = self.next
        self.at += 1
        if not word:
            raise ValueError("a value is missing")
        if word in ("+", "-"):
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
        vector = _VECTOR.match(word)
        if vector:
            return _vector(self.arguments(depth + 1), vector[1], int(vector[2]))
        if word in ("float", "int", "uint", "bool"):
            return _scalar(self.arguments(depth + 1), word)
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
            if not self.taken(","):
                break
        self.take(")")
        return parts


def _number(word: str) -> int | float:
    plain = word.lower()
    if len(word) > 100:
        raise ValueError("it is too long")
    if plain.startswith("0x"):
        return _bounded(int(plain.rstrip("u"), 16))
    if plain.rstrip("u").isdigit():
        return _bounded(int(plain.rstrip("u")))
    return _bounded(float(plain.rstrip("lf")))


def _bounded(value: float) -> int | float:
    """The same; whole numbers would grow without end, and no parameter is infinite."""
    if abs(value) > _LARGEST:
        raise ValueError("it is too large")
    return value


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
        return _bounded(a / b)
    return _bounded(a * b if sign == "*" else a + b if sign == "+" else a - b)


def _number_of(value: Constant) -> float:
    if isinstance(value, tuple):
        raise ValueError("a vector of vectors")
    return value
