"""Kinds of value that a key takes: which values fit, what they mean, what words and JSON Schema say of them."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeAlias

from msgspec import Struct
from msgspec.structs import replace

from rendergraph.annotations import Range
from rendergraph.document import Value
from rendergraph.errors import suggestion

Schema: TypeAlias = "dict[str, Any]"

MOST = 1e12
"""Beyond this no number that a person writes makes sense, and products of a few would leave single precision."""


class Form(Struct, frozen=True):
    """One kind of value. Null stands for what is not there, so it is of none but `ANYTHING`.

    Attributes:
        shown: what it takes, in a word or two for a table.
        wanted: the same in words for a message.
        fits: whether a value is of this kind.
        schema: its JSON Schema (draft 07).
        plain: what a value that fits means, as plain Python.
        hint: what a value that does not fit was most likely meant to be, to be put behind the message.
        moves: it is numbers, between which there are others.
    """

    shown: str
    wanted: str
    fits: Callable[[Value], bool]
    schema: Callable[[], Schema]
    plain: Callable[[Value], Any] = Value.plain
    hint: Callable[[Value], str] = lambda value: ""
    moves: bool = False


ANYTHING = Form("any value", "a value", lambda value: True, dict)
FLAG = Form("true | false", "true or false", lambda value: isinstance(value.data, bool), lambda: {"type": "boolean"})
TEXT = Form(
    "text",
    "text",
    lambda value: isinstance(value.data, str) and bool(value.data.strip()),
    lambda: {"type": "string", "pattern": "\\S"},
)
NUMBER = Form(
    "number", "a number", lambda value: _is_number(value) and math.isfinite(value.plain()), lambda: {"type": "number"}
)
FILE = Form("path", "a file's name", TEXT.fits, TEXT.schema)


def version(number: int) -> Form:
    """The version of the format that is read."""
    return Form(
        str(number),
        f"{number}, the version of the format that this program reads",
        lambda value: value.data == number and not isinstance(value.data, bool),
        lambda: {"const": number},
    )


def word(pattern: re.Pattern[str], wanted: str, shown: str = "name") -> Form:
    """Text of a certain form.

    Args:
        pattern: of all of it.
        wanted: what it is, in words.
        shown: the same for a table.
    """
    schema = {"type": "string", "pattern": regular(pattern)}
    return Form(
        shown, wanted, lambda value: isinstance(value.data, str) and bool(pattern.match(value.data)), lambda: schema
    )


def shipped(names: Callable[[], Mapping[str, Path]]) -> Form:
    """The name of something shipped, which an editor offers, or the path of a file, which it does not."""
    path = {"type": "string", "pattern": "[./]"}
    return Form("name | path", "text", TEXT.fits, lambda: {"anyOf": [{"enum": list(names())}, path]})


def choice(*words: str) -> Form:
    """One of some words."""
    return Form(
        " | ".join(words),
        f"one of {', '.join(words)}",
        lambda value: isinstance(value.data, str) and value.data in words,
        lambda: {"enum": list(words)},
        hint=lambda value: suggestion(value.data, words, most=0) if isinstance(value.data, str) else "",
    )


def number(low: float = -MOST, high: float = MOST, *, above: bool = False, infinite: bool = False) -> Form:
    """A number.

    Args:
        low, high: limits, inclusive; those that nobody reaches go without saying.
        above: `low` itself is not among them.
        infinite: `.inf` is, whatever `high` says.
    """
    limits = Range(low, high, above)

    def fits(value: Value) -> bool:
        return _is_number(value) and (limits.holds(value.data) or (infinite and value.data == math.inf))

    words = f"a number{_words(limits)}"
    return Form("number", words, fits, lambda: _schema(limits, infinite), _float, _too_large, moves=True)


def _too_large(value: Value) -> str:
    """That it is a number, or a list of numbers, and what is wrong is how large they are."""
    parts = value.data if isinstance(value.data, list) else [value]
    large = [part for part in parts if isinstance(part.data, int | float) and abs(part.data) > MOST]
    if large and all(map(_is_number, parts)):
        return f"; numbers end at {MOST:.3g}"
    return ""


def whole(low: int, high: float = MOST) -> Form:
    """A whole number within limits, inclusive."""
    limits = Range(low, high)
    return Form(
        "whole number",
        f"a whole number{_words(limits)}",
        lambda value: _is_number(value) and isinstance(value.data, int) and limits.holds(value.data),
        lambda: {**_schema(limits), "type": "integer"},
    )


# --- several values --------------------------------------------------------------------------------------------------


def row(*forms: Form) -> Form:
    """A list of as many values, each of its own form."""
    count = len(forms)

    def fits(value: Value) -> bool:
        parts = _parts(value)
        return len(parts) == count and all(form.fits(part) for form, part in zip(forms, parts, strict=True))

    return Form(
        f"[{', '.join(form.shown for form in forms)}]",
        f"a list of {', '.join(form.wanted for form in forms)}",
        fits,
        lambda: {"type": "array", "items": [form.schema() for form in forms], "minItems": count, "maxItems": count},
        lambda value: tuple(form.plain(part) for form, part in zip(forms, _parts(value), strict=True)),
        moves=all(form.moves for form in forms),
    )


def vector(count: int = 3, low: float = -MOST, high: float = MOST, *, above: bool = False) -> Form:
    """A list of as many numbers, each within limits as `number` has them."""
    words = f"{count} numbers{_words(Range(low, high, above))}"
    return replace(
        row(*[number(low, high, above=above)] * count), shown=f"[{count} numbers]", wanted=words, hint=_too_large
    )


def color(high: float = MOST, *, alpha: bool = False) -> Form:
    """Red, green and blue from 0 up, and alpha where it is asked for; without it alpha is 1."""
    three, four = vector(3, 0, high), vector(4, 0, high)
    found = three
    if alpha:
        words = four.wanted.replace("4", "3 or 4", 1)
        both = either(four, three, wanted=words)
        found = replace(both, plain=lambda value: (*both.plain(value), 1.0)[:4])
    return replace(found, shown="[r, g, b]")


def scale() -> Form:
    """A factor for each axis, or one for all."""
    one, three = number(), vector(3)
    found = either(one, three, wanted="one number or 3 numbers", shown="number | [x, y, z]")
    return replace(
        found,
        plain=lambda value: three.plain(value) if three.fits(value) else (one.plain(value),) * 3,
    )


def listed(of: Form, what: str, least: int = 0, most: int | None = None) -> Form:
    """A list.

    Args:
        of: its values.
        what: several of them, in a word.
        least, most: how many there are.
    """

    def fits(value: Value) -> bool:
        parts = _parts(value)
        count = least <= len(parts) and (most is None or len(parts) <= most)
        return isinstance(value.data, list) and count and all(map(of.fits, parts))

    bounds = {"minItems": least} | ({"maxItems": most} if most is not None else {})
    return Form(
        f"[{of.shown}, …]", f"a list of {what}", fits, lambda: {"type": "array", "items": of.schema(), **bounds}
    )


def either(*forms: Form, wanted: str = "", shown: str = "") -> Form:
    """A value of one of some forms.

    Args:
        forms: which.
        wanted, shown: what it takes in words; those of the forms by default.
    """
    words = [form.wanted for form in forms]
    return Form(
        shown or " | ".join(form.shown for form in forms),
        wanted or f"{', '.join(words[:-1])}, or {words[-1]}",
        lambda value: any(form.fits(value) for form in forms),
        lambda: {"anyOf": [form.schema() for form in forms]},
        lambda value: next(form for form in forms if form.fits(value)).plain(value),
        lambda value: next(filter(None, (form.hint(value) for form in forms)), ""),
        all(form.moves for form in forms),
    )


def _float(value: Value) -> float:
    return float(value.data)  # type: ignore[arg-type]  # it fits, so it is a number


def _is_number(value: Value) -> bool:
    return isinstance(value.data, int | float) and not isinstance(value.data, bool)


def _words(limits: Range) -> str:
    """Those that do not go without saying."""
    low, high = limits.low, limits.high
    return str(replace(limits, low=None if low == -MOST else low, high=None if high == MOST else high))


def _schema(limits: Range, infinite: bool = False) -> Schema:
    """A number within limits; JSON has no infinity that would be one."""
    found: Schema = {"type": "number"}
    if limits.low is not None and limits.low > -MOST:
        found["exclusiveMinimum" if limits.above else "minimum"] = limits.low
    if limits.high is not None and limits.high < MOST and not infinite:
        found["maximum"] = limits.high
    return found


def _parts(value: Value) -> Sequence[Value]:
    return value.data if isinstance(value.data, list) else ()


def regular(pattern: re.Pattern[str]) -> str:
    """A pattern that holds for all of a text, as JSON Schema writes it."""
    return f"^{pattern.pattern.removesuffix(chr(92) + 'Z')}$"
