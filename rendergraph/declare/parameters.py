"""Parameters: annotated fields of a node."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, Literal, TypeAlias, get_args, get_origin

from msgspec import Struct

from rendergraph.typecheck import Brief, JsonSchema, Range, conversion_to, test_of, words_for

Role: TypeAlias = Literal["param", "define", "structural", "plain"]
_is_number = test_of(float)


class FileContent(Struct, frozen=True):
    """The file that a parameter names, relative to the file that contains the value.

    Attributes:
        path: of the file, which exists.
        digest: of its content, so that a changed file is another value.
    """

    path: Path
    digest: str

    def __str__(self) -> str:
        return str(self.path)


InputFile: TypeAlias = Annotated[
    FileContent, "a file's name", Brief("path"), JsonSchema(lambda: {"type": "string", "minLength": 1})
]
"""The type of a parameter that names a file: `look: InputFile | None = structural(default=None, doc=…)`."""


class Parameter(Struct, frozen=True, dict=True):
    """The declaration of a parameter; see `param`, `define` and `structural`.

    Attributes:
        role: a uniform (`param`), program text (`define`) or part of the plan (`structural`). A bare value on the class
            is `plain`, which is a mistake.
        limits: of each number in it, inclusive.
        open_name: the name under which plugins add choices, empty if they cannot.
        name, type: the field's name and annotation.
    """

    role: Role
    default: Any
    doc: str = ""
    unit: str = ""
    limits: Range = Range()
    glsl: str = ""
    open_name: str = ""
    needs: tuple[str, ...] = ()
    unless: str = ""
    name: str = ""
    type: Any = None

    @cached_property
    def choices(self) -> tuple[Any, ...]:
        """The values that its type lists, also as part of a union."""
        return tuple(_listed(self.type))

    @cached_property
    def words(self) -> tuple[str, ...]:
        """The choices that are words."""
        return tuple(choice for choice in self.choices if isinstance(choice, str))

    def closed(self, added: tuple[str, ...] = ()) -> Any:
        """Return its type; if plugins can add choices, a `Literal` of its own and the added ones."""
        return Literal[(*self.words, *added)] if self.open_name else self.type

    def takes(self, added: tuple[str, ...] = ()) -> str:
        """Return a description of the values that a file may give; `added` are the choices of plugins."""
        return words_for(self.closed(added), self.limits, file=True)

    def convert(self, value: object) -> Any:
        """Convert a file's value to the parameter's type: a list to a tuple, a whole number to a float.

        Raises:
            TypeError: it does not fit the type: `expected a whole number`.
            ValueError: a number is outside the limits: `must be at least 1`.
        """
        convert, fits = self._taken
        found = convert(value)
        if not fits(found):
            raise TypeError(f"expected {self.takes()}")
        if wrong := self.violation(found):
            raise ValueError(wrong)
        return found

    def violation(self, value: object) -> str | None:
        """Return what a value outside the limits must be; None for other values."""
        parts: tuple[Any, ...] = value if isinstance(value, tuple) else (value,)
        for number in parts:
            if _is_number(number) and (wrong := self.limits.violation(number)):
                return wrong
        return None

    @cached_property
    def _taken(self) -> tuple[Callable[[Any], Any], Callable[[Any], bool]]:
        return conversion_to(self.type), test_of(self.type)


def _listed(annotation: Any) -> Iterator[Any]:
    if get_origin(annotation) is Literal:
        yield from get_args(annotation)
    else:
        for part in get_args(annotation):
            yield from _listed(part)


def param(
    *,
    default: Any,
    doc: str,
    unit: str = "",
    min: float | None = None,
    max: float | None = None,
    glsl: str = "",
    unless: str = "",
) -> Any:
    """Declare a parameter that becomes a uniform: changing it rebuilds nothing.

    Args:
        default: value if the file gives none.
        doc: one line.
        unit: the unit's symbol, empty for a pure number.
        min, max: smallest and largest legal value, inclusive.
        glsl: the uniform's type, if the annotation does not give it (`vec3` for a number or a colour).
        unless: an optional input that replaces it when connected; setting it then is a warning.
    """
    return Parameter("param", default, doc, unit, Range(min, max), glsl, unless=unless)


def define(
    *,
    default: Any,
    doc: str,
    unit: str = "",
    min: float | None = None,
    max: float | None = None,
    choices: str = "",
    needs: tuple[str, ...] = (),
) -> Any:
    """Declare a parameter that becomes program text: `#define NAME value`, and `#define NAME_CHOICE` for a choice.

    Numbers and switches become `#define SAMPLES 16`; a choice `smith: fast` becomes `#define SMITH SMITH_FAST`, where
    every choice has a number, so that shaders can test `#if SMITH == SMITH_FAST`.

    Args:
        default, doc, unit, min, max: see `param`.
        choices: the name under which plugins add choices, for a type such as `Literal["neutral", "aces"] | str`. Each
            choice is then an include, the node's own `curve/aces.glsl` among its shaders or the shared includes; the
            shader includes it by `#include <CURVE>`, and there are no numbers.
        needs: what such an include may request (`#pragma needs(…)`) and other choices do not need: `NEEDS_…` in the
            shader, `steps.needs(…)` in `record`.
    """
    return Parameter("define", default, doc, unit, Range(min, max), open_name=choices, needs=needs)


def structural(*, default: Any, doc: str, unit: str = "", min: float | None = None, max: float | None = None) -> Any:
    """Declare a parameter that is part of the plan, such as a resolution or a light's name."""
    return Parameter("structural", default, doc, unit, Range(min, max))
