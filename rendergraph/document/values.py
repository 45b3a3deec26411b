"""Values with their places, and their sources."""

from __future__ import annotations

import os
import re
from bisect import bisect_right
from collections.abc import Iterator, Mapping
from functools import cached_property
from os import PathLike, fspath
from pathlib import Path
from typing import Any, TypeAlias

from msgspec import Struct

from rendergraph.errors import InputError, Option, Place, Problem, printable

Scalar: TypeAlias = "str | int | float | bool | None"
Index: TypeAlias = "str | int | float"
Data: TypeAlias = "Scalar | list[Value] | dict[Any, Value] | Broken"

_BREAK = "\r\n|[\r\n\x85\u2028\u2029]"  # YAML's line breaks
_LONGEST_LINE = 400


class Source(Struct, eq=False, dict=True):
    """The file, option or argument that values come from; the text is kept to show the line of a mistake."""

    origin: str | Option
    path: Path | None = None
    text: str = ""

    def beside(self, name: str) -> Path:
        """Return the path of a name relative to the source's folder; to the current one if the source is not a file."""
        return Path(os.path.normpath((self.path.parent if self.path else Path()) / name))

    @cached_property
    def _starts(self) -> list[int]:
        return [0, *(match.end() for match in re.finditer(_BREAK, self.text))]

    def line(self, number: int) -> str:
        """Return a line's text, counted from 1; empty if it does not exist or is too long to show."""
        if not 0 < number <= len(self._starts):
            return ""
        text = self.text[self._starts[number - 1] : self._starts[number - 1] + _LONGEST_LINE + 1]
        text = re.split(_BREAK, text, maxsplit=1)[0]
        return text if len(text) <= _LONGEST_LINE and text.expandtabs(1).isprintable() else ""

    def at(self, offset: int) -> tuple[int, int]:
        """Return line and column, from 1, of a character."""
        line = bisect_right(self._starts, offset)
        return line, offset - self._starts[line - 1] + 1

    def problem(self, code: str, text: str, line: int = 0, column: int = 0) -> Problem:
        return Problem(code, text, Place(self.origin, line, column), self.line(line))


class Broken:
    """Stands for a wrong value that has been reported, so that reading can continue."""

    def __repr__(self) -> str:
        return "BROKEN"


BROKEN = Broken()


class Value(Struct, eq=False):
    """One value with its position, counted from 1, and that of its key; lists and mappings hold further values."""

    data: Data
    source: Source
    line: int = 0
    column: int = 0
    key: tuple[int, int] | None = None

    def __repr__(self) -> str:
        return f"Value({self.data!r}, {self.place})"

    @property
    def place(self) -> Place:
        return Place(self.source.origin, self.line, self.column)

    @property
    def key_place(self) -> Place:
        line, column = self.key or (self.line, self.column)
        return Place(self.source.origin, line, column)

    @property
    def kind(self) -> str:
        return kind_of(self.data)

    def with_data(self, data: Data) -> Value:
        return Value(data, self.source, self.line, self.column, self.key)

    @property
    def mapping(self) -> dict[Any, Value]:
        """The entries of a mapping; none for other values."""
        return self.data if isinstance(self.data, dict) else {}

    def updated(self, entries: Mapping[Any, Value]) -> Value:
        return self.with_data({**self.mapping, **entries})

    def problem(self, code: str, text: str, *, key: bool = False) -> Problem:
        place = self.key_place if key else self.place
        return self.source.problem(code, text, place.line, place.column)

    def relocate(self, problem: Problem, *, key: bool = False, code: str = "", context: str = "") -> Problem:
        place = self.key_place if key else self.place
        return problem.relocate(place, self.source.line(place.line), code=code, context=context)

    def items(self) -> Iterator[tuple[Any, Value]]:
        """Iterate over a mapping; over nothing for other values."""
        return iter(self.mapping.items())

    def get(self, *path: Index) -> Value | None:
        found: Value = self
        for step in path:
            data = found.data
            if isinstance(data, dict) and step in data:
                found = data[step]
            elif isinstance(data, list) and step in range(len(data)):
                found = data[int(step)]
            else:
                return None
        return found

    def plain(self) -> Any:
        """Return Python data; repeated aliases are one object, not copies."""
        return _plain(self, {})


def _plain(value: Value, seen: dict[int, Any]) -> Any:
    data = value.data
    if not isinstance(data, dict | list):
        return data
    # An alias's value shares `data` with its anchor's, so that many nested aliases cost no more than their text.
    if id(data) not in seen:
        seen[id(data)] = (
            {key: _plain(child, seen) for key, child in data.items()}
            if isinstance(data, dict)
            else [_plain(child, seen) for child in data]
        )
    return seen[id(data)]


class Document(Struct, frozen=True, eq=False, dict=True):
    """The values of one YAML file.

    Attributes:
        problems: mistakes that did not prevent reading.
        dropped: paths of wrong values that were left out, so that they are not reported as missing.
    """

    root: Value
    source: Source
    problems: tuple[Problem, ...] = ()
    dropped: frozenset[tuple[str, ...]] = frozenset()

    @property
    def path(self) -> Path | None:
        return self.source.path


def from_plain(data: Any, source: Source) -> Value:
    """Return Python data as values; tuples become lists, NumPy scalars and arrays their contents.

    For an argument in Python, the place of each value is its path of keys: `nodes.ao.params.radius`.
    """
    if hasattr(data, "tolist"):
        data = data.tolist()
    if isinstance(data, Mapping):
        return Value({str(key): from_plain(child, _below(source, key)) for key, child in data.items()}, source)
    if isinstance(data, list | tuple):
        return Value([from_plain(child, source) for child in data], source)
    if isinstance(data, PathLike):
        data = fspath(data)
    if data is None or isinstance(data, str | float) or (isinstance(data, int) and abs(data) < 2**63):
        return Value(data, source)
    text = f"{shown(repr(data))} cannot be written to a file; use text, numbers, lists and mappings"
    raise InputError(source.problem("RG106", text))


def merge_patch(target: Value | None, patch: Value, *, keep_nulls: bool = False) -> Value:
    """Merge as in RFC 7386: mappings merge, null removes, everything else replaces; values keep their places.

    With `keep_nulls`, nulls stay, so that they remove when the result is merged into something else.
    """
    if not isinstance(patch.data, dict):
        return patch
    merged = dict(target.mapping) if target is not None else {}
    for key, value in patch.data.items():
        if value.data is None and not keep_nulls:
            merged.pop(key, None)
        else:
            merged[key] = merge_patch(merged.get(key), value, keep_nulls=keep_nulls)
    return patch.with_data(merged)


def _below(source: Source, key: object) -> Source:
    origin = source.origin
    if isinstance(origin, str) or origin.name.startswith("-"):
        return source
    return Source(Option(origin.name, ".".join(filter(None, (origin.text, str(key))))))


def kind_of(data: object) -> str:
    if data is None:
        return "null"
    if isinstance(data, bool):
        return "true" if data else "false"
    if isinstance(data, str):
        return "text"
    if isinstance(data, int | float):
        return "a number"
    return "a mapping" if isinstance(data, Mapping) else "a list"


def describe(value: Value) -> str:
    """Describe a value for messages, or quote it if it is short."""
    data = value.data
    if isinstance(data, str):
        return f"'{shown(data, 40)}'"
    if isinstance(data, list) and len(data) <= 8 and not any(isinstance(part.data, list | dict) for part in data):
        return shown([part.data for part in data])
    is_plain = isinstance(data, int | float) and not isinstance(data, bool)
    return shown(data) if is_plain else value.kind


def shown(text: object, most: int = 60) -> str:
    """Quote a user's text for a message: one line, no control characters, at most `most` characters."""
    word = str(text)
    if len(word) > most:
        word = word[: most - 1] + "…"
    return printable(word)
