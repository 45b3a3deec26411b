"""Scenes that pipelines, settings and other scenes change: one merge patch on the scene's file, read as if it were one."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

import rendergraph as rg
from rendergraph.compare.prepare import match_scene_and_size
from rendergraph.errors import InputError
from rendergraph.scene.model import Scene

BASE = """
scene: 1
objects: {ball: {shape: sphere, material: red}, floor: {shape: plane}}
materials: {red: {base_color: [1, 0, 0]}}
lights: {sun: {type: directional, intensity: 3}, lamp: {type: point, at: [0, 2, 0], intensity: 5}}
cameras: {main: {eye: [0, 1, 4]}}
"""


@pytest.fixture
def base(tmp_path: Path) -> Path:
    (tmp_path / "base.yaml").write_text(BASE)
    return tmp_path / "base.yaml"


def scene_of(pipeline: rg.Pipeline) -> Scene:
    return pipeline.link().scene


def test_settings_reach_into_the_scene(base: Path) -> None:
    sets = ["scene.lights.sun.intensity=2", "scene.cameras.main.eye=[0,2,4]", "scene.lights.lamp=null"]
    sets += ["scene.materials.red.roughness=0.25", "scene.lights.rim={type: directional, intensity: 1}"]
    found = scene_of(rg.load("forward", scene=base, sets=sets))
    assert [(light.name, light.intensity) for light in found.lights] == [("sun", 2), ("rim", 1)]
    assert found.cameras["main"].transform[1, 3] == 2
    assert next(one for one in found.materials if one.name == "red").roughness == 0.25


@pytest.mark.parametrize(
    ("setting", "message"),
    [
        (
            "scene.lights.sn.intensity=2",
            r"^--set scene\.lights\.sn\.intensity=2: RG322 there is no light 'sn'; did you mean 'sun'\?$",
        ),
        ("scene.lights.sun.intensty=2", r"RG320 light 'sun' has no key 'intensty'; did you mean 'intensity'\?$"),
        ("scene.lights.sun.intensity=-1", r"RG321 'intensity': expected a number from 0 up, got -1$"),
        ("scene.light.sun.intensity=2", r"RG320 a scene file has no key 'light'; did you mean 'lights'\?$"),
        (
            "scene.environment.file=none.hdr",
            r"RG350 image 'none\.hdr' does not exist$|RG350 image '.*none\.hdr' does not exist$",
        ),
    ],
)
def test_wrong_settings_of_scenes_are_told_where_they_are_typed(base: Path, setting: str, message: str) -> None:
    with pytest.raises(InputError, match=message):
        rg.load("forward", scene=base, sets=[setting]).check()


def test_a_node_called_scene_keeps_its_settings() -> None:
    document = {"size": [4, 4], "nodes": {"scene": {"type": "overdraw"}}, "outputs": {"image": "scene.count"}}
    with pytest.raises(InputError, match=r"RG103 node 'scene' .overdraw. has no param or input 'lights'"):
        rg.load(document).set("scene.lights", 1).resolve().spec.check()


def test_a_pipeline_changes_the_scene_that_it_inherits(base: Path) -> None:
    folder = base.parent
    (folder / "one.yaml").write_text("extends: forward\nscene: ./base.yaml\n")
    (folder / "two.yaml").write_text("extends: ./one.yaml\nscene: {lights: {lamp: null, sun: {intensity: 1}}}\n")
    pipeline = rg.load(folder / "two.yaml").set("scene.lights.sun.color", [1, 0, 0])
    (sun,) = scene_of(pipeline).lights
    assert (sun.intensity, sun.color) == (1, (1, 0, 0))
    written = rg.loads(pipeline.resolve().spec.to_yaml(), asset_roots=[folder]).patch({"scene": {"extends": str(base)}})
    assert scene_of(written).lights == (sun,)
    assert (
        len(scene_of(rg.load(folder / "two.yaml", scene="cornell_box")).lights) == 1
    )  # another scene, without changes


def test_scene_files_extend_scene_files_and_shipped_scenes(base: Path) -> None:
    folder = base.parent
    (folder / "sub").mkdir()
    (folder / "sub/more.yaml").write_text(
        "scene: 1\nextends: ../base.yaml\nlights: {sun: {intensity: 7}, lamp: null}\n"
    )
    found = scene_of(rg.load("forward", scene=folder / "sub/more.yaml", asset_roots=[folder]))
    assert [light.intensity for light in found.lights] == [7]
    assert [one.name for one in found.objects] == ["ball", "floor"]
    (folder / "box.yaml").write_text("scene: 1\nextends: cornell_box\nlights: {lamp: {intensity: 2}}\n")
    box, shipped = (scene_of(rg.load("forward", scene=one)) for one in (folder / "box.yaml", "cornell_box"))
    assert [one.name for one in box.objects] == [one.name for one in shipped.objects]
    assert box.lights[0].intensity == 2


@pytest.mark.parametrize(
    ("extends", "message"),
    [
        ("./own.yaml", r"own\.yaml:2:10: RG118 the file extends itself: own\.yaml → own\.yaml"),
        ("cornel_box", r"own\.yaml:2:10: RG015 there is no shipped scene 'cornel_box'; did you mean 'cornell_box'"),
        ("./gone.yaml", r"RG301 scene file 'gone\.yaml' does not exist|RG011"),
        ("/etc/passwd", r"RG012|RG302"),
    ],
)
def test_scenes_that_cannot_be_extended(tmp_path: Path, extends: str, message: str) -> None:
    (tmp_path / "own.yaml").write_text(f"scene: 1\nextends: {extends}\n")
    with pytest.raises(InputError, match=message):
        rg.load("forward", scene=tmp_path / "own.yaml").link()


def test_a_mesh_file_takes_changes_and_keeps_its_surroundings(tmp_path: Path) -> None:
    (tmp_path / "a.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    plain = rg.load("forward", scene=tmp_path / "a.obj")
    lit = plain.set("scene.lights.lamp", {"type": "point", "at": [0, 0, 2], "intensity": 4})
    assert [light.name for light in scene_of(lit).lights] == ["lamp"]
    assert scene_of(lit).environment is not None
    assert scene_of(plain).environment is not None


def test_scene_camera_and_environment_are_settings_too(base: Path) -> None:
    pipeline = rg.load("forward").set({"scene": str(base), "camera": "main", "environment": "studio"})
    assert pipeline.selection == rg.load("forward", scene=base, camera="main", environment="studio").selection
    with pytest.raises(InputError, match=r"^--camera side: RG322 the scene has no camera 'side'"):
        pipeline.set("camera", "side").link()
    with pytest.raises(
        InputError, match=r"^--scene spere: RG015 there is no shipped scene 'spere'; did you mean 'spheres'"
    ):
        pipeline.set("scene", "spere").link()


def test_a_mapping_for_a_scene_has_the_keys_of_scene_files() -> None:
    with pytest.raises(InputError, match="RG320 a scene file has no key 'file'"):
        rg.load({"extends": "forward", "scene": {"file": "a.glb"}}).check()


@pytest.mark.parametrize(
    ("size", "keywords", "expected"),
    [
        ("", {}, (720, 720)),
        ("size: [64, 36]\n", {}, (64, 36)),
        ("", {"size": (48, 32)}, (48, 32)),
        ("", {"camera": "eye=0,1,3"}, (720, 720)),
    ],
)
def test_a_camera_has_the_shape_of_pictures_whose_size_nothing_says(
    tmp_path: Path, size: str, keywords: dict[str, Any], expected: tuple[int, int]
) -> None:
    file = tmp_path / "file.yaml"
    file.write_text(f"rendergraph: 1\nextends: deferred\nscene: cornell_box\n{size}")
    assert rg.load(file, **keywords).link().graph.size == expected


def test_pipelines_are_compared_at_the_first_ones_shape(tmp_path: Path) -> None:
    wide = tmp_path / "wide.yaml"
    wide.write_text("rendergraph: 1\nextends: deferred\nscene: cornell_box\nsize: [1280, 720]\n")
    pipelines, notes = match_scene_and_size([rg.load("deferred", scene="cornell_box"), rg.load(wide)])
    assert [pipeline.link().graph.size for pipeline in pipelines] == [(720, 720), (720, 720)]
    assert notes == ["'wide' is rendered at the size of 'deferred': 720×720"]
