"""The render service, in this process."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from msgspec.structs import replace

import rendergraph as rg
from rendergraph.images import read
from rendergraph.viewer import camera as cameras
from rendergraph.viewer.messages import (
    ChangedFilesRequest,
    CompareRequest,
    PixelRequest,
    RenderRequest,
    Response,
    ThumbnailRequest,
)
from rendergraph.viewer.render_service import RenderService, texel, texture_statistics

SIZE = (64, 36)
FORWARD = rg.Selection("forward", size=SIZE)


@pytest.fixture
def service(gl: rg.Session) -> RenderService:
    return RenderService(gl)


def picture(answer: Response, folder: Path, name: str = "picture") -> np.ndarray:
    assert not answer.problems
    file = folder / f"{name}.png"
    file.write_bytes(answer.files[name])
    return read(file)


def test_the_picture_is_the_one_that_python_renders(service: RenderService, gl: rg.Session, tmp_path: Path) -> None:
    answer = service.answer(RenderRequest(FORWARD))
    expected = gl.render(rg.load("forward", size=SIZE), outputs=("image",))["image"][..., :3]
    np.testing.assert_array_equal(picture(answer, tmp_path)[..., :3], expected)
    assert answer.facts["size"] == list(SIZE)
    assert [entry["node"] for entry in answer.facts["passes"]][-1] == "display"


def test_a_camera_by_hand_is_what_the_scene_says_with_that_camera(service: RenderService, tmp_path: Path) -> None:
    first = service.answer(RenderRequest(FORWARD))
    assert first.camera is not None
    assert first.sphere is not None
    moved = cameras.orbit(first.camera, first.sphere, 0.5, 0.1)
    turned = picture(service.answer(RenderRequest(FORWARD, camera=moved)), tmp_path)
    assert np.abs(turned.astype(int) - picture(first, tmp_path)).max() > 30
    again = service.answer(RenderRequest(FORWARD, camera=first.camera))
    np.testing.assert_array_equal(picture(again, tmp_path), picture(first, tmp_path))


def test_the_description_comes_once_a_change(service: RenderService) -> None:
    first = service.answer(RenderRequest(FORWARD))
    assert "pipeline" in first.facts
    known = first.facts["revision"]
    assert "pipeline" not in service.answer(RenderRequest(FORWARD, frame=2, known_revision=known)).facts
    changed = service.answer(RenderRequest(replace(FORWARD, sets=("light.ambient=0.5",)), known_revision=known))
    assert changed.facts["pipeline"]["nodes"]["light"]["parameters"]["ambient"]["value"] == 0.5


@pytest.mark.nightly(keep=1)
@pytest.mark.parametrize(
    ("pipeline", "setting", "runs"),
    [
        ("ssao-hemisphere", "ao.radius=0.3", {"ao", "light", "display"}),
        ("full", "display.exposure=1", {"display", "aa"}),  # not `exposure`, which remembers the frame before
    ],
)
def test_a_slider_runs_nothing_before_what_it_changes(
    service: RenderService, pipeline: str, setting: str, runs: set[str]
) -> None:
    selection = rg.Selection(pipeline, size=SIZE)
    service.answer(RenderRequest(selection))
    passes = service.answer(RenderRequest(replace(selection, sets=(setting,)))).facts["passes"]
    ran = {entry["node"]: entry["ran"] for entry in passes}
    assert {node for node in ran if ran[node]} == runs
    assert {"gbuffer", "sun", "shadows"} < ran.keys()  # with the times that they took


def test_parameters_say_what_they_may_be(service: RenderService) -> None:
    nodes = service.answer(RenderRequest(FORWARD)).facts["pipeline"]["nodes"]
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


def test_a_pixel_has_the_textures_own_values(service: RenderService, gl: rg.Session) -> None:
    service.answer(RenderRequest(FORWARD, port="light.radiance"))
    expected = gl.render(rg.load("forward", size=SIZE), outputs=(), taps=("light.radiance",))["light.radiance"]
    at = service.answer(PixelRequest(40.5 / 64, 30.5 / 36)).facts["pixel"]
    assert at["at"] == [40, 30]
    np.testing.assert_allclose(at["values"], expected[30, 40], rtol=1e-6)


def test_layers_lie_in_a_grid_and_a_pixel_says_which() -> None:
    layers = np.arange(3 * 2 * 4, dtype=np.float32).reshape(3, 2, 4, 1)
    assert texel(layers, 0.0, 0.0) == {"at": [0, 0], "layer": 0, "values": [0.0]}
    assert texel(layers, 0.99, 0.01) == {"at": [3, 0], "layer": 1, "values": [11.0]}
    assert texel(layers, 0.01, 0.99) == {"at": [0, 1], "layer": 2, "values": [20.0]}
    assert texel(layers, 0.99, 0.99) == {}
    buffer = np.arange(6, dtype=np.float32).reshape(3, 2)  # records, values
    assert texel(buffer, 0.6, 0.9) == {"at": [1, 2], "layer": None, "values": [5.0]}


def test_figures_of_a_texture(gl: rg.Session) -> None:
    pixels = np.array([[1.0, 3.0], [np.nan, np.inf]], np.float32)
    found = texture_statistics(pixels, rg.session.OutputInfo("a", "a.b", "depth", "r32f", "texture2d", None, ("Z",)))
    assert (found["nan"], found["infinite"]) == (1, 1)
    channel = found["channels"][0]
    assert (channel["min"], channel["max"], channel["mean"]) == (1.0, 3.0, 2.0)
    assert sum(channel["histogram"]) == 2
    assert channel["histogram"][0] == channel["histogram"][-1] == 1


def test_thumbnails_are_of_every_port_that_is_drawn(service: RenderService, tmp_path: Path) -> None:
    service.answer(RenderRequest(FORWARD))
    answer = service.answer(ThumbnailRequest())
    assert {"light.radiance", "display.color", "sun.shadow_map"} <= answer.files.keys()
    assert max(picture(answer, tmp_path, "sun.shadow_map").shape[:2]) <= 176


def test_against_itself_nothing_differs_and_against_another_something(service: RenderService) -> None:
    service.answer(RenderRequest(FORWARD))
    same = service.answer(CompareRequest(FORWARD))
    assert same.facts["figures"]["rmse"] == 0
    other = service.answer(CompareRequest(replace(FORWARD, sets=("display.exposure=1",))))
    assert other.facts["figures"]["flip"] > 0.05
    assert other.files.keys() == {"other", "difference", "flip"}


def test_what_it_is_compared_with_is_drawn_on_its_scene_by_its_camera(service: RenderService, tmp_path: Path) -> None:
    (tmp_path / "ball.yaml").write_text(
        "scene: 1\nobjects: {ball: {shape: sphere, radius: 0.5}}\n"
        "cameras: {main: {eye: [0, 0, 3], target: [0, 0, 0]}, side: {eye: [9, 0, 0], target: [0, 0, 0]}}\n"
    )
    service.answer(RenderRequest(replace(FORWARD, scene=str(tmp_path / "ball.yaml"), camera="side")))
    assert service.answer(CompareRequest(FORWARD)).facts["figures"]["rmse"] == 0


def test_types_that_fit_the_links_come_before_those_that_want_others(service: RenderService) -> None:
    sun = service.answer(RenderRequest(FORWARD)).facts["pipeline"]["nodes"]["sun"]
    assert {"shadow_map", "shadow_cascaded", "shadow_cube"} <= set(sun["types"])
    assert {"shadow_pcf", "shadow_planar", "show_shadow_map"} <= set(sun["other_types"])
    for name in sun["types"]:
        rg.load("forward", size=SIZE, sets=[f"sun.type={name}"]).expand()
    assert not set(sun["types"]) & set(sun["other_types"])


def test_a_mistake_names_its_node_and_the_next_picture_is_drawn(service: RenderService) -> None:
    service.answer(RenderRequest(FORWARD))
    wrong = service.answer(RenderRequest(replace(FORWARD, sets=("display.exposure=bright",))))
    assert wrong.problems[0]["node"] == "display"
    assert not wrong.files
    assert service.answer(RenderRequest(FORWARD)).files


def test_a_changed_file_is_noticed_and_drawn(service: RenderService, tmp_path: Path) -> None:
    file = tmp_path / "mine.yaml"
    file.write_text("extends: forward\nsize: [32, 18]\n")
    selection = rg.Selection(str(file))
    service.answer(RenderRequest(selection))
    assert service.answer(ChangedFilesRequest()).facts["changed"] == []
    file.write_text("extends: forward\nsize: [48, 18]\n")
    assert service.answer(ChangedFilesRequest()).facts["changed"] == ["mine.yaml"]
    assert service.answer(RenderRequest(selection)).facts["size"] == [48, 18]


def test_a_moving_picture_is_rendered_smaller_where_that_takes_long(gl: rg.Session) -> None:
    service = RenderService(gl, interactive_ms=1e9)
    service.answer(RenderRequest(FORWARD))
    assert service.answer(RenderRequest(FORWARD, still=False)).facts["size"] == list(SIZE)
    slow = RenderService(gl, interactive_ms=0.0)
    slow.answer(RenderRequest(FORWARD))
    assert slow.answer(RenderRequest(FORWARD, still=False)).facts["size"] == [16, 9]


def test_nan_is_told_with_the_first_texture_that_holds_it(service: RenderService, tmp_path: Path) -> None:
    (tmp_path / "nan.frag").write_text(
        "/*---\ndoc: NaN.\noutputs: {light: {semantic: radiance, doc: Light.}}\n---*/\n"
        "uniform float zero;\nout vec4 light;\n\nvoid main() {\n    light = vec4(zero / zero);\n}\n"
    )
    (tmp_path / "nan.yaml").write_text(
        "rendergraph: 1\nsize: [4, 4]\nnodes:\n  a: {type: ./nan.frag, params: {zero: 0}}\n"
        "  display: {type: tonemap, inputs: {radiance: a.light}}\noutputs: {image: display.color}\n"
    )
    (warning,) = service.answer(RenderRequest(rg.Selection(str(tmp_path / "nan.yaml")))).facts["warnings"]
    assert warning["code"] == "RG619"
    assert "the first texture with such texels is 'a.light'" in warning["text"]


def test_exposure_is_of_light_alone(service: RenderService, tmp_path: Path) -> None:
    plain = picture(service.answer(RenderRequest(FORWARD, port="light.radiance")), tmp_path).astype(float)
    brighter = picture(service.answer(RenderRequest(FORWARD, port="light.radiance", exposure=2.0)), tmp_path)
    assert brighter.mean() > 1.3 * plain.mean()
    image = picture(service.answer(RenderRequest(FORWARD)), tmp_path)
    np.testing.assert_array_equal(picture(service.answer(RenderRequest(FORWARD, exposure=2.0)), tmp_path), image)


@pytest.mark.nightly(keep=2)
@pytest.mark.parametrize(
    ("pipeline", "path"),
    [
        *(("forward", path) for path in ("display.exposure", "light.ambient", "shadows.bias", "light.terms")),
        ("forward", "display.curve"),
        ("full", "display.exposure"),
        ("full", "bloom.intensity"),
    ],
)
def test_a_value_that_slides_is_drawn_as_if_it_were_linked(
    gl: rg.Session, tmp_path: Path, pipeline: str, path: str
) -> None:
    """Moving pictures set the uniform of the last one; those of other values, and still ones, come from the pipeline."""
    service = RenderService(gl, interactive_ms=1e9)  # never smaller
    values = {"light.terms": ["all", "diffuse"], "display.curve": ["aces", "none"]}.get(path, [0.02, 0.3])
    plain = rg.Selection(pipeline, size=SIZE)
    chosen = [replace(plain, sets=(f"{path}={value}",)) for value in values]
    still = [picture(service.answer(RenderRequest(each)), tmp_path) for each in (plain, *chosen)]
    service.answer(RenderRequest(plain, still=False))
    seen = []
    for each in (*chosen, plain, chosen[0]):
        answer = service.answer(RenderRequest(each, still=False))
        assert not answer.problems
        assert service._rendered is not None
        seen.append(service._rendered.displayed()[0][..., :3])
    for found, expected in zip(seen, (still[1], still[2], still[0], still[1]), strict=True):
        np.testing.assert_array_equal(found, expected[..., :3])
    np.testing.assert_array_equal(picture(service.answer(RenderRequest(chosen[0])), tmp_path), still[1])
    np.testing.assert_array_equal(picture(service.answer(RenderRequest(plain)), tmp_path), still[0])
    if path in ("display.exposure", "bloom.intensity"):
        assert np.abs(still[1].astype(int) - still[2]).max() > 0
