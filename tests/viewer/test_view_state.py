"""The state of the pages: what they may send, that it stays bounded, undo and redo."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

import rendergraph as rg
from rendergraph.document import parse
from rendergraph.errors import UsageError
from rendergraph.viewer.messages import parse_message
from rendergraph.viewer.view_state import MOST_COMPARED, Edits, ViewState


@pytest.fixture
def state(tmp_path: Path) -> ViewState:
    return ViewState(rg.Selection("forward", sets=("light.ambient=0.1",)), tmp_path, fps=24.0)


def say(state: ViewState, **message: Any) -> bool:
    return state.apply(parse_message(json.dumps(message)))


def test_the_request_holds_everything_that_was_changed(state: ViewState) -> None:
    assert say(state, do="set", path="display.exposure", value=1)
    assert say(state, do="frame", number=5)
    assert say(state, do="look", port="light.radiance", exposure=2)
    asked = state.request()
    assert asked.selection.sets == ("light.ambient=0.1", "display.exposure=1")
    assert (asked.frame, asked.fps, asked.port, asked.exposure, asked.still) == (5, 24.0, "light.radiance", 2.0, True)


def test_what_is_held_or_played_does_not_stand_still(state: ViewState) -> None:
    assert not say(state, do="hold", on=True)
    assert not state.request().still
    assert say(state, do="hold", on=False)
    assert not say(state, do="hold", on=False)
    say(state, do="play", on=True)
    assert not state.request().still


@pytest.mark.parametrize("value", ["./mine.frag", "/tmp/mine.yaml", "../mine.yaml", {"nodes": {}}, 3, ""])
def test_a_page_names_types_and_no_files(state: ViewState, value: Any) -> None:
    """A path that is typed on the command line is the user's own; one that a page sends is not."""
    with pytest.raises(UsageError, match="a type must be the name of a node type"):
        say(state, do="set", path="shadows.type", value=value)
    with pytest.raises(UsageError, match="a type must be the name of a node type"):
        say(state, do="set", path="glow/blur.type", value=value)
    assert state.request().selection.sets == ("light.ambient=0.1",)


def test_snapshots_are_kept_up_to_a_number_and_the_file_as_it_was_opened_always(state: ViewState) -> None:
    for number in range(2 * MOST_COMPARED):
        say(state, do="set", path="display.exposure", value=number)
        say(state, do="remember")
    others = state.as_json()["others"]
    assert len(others) == MOST_COMPARED
    assert others[0] == "as opened"
    assert others[-1] == state.as_json()["other"] == f"snapshot {2 * MOST_COMPARED}"
    assert state.other == state.selection


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
    assert edits.current == {"a.x": "3", "a.y": "2"}
    back = edits.undo()
    assert back.current == {"a.x": "1", "a.y": "2"}
    assert back.undo().undo().current == {}
    assert back.undo().undo().undo().current == {}
    assert back.redo() == edits
    assert back.set("a.z", 1).after == ()


def test_what_is_still_held_is_one_change() -> None:
    edits = Edits().set("a.y", 2).set("a.x", 1)
    for value in (2, 3, 4):
        edits = edits.set("a.x", value, again=True)
    assert edits.current == {"a.y": "2", "a.x": "4"}
    assert edits.undo().current == {"a.y": "2"}


def test_the_first_value_of_a_held_slider_is_a_change_of_its_own() -> None:
    edits = Edits().set("a.y", 2).set("a.x", 1, again=True)
    assert edits.undo().current == {"a.y": "2"}


def test_a_setting_is_taken_back_and_that_undo() -> None:
    edits = Edits().set("a.x", 1).set("a.y", 2).drop("a.x")
    assert edits.current == {"a.y": "2"}
    assert edits.undo().current == {"a.x": "1", "a.y": "2"}
    assert edits.drop("b.x") is edits
