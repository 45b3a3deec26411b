"""YAML text to values that know where they stand.

Values are built from PyYAML's parse events, not by its loaders: those forget an alias's own place, run user-chosen
constructors, read YAML 1.1 scalars (`1e-3` as text, `no` as false) and die in many ways on hostile text. Here nothing
is built but text, numbers, switches, null, lists and mappings, every one under a budget.
"""

from __future__ import annotations

import math
import re
from bisect import bisect_right
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any, TypeAlias

from rendergraph.errors import InputError, Place, Problem

Scalar: TypeAlias = "str | int | float | bool | None"
Key: TypeAlias = "str | int | float"


Data: TypeAlias = "Scalar | list[Value] | dict[Any, Value] | Broken"


@dataclass(frozen=True)
class Limits:
    """Budgets of one YAML file; each is a small multiple of what a person writes.

    Attributes:
        bytes: length of the text.
        depth: lists and mappings inside each other; libyaml itself dies at about 25,000.
        nodes: values after aliases are expanded.
        aliases: uses of `*name`.
    """

    bytes: int = 2_000_000
    depth: int = 64
    nodes: int = 200_000
    aliases: int = 1_000


@dataclass(eq=False)
class Source:
    """Where values come from: a file, or an option of the command line.

    Attributes:
        name: how messages name it.
        path: the file, None where there is none.
        text: its text, to show the line of a mistake.
    """

    name: str
    path: Path | None = None
    text: str = field(default="", repr=False)

    @cached_property
    def _starts(self) -> list[int]:
        return [0, *(match.end() for match in _BREAK.finditer(self.text))]

    def line(self, number: int) -> str:
        """The text of a line, from 1; empty where there is none or where it is too long to show."""
        if not 0 < number <= len(self._starts):
            return ""
        text = self.text[self._starts[number - 1] : self._starts[number - 1] + _LONGEST_LINE + 1]
        text = _BREAK.split(text, maxsplit=1)[0]
        return text if len(text) <= _LONGEST_LINE and text.expandtabs(1).isprintable() else ""

    def at(self, offset: int) -> tuple[int, int]:
        """Line and column, from 1, of a character."""
        line = bisect_right(self._starts, offset)
        return line, offset - self._starts[line - 1] + 1

    def problem(self, code: str, text: str, line: int = 0, column: int = 0) -> Problem:
        """A mistake in this source."""
        return Problem(code, text, Place(self.name, line, column), self.line(line))


class Broken:
    """What stands for a value that is wrong and has been reported, where the reading goes on."""

    def __repr__(self) -> str:
        return "BROKEN"


BROKEN = Broken()


class Value:
    """One value of a document with its place; `data` holds further `Value`s in mappings and lists.

    Attributes:
        data: a scalar, a list of values, or a dict of values; `BROKEN` in a document with problems.
        source: the file it stands in.
        line, column: where it starts, from 1; 0 where the source has no lines.
        key_line, key_column: where its key starts, the value's own place where it has none.
    """

    __slots__ = ("column", "data", "key_column", "key_line", "line", "source")

    def __init__(
        self,
        data: Data,
        source: Source,
        line: int = 0,
        column: int = 0,
        key: tuple[int, int] | None = None,
    ) -> None:
        self.data = data
        self.source = source
        self.line = line
        self.column = column
        self.key_line, self.key_column = key or (line, column)

    def __repr__(self) -> str:
        return f"Value({self.data!r}, {self.place})"

    @property
    def place(self) -> Place:
        """Where the value starts."""
        return Place(self.source.name, self.line, self.column)

    @property
    def key_place(self) -> Place:
        """Where its key starts."""
        return Place(self.source.name, self.key_line, self.key_column)

    @property
    def kind(self) -> str:
        """What it is, in words for messages."""
        return kind_of(self.data)

    def with_data(self, data: Data) -> Value:
        """The same place with other contents."""
        return Value(data, self.source, self.line, self.column, (self.key_line, self.key_column))

    def problem(self, code: str, text: str, *, key: bool = False) -> Problem:
        """A mistake at this value, or at its key."""
        line, column = (self.key_line, self.key_column) if key else (self.line, self.column)
        return self.source.problem(code, text, line, column)

    def items(self) -> Iterator[tuple[Any, Value]]:
        """Keys and values of a mapping, nothing for anything else."""
        return iter(self.data.items() if isinstance(self.data, dict) else ())

    def get(self, *path: Key) -> Value | None:
        """The value that lies at a path of keys and positions, or None."""
        found: Value = self
        for step in path:
            data = found.data
            if isinstance(data, dict) and step in data:
                found = data[step]
            elif isinstance(data, list) and step in range(len(data)):
                found = data[int(step)]
            else:
                return None
        return found

    def plain(self) -> Any:
        """The same as Python's own dict, list and scalars; what an alias repeats is one object, not copies."""
        return _plain(self, {})


def _plain(value: Value, seen: dict[int, Any]) -> Any:
    data = value.data
    if not isinstance(data, dict | list):
        return data
    # An alias's value shares `data` with its anchor's, so that a bomb of aliases costs what its text costs.
    if id(data) not in seen:
        seen[id(data)] = (
            {key: _plain(child, seen) for key, child in data.items()}
            if isinstance(data, dict)
            else [_plain(child, seen) for child in data]
        )
    return seen[id(data)]


@dataclass(frozen=True, eq=False)
class Document:
    """The values of one YAML file.

    Attributes:
        root: the outermost value.
        source: the file.
        problems: mistakes that did not stop the reading, where the caller asked to keep going.
        dropped: paths of what was left out because it was wrong, so that nobody complains that it is missing.
    """

    root: Value
    source: Source
    problems: tuple[Problem, ...] = ()
    dropped: frozenset[tuple[str, ...]] = frozenset()

    @property
    def file(self) -> str:
        """How messages name the file."""
        return self.source.name

    @property
    def path(self) -> Path | None:
        """The file, None for text without one."""
        return self.source.path

    @cached_property
    def value(self) -> Any:
        """Everything as plain Python data; not to be changed, for aliases share it."""
        return self.root.plain()

    def place(self, path: Sequence[Key] = (), *, key: bool = False) -> Place:
        """Where the value at a path of keys and positions starts, or its key.

        The nearest place that exists stands in for a path that does not.
        """
        found, rest = self._nearest(path)
        return found.key_place if key and not rest else found.place

    def problem(self, code: str, text: str, path: Sequence[Key] = (), *, key: bool = False) -> Problem:
        """A mistake at the value of a path, or at its key, with the line it stands in."""
        found, rest = self._nearest(path)
        return found.problem(code, text, key=key and not rest)

    def _nearest(self, path: Sequence[Key]) -> tuple[Value, bool]:
        found = self.root
        for position, step in enumerate(path):
            child = found.get(step)
            if child is None:
                return found, position < len(path)
            found = child
        return found, False


def load(path: Path, *, limits: Limits = Limits(), keep_going: bool = False, name: str | None = None) -> Document:
    """The values of a YAML file.

    Args:
        path: the file, opened as it is: whether it may be read is the caller's question.
        limits: budgets.
        keep_going: put mistakes that do not stop the reading into `Document.problems`.
        name: how messages name it; the path as given by default.

    Raises:
        InputError: it cannot be read or is no YAML of ours; with all mistakes.
    """
    name = name or str(path)
    raw = read_bytes(path, limits.bytes, name)
    try:
        text = raw.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        good = Source(name, path, raw[: error.start].decode("utf-8-sig", "replace"))
        line, column = good.at(len(good.text))
        where = Place(name, line, column)
        raise InputError(Problem("RG008", "the text is not UTF-8; save the file as UTF-8", where)) from None
    return _parse(text, Source(name, path, text), limits, keep_going)


def parse(
    text: str, file: str = "<text>", *, path: Path | None = None, limits: Limits = Limits(), keep_going: bool = False
) -> Document:
    """The values of a YAML text.

    Args:
        text: the text.
        file: how messages name it.
        path: the file it comes from, to which its relative paths are relative.
        limits: budgets.
        keep_going: put mistakes that do not stop the reading into `Document.problems`.

    Raises:
        InputError: it is no YAML of ours; with all mistakes.
    """
    text = text.removeprefix("\ufeff")
    return _parse(text, Source(file, path, text), limits, keep_going)


def read_bytes(path: Path, most: int, name: str | None = None) -> bytes:
    """The bytes of a regular file of at most `most` bytes.

    Raises:
        InputError: there is none, it is a folder or a device, it may not be read, or it is longer.
    """
    name = shown(name or str(path))
    try:
        if path.is_dir():
            raise InputError(Problem("RG011", f"'{name}' is a folder, a file is needed"))
        if path.exists() and not path.is_file():
            raise InputError(Problem("RG011", f"'{name}' is not a regular file"))
        with path.open("rb") as file:
            raw = file.read(most + 1)
    except FileNotFoundError:
        raise InputError(Problem("RG011", f"there is no file '{name}'")) from None
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
        raise InputError(Problem("RG011", f"cannot read '{name}': {reason}")) from None
    if len(raw) > most:
        raise InputError(Problem("RG007", _over("bytes", most), Place(name)))
    return raw


def kind_of(data: object) -> str:
    """What a value is, in words for messages."""
    if data is None:
        return "null"
    if isinstance(data, bool):
        return "true" if data else "false"
    if isinstance(data, str):
        return "text"
    if isinstance(data, int | float):
        return "a number"
    return "a mapping" if isinstance(data, Mapping) else "a list"


def shown(text: object, most: int = 60) -> str:
    """Text of a user's for a message: one line, no control characters, not too long."""
    word = str(text)
    if len(word) > most:
        word = word[: most - 1] + "…"
    return "".join(c if c.isprintable() else c.encode("unicode_escape", "surrogatepass").decode() for c in word)


# --- scalars ---------------------------------------------------------------------------------------------------------

_NULL = frozenset(["", "~", "null", "Null", "NULL"])
_BOOL = {"true": True, "True": True, "TRUE": True, "false": False, "False": False, "FALSE": False}
_INT = re.compile(r"[-+]?[0-9]+\Z")
_BASED = re.compile(r"0o[0-7]+\Z|0x[0-9a-fA-F]+\Z")
_FLOAT = re.compile(r"[-+]?(?:\.[0-9]+|[0-9]+(?:\.[0-9]*)?)(?:[eE][-+]?[0-9]+)?\Z")
_SPECIAL = re.compile(r"([-+]?)\.(?:inf|Inf|INF)\Z|\.(?:nan|NaN|NAN)\Z")
_MOST_WHOLE = 2**63


def scalar(text: str) -> Scalar:
    """What a plain scalar means in YAML 1.2's core schema.

    Raises:
        ValueError: a number that no float, or a whole number that no 64 bits can hold.
    """
    if text in _NULL:
        return None
    if text in _BOOL:
        return _BOOL[text]
    if text[0] not in "+-.0123456789":
        return text
    if _INT.match(text):
        return _whole(text, 10)
    if _BASED.match(text):
        return _whole(text[2:], 8 if text[1] == "o" else 16)
    if _FLOAT.match(text):
        number = float(text)
        if math.isinf(number):
            raise ValueError("the number is too large; infinity is written .inf")
        return number
    special = _SPECIAL.match(text)
    if special is None:
        return text
    if special[1] is None:
        return math.nan
    return -math.inf if special[1] == "-" else math.inf


def _whole(digits: str, base: int) -> int:
    number = int(digits, base) if len(digits) < 100 else _MOST_WHOLE
    if not -_MOST_WHOLE <= number < _MOST_WHOLE:
        raise ValueError("the whole number needs more than 64 bits; write a smaller one, or one with a point")
    return number


# --- parsing ---------------------------------------------------------------------------------------------------------

_BREAK = re.compile("\r\n|[\r\n\x85\u2028\u2029]")
_LONGEST_LINE = 400
_MOST_PROBLEMS = 100
_ILLEGAL = re.compile("[^\t\n\r\x20-\x7e\x85\xa0-\ud7ff\ue000-\ufefe\uff00-\ufffd\U00010000-\U0010ffff]")
_UNITS = {
    "bytes": "is {} bytes long",
    "depth": "is {} levels deep",
    "nodes": "has {} values, aliases expanded",
    "aliases": "has {} aliases",
}


def _over(what: str, limit: int) -> str:
    return f"the text {_UNITS[what].format(f'more than {limit:,}')}; --limit yaml-{what}=N allows more"


class _Builder:
    """Values from parse events; holds what several events share."""

    def __init__(self, source: Source, limits: Limits) -> None:
        self.source = source
        self.limits = limits
        self.problems: list[Problem] = []
        self.anchors: dict[str, tuple[Value, int] | None] = {}
        self.nodes = 0
        self.aliases = 0

    def say(self, code: str, text: str, mark: Any) -> None:
        self.problems.append(self.source.problem(code, text, mark.line + 1, mark.column + 1))
        if len(self.problems) >= _MOST_PROBLEMS:
            raise InputError(self.problems)

    def stop(self, code: str, text: str, mark: Any) -> InputError:
        self.say(code, text, mark)
        return InputError(self.problems)

    def count(self, number: int, mark: Any) -> None:
        self.nodes += number
        if self.nodes > self.limits.nodes:
            raise self.stop("RG007", _over("nodes", self.limits.nodes), mark)

    def build(self, parser: Any, event: Any, depth: int, key: tuple[int, int] | None = None) -> Value:
        import yaml

        mark = event.start_mark
        line, column = mark.line + 1, mark.column + 1
        if isinstance(event, yaml.AliasEvent):
            return self.alias(event, key)
        before = self.nodes
        self.count(1, mark)
        if event.tag:
            self.say("RG004", f"the tag '{shown(event.tag)}' is not allowed; values have no types but their own", mark)
        if isinstance(event, yaml.ScalarEvent):
            value = Value(self.scalar(event), self.source, line, column, key)
        else:
            if depth >= self.limits.depth:
                raise self.stop("RG007", _over("depth", self.limits.depth), mark)
            if event.anchor:
                self.anchors[event.anchor] = None  # open: a use inside would be a cycle
            items: list[Value] | dict[Any, Value] = [] if isinstance(event, yaml.SequenceStartEvent) else {}
            value = Value(items, self.source, line, column, key)
            if isinstance(items, list):
                while not isinstance(following := parser.get_event(), yaml.SequenceEndEvent):
                    items.append(self.build(parser, following, depth + 1))
            else:
                while not isinstance(following := parser.get_event(), yaml.MappingEndEvent):
                    self.entry(parser, following, depth + 1, items)
        if event.tag:
            value.data = BROKEN
        if event.anchor:
            self.anchors[event.anchor] = (value, self.nodes - before)
        return value

    def entry(self, parser: Any, event: Any, depth: int, into: dict[Any, Value]) -> None:
        mark = event.start_mark
        merge = getattr(event, "value", None) == "<<" and event.implicit[0]
        name = self.build(parser, event, depth).data
        value = self.build(parser, parser.get_event(), depth, (mark.line + 1, mark.column + 1))
        if merge:
            self.say("RG003", "merge keys ('<<') are not allowed; use `extends`, or write the values out", mark)
        elif name is BROKEN:
            pass
        elif isinstance(name, bool) or not isinstance(name, str | int | float) or name != name:
            self.say("RG009", f"a key must be text or a number, this is {kind_of(name)}", mark)
        elif name in into:
            first = into[name].key_line
            self.say("RG002", f"the key '{shown(name)}' stands here twice, first in line {first}; remove one", mark)
        else:
            into[name] = value

    def alias(self, event: Any, key: tuple[int, int] | None) -> Value:
        mark = event.start_mark
        self.aliases += 1
        if self.aliases > self.limits.aliases:
            raise self.stop("RG007", _over("aliases", self.limits.aliases), mark)
        found = self.anchors.get(event.anchor)
        place = (self.source, mark.line + 1, mark.column + 1, key)
        if found is None:
            name = shown(event.anchor)
            inside = event.anchor in self.anchors
            reason = "contains itself" if inside else f"has no anchor '&{name}' before it"
            self.say("RG006", f"the alias '*{name}' {reason}", mark)
            return Value(BROKEN, *place)
        value, size = found
        self.count(size, mark)
        return Value(value.data, *place)

    def scalar(self, event: Any) -> Scalar | Broken:
        # Plain or quoted is asked of `implicit`: tag and style are '' in the C parser where they are None in the other.
        if not event.implicit[0]:
            return str(event.value)
        try:
            return scalar(event.value)
        except ValueError as error:
            self.say("RG010", f"{error}", event.start_mark)
            return BROKEN


def _parse(text: str, source: Source, limits: Limits, keep_going: bool) -> Document:
    import yaml

    if len(text) > limits.bytes or len(text.encode("utf-8", "surrogatepass")) > limits.bytes:
        raise InputError(Problem("RG007", _over("bytes", limits.bytes), Place(source.name)))
    illegal = _ILLEGAL.search(text)
    if illegal:
        what = f'the character U+{ord(illegal[0]):04X} is not allowed in YAML; remove it, or write it as "\\u…"'
        raise InputError(source.problem("RG008", what, *source.at(illegal.start())))
    builder = _Builder(source, limits)
    try:
        parser: Any = _parser(text)
        parser.get_event()  # the stream's start
        event = parser.get_event()
        if isinstance(event, yaml.StreamEndEvent):
            return Document(Value(None, source, 1, 1), source)
        root = builder.build(parser, parser.get_event(), 0)
        parser.get_event()  # the document's end
        event = parser.get_event()
        if not isinstance(event, yaml.StreamEndEvent):
            builder.say("RG005", "a file holds one document; remove everything from '---' on", event.start_mark)
    except yaml.MarkedYAMLError as error:
        raise InputError([*builder.problems, _syntax(source, error)]) from None
    except (yaml.YAMLError, ValueError, LookupError, AttributeError, RecursionError) as error:
        # PyYAML leaks these on some malformed text.
        reason = shown(str(error).splitlines()[0] if str(error) else type(error).__name__)
        raise InputError([*builder.problems, source.problem("RG001", f"not valid YAML: {reason}")]) from None
    if builder.problems and not keep_going:
        raise InputError(builder.problems)
    return Document(root, source, tuple(builder.problems))


def _parser(text: str) -> object:
    try:
        from yaml.cyaml import CParser  # type: ignore[attr-defined]  # the stubs leave it out
    except ImportError:  # PyYAML built without libyaml: the same events, ten times slower
        from yaml import SafeLoader

        return SafeLoader(text)
    return CParser(text)


def _syntax(source: Source, error: Any) -> Problem:
    """PyYAML's complaint in our words: its own name tokens, differ between its two parsers, and point at the end."""
    mark = error.problem_mark or error.context_mark
    problem, context = error.problem or "", error.context or ""
    line, column = (mark.line + 1, mark.column + 1) if mark else (0, 0)
    char = source.line(line)[column - 1 : column] if line else ""
    start = error.context_mark
    if "mapping values are not allowed" in problem:
        what = "a ':' cannot stand here; quote the text that holds it, or start a new line with the right indentation"
    elif "cannot start any token" in problem and char == "\t":
        what = "a tab cannot indent; use spaces"
    elif "cannot start any token" in problem:
        what = f"text cannot start with '{shown(char)}'; put it in quotes"
    elif "quoted scalar" in context and "end of stream" in problem:
        what, mark = "the quote that starts here is not closed", start or mark
    elif "flow sequence" in context:
        what, mark = "the '[' that starts here has no ']' or lacks a comma", start or mark
    elif "flow mapping" in context:
        what, mark = "the '{' that starts here has no '}' or lacks a comma", start or mark
    elif "expected ':'" in problem:
        what, mark = "this key has no ':'", start or mark
    elif "block" in context:
        what = "this does not fit what is above; check the indentation"
    else:
        what = shown(" ".join((f"{context}: " * bool(context) + problem).split()), 120)
    line, column = (mark.line + 1, mark.column + 1) if mark else (0, 0)
    return source.problem("RG001", f"not valid YAML: {what}", line, column)
