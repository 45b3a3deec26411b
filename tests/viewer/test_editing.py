"""The file that pages edit: operations on its graph, what is saved, and that `run` draws from it what the page shows."""

from __future__ import annotations

import json
import random
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import rendergraph as rg
from rendergraph.errors import RendergraphError, UsageError
from rendergraph.images import read
from rendergraph.viewer import Viewer, editing, messages
from rendergraph.viewer.messages import RenderRequest, parse_message
from rendergraph.viewer.render_service import RenderService
from rendergraph.viewer.view_state import ViewState

MINE = """rendergraph: 1
# My renderer.
extends: forward
size: [48, 27]  # small
nodes:
  shadows: {params: {normal_offset: 2}}  # as in the book
"""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.yaml").write_text(MINE)
    return tmp_path


@pytest.fixture
def state(folder: Path) -> ViewState:
    return ViewState(rg.Selection("mine.yaml"), folder)


def say(state: ViewState, **message: Any) -> None:
    parsed = parse_message(json.dumps(message))
    if isinstance(parsed, messages.EditMessage):
        state.edit(parsed.operations)
    else:
        state.apply(parsed)


def insert_bloom(state: ViewState) -> None:
    say(state, do="edit", operations=[["insert", "glow", "bloom", "display.radiance"]])


def pixels(service: RenderService, state: ViewState, folder: Path) -> np.ndarray:
    answer = service.answer(state.request())
    assert not answer.problems
    state.record(answer)
    (folder / "shown.png").write_bytes(answer.files["picture"])
    return read(folder / "shown.png")


def test_an_operation_takes_the_settings_into_the_text(state: ViewState) -> None:
    say(state, do="set", path="light.ambient", value=0.4)
    insert_bloom(state)
    assert state.edits.text == (
        MINE + "  light: {params: {ambient: 0.4}}\n"
        "  glow: {type: bloom, inputs: {radiance: light.radiance}}\n"
        "  display: {inputs: {radiance: glow.radiance}}\n"
    )
    assert state.edits.current == {}
    assert editing.problems_of(state.selection) == []
    say(state, do="undo")
    assert state.edits.text is None
    assert state.edits.current == {"light.ambient": "0.4"}
    say(state, do="redo")
    assert state.edits.text is not None


def test_the_opened_file_is_saved_in_place_and_undo_goes_back_past_it(state: ViewState, folder: Path) -> None:
    insert_bloom(state)
    say(state, do="set", path="display.exposure", value=1)
    text, difference, digest = state.draft("mine.yaml")
    assert [line for line in difference.splitlines() if line.startswith("+ ")] == [
        "+  glow: {type: bloom, inputs: {radiance: light.radiance}}",
        "+  display: {inputs: {radiance: glow.radiance}, params: {exposure: 1}}",
    ]
    assert state.is_changed
    state.save("mine.yaml", digest)
    assert (folder / "mine.yaml").read_text() == text
    assert not state.is_changed
    for _ in range(3):
        say(state, do="undo")
    assert state.edits.text == MINE
    assert state.is_changed
    state.save("mine.yaml", state.draft("mine.yaml")[2])
    assert (folder / "mine.yaml").read_text() == MINE


def test_a_file_that_changed_meanwhile_is_not_overwritten_unseen(state: ViewState, folder: Path) -> None:
    insert_bloom(state)
    digest = state.draft("mine.yaml")[2]
    assert not state.is_behind
    (folder / "mine.yaml").write_text(MINE + "  light: {params: {ambient: 0.9}}\n")
    assert state.is_behind
    with pytest.raises(UsageError, match="has changed on disk"):
        state.save("mine.yaml", digest)
    assert "-  light: {params: {ambient: 0.9}}" in state.draft("mine.yaml")[1]
    say(state, do="reload")
    assert not state.is_behind
    assert not state.is_changed
    say(state, do="undo")
    assert "glow" in (state.edits.text or "")


def test_a_saved_file_is_followed_again(state: ViewState, folder: Path) -> None:
    insert_bloom(state)
    text = state.save("mine.yaml", state.draft("mine.yaml")[2])
    assert not state.follow()
    (folder / "mine.yaml").write_text(text + "  light: {params: {ambient: 0.9}}\n")
    assert state.follow()
    assert "ambient: 0.9" in (state.selection.text or "")
    assert not state.is_behind
    assert not state.is_changed
    say(state, do="undo")
    assert "ambient: 0.9" not in (state.edits.text or "")
    (folder / "mine.yaml").write_text(text)
    assert not state.follow()  # it would lose the change
    assert state.is_behind


def test_a_saved_file_is_followed_beside_changes_of_settings(state: ViewState, folder: Path) -> None:
    insert_bloom(state)
    text = state.save("mine.yaml", state.draft("mine.yaml")[2])
    say(state, do="set", path="display.exposure", value=2)
    (folder / "mine.yaml").write_text(text + "  light: {params: {ambient: 0.9}}\n")
    assert state.follow()
    assert state.is_changed
    assert state.edits.current == {"display.exposure": "2"}
    say(state, do="drop", path="display.exposure")
    assert not state.is_changed


def test_changes_that_were_saved_as_another_file_stay(state: ViewState, folder: Path) -> None:
    insert_bloom(state)
    state.save("other.yaml", state.draft("other.yaml")[2])
    changed = state.edits.text
    (folder / "mine.yaml").write_text(MINE + "  light: {params: {ambient: 0.9}}\n")
    assert not state.follow()
    assert (state.edits.text, state.is_behind) == (changed, True)


def test_a_shipped_pipeline_is_extended(folder: Path) -> None:
    state = ViewState(rg.Selection("forward", size=(48, 27), sets=("light.ambient=0.1",)), folder)
    insert_bloom(state)
    assert state.save("mine2.yaml", "") == (
        "rendergraph: 1\nextends: forward\nnodes:\n"
        "  light: {params: {ambient: 0.1}}\n"
        "  glow: {type: bloom, inputs: {radiance: light.radiance}}\n"
        "  display: {inputs: {radiance: glow.radiance}}\nsize: [48, 27]\n"
    )
    with pytest.raises(UsageError, match="look at the difference first"):
        state.save("mine2.yaml", "")
    say(state, do="set", path="light.ambient", value=0.2)
    text, difference, digest = state.draft("mine2.yaml")
    assert "+  light: {params: {ambient: 0.2}}" in difference
    assert state.save("mine2.yaml", digest) == text == (folder / "mine2.yaml").read_text()
    with pytest.raises(UsageError, match="exists; choose another name"):
        state.save("mine.yaml", "")


def test_what_is_inside_a_sub_pipeline_stays_beside_the_text(folder: Path) -> None:
    (folder / "inner.yaml").write_text(
        "inputs: {radiance: {semantic: radiance}}\n"
        "nodes: {blur: {type: bloom, inputs: {radiance: inputs.radiance}}}\noutputs: {radiance: blur.radiance}\n"
    )
    (folder / "outer.yaml").write_text(
        "extends: forward\nnodes:\n  glow: {type: ./inner.yaml, inputs: {radiance: light.radiance}}\n"
        "  display: {inputs: {radiance: glow.radiance}}\n"
    )
    state = ViewState(rg.Selection("outer.yaml"), folder)
    say(state, do="set", path="glow/blur.intensity", value=0.3)
    say(state, do="edit", operations=[["rename", "glow", "halo"]])
    assert dict(state.edits.current) == {"halo/blur.intensity": "0.3"}
    assert editing.problems_of(state.selection) == []
    with pytest.raises(UsageError, match="save under another name"):
        state.draft("outer.yaml")
    assert "intensity: 0.3" in state.save("other.yaml", "")


def test_a_type_that_lacks_a_parameter_is_saved_without_it(state: ViewState, folder: Path) -> None:
    (folder / "mine.yaml").write_text(MINE.replace("{params: {normal_offset: 2}}", "{params: {taps: 5}}"))
    say(state, do="set", path="shadows.type", value="shadow_vsm")
    state.save("mine.yaml", state.draft("mine.yaml")[2])
    assert (folder / "mine.yaml").read_text() == MINE.replace("{params: {normal_offset: 2}}", "{type: shadow_vsm}")


def test_a_mistake_on_the_disk_is_at_its_node(folder: Path) -> None:
    for sets in ((), ("display.saturation=0",)):
        (folder / "mine.yaml").write_text(MINE + "  light: {params: {ambient: bright}}\n")
        (problem,) = editing.problems_of(rg.Selection("mine.yaml", sets=sets))
        assert problem["node"] == "light"


def test_what_does_not_link_is_not_saved_but_kept(state: ViewState, folder: Path) -> None:
    say(state, do="edit", operations=[["add", "fx", "fxaa", {}]])
    (problem,) = editing.problems_of(state.selection)
    assert (problem["node"], problem["code"]) == ("fx", "RG114")
    for name in ("mine.yaml", "other.yaml"):
        with pytest.raises(RendergraphError, match="fx"):
            state.save(name, "")
    assert (folder / "mine.yaml").read_text() == MINE
    kept = state.keep()
    assert kept == folder / "mine-unsaved.yaml"
    assert "fx: {type: fxaa}" in kept.read_text()


def test_the_end_of_the_server_keeps_what_was_not_saved(state: ViewState, folder: Path) -> None:
    assert state.keep() is None
    insert_bloom(state)
    assert state.keep() == folder / "mine-unsaved.yaml"
    assert state.keep() == folder / "mine-unsaved1.yaml"


def test_closing_a_page_in_python_keeps_it_once(state: ViewState, folder: Path) -> None:
    stopped: list[str] = []
    viewer = Viewer("http://127.0.0.1/", lambda: stopped.append("stopped"), state.keep, 720)
    insert_bloom(state)
    assert viewer.close() == folder / "mine-unsaved.yaml"
    assert viewer.close() is None
    assert stopped == ["stopped"]


@pytest.mark.parametrize(
    "operation",
    [
        [],
        ["exec", "x"],
        ["upgrade"],
        ["set", "plugins", ["x.py"]],
        ["delete"],
        ["delete", 3],
        ["add", "x", "./evil.py", {}],
        ["retype", "light", "/tmp/x.frag"],
        ["insert", "x", "../x.yaml", "display.radiance"],
        ["connect", "a.b", "c.d"],
    ],
)
def test_a_page_does_no_other_operations_and_names_no_files(operation: list[Any]) -> None:
    with pytest.raises(UsageError, match="malformed request"):
        parse_message(json.dumps({"do": "edit", "operations": [operation]}))


@pytest.mark.nightly(keep=1)
@pytest.mark.parametrize("scene", [None, "lone", "endless"])
def test_a_saved_file_shows_the_scene_by_the_camera_that_was_moved(
    gl: rg.Session, folder: Path, scene: str | None
) -> None:
    """Also where the scene has no camera, and its light comes from beside the one that frames it."""
    ball = "scene: 1\nobjects: {ball: {shape: sphere, radius: 1, segments: 8}}\n"
    (folder / "lone.yaml").write_text(ball)
    (folder / "endless.yaml").write_text(ball + "cameras: {c: {eye: [0, 1, 4], far: .inf}}\n")
    state = ViewState(rg.Selection("forward", size=(48, 27), scene=scene and f"{scene}.yaml"), folder)
    service = RenderService(gl)
    before = pixels(service, state, folder)
    say(state, do="hold", on=True)
    say(state, do="camera", orbit=[0.4, 0.1])
    say(state, do="hold", on=False)
    shown = pixels(service, state, folder)
    assert (shown != before).any()
    text = state.save("variant.yaml", "")
    assert scene != "endless" or "far: .inf" in text
    saved = service.answer(RenderRequest(rg.Selection("variant.yaml")))
    (folder / "saved.png").write_bytes(saved.files["picture"])
    np.testing.assert_array_equal(read(folder / "saved.png"), shown)
    say(state, do="undo")
    np.testing.assert_array_equal(pixels(service, state, folder), before)


ACTIONS: list[dict[str, Any]] = [
    {"do": "set", "path": "display.exposure", "value": 0.5},
    {"do": "set", "path": "display.curve", "value": "aces"},
    {"do": "set", "path": "light.ambient", "value": 0.3},
    {"do": "set", "path": "shadows.type", "value": "shadow_vsm"},
    {"do": "set", "path": "shadows.type", "value": "shadow_pcf"},
    {"do": "set", "path": "shadows.enabled", "value": False},
    {"do": "drop", "path": "shadows.enabled"},
    {"do": "set", "path": "glow.intensity", "value": 0.4},
    {"do": "camera", "orbit": [0.2, 0.05]},
    {"do": "camera", "zoom": [1.1]},
    {"do": "frame", "number": 5},
    {"do": "frame", "number": 9},
    {"do": "set", "path": "environment", "value": "studio"},
    {"do": "set", "path": "environment", "value": "none"},
    {"do": "set", "path": "scene", "value": "shapes"},
    {"do": "keep_view", "name": "side"},
    {"do": "view", "name": "side"},
    {"do": "undo"},
    {"do": "redo"},
    {"do": "edit", "operations": [["insert", "glow", "bloom", "display.radiance"]]},
    {
        "do": "edit",
        "operations": [["duplicate", "glow", "second"], ["connect", "display.radiance", ["second.radiance"]]],
    },
    {"do": "edit", "operations": [["connect", "display.radiance", ["light.radiance"]], ["delete", "glow"]]},
    {"do": "edit", "operations": [["rename", "glow", "halo"]]},
    {"do": "edit", "operations": [["insert", "smooth", "fxaa", "outputs.image"]]},
    {"do": "edit", "operations": [["retype", "shadows", "shadow_vsm"]]},
    {"do": "edit", "operations": [["disable", "shadows"]]},
    {"do": "edit", "operations": [["enable", "shadows"]]},
    {"do": "edit", "operations": [["disconnect", "light.lookup"]]},
]


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, *(pytest.param(seed, marks=pytest.mark.nightly) for seed in range(2, 12))])
def test_any_fifty_actions_saved_are_what_the_page_shows(gl: rg.Session, folder: Path, seed: int) -> None:
    """In place and as a variant; a step that does not link is undone, as a hand would."""
    choose = random.Random(seed)
    state, service = ViewState(rg.Selection("mine.yaml"), folder), RenderService(gl)
    shown = pixels(service, state, folder)
    done = 0
    while done < 50:
        try:
            say(state, **choose.choice(ACTIONS))
        except RendergraphError:
            continue  # it is refused and changes nothing, such as a node that exists already
        done += 1
        if editing.problems_of(state.selection):
            say(state, do="undo")
    shown = pixels(service, state, folder)
    state.save("variant.yaml", "")
    state.save("mine.yaml", state.draft("mine.yaml")[2])
    for name in ("mine.yaml", "variant.yaml"):
        answer = service.answer(RenderRequest(rg.Selection(name), frame=state.frame))
        (folder / "saved.png").write_bytes(answer.files["picture"])
        np.testing.assert_array_equal(read(folder / "saved.png"), shown, err_msg=name)


def test_a_view_is_kept_in_the_file_and_looked_through(gl: rg.Session, state: ViewState, folder: Path) -> None:
    service = RenderService(gl)
    before = pixels(service, state, folder)
    say(state, do="keep_view", name="as_it_was")
    assert "as_it_was:\n    camera: " in (state.edits.text or "")  # although it is that of the scene
    say(state, do="undo")
    say(state, do="camera", orbit=[0.4, 0.1])
    say(state, do="frame", number=7)
    say(state, do="set", path="environment", value="overcast")
    shown = pixels(service, state, folder)
    say(state, do="keep_view", name="side")
    say(state, do="drop", path="camera")
    say(state, do="drop", path="frame")
    say(state, do="drop", path="environment")
    assert state.frame == 1
    np.testing.assert_array_equal(pixels(service, state, folder), before)
    say(state, do="view", name="side")
    assert state.frame == 7
    np.testing.assert_array_equal(pixels(service, state, folder), shown)
    say(state, do="undo")
    state.save("mine.yaml", state.draft("mine.yaml")[2])
    assert "views:\n  side:\n    camera: " in (folder / "mine.yaml").read_text()
    drawn = rg.load("mine.yaml", view="side").render(session=gl)
    assert drawn.number == 7
    np.testing.assert_array_equal(drawn.arrays["image"][..., :3], shown[..., :3])


def test_a_frame_is_undone_and_saved_as_a_view(state: ViewState, folder: Path) -> None:
    for number in (3, 4, 5):
        say(state, do="frame", number=number)
    say(state, do="set", path="display.exposure", value=1)
    say(state, do="frame", number=8)
    assert "views:\n  page: {frame: 8}\n" in state.save("variant.yaml", "")
    for frame in (5, 5, 1):
        say(state, do="undo")
        assert state.frame == frame
    assert not state.as_json()["can_undo"]


@pytest.mark.parametrize("path", ["scene", "environment"])
def test_a_page_chooses_shipped_surroundings_alone(state: ViewState, path: str) -> None:
    with pytest.raises(UsageError, match="choose a shipped one"):
        say(state, do="set", path=path, value="../x.hdr")
