"""Values of Python in place of files: scenes of arrays, documents, arrays as inputs, node classes and shader text."""

from __future__ import annotations

import pickle
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import rendergraph as rg
from rendergraph.compare import compare
from rendergraph.errors import InputError

SIZE = (48, 27)
QUAD: dict[str, Any] = {
    "positions": [[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]],
    "indices": [[0, 1, 2], [0, 2, 3]],
}
UV = [[0, 1], [1, 1], [1, 0], [0, 0]]
SUN = {"sun": {"type": "directional", "direction": [0, 0, -1], "intensity": 3}}
DIM = "uniform sampler2D radiance;\nout vec4 dim;\nvoid main() { dim = 0.5 * texelFetch(radiance, ivec2(gl_FragCoord.xy), 0); }"


def scene(**keys: Any) -> rg.Scene:
    """A square of 2 m, seen from 3 m away so that it fills the middle."""
    quad = rg.Object(rg.Mesh(**QUAD, uv0=UV), material={"base_color": [1, 0, 0]})
    return rg.Scene({"quad": quad}, lights=SUN, cameras={"main": {"eye": [0, 0, 3]}}, **keys)


def colors(pipeline: rg.Pipeline, gl: rg.Session) -> Any:
    return gl.render(pipeline, outputs="radiance")["radiance"][..., :3]


def test_a_scene_of_arrays_is_drawn_as_the_same_scene_of_a_file(gl: rg.Session, tmp_path: Path) -> None:
    mesh = ["v -1 -1 0", "v 1 -1 0", "v 1 1 0", "v -1 1 0", "f 1 2 3", "f 1 3 4"]
    (tmp_path / "quad.obj").write_text("\n".join(mesh))
    (tmp_path / "quad.yaml").write_text(
        "scene: 1\nobjects: {quad: {file: quad.obj, material: quad}}\nmaterials: {quad: {base_color: [1, 0, 0]}}\n"
        "lights: {sun: {type: directional, direction: [0, 0, -1], intensity: 3}}\ncameras: {main: {eye: [0, 0, 3]}}\n"
    )
    made, read = (colors(rg.load("forward", scene=one, size=SIZE), gl) for one in (scene(), tmp_path / "quad.yaml"))
    np.testing.assert_array_equal(made, read)
    assert made[13, 24, 0] > 0.5 > made[13, 24, 1]


def test_a_selection_of_values_can_be_pickled_and_is_keyed_by_content(gl: rg.Session) -> None:
    first, second = (rg.load("forward", scene=scene(), size=SIZE) for _ in range(2))
    assert first.selection == second.selection == pickle.loads(pickle.dumps(first.selection))
    assert first.link().scene is second.link().scene
    other = rg.load("forward", scene=scene(environment=np.full((2, 4, 3), 0.5)), size=SIZE)
    assert other.link().scene is not first.link().scene
    np.testing.assert_allclose(colors(other, gl)[0, 0], 0.5, atol=1e-3)  # the background is the array


def test_another_process_draws_a_scene_of_arrays() -> None:
    pipelines = [rg.load("forward", scene=scene(), size=(16, 9)).set("light.ambient", value) for value in (0, 0.1)]
    here, there = (compare(pipelines, frames=1, executor=name).results for name in ("serial", "processes:1"))
    assert [one.metrics for one in here] == [one.metrics for one in there]


def test_images_of_scenes_are_arrays(gl: rg.Session) -> None:
    halves = np.zeros((2, 2, 3), np.uint8)
    halves[:, 1] = 255  # the right half is white
    textured = scene()
    textured["materials"]["quad"] = {"base_color_texture": halves, "unlit": True}
    picture = colors(rg.load("forward", scene=textured, size=SIZE), gl)
    assert picture[13, 19].max() < 0.05
    assert picture[13, 29].min() > 0.95
    around = rg.load("forward", scene="shapes", size=SIZE).with_environment(np.full((4, 8, 3), 0.25))
    np.testing.assert_allclose(colors(around, gl)[0, 0], 0.25, atol=1e-3)


def test_documents_are_mappings_and_texts(gl: rg.Session) -> None:
    document = {"extends": "forward", "size": SIZE, "nodes": {"light": {"params": {"ambient": np.float32(0.5)}}}}
    text = "extends: forward\nsize: [48, 27]\nnodes: {light: {params: {ambient: 0.5}}}"
    pictures = [
        colors(one, gl) for one in (rg.load(document), rg.loads(text), rg.loads(f"{{{text}}}".replace("\n", ", ")))
    ]
    assert all((picture == pictures[0]).all() for picture in pictures)
    assert gl.render(document)["image"].shape == (27, 48, 4)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        (
            {"extends": "forward", "nodes": {"light": {"params": {"ambiant": 1}}}},
            r"^pipeline\.nodes\.light\.params\.ambiant: RG103",
        ),
        (
            {"extends": "forward", "scene": {"lights": {"a": {"type": "sun"}}}},
            r"^pipeline\.scene\.lights\.a\.type: RG321",
        ),
        (
            {"extends": "forward", "scene": {"extends": "shape"}},
            r"^pipeline\.scene\.extends: RG015 .* did you mean 'shapes'",
        ),
        ({"extends": "forward", "size": "big"}, r"^pipeline\.size: RG207"),
    ],
)
def test_mistakes_in_values_are_told_with_their_keys(given: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        rg.load(given).check()


def test_arrays_that_are_no_meshes_or_images_are_refused_at_once() -> None:
    mesh = rg.Mesh(QUAD["positions"], [[0, 1, 7]])
    with pytest.raises(
        InputError, match=r"scene\.objects\.a\.file: RG498 this is not a mesh: its indices go from 0 to 7"
    ):
        rg.load("forward", scene=rg.Scene({"a": mesh}))
    with pytest.raises(InputError, match=r"RG106 an image is an array .* not \(2, 2, 7\)"):
        rg.load("forward").with_environment(np.zeros((2, 2, 7)))
    with pytest.raises(InputError, match=r"RG106 an input is an array .* not \(2, 2, 2, 2, 2\)"):
        rg.load("deferred").set("display.radiance", np.zeros((2, 2, 2, 2, 2)))


@pytest.mark.parametrize("channels", [1, 2, 3, 4])
def test_an_array_is_the_input_of_a_port(gl: rg.Session, channels: int) -> None:
    given = np.random.default_rng(1).random((27, 48, channels), np.float32)
    pipeline = rg.load("deferred", size=SIZE).set("display.radiance", given[..., 0] if channels == 1 else given)
    tap = next(f"{one.id}.values" for one in pipeline.link().graph.nodes if one.id.startswith("array_"))
    read = gl.render(pipeline, taps=[tap]).arrays[tap]
    np.testing.assert_array_equal(read.reshape(27, 48, -1)[..., :channels], given)
    assert not pipeline.travels


def test_with_camera_looks_from_a_new_camera_or_from_one_of_the_scene(gl: rg.Session) -> None:
    base = rg.load("forward", scene=scene(), size=SIZE)
    np.testing.assert_array_equal(colors(base.with_camera(eye=(0, 0, 3)), gl), colors(base, gl))
    assert colors(base.with_camera(eye=(0, 0, -3), target=(0, 0, -4)), gl).max() < 0.05
    with pytest.raises(InputError, match="RG322 the scene has no camera 'side'; available: main"):
        base.with_camera("side").link()
    with pytest.raises(InputError, match=r"'fov_y_degrees': expected a number from 0\.01 to 179, got 300"):
        base.with_camera(fov_y_degrees=300).link()


def test_set_takes_several_values() -> None:
    changed = rg.load("forward").set({"light.ambient": 0.2, "scene.lights.key.color": [1, 0, 0]})
    assert changed.link().scene.lights[0].color == (1, 0, 0)
    assert dict(changed.link().graph["light"].node)["ambient"] == 0.2


def test_shader_text_is_a_node_type_and_other_text_another(gl: rg.Session) -> None:
    def dimmed(text: str) -> rg.Pipeline:
        nodes = {
            "dim": {"type": text, "inputs": {"radiance": "light.radiance"}},
            "display": {"inputs": {"radiance": "dim.dim"}},
        }
        return rg.load({"extends": "forward", "size": SIZE, "nodes": nodes, "outputs": {"radiance": "dim.dim"}})

    plain = colors(rg.load("forward", size=SIZE), gl)
    half = dimmed(DIM)
    np.testing.assert_allclose(colors(half, gl), plain / 2, atol=2e-3)
    np.testing.assert_allclose(colors(half.set("dim.type", DIM.replace("0.5", "0.25")), gl), plain / 4, atol=2e-3)
    assert half.travels
    with pytest.raises(InputError, match=r"dim_\w+\.frag:3:26: RG410 node 'dim': .* unexpected ';'"):
        gl.render(dimmed(DIM.replace("0.5", "0.5 +;")))


NOTEBOOK = """
import rendergraph as rg
from rendergraph.api import Node, Output, Radiance, param

def cell(value):
    class Flat(Node):
        "One value everywhere."
        values = Output(Radiance, doc="The value.")
        level: float = param(default=value, min=0, max=1, doc="The value.")
        def record(self, steps):
            steps.clear(self.values, (self.level,) * 4)
    Flat.__module__ = "__main__"
    return Flat

document = {"size": [4, 4], "nodes": {"flat": {"type": "flat"}}, "outputs": {"radiance": "flat.values"}}
for value in (0.25, 0.75):
    Flat = cell(value)  # as a cell of a notebook that runs again
    assert rg.load(document).render()["radiance"][0, 0, 0] == value
assert not rg.load(document).travels
other = cell(0.5)
document["nodes"]["flat"]["type"] = other
assert rg.load(document).render()["radiance"][0, 0, 0] == 0.5
"""


def test_a_class_of_a_notebook_is_a_node_type_and_its_cell_runs_again(tmp_path: Path) -> None:
    (tmp_path / "notebook.py").write_text(NOTEBOOK)
    done = subprocess.run([sys.executable, "notebook.py"], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: rg.load(None), "source: expected a name, a file or a mapping, got None"),  # type: ignore[arg-type]
        (lambda: rg.load("forward", scene=np.zeros(3)), "scene: expected a name, a file or a `Scene`, got array"),  # type: ignore[arg-type]
        (lambda: rg.load("forward").with_environment(3), "environment: expected a name, a file or an array, got 3"),  # type: ignore[arg-type]
        (lambda: rg.load("forward").set("light.type", int), "RG106 <class 'int'> cannot be written to a file"),
    ],
)
def test_what_no_value_can_be_is_refused_at_once(call: Any, message: str) -> None:
    with pytest.raises(rg.RendergraphError, match=message):
        call()


def test_a_mesh_alone_is_a_scene_and_infinity_a_number() -> None:
    assert len(rg.load("forward", scene=rg.Mesh(**QUAD)).link().scene.objects) == 1
    far = rg.load("forward").with_camera(eye=(0, 0, 3), far=float("inf")).link().scene.cameras["custom"].far
    assert far == float("inf")
    assert rg.load("forward").with_environment({"file": "sky", "intensity": 2}).link().scene.environment is not None
