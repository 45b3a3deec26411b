"""What a key of a scene file takes: the one source for checking, for `explain scene` and for the docs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal, TypeAlias

Kind: TypeAlias = Literal[
    "number", "integer", "flag", "text", "choice", "vector", "scale", "color", "file", "link", "map"
]


MOST = 1e12
"""Beyond this no number of a scene makes sense, and products of a few would leave single precision."""


@dataclass(frozen=True)
class Key:
    """One key.

    Attributes:
        name: as written in the file.
        kind: `number`, `integer`, `flag`, `text`, a `choice` of words, a `vector` of `size` numbers, a `scale` (one
            number or three), a `color` (three numbers, or four where `size` is 4), the name of a `file`, a `link` to
            something named elsewhere in the file, or a nested `map`.
        doc: one line.
        default: the value where the file has none; None where that means absent.
        unit: the unit's symbol, empty for a pure number.
        low, high: limits of every component, inclusive; `above` makes the lower one exclusive.
        choices: the words of a choice, or the section a link looks into.
        size: numbers of a vector or colour.
        required: it must be there.
        infinite: `.inf` is a value too.
    """

    name: str
    kind: Kind
    doc: str
    default: Any = None
    unit: str = ""
    low: float = -MOST
    high: float = MOST
    above: bool = False
    choices: tuple[str, ...] = ()
    size: int = 3
    required: bool = False
    infinite: bool = False


def positive(name: str, doc: str, default: float, unit: str = "m") -> Key:
    """A number above zero."""
    return Key(name, "number", doc, default, unit, low=0, above=True)


def whole(name: str, doc: str, default: int, low: int, high: int) -> Key:
    """A whole number within limits."""
    return Key(name, "integer", doc, default, low=low, high=high)
