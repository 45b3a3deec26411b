"""Python values against their own annotations: whether one fits, and in words what would.

Metadata of an `Annotated` says more than a type can: limits (`Range`, `Length`), words that a table has (`Known`), and
a text that stands for the annotation in messages. `Parameter` has its words for files from here, too.
"""

from __future__ import annotations

import math
import re
import types
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import fields, is_dataclass
from functools import cache, partial, reduce
from inspect import get_annotations
from typing import TYPE_CHECKING, Annotated, Any, Literal, TypeVar, Union, get_args, get_origin, get_type_hints

import msgspec
from msgspec import Struct

from rendergraph.errors import Misuse, Problem, suggestion

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

    T = TypeVar("T", bound=DataclassInstance | Struct)


LARGEST = 3.4028235e38
"""What 32 bits hold of a number; GPUs compute with those."""


class Range(Struct, frozen=True):
    """Limits of a number, which is then finite; `above` leaves `low` itself out."""

    low: float | None = None
    high: float | None = None
    above: bool = False

    def __str__(self) -> str:
        if self.low is None:
            return "" if self.high is None else f" up to {self.high}"
        to = f" to {self.high}" if self.high is not None else "" if self.above else " up"
        return f" above {self.low}{to}" if self.above else f" from {self.low}{to}"

    @property
    def empty(self) -> bool:
        """Whether no number lies inside."""
        return self.low is not None and self.high is not None and self.low > self.high

    def beyond(self, value: float) -> str | None:
        """What a number that lies outside must be; None where it lies inside."""
        if not abs(value) <= LARGEST:
            return f"must be from -{LARGEST} to {LARGEST}" if -math.inf < value < math.inf else "must be finite"
        if self.low is not None and (value < self.low or (self.above and value == self.low)):
            return f"must be {'above' if self.above else 'at least'} {self.low}"
        return f"must be at most {self.high}" if self.high is not None and value > self.high else None

    def holds(self, value: Any) -> bool:
        """Whether a number lies inside."""
        return self.beyond(value) is None


class Length(Struct, frozen=True):
    """How many entries a list or letters a text has; a single value counts as one."""

    low: int
    high: float = math.inf

    def holds(self, value: Any) -> bool:
        """Whether it has as many."""
        return self.low <= (len(value) if isinstance(value, str | Sequence) else 1) <= self.high


class Known(Struct, frozen=True):
    """A word that stands in a table."""

    words: Collection[str]

    def holds(self, value: Any) -> bool:
        """Whether it does."""
        return value in self.words


class Matching(Struct, frozen=True):
    """A text that a regular expression matches from its first letter to its last."""

    pattern: str

    def holds(self, value: Any) -> bool:
        """Whether it does."""
        return re.fullmatch(self.pattern, value) is not None


def fits(value: object, annotation: Any) -> bool:
    """Whether a value is what an annotation says; a float may be written as a whole number, a number is no switch."""
    return test_of(annotation)(value)


@cache
def test_of(annotation: Any) -> Callable[[Any], bool]:
    """What tells whether a value is what an annotation says, for whoever asks often: see `fits`."""
    origin, arguments = get_origin(annotation), get_args(annotation)
    if annotation is Any:
        return lambda value: True
    if annotation is None:
        return lambda value: value is None
    if origin is Annotated:
        rules = [rule.holds for rule in annotation.__metadata__ if not isinstance(rule, str)]
        return reduce(_both, rules, test_of(annotation.__origin__))
    if origin in (Union, types.UnionType):
        return reduce(_either, map(test_of, arguments))
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


def _both(one: Callable[[Any], bool], other: Callable[[Any], bool]) -> Callable[[Any], bool]:
    return lambda value: one(value) and other(value)


def _either(one: Callable[[Any], bool], other: Callable[[Any], bool]) -> Callable[[Any], bool]:
    return lambda value: one(value) or other(value)


@cache
def conversion_to(annotation: Any) -> Callable[[Any], Any]:
    """What makes a value of a file one of an annotation: of a list a tuple, of a whole number a float."""
    origin, arguments = get_origin(annotation), get_args(annotation)
    if origin is Annotated:
        return conversion_to(annotation.__origin__)
    if origin in (Union, types.UnionType):
        parts = [(conversion_to(part), test_of(part)) for part in arguments]
        return lambda value: next((made for convert, test in parts if test(made := convert(value))), value)
    if origin is list or (origin is tuple and Ellipsis in arguments):
        entry = conversion_to(arguments[0])
        return lambda value: origin(map(entry, value)) if isinstance(value, tuple | list) else value
    if origin is tuple:
        entries = [conversion_to(part) for part in arguments]
        return lambda value: (
            tuple(make(part) for make, part in zip(entries, value, strict=True))
            if isinstance(value, tuple | list) and len(value) == len(entries)
            else value
        )
    if annotation is float:
        return lambda value: float(value) if fits(value, int) and abs(value) <= LARGEST else value
    return lambda value: value


def words_for(annotation: Any, limits: Range = Range(), *, file: bool = False) -> str:
    """What an annotation takes, in words: `a whole number from 1 to 64`.

    Args:
        annotation: a type as it is written.
        limits: of each number in it.
        file: what a YAML file may give, instead of a Python value.
    """
    origin, arguments = get_origin(annotation), get_args(annotation)
    if origin is Annotated:
        said = next((rule for rule in annotation.__metadata__ if isinstance(rule, str)), None)
        rules = [rule for rule in annotation.__metadata__ if isinstance(rule, Range)]
        return said or words_for(annotation.__origin__, next(iter(rules), limits), file=file)
    if origin in (Union, types.UnionType):
        parts = [words_for(part, limits, file=file) for part in arguments if not (file and part is types.NoneType)]
        return " or ".join([", ".join(parts[:-1]), parts[-1]] if len(parts) > 1 else parts)
    if origin is Literal:
        listed = ", ".join(map(str, arguments))
        return f"one of {listed}" if len(arguments) > 1 else f"only {listed}"
    if origin in (tuple, list, Sequence):
        first = next(iter(arguments), float)
        if isinstance(first, type) and first not in (bool, int, float, str):
            return f"a tuple of {first.__name__}"
        of = {int: "whole numbers", str: "words"}.get(first, "numbers")
        count = "" if origin is not tuple or Ellipsis in arguments else f"{len(arguments)} "
        return f"a list of {count}{of}" if file else f"{count}{of}"
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
        return "a mapping"
    return f"{'an' if annotation.__name__[0] in 'AEIOU' else 'a'} {annotation.__name__}"


def quoted(value: object) -> str:
    """A Python value as messages show it: as it is written, and not too long; a port by its name."""
    name = getattr(value, "name", "")
    if (is_dataclass(value) or isinstance(value, Struct)) and isinstance(name, str) and name:
        return f"the {type(value).__name__} '{name}'"
    text = repr(value)
    return text if len(text) <= 60 else f"{text[:57]}..."


def mistakes_in(what: str, value: object, annotation: Any, subject: str = "") -> Iterator[Problem]:
    """What is wrong with a value, or with each entry of a mapping.

    Args:
        what: how messages name it.
        value: any.
        annotation: what it should be.
        subject: see `Problem`.
    """
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
    plain = all(get_origin(part) is Literal or part is types.NoneType for part in parts)
    hint = suggestion(word, choices, most=20) if word or plain else ""
    if not hint:
        whole = int in parts and float not in parts and any(isinstance(entry, float) for entry in _entries(value))
        hint = f", not {words_for(annotation)}" + ("; divide with //" if whole else "")
    yield Problem("RG490", f"{what} is {quoted(value)}{hint}", subject=subject)


def mistakes_of(thing: DataclassInstance | Struct, who: str, subject: str = "") -> Iterator[Problem]:
    """What is wrong with the fields of a dataclass or struct.

    Args:
        thing: an instance.
        who: how messages name it, if at all.
        subject: see `Problem`; the field by default.
    """
    kind: Any = type(thing)
    for name, default, hint, _ in _given(kind):
        value = getattr(thing, name)
        if value is not default:
            yield from mistakes_in(f"{who}: {name}" if who else name, value, hint, subject or name)


@cache
def _given(kind: Any) -> tuple[tuple[str, Any, Any, Callable[[Any], bool]], ...]:
    """Names, defaults, annotations and their tests of the fields that its constructor takes."""
    hints: dict[str, Any] = {}
    for base in reversed(kind.__mro__):
        hints |= _annotations_of(base)
    if issubclass(kind, Struct):  # `msgspec.structs.fields` would work all types out once more
        names, defaults = kind.__struct_fields__, kind.__struct_defaults__
        taken = [*zip(names, (*(len(names) - len(defaults)) * [msgspec.NODEFAULT], *defaults), strict=True)]
    else:
        taken = [(entry.name, entry.default) for entry in fields(kind) if entry.init]
    return tuple((name, default, hints[name], test_of(hints[name])) for name, default in taken)


@cache
def _annotations_of(kind: type) -> dict[str, Any]:
    """Of a class alone, which `typing` works out again for each class that inherits them."""
    return get_annotations(kind, eval_str=True)


def right(thing: T, who: str = "") -> T:
    """An instance of a dataclass or struct, all of whose fields are what their annotations say.

    Raises:
        Misuse: one of them is not.
    """
    kind: Any = type(thing)
    for name, default, _, test in _given(kind):
        value = getattr(thing, name)
        if value is not default and not test(value):
            for mistake in mistakes_of(thing, who or type(thing).__name__):
                raise Misuse(mistake.text)
    return thing


def parts_of(annotation: Any) -> Iterator[Any]:
    """What a union is of, without metadata but for words of a table; of a tuple its entries."""
    origin, arguments = get_origin(annotation), get_args(annotation)
    if origin is Annotated and not any(isinstance(rule, Known) for rule in annotation.__metadata__):
        yield from parts_of(annotation.__origin__)
    elif origin in (Union, types.UnionType, tuple, Sequence):
        for part in arguments:
            yield from parts_of(part) if part is not Ellipsis else ()
    else:
        yield annotation


def _choices(part: Any) -> Iterator[str]:
    if get_origin(part) is Literal:
        yield from map(str, get_args(part))
    elif get_origin(part) is Annotated:
        yield from (word for rule in part.__metadata__ if isinstance(rule, Known) for word in rule.words)


def _entries(value: object) -> Sequence[object]:
    return value if isinstance(value, tuple | list) else (value,)


@cache
def may_be(annotation: Any, wanted: type) -> bool:
    """Whether a value of an annotation, or an entry of it, may be an instance of a class."""
    return wanted in (annotation, get_origin(annotation)) or any(may_be(part, wanted) for part in get_args(annotation))


hints_of: Callable[[Any], dict[str, Any]] = cache(partial(get_type_hints, include_extras=True))
"""The annotations of a class or function by name, worked out once."""
