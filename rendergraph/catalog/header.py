"""The YAML header of a shader file: what it says of ports and parameters, each value with its place in the file."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TypeAlias, get_args

from rendergraph.document import BROKEN, Value, parse, shown
from rendergraph.errors import InputError, Place, Problem, suggestion
from rendergraph.textures import FORMATS, Filter, Wrap

BEGIN, END = "/*---", "---*/"
"""The lines between which a header stands."""

_BEGIN = re.compile(rf"^[ \t]*{re.escape(BEGIN)}[ \t]*$", re.MULTILINE)
_ALMOST = re.compile(r"[ \t]*/\*[ \t]+---[ \t]*\Z")
_NAME = re.compile(r"[A-Za-z]\w*\Z", re.ASCII)
_REFERENCE = re.compile(r"\$[A-Za-z]\w*\Z", re.ASCII)
_MOST_SIDE = 16_384

Check: TypeAlias = "Callable[[Value], str | None]"
"""What a key takes, in words, where a value is wrong; None where it is right."""


@dataclass(frozen=True, eq=False)
class Header:
    """A header as it is written, without what is wrong in it.

    Attributes:
        doc: the node's docs; None where there are none.
        inputs, outputs, params: by name the keys of each entry.
        names: by name the entry, for its place.
        threads: how many threads a compute shader runs; None where it is not said.
        problems: everything that is wrong.
        present: whether there is a header at all.
    """

    doc: str | None = None
    inputs: Mapping[str, Mapping[str, Value]] = field(default_factory=dict)
    outputs: Mapping[str, Mapping[str, Value]] = field(default_factory=dict)
    params: Mapping[str, Mapping[str, Value]] = field(default_factory=dict)
    names: Mapping[str, Value] = field(default_factory=dict)
    threads: Value | None = None
    problems: tuple[Problem, ...] = ()
    present: bool = False


def is_in(text: str) -> bool:
    """Whether a shader's text has a header."""
    return _BEGIN.search(text) is not None


def read_header(text: str, file: Path, name: str) -> Header:
    """The header of a shader's text.

    Args:
        text: all of the file.
        file: the file.
        name: how messages name it.

    Raises:
        InputError: it has no end, or is no YAML at all.
    """
    begin = _BEGIN.search(text)
    lines = text.split("\n")
    if begin is None:
        almost = next((number for number, line in enumerate(lines) if _ALMOST.match(line)), None)
        if almost is not None and any(line.strip() == END for line in lines[almost:]):
            raise InputError(_problem(name, lines, almost, f"a header begins with a line '{BEGIN}', without blanks"))
        return Header()
    first = text.count("\n", 0, begin.start()) + 1  # the line behind the fence, counted from 0
    last = next((number for number in range(first, len(lines)) if "*/" in lines[number]), None)
    if last is None or lines[last].strip() != END:
        at = first - 1 if last is None else last
        what = "has no end" if last is None else "is ended by '*/' here"
        text = f"the header {what}; it ends with a line '{END}'"
        raise InputError(_problem(name, lines, at, text))
    # The YAML keeps its lines: what stands above is blank.
    document = parse("\n" * first + "\n".join(lines[first:last]) + "\n", name, path=file, keep_going=True)
    return _Reader(list(document.problems)).header(document.root)


def _problem(name: str, lines: list[str], number: int, text: str) -> Problem:
    line = lines[number]
    column = len(line) - len(line.lstrip()) + 1
    return Problem("RG440", text, Place(name, number + 1, column), line)


# --- what keys take --------------------------------------------------------------------------------------------------


def _text(value: Value) -> str | None:
    return None if isinstance(value.data, str) and value.data.strip() else "text"


def _flag(value: Value) -> str | None:
    return None if isinstance(value.data, bool) else "true or false"


def _number(value: Value) -> str | None:
    data = value.data
    return None if isinstance(data, int | float) and not isinstance(data, bool) else "a number"


def _count(most: int) -> Check:
    def check(value: Value) -> str | None:
        data = value.data
        fits = isinstance(data, int) and not isinstance(data, bool) and 1 <= data <= most
        return None if fits or _is_reference(value) else f"a whole number from 1 to {most}, or $ and a parameter's name"

    return check


def _one_of(*choices: str) -> Check:
    def check(value: Value) -> str | None:
        return None if value.data in choices else f"one of {', '.join(choices)}"

    return check


def _format(value: Value) -> str | None:
    if isinstance(value.data, str) and (value.data in FORMATS or _is_reference(value)):
        return None
    return f"a format{suggestion(str(value.data), FORMATS, most=0)}; there is {', '.join(FORMATS)}"


def _mips(value: Value) -> str | None:
    if value.data == "all" or _count(15)(value) is None:
        return None
    return "a whole number from 1 to 15, all, or $ and a parameter's name"


def _name(value: Value) -> str | None:
    return None if isinstance(value.data, str) and _NAME.match(value.data) else "the name of an input"


def _size(value: Value) -> str | None:
    """A factor, an input, `[width, height]`, `[input, factor]`."""
    data = value.data
    if isinstance(data, list) and len(data) == 2:
        sides = [part.data for part in data]
        if all(isinstance(s, int) and not isinstance(s, bool) and 1 <= s <= _MOST_SIDE for s in sides):
            return None
        if _name(data[0]) is None and _factor(data[1]):
            return None
    elif _factor(value) or _name(value) is None:
        return None
    return "a factor of the picture's size, an input's name, [input, factor], or [width, height] in texels"


def _factor(value: Value) -> bool:
    data = value.data
    return _is_reference(value) or (isinstance(data, int | float) and not isinstance(data, bool) and 0 < data <= 64)


def _is_reference(value: Value) -> bool:
    return isinstance(value.data, str) and bool(_REFERENCE.match(value.data))


def _clear(value: Value) -> str | None:
    data = value.data
    parts = data if isinstance(data, list) else [value]
    fits = all(_number(part) is None for part in parts) and (not isinstance(data, list) or len(data) == 4)
    return None if fits else "a number, or a list of 4"


def _threads(value: Value) -> str | None:
    data = value.data
    parts = data if isinstance(data, list) else [value]
    if isinstance(data, str) and _name(value) is None:
        return None
    if 1 <= len(parts) <= 3 and all(_count(1 << 30)(part) is None for part in parts):
        return None
    return "a port whose texels they are, or 1 to 3 whole numbers"


def _default(value: Value) -> str | None:
    data = value.data
    if isinstance(data, list):
        numbers = [part.data for part in data]
        fits = 2 <= len(numbers) <= 4 and all(isinstance(n, int | float) and not isinstance(n, bool) for n in numbers)
        return None if fits else "2 to 4 numbers"
    return None if isinstance(data, str | int | float) else "a number, a switch, a word or a list of numbers"


def _choices(value: Value) -> str | None:
    data = value.data
    fits = isinstance(data, list) and data and all(isinstance(c.data, str) and _NAME.match(c.data) for c in data)
    return None if fits else "a list of words"


INPUT_KEYS: dict[str, Check] = {
    "doc": _text,
    "semantic": _name,
    "kind": _one_of("function", "view"),
    "optional": _flag,
    "many": _flag,
    "size": _one_of("same", "any"),
    "filter": _one_of(*get_args(Filter)),
    "wrap": _one_of(*get_args(Wrap)),
    "anisotropy": _count(16),
    "group": _name,
}
OUTPUT_KEYS: dict[str, Check] = {
    "doc": _text,
    "semantic": _name,
    "like": _name,
    "format": _format,
    "size": _size,
    "mips": _mips,
    "layers": _count(2048),
    "samples": _count(16),
    "clear": _clear,
    "first": _number,
    "kept": _flag,
    "bytes": _count(1 << 30),
}
PARAM_KEYS: dict[str, Check] = {
    "doc": _text,
    "default": _default,
    "unit": _text,
    "min": _number,
    "max": _number,
    "role": _one_of("param", "define", "structural"),
    "choices": _choices,
}
TOP_KEYS = ("doc", "inputs", "outputs", "params", "threads")

_SECTIONS = {
    "inputs": ("an input", INPUT_KEYS),
    "outputs": ("an output", OUTPUT_KEYS),
    "params": ("a parameter", PARAM_KEYS),
}


class _Reader:
    """One walk over a header; what is wrong is said and left out."""

    def __init__(self, problems: list[Problem]) -> None:
        self.problems = problems
        self.names: dict[str, Value] = {}

    def header(self, root: Value) -> Header:
        if root.data is BROKEN or not isinstance(root.data, dict | None):
            if root.data is not BROKEN:
                text = f"a header is a mapping with {', '.join(TOP_KEYS[:-1])}, this is {root.kind}"
                self.problems.append(root.problem("RG440", text))
            return Header(problems=tuple(self.problems), present=True)
        parts: dict[str, dict[str, dict[str, Value]]] = {}
        doc: str | None = None
        threads: Value | None = None
        for key, value in root.items():
            if value.data is BROKEN:
                continue
            if key not in TOP_KEYS:
                text = f"a header has no key '{shown(key)}'{suggestion(str(key), TOP_KEYS)}"
                self.problems.append(value.problem("RG440", text, key=True))
            elif value.data is None:
                continue
            elif key in _SECTIONS:
                parts[key] = self.section(key, value)
            elif self.right(key, value, _text if key == "doc" else _threads):
                doc = str(value.data).strip() if key == "doc" else doc
                threads = value if key == "threads" else threads
        inputs, outputs, params = (parts.get(key, {}) for key in ("inputs", "outputs", "params"))
        return Header(doc, inputs, outputs, params, self.names, threads, tuple(self.problems), True)

    def section(self, section: str, value: Value) -> dict[str, dict[str, Value]]:
        what, keys = _SECTIONS[section]
        found: dict[str, dict[str, Value]] = {}
        if not isinstance(value.data, dict):
            text = f"'{section}' takes a mapping of names, this is {value.kind}"
            self.problems.append(value.problem("RG440", text))
            return found
        for name, entry in value.items():
            if not isinstance(name, str) or not _NAME.match(name):
                text = f"'{shown(name)}' is no name of {what}; letters, digits and '_' make one, a letter first"
                self.problems.append(entry.problem("RG440", text, key=True))
            elif name in self.names:
                line = self.names[name].key_line
                text = f"'{name}' stands in line {line} too; no port or parameter has the name of another"
                self.problems.append(entry.problem("RG440", text, key=True))
            elif entry.data is None or isinstance(entry.data, dict):
                self.names[name] = entry
                found[name] = self.entry(what, keys, entry)
            elif entry.data is not BROKEN:
                text = f"'{name}' takes a mapping as in {{doc: …}}, this is {entry.kind}"
                self.problems.append(entry.problem("RG440", text))
        return found

    def entry(self, what: str, keys: Mapping[str, Check], entry: Value) -> dict[str, Value]:
        found: dict[str, Value] = {}
        for key, value in entry.items():
            if key not in keys and value.data is None and " " in str(key):
                text = f"'{shown(key)}' reads as a key: text with a comma stands in quotes within {{…}}"
                self.problems.append(value.problem("RG440", text, key=True))
            elif key not in keys:
                text = f"{what} has no key '{shown(key)}'{suggestion(str(key), keys)}"
                self.problems.append(value.problem("RG440", text, key=True))
            elif value.data is not None and value.data is not BROKEN and self.right(key, value, keys[key]):
                found[key] = value
        return found

    def right(self, key: str, value: Value, check: Check) -> bool:
        wanted = check(value)
        if wanted is not None:
            is_text = isinstance(value.data, str)
            given = f"'{shown(value.data, 40)}'" if is_text else shown(value.data) if _scalar(value) else value.kind
            self.problems.append(value.problem("RG440", f"'{key}' takes {wanted}, this is {given}"))
        return wanted is None


def _scalar(value: Value) -> bool:
    return isinstance(value.data, int | float) and not isinstance(value.data, bool)
