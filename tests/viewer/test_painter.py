"""What the render process says to questions, in this process."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from msgspec.structs import replace

import rendergraph as rg
from rendergraph.images import read
from rendergraph.viewer import camera as moving
from rendergraph.viewer.painter import Painter, figures, texel
from rendergraph.viewer.questions import Against, Answer, Ask, Changed, Pixel, Thumbnails, Variant

SIZE = (64, 36)
FORWARD = rg.Selection("forward", size=SIZE)


@pytest.fixture
def painter(gl: rg.Session) -> Iterator[Painter]:
    with closing(Painter(gl)) as found:
        yield found


def picture(answer: Answer, folder: Path, name: str = "picture") -> np.ndarray:
    assert not answer.problems
    file = folder / f"{name}.png"
    file.write_bytes(answer.files[name])
    return read(file)


def test_the_picture_is_the_one_that_python_renders(painter: Painter, gl: rg.Session, tmp_path: Path) -> None:
    answer = painter.answer(Ask(FORWARD))
    expected = gl.render(rg.load("forward", size=SIZE), outputs=("image",))["image"][..., :3]
    np.testing.assert_array_equal(picture(answer, tmp_path)[..., :3], expected)
    assert answer.facts["size"] == list(SIZE)
    assert [entry["node"] for entry in answer.facts["passes"]][-1] == "display"


def test_a_camera_by_hand_is_what_the_scene_says_with_that_camera(painter: Painter, tmp_path: Path) -> None:
    first = painter.answer(Ask(FORWARD))
    assert first.camera is not None
    assert first.sphere is not None
    moved = moving.orbited(first.camera, first.sphere, 0.5, 0.1)
    turned = picture(painter.answer(Ask(FORWARD, camera=moved)), tmp_path)
    assert np.abs(turned.astype(int) - picture(first, tmp_path)).max() > 30
    again = painter.answer(Ask(FORWARD, camera=first.camera))
    np.testing.assert_array_equal(picture(again, tmp_path), picture(first, tmp_path))


def test_the_description_comes_once_a_change(painter: Painter) -> None:
    first = painter.answer(Ask(FORWARD))
    assert "pipeline" in first.facts
    known = first.facts["revision"]
    assert "pipeline" not in painter.answer(Ask(FORWARD, frame=2, known=known)).facts
    changed = painter.answer(Ask(replace(FORWARD, sets=("light.ambient=0.5",)), known=known))
    assert changed.facts["pipeline"]["nodes"]["light"]["parameters"]["ambient"]["value"] == 0.5


def test_a_slider_runs_nothing_before_what_it_changes(painter: Painter) -> None:
    selection = rg.Selection("ssao-hemisphere", size=SIZE)
    painter.answer(Ask(selection))
    passes = painter.answer(Ask(replace(selection, sets=("ao.radius=0.3",)))).facts["passes"]
    ran = {entry["node"]: entry["ran"] for entry in passes}
    assert {node for node in ran if ran[node]} == {"ao", "light", "display"}
    assert {"gbuffer", "sun", "shadows"} < ran.keys()  # with the times that they took


def test_parameters_say_what_they_may_be(painter: Painter) -> None:
    nodes = painter.answer(Ask(FORWARD)).facts["pipeline"]["nodes"]
    assert nodes["display"]["parameters"]["exposure"] | {"takes": ""} == {
        "value": 0.0,
        "default": 0.0,
        "role": "param",
        "doc": nodes["display"]["parameters"]["exposure"]["doc"],
        "unit": "EV",
        "min": -32,
        "max": 32,
        "choices": [],
        "kind": "number",
        "takes": "",
        "idle": "",
    }
    assert nodes["light"]["parameters"]["ambient"]["idle"] == "environment"
    assert "phong" in nodes["light"]["parameters"]["shading"]["choices"]
    assert nodes["light"]["parameters"]["ambient"]["kind"] == "color"
    assert nodes["sun"]["parameters"]["resolution"]["kind"] == "integer"
    assert "shadow_vsm" in nodes["shadows"]["types"]


def test_a_pixel_has_the_textures_own_values(painter: Painter, gl: rg.Session) -> None:
    painter.answer(Ask(FORWARD, port="light.radiance"))
    expected = gl.render(rg.load("forward", size=SIZE), outputs=(), taps=("light.radiance",))["light.radiance"]
    at = painter.answer(Pixel(40.5 / 64, 30.5 / 36)).facts["pixel"]
    assert at["at"] == [40, 30]
    np.testing.assert_allclose(at["values"], expected[30, 40], rtol=1e-6)


def test_layers_lie_in_a_grid_and_a_pixel_says_which() -> None:
    layers = np.arange(3 * 2 * 4, dtype=np.float32).reshape(3, 2, 4, 1)
    info: Any = None
    assert texel(layers, info, 0.0, 0.0) == {"at": [0, 0], "layer": 0, "values": [0.0]}
    assert texel(layers, info, 0.99, 0.01) == {"at": [3, 0], "layer": 1, "values": [11.0]}
    assert texel(layers, info, 0.01, 0.99) == {"at": [0, 1], "layer": 2, "values": [20.0]}
    assert texel(layers, info, 0.99, 0.99) == {}


def test_figures_of_a_texture(gl: rg.Session) -> None:
    pixels = np.array([[1.0, 3.0], [np.nan, np.inf]], np.float32)
    found = figures(pixels, rg.session.OutputInfo("a", "a.b", "depth", "r32f", "texture2d", None, ("Z",)))
    assert (found["nan"], found["infinite"]) == (1, 1)
    channel = found["channels"][0]
    assert (channel["min"], channel["max"], channel["mean"]) == (1.0, 3.0, 2.0)
    assert sum(channel["histogram"]) == 2
    assert channel["histogram"][0] == channel["histogram"][-1] == 1


def test_thumbnails_are_of_every_port_that_is_drawn(painter: Painter, tmp_path: Path) -> None:
    painter.answer(Ask(FORWARD))
    answer = painter.answer(Thumbnails())
    assert {"light.radiance", "display.color", "sun.shadow_map"} <= answer.files.keys()
    assert max(picture(answer, tmp_path, "sun.shadow_map").shape[:2]) <= 176


def test_against_itself_nothing_differs_and_against_another_something(painter: Painter) -> None:
    painter.answer(Ask(FORWARD))
    same = painter.answer(Against(FORWARD))
    assert same.facts["figures"]["rmse"] == 0
    other = painter.answer(Against(replace(FORWARD, sets=("display.exposure=1",))))
    assert other.facts["figures"]["flip"] > 0.05
    assert other.files.keys() == {"other", "difference", "flip"}


def test_what_it_is_compared_with_is_drawn_on_its_scene_by_its_camera(painter: Painter, tmp_path: Path) -> None:
    (tmp_path / "ball.yaml").write_text(
        "scene: 1\nobjects: {ball: {shape: sphere, radius: 0.5}}\n"
        "cameras: {main: {eye: [0, 0, 3], target: [0, 0, 0]}, side: {eye: [9, 0, 0], target: [0, 0, 0]}}\n"
    )
    painter.answer(Ask(replace(FORWARD, scene=str(tmp_path / "ball.yaml"), camera="side")))
    assert painter.answer(Against(FORWARD)).facts["figures"]["rmse"] == 0


def test_types_that_fit_the_links_come_before_those_that_want_others(painter: Painter) -> None:
    sun = painter.answer(Ask(FORWARD)).facts["pipeline"]["nodes"]["sun"]
    assert {"shadow_map", "shadow_cascaded", "shadow_cube"} <= set(sun["types"])
    assert {"shadow_pcf", "shadow_planar", "show_shadow_map"} <= set(sun["other_types"])
    for name in sun["types"]:
        rg.load("forward", size=SIZE, sets=[f"sun.type={name}"]).expand()
    assert not set(sun["types"]) & set(sun["other_types"])


def test_a_variant_reads_back_to_what_was_on_the_page(painter: Painter, tmp_path: Path) -> None:
    changed = replace(FORWARD, sets=("display.exposure=1.5", "shadows.type=shadow_vsm", "light.smith=fast"))
    painter.answer(Ask(changed))
    text = painter.answer(Variant(FORWARD)).facts["yaml"]
    assert text.startswith("extends: forward\n")
    file = tmp_path / "variant.yaml"
    file.write_text(text)
    assert rg.load(file).resolve().spec.plain() == rg.load("forward", **_kept(changed)).resolve().spec.plain()


def _kept(selection: rg.Selection) -> dict[str, Any]:
    return {"sets": selection.sets, "size": selection.size}


def test_a_mistake_names_its_node_and_the_next_picture_is_drawn(painter: Painter) -> None:
    painter.answer(Ask(FORWARD))
    wrong = painter.answer(Ask(replace(FORWARD, sets=("display.exposure=bright",))))
    assert wrong.problems[0]["node"] == "display"
    assert not wrong.files
    assert painter.answer(Ask(FORWARD)).files


def test_a_changed_file_is_noticed_and_drawn(painter: Painter, tmp_path: Path) -> None:
    file = tmp_path / "mine.yaml"
    file.write_text("extends: forward\nsize: [32, 18]\n")
    selection = rg.Selection(str(file))
    painter.answer(Ask(selection))
    assert painter.answer(Changed()).facts["changed"] == []
    file.write_text("extends: forward\nsize: [48, 18]\n")
    assert painter.answer(Changed()).facts["changed"] == ["mine.yaml"]
    assert painter.answer(Ask(selection)).facts["size"] == [48, 18]


def test_what_moves_is_drawn_smaller_where_that_takes_long(painter: Painter) -> None:
    painter.answer(Ask(FORWARD))
    painter._full_ms = 1000.0  # as a large one would take
    assert painter.answer(Ask(FORWARD, still=False)).facts["size"] == [16, 9]
    painter._full_ms = 1.0
    assert painter.answer(Ask(FORWARD, still=False)).facts["size"] == list(SIZE)


def test_exposure_is_of_light_alone(painter: Painter, tmp_path: Path) -> None:
    plain = picture(painter.answer(Ask(FORWARD, port="light.radiance")), tmp_path).astype(float)
    brighter = picture(painter.answer(Ask(FORWARD, port="light.radiance", stops=2.0)), tmp_path)
    assert brighter.mean() > 1.3 * plain.mean()
    image = picture(painter.answer(Ask(FORWARD)), tmp_path)
    np.testing.assert_array_equal(picture(painter.answer(Ask(FORWARD, stops=2.0)), tmp_path), image)
