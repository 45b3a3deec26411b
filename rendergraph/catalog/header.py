"""The YAML header of a shader file: its ports and parameters, each value with its place in the file."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, get_args

from msgspec import Struct, field
from msgspec.structs import replace

from rendergraph.document import Document, Value, parse
from rendergraph.errors import InputError, Place, Problem
from rendergraph.keys import Codes, Key, MapOf, Naming, Table, Validator
from rendergraph.keys.values import NUMBER, TEXT, choice, listed, number, row, vector, whole, word
from rendergraph.textures import FORMATS, MOST_SIDE, Filter, Wrap
from rendergraph.typecheck import Brief

BEGIN, END = "/*---", "---*/"
"""The lines between which a header stands."""

_BEGIN = re.compile(rf"^[ \t]*{re.escape(BEGIN)}[ \t]*$", re.MULTILINE)
_ALMOST = re.compile(r"[ \t]*/\*[ \t]+---[ \t]*\Z")
_NAME = re.compile(r"[A-Za-z]\w*\Z", re.ASCII)


class Header(Struct, frozen=True, eq=False):
    """A header as it is written, without its wrong entries: the keys of each by its name; `names` has their places."""

    doc: str | None = None
    inputs: Mapping[str, Mapping[str, Value]] = field(default_factory=dict)
    outputs: Mapping[str, Mapping[str, Value]] = field(default_factory=dict)
    params: Mapping[str, Mapping[str, Value]] = field(default_factory=dict)
    names: Mapping[str, Value] = field(default_factory=dict)
    threads: Value | None = None
    problems: tuple[Problem, ...] = ()


def is_in(text: str) -> bool:
    return _BEGIN.search(text) is not None


def read_header(text: str, file: Path, name: str) -> Header:
    begin = _BEGIN.search(text)
    lines = text.split("\n")
    if begin is None:
        almost = next((number for number, line in enumerate(lines) if _ALMOST.match(line)), None)
        if almost is not None and any(line.strip() == END for line in lines[almost:]):
            raise InputError(_problem(name, lines, almost, f"a header begins with a line '{BEGIN}', without spaces"))
        return Header()
    first = text.count("\n", 0, begin.start()) + 1  # the line after the fence, counted from 0
    last = next((number for number in range(first, len(lines)) if "*/" in lines[number]), None)
    if last is None or lines[last].strip() != END:
        at = first - 1 if last is None else last
        what = "has no end" if last is None else "is ended by '*/' here"
        raise InputError(_problem(name, lines, at, f"the header {what}; it ends with a line '{END}'"))
    # Blank lines in place of the text above keep the YAML's line numbers.
    header = _checked(parse("\n" * first + "\n".join(lines[first:last]) + "\n", name, path=file, keep_going=True))
    second = next((number for number in range(last, len(lines)) if _BEGIN.match(lines[number])), None)
    if second is None:
        return header
    text = f"a file has one header; put this one into the header that begins in line {first}"
    return replace(header, problems=(*header.problems, _problem(name, lines, second, text)))


def _problem(name: str, lines: list[str], number: int, text: str) -> Problem:
    line = lines[number]
    column = len(line) - len(line.lstrip()) + 1
    return Problem("RG440", text, Place(name, number + 1, column), line)


_INPUT = word(_NAME, "the name of an input")
_REFERENCE = word(re.compile(r"\$[A-Za-z]\w*\Z", re.ASCII), "$ and a parameter's name", "$name")
_FACTOR: Any = number(0, 64, above=True) | _REFERENCE
_NAMES = Naming(_NAME, "letters, digits and '_', a letter first")


def _count(most: int) -> Any:
    return whole(1, most) | _REFERENCE


_SIZE: Any = Annotated[
    _FACTOR | _INPUT | row(_INPUT, _FACTOR) | row(*[whole(1, MOST_SIDE)] * 2),
    "a factor of the picture's size, an input's name, [input, factor], or [width, height] in texels",
    Brief("number | $name | input | [input, number] | [2 whole numbers]"),
]
_THREADS: Any = Annotated[
    _INPUT | _count(1 << 30) | listed(_count(1 << 30), "whole numbers", 1, 3),
    "a port whose texels are the threads, or 1 to 3 whole numbers",
    Brief("name | [whole number, …]"),
]
_DEFAULT: Any = Annotated[
    bool | NUMBER | TEXT | listed(NUMBER, "numbers", 2, 4),
    "a number, true or false, a word or a list of 2 to 4 numbers",
]
_FORMAT: Any = Annotated[choice(*FORMATS) | _REFERENCE, Brief("format | $name")]

_DOC = Key("doc", TEXT, "What it is, in one line.")
INPUT = Table(
    "an input",
    (
        _DOC,
        Key("semantic", word(_NAME, "a word"), "Meaning of its texels; for a function, its name.", "any"),
        Key("kind", choice("function", "view"), "Kind of an input that is not a texture; by default the sampler's."),
        Key("optional", bool, "It may stay unconnected; `HAS_<NAME>` is then undefined.", False),
        Key("many", bool, "It takes a list of links; the shader sees `name_0`, `name_1`, ….", False),
        Key("size", choice("same", "any"), "Whether it must have the size of the target.", "same"),
        Key("filter", choice(*get_args(Filter)), "How it is filtered.", "nearest"),
        Key("wrap", choice(*get_args(Wrap)), "How it is read outside its edges.", "clamp"),
        Key("anisotropy", whole(1, 16), "Maximum anisotropy of filtering.", 1),
        Key("border", NUMBER | vector(4), "Value outside its edges, with `wrap: border`.", 1),
        Key("group", word(_NAME, "a word"), "Inputs of one group are connected together."),
        Key("rays", bool, "With `semantic: scene_data`: also the BVH for <trace.glsl>.", False),
    ),
)
OUTPUT = Table(
    "an output",
    (
        _DOC,
        Key("semantic", word(_NAME, "a word"), "Meaning of its texels; by default that of `like`, or `any`."),
        Key("like", _INPUT, "An input whose format, size, semantic and view are its defaults."),
        Key("format", _FORMAT, "Format of a texel, such as `r32f`.", "rgba16f"),
        Key("size", _SIZE, "A factor of the picture's size, an input with the same size, or a number of texels.", 1),
        Key("mips", choice("all") | _count(15), "Mip levels.", 1),
        Key("layers", _count(2048), "Array layers.", 1),
        Key("samples", _count(16), "Samples per texel.", 1),
        Key("clear", NUMBER | vector(4), "Value where nothing is written."),
        Key("first", NUMBER, "Value that `@previous` reads in the first frame.", 0),
        Key(
            "kept",
            bool,
            "It is kept from frame to frame, and recomputed only when its inputs or parameters change.",
            False,
        ),
        Key("bytes", _count(1 << 30), "Size of a buffer."),
    ),
)
PARAM = Table(
    "a parameter",
    (
        _DOC,
        Key("default", _DEFAULT, "Its default value; if absent, the initialiser, 0 or the first choice."),
        Key("unit", TEXT, "The unit's symbol."),
        Key("min", NUMBER, "Minimum of each component."),
        Key("max", NUMBER, "Maximum of each component."),
        Key("role", choice("param", "define", "structural"), "A uniform, a macro `NAME`, or a part of the plan."),
        Key("choices", listed(word(_NAME, "a word"), "words", 1), "Its possible words, if it is not a uniform."),
    ),
)
HEADER = Table(
    "a header",
    (
        Key("doc", TEXT, "What the node does: one line, then an empty line and any amount of text."),
        Key("inputs", MapOf(INPUT, _NAMES, "name of an input"), "What it reads.", example="inputs: {color: {doc: …}}"),
        Key("outputs", MapOf(OUTPUT, _NAMES, "name of an output"), "What it makes."),
        Key("params", MapOf(PARAM, _NAMES, "name of a parameter"), "What a pipeline can set."),
        Key("threads", _THREADS, "For a `.comp`: a texture with one texel per thread, or 1 to 3 numbers of threads."),
    ),
)
_CODES = Codes(unknown="RG440", wrong="RG440", name="RG440", file="RG440")


def _checked(document: Document) -> Header:
    validator = Validator(_CODES, document.problems)
    root = document.root
    if root.data is not None:
        root = validator.file(root, HEADER, "doc, inputs, outputs, params") or root.with_data(None)
    given = {key: value for key, value in root.items() if value.data is not None}
    names: dict[str, Value] = {}
    sections: dict[str, dict[str, dict[str, Value]]] = {"inputs": {}, "outputs": {}, "params": {}}
    for section, entries in sections.items():
        for name, entry in given[section].items() if section in given else ():
            if name in names:
                line = names[name].key_place.line
                text = f"'{name}' is also in line {line}; ports and parameters need distinct names"
                validator.report(entry, _CODES.name, text, key=True)
                continue
            names[name] = entry
            entries[name] = {key: value for key, value in entry.items() if value.data is not None}
    doc = str(given["doc"].data).strip() if "doc" in given else None
    threads = given.get("threads")
    return Header(doc, **sections, names=names, threads=threads, problems=tuple(validator.problems))
