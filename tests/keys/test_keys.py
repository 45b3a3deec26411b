"""The grammar of the files we read: what tables say, and that the schema made of them says the same."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import pytest

from rendergraph.document import Source, Value, from_plain, parse
from rendergraph.errors import InputError
from rendergraph.keys import Codes, Key, MapOf, Naming, Recursive, Table, Validator, as_markdown, file_schema, plain
from rendergraph.keys import schema as schema_of
from rendergraph.keys.values import TEXT, choice, color, listed, number, scale, vector, version, whole
from rendergraph.reference import FILE_KINDS, table_of
from rendergraph.resources import shipped_scenes
from rendergraph.typecheck import conversion_to, fits, words_for

CODES = Codes("UNKNOWN", "WRONG", "NAME", "FILE")
LAMP = Table(
    "lamp '{}'",
    (
        Key("power", number(0, above=True), "How bright.", 1.0, "W"),
        Key("kind", choice("round", "square", "long"), "Its shape.", required=True, example="kind: round"),
        Key("color", color(1, alpha=True), "Its colour."),
        Key("size", scale(), "Its size."),
    ),
)
BOX = Table(
    "box '{}'",
    (Key("at", vector(), "Where."), Key("shape", choice("cube", "ball"), "Which."), Key("file", TEXT, "Or its file.")),
    {
        "shape": {"cube": (Key("side", number(), "Edge."),), "ball": (Key("radius", number(), "Radius."),)},
        "file": (Key("page", whole(1, 9), "Which."),),
    },
)
ROOM: Table = Table(
    "a room",
    (
        Key("room", version(1), "Version.", code="VERSION"),
        Key("lamps", MapOf(LAMP, Naming(re.compile(r"[a-z]+\Z"), "small letters"), "lamp"), "Lamps."),
        Key("boxes", MapOf(BOX, refused={"self": "a box cannot be called 'self'"}), "Boxes."),
        Key("tags", listed(TEXT, "tags", 1, 3), "Words.", example="tags: [old]"),
        Key("lists", MapOf(listed(Any, "values"), null=False, least=1), "Lists."),
        Key("inner", Recursive(TEXT, lambda: ROOM), "Another room, or its file."),
        Key("open", bool, "Whether."),
    ),
    refused={"door": "a room has no door, say open: true"},
    code="TOP",
)


def validate(text: str) -> tuple[Value | None, Validator]:
    document = parse(text, keep_going=True)
    validator = Validator(CODES, document.problems)
    return validator.file(document.root, ROOM, "`lamps`"), validator


def messages(text: str) -> list[str]:
    return [f"{p.place.line}:{p.place.column} {p.code} {p.message}" for p in validate(text)[1].problems if p.place]


def test_what_is_right_stays_and_means_something() -> None:
    text = """
room: 1
lamps: {a: {kind: round, power: 2, color: [1, 0, 0], size: 2}, b: {kind: long, size: [1, 2, 3], color: null}}
boxes: {c: {shape: cube, side: 3}, d: {file: x.obj, page: 2, at: [0, 0, 1]}}
inner: {room: 1, inner: there.yaml}
lists: {x: [1, null]}
"""
    root, validator = validate(text)
    assert not validator.problems
    assert root is not None
    assert plain(root, ROOM) == {
        "room": 1,
        "lamps": {
            "a": {"kind": "round", "power": 2.0, "color": (1.0, 0.0, 0.0, 1.0), "size": (2.0, 2.0, 2.0)},
            "b": {"kind": "long", "size": (1.0, 2.0, 3.0)},
        },
        "boxes": {"c": {"shape": "cube", "side": 3.0}, "d": {"file": "x.obj", "page": 2, "at": (0.0, 0.0, 1.0)}},
        "inner": {"room": 1, "inner": "there.yaml"},
        "lists": {"x": [1, None]},
    }


WRONG = {
    "- 1": "1:1 FILE expected a room, a mapping with `lamps`, got a list",
    "rooms: 1": "1:1 TOP a room has no key 'rooms'; did you mean 'room'?",
    "door: 1": "1:1 TOP a room has no door, say open: true",
    "room: 2": "1:7 VERSION 'room': expected 1, the version of the format that this program reads, got 2",
    "room: true": "1:7 VERSION 'room': expected 1, the version of the format that this program reads, got true",
    "open: yes": "1:7 WRONG 'open': expected true or false, got 'yes'",
    "lamps: 3": "1:8 WRONG 'lamps': expected a mapping, got 3",
    "lamps: {A: {kind: long}}": "1:9 NAME 'A' is not a lamp; use small letters",
    "lamps: {a: 3}": "1:12 WRONG 'a': expected a mapping, got 3",
    "lamps: {a: }": "1:9 WRONG lamp 'a' needs 'kind'; add kind: round",
    "lamps: {a: {kind: null}}": "1:9 WRONG lamp 'a' needs 'kind'; add kind: round",
    "lamps: {a: {kind: log}}": "1:19 WRONG 'kind': expected one of round, square, long, as in kind: round, got 'log'; did you mean 'long'?",
    "lamps: {a: {kind: long, pwr: 1}}": "1:25 UNKNOWN lamp 'a' has no key 'pwr'; did you mean 'power'?",
    "lamps: {a: {kind: long, power: 0}}": "1:32 WRONG 'power': expected a number above 0, got 0",
    "lamps: {a: {kind: long, color: [1, 2, 0]}}": "1:32 WRONG 'color': expected a number or a list of 3 or 4 numbers from 0 to 1, got [1, 2, 0]",
    "lamps: {a: {kind: long, size: [1, 2]}}": "1:31 WRONG 'size': expected a number or a list of 3 numbers, got [1, 2]",
    "boxes: {a: {}}": "1:9 WRONG box 'a' needs either 'shape' or 'file'",
    "boxes: {a: {shape: cube, file: x}}": "1:9 WRONG box 'a' needs either 'shape' or 'file'",
    "boxes: {a: {shape: cube, radius: 1}}": "1:26 UNKNOWN box 'a' has no key 'radius'; available: at, file, shape, side",
    "boxes: {self: {shape: cube}}": "1:9 NAME a box cannot be called 'self'",
    "boxes: {a: {shape: cube, at: [1, .nan, 1]}}": "1:30 WRONG 'at': expected a list of 3 numbers, got [1, nan, 1]",
    "tags: []": "1:7 WRONG 'tags': expected a list of tags, as in tags: [old], got []",
    "tags: [a, b, c, d]": "1:7 WRONG 'tags': expected a list of tags, as in tags: [old], got ['a', 'b', 'c', 'd']",
    "tags: [' ']": "1:7 WRONG 'tags': expected a list of tags, as in tags: [old], got [' ']",
    "lists: {}": "1:8 WRONG 'lists': expected a mapping, got a mapping",
    "lists: {x: null}": "1:12 WRONG 'x': expected a list of values, got null",
    "inner: {tags: 1}": "1:15 WRONG 'tags': expected a list of tags, as in tags: [old], got 1",
    "inner: 3": "1:8 WRONG 'inner': expected text, got 3",
    "tags: [old, very old, and so on]\n? a key, which is none\n": "2:3 TOP 'a key, which is none' is read as a key; put text with "
    "a comma in quotes within {…}",
}


@pytest.mark.parametrize("text", WRONG)
def test_a_mistake_is_told_at_its_place(text: str) -> None:
    assert messages(text) == [WRONG[text]]


def test_what_is_left_out_is_remembered() -> None:
    root, validator = validate("lamps: {a: {kind: lng, power: 1}, B: {}}\ntags: 1\nopen: *nowhere\n")
    assert root is not None
    assert root.plain() == {"lamps": {"a": {"power": 1}}}
    assert validator.dropped == {("lamps", "a", "kind"), ("lamps", "B"), ("tags",), ("open",)}
    assert [problem.code for problem in validator.problems] == ["RG006", "WRONG", "NAME", "WRONG"]


def test_nobody_reads_a_thousand_mistakes() -> None:
    with pytest.raises(InputError) as caught:
        validate("".join(f"k{number}: 1\n" for number in range(1000)))
    assert len(caught.value.problems) == 100


@pytest.mark.parametrize(
    ("type", "words"),
    [
        (number(), "a number"),
        (number(0), "a number from 0 up"),
        (number(high=5), "a number up to 5"),
        (number(0.5, 1000), "a number from 0.5 to 1000"),
        (number(0, 90, above=True), "a number above 0 to 90"),
        (whole(1), "a whole number from 1 up"),
        (whole(1, 3) | TEXT | bool, "a whole number from 1 to 3, text or true or false"),
        (tuple[TEXT, bool], "a list of text, true or false"),
        (vector(2, 0, 1), "a list of 2 numbers from 0 to 1"),
    ],
)
def test_limits_in_words(type: Any, words: str) -> None:
    assert words_for(type, file=True) == words


@pytest.mark.parametrize("kind", FILE_KINDS)
def test_every_key_of_every_file_is_documented_and_has_a_legal_default(kind: str) -> None:
    for _, keys in table_of(kind).sections():
        for key in keys:
            assert key.doc.endswith((".", ")")), key.name
            if key.default is not None:
                default = list(key.default) if isinstance(key.default, tuple) else key.default
                assert fits(conversion_to(key.type)(default), key.type), key.name


# --- the schema says the same ----------------------------------------------------------------------------------------


@cache
def compiled(what: str) -> Callable[[Any], Any]:
    fastjsonschema = pytest.importorskip("fastjsonschema")
    made = as_markdown(file_schema(ROOM if what == "room" else table_of(what)))
    found: Callable[[Any], Any] = fastjsonschema.compile(json.loads(json.dumps(made)))
    return found


def accepts(validate: Callable[[Any], Any], data: Any) -> bool:
    import fastjsonschema

    try:
        validate(json.loads(json.dumps(data)))
    except fastjsonschema.JsonSchemaException:
        return False
    return True


@pytest.mark.parametrize("text", [text for text in WRONG if ".nan" not in text and "door" not in text])
def test_what_the_walk_refuses_the_schema_refuses(text: str) -> None:
    assert not accepts(compiled("room"), parse(text, keep_going=True).root.plain())


SWEEP = """
sweep: 1
pipeline: forward
scene: spheres
size: [48, 27]
frames: 2
reference: ./truth.png
set: {light.ambient: 0.1, light.lookup: null}
axes: {shadows.taps: [1, 3], light.shading: [pbr, phong]}
"""


def files(kind: str) -> list[str]:
    if kind == "sweep":
        study = (Path(__file__).parents[2] / "docs/guide/compare.md").read_text(encoding="utf-8")
        return [SWEEP, study.partition("# study.yaml\n")[2].partition("```")[0]]
    return [file.read_text(encoding="utf-8") for file in shipped_scenes().values()]


def mutants(value: Any) -> list[Any]:
    """The same with one thing in it changed, for each thing."""
    found: list[Any] = ["no such word", [], {"nobody": 1}, -3]
    if isinstance(value, dict):
        found += [{**value, key: part} for key, child in value.items() for part in mutants(child)]
        found += [{key: child for key, child in value.items() if key != left} for left in value]
        found += [{**value, "no_such_key": 1}]
    elif isinstance(value, list):
        found += [[*value[:at], part, *value[at + 1 :]] for at, child in enumerate(value) for part in mutants(child)]
        found += [value[:-1], [*value, 1]]
    return found


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "most", "every"),
    [("scene", 20, 3), ("sweep", 100, 1), pytest.param("scene", 300, 1, marks=pytest.mark.nightly)],
)
def test_shipped_files_are_valid_and_mutants_are_as_the_walk_says(kind: str, most: int, every: int) -> None:
    table, validate, checked = table_of(kind), compiled(kind), 0
    for place, text in enumerate(files(kind)):
        data = parse(text).root.plain()
        assert accepts(validate, data)
        found = mutants(data) if place % every == 0 else []
        for mutant in found[:: len(found) // most + 1]:
            validator = Validator(CODES)
            validator.file(from_plain(mutant, Source("mutant")), table, "keys")
            checked += 1
            if validator.problems:
                assert not accepts(validate, mutant), (mutant, validator.problems)
    assert checked > 100


def test_a_schema_says_what_it_is_made_of() -> None:
    made = schema_of(LAMP)
    assert made["properties"]["power"] == {
        "type": ["number", "null"],
        "exclusiveMinimum": 0,
        "description": "How bright.\n\nDefault 1.0 W.",
        "default": 1.0,
    }
    assert made["required"] == ["kind"]
    assert made["properties"]["kind"]["enum"] == ["round", "square", "long"]
