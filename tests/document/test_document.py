"""YAML text to values with places."""

from __future__ import annotations

import contextlib
import math
import time
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rendergraph.document import Document, Value, YamlLimits, load, parse, parsing
from rendergraph.errors import InputError, Place, Problem

TEXT = """\
a: 1
list: [x, {deep: no}]
again: &anchor
  b: 1e-3
used: *anchor
"""


@pytest.fixture(params=["libyaml", "python"])
def _parser(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """Both of PyYAML's parsers: not every build has the fast one."""
    if request.param == "python":
        from yaml import SafeLoader

        monkeypatch.setattr(parsing, "parser_of", SafeLoader)


@pytest.mark.usefixtures("_parser")
def test_values_and_places() -> None:
    document = parse(TEXT, "f.yaml")
    assert document.root.plain() == {
        "a": 1,
        "list": ["x", {"deep": "no"}],
        "again": {"b": 0.001},
        "used": {"b": 0.001},
    }
    assert at(document, "a").place == Place("f.yaml", 1, 4)
    assert at(document, "a").key_place == Place("f.yaml", 1, 1)
    assert at(document, "list", 1, "deep").place == Place("f.yaml", 2, 18)
    assert at(document, "list", 1, "deep").key_place == Place("f.yaml", 2, 12)
    assert at(document, "used").place == Place("f.yaml", 5, 7)
    assert at(document, "used", "b").place == Place("f.yaml", 4, 6)


def test_a_problem_shows_the_line_of_its_value() -> None:
    assert at(parse(TEXT, "f.yaml"), "list", 0).problem("RG999", "text").line_text == "list: [x, {deep: no}]"


def test_of_a_long_line_a_message_shows_what_is_around_the_place() -> None:
    line = 5000 * "a" + "b" + 5000 * "c"
    head, shown, caret = str(Problem("RG999", "text", Place("x.yaml", 1, 5001), line)).split("\n")
    assert head == "x.yaml:1:5001: RG999 text"
    assert len(shown) < 250
    assert shown[caret.index("^")] == "b"


@pytest.mark.usefixtures("_parser")
@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("null", None),
        ("~", None),
        ("Null", None),
        ("", None),
        ("true", True),
        ("False", False),
        ("yes", "yes"),
        ("no", "no"),
        ("on", "on"),
        ("y", "y"),
        ("12", 12),
        ("+12", 12),
        ("-0", 0),
        ("010", 10),
        ("0o14", 12),
        ("0x1F", 31),
        ("1_000", "1_000"),
        ("12:30", "12:30"),
        ("2001-01-01", "2001-01-01"),
        ("1e3", 1e3),
        ("1e-3", 0.001),
        ("1.0e3", 1000.0),
        (".5", 0.5),
        ("5.", 5.0),
        ("+.5e-1", 0.05),
        (".inf", math.inf),
        ("-.INF", -math.inf),
        ("'1'", "1"),
        ('"null"', "null"),
        ("0x", "0x"),
        ("-", [None]),
        ("1.2.3", "1.2.3"),
        ("inf", "inf"),
        ("9223372036854775807", 2**63 - 1),
    ],
)
def test_scalars_are_those_of_yaml_1_2(text: str, value: object) -> None:
    found = parse(f"{text}\n").root.plain()
    assert found == value
    assert type(found) is type(value)


def test_not_a_number_is_one() -> None:
    assert math.isnan(parse(".nan").root.plain())


def test_number_keys_stay_numbers() -> None:
    assert parse("{0: a, 2.5: b}").root.plain() == {0: "a", 2.5: "b"}


def test_keys_that_are_equal_numbers_are_duplicates() -> None:
    with pytest.raises(InputError, match=r"RG002 duplicate key '1\.0'"):
        parse("{1: a, 1.0: b}")


@pytest.mark.usefixtures("_parser")
def test_all_mistakes_are_collected() -> None:
    with pytest.raises(InputError) as caught:
        parse("a: !x 1\na: 2\nb: {<<: {c: 1}}\nd: *e\n", "f.yaml")
    found = [(str(problem.place), problem.code) for problem in caught.value.problems]
    assert found == [("f.yaml:1:4", "RG004"), ("f.yaml:2:1", "RG002"), ("f.yaml:3:5", "RG003"), ("f.yaml:4:4", "RG006")]


def test_an_alias_is_one_object_and_not_a_copy() -> None:
    value = parse("a: &a [1, 2]\nb: [*a, *a]").root.plain()
    assert value["b"][0] is value["a"]


def test_a_byte_order_mark_moves_nothing(tmp_path: Path) -> None:
    file = tmp_path / "f.yaml"
    file.write_bytes("\ufeffa: 1\n".encode())
    assert at(load(file), "a").column == 4


def test_windows_line_ends(tmp_path: Path) -> None:
    file = tmp_path / "f.yaml"
    file.write_bytes(b"a: 1\r\nb: [1\r\n")
    with pytest.raises(InputError, match=r"f.yaml:2:4: RG001") as caught:
        load(file)
    assert caught.value.problems[0].line_text == "b: [1"


def test_files_that_cannot_be_read(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="RG011 there is no file"):
        load(tmp_path / "none.yaml")
    with pytest.raises(InputError, match=r"RG011 .* is a folder"):
        load(tmp_path)
    with pytest.raises(InputError, match=r"RG011 .* is not a regular file"):
        load(Path("/dev/zero"))
    with pytest.raises(InputError, match="RG011 cannot read"):
        load(tmp_path / ("x" * 300))
    with pytest.raises(InputError, match="RG011 cannot read"):
        load(tmp_path / "a\0b")


# --- budgets ---------------------------------------------------------------------------------------------------------

BOMBS = {
    "brackets": "[" * 1_000_000,
    "dashes": "- " * 900_000,
    "braces": "{a: " * 400_000,
    "question marks": "? " * 900_000,
    "laughs": "a0: &a0 [x,x,x,x,x,x,x,x,x]\n"
    + "".join(f"a{i}: &a{i} [{','.join([f'*a{i - 1}'] * 9)}]\n" for i in range(1, 20)),
    "aliases": "a: &a 1\nb: [" + "*a," * 100_000 + "]",
    "values": "[" + "1," * 900_000 + "]",
    "keys": "".join(f"k{i}: 1\n" for i in range(190_000)),
    "duplicates": "a: 1\n" * 190_000,
    "tags": "- !a 1\n" * 190_000,
    "blank lines": "\n" * 1_900_000 + "a: [",
    "ampersands": "&" * 1_900_000,
    "colons": ":" * 1_900_000,
    "percents": "%" * 1_900_000,
    "commas": "[" + "," * 1_900_000,
    "escapes": 'a: "' + "\\\n" * 900_000,
    "too long": "a: " + "x" * 3_000_000,
    "merge keys": "a: &a {x: 1}\n" + "".join(f"b{i}: {{<<: [*a, *a]}}\n" for i in range(400)),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", BOMBS)
def test_a_bomb_is_refused_at_once(name: str) -> None:
    start = time.process_time()
    with pytest.raises(InputError, match="RG0") as caught:
        parse(BOMBS[name], "bomb.yaml")
    assert time.process_time() - start < 20  # an attack takes minutes; a slow machine does not
    assert len(caught.value.problems) <= 100
    assert len(str(caught.value)) < 100_000


def test_what_is_large_and_legal_is_read() -> None:
    assert len(parse("a: " + "x" * 1_900_000).root.plain()["a"]) == 1_900_000
    assert parse("[" * 64 + "]" * 64).root.plain() is not None


def test_limits_are_named_with_their_option() -> None:
    with pytest.raises(InputError, match=r"RG007 the text has more than 3 values, .* --limit yaml-nodes=N allows more"):
        parse("[1, 2, 3]", limits=YamlLimits(nodes=3))
    assert parse("[1, 2]", limits=YamlLimits(nodes=3)).root.plain() == [1, 2]


# --- any text --------------------------------------------------------------------------------------------------------


@pytest.mark.slow
@given(st.text(alphabet=st.sampled_from("ab1 .:-?,[]{}&*!|>'\"%@#<\n\t\\\x00\x85\u2028\ufeff\ud800~="), max_size=60))
@settings(max_examples=600, deadline=None)
def test_any_text_is_read_or_refused(text: str) -> None:
    try:
        document = parse(text, "f.yaml")
    except InputError as error:
        for problem in error.problems:
            assert problem.code.startswith("RG0")
            assert problem.message.isprintable()
            assert str(problem).encode()
    else:
        walk(document.root)


@given(st.binary(max_size=40))
@settings(max_examples=200, deadline=None)
def test_any_bytes_are_read_or_refused(tmp_path_factory: pytest.TempPathFactory, data: bytes) -> None:
    file = tmp_path_factory.getbasetemp() / "any.yaml"
    file.write_bytes(data)
    with contextlib.suppress(InputError):
        load(file)


def walk(value: Value) -> None:
    """Every value has a place inside the text."""
    assert value.line >= 1
    for child in value.data if isinstance(value.data, list) else value.mapping.values():
        walk(child)


def at(document: Document, *path: str | int) -> Value:
    found = document.root.get(*path)
    assert found is not None
    return found
