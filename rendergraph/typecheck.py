"""Types as data: values that an annotation accepts, conversion of a file's values, descriptions and JSON Schemas.

Annotations describe ports, steps, parameters and the keys of files. Metadata of an `Annotated` adds to a type: `Range`,
`Length`, `Known` and `Matching` restrict values, a text describes the annotation in messages, `Brief` in tables, and
`Converted` changes a file's value. `msgspec.convert` is not used, because it does not support functions or unions of
several tuples or classes, which ports take.
"""

from __future__ import annotations

import math
import re
import types
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from functools import cache, partial, reduce
from inspect import get_annotations
from typing import Annotated, Any, Literal, TypeAlias, TypeVar, Union, get_args, get_origin, get_type_hints

import msgspec
from msgspec import Struct

from rendergraph.errors import Misuse, Problem, suggestion

T = TypeVar("T", bound=Struct)
Schema: TypeAlias = "dict[str, Any]"

LARGEST = 3.4028235e38
"""The largest 32-bit float, because GPUs compute with these."""
MOST = 1e12
"""Limit of numbers in files: products of a few larger ones exceed single precision. Messages do not mention it."""


class Range(Struct, frozen=True):
    """Limits of a finite number; `above` excludes `low` itself, `infinite` includes infinity."""

    low: float | None = None
    high: float | None = None
    above: bool = False
    infinite: bool = False

    def __str__(self) -> str:
        low, high = self.mentioned
        if low is None:
            return "" if high is None else f" up to {high}"
        to = f" to {high}" if high is not None else "" if self.above else " up"
        return f" above {low}{to}" if self.above else f" from {low}{to}"

    @property
    def mentioned(self) -> tuple[float | None, float | None]:
        """The limits without those of every number in a file."""
        return None if self.low == -MOST else self.low, None if self.high == MOST else self.high

    @property
    def empty(self) -> bool:
        return self.low is not None and self.high is not None and self.low > self.high

    def violation(self, value: float) -> str | None:
        """Return what a number outside the limits must be; None for one inside."""
        if not abs(value) <= LARGEST:
            if value == math.inf and self.infinite:
                return None
            return f"must be from -{LARGEST} to {LARGEST}" if -math.inf < value < math.inf else "must be finite"
        if self.low is not None and (value < self.low or (self.above and value == self.low)):
            return f"must be {'above' if self.above else 'at least'} {self.low}"
        return f"must be at most {self.high}" if self.high is not None and value > self.high else None

    def accepts(self, value: Any) -> bool:
        return self.violation(value) is None

    def schema(self, kind: str) -> Schema:
        low, high = self.mentioned
        found = {"exclusiveMinimum" if self.above else "minimum": low, "maximum": None if self.infinite else high}
        return {key: limit for key, limit in found.items() if limit is not None}


class Length(Struct, frozen=True):
    """Number of entries of a list or of characters of a text; a single value counts as one."""

    low: int
    high: float = math.inf

    def accepts(self, value: Any) -> bool:
        return self.low <= (len(value) if isinstance(value, str | Sequence) else 1) <= self.high

    def schema(self, kind: str) -> Schema:
        least, most = ("minLength", "maxLength") if kind == "string" else ("minItems", "maxItems")
        return {least: self.low, **({most: self.high} if self.high < math.inf else {})}


class Known(Struct, frozen=True):
    """Words of a table."""

    words: Collection[str]

    def accepts(self, value: Any) -> bool:
        return value in self.words

    def schema(self, kind: str) -> Schema:
        return {"enum": list(self.words)}


class Matching(Struct, frozen=True):
    """A text whose beginning a regular expression matches; `\\Z` in it stands for the end of the text."""

    pattern: str | re.Pattern[str]

    def accepts(self, value: Any) -> bool:
        return re.match(self.pattern, value) is not None

    def schema(self, kind: str) -> Schema:
        pattern = self.pattern if isinstance(self.pattern, str) else self.pattern.pattern
        return {"pattern": "^" + pattern.replace("\\Z", "$")}


class Brief(Struct, frozen=True):
    """The name of a type in tables."""

    text: str


class Converted(Struct, frozen=True):
    """A function that converts an accepted value of a file."""

    by: Callable[[Any], Any]


class JsonSchema(Struct, frozen=True):
    """A function that returns the JSON Schema, if the type's own is not enough for editors."""

    make: Callable[[], Schema]


def _rules(annotation: Any, *kinds: Any) -> list[Any]:
    return [rule for rule in annotation.__metadata__ if isinstance(rule, kinds)]


# --- which values fit ------------------------------------------------------------------------------------------------


def fits(value: object, annotation: Any) -> bool:
    """Return whether an annotation accepts a value; a float may be written as an integer, a bool is not a number."""
    return test_of(annotation)(value)


@cache
def test_of(annotation: Any) -> Callable[[Any], bool]:
    """Return a function that tests whether an annotation accepts a value, for repeated use; see `fits`."""
    origin, arguments = get_origin(annotation), get_args(annotation)
    if annotation is Any:
        return lambda value: True
    if annotation is None:
        return lambda value: value is None
    if origin is Annotated:
        tests = [test_of(annotation.__origin__)]
        tests += [rule.accepts for rule in _rules(annotation, Range, Length, Known, Matching)]
        return tests[0] if len(tests) == 1 else lambda value: all(test(value) for test in tests)
    if origin in (Union, types.UnionType):
        tests = [test_of(part) for part in arguments]
        return lambda value: any(test(value) for test in tests)
    if origin is Literal:
        return lambda value: any(type(value) is type(choice) and value == choice for choice in arguments)
    if origin is tuple and Ellipsis not in arguments:
        tests = [test_of(part) for part in arguments]
        return lambda value: (
            isinstance(value, tuple)
            and len(value) == len(tests)
            and all(test(entry) for test, entry in zip(tests, value, strict=True))
        )
    if origin in (tuple, list, Sequence):
        entries = test_of(arguments[0])
        return lambda value: isinstance(value, tuple | list | range) and all(map(entries, value))
    if origin in (dict, Mapping):
        keys, entries = map(test_of, arguments)
        return lambda value: isinstance(value, Mapping) and all(keys(k) and entries(v) for k, v in value.items())
    if Callable in (origin, annotation):
        return callable
    if annotation in (int, float):
        kinds = (int,) if annotation is int else (int, float)
        return lambda value: isinstance(value, kinds) and not isinstance(value, bool)
    kind = origin or annotation
    return lambda value: isinstance(value, kind)


@cache
def conversion_to(annotation: Any) -> Callable[[Any], Any]:
    """Return a function that converts a file's value to an annotation: a list to a tuple, an integer to a float."""
    origin, arguments = get_origin(annotation), get_args(annotation)
    if origin is Annotated:
        steps = [conversion_to(annotation.__origin__), *(rule.by for rule in _rules(annotation, Converted))]
        return steps[0] if len(steps) == 1 else lambda value: reduce(lambda found, step: step(found), steps, value)
    if origin in (Union, types.UnionType):
        parts = [(conversion_to(part), test_of(part)) for part in arguments]
        return lambda value: next((found for convert, test in parts if test(found := convert(value))), value)
    if origin is list or (origin is tuple and Ellipsis in arguments):
        entry = conversion_to(arguments[0])
        return lambda value: origin(map(entry, value)) if isinstance(value, tuple | list) else value
    if origin is tuple:
        entries = [conversion_to(part) for part in arguments]
        return lambda value: (
            tuple(convert(part) for convert, part in zip(entries, value, strict=True))
            if isinstance(value, tuple | list) and len(value) == len(entries)
            else value
        )
    if annotation is float:
        return lambda value: float(value) if fits(value, int) and abs(value) <= LARGEST else value
    return lambda value: value


# --- words and schema ------------------------------------------------------------------------------------------------

_NOUNS = {int: "whole numbers", str: "words", float: "numbers"}
_BRIEF = {bool: "true | false", float: "number", int: "whole number", str: "text", types.NoneType: "null"}
_JSON = {bool: "boolean", int: "integer", float: "number", str: "string", types.NoneType: "null"}


def words_for(annotation: Any, limits: Range = Range(), *, file: bool = False) -> str:
    """Return a description of what an annotation accepts, with limits: `a whole number from 1 to 64`.

    `file` describes values in a YAML file, instead of Python values.
    """
    origin, arguments = get_origin(annotation), get_args(annotation)
    if origin is Annotated:
        limits = next(iter(_rules(annotation, Range)), limits)
        text = next(iter(_rules(annotation, str)), None)
        return text or words_for(annotation.__origin__, limits, file=file)
    if origin in (Union, types.UnionType):
        parts = [words_for(part, limits, file=file) for part in arguments if not (file and part is types.NoneType)]
        return " or ".join([", ".join(parts[:-1]), parts[-1]] if len(parts) > 1 else parts)
    if origin is Literal:
        listed = ", ".join(map(str, arguments))
        return f"one of {listed}" if len(arguments) > 1 else f"only {listed}"
    if origin in (tuple, list, Sequence):
        return _row_words(origin, arguments or (float,), file)
    if Callable in (origin, annotation):
        return "a function"
    if annotation in (int, float):
        return f"{'a whole number' if annotation is int else 'a number'}{limits}"
    if annotation in (None, types.NoneType):
        return "None"
    if annotation is bool:
        return "true or false" if file else "True or False"
    if annotation is str:
        return "text"
    if file or origin is Mapping or not isinstance(annotation, type):
        return "a value" if annotation is Any else "a mapping"
    return f"{'an' if annotation.__name__[0] in 'AEIOU' else 'a'} {annotation.__name__}"


def _row_words(origin: Any, arguments: tuple[Any, ...], file: bool) -> str:
    several = origin is not tuple or Ellipsis in arguments
    first = arguments[0]
    if not several and len(set(arguments)) > 1:
        return f"a list of {', '.join(words_for(part, file=file) for part in arguments)}"
    leaf = first.__origin__ if get_origin(first) is Annotated else first
    if isinstance(leaf, type) and leaf not in (bool, int, float, str):
        return f"a tuple of {leaf.__name__}"
    limits = next(iter(_rules(first, Range)), "") if leaf is not first else ""
    text = f"{'' if several else f'{len(arguments)} '}{_NOUNS.get(leaf, 'numbers')}{limits}"
    return f"a list of {text}" if file else text


def brief(annotation: Any) -> str:
    """Return a type's name for tables: `number`, `[3 numbers]`, `neutral | aces`."""
    origin, arguments = get_origin(annotation), get_args(annotation)
    if origin is Annotated:
        return next((rule.text for rule in _rules(annotation, Brief)), "") or brief(annotation.__origin__)
    if origin is Literal:
        return " | ".join(map(str, arguments))
    if origin in (Union, types.UnionType):
        return " | ".join(dict.fromkeys(map(brief, arguments)))
    if origin is list or (origin is tuple and Ellipsis in arguments):
        return f"[{brief(arguments[0])}, …]"
    if origin is tuple:
        parts = [brief(part) for part in arguments]
        return f"[{len(parts)} {parts[0]}s]" if {*parts} <= {"number", "whole number"} else f"[{', '.join(parts)}]"
    if annotation is Any:
        return "any value"
    return _BRIEF.get(annotation, getattr(annotation, "__name__", str(annotation)))


def json_schema(annotation: Any) -> Schema:
    """Return the JSON Schema (draft 07, which editors support) of a file's values; any value for other types."""
    origin, arguments = get_origin(annotation), get_args(annotation)
    if origin is Annotated:
        if given := _rules(annotation, JsonSchema):
            own: Schema = given[0].make()
            return own
        found = json_schema(annotation.__origin__)
        for rule in _rules(annotation, Range, Length, Known, Matching):
            found |= rule.schema(found.get("type", ""))
        return found
    if origin in (Union, types.UnionType):
        return {"anyOf": [json_schema(part) for part in arguments]}
    if origin is Literal and len(arguments) == 1:
        return {"const": arguments[0]}
    if origin is Literal:
        kinds = {type(choice) for choice in arguments}
        return {"enum": list(arguments), **({"type": _JSON[kinds.pop()]} if len(kinds) == 1 else {})}
    if origin is list or (origin is tuple and Ellipsis in arguments):
        return {"type": "array", "items": json_schema(arguments[0])}
    if origin is tuple:
        parts = [json_schema(part) for part in arguments]
        return {"type": "array", "items": parts, "minItems": len(parts), "maxItems": len(parts)}
    return {"type": _JSON[annotation]} if annotation in _JSON else {}


def hint_for(value: object, annotation: Any) -> str:
    """Return a suggestion for a file's value that does not fit, as the end of a message."""
    parts = list(parts_of(annotation))
    if isinstance(value, str):
        return suggestion(value, [choice for part in parts for choice in _choices(part)], most=0)
    numbers: list[Any] = [entry for entry in _entries(value) if fits(entry, float)]
    is_too_large = any(abs(entry) > MOST for entry in numbers) and len(numbers) == len(_entries(value))
    return f"; the largest number is {MOST:.3g}" if is_too_large and float in parts else ""


# --- what is wrong with Python values --------------------------------------------------------------------------------


def quoted(value: object) -> str:
    """Return a Python value for a message, shortened; a port by its name."""
    name = getattr(value, "name", "")
    if isinstance(value, Struct) and isinstance(name, str) and name:
        return f"the {type(value).__name__} '{name}'"
    text = repr(value)
    return text if len(text) <= 60 else f"{text[:57]}..."


def mistakes_in(what: str, value: object, annotation: Any, subject: str = "") -> Iterator[Problem]:
    """Yield the mistakes in a value, or in each entry of a mapping; messages name it `what`."""
    if fits(value, annotation):
        return
    parts = list(parts_of(annotation))
    table = next((get_args(part) for part in parts if get_origin(part) is Mapping), None)
    if table is not None and isinstance(value, Mapping):
        for key, entry in value.items():
            if not fits(key, table[0]):
                text = f"{what} has the key {key!r}, which is not {words_for(table[0])}"
                yield Problem("RG490", text, subject=subject)
            yield from mistakes_in(f"{what}[{key!r}]", entry, table[1], subject)
        return
    if get_origin(annotation) is tuple and Ellipsis in get_args(annotation) and isinstance(value, tuple):
        for number, entry in enumerate(value):
            yield from mistakes_in(f"{what}[{number}]", entry, parts[0], subject)
        return
    word = value if isinstance(value, str) else ""
    choices = [choice for part in parts for choice in _choices(part)]
    only_words = all(get_origin(part) is Literal or part is types.NoneType for part in parts)
    hint = suggestion(word, choices, most=20) if word or only_words else ""
    if not hint:
        is_fraction = int in parts and float not in parts and any(isinstance(entry, float) for entry in _entries(value))
        hint = f", not {words_for(annotation)}" + ("; divide with //" if is_fraction else "")
    yield Problem("RG490", f"{what} is {quoted(value)}{hint}", subject=subject)


def mistakes_of(thing: Struct, who: str, subject: str = "") -> Iterator[Problem]:
    """Yield the mistakes in the fields of a struct; messages name it `who`, the default subject is the field."""
    for name, default, hint, _ in _fields(type(thing)):
        value = getattr(thing, name)
        if value is not default:
            yield from mistakes_in(f"{who}: {name}" if who else name, value, hint, subject or name)


@cache
def _fields(kind: type[Struct]) -> tuple[tuple[str, Any, Any, Callable[[Any], bool]], ...]:
    """Return names, defaults, annotations and their tests; `msgspec.structs.fields` would resolve all types again."""
    hints: dict[str, Any] = {}
    for base in reversed(kind.__mro__):
        hints |= _annotations_of(base)
    names, defaults = kind.__struct_fields__, kind.__struct_defaults__
    defaults = (*(len(names) - len(defaults)) * [msgspec.NODEFAULT], *defaults)
    types = [hints[name] for name in names]
    return tuple(zip(names, defaults, types, map(test_of, types), strict=True))


def validated(thing: T, who: str = "") -> T:
    """Return a struct whose fields all fit their annotations; raise `Misuse` if one does not."""
    for name, default, _, test in _fields(type(thing)):
        value = getattr(thing, name)
        if value is not default and not test(value):
            for mistake in mistakes_of(thing, who or type(thing).__name__):
                raise Misuse(mistake.text)
    return thing


def parts_of(annotation: Any) -> Iterator[Any]:
    """Yield the members of a union and the entries of a tuple, without metadata except `Known`."""
    origin, arguments = get_origin(annotation), get_args(annotation)
    if origin is Annotated and not _rules(annotation, Known):
        yield from parts_of(annotation.__origin__)
    elif origin in (Union, types.UnionType, tuple, Sequence):
        for part in arguments:
            yield from parts_of(part) if part is not Ellipsis else ()
    else:
        yield annotation


def is_numeric(annotation: Any) -> bool:
    """Return whether an annotation accepts only numbers and tuples of numbers, which can be interpolated."""
    return all(part is float for part in parts_of(annotation))


def _choices(part: Any) -> Iterator[str]:
    if get_origin(part) is Literal:
        yield from map(str, get_args(part))
    elif get_origin(part) is Annotated:
        yield from (word for rule in _rules(part, Known) for word in rule.words)


def _entries(value: object) -> Sequence[object]:
    return value if isinstance(value, tuple | list) else (value,)


@cache
def accepts(annotation: Any, kind: type) -> bool:
    """Return whether an annotation, or an entry of it, accepts instances of a class."""
    return kind in (annotation, get_origin(annotation)) or any(accepts(part, kind) for part in get_args(annotation))


_annotations_of = cache(partial(get_annotations, eval_str=True))  # `typing` resolves a base's again for each subclass
hints_of: Callable[[Any], dict[str, Any]] = cache(partial(get_type_hints, include_extras=True))
"""Returns the annotations of a class or function by name; cached."""
