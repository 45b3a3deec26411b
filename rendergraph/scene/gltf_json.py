"""Strict JSON for glTF, and getters that check type and range and say where they stand.

Strict means: UTF-8, no duplicate keys, no NaN or Infinity, no number that overflows a double.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from rendergraph.document import shown
from rendergraph.errors import InputError

Fail = Callable[[str], InputError]
"""Makes the error for a text, with the file's name."""


class _Wrong(Exception):
    """What a JSON hook found; turned into an error with the file's name."""


def parse(text: bytes, fail: Fail) -> JsonObject:
    """The top object of strict JSON.

    Raises:
        InputError: it is not UTF-8, not JSON, too deep, has duplicate keys, NaN, or a number out of range.
    """

    def unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        result = dict(pairs)
        if len(result) != len(pairs):
            seen: set[str] = set()
            for key, _ in pairs:
                if key in seen:
                    raise _Wrong(f"key '{shown(key)}' stands twice in one object")
                seen.add(key)
        return result

    def finite(digits: str) -> float:
        value = float(digits)
        if not math.isfinite(value):
            raise _Wrong(f"number {shown(digits, 30)} is out of range")
        return value

    def whole(digits: str) -> int:
        if len(digits) > 20:
            raise _Wrong(f"number {shown(digits, 30)} is out of range")
        return int(digits)

    def constant(word: str) -> Any:
        raise _Wrong(f"{word} is not allowed in JSON")

    try:
        value = json.loads(
            text.decode("utf-8"), object_pairs_hook=unique, parse_float=finite, parse_int=whole, parse_constant=constant
        )
    except UnicodeDecodeError as problem:
        raise fail(f"its JSON is not UTF-8 at byte {problem.start}") from None
    except json.JSONDecodeError as problem:
        raise fail(f"its JSON is malformed at line {problem.lineno}, column {problem.colno}: {problem.msg}") from None
    except RecursionError:
        raise fail("its JSON is nested too deeply") from None
    except _Wrong as problem:
        raise fail(f"its JSON is wrong: {problem}") from None
    if not isinstance(value, dict):
        raise fail("its JSON is no object")
    return JsonObject(value, "", fail)


_TYPES: dict[type, str] = {dict: "an object", list: "a list", str: "text", bool: "true or false"}


@dataclass(frozen=True)
class JsonObject:
    """A JSON object with its path in the file (`meshes[2].primitives[0]`)."""

    value: dict[str, Any]
    path: str
    fail: Fail

    def wrong(self, text: str) -> InputError:
        """An error at this object."""
        return self.fail(f"{self.path}: {text}" if self.path else text)

    def has(self, key: str) -> bool:
        """Whether the key stands there."""
        return key in self.value

    def _typed(self, key: str, kind: type) -> Any:
        found = self.value.get(key)
        if found is not None and not isinstance(found, kind):
            raise self.wrong(f"'{key}' must be {_TYPES[kind]}")
        if found is None and key in self.value:
            raise self.wrong(f"'{key}' is null")
        return found

    def text(self, key: str, default: str = "") -> str:
        """A string."""
        found = self._typed(key, str)
        return default if found is None else str(found)

    def choice(self, key: str, default: str, choices: tuple[str, ...]) -> str:
        """One of a few words."""
        found = self.text(key, default)
        if found not in choices:
            raise self.wrong(f"'{key}' is '{shown(found)}', not one of {', '.join(choices)}")
        return found

    def flag(self, key: str) -> bool:
        """A boolean, false where it is missing."""
        return bool(self._typed(key, bool))

    def part(self, key: str) -> JsonObject | None:
        """An object, or None."""
        found = self._typed(key, dict)
        return None if found is None else JsonObject(found, f"{self.path}.{key}" if self.path else key, self.fail)

    def parts(self, key: str) -> list[JsonObject]:
        """A list of objects, empty where it is missing."""
        found = self._typed(key, list) or []
        base = f"{self.path}.{key}" if self.path else key
        for index, entry in enumerate(found):
            if not isinstance(entry, dict):
                raise self.wrong(f"'{key}[{index}]' must be an object")
        return [JsonObject(entry, f"{base}[{index}]", self.fail) for index, entry in enumerate(found)]

    def extension(self, name: str) -> JsonObject | None:
        """An extension's object on this one."""
        found = self.part("extensions")
        return None if found is None else found.part(name)

    def integer(self, key: str, default: int | None = None, low: int = 0, high: int = 2**53) -> int:
        """A whole number within limits; required where there is no default."""
        found = self.value.get(key, default)
        if isinstance(found, float) and found.is_integer():
            found = int(found)
        if not isinstance(found, int) or isinstance(found, bool):
            raise self.wrong(f"'{key}' {'is missing' if key not in self.value else 'must be a whole number'}")
        if not low <= found <= high:
            raise self.wrong(f"'{key}' is {found}, outside {low} to {high}")
        return found

    def index(self, key: str, count: int, what: str) -> int | None:
        """An index into a list of `count`, or None where it is missing."""
        if key not in self.value:
            return None
        found = self.integer(key)
        if found >= count:
            raise self.wrong(f"'{key}' is {found}, but there are {count} {what}")
        return found

    def indices(self, key: str, count: int, what: str) -> list[int]:
        """A list of indices."""
        found = self._typed(key, list) or []
        for entry in found:
            if not isinstance(entry, int) or isinstance(entry, bool) or entry < 0:
                raise self.wrong(f"'{key}' must hold indices")
            if entry >= count:
                raise self.wrong(f"'{key}' holds {entry}, but there are {count} {what}")
        return list(found)

    def number(self, key: str, default: float | None = None) -> float:
        """A finite number; required where there is no default."""
        found = self.value.get(key, default)
        if not isinstance(found, int | float) or isinstance(found, bool):
            raise self.wrong(f"'{key}' {'is missing' if key not in self.value else 'must be a number'}")
        return float(found)

    def numbers(self, key: str, count: int, default: tuple[float, ...] | None = None) -> tuple[float, ...]:
        """So many finite numbers."""
        found = self._typed(key, list)
        if found is None:
            if default is None:
                raise self.wrong(f"'{key}' is missing")
            return default
        if len(found) != count or not all(isinstance(v, int | float) and not isinstance(v, bool) for v in found):
            raise self.wrong(f"'{key}' must be {count} numbers")
        return tuple(float(v) for v in found)
