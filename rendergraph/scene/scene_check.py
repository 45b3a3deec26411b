"""Values of a scene file against the keys they belong to: all mistakes at once, each with its place and a way out."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from rendergraph.document import Value, shown
from rendergraph.errors import Problem, suggestion
from rendergraph.scene.keys import MOST, Key


class Checker:
    """Gathers problems while values are read."""

    def __init__(self) -> None:
        self.problems: list[Problem] = []

    def say(self, value: Value, code: str, text: str, *, key: bool = False) -> None:
        """Note a mistake at a value, or at its key."""
        self.problems.append(value.problem(code, text, key=key))

    def mapping(self, value: Value, what: str) -> dict[str, Value]:
        """The entries of a mapping whose keys are names; empty for null."""
        if value.data is None:
            return {}
        if not isinstance(value.data, dict):
            self.say(value, "RG321", f"{what} is a mapping of names, not {value.kind}")
            return {}
        result = {}
        for name, entry in value.items():
            if not isinstance(name, str) or not name or not name.isprintable():
                self.say(entry, "RG321", f"{what} has the name {shown(repr(name))}; names are text", key=True)
            else:
                result[name] = entry
        return result

    def values(
        self, value: Value, keys: Sequence[Key], what: str, names: Mapping[str, Iterable[str]]
    ) -> dict[str, Any]:
        """The values of one entry; what is not there, null or wrong is left out.

        Args:
            value: a mapping.
            keys: what it may hold.
            what: how messages name it, for example `light 'sun'`.
            names: section to the names a link may use.
        """
        if value.data is not None and not isinstance(value.data, dict):
            self.say(value, "RG321", f"{what} is a mapping, not {value.kind}")
            return {}
        table = {key.name: key for key in keys}
        result: dict[str, Any] = {}
        for name, entry in value.items():
            if name not in table:
                self.say(entry, "RG320", f"{what} has no key '{shown(name)}'{suggestion(str(name), table)}", key=True)
                continue
            found = self.value(entry, table[name], what, names)
            if found is not None:
                result[name] = found
        for key in keys:
            if key.required and value.get(key.name) is None:
                self.say(value, "RG321", f"{what} needs '{key.name}'", key=True)
        return result

    def value(self, value: Value, key: Key, what: str, names: Mapping[str, Iterable[str]]) -> Any:
        """One value, or None where it is null or wrong."""
        data = value.data
        if data is None:
            if key.required:
                self.say(value, "RG321", f"{what} needs '{key.name}'")
            return None
        wrong: str | None = None
        result: Any = None
        if key.kind in ("number", "integer"):
            result, wrong = _number(value, key)
        elif key.kind in ("vector", "color", "scale"):
            result, wrong = _numbers(value, key)
        elif key.kind == "flag":
            result, wrong = (data, None) if isinstance(data, bool) else (None, "true or false")
        elif key.kind in ("text", "file"):
            result, wrong = (data, None) if isinstance(data, str) and data else (None, "text")
        elif key.kind == "map":
            result, wrong = (value, None) if isinstance(data, dict) else (None, "a mapping")
        elif key.kind == "choice":
            if str(data) in key.choices:
                return str(data)
            text = f"{what}: '{key.name}' is {_said(value)}, not one of {', '.join(key.choices)}"
            if len(key.choices) > 3:
                text = f"{what}: there is no {key.name} '{shown(data)}'{suggestion(str(data), key.choices)}"
            self.say(value, "RG321", text)
        elif key.kind == "link":
            known = list(names.get(key.choices[0], ()))
            if isinstance(data, str) and data in known:
                return data
            hint = suggestion(str(data), known) or f"; there are no {key.choices[0]}"
            self.say(value, "RG322", f"{what}: there is no {key.name} '{shown(data)}'{hint}")
        if wrong is not None:
            self.say(value, "RG321", f"{what}: '{key.name}' is {_said(value)}, not {wrong}")
        return result


def _said(value: Value) -> str:
    data = value.data
    if isinstance(data, list) and len(data) <= 8 and not any(isinstance(entry.data, list | dict) for entry in data):
        return shown(str([entry.data for entry in data]))
    return f"'{shown(data)}'" if isinstance(data, str) else shown(data) if isinstance(data, int | float) else value.kind


def _number(value: Value, key: Key) -> tuple[Any, str | None]:
    wanted = "a whole number" if key.kind == "integer" else "a number"
    data = value.data
    if isinstance(data, bool) or not isinstance(data, int | float):
        return None, wanted + _limits(key)
    if key.kind == "integer" and not isinstance(data, int):
        return None, wanted + _limits(key)
    if not _within(float(data), key):
        return None, wanted + _limits(key)
    return (int(data) if key.kind == "integer" else float(data)), None


def _numbers(value: Value, key: Key) -> tuple[Any, str | None]:
    sizes = (3, 4) if key.kind == "color" and key.size == 4 else (key.size,)
    wanted = f"{' or '.join(map(str, sizes))} numbers"
    data = value.data
    if key.kind == "scale":
        wanted = "one number or 3 numbers"
        if isinstance(data, int | float) and not isinstance(data, bool) and _within(float(data), key):
            return (float(data),) * 3, None
    if not isinstance(data, list) or len(data) not in sizes:
        return None, wanted
    numbers = [entry.data for entry in data]
    for number in numbers:
        if isinstance(number, bool) or not isinstance(number, int | float):
            return None, wanted
        if not _within(float(number), key):
            return None, wanted + _limits(key)
    result = tuple(float(number) for number in numbers if isinstance(number, int | float))
    return (*result, 1.0) if sizes == (3, 4) and len(result) == 3 else result, None


def _within(number: float, key: Key) -> bool:
    if key.infinite and number == math.inf:
        return True
    return key.low <= number <= key.high and not (key.above and number == key.low)


def _limits(key: Key) -> str:
    low = f"above {key.low:g}" if key.above else f"of at least {key.low:g}" if key.low > -MOST else ""
    high = f"at most {key.high:g}" if key.high < MOST else ""
    if not low and not high:
        return ""
    return " " + " and ".join(filter(None, (low, high)))
