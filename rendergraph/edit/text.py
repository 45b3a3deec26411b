"""Edit YAML text in place: set, delete or rename one entry, and keep every other byte.

Places come from PyYAML's events. Only block collections need care: their end mark is after the comments that follow, so
they end where their last value ends. Every change is verified: the new text must parse to the old values with the same
change. Text that cannot be edited here, such as a value that an alias repeats, is refused.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from typing import Any

from msgspec import Struct

from rendergraph.document import Source, from_plain, parse, scalar
from rendergraph.document.parsing import parser_of
from rendergraph.errors import InputError, Problem
from rendergraph.resolve.spec import flow, text_of

Path = tuple[str | int, ...]
DELETED: Any = object()
"""In place of a value: delete the entry."""

BREAK = re.compile("\r\n|[\r\n\x85\u2028\u2029]")
_COMMA = re.compile(r"(?:\s|(?<=\s)#[^\r\n]*+)*+,")
_WIDTH = 100  # longer new mappings, and the nodes of a file, are written in block style


def edit(text: str, path: Path, value: Any) -> str:
    """Return the text with a value at a path, or without an entry there if the value is `DELETED`.

    A value replaces the existing one, or is added after its siblings. A deleted entry's line or comma goes, too;
    comments above it stay. Raise InputError (RG019) if the text cannot be edited.
    """

    def change(data: Any) -> None:
        for step in path[:-1]:
            if isinstance(data, dict) and data.get(step) is None:
                data[step] = {}
            data = data[step]
        if value is DELETED:
            del data[path[-1]]
        else:
            data[path[-1]] = value

    return _checked(text, path, change, _delete if value is DELETED else _set)


def rename(text: str, path: Path, key: str) -> str:
    """Return the text with another key for the entry at a path."""

    def change(data: Any) -> None:
        for step in path[:-1]:
            data = data[step]
        entries = [(key if name == path[-1] else name, child) for name, child in data.items()]
        data.clear()
        data.update(entries)

    def written(text: str, path: Path, data: Any) -> str:
        span = spans(text, path)[-1]
        adjacent = re.match(r":\S", text[span.key_end :])  # `{"a":1}`: the colon would join an unquoted key
        return text[: span.first] + (f'"{key}"' if adjacent else text_of(key)) + text[span.key_end :]

    return _checked(text, path, change, written)


def _checked(text: str, path: Path, change: Callable[[Any], None], written: Callable[[str, Path, Any], str]) -> str:
    expected = _unshared(parse(text).root.plain())
    try:
        change(expected)
        after = written(text, path, expected)
        found = _unshared(parse(after).root.plain())
    except (InputError, LookupError, TypeError, ValueError):
        after, found = "", None
    if repr(found) != repr(expected):  # distinguishes 1 from 1.0, and nan equals nan
        shared = "; its anchor (&) is used elsewhere: write the value out there first"
        way = shared if re.search(r"&\w", text) else ": edit it by hand"
        raise InputError(Problem("RG019", f"'{'.'.join(map(str, path))}' cannot be edited where it stands{way}"))
    return after


def _unshared(data: Any) -> Any:
    """Copy data that aliases share: a change at one place must not affect another."""
    if isinstance(data, dict):
        return {key: _unshared(child) for key, child in data.items()}
    return [_unshared(child) for child in data] if isinstance(data, list) else data


class Span(Struct, eq=False):
    """Offsets of a value and its key in the text; a `block` is a mapping or list in block style.

    An entry begins at `first`, with its key, or with its value if that has no key.
    """

    start: int
    end: int
    block: bool
    first: int
    key_end: int
    children: dict[Any, Span] | None

    @property
    def last(self) -> int:
        return max(self.end, self.key_end)


def spans(text: str, path: Path) -> list[Span]:
    """Return the spans of the file's value and of the values along a path, as far as they exist."""
    import yaml  # loaded with the first file

    parser: Any = parser_of(text)
    get: Callable[[], Any] = parser.get_event

    def span(event: Any, key: Any = None) -> Span:
        start, end = event.start_mark.index, event.end_mark.index
        children: dict[Any, Span] | None = None
        block = False
        if isinstance(event, yaml.ScalarEvent) and event.style in ("|", ">"):
            if "+" not in BREAK.split(text[start:], maxsplit=1)[0]:  # `|+` keeps empty lines
                end = len(text[:end].rstrip())
        elif isinstance(event, yaml.SequenceStartEvent | yaml.MappingStartEvent):
            children, is_list, block = {}, isinstance(event, yaml.SequenceStartEvent), not event.flow_style
            while not isinstance(following := get(), yaml.CollectionEndEvent):
                if is_list:
                    children[len(children)] = span(following)
                else:  # an alias as a key has no value, and is refused
                    name = scalar(following.value) if following.implicit[0] else following.value
                    children[name] = span(get(), following)
            closing: Any = following
            end = max(child.last for child in children.values()) if block else closing.end_mark.index
        first, key_end = (start, start) if key is None else (key.start_mark.index, key.end_mark.index)
        return Span(start, end, block, first, key_end, children)

    while not isinstance(get(), yaml.DocumentStartEvent):
        pass
    found = [span(get())]
    for step in path:
        child = (found[-1].children or {}).get(step)
        if child is None:
            break
        found.append(child)
    return found


def _line(text: str, at: int) -> tuple[int, int, int]:
    """Return where the line of an offset begins, where it ends, and where the next one begins."""
    start = max((found.end() for found in BREAK.finditer(text, 0, at)), default=0)
    found = BREAK.search(text, at)
    return (start, *found.span()) if found else (start, len(text), len(text))


def _lines(text: str, first: int, last: int) -> tuple[int, int]:
    """Return the range of whole lines from one offset to another; the last line may have no break."""
    start, (_, end, behind) = _line(text, first)[0], _line(text, last)
    if BREAK.fullmatch(text[last - 1 : last]):  # a literal that keeps trailing empty lines
        return start, last
    if end == behind:
        start -= 2 if text.endswith("\r\n", 0, start) else min(start, 1)
    return start, behind


def _set(text: str, path: Path, data: Any) -> str:
    *_, span = found = spans(text, path)
    for step in path[: len(found) - 1]:
        data = data[step]
    if len(found) <= len(path) and span.children is not None:
        key = path[len(found) - 1]
        return _insert(text, span, key, data[key])
    return _replace(text, span, flow(from_plain(data, Source(""))))  # a null and an alias are written out


def _replace(text: str, span: Span, written: str) -> str:
    colon = text.find(":", span.key_end, span.start)
    if span.start == span.end:  # the value is empty
        at = colon + 1 or span.end
        return text[:at] + (" " if colon >= 0 else ": ") + written + text[at:]
    if not span.block or colon < 0 or _line(text, span.start)[0] < colon:
        return text[: span.start] + written + text[span.end :]
    first, behind = _lines(text, span.start, span.end)
    return text[: colon + 1] + " " + written + text[colon + 1 : first] + text[behind:]


def _insert(text: str, parent: Span, key: Any, value: Any) -> str:
    entry = f"{text_of(key)}: {flow(from_plain(value, Source('')))}"
    children = [*(parent.children or {}).values()]
    if not children:
        at = text.index("{", parent.start) + 1
        return text[:at] + entry + text[at:]
    last = children[-1].last
    newline = (BREAK.search(text) or ["\n"])[0]
    indent = " " * (children[0].first - _line(text, children[0].first)[0])
    if parent.block:
        lines = [indent + line for line in _entry(key, value, len(indent))]
        if BREAK.fullmatch(text[last - 1 : last]):
            return text[:last] + "".join(line + newline for line in lines) + text[last:]
        at = _line(text, last)[1]
        return text[:at] + "".join(newline + line for line in lines) + text[at:]
    before = text[_line(text, children[-1].first)[0] : children[-1].first]
    between = newline + before if len(children) > 1 and not before.strip() else " "
    return text[:last] + "," + between + entry + text[last:]


def _entry(key: Any, value: Any, indent: int) -> Iterator[str]:
    line = f"{text_of(key)}: {flow(from_plain(value, Source('')))}"
    if not isinstance(value, dict) or not value:
        yield line
    elif indent + len(line) > _WIDTH or (indent == 0 and all(isinstance(child, dict) for child in value.values())):
        yield f"{text_of(key)}:"
        for name, child in value.items():
            yield from (f"  {inner}" for inner in _entry(name, child, indent + 2))
    else:
        yield line


def _delete(text: str, path: Path, data: Any) -> str:
    *_, span = found = spans(text, path)
    if len(found) <= len(path):  # below an alias, whose value is written out
        return _set(text, path, data)
    parent = found[-2]
    children = [*(parent.children or {}).values()]
    number = children.index(span)
    if parent.block and len(children) == 1:
        return _replace(text, parent, "{}")
    if parent.block:
        first, behind = _lines(text, span.first, span.last)
        if text[_line(text, span.first)[0] : span.first].strip(" "):  # on the line of a list's dash
            first, behind = span.first, children[number + 1].first
        return text[:first] + text[behind:]
    if comma := _COMMA.match(text, span.last):
        gap = re.compile(" *(?! *#)").match(text, comma.end())  # a comment after the comma keeps its space
        return text[: span.first] + text[gap.end() if gap else comma.end() :]
    if number == 0:
        return text[: span.first] + text[span.last :]
    comma = _COMMA.match(text, children[number - 1].last)
    assert comma is not None
    return text[: comma.end() - 1] + text[comma.end() : span.first].rstrip(" ") + text[span.last :]
