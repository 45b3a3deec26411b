"""Shader files: their text, their lines with what rendergraph looks at in them, and where links lead."""

from __future__ import annotations

import itertools
import os
import re
from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path

from msgspec import Struct

from rendergraph.errors import InputError, Place, Problem, shown_file, suggestion
from rendergraph.glsl.names import blank
from rendergraph.stamps import Stamp, record_read, stamp

MAX_BYTES = 1_000_000
"""Bytes of one stage's text after includes."""

_DIRECTIVE = re.compile(r"\s*#\s*(\w+)(.*)\Z", re.DOTALL)
_NESTS = {"if": 1, "ifdef": 1, "ifndef": 1, "endif": -1}
_NEEDS = re.compile(r"\s+needs\b\s*(.*)\Z")
_VERSION = re.compile(r"\s*#\s*version\s+(?:3[3-9]0|4[0-6]0)(?:\s+(?:core|compatibility))?\s*\Z")
_COMMENT = re.compile(r"//(?:\\\n|[^\n])*|/\*.*?(?:\*/|(?P<open>\Z))", re.DOTALL)


def strip_comments(text: str) -> str:
    """The text with comments replaced by as many blanks: lines and columns stay where they are.

    One that has no end is left as it is, for the driver to say so.
    """

    def blanks(match: re.Match[str]) -> str:
        return match.group() if match["open"] is not None else blank(match.group())

    return _COMMENT.sub(blanks, text)


class Directive(Struct, frozen=True, gc=False):
    """A line that is more than text for the driver.

    Attributes:
        number, text: the line.
        word: `include`, `version`, `line`, or `needs` for a `#pragma needs`, which says nothing to the driver.
        rest: what stands behind that.
    """

    number: int
    text: str
    word: str
    rest: str

    @property
    def is_version(self) -> bool:
        """Whether it is a `#version` that a file may begin with."""
        return _VERSION.match(self.text) is not None

    @classmethod
    def of(cls, number: int, text: str, word: str, rest: str) -> Directive | None:
        """What a line with a `#`, a word and more says, None where that is the driver's affair."""
        if word in ("include", "version", "line"):
            return cls(number, text, word, rest.strip())
        needs = _NEEDS.match(rest) if word == "pragma" else None
        return cls(number, text, "needs", needs[1]) if needs else None


class Run(Struct, frozen=True, gc=False):
    """Lines for the driver, and the one behind them that is not.

    Attributes:
        first: the number of the first.
        lines: they, and how many `bytes` they are.
        nests: how many more `#if` they open than they close.
        end: None at the end of the file.
    """

    first: int
    lines: tuple[str, ...]
    bytes: int
    nests: int
    end: Directive | None


class Links:
    """Paths with their links followed, each folder's once for as long as this is kept: asked for at every include."""

    def __init__(self) -> None:
        self._followed: dict[str, str] = {}
        self._led: dict[Path, str] = {}
        self._files: dict[tuple[Path, str, Path], Path | None] = {}

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

    def of(self, path: Path) -> str:
        """The same of a path that may begin in the current folder."""
        found = self._led.get(path)
        if found is None:
            found = self._led[path] = self.follow(str(path if path.is_absolute() else Path.cwd() / path))
        return found

    def file(self, folder: Path, name: str, home: Path) -> Path | None:
        """What a name in a folder stands for, whether it is there or not; None where that lies outside of `home`."""
        key = folder, name, home
        if key not in self._files:
            target = folder / name
            inside = os.path.join(self.of(home), "")
            self._files[key] = target if os.path.join(self.of(target), "").startswith(inside) else None
        return self._files[key]


def read_text(file: Path) -> str:
    """A shader's text, with `\n` at the end of lines.

    Raises:
        InputError: there is none, it is too large, or no UTF-8.
    """
    record_read(file)
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


def runs(file: Path) -> tuple[str, tuple[Run, ...]]:
    """A file's text, and its lines without comments and blanks at their ends.

    Raises:
        InputError: the file cannot be read.
    """
    record_read(file)
    return _runs(file, stamp(file))


@lru_cache(maxsize=256)
def _runs(file: Path, stamp: Stamp) -> tuple[str, tuple[Run, ...]]:
    raw = read_text(file)
    lines = tuple(line.rstrip() for line in strip_comments(raw).split("\n"))
    found: list[Run] = []
    begin = nests = 0
    for number, line in enumerate(lines):
        directive = _DIRECTIVE.match(line) if "#" in line else None
        if directive is not None:
            nests += _NESTS.get(directive[1], 0)
            end = Directive.of(number + 1, line, directive[1], directive[2])
            if end is not None:
                found.append(Run(begin + 1, lines[begin:number], _size(lines[begin:number]), nests, end))
                begin, nests = number + 1, 0
    found.append(Run(begin + 1, lines[begin:], _size(lines[begin:]), nests, None))
    return raw, tuple(found)


def _size(lines: Sequence[str]) -> int:
    """How large lines are, their ends included."""
    return sum(map(len, lines)) + len(lines)
