"""The one checker of Python values: what fits an annotation, and what is said where a value does not."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Annotated, Any, Literal, TypeAlias

import pytest
from msgspec import Struct
from msgspec.structs import force_setattr

from rendergraph.errors import Misuse
from rendergraph.typecheck import (
    Brief,
    Known,
    Length,
    Matching,
    Range,
    brief,
    conversion_to,
    fits,
    mistakes_in,
    mistakes_of,
    validated,
    words_for,
)

Count: TypeAlias = Annotated[int, Range(0)]
Factor: TypeAlias = Annotated[float, Range(0, above=True)]
Texel: TypeAlias = Annotated[float | tuple[float, ...], Length(1, 4)]
FormatName: TypeAlias = Annotated[str, Known(("r8", "rgba8")), "a format"]
Perhaps: TypeAlias = Count | None
PerhapsFormat: TypeAlias = FormatName | None
Side: TypeAlias = Literal["left", "right"]

FITS: list[tuple[Any, list[object], list[object]]] = [
    (Any, [None, object()], []),
    (None, [None], [0, False]),
    (bool, [True, False], [0, 1, "true"]),
    (int, [0, -3], [True, 1.0, "1"]),
    (float, [0, 1.5, float("nan")], [False, "1.5"]),
    (str, ["", "a"], [b"a", 1]),
    (int | None, [1, None], [False, 0.5]),
    (Side, ["left"], ["up", 0, None]),
    (Literal[1, 2], [1], [True, 1.0, 3]),
    (Side | Callable[[Any], Side], ["right", len], ["lef", 1]),
    (tuple[int, int], [(1, 2)], [(1,), (1, 2, 3), [1, 2], (1, 2.0)]),
    (tuple[int, ...], [(), (1, 2), [1]], [("a",), 1, "12"]),
    (list[int], [[], [1]], [["a"], 1]),
    (dict[str, int], [{"a": 1}], [{"a": "b"}, []]),
    (set[int], [{1}], [[1]]),
    (Sequence[str], [["a"], ("a", "b")], ["ab", {"a"}]),
    (Mapping[str, int], [{}, {"a": 1}], [{1: 1}, {"a": "b"}, [("a", 1)]]),
    (Count, [0, 7], [-1, 0.5, True]),
    (Factor, [0.5, 3], [0, -1, float("inf"), float("nan")]),
    (Annotated[int, Range(1, 16)], [1, 16], [0, 17]),
    (Texel, [0, (1, 2), (0.5,) * 4], [(), (1,) * 5, "a"]),
    (Annotated[str, Known(("r8", "rg8"))], ["r8"], ["r9", 8]),
    (Annotated[str, Matching(r"[a-z]+\Z")], ["ab"], ["ab\n", "A", 1]),
    (Range, [Range()], [Range, 1]),
]


@pytest.mark.parametrize(("annotation", "right_ones", "wrong_ones"), FITS)
def test_what_fits(annotation: Any, right_ones: list[object], wrong_ones: list[object]) -> None:
    assert [value for value in right_ones if not fits(value, annotation)] == []
    assert [value for value in wrong_ones if fits(value, annotation)] == []
    assert all(list(mistakes_in("it", value, annotation)) == [] for value in right_ones)
    assert all(list(mistakes_in("it", value, annotation)) for value in wrong_ones)


CONVERTED: list[tuple[Any, object, object]] = [
    (float, 2, 2.0),
    (float, True, True),
    (float, 10**400, 10**400),
    (int, 2.0, 2.0),
    (Count, 2, 2),
    (int | float, 2, 2),
    (float | tuple[float, float], 2, 2.0),
    (float | tuple[float, float], [1, 2], (1.0, 2.0)),
    (float | tuple[float, float], [1, 2, 3], [1, 2, 3]),
    (tuple[float, ...], [1, 2, 3], (1.0, 2.0, 3.0)),
    (tuple[tuple[int, int], ...], [[1, 2], [3, 4]], ((1, 2), (3, 4))),
    (list[float], [1, 2], [1.0, 2.0]),
    (str | list[str], ["a"], ["a"]),
    (Side | tuple[Side, ...], ["left"], ("left",)),
]


@pytest.mark.parametrize(("annotation", "value", "made"), CONVERTED)
def test_what_a_file_means(annotation: Any, value: object, made: object) -> None:
    assert repr(conversion_to(annotation)(value)) == repr(made)


BEYOND: list[tuple[Range, float, str | None]] = [
    (Range(0, 4), 4, None),
    (Range(0, 4), -1, "must be at least 0"),
    (Range(0, 4), 4.5, "must be at most 4"),
    (Range(0, above=True), 0, "must be above 0"),
    (Range(), 10**400, "must be from -3.4028235e+38 to 3.4028235e+38"),
    (Range(), float("nan"), "must be finite"),
    (Range(), 1e39, "must be from -3.4028235e+38 to 3.4028235e+38"),
    (Range(high=4), float("-inf"), "must be finite"),
]


@pytest.mark.parametrize(("limits", "value", "said"), BEYOND)
def test_limits_of_a_number(limits: Range, value: float, said: str | None) -> None:
    assert (limits.violation(value), limits.accepts(value)) == (said, said is None)


SAID: list[tuple[object, Any, str]] = [
    ("yes", bool, "it is 'yes', not True or False"),
    (-1, Count, "it is -1, not a whole number from 0 up"),
    (1.5, Perhaps, "it is 1.5, not a whole number from 0 up or None; divide with //"),
    (0, Factor, "it is 0, not a number above 0"),
    (300, Annotated[int, Range(0, 255)], "it is 300, not a whole number from 0 to 255"),
    ("lef", Side, "it is 'lef'; did you mean 'left'?"),
    (3, Side, "it is 3; available: left, right"),
    ("lef", Side | Callable[[], Side], "it is 'lef'; did you mean 'left'?"),
    (3, Side | Callable[[], Side], "it is 3, not one of left, right or a function"),
    ("rgb8", PerhapsFormat, "it is 'rgb8'; did you mean 'rgba8'?"),
    (8, PerhapsFormat, "it is 8, not a format or None"),
    ("x" * 99, int, f"it is '{'x' * 56}..., not a whole number"),
    (
        {"a": {"b": 1, "c": 2.5}},
        Mapping[str, Mapping[str, int]],
        "it['a']['c'] is 2.5, not a whole number; divide with //",
    ),
    ({1: 2}, Mapping[str, int], "it has the key 1, which is not text"),
    ((Range(), 3), tuple[Range, ...], "it[1] is 3, not a Range"),
]


@pytest.mark.parametrize(("value", "annotation", "said"), SAID)
def test_what_is_said(value: object, annotation: Any, said: str) -> None:
    (mistake,) = mistakes_in("it", value, annotation, "subject")
    assert (mistake.subject, mistake.text) == ("subject", said)


BRIEF: list[tuple[Any, str]] = [
    (int | None, "whole number | null"),
    (tuple[float, ...], "[number, …]"),
    (tuple[float, float], "[2 numbers]"),
    (tuple[str, float], "[text, number]"),
    (str | list[str], "text | [text, …]"),
    (Annotated[str, Brief("name")] | Side, "name | left | right"),
    (Any, "any value"),
]


@pytest.mark.parametrize(("annotation", "text"), BRIEF)
def test_a_type_in_a_table(annotation: Any, text: str) -> None:
    assert brief(annotation) == text


def test_a_file_gives_other_values_than_python() -> None:
    annotation = bool | tuple[float, float, float] | None
    assert words_for(annotation) == "True or False, 3 numbers or None"
    assert words_for(annotation, file=True) == "true or false or a list of 3 numbers"


class Lens(Struct, frozen=True):
    """Something with fields."""

    side: Side
    count: Count = 1

    def __post_init__(self) -> None:
        validated(self)


def test_a_struct_refuses_what_its_fields_do_not_say() -> None:
    assert validated(Lens("left"), "a lens") == Lens("left")
    with pytest.raises(Misuse, match=r"^Lens: count is -1, not a whole number from 0 up$"):
        Lens("left", -1)
    wrong = Lens("left")
    force_setattr(wrong, "side", 7)
    force_setattr(wrong, "count", None)
    assert [mistake.subject for mistake in mistakes_of(wrong, "a lens")] == ["side", "count"]
