"""The statements of an OBJ file as arrays, parsed in blocks of lines.

In a block the words are found, lines sorted by statement, and each kind is parsed at once: vertices and faces become
numbers by one vectorised call. Lines that it cannot take are halved until the one with the mistake is found.
"""

from __future__ import annotations

import re
import warnings
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import numpy.typing as npt
from msgspec import Struct, field

from rendergraph.document import shown
from rendergraph.scene.model import FARTHEST
from rendergraph.scene.reading import Reading

Doubles = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]
Bytes = npt.NDArray[np.uint8]

ABSENT = 9_999_999_999
"""Stands for a texture coordinate or normal that a corner does not have."""
_BLOCK_BYTES = 8 << 20  # large enough that a call for each costs nothing, small enough for the memory of its word table
_STATES = (b"o", b"g", b"s", b"usemtl")
_SILENT = (b"vp", b"mg", b"lod", b"bevel", b"c_interp", b"d_interp", b"usemap", b"maplib", b"shadow_obj", b"trace_obj")
_CORNER = re.compile(rb"[-+]?[0-9]+(/([-+]?[0-9]+)?(/([-+]?[0-9]+)?)?)?\Z")
_COMMENT = re.compile(rb"#(?<!\S#)[^\n]*")
_BLANKS = np.zeros(256, bool)
_BLANKS[[9, 11, 12, 13, 32]] = True
_COLUMNS: dict[str, npt.NDArray[Any]] = {
    "positions": np.zeros((0, 3)),
    "colors": np.zeros((0, 3)),
    "uvs": np.zeros((0, 2)),
    "normals": np.zeros((0, 3)),
    "corners": np.zeros((0, 3), np.int64),
    "sizes": np.zeros(0, np.int64),
    "lines": np.zeros(0, np.int64),
    "states": np.zeros((0, 4), np.int64),
}


class Statements(Struct, eq=False):
    """The content of an OBJ file.

    Attributes:
        positions: (v, 3); `colors` (v, 3), NaN if a vertex has none.
        uvs: (t, 2) as written, v upwards.
        normals: (n, 3).
        corners: (c, 3) position, texture coordinate and normal of each corner, from 0, `ABSENT` if there is none.
        sizes: corners of each face; `lines` its line.
        states: for each face, columns object, group, smoothing group and material as numbers into `names`.
        names: the words behind the numbers; smoothing groups are kept as they are, 0 for off.
        libraries: `mtllib` arguments with their lines.
    """

    positions: Doubles
    colors: Doubles
    uvs: Doubles
    normals: Doubles
    corners: Ints
    sizes: Ints
    lines: Ints
    states: Ints
    names: list[list[str]]
    libraries: list[tuple[str, int]]
    has_smoothing: bool


class _Parsed(Struct):
    """The statements so far, an array for each block; state words are numbered as they come."""

    columns: dict[str, list[npt.NDArray[Any]]] = field(default_factory=lambda: {k: [v] for k, v in _COLUMNS.items()})
    counts: list[int] = field(default_factory=lambda: [0, 0, 0])
    numbers: tuple[dict[str, int], ...] = field(default_factory=lambda: ({"": 0}, {"": 0}, {"": 0}, {"": 0}))
    current: list[int] = field(default_factory=lambda: [0, 0, 0, 0])
    libraries: dict[str, int] = field(default_factory=dict)
    has_smoothing: bool = False


def parse(data: bytes, reading: Reading, block_bytes: int = _BLOCK_BYTES) -> Statements:
    if data.startswith(b"\xef\xbb\xbf"):
        data = data[3:]
    if b"\0" in data[:4096]:
        raise reading.error("RG303", "is not an OBJ text: it contains zero bytes")
    if b"\n" not in data:
        data = data.replace(b"\r", b"\n")
    parsed = _Parsed()
    for block, first_line in _blocks(data, block_bytes):
        _Block(block, first_line, parsed, reading).read()
    arrays: dict[str, Any] = {name: np.concatenate(parts) for name, parts in parsed.columns.items()}
    names, libraries = [list(table) for table in parsed.numbers], list(parsed.libraries.items())
    return Statements(**arrays, names=names, libraries=libraries, has_smoothing=parsed.has_smoothing)


def _blocks(data: bytes, block_bytes: int) -> Iterator[tuple[bytes, int]]:
    """Blocks that end at a line's end, with their first line's number."""
    at, line = 0, 1
    while at < len(data):
        end = data.find(b"\n", min(len(data), at + block_bytes))
        while end > 0 and (data[end - 1 : end] == b"\\" or data[end - 2 : end] == b"\\\r"):
            end = data.find(b"\n", end + 1)
        end = len(data) if end < 0 else end + 1
        block = data[at:end]
        yield block, line
        line += block.count(b"\n")
        at = end


def text_of(raw: bytes) -> str:
    """Decode a name as UTF-8, or as Latin-1 if it is not UTF-8."""
    try:
        return raw.decode("utf-8")
    except UnicodeDecodeError:
        return raw.decode("latin-1")


class _Block:
    """One block of lines with the positions of its words."""

    def __init__(self, block: bytes, first_line: int, parsed: _Parsed, reading: Reading) -> None:
        self.parsed, self.reading, self.first_line = parsed, reading, first_line
        self.original = block
        self._newlines: Ints | None = None
        if b"\\" in block:  # a continued line becomes one; byte offsets, and so line numbers, stay
            block = block.replace(b"\\\r\n", b"   ").replace(b"\\\n", b"  ")
        if not block.endswith(b"\n"):
            block += b"\n"
        if b"#" in block:
            block = _COMMENT.sub(lambda comment: b" " * len(comment[0]), block)
        self.block = block
        self.bytes: Bytes = np.frombuffer(block, np.uint8)
        ends = np.flatnonzero(self.bytes == 10)
        self.starts = np.concatenate([[0], ends[:-1] + 1])
        self.lengths = ends + 1 - self.starts
        ink = ~_BLANKS[self.bytes]
        ink[ends] = False
        before = np.empty_like(ink)
        before[0] = False
        before[1:] = ink[:-1]
        self.words = np.flatnonzero(ink & ~before)
        self.word_ends = np.flatnonzero(~ink & before)
        self.line_of_word = np.searchsorted(ends, self.words)
        self.word_counts = np.bincount(self.line_of_word, minlength=len(ends))
        self.first_word = np.cumsum(self.word_counts) - self.word_counts

    def line(self, row: int) -> int:
        """The number in the file of one of the block's (joined) lines."""
        return self.first_line + int(self.lines_before(self.starts[row : row + 1])[0])

    def lines_before(self, offsets: Ints) -> Ints:
        """Line ends of the file in front of each byte offset."""
        if self._newlines is None:
            self._newlines = np.flatnonzero(np.frombuffer(self.original, np.uint8) == 10)
        return np.searchsorted(self._newlines, offsets)

    def read(self) -> None:
        kinds = self._kinds()
        rows = [np.flatnonzero(kinds == kind) for kind in range(4)]
        limit = self.reading.limits.vertices
        for kind, what in enumerate(("positions", "texture coordinates", "normals")):
            if self.parsed.counts[kind] + len(rows[kind]) > limit:
                raise self.reading.over(f"more than {limit:,} {what}", "vertices")
        self._faces(rows, kinds)
        self._vertices(rows[0])
        for kind, name, least, width in ((1, "uvs", 1, 2), (2, "normals", 3, 3)):
            if len(rows[kind]):
                values, counts, at = self._numbers(rows[kind], least, 3)
                table = np.zeros((len(rows[kind]), width))
                for column in range(width):
                    has = counts > column
                    table[has, column] = values[at[has] + column]
                self._add(name, table)
        for kind in range(3):
            self.parsed.counts[kind] += len(rows[kind])

    def _add(self, name: str, values: npt.NDArray[Any]) -> None:
        self.parsed.columns[name].append(values)

    def _kinds(self) -> npt.NDArray[np.int8]:
        """For each line 0 to 3 for v, vt, vn and f, 4 for a change of state, -1 if there is nothing to read."""
        kinds = np.full(len(self.starts), -1, np.int8)
        used = np.flatnonzero(self.word_counts)
        first = self.first_word[used]
        start, length = self.words[first], self.word_ends[first] - self.words[first]
        one, two = self.bytes[start], self.bytes[np.minimum(start + 1, len(self.bytes) - 1)]
        short, pair = length == 1, length == 2
        kind_of = np.full(len(used), 9, np.int8)
        kind_of[short & (one == ord("v"))] = 0
        kind_of[pair & (one == ord("v")) & (two == ord("t"))] = 1
        kind_of[pair & (one == ord("v")) & (two == ord("n"))] = 2
        kind_of[short & (one == ord("f"))] = 3
        for place in np.flatnonzero(kind_of == 9):
            kind_of[place] = self._other(int(used[place]))
        kinds[used] = kind_of
        return kinds

    def _other(self, row: int) -> int:
        """The kind of a line that is neither vertex nor face: 4 if it changes the state, else -1."""
        word = self._statement(row)
        if word in _STATES:
            return 4
        if word == b"mtllib":
            self.parsed.libraries.setdefault(text_of(self._rest(row)), self.line(row))
        elif word in (b"l", b"p"):
            what = "lines" if word == b"l" else "points"
            self.reading.warn("RG333", what, f"{what} are left out; only faces are drawn", line=self.line(row))
        elif word not in _SILENT:
            name = shown(text_of(word), 30)
            self.reading.warn("RG331", name, f"unknown statement '{name}' is left out", line=self.line(row))
        return -1

    def _statement(self, row: int) -> bytes:
        first = self.first_word[row]
        return self.block[self.words[first] : self.word_ends[first]]

    def _rest(self, row: int) -> bytes:
        end = self.starts[row] + self.lengths[row]
        return self.block[self.word_ends[self.first_word[row]] : end].strip()

    def _text(self, rows: Ints, slashes: bool = False) -> bytes:
        """The arguments of some lines as one text, the first words blanked."""
        keep = np.zeros(len(self.starts), bool)
        keep[rows] = True
        chosen: Bytes = self.bytes.copy()
        first = self.first_word[rows]
        chosen[self.words[first]] = 32
        chosen[self.word_ends[first] - 1] = 32  # vt and vn have a second letter
        text: bytes = chosen[np.repeat(keep, self.lengths)].tobytes()
        if slashes:
            text = text.replace(b"//", b"/%d/" % ABSENT)
            for blank in (b" ", b"\n", b"\r", b"\t"):  # a trailing slash stands for nothing
                text = text.replace(b"/" + blank, b"/%d" % ABSENT + blank)
            text = text.replace(b"/", b" ")
        return text

    def _parse(self, text: bytes, kind: type[np.float64 | np.int64], count: int) -> npt.NDArray[Any] | None:
        """The numbers in a text, or None if it contains anything else or another number of them."""
        with warnings.catch_warnings():
            warnings.simplefilter("error", DeprecationWarning)
            try:
                values: npt.NDArray[Any] = np.fromstring(text, kind, sep=" ")
            except (DeprecationWarning, ValueError):
                return None
        return values if len(values) == count else None

    def _numbers(self, rows: Ints, least: int, most: int) -> tuple[Doubles, Ints, Ints]:
        """Arguments of lines as finite numbers, how many each line has, and where each line's first is."""
        counts = self.word_counts[rows] - 1
        for row in rows[(counts < least) | (counts > most)][:1]:
            count = self.word_counts[row] - 1
            raise self._wrong(
                int(row), f"'{text_of(self._statement(row))}': expected {least} to {most} numbers, got {count}"
            )
        values = self._parse(self._text(rows), np.float64, int(counts.sum()))
        if values is None:

            def good(some: Ints) -> bool:
                count = int((self.word_counts[some] - 1).sum())
                return self._parse(self._text(some), np.float64, count) is not None

            row = self._first_bad(rows, good)
            for word in self._rest(row).split():
                if self._parse(word, np.float64, 1) is None:
                    raise self._wrong(row, f"'{shown(text_of(word), 30)}' is not a number")
            raise self._wrong(row, "its numbers cannot be separated")
        at = np.cumsum(counts) - counts
        bad = ~(np.abs(values) <= FARTHEST)
        if bad.any():
            row = int(rows[np.searchsorted(at, int(np.flatnonzero(bad)[0]), side="right") - 1])
            text = f"'{shown(text_of(self._rest(row)), 60)}' is not finite, or beyond {FARTHEST:g}"
            raise self.reading.error("RG306", text, line=self.line(row))
        return values.astype(np.float64), counts, at

    def _first_bad(self, rows: Ints, good: Callable[[Ints], bool]) -> int:
        """The first line that spoils a parse, by halving."""
        while len(rows) > 1:
            half = rows[: len(rows) // 2]
            rows = rows[len(rows) // 2 :] if good(half) else half
        return int(rows[0])

    def _wrong(self, row: int, text: str) -> Exception:
        return self.reading.error("RG304", text, line=self.line(row))

    def _vertices(self, rows: Ints) -> None:
        if not len(rows):
            return
        values, counts, at = self._numbers(rows, 3, 7)
        for row in rows[counts == 5][:1]:
            raise self._wrong(int(row), "'v': expected 3, 4, 6 or 7 numbers, got 5")
        self._add("positions", values[at[:, None] + np.arange(3)])
        colors = np.full((len(rows), 3), np.nan)
        colored = counts >= 6
        if colored.any():
            colors[colored] = values[(at + counts - 3)[colored, None] + np.arange(3)]
        self._add("colors", colors)

    def _faces(self, rows: list[Ints], kinds: npt.NDArray[np.int8]) -> None:
        faces = rows[3]
        states = self._states(faces, np.flatnonzero(kinds == 4))
        if not len(faces):
            return
        sizes = self.word_counts[faces] - 1
        for row in faces[sizes < 3][:1]:
            raise self._wrong(int(row), f"'f': expected at least 3 corners, got {self.word_counts[row] - 1}")
        corners = self._corners(faces, sizes)
        seen = np.stack([np.cumsum(kinds == kind)[faces] + self.parsed.counts[kind] for kind in range(3)], axis=1)
        seen = np.repeat(seen, sizes, axis=0)
        zero = corners == 0
        if zero.any():
            face = int(np.searchsorted(np.cumsum(sizes), int(np.flatnonzero(zero.any(axis=1))[0]), side="right"))
            line = self.line(int(faces[face]))
            raise self.reading.error("RG305", "index 0 is out of range; indices start at 1", line=line)
        corners = np.where(corners < 0, corners + seen, np.where(corners == ABSENT, ABSENT, corners - 1))
        self._add("corners", corners)
        self._add("sizes", sizes.astype(np.int64))
        self._add("lines", self.lines_before(self.starts[faces]) + self.first_line)
        self._add("states", states)

    def _corners(self, faces: Ints, sizes: Ints) -> Ints:
        """Indices of every corner as written, `ABSENT` for missing ones."""
        marks = np.flatnonzero(self.bytes == ord("/"))
        within = np.arange(int(sizes.sum())) - np.repeat(np.cumsum(sizes) - sizes, sizes)
        words = np.repeat(self.first_word[faces] + 1, sizes) + within
        slashes = np.searchsorted(marks, self.word_ends[words]) - np.searchsorted(marks, self.words[words])
        if int(slashes.max()) <= 2:
            values = self._parse(self._text(faces, slashes=True), np.int64, int((slashes + 1).sum()))
            if values is not None:
                table = np.full((len(slashes), 3), ABSENT, np.int64)
                at = np.cumsum(slashes + 1) - (slashes + 1)
                for column in range(3):
                    has = slashes >= column
                    table[has, column] = values[at[has] + column]
                table[table[:, 0] == ABSENT, 0] = 0
                return table

        def good(some: Ints) -> bool:
            text, written = self._text(some, slashes=True), self._text(some)
            count = len(written.split()) + written.count(b"/")  # with those left out between and behind slashes
            has_only_digits = text.translate(None, b"+-0123456789 \t\v\f\r\n") == b""
            return has_only_digits and self._parse(text, np.int64, count) is not None

        row = self._first_bad(faces, good)
        for word in self._rest(row).split():
            if not _CORNER.match(word):
                raise self._wrong(row, f"'{shown(text_of(word), 40)}' is not a corner; write v, v/vt, v//vn or v/vt/vn")
        raise self._wrong(row, "its corners cannot be separated")

    def _states(self, faces: Ints, changes: Ints) -> Ints:
        """Numbers of object, group, smoothing group and material in force at each face."""
        parsed = self.parsed
        table = [list(parsed.current)]
        for row in changes:
            column = _STATES.index(self._statement(row))
            name = text_of(self._rest(int(row)))
            if column == 2:
                parsed.has_smoothing = True
                name = "" if name.lower() in ("off", "0") else name
            numbers = parsed.numbers[column]
            parsed.current[column] = numbers.setdefault(name, len(numbers))
            if column == 0:  # a new object starts without a group
                parsed.current[1] = 0
            table.append(list(parsed.current))
        return np.array(table, np.int64)[np.searchsorted(changes, faces)]
