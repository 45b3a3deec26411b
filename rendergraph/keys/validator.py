"""Validate a file: report unknown keys and values that do not fit, with their places, and leave them out."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

from msgspec import Struct

from rendergraph.document import BROKEN, Value, describe, shown
from rendergraph.errors import InputError, Problem, suggestion
from rendergraph.keys.tables import Key, MapOf, Recursive, Table, Type
from rendergraph.typecheck import conversion_to, hint_for, test_of, words_for

MOST_PROBLEMS = 100
"""Maximum number of mistakes: finding the nearest name for each of a million would take hours."""


class Codes(Struct, frozen=True):
    """The error codes of one kind of file.

    Attributes:
        wrong: a value that does not fit, or is missing.
        file: the file is not a mapping.
    """

    unknown: str
    wrong: str
    name: str
    file: str


class Validator:
    """Checks the values of one file against tables.

    Attributes:
        dropped: paths of values that were left out, so that they are not reported as missing.
    """

    def __init__(self, codes: Codes, problems: Iterable[Problem] = ()) -> None:
        """Start with the problems of parsing; values may be `BROKEN`, which has been reported."""
        self.codes = codes
        self.problems = list(problems)
        self.dropped: set[tuple[str, ...]] = set()
        self._has_broken = bool(self.problems)
        self._path: list[str] = []
        # By identity, because hashing an annotation takes long.
        self._checks: dict[int, tuple[Callable[[Any], bool], Callable[[Any], Any]]] = {}

    def report(self, value: Value, code: str, text: str, *, key: bool = False) -> None:
        """Record a mistake at a value, or at its key."""
        self.problems.append(value.problem(code, text, key=key))
        if len(self.problems) >= MOST_PROBLEMS:
            raise InputError(self.problems)

    def file(self, value: Value, table: Table, holds: str) -> Value | None:
        """Return the valid part of a file's root; `holds` describes what a file usually has."""
        if isinstance(value.data, dict):
            return self._table(value, table, "")
        if value.data is not BROKEN:
            self.report(value, self.codes.file, f"expected {table.what}, a mapping with {holds}, got {value.kind}")
        return None

    def value(self, value: Value, key: Key) -> Value | None:
        """Return the valid part of a key's value; None if nothing of it is valid, or it is null."""
        return self._value(value, key, key.type, key.name)

    def _value(self, value: Value, key: Key, type: Type, name: str) -> Value | None:
        data = value.data
        if isinstance(type, Recursive):
            type = type.table() if isinstance(data, dict) else type.type
        if isinstance(type, Table) and isinstance(data, dict):
            return self._table(value, type, name)
        if isinstance(type, MapOf) and isinstance(data, dict) and len(data) >= type.least:
            return self._map(value, key, type)
        expected, hint = "a mapping", ""
        if not isinstance(type, Table | MapOf):
            if self._has_broken and _is_broken(value):
                return None
            plain = value.plain() if isinstance(data, list | dict) else data
            if type is Any or self._accepts(type, plain):
                return value
            expected, hint = words_for(type, file=True), hint_for(plain, type)
        if data is not BROKEN:
            example = f", as in {key.example}" if key.example else ""
            text = f"'{shown(name)}': expected {expected}{example}, got {describe(value)}{hint}"
            self.report(value, key.code or self.codes.wrong, text)
        return None

    def _accepts(self, type: Any, value: Any) -> bool:
        check = self._checks.get(id(type))
        if check is None:
            self._checks[id(type)] = check = test_of(type), conversion_to(type)
        test, convert = check
        return test(value) or test(convert(value))  # most values fit without conversion

    def _enter(self, valid: dict[str, Value], name: str, child: Value, key: Key, type: Type) -> None:
        """Add the valid part of a child to a mapping, or record that it was left out."""
        self._path.append(name)
        if child.data is None:
            valid[name] = child
        elif (part := self._value(child, key, type, name)) is not None:
            valid[name] = part
        else:
            self.dropped.add(tuple(self._path))
        self._path.pop()

    def _table(self, value: Value, table: Table, name: str) -> Value:
        what = table.what.format(shown(name))
        keys = table.keys_of(value)
        valid: dict[str, Value] = {}
        for word, child in value.items():
            if word in keys:
                self._enter(valid, word, child, keys[word], keys[word].type)
                continue
            if word in table.refused:
                text = table.refused[word]
            elif child.data is None and " " in str(word):
                text = f"'{shown(word)}' is read as a key; put text with a comma in quotes within {{…}}"
            else:
                text = f"{what} has no key '{shown(word)}'{suggestion(str(word), keys)}"
            self.report(child, table.code or self.codes.unknown, text, key=True)
        self._missing(value, table, what)
        return value.with_data(valid)

    def _missing(self, value: Value, table: Table, what: str) -> None:
        given = {name for name, child in value.items() if child.data is not None}
        if table.alternatives and len(given & table.alternatives.keys()) != 1:
            words = " or ".join(f"'{name}'" for name in table.alternatives)
            either = "either " if len(table.alternatives) > 1 else ""
            self.report(value, self.codes.wrong, f"{what} needs {either}{words}", key=True)
        for key in table.keys:
            if key.required and key.name not in given:
                example = f"; add {key.example}" if key.example else ""
                self.report(value, self.codes.wrong, f"{what} needs '{key.name}'{example}", key=True)

    def _map(self, value: Value, key: Key, type: MapOf) -> Value:
        valid: dict[str, Value] = {}
        for name, child in value.items():
            if not isinstance(name, str) or name in type.refused or not type.naming.pattern.match(name):
                text = type.refused.get(str(name)) or f"'{shown(name)}' is not a {type.what}; use {type.naming.words}"
                text += "; a space is needed between the ':' and the value" if ":" in str(name) else ""
                self.report(child, self.codes.name, text, key=True)
                self.dropped.add((*self._path, str(name)))
            elif child.data is None and isinstance(type.of, Table):
                valid[name] = child
                self._missing(child, type.of, type.of.what.format(shown(name)))
            elif child.data is None and not type.null:
                self._value(child, key, type.of, name)
            else:
                self._enter(valid, name, child, key, type.of)
        return value.with_data(valid)


def _is_broken(value: Value) -> bool:
    data = value.data
    parts = data if isinstance(data, list) else data.values() if isinstance(data, dict) else ()
    return data is BROKEN or any(map(_is_broken, parts))
