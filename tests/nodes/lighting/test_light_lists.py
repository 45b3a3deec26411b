"""Lists of lights: clustered forward+ as the guide shows it gives the same picture as a loop over all lights."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

import rendergraph as rg
from rendergraph.errors import RendergraphError

PAGE = Path(__file__).parents[3] / "docs" / "guide" / "light-parts.md"
SIZE = (64, 36)
LIGHTS = 16 * 16 + 6 * 6
NODES = "{clusters: {type: clusters}, light: {inputs: {light_list: clusters.light_list}}}"
PIPELINES = ("forward", "deferred-stencil-lights", "deferred", "forward-msaa")


@pytest.fixture(scope="module")
def guide(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The files of the guide's section, a pane of glass in its scene, and each pipeline with and without lists."""
    folder = tmp_path_factory.mktemp("guide")
    text = PAGE.read_text(encoding="utf-8")
    for block in re.findall(r"^```\w+\n(.*?)^```$", text, re.MULTILINE | re.DOTALL):
        named = re.match(r"(?:#|//) ([\w.-]+)\n", block)
        if named and named[1] in ("clusters.py", "cluster_grid.glsl", "clusters.comp", "clusters.glsl", "lamps.yaml"):
            (folder / named[1]).write_text(block)
    scene = (folder / "lamps.yaml").read_text()
    pane = "  pane: {shape: box, size: [4, 2, 0.1], at: [3, 1, 7], material: glass}\n"
    glass = "  glass: {base_color: [0.6, 0.9, 0.7, 0.4], alpha_mode: blend, roughness: 0.2}\n"
    sun = "  sun: {type: directional, direction: [-1, -1, -1], intensity: 0.1}\n"
    bare = "  bare: {type: point, at: [0, 2, 0], intensity: 0.5}\n"
    scene = scene.replace("objects:\n", f"objects:\n{pane}").replace("lights:\n", f"lights:\n{sun}{bare}")
    scene = scene.replace("materials: {white", f"materials:\n{glass}  white").replace(
        "roughness: 0.4}}", "roughness: 0.4}"
    )
    (folder / "lamps.yaml").write_text(scene)
    for name in PIPELINES:
        (folder / f"{name}.yaml").write_text(f"extends: {name}\nscene: ./lamps.yaml\nnodes: {NODES}\n")
    return folder


def load(guide: Path, name: str, *sets: str) -> rg.Pipeline:
    return rg.load(guide / f"{name}.yaml", size=SIZE, sets=sets, plugins=[guide])


@pytest.mark.nightly(keep=1)
@pytest.mark.parametrize("pipeline", PIPELINES)
def test_the_picture_is_that_of_a_loop_over_all_lights(session: rg.Session, guide: Path, pipeline: str) -> None:
    listed = session.render(load(guide, pipeline), outputs=["radiance"])["radiance"]
    looped = session.render(load(guide, pipeline, "light.light_list=null"), outputs=["radiance"])["radiance"]
    assert looped[..., :3].mean() > 0.05
    np.testing.assert_array_equal(listed, looped)


def test_lists_are_short_and_ascend(session: rg.Session, guide: Path) -> None:
    frame = session.render(load(guide, "forward"), outputs=["radiance"], taps=["clusters.lists"])
    lists = np.frombuffer(np.ascontiguousarray(frame["clusters.lists"]).tobytes(), np.uint32).reshape(-1, LIGHTS + 3)
    counts = lists[:, 0]
    assert counts.min() >= 2, "the sun and the light without a range are everywhere"
    assert counts.mean() < 0.1 * LIGHTS
    for row in lists:
        assert (np.diff(row[1 : row[0] + 1].astype(np.int64)) > 0).all()


def test_surfaces_are_lit_by_nothing_but_their_list(session: rg.Session, guide: Path, tmp_path: Path) -> None:
    """Of each list only the first light counts here, which is the sun."""
    for file in guide.iterdir():
        (tmp_path / file.name).write_text(file.read_text())
    text = (tmp_path / "clusters.glsl").read_text()
    (tmp_path / "clusters.glsl").write_text(text.replace("return int(words[first - 1u]);", "return 1;"))
    full = session.render(load(guide, "deferred"), outputs=["radiance"])["radiance"][..., :3]
    one = session.render(load(tmp_path, "deferred"), outputs=["radiance"])["radiance"][..., :3]
    scene = re.sub(r"\n  (?:warm|cold|bare): \{.*", "", (guide / "lamps.yaml").read_text())
    (guide / "sun.yaml").write_text(scene)
    alone = load(guide, "deferred", "light.light_list=null").with_scene(guide / "sun.yaml")
    np.testing.assert_allclose(one, session.render(alone, outputs=["radiance"])["radiance"][..., :3], atol=1e-4)
    assert one.mean() < 0.5 * full.mean()


def test_vertices_are_lit_by_all_lights(session: rg.Session, guide: Path) -> None:
    plan = load(guide, "forward", "light.evaluate=vertex", "light.blended=false").plan(outputs=["radiance"])
    assert not any(step.node == "clusters" for step in plan.schedule.steps)


def test_a_file_that_lacks_one_of_the_functions_is_named(guide: Path, tmp_path: Path) -> None:
    for file in guide.iterdir():
        (tmp_path / file.name).write_text(file.read_text())
    text = (tmp_path / "clusters.glsl").read_text()
    (tmp_path / "clusters.glsl").write_text(text.replace("light_at", "light_of"))
    with pytest.raises(RendergraphError, match=r"RG408 .*does not define 'int light_at\(int index\)'"):
        load(tmp_path, "forward").check()
