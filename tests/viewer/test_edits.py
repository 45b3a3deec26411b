"""Settings made by hand: their texts, undo, redo."""

from __future__ import annotations

import pytest

from rendergraph.document import parse
from rendergraph.viewer.edits import Edits


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (0.5, "0.5"),
        (8, "8"),
        (True, "true"),
        (None, "null"),
        ("fast", "fast"),
        ("gbuffer.normal", "gbuffer.normal"),
        ("true", '"true"'),
        ("1e3", '"1e3"'),
        ("<img onerror=x>", '"<img onerror=x>"'),
        ([1, 0.5, 0], "[1, 0.5, 0]"),
    ],
)
def test_a_value_reads_back_as_itself(value: object, text: str) -> None:
    edits = Edits().set("a.b", value)
    assert edits.sets == (f"a.b={text}",)
    assert parse(f"a: {text}").root.plain() == {"a": value}


def test_undo_and_redo_go_through_all_states() -> None:
    edits = Edits().set("a.x", 1).set("a.y", 2).set("a.x", 3)
    assert edits.now == {"a.x": "3", "a.y": "2"}
    back = edits.undone()
    assert back.now == {"a.x": "1", "a.y": "2"}
    assert back.undone().undone().now == {}
    assert back.undone().undone().undone().now == {}
    assert back.redone() == edits
    assert back.set("a.z", 1).after == ()


def test_what_is_still_held_is_one_change() -> None:
    edits = Edits().set("a.y", 2).set("a.x", 1)
    for value in (2, 3, 4):
        edits = edits.set("a.x", value, again=True)
    assert edits.now == {"a.y": "2", "a.x": "4"}
    assert edits.undone().now == {"a.y": "2"}


def test_the_first_value_of_a_held_slider_is_a_change_of_its_own() -> None:
    edits = Edits().set("a.y", 2).set("a.x", 1, again=True)
    assert edits.undone().now == {"a.y": "2"}


def test_a_setting_is_taken_back_and_that_undone() -> None:
    edits = Edits().set("a.x", 1).set("a.y", 2).dropped("a.x")
    assert edits.now == {"a.y": "2"}
    assert edits.undone().now == {"a.x": "1", "a.y": "2"}
    assert edits.dropped("b.x") is edits
