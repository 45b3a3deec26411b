"""Shader files: their text, their lines with what rendergraph looks at in them, and where links lead."""

from __future__ import annotations

import itertools
import os
import re
from functools import lru_cache
from pathlib import Path
from typing import TypeAlias

from msgspec import Struct

from rendergraph.errors import InputError, Place, Problem, shown_file, suggestion
from rendergraph.stamps import Stamp, look, stamp

MAX_BYTES = 1_000_000
"""Bytes of one stage's text after includes."""

_INCLUDE = re.compile(r"\s*#\s*include\b(.*)\Z", re.DOTALL)
_OPENS = re.compile(r"\s*#\s*if(?:n?def)?\b")
_CLOSES = re.compile(r"\s*#\s*endif\b")
_FORBIDDEN = re.compile(r"\s*#\s*(version|line)\b")
_NEEDS = re.compile(r"\s*#\s*pragma\s+needs\b\s*(.*)\Z")
_VERSION = re.compile(r"\s*#\s*version\s+(?:3[3-9]0|4[0-6]0)(?:\s+(?:core|compatibility))?\s*\Z")
_COMMENT = re.compile(r"//(?:\\\n|[^\n])*|/\*.*?(?:\*/|(?P<open>\Z))", re.DOTALL)


def strip_comments(text: str) -> str:
    """The text with comments replaced by as many blanks: lines and columns stay where they are.

    One that has no end is left as it is, for the driver to say so.
    """

    def blanks(match: re.Match[str]) -> str:
        return match.group() if match["open"] is not None else re.sub(r"[^\n]", " ", match.group())

    return _COMMENT.sub(blanks, text)


class Directive(Struct, frozen=True):
    """A line with a `#`, the parts of it that matter here.

    Attributes:
        number, text: the line.
        forbidden: `version` or `line`, which are written by rendergraph.
        is_version: it is a `#version` that a file may begin with.
        needs: what stands in a `#pragma needs`, said to rendergraph and not to the driver; None elsewhere.
        included: what it includes, as it is written; None where it includes nothing.
        nests: 1 where it opens an `#if`, -1 where it closes one.
    """

    number: int
    text: str
    forbidden: str | None
    is_version: bool
    needs: str | None
    included: str | None
    nests: int

    @classmethod
    def of(cls, number: int, text: str) -> Directive:
        """What a line says."""
        forbidden, needs, include = _FORBIDDEN.match(text), _NEEDS.match(text), _INCLUDE.match(text)
        return cls(
            number,
            text,
            forbidden[1] if forbidden else None,
            _VERSION.match(text) is not None,
            needs[1] if needs else None,
            include[1].strip() if include else None,
            bool(_OPENS.match(text)) - bool(_CLOSES.match(text)),
        )


Runs: TypeAlias = "tuple[tuple[int, tuple[str, ...], Directive | None], ...]"
"""Lines in runs without a `#`: the number of the first, the lines, and the line that ends them, None at the end."""


class Links:
    """Paths with their links followed, each folder's once for as long as this is kept: asked for at every include."""

    def __init__(self) -> None:
        self._followed: dict[str, str] = {}

    def follow(self, path: str) -> str:
        """As `os.path.realpath` says it."""
        found = self._followed.get(path)
        if found is None:
            folder, name = os.path.split(path)
            if folder in ("", path) or name in ("", ".", ".."):
                found = os.path.realpath(path)
            else:
                found = os.path.join(self.follow(folder), name)
                found = os.path.realpath(found) if os.path.islink(found) else found
            self._followed[path] = found
        return found


def read_text(file: Path) -> str:
    """A shader's text, with `\n` at the end of lines.

    Raises:
        InputError: there is none, it is too large, or no UTF-8.
    """
    look(file)
    if not file.is_file():
        beside = file.parent.glob("*") if file.parent.is_dir() else ()
        known = {path.name for path in beside if path.suffix == file.suffix and path.is_file()}
        text = f"there is no shader '{shown_file(file)}'{suggestion(file.name, known)}"
        raise InputError(Problem("RG400", text))
    if file.stat().st_size > MAX_BYTES:
        raise InputError(Problem("RG403", f"the shader is larger than {MAX_BYTES:,} bytes", Place(shown_file(file))))
    try:
        return file.read_bytes().decode("utf-8-sig").replace("\r\n", "\n").replace("\r", "\n")
    except UnicodeDecodeError as error:
        raise InputError(Problem("RG407", f"the shader is not UTF-8 text: {error}", Place(shown_file(file)))) from error


def about(file: Path) -> str:
    """A shader's opening comment as one line; empty where it has none.

    Raises:
        InputError: the file cannot be read.
    """
    opening = itertools.takewhile(lambda line: line.startswith("//"), read_text(file).split("\n"))
    return " ".join(" ".join(line.removeprefix("//") for line in opening).split())


def runs(file: Path) -> tuple[str, Runs]:
    """A file's text, and its lines without comments and blanks at their ends.

    Raises:
        InputError: the file cannot be read.
    """
    look(file)
    return _runs(file, stamp(file))


@lru_cache(maxsize=256)
def _runs(file: Path, stamp: Stamp) -> tuple[str, Runs]:
    raw = read_text(file)
    lines = tuple(line.rstrip() for line in strip_comments(raw).split("\n"))
    ends = [number for number, line in enumerate(lines) if "#" in line]
    begins = [0, *(number + 1 for number in ends)]
    directives = [Directive.of(number + 1, lines[number]) for number in ends]
    found = zip(begins, [*ends, len(lines)], [*directives, None], strict=True)
    return raw, tuple((begin + 1, lines[begin:end], directive) for begin, end, directive in found)
