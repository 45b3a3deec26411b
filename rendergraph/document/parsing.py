"""Parse YAML text into values: PyYAML's parse events, YAML 1.2's core schema, and budgets."""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import Any

from msgspec import Struct

from rendergraph.document.values import BROKEN, Broken, Document, Scalar, Source, Value, kind_of, shown
from rendergraph.errors import InputError, Option, Place, Problem

_NULL = frozenset(["", "~", "null", "Null", "NULL"])
_BOOL = {"true": True, "True": True, "TRUE": True, "false": False, "False": False, "FALSE": False}
_INT = re.compile(r"[-+]?[0-9]+\Z")
_BASED = re.compile(r"0o[0-7]+\Z|0x[0-9a-fA-F]+\Z")
_FLOAT = re.compile(r"[-+]?(?:\.[0-9]+|[0-9]+(?:\.[0-9]*)?)(?:[eE][-+]?[0-9]+)?\Z")
# Compiled on use, because few values begin like a number without being one.
_SPECIAL = r"([-+]?)\.(?:inf|Inf|INF)\Z|\.(?:nan|NaN|NAN)\Z"
_MOST_WHOLE = 2**63


def scalar(text: str) -> Scalar:
    """Return the value of a plain scalar in YAML 1.2's core schema."""
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
    special = re.match(_SPECIAL, text)
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


class YamlLimits(Struct, frozen=True):
    """Budgets of one YAML file; each is a small multiple of what a person writes.

    Attributes:
        bytes: length of the text.
        depth: nested lists and mappings; libyaml itself crashes at about 25,000.
        nodes: values after aliases are expanded.
        aliases: uses of `*name`.
    """

    bytes: int = 2_000_000
    depth: int = 64
    nodes: int = 200_000
    aliases: int = 1_000


_MOST_PROBLEMS = 100
_ILLEGAL = "[\0-\x08\x0b\x0c\x0e-\x1f\x7f-\x84\x86-\x9f\ud800-\udfff\ufeff\ufffe\uffff]"
_UNITS = {
    "bytes": "is {} bytes long",
    "depth": "is {} levels deep",
    "nodes": "has {} values, aliases expanded",
    "aliases": "has {} aliases",
}


def over_limit(what: str, limit: int) -> str:
    return f"the text {_UNITS[what].format(f'more than {limit:,}')}; --limit yaml-{what}=N allows more"


class _Builder(Struct, eq=False):
    source: Source
    limits: YamlLimits
    problems: list[Problem] = []
    anchors: dict[str, tuple[Value, int] | None] = {}
    nodes: int = 0
    aliases: int = 0

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
            raise self.stop("RG007", over_limit("nodes", self.limits.nodes), mark)

    def build(self, parser: Any, event: Any, depth: int, key: tuple[int, int] | None = None) -> Value:
        import yaml  # loaded with the first file

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
                raise self.stop("RG007", over_limit("depth", self.limits.depth), mark)
            if event.anchor:
                self.anchors[event.anchor] = None  # still open: a use inside would be a cycle
            items: list[Value] | dict[Any, Value] = [] if isinstance(event, yaml.SequenceStartEvent) else {}
            value = Value(items, self.source, line, column, key)
            if isinstance(items, list):
                while not isinstance(following := parser.get_event(), yaml.SequenceEndEvent):
                    items.append(self.build(parser, following, depth + 1))
            else:
                while not isinstance(following := parser.get_event(), yaml.MappingEndEvent):
                    whole = self.entry(parser, following, depth + 1, items)
                    value.data = value.data if whole else BROKEN
        if event.tag:
            value.data = BROKEN
        if event.anchor:
            self.anchors[event.anchor] = (value, self.nodes - before)
        return value

    def entry(self, parser: Any, event: Any, depth: int, into: dict[Any, Value]) -> bool:
        """Add one key with its value; return False if the contents of the mapping cannot be known."""
        mark = event.start_mark
        merge = getattr(event, "value", None) == "<<" and event.implicit[0]
        name = self.build(parser, event, depth).data
        value = self.build(parser, parser.get_event(), depth, (mark.line + 1, mark.column + 1))
        if merge:
            self.say("RG003", "merge keys ('<<') are not allowed; use `extends`, or write the values out", mark)
        elif name is BROKEN:
            pass
        elif isinstance(name, bool) or not isinstance(name, str | int | float) or name != name:
            self.say("RG009", f"a key must be text or a number, got {kind_of(name) if name == name else '.nan'}", mark)
        elif name in into:
            first = into[name].key_place.line
            self.say("RG002", f"duplicate key '{shown(name)}', first in line {first}; remove one", mark)
        else:
            into[name] = value
        return not merge

    def alias(self, event: Any, key: tuple[int, int] | None) -> Value:
        mark = event.start_mark
        self.aliases += 1
        if self.aliases > self.limits.aliases:
            raise self.stop("RG007", over_limit("aliases", self.limits.aliases), mark)
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
        # `implicit` tells plain from quoted: tag and style are '' in the C parser but None in the Python one.
        if not event.implicit[0]:
            return str(event.value)
        try:
            return scalar(event.value)
        except ValueError as error:
            self.say("RG010", f"{error}", event.start_mark)
            return BROKEN


def parse(
    text: str,
    origin: str | Option = "<text>",
    *,
    path: Path | None = None,
    limits: YamlLimits = YamlLimits(),
    keep_going: bool = False,
) -> Document:
    """Return the values of a YAML text.

    Args:
        origin: its name in messages.
        path: the file that it comes from, to which its paths are relative.
        keep_going: put mistakes that do not prevent reading into `Document.problems`.
    """
    import yaml  # loaded with the first file

    text = text.removeprefix("\ufeff")
    source = Source(origin, path, text)
    if len(text) > limits.bytes or len(text.encode("utf-8", "surrogatepass")) > limits.bytes:
        raise InputError(Problem("RG007", over_limit("bytes", limits.bytes), Place(source.origin)))
    # Compiling the large character set takes as long as reading a pipeline, and most files are plain lines of text.
    in_lines = text.replace("\n", "").replace("\r", "").replace("\t", "").isprintable()
    illegal = None if in_lines else re.search(_ILLEGAL, text)
    if illegal:
        what = f'the character U+{ord(illegal[0]):04X} is not allowed in YAML; remove it, or write it as "\\u…"'
        raise InputError(source.problem("RG008", what, *source.at(illegal.start())))
    builder = _Builder(source, limits)
    try:
        parser: Any = parser_of(text)
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
        # PyYAML raises these on some malformed text.
        reason = shown(str(error).splitlines()[0] if str(error) else type(error).__name__)
        raise InputError([*builder.problems, source.problem("RG001", f"not valid YAML: {reason}")]) from None
    if builder.problems and not keep_going:
        raise InputError(builder.problems)
    return Document(root, source, tuple(builder.problems))


def parser_of(text: str) -> object:
    try:
        from yaml.cyaml import CParser  # type: ignore[attr-defined]  # the stubs leave it out
    except ImportError:  # PyYAML without libyaml: the same events, ten times slower
        from yaml import SafeLoader  # only without libyaml

        return SafeLoader(text)
    return CParser(text)


def _syntax(source: Source, error: Any) -> Problem:
    """Reword PyYAML's message, which names tokens, differs between its two parsers, and points at the end."""
    mark = error.problem_mark or error.context_mark
    problem, context = error.problem or "", error.context or ""
    line, column = (mark.line + 1, mark.column + 1) if mark else (0, 0)
    char = source.line(line)[column - 1 : column] if line else ""
    start = error.context_mark
    if "mapping values are not allowed" in problem:
        what = "a ':' is not allowed here; quote the text that has it, or start a new line with the right indentation"
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
    elif "flow node" in context:
        what = "a value is expected here; close the '[' or '{' before it, or remove a comma"
    elif "expected ':'" in problem:
        what, mark = "this key has no ': ', a colon and a space", start or mark
    elif "block" in context:
        what = "this does not fit what is above; check the indentation"
    else:
        what = shown(" ".join((f"{context}: " * bool(context) + problem).split()), 120)
    line, column = (mark.line + 1, mark.column + 1) if mark else (0, 0)
    return source.problem("RG001", f"not valid YAML: {what}", line, column)
