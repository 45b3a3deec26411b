"""One parameter of a shader file: its type and default from the declaration, the rest from the header."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence, Set
from typing import Any, Literal

from rendergraph.declare import Parameter
from rendergraph.document import Value
from rendergraph.errors import Problem, suggestion
from rendergraph.glsl.globals import Global, literal
from rendergraph.typecheck import Range, fits

_SCALAR: dict[str, type] = {"float": float, "int": int, "uint": int, "bool": bool}
_VECTOR = re.compile(r"([iu]?)vec([234])\Z")
_WORDS = {bool: "true or false", int: "a whole number", float: "a number"}


class HeaderParameter:
    """Makes one parameter and collects what is wrong with it.

    Attributes:
        problems: mistakes in the header.
        said: code and text of mistakes in the declaration.
        lacks_range: it is a number, and neither its least nor its greatest value is said.
    """

    def __init__(
        self,
        name: str,
        entry: Mapping[str, Value],
        named: Value | None,
        found: Global | None,
        words: Set[str],
    ) -> None:
        """Args are the name, the header's keys, its entry where there is one, the declaration, and all words of
        the text.
        """
        self.name = name
        self.entry = entry
        self.named = named
        self.found = found
        self.words = words
        self.problems: list[Problem] = []
        self.said: list[tuple[str, str]] = []
        self.lacks_range = False

    def parameter(self, uniforms: Sequence[str]) -> Parameter | None:
        """The parameter, None where it is wrong.

        Args:
            uniforms: those that the header does not mention, in case its name is misspelt.
        """
        found, entry = self.found, self.entry
        role: Any = self._word("role") or ("param" if found is not None else "define")
        if not self._agrees(role, uniforms):
            return None
        made = self._of_uniform(found) if found is not None else self._of_header()
        if made is None:
            return None
        annotation, default = made
        low, high = self._limit("min"), self._limit("max")
        if low is None and found is not None and found.type.startswith("u"):
            low = 0
        self._check_range(Range(low, high), default)
        self.lacks_range = not {"min", "max", "choices"} & entry.keys() and annotation is not bool
        return Parameter(role, default, self._word("doc"), self._word("unit"), Range(low, high), type=annotation)

    def _word(self, key: str) -> str:
        return str(self.entry[key].data) if key in self.entry else ""

    def _limit(self, key: str) -> float | None:
        data = self.entry[key].data if key in self.entry else None
        return data if isinstance(data, int | float) else None

    def _wrong(self, code: str, key: str, text: str) -> None:
        """A mistake at a value of the header, or at the declaration where the header does not say it."""
        if key in self.entry:
            self.problems.append(self.entry[key].problem(code, text))
        else:
            self.said.append((code, text))

    def _agrees(self, role: str, uniforms: Sequence[str]) -> bool:
        """Whether header and declaration speak of the same thing."""
        found, name = self.found, self.name
        text = ""
        if found is None and role == "param":
            text = f"the header has parameter '{name}', but the shader declares no 'uniform float {name};'"
            text += suggestion(name, uniforms)
        elif found is None and "role" not in self.entry and self.words.isdisjoint(self._macros()):
            text = f"the header has parameter '{name}', but the shader has neither 'uniform float {name};' nor "
            text += f"{name.upper()}, as which it would be compiled in{suggestion(name, uniforms)}"
        elif found is not None and (role != "param" or found.storage != "uniform"):
            what = f"'{found.storage} {found.type} {name};'" + (f", no {role}" if role != "param" else "")
            text = f"the header has parameter '{name}', which the shader declares as {what}"
        if text and self.named is not None:
            self.problems.append(self.named.problem("RG444", text, key=True))
        if not text and found is not None:
            text = self._unfit(found)
            self.said += [("RG441", text)] if text else []
        return not text

    def _macros(self) -> list[str]:
        """What it is in the text where it is compiled in."""
        choices = self.entry["choices"].plain() if "choices" in self.entry else []
        words = [self.name, *(f"{self.name}_{choice}" for choice in choices)]
        return [word.upper().replace("-", "_") for word in words]

    def _unfit(self, found: Global) -> str:
        if not found.array and (found.type in _SCALAR or _VECTOR.match(found.type)):
            return ""
        what = f"an array of {found.type}" if found.array else found.type
        return f"'{self.name}' is {what}, which is no parameter; bool, int, uint, float and their vectors can be"

    def _of_uniform(self, found: Global) -> tuple[Any, Any]:
        """Type and default of a uniform: the header's default, else its initialiser, else 0."""
        vector = _VECTOR.match(found.type)
        part: type = (int if vector[1] else float) if vector else _SCALAR[found.type]
        count = int(vector[2]) if vector else 1
        value: Any = part(0)
        if "choices" in self.entry:
            text = f"'{self.name}' is a uniform; choices are for parameters with the role define or structural"
            self._wrong("RG444", "choices", text)
        if "default" in self.entry:
            value = self.entry["default"].plain()
        elif found.initialiser:
            try:
                value = literal(found.initialiser)
            except ValueError as error:
                text = f"the initialiser of '{self.name}': {error}; write a number, or say its default in the header"
                self.said.append(("RG442", text))
        parts = list(value) if isinstance(value, list | tuple) else [value] * count
        if len(parts) != count or not all(fits(number, part) and Range().accepts(number) for number in parts):
            words = f"{count} numbers" if vector else _WORDS[part]
            text = f"the default of '{self.name}' ({found.type}) is {words}, not {_text(value)}"
            self._wrong("RG442", "default", text)
            parts = [part(0)] * count
        converted = tuple(part(number) for number in parts)
        if vector:
            return tuple[(part,) * count], converted  # type: ignore[misc]  # made at run time
        return part, converted[0]

    def _of_header(self) -> tuple[Any, Any] | None:
        """Type and default of a parameter that is no uniform; None where it is wrong."""
        default = self.entry["default"].plain() if "default" in self.entry else None
        if "choices" in self.entry:
            choices = tuple(str(choice) for choice in self.entry["choices"].plain())
            if default is not None and default not in choices:
                text = f"the default of '{self.name}' is one of {', '.join(choices)}, not {_text(default)}"
                self._wrong("RG442", "default", text)
                default = None
            return Literal[choices], choices[0] if default is None else default
        if isinstance(default, bool | int | float):
            return type(default), default
        text = f"'{self.name}' is no uniform of the shader; it needs choices, or a number or a switch as default"
        if self.named is not None:
            self.problems.append(self.named.problem("RG444", text, key=True))
        return None

    def _check_range(self, limits: Range, default: Any) -> None:
        if limits.empty:
            self._wrong("RG442", "min", f"'{self.name}' has a min of {limits.low:g} above its max of {limits.high:g}")
            return
        for number in default if isinstance(default, tuple) else (default,):
            if fits(number, float) and not limits.accepts(number):
                key = next((key for key in ("default", "min", "max") if key in self.entry), "")
                self._wrong("RG442", key, f"the default of '{self.name}' is {number:g}, outside of its own range")
                return


def _text(value: object) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    return f"'{value}'" if isinstance(value, str) else str(list(value) if isinstance(value, tuple) else value)
