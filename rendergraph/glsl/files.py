"""Shader files: their text, their lines with the directives that rendergraph handles, and symbolic links."""

from __future__ import annotations

import itertools
import os
import re
from collections.abc import Sequence
from functools import cache, lru_cache
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
    """Replace comments by as many blanks, so that lines and columns stay.

    An unterminated comment stays, for the driver to report.
    """

    def blanks(match: re.Match[str]) -> str:
        return match.group() if match["open"] is not None else blank(match.group())

    return _COMMENT.sub(blanks, text)


class Directive(Struct, frozen=True, gc=False):
    """A line that rendergraph handles itself; its `word` is `include`, `version`, `line` or `needs`, of a pragma."""

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
        """Return the directive of a line, None if it is left to the driver."""
        if word in ("include", "version", "line"):
            return cls(number, text, word, rest.strip())
        needs = _NEEDS.match(rest) if word == "pragma" else None
        return cls(number, text, "needs", needs[1]) if needs else None


class LineRun(Struct, frozen=True, gc=False):
    """Consecutive lines for the driver, with `nests` more `#if` than `#endif`, and the directive after them."""

    first: int
    lines: tuple[str, ...]
    bytes: int
    nests: int
    end: Directive | None


class Links:
    """Resolves symbolic links; caches folders, because every include needs them."""

    def __init__(self) -> None:
        self.follow, self.of, self.file = cache(self._follow), cache(self._of), cache(self._file)

    def _follow(self, path: str) -> str:
        """Return `os.path.realpath`."""
        folder, name = os.path.split(path)
        if folder in ("", path) or name in ("", ".", ".."):
            return os.path.realpath(path)
        found = os.path.join(self.follow(folder), name)
        return os.path.realpath(found) if os.path.islink(found) else found

    def _of(self, path: Path) -> str:
        """Return the same for a path that may be relative to the current folder."""
        return self.follow(str(path if path.is_absolute() else Path.cwd() / path))

    def _file(self, folder: Path, name: str, home: Path) -> Path | None:
        """Return the path of a name in a folder, whether it exists or not; None if it lies outside of `home`."""
        target, inside = folder / name, os.path.join(self.of(home), "")
        return target if os.path.join(self.of(target), "").startswith(inside) else None


def read_text(file: Path) -> str:
    """Return a shader's text with `\n` as line ends."""
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
    """Return a shader's opening comment as one line; empty without one."""
    opening = itertools.takewhile(lambda line: line.startswith("//"), read_text(file).split("\n"))
    return " ".join(" ".join(line.removeprefix("//") for line in opening).split())


def runs(file: Path) -> tuple[str, tuple[LineRun, ...]]:
    """Return a file's text, and its lines without comments and trailing blanks."""
    record_read(file)
    return _runs(file, stamp(file))


@lru_cache(maxsize=256)
def _runs(file: Path, stamp: Stamp) -> tuple[str, tuple[LineRun, ...]]:
    raw = read_text(file)
    lines = tuple(line.rstrip() for line in strip_comments(raw).split("\n"))
    found: list[LineRun] = []
    begin = nests = 0
    for number, line in enumerate(lines):
        directive = _DIRECTIVE.match(line) if "#" in line else None
        if directive is not None:
            nests += _NESTS.get(directive[1], 0)
            end = Directive.of(number + 1, line, directive[1], directive[2])
            if end is not None:
                found.append(LineRun(begin + 1, lines[begin:number], _size(lines[begin:number]), nests, end))
                begin, nests = number + 1, 0
    found.append(LineRun(begin + 1, lines[begin:], _size(lines[begin:]), nests, None))
    return raw, tuple(found)


def _size(lines: Sequence[str]) -> int:
    return sum(map(len, lines)) + len(lines)
