"""Keyframes of nodes' parameters: as if each frame had been rendered with its value."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import yaml

import rendergraph as rg
from rendergraph.errors import InputError
from rendergraph.resources import folder

SCENE = """scene: 1
objects: {box: {shape: box}}
lights: {sun: {type: directional, direction: [-1, -2, -1], intensity: 3}}
cameras: {main: {eye: [2, 1.5, 3]}}
"""
SIZE = (48, 28)


def driven(folder: Path, keyframes: str, name: str = "bloom") -> rg.Pipeline:
    (folder / "scene.yaml").write_text(f"{SCENE}keyframes: {{{keyframes}}}\n")
    return rg.load(name, scene=folder / "scene.yaml", size=SIZE)


def test_every_frame_has_its_value(gl: rg.Session, tmp_path: Path) -> None:
    """And the file's own value holds again for a scene without keyframes, in the same session."""
    keys = (
        "nodes.bloom.intensity: {0: 0, 0.1: 6, ease: smooth}, nodes.light.ambient: {0: [0, 0, 0], 0.2: [0.4, 0.2, 0]}"
    )
    pipeline = driven(tmp_path, keys).set("bloom.threshold", 0.2)
    (tmp_path / "still.yaml").write_text(SCENE)
    still = pipeline.with_scene(tmp_path / "still.yaml")
    other = rg.Session()
    for frame in gl.frames(pipeline, frames=range(1, 6, 2), outputs=["radiance"]):
        t = min((frame.number - 1) / 3, 1.0)
        ambient = [0.4 * (frame.number - 1) / 6, 0.2 * (frame.number - 1) / 6, 0]
        same = still.set("bloom.intensity", 6 * (3 * t**2 - 2 * t**3)).set("light.ambient", ambient)
        expected = other.render(same, outputs=["radiance"])["radiance"]
        np.testing.assert_array_equal(frame["radiance"], expected)
    again, fresh = (session.render(still, outputs=["radiance"])["radiance"] for session in (gl, other))
    np.testing.assert_array_equal(again, fresh)
    other.close()


def test_whole_numbers_are_rounded(gl: rg.Session, tmp_path: Path) -> None:
    pipeline = driven(tmp_path, "nodes.bloom.radius: {0: 1, 0.1: 7}")
    frames = list(gl.frames(pipeline, frames=range(1, 4), outputs=["radiance"]))
    assert len(frames) == 3


def test_another_pipeline_may_lack_the_node(gl: rg.Session, tmp_path: Path) -> None:
    pipeline = driven(tmp_path, "nodes.bloom.intensity: {0: 0, 1: 1}", "forward")
    (warning,) = [problem for problem in pipeline.link().warnings if problem.code == "RG218"]
    assert "scene.yaml:5:13: " in str(warning)
    assert "keyframes of 'nodes.bloom.intensity': the pipeline has no node 'bloom'" in str(warning)
    assert gl.render(pipeline, outputs=["image"])["image"].any()


@pytest.mark.parametrize(
    ("keyframes", "message"),
    {
        "nodes.bloom.intensty: {0: 0}": "'intensty' is not a parameter; did you mean 'intensity'?",
        "nodes.bloom.levels: {0: 1, 1: 3}": "'levels' is fixed when the pipeline is compiled",
        "nodes.bloom.intensity: {0: 0, 1: 40}": "40: it must be at most 16",
        "nodes.bloom.intensity: {0: [1, 2]}": "it expected a number",
        "nodes.light.ambient: {0: [1, 2]}": "it expected",
    }.items(),
)
def test_mistakes(tmp_path: Path, keyframes: str, message: str) -> None:
    with pytest.raises(InputError) as caught:
        driven(tmp_path, keyframes).link()
    assert "RG219" in str(caught.value)
    assert message in str(caught.value)


def test_a_parameter_that_nothing_reads_in_every_frame(gl: rg.Session, tmp_path: Path) -> None:
    """Such as one of a map that is made once and kept."""
    pipeline = driven(tmp_path, "nodes.environment.level_bias: {0: 1}", "ibl").select(environment=Path("studio"))
    with pytest.raises(InputError, match="no shader that runs in every frame reads it"):
        gl.render(pipeline, outputs=["image"])


@pytest.mark.parametrize("code", ["RG218", "RG219"])
def test_the_pages_of_errors_are_right(tmp_path: Path, code: str) -> None:
    page: dict[str, str] = yaml.safe_load(next(folder("rendergraph.errors").glob(f"{code}-*.yaml")).read_text())
    for text, expected in ((page["wrong"], [page["message"]]), (page["right"], [])):
        (tmp_path / "scene.yaml").write_text(text)
        try:
            found = rg.load("bloom", scene=tmp_path / "scene.yaml").link().warnings
        except InputError as error:
            found = error.problems
        lines = [str(problem).splitlines()[0].partition("scene.yaml:")[2] for problem in found]
        assert lines == expected
