"""The page's state: what may be said to it, and that it stays bounded."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

import rendergraph as rg
from rendergraph.errors import UsageError
from rendergraph.viewer.desk import MOST_OTHERS, Desk


@pytest.fixture
def desk(tmp_path: Path) -> Desk:
    return Desk(rg.Selection("forward", sets=("light.ambient=0.1",)), tmp_path, fps=24.0)


def test_the_question_holds_everything_that_was_changed(desk: Desk) -> None:
    assert desk.said({"do": "set", "path": "display.exposure", "value": 1})
    assert desk.said({"do": "frame", "number": 5})
    assert desk.said({"do": "look", "port": "light.radiance", "stops": 2})
    asked = desk.question()
    assert asked.selection.sets == ("light.ambient=0.1", "display.exposure=1")
    assert (asked.frame, asked.fps, asked.port, asked.stops, asked.still) == (5, 24.0, "light.radiance", 2.0, True)


def test_what_is_held_or_played_does_not_stand_still(desk: Desk) -> None:
    assert not desk.said({"do": "hold", "on": True})
    assert not desk.question().still
    assert desk.said({"do": "hold", "on": False})
    assert not desk.said({"do": "hold", "on": False})
    desk.said({"do": "play", "on": True})
    assert not desk.question().still


@pytest.mark.parametrize("value", ["./mine.frag", "/tmp/mine.yaml", "../mine.yaml", {"nodes": {}}, 3, ""])
def test_a_page_names_types_and_no_files(desk: Desk, value: Any) -> None:
    """A path that is typed on the command line is the user's own; one that a page sends is not."""
    with pytest.raises(UsageError, match="a type is the name of one"):
        desk.said({"do": "set", "path": "shadows.type", "value": value})
    with pytest.raises(UsageError, match="a type is the name of one"):
        desk.said({"do": "set", "path": "glow/blur.type", "value": value})
    assert desk.question().selection.sets == ("light.ambient=0.1",)


def test_snapshots_are_kept_up_to_a_number_and_the_file_as_it_was_opened_always(desk: Desk) -> None:
    for number in range(2 * MOST_OTHERS):
        desk.said({"do": "set", "path": "display.exposure", "value": number})
        desk.said({"do": "remember"})
    others = desk.state()["others"]
    assert len(others) == MOST_OTHERS
    assert others[0] == "as opened"
    assert others[-1] == desk.state()["other"] == f"snapshot {2 * MOST_OTHERS}"
    assert desk.other == desk.selection
