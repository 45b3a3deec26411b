"""Types of values in files, as annotations: see `rendergraph.typecheck`. Null means absent and has no type."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

from rendergraph.typecheck import MOST, Brief, Converted, JsonSchema, Length, Matching, Range, words_for

TEXT: Any = Annotated[str, Matching(re.compile(r"\s*\S"))]
FILE: Any = Annotated[TEXT, "a file's name", Brief("path")]
NUMBER: Any = Annotated[float, Range()]


def version(number: int) -> Any:
    return Annotated[Literal[number], f"{number}, the version of the format that this program reads"]


def word(pattern: re.Pattern[str], words: str, short: str = "name") -> Any:
    """Return the type of text that matches a pattern, with its description for messages and tables."""
    return Annotated[str, Matching(pattern), words, Brief(short)]


def shipped(names: Callable[[], Mapping[str, Path]]) -> Any:
    """Return the type of the name of something shipped, which editors suggest, or a file's path."""
    path = {"type": "string", "pattern": "[./]"}
    schema = JsonSchema(lambda: {"anyOf": [{"enum": list(names())}, path]})
    return Annotated[TEXT, schema, Brief("name | path")]


def choice(*words: str) -> Any:
    return Literal[words]


def number(low: float = -MOST, high: float = MOST, *, above: bool = False, infinite: bool = False) -> Any:
    return Annotated[float, Range(low, high, above, infinite)]


def whole(low: int, high: float = MOST) -> Any:
    return Annotated[int, Range(low, high)]


def vector(count: int = 3, low: float = -MOST, high: float = MOST, *, above: bool = False) -> Any:
    return tuple[(number(low, high, above=above),) * count]  # type: ignore[misc]  # made at run time


def color(high: float = MOST, *, alpha: bool = False) -> Any:
    """Return the type of red, green and blue from 0 up, or one number for grey; `alpha` allows a fourth number."""
    three, four = vector(3, 0, high), vector(4, 0, high)
    words = words_for(three, file=True).replace("list of 3", "number or a list of 3" + (" or 4" if alpha else ""), 1)

    def whole(value: Any) -> Any:
        rgb = (value,) * 3 if isinstance(value, float) else value
        return (*rgb, 1.0) if alpha and isinstance(rgb, tuple) and len(rgb) == 3 else rgb

    return Annotated[
        number(0, high) | three | (four if alpha else three), words, Brief("grey | [r, g, b]"), Converted(whole)
    ]


def scale() -> Any:
    """Return the type of a factor for each axis, or one for all."""
    uniform = Converted(lambda value: (value,) * 3 if isinstance(value, float) else value)
    return Annotated[number() | vector(), "a number or a list of 3 numbers", Brief("number | [x, y, z]"), uniform]


def row(*types: Any) -> Any:
    return tuple[types]  # type: ignore[valid-type]  # made at run time


def listed(of: Any, words: str, least: int = 0, most: float = math.inf) -> Any:
    """Return the type of a list; `words` describes its elements, in the plural."""
    return Annotated[list[of], Length(least, most), f"a list of {words}"]
