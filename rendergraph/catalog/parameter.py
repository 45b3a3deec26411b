"""One parameter of a shader file: its type and default from the declaration, the rest from the header."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence, Set
from typing import Any, Literal

from msgspec import Struct

from rendergraph.declare import Parameter
from rendergraph.document import Value
from rendergraph.errors import suggestion
from rendergraph.glsl.globals import Global, literal
from rendergraph.typecheck import Range, fits, words_for

_SCALAR: dict[str, type] = {"float": float, "int": int, "uint": int, "bool": bool}
_VECTOR = re.compile(r"([iu]?)vec([234])\Z")
Report = Callable[[str, str, "Value | None"], None]


def is_parameter(found: Global) -> bool:
    """Whether a declaration may be a parameter: a number, a switch or a vector."""
    return found.storage == "uniform" and (found.type in _SCALAR or _VECTOR.match(found.type) is not None)


class ParameterReader(Struct, eq=False):
    """Reads a parameter from the header's keys, the entry's value and the declaration.

    `report` receives code, text and the wrong value of the header, None for the declaration.
    """

    name: str
    entry: Mapping[str, Value]
    named: Value | None
    found: Global | None
    report: Report
    lacks_range: bool = False

    def parameter(self, uniforms: Sequence[str], words: Callable[[], Set[str]]) -> Parameter | None:
        """Return the parameter; None if it is wrong."""
        found, entry = self.found, self.entry
        role: Any = self._text("role") or ("param" if found is not None else "define")
        if mismatch := self._mismatch(role, uniforms, words):
            if self.named is not None:
                self.report("RG444", mismatch, self.named)
            return None
        if found is not None and (found.array or not is_parameter(found)):
            what = f"an array of {found.type}" if found.array else found.type
            kinds = "bool, int, uint, float and their vectors can be"
            self.report("RG441", f"'{self.name}' is {what}, which is not a parameter; {kinds}", None)
            return None
        typed = self._of_uniform(found) if found is not None else self._of_header()
        if typed is None:
            return None
        annotation, default = typed
        low, high = self._limit("min"), self._limit("max")
        if low is None and found is not None and found.type.startswith("u"):
            low = 0
        self._check_range(Range(low, high), default)
        self.lacks_range = not {"min", "max", "choices"} & entry.keys() and annotation is not bool
        return Parameter(role, default, self._text("doc"), self._text("unit"), Range(low, high), type=annotation)

    def _text(self, key: str) -> str:
        return str(self.entry[key].data) if key in self.entry else ""

    def _limit(self, key: str) -> float | None:
        data = self.entry[key].data if key in self.entry else None
        return data if isinstance(data, int | float) else None

    def _mismatch(self, role: str, uniforms: Sequence[str], words: Callable[[], Set[str]]) -> str:
        """Return how header and declaration disagree; empty if they agree."""
        found, name = self.found, self.name
        if found is not None:
            if role == "param" and found.storage == "uniform":
                return ""
            what = f"'{found.storage} {found.type} {name};'" + (f", not a {role}" if role != "param" else "")
            return f"the header has parameter '{name}', which the shader declares as {what}"
        if role == "param":
            text = f"the header has parameter '{name}', but the shader declares no 'uniform float {name};'"
        elif "role" not in self.entry and words().isdisjoint(self._macros()):
            text = f"the header has parameter '{name}', but the shader has neither 'uniform float {name};' nor "
            text += f"{name.upper()}, as which it would be compiled in"
        else:
            return ""
        return text + suggestion(name, uniforms)

    def _macros(self) -> list[str]:
        choices = self.entry["choices"].plain() if "choices" in self.entry else []
        names = [self.name, *(f"{self.name}_{choice}" for choice in choices)]
        return [name.upper().replace("-", "_") for name in names]

    def _of_uniform(self, found: Global) -> tuple[Any, Any]:
        """Return type and default of a uniform: the header's default, else its initialiser, else 0."""
        vector = _VECTOR.match(found.type)
        kind: type = (int if vector[1] else float) if vector else _SCALAR[found.type]
        count = int(vector[2]) if vector else 1
        given, value = self.entry.get("default"), kind(0)
        if "choices" in self.entry:
            text = f"'{self.name}' is a uniform; choices are for parameters with the role define or structural"
            self.report("RG444", text, self.entry["choices"])
        if given is not None:
            value = given.plain()
        elif found.initialiser:
            try:
                value = literal(found.initialiser)
            except ValueError as error:
                text = f"the initialiser of '{self.name}': {error}; write a number, or give its default in the header"
                self.report("RG442", text, None)
        numbers = list(value) if isinstance(value, list | tuple) else [value] * count
        if len(numbers) != count or not all(fits(number, kind) and Range().accepts(number) for number in numbers):
            expected = f"{count} numbers" if vector else words_for(kind, file=True)
            text = f"the default of '{self.name}' ({found.type}): expected {expected}, got {_text(value)}"
            self.report("RG442", text, given)
            numbers = [kind(0)] * count
        converted = tuple(map(kind, numbers))
        if vector:
            return tuple[(kind,) * count], converted  # type: ignore[misc]  # made at run time
        return kind, converted[0]

    def _of_header(self) -> tuple[Any, Any] | None:
        """Return type and default of a parameter that is not a uniform; None if they are wrong."""
        default = self.entry["default"].plain() if "default" in self.entry else None
        if "choices" in self.entry:
            choices = tuple(map(str, self.entry["choices"].plain()))
            if default is not None and default not in choices:
                text = f"the default of '{self.name}': expected one of {', '.join(choices)}, got {_text(default)}"
                self.report("RG442", text, self.entry["default"])
                default = None
            return Literal[choices], choices[0] if default is None else default
        if isinstance(default, bool | int | float):
            return type(default), default
        if self.named is not None:
            needs = "it needs choices, or a default that is a number or a switch"
            self.report("RG444", f"'{self.name}' is not a uniform of the shader; {needs}", self.named)
        return None

    def _check_range(self, limits: Range, default: Any) -> None:
        if limits.empty:
            text = f"'{self.name}' has a min of {limits.low:g} above its max of {limits.high:g}"
            self.report("RG442", text, self.entry.get("min"))
            return
        for number in default if isinstance(default, tuple) else (default,):
            if fits(number, float) and not limits.accepts(number):
                where = next((self.entry[key] for key in ("default", "min", "max") if key in self.entry), None)
                self.report("RG442", f"the default of '{self.name}' is {number:g}, outside its range", where)
                return


def _text(value: object) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    return f"'{value}'" if isinstance(value, str) else str(list(value) if isinstance(value, tuple) else value)
