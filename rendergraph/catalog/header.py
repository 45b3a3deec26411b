"""The YAML header of a shader file, each value with its place; and the parameters that it and the text declare."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence, Set
from pathlib import Path
from typing import Annotated, Any, Literal, get_args

from msgspec import Struct, field
from msgspec.structs import replace

from rendergraph.declare import Parameter
from rendergraph.document import Document, Value, parse
from rendergraph.errors import InputError, Place, Problem, suggestion
from rendergraph.glsl.globals import Global, literal
from rendergraph.keys import Codes, Key, MapOf, Naming, Table, Validator
from rendergraph.keys.values import NUMBER, TEXT, choice, listed, number, row, vector, whole, word
from rendergraph.textures import FORMATS, MOST_SIDE, Filter, Wrap
from rendergraph.typecheck import Brief, Range, fits, words_for

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


# --- parameters -------------------------------------------------------------------------------------------------------

_SCALAR: dict[str, type] = {"float": float, "int": int, "uint": int, "bool": bool}
_VECTOR = re.compile(r"([iu]?)vec([234])\Z")
Report = Callable[[str, str, "Value | None"], None]


def is_parameter(found: Global) -> bool:
    """Whether a declaration may be a parameter: a number, a switch or a vector."""
    return found.storage == "uniform" and (found.type in _SCALAR or _VECTOR.match(found.type) is not None)


class ParameterReader(Struct, eq=False):
    """Reads a parameter from the header's keys, the entry's value and the declaration.

    `report` receives code, text and the wrong value of the header, None for the declaration.
    """

    name: str
    entry: Mapping[str, Value]
    named: Value | None
    found: Global | None
    report: Report
    lacks_range: bool = False

    def parameter(self, uniforms: Sequence[str], words: Callable[[], Set[str]]) -> Parameter | None:
        """Return the parameter; None if it is wrong."""
        found, entry = self.found, self.entry
        role: Any = self._text("role") or ("param" if found is not None else "define")
        if mismatch := self._mismatch(role, uniforms, words):
            if self.named is not None:
                self.report("RG444", mismatch, self.named)
            return None
        if found is not None and (found.array or not is_parameter(found)):
            what = f"an array of {found.type}" if found.array else found.type
            kinds = "bool, int, uint, float and their vectors can be"
            self.report("RG441", f"'{self.name}' is {what}, which is not a parameter; {kinds}", None)
            return None
        typed = self._of_uniform(found) if found is not None else self._of_header()
        if typed is None:
            return None
        annotation, default = typed
        low, high = self._limit("min"), self._limit("max")
        if low is None and found is not None and found.type.startswith("u"):
            low = 0
        self._check_range(Range(low, high), default)
        self.lacks_range = not {"min", "max", "choices"} & entry.keys() and annotation is not bool
        return Parameter(role, default, self._text("doc"), self._text("unit"), Range(low, high), type=annotation)

    def _text(self, key: str) -> str:
        return str(self.entry[key].data) if key in self.entry else ""

    def _limit(self, key: str) -> float | None:
        data = self.entry[key].data if key in self.entry else None
        return data if isinstance(data, int | float) else None

    def _mismatch(self, role: str, uniforms: Sequence[str], words: Callable[[], Set[str]]) -> str:
        """Return how header and declaration disagree; empty if they agree."""
        found, name = self.found, self.name
        if found is not None:
            if role == "param" and found.storage == "uniform":
                return ""
            what = f"'{found.storage} {found.type} {name};'" + (f", not a {role}" if role != "param" else "")
            return f"the header has parameter '{name}', which the shader declares as {what}"
        if role == "param":
            text = f"the header has parameter '{name}', but the shader declares no 'uniform float {name};'"
        elif "role" not in self.entry and words().isdisjoint(self._macros()):
            text = f"the header has parameter '{name}', but the shader has neither 'uniform float {name};' nor "
            text += f"{name.upper()}, as which it would be compiled in"
        else:
            return ""
        return text + suggestion(name, uniforms)

    def _macros(self) -> list[str]:
        choices = self.entry["choices"].plain() if "choices" in self.entry else []
        names = [self.name, *(f"{self.name}_{choice}" for choice in choices)]
        return [name.upper().replace("-", "_") for name in names]

    def _of_uniform(self, found: Global) -> tuple[Any, Any]:
        """Return type and default of a uniform: the header's default, else its initialiser, else 0."""
        match = _VECTOR.match(found.type)
        kind: type = (int if match[1] else float) if match else _SCALAR[found.type]
        count = int(match[2]) if match else 1
        given, value = self.entry.get("default"), kind(0)
        if "choices" in self.entry:
            text = f"'{self.name}' is a uniform; choices are for parameters with the role define or structural"
            self.report("RG444", text, self.entry["choices"])
        if given is not None:
            value = given.plain()
        elif found.initialiser:
            try:
                value = literal(found.initialiser)
            except ValueError as error:
                text = f"the initialiser of '{self.name}': {error}; write a number, or give its default in the header"
                self.report("RG442", text, None)
        numbers = list(value) if isinstance(value, list | tuple) else [value] * count
        if len(numbers) != count or not all(fits(one, kind) and Range().accepts(one) for one in numbers):
            expected = f"{count} numbers" if match else words_for(kind, file=True)
            text = f"the default of '{self.name}' ({found.type}): expected {expected}, got {_text(value)}"
            self.report("RG442", text, given)
            numbers = [kind(0)] * count
        converted = tuple(map(kind, numbers))
        if match:
            return tuple[(kind,) * count], converted  # type: ignore[misc]  # made at run time
        return kind, converted[0]

    def _of_header(self) -> tuple[Any, Any] | None:
        """Return type and default of a parameter that is not a uniform; None if they are wrong."""
        default = self.entry["default"].plain() if "default" in self.entry else None
        if "choices" in self.entry:
            choices = tuple(map(str, self.entry["choices"].plain()))
            if default is not None and default not in choices:
                text = f"the default of '{self.name}': expected one of {', '.join(choices)}, got {_text(default)}"
                self.report("RG442", text, self.entry["default"])
                default = None
            return Literal[choices], choices[0] if default is None else default
        if isinstance(default, bool | int | float):
            return type(default), default
        if self.named is not None:
            needs = "it needs choices, or a default that is a number or a switch"
            self.report("RG444", f"'{self.name}' is not a uniform of the shader; {needs}", self.named)
        return None

    def _check_range(self, limits: Range, default: Any) -> None:
        if limits.empty:
            text = f"'{self.name}' has a min of {limits.low:g} above its max of {limits.high:g}"
            self.report("RG442", text, self.entry.get("min"))
            return
        for value in default if isinstance(default, tuple) else (default,):
            if fits(value, float) and not limits.accepts(value):
                where = next((self.entry[key] for key in ("default", "min", "max") if key in self.entry), None)
                self.report("RG442", f"the default of '{self.name}' is {value:g}, outside its range", where)
                return


def _text(value: object) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    return f"'{value}'" if isinstance(value, str) else str(list(value) if isinstance(value, tuple) else value)
