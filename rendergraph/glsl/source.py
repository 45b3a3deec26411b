"""Shader files as text with includes resolved, every line with its origin."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Iterator, Mapping
from functools import cache, cached_property
from itertools import accumulate, chain, product, repeat
from pathlib import Path

from msgspec import Struct, json
from msgspec.structs import replace

from rendergraph.errors import InputError, Place, Problem, shown_file, suggestion
from rendergraph.glsl.files import MAX_BYTES, LineRun, Links, read_text, runs, strip_comments
from rendergraph.glsl.names import declared, mentions
from rendergraph.stamps import record_read

MAX_DEPTH = 32
"""Maximum depth of nested includes."""


class Origin(Struct, frozen=True):
    """Where a line of program text comes from.

    Attributes:
        file: the author's file, None for generated lines.
        column: number of columns by which the line has moved to the right.
        shared: it comes from an include in angle brackets.
        prefix: the prefix of the names that the file declares.
        by: the line that includes the file, None for the file of a stage itself.
        purpose: that of a generated line, as in "the views of 'depth'".
    """

    file: Path | None = None
    line: int = 0
    column: int = 0
    shared: bool = False
    prefix: str = ""
    by: Origin | None = None
    purpose: str = ""

    def place(self, column: int = 1) -> Place | None:
        """Return the place for messages, relative to the current folder where possible."""
        if self.file is None:
            return None
        return Place(shown_file(self.file), self.line, max(1, column - self.column))


class SourceBlock(Struct, frozen=True, gc=False):
    """Consecutive lines of a file, with comments blanked out, or generated lines; `origin` is that of the first."""

    lines: tuple[str, ...]
    origin: Origin

    @property
    def origins(self) -> Iterator[Origin]:
        first = self.origin
        if first.file is None:
            return repeat(first, len(self.lines))
        return (replace(first, line=first.line + number) for number in range(len(self.lines)))


class SourceText(Struct, frozen=True, dict=True):
    """GLSL in which every line has an origin, computed only for error messages."""

    blocks: tuple[SourceBlock, ...] = ()

    @classmethod
    def of(cls, rows: Iterable[tuple[str, Origin]]) -> SourceText:
        return cls(tuple(SourceBlock((line,), origin) for line, origin in rows))

    @cached_property
    def lines(self) -> tuple[str, ...]:
        return tuple(chain.from_iterable(block.lines for block in self.blocks))

    @property
    def files(self) -> set[Path]:
        by_id = {id(block.origin.file): block.origin.file for block in self.blocks}  # comparing paths is slow
        return {file for file in by_id.values() if file is not None}

    @cached_property
    def origins(self) -> tuple[Origin, ...]:
        return tuple(chain.from_iterable(block.origins for block in self.blocks))

    @cached_property
    def text(self) -> str:
        return "".join(["\n".join([*block.lines, ""]) for block in self.blocks])

    def place(self, at: int) -> tuple[Place | None, str]:
        """Return the place in the author's file of a character of the text, and its line."""
        number = self.text.count("\n", 0, at)
        origin, line = self.origins[number], self.lines[number]
        if origin.column:  # a layout was inserted into the author's line
            start = max(0, line.find("layout("))
            line = line[:start] + line[start + origin.column :]
        return origin.place(at - self.text.rfind("\n", 0, at)), line

    def __add__(self, other: SourceText) -> SourceText:
        return SourceText(self.blocks + other.blocks)


def generated(lines: Iterable[str], purpose: str = "") -> SourceText:
    """Return generated lines, which come from no file."""
    return SourceText((SourceBlock(tuple(lines), Origin(purpose=purpose)),))


_MAIN_IMAGE = re.compile(r"^\s*void\s+mainImage\s*\(", re.MULTILINE)
_MAIN = re.compile(r"^\s*void\s+main\s*\(", re.MULTILINE)
_CHANNEL = re.compile(r"\biChannel([0-3])\b|\biChannelResolution\b")


def is_shadertoy(text: str) -> bool:
    """Whether a shader is one of Shadertoy's: it has a `mainImage` and no `main`."""
    return _MAIN_IMAGE.search(text) is not None and _MAIN.search(text) is None


_PARAMETER = re.compile(r"<([A-Z][A-Z0-9_]*)>\Z")
_INCLUDE_NAME = re.compile(r'"([^"<>]+)"\Z|<([^"<>]+)>\Z')


class Includes:
    """Resolves the includes of one stage; each file is compiled once per stage, where it is first included.

    Only the driver's preprocessor knows whether an include inside `#if` is compiled: such text gets include guards and
    is repeated at every further include.
    """

    def __init__(self, include_folder: Path, links: Links | None = None) -> None:
        self.include_folder = include_folder
        self._links = Links() if links is None else links
        self.bytes = 0
        self._certain: set[tuple[str, str]] = set()
        self._guards: dict[tuple[str, str], str] = {}
        self._plugged: dict[str, Path] = {}
        self._versions = False
        self._inherited: tuple[Path, ...] = ()

    def fresh(self) -> Includes:
        """Return the includes of another stage, with the same resolved links."""
        return Includes(self.include_folder, self._links)

    def copy(self) -> Includes:
        """Return a copy for a text that may be discarded."""
        other = self.fresh()
        other.bytes, other._certain, other._guards = self.bytes, set(self._certain), dict(self._guards)
        return other

    def expand(
        self,
        source: Path,
        *,
        root: Path | None = None,
        prefix: str = "",
        plugged: Mapping[str, Path] | None = None,
        versions: bool = False,
        inherited: tuple[Path, ...] = (),
    ) -> SourceText:
        """Return the text of a file with all its includes.

        Args:
            root: the folder in which includes in quotes must stay; the file's own by default.
            prefix: recorded in the origins of all lines that are not shared.
            plugged: parameters in capitals with the file of their choice: `#include <SHADING>` includes this file, or
                nothing without one.
            versions: accept a `#version` of 330 to 460 in the file itself, and leave its line empty.
            inherited: more folders for includes in quotes that are not beside the file, each a root.
        """
        root = Path(self._links.of(root or source.parent))
        self._blocks: list[SourceBlock] = []
        self._conditions = 0  # open `#if`
        self._certain.add((self._links.of(source), prefix))
        self._plugged = dict(plugged or {})
        self._versions = versions
        self._inherited = inherited
        text = runs(source)[0] if source.suffix == ".frag" else ""
        if is_from_shadertoy := is_shadertoy(text):
            self._before_shadertoy(text)
        self._file(source, root, Origin(prefix=prefix), [])
        if is_from_shadertoy:
            end = "void main() { mainImage(values, gl_FragCoord.xy); image = vec4(values.rgb, 1.0); }"
            self._blocks.append(SourceBlock((end,), Origin(purpose="the end of a Shadertoy program")))
        return SourceText(tuple(self._blocks))

    def _before_shadertoy(self, text: str) -> None:
        """Declare what a Shadertoy program reads and writes: the channels that it names, and two outputs."""
        found = {match[1] for match in _CHANNEL.finditer(text)}
        channels = sorted(found - {None}) if found else []
        lines = [f"uniform sampler2D iChannel{number};" for number in channels]
        if re.search(r"\biMouse\b", text):
            lines.append("uniform vec4 iMouse = vec4(0.0);")
        if None in found:
            sizes = (f"vec3(textureSize(iChannel{n}, 0), 1.0)" if str(n) in channels else "vec3(1.0)" for n in range(4))
            lines.append(f"#define iChannelResolution vec3[4]({', '.join(sizes)})")
        lines += ["out vec4 image;", "out vec4 values;"]
        self._blocks.append(SourceBlock(tuple(lines), Origin(purpose="the beginning of a Shadertoy program")))
        self._include(self.include_folder / "shadertoy.glsl", self.include_folder, Origin(shared=True), [])

    def _file(self, file: Path, root: Path, base: Origin, stack: list[str]) -> None:
        raw, found = runs(file)
        stack = [*stack, self._links.of(file)]
        for run in found:
            line = run.end
            self._add(run, replace(base, file=file, line=run.first), raw)
            self._conditions += run.nests
            if line is None:
                return
            origin = replace(base, file=file, line=line.number)
            if line.word == "needs" or (line.is_version and self._versions and len(stack) == 1):
                self._blocks.append(SourceBlock(("",), origin))
                continue
            if line.word != "include":
                text = f"'#{line.word}' is written by rendergraph; remove the line"
                raise _error("RG404", text, origin, raw)
            parameter = _PARAMETER.match(line.rest)
            if parameter is not None and parameter[1] not in self._plugged:
                self._blocks.append(SourceBlock(("",), origin))
                continue
            if parameter is not None:
                target, shared, home = self._plugged[parameter[1]], True, self._plugged[parameter[1]].parent
            else:
                target, shared, home = self._find(line.rest, file, root, origin, raw, base.shared)
            if self._links.of(target) in stack:
                ring = " includes ".join(os.path.basename(path) for path in [*stack, str(target)])
                raise _error("RG402", f"'{target.name}' includes itself: {ring}", origin, raw)
            if len(stack) > MAX_DEPTH:
                raise _error("RG403", f"includes are nested deeper than {MAX_DEPTH}", origin, raw)
            inner = replace(base, shared=shared, prefix="" if shared else base.prefix, by=origin)
            self._include(target, home, inner, stack)

    def _add(self, run: LineRun, first: Origin, raw: str) -> None:
        if self.bytes + run.bytes > MAX_BYTES:
            sizes = accumulate(len(line) + 1 for line in run.lines)
            beyond = sum(self.bytes + size <= MAX_BYTES for size in sizes)
            text = f"the shader with its includes is larger than {MAX_BYTES:,} bytes"
            raise _error("RG403", text, replace(first, line=first.line + beyond), raw)
        self.bytes += run.bytes
        if run.lines:
            self._blocks.append(SourceBlock(run.lines, first))

    def _include(self, file: Path, root: Path, base: Origin, stack: list[str]) -> None:
        key = (self._links.of(file), base.prefix)
        if key in self._certain:
            return
        certain = self._conditions <= 0
        if certain:
            self._certain.add(key)
        guard = self._guards.get(key)
        if guard is None and not certain:
            guard = self._guards[key] = f"INCLUDED_{len(self._guards)}"
        if guard is None:
            self._file(file, root, base, stack)
            return
        self._blocks.append(SourceBlock((f"#ifndef {guard}", f"#define {guard}"), Origin(shared=True)))
        self._conditions += 1
        self._file(file, root, base, stack)
        self._conditions -= 1
        self._blocks.append(SourceBlock(("#endif",), Origin(shared=True)))

    def _find(
        self, written: str, file: Path, root: Path, origin: Origin, raw: str, in_shared: bool
    ) -> tuple[Path, bool, Path]:
        """Return the file that an include names, whether it is shared, and the root of its own includes."""
        match = _INCLUDE_NAME.match(written)
        if match is None:
            text = f"'#include {written[:60]}' is not '#include <name.glsl>' or '#include \"name.glsl\"'"
            raise _error("RG405", text, origin, raw)
        name = old_names(self.include_folder).get(written, match[1] or match[2])
        beside = match[1] is not None
        shared = not beside or in_shared
        places = [(file.parent, root)] if beside else [(self.include_folder, self.include_folder)]
        if beside and not in_shared:
            places += [(home, home) for home in self._inherited]
        for folder, home in places:
            target = self._links.file(folder, name, home)
            if target is None:
                text = f"'{name}' lies outside '{shown_file(self._links.of(home))}', where this shader's includes are"
                raise _error("RG406", text, origin, raw)
            record_read(target)
            if target.is_file():
                return target, shared, home
        known = {path.relative_to(folder).as_posix() for folder, _ in places for path in folder.rglob("*.glsl")}
        where = "beside the file" if beside else "in shaders/include"
        if len(places) > 1:
            where += " or among the shaders of what its node extends"
        raise _error("RG401", f"there is no include '{name}' {where}{suggestion(name, known)}", origin, raw)


def old_name_pattern(old: str) -> str:
    """Return a pattern that finds an old name in a shader's text."""
    pattern = re.escape(old).replace(r"\(\)", r"(?=\s*\()") + r"(?!\w)"
    return pattern if old[0] == "." else r"(?<![\w.])" + pattern


@cache
def old_names(include_folder: Path) -> dict[str, str]:
    """Return old names of `<files>`, `functions()`, `.members` and other words of the shared includes, with the new."""
    file = include_folder / "old_names.json"
    return json.decode(file.read_bytes()) if file.is_file() else {}


def find_old_names(source: SourceText, include_folder: Path) -> tuple[dict[str, str], list[Problem]]:
    """Return macros for the old names that plugins' files use, and a warning (RG449) for each."""
    macros: dict[str, str] = {}
    warnings: list[Problem] = []
    shipped = f"{include_folder.parent}/"
    own = [file for file in source.files if not str(file).startswith(shipped)]
    shared = SourceText(tuple(block for block in source.blocks if own and block.origin.file not in own)).text
    texts = {file: strip_comments(read_text(file)) for file in own}
    for (file, text), (old, new) in product(texts.items(), old_names(include_folder).items()):
        name = old.strip("<>.()")
        match = re.search(old_name_pattern(old), text)
        defined = rf"(?m)^\s*\w+\s+{new}\s*\([^;{{}}]*\)\s*\{{|\b(?:define|struct)\s+{new}\b"
        is_own = match and name in declared(text) and re.search(defined, shared)  # not one that an include uses
        if match and not is_own and (old[0] == "<" or name.startswith("v_") or mentions(shared, new)):
            macros |= {name: new} if old[0] != "<" else {}
            before = text[: match.start()].split("\n")
            place = Place(shown_file(file), len(before), len(before[-1]) + 1)
            what = f"'{old}' is now called '{new}'"
            warnings.append(Problem("RG449", what, place, text.split("\n")[len(before) - 1], "warning"))
    return macros, warnings


def needs(file: Path) -> tuple[str, ...]:
    """Return the words of an include's `#pragma needs(…)`: what a choice needs."""
    raw, found = runs(file)
    words: list[str] = []
    for line in (run.end for run in found):
        if line is not None and line.word == "needs":
            listed = re.fullmatch(r"\(\s*(\w+(?:\s*,\s*\w+)*)\s*\)", line.rest)
            if listed is None:
                text = f"'{line.text.strip()[:60]}' is not '#pragma needs(word)' or '#pragma needs(word, word)'"
                raise _error("RG405", text, Origin(file, line.number), raw)
            words += re.findall(r"\w+", listed[1])
    return tuple(words)


def needs_place(file: Path) -> tuple[Place, str]:
    """Return the place and text of an include's `#pragma needs`."""
    raw, found = runs(file)
    number = next((run.end.number for run in found if run.end is not None and run.end.word == "needs"), 1)
    return Place(shown_file(file), number, 1), raw.split("\n")[number - 1]


def _error(code: str, text: str, origin: Origin, raw: str) -> InputError:
    line = raw.split("\n")[origin.line - 1]
    column = len(line) - len(line.lstrip()) + 1
    return InputError(Problem(code, text, origin.place(column), line))
