"""Scene files: every key, all mistakes at once, placement, overrides, and the shipped scenes."""

from __future__ import annotations

import math
import shutil
from pathlib import Path

import numpy as np
import pytest

from rendergraph.errors import InputError
from rendergraph.resources import shipped_scenes
from rendergraph.scene.load import load
from rendergraph.scene.model import ImageSource, Scene, SceneLimits

EXAMPLE = """
scene: 1
objects:
  floor:  {shape: plane, size: [10, 10], material: white}
  box:    {shape: box, size: [1, 2, 1], at: [0, 1, 0], rotate_degrees: [0, 30, 0], scale: 1, material: red,
           casts_shadow: true}
  helmet: {file: helmet.glb, at: [0, 1, 0], overrides: {Mesh: {material: red, hidden: false}}}
materials:
  white: {base_color: [0.7, 0.7, 0.7], roughness: 0.9, metallic: 0}
  red:   {base_color: [0.63, 0.06, 0.05], roughness: 0.8, emissive: [0, 0, 0], base_color_texture: brick.png}
lights:
  sun:  {type: directional, direction: [-1, -2, -1], intensity: 3.0, color: [1, 1, 1]}
  lamp: {type: spot, at: [0, 3, 0], direction: [0, -1, 0], intensity: 40, inner_degrees: 20, outer_degrees: 30,
         range: 10}
cameras:
  main: {eye: [0, 1.5, 4], target: [0, 1, 0], fov_y_degrees: 45, near: 0.05, far: 100}
environment: {file: sky.hdr, intensity: 1, rotate_degrees: 0}
keyframes: {cameras.main.eye: {0: [0, 1.5, 4], 2.0: [2, 1.5, 3.5]}}     # seconds: value, linear between
orbit: {camera: main, degrees_per_second: 30}
"""


def read(tmp_path: Path, text: str, **options: object) -> Scene:
    path = tmp_path / "a.yaml"
    path.write_text(text)
    return load(path, **options)  # type: ignore[arg-type]  # options of load


@pytest.fixture
def folder(tmp_path: Path, shared: Path) -> Path:
    """A folder with everything the example names."""
    shutil.copyfile(shared / "assets/gltf/BoxTextured.glb", tmp_path / "helmet.glb")
    shutil.copyfile(next((shared / "assets/sponza/textures").glob("*.png")), tmp_path / "brick.png")
    (tmp_path / "sky.hdr").write_bytes(b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 4 +X 8\n" + bytes(128))
    return tmp_path


def test_the_example_of_the_design(folder: Path) -> None:
    text = EXAMPLE.replace("Mesh:", "node_1:")
    scene = read(folder, text)
    assert scene.warnings == ()
    assert [entry.name for entry in scene.objects] == ["floor", "box", "helmet/node_1"]
    assert [scene.materials[entry.material].name for entry in scene.objects] == ["white", "red", "red"]
    assert scene.materials[1].textures["base_color"].srgb
    lamp = scene.lights[1]
    assert (lamp.inner, lamp.outer, lamp.range) == (math.radians(20), math.radians(30), 10)
    sun = scene.lights[0]
    assert np.allclose(sun.direction, np.array([-1, -2, -1]) / math.sqrt(6))
    assert scene.cameras["main"].fov_y == math.radians(45)
    assert scene.environment is not None
    assert str(scene.environment.image.label) == "sky.hdr"
    assert scene.keyframes["cameras.main.eye"].at(2.0) == (2, 1.5, 3.5)
    assert scene.orbit is not None
    assert scene.orbit.degrees_per_second == 30


def test_placement_scales_turns_and_moves(tmp_path: Path) -> None:
    text = "scene: 1\nobjects:\n  b: {shape: box, at: [1, 2, 3], rotate_degrees: [0, 90, 0], scale: [2, 1, 1]}\n"
    (entry,) = read(tmp_path, text).objects
    assert np.allclose(entry.transform @ (1, 0, 0, 1), (1, 2, 1, 1))
    assert np.allclose(entry.transform @ (0, 1, 0, 1), (1, 3, 3, 1))


def test_one_shape_is_one_mesh_and_a_grid_has_its_materials(tmp_path: Path) -> None:
    text = """
scene: 1
objects:
  a: {shape: sphere, radius: 1}
  b: {shape: sphere, radius: 1}
  g: {shape: sphere_grid, columns: 2, rows: 2, material: m}
materials: {m: {base_color: [1, 0, 0]}}
"""
    scene = read(tmp_path, text)
    assert len(scene.meshes) == 2
    assert [entry.name for entry in scene.objects] == ["a", "b", "g/0_0", "g/1_0", "g/0_1", "g/1_1"]
    last = scene.materials[scene.objects[-1].material]
    assert (last.name, last.roughness, last.metallic, last.base_color) == ("g/1_1", 1, 1, (1, 0, 0, 1))


def test_one_number_is_a_grey(tmp_path: Path) -> None:
    text = "scene: 1\nobjects: {b: {shape: box, material: m}}\nmaterials: {m: {base_color: 0.5, emissive: 2}}\n"
    (material,) = read(tmp_path, f"{text}lights: {{sun: {{type: directional, color: 0.25}}}}\n").materials
    assert material.base_color == (0.5, 0.5, 0.5, 1)
    assert material.emissive == (2, 2, 2)


def test_a_file_brings_its_lights_and_cameras_placed(tmp_path: Path, shared: Path) -> None:
    shutil.copyfile(shared / "reference/b2_shadows/spot_basic/scene.glb", tmp_path / "s.glb")
    text = "scene: 1\nobjects:\n  room: {file: s.glb, at: [0, 10, 0], material: m}\nmaterials: {m: {}}\n"
    scene, alone = read(tmp_path, text), load(tmp_path / "s.glb")
    (light,), (camera,) = scene.lights, scene.cameras.values()
    assert light.name == "room/spot"
    assert camera.name == "room/camera"
    assert np.allclose(np.subtract(light.position, alone.lights[0].position), (0, 10, 0))
    assert np.allclose(light.direction, alone.lights[0].direction)
    assert {scene.materials[entry.material].name for entry in scene.objects} == {"m"}


def test_the_same_file_is_read_once(tmp_path: Path, shared: Path) -> None:
    shutil.copyfile(shared / "assets/gltf/BoxTextured.glb", tmp_path / "b.glb")
    scene = read(tmp_path, "scene: 1\nobjects:\n  a: {file: b.glb}\n  b: {file: b.glb, hidden: true}\n")
    assert len(scene.meshes) == 1
    assert [entry.hidden for entry in scene.objects] == [False, True]


def test_cameras_of_all_types(tmp_path: Path) -> None:
    text = """
scene: 1
cameras:
  flat: {eye: [0, 5, 0], height: 4, far: 20}
  endless: {far: .inf, target: [1, 0, 0]}
  off: {frustum: [-0.1, 0.2, -0.1, 0.1], near: 0.1}
"""
    found = read(tmp_path, text).cameras
    assert [camera.type for camera in found.values()] == ["orthographic", "perspective", "frustum"]
    assert math.isinf(found["endless"].far)
    assert found["off"].frustum == (-0.1, 0.2, -0.1, 0.1)


def test_null_is_the_default(tmp_path: Path) -> None:
    scene = read(tmp_path, "scene: 1\nobjects:\n  b: {shape: box, size: null, at: null}\nlights:\ncameras: null\n")
    assert scene.meshes[0].box[1].tolist() == [0.5, 0.5, 0.5]


WRONG = {
    "objcts: {}": "2:1: RG320 a scene file has no key 'objcts'; did you mean 'objects'?",
    "objects: [1]": "2:10: RG321 'objects': expected a mapping, got [1]",
    "objects: {a: {shape: bx}}": "2:22: RG321 'shape': expected one of plane, box,",
    "objects: {a: {shape: box, radius: 1}}": "2:27: RG320 object 'a' has no key 'radius'",
    "objects: {a: {}}": "2:11: RG321 object 'a' needs either 'shape' or 'file'",
    "objects: {a: }": "2:11: RG321 object 'a' needs either 'shape' or 'file'",
    "objects: {a: {shape: box, file: a.glb}}": "2:11: RG321 object 'a' needs either",
    "objects: {a: {file: a.glb}}": "2:21: RG301 file 'a.glb' does not exist",
    "objects: {a: {file: a.yaml}}": "2:21: RG303 'a.yaml' is not a mesh file",
    "objects: {a: {shape: plane, size: [10, -1]}}": "2:35: RG321 'size': expected a list of 2 numbers above 0, got [10, -1]",
    "objects: {a: {shape: box, hidden: yes}}": "2:35: RG321 'hidden': expected true or false, got 'yes'",
    "objects: {a: {shape: box, at: [0, .nan, 0]}}": "RG321 'at': expected a list of 3 numbers, got [0, nan, 0]",
    "objects: {a: {shape: box, at: [0, 1e300, 0]}}": "RG321 'at': expected a list of 3 numbers, got [0, 1e+300, 0]",
    "objects: {a: {shape: sphere, segments: 1.5}}": "expected a whole number from 3 to 2048, got 1.5",
    "objects: {a: {shape: box, material: red}}": "no material 'red'; there are no materials",
    "materials: {m: {base_color: [1, 2, 0]}}": "expected a number or a list of 3 or 4 numbers from 0 to 1, got [1, 2, 0]",
    "materials: {m: {alpha_mode: Mask}}": "2:29: RG321 'alpha_mode': expected one of opaque, mask, blend, got 'Mask'; did you mean 'mask'?",
    "materials: {m: {normal_texture: a.png}}": "2:33: RG350 image 'a.png' does not exist",
    "lights: {l: {intensity: 1}}": "2:10: RG321 light 'l' needs 'type'",
    "lights: {l: {type: spot, inner_degrees: 50}}": "'inner_degrees' (50) must be below 'outer_degrees' (45)",
    "lights: {l: {type: point, range: 0}}": "'range': expected a number above 0, got 0",
    "lights: {l: {type: directional, direction: [0, 0, 0]}}": "light 'l': 'direction' has no length",
    "cameras: {c: {eye: [1, 1, 1], target: [1, 1, 1]}}": "2:11: RG321 camera 'c': eye and target coincide",
    "cameras: {c: {near: 5, far: 1}}": "'near' (5) must be below 'far' (1)",
    "cameras: {c: {height: 1, far: .inf}}": "an orthographic camera needs a finite 'far'",
    "cameras: {c: {height: 1, fov_y_degrees: 45}}": "has both 'fov_y_degrees' and 'height'",
    "cameras: {c: {frustum: [1, 0, 0, 1]}}": "must be left < right",
    "environment: {}": "RG321 environment needs 'file'",
    "environment: {file: ../../sky.hdr}": "RG302",
    "orbit: {camera: man}": "2:17: RG322 there is no camera 'man'; there are no cameras",
    "keyframes: {cameras.m.eye: {0: [0, 0, 0]}}": "2:13: RG322 keyframes: there is no 'm' under cameras",
    "keyframes: {camera.m.eye: {0: 1}}": "keyframes: there is no section 'camera'; did you mean 'cameras'?",
    "cameras: {m: {}}\nkeyframes: {cameras.m.eyes: {0: 1}}": "3:13: RG322 keyframes: cameras have no moving key 'eyes'",
    "cameras: {m: {}}\nkeyframes: {cameras.m.eye: {0: 1}}": "3:32: RG321 'eye': expected a list of 3 numbers, got 1",
    "cameras: {m: {}}\nkeyframes: {cameras.m.eye: {a: [1, 2, 3]}}": "'a' is not a time in seconds",
    "cameras: {m: {}}\nkeyframes: {cameras.m.eye: {}}": "are empty, not a mapping of seconds to values",
    "cameras: {m: {}}\nkeyframes: {cameras.m.eye: {1: null}}": "keyframe 1 s of 'cameras.m.eye' has no value",
}


def test_names_that_are_numbers_are_mistakes_beside_others(tmp_path: Path) -> None:
    with pytest.raises(InputError) as error:
        read(tmp_path, "scene: 1\nmaterials: {1: {}, red: {}}\nobjects: {a: {shape: box, material: rad}}\n")
    texts = [problem.text for problem in error.value.problems]
    assert texts == [
        "'1' is not a name; use text without control characters",
        "there is no material 'rad'; did you mean 'red'?",
    ]


def test_an_image_prints_its_name_and_size() -> None:
    assert repr(ImageSource(Path("a.glb"), b"\0" * 1000, "wood")) == "<ImageSource wood, 1000 bytes>"


@pytest.mark.parametrize("text", WRONG)
def test_mistake_has_its_place_and_a_way_out(tmp_path: Path, text: str) -> None:
    with pytest.raises(InputError) as error:
        read(tmp_path, f"scene: 1\n{text}\n")
    (problem,) = error.value.problems
    assert WRONG[text] in str(problem)
    assert problem.place is not None
    assert problem.place.line >= 2


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "expected a scene file, a mapping"),
        ("- 1", "expected a scene file, a mapping"),
        ("objects: {}", "a scene file needs 'scene'; add scene: 1"),
        ("scene: 2", "'scene': expected 1, the version of the format that this program reads, as in scene: 1, got 2"),
        ("scene: 1\na: [", "RG0"),
    ],
)
def test_not_a_scene(tmp_path: Path, text: str, says: str) -> None:
    with pytest.raises(InputError, match=says):
        read(tmp_path, text)


def test_all_mistakes_at_once_in_the_files_order(tmp_path: Path) -> None:
    with pytest.raises(InputError) as error:
        read(tmp_path, "scene: 1\nlights:\n  l: {}\nobjects:\n  a: {shape: bx}\n  b: {shape: box, sise: 1}\n")
    lines = [problem.place.line for problem in error.value.problems if problem.place]
    assert len(lines) == 3
    assert lines == sorted(lines)


def test_overrides_name_nodes_of_the_file(folder: Path) -> None:
    with pytest.raises(InputError, match="RG322 object 'helmet': its file has no node 'Mesh'"):
        read(folder, EXAMPLE)


def test_shapes_beyond_the_limit(tmp_path: Path) -> None:
    text = "scene: 1\nobjects: {a: {shape: sphere, segments: 2048, rings: 1024}}\n"
    with pytest.raises(InputError, match=r"a\.yaml:2:14: RG307 shapes have 2,100,225 vertices"):
        read(tmp_path, text, limits=SceneLimits(vertices=1_000_000))


def test_check_path_is_asked_for_every_file(folder: Path) -> None:
    asked = []

    def check(path: Path, place: object) -> Path:
        asked.append(path.name)
        return path

    read(folder, EXAMPLE.replace("Mesh:", "node_1:"), check_path=check)
    assert set(asked) == {"helmet.glb", "brick.png", "sky.hdr"}


@pytest.mark.parametrize("name", sorted(shipped_scenes()))
def test_shipped_scene(name: str) -> None:
    path = shipped_scenes()[name]
    lines = path.read_text().splitlines()
    assert lines[0].startswith("# ")
    longer = {"many_lights": 120, "courtyard": 60, "arcade": 80}  # whose bulbs and stones differ from each other
    assert len(lines) <= longer.get(name, 40)
    scene = load(path)
    assert scene.warnings == ()
    assert scene.lights
    assert "main" in scene.cameras


def test_shipped_scenes_are_all_there() -> None:
    assert set(shipped_scenes()) >= {"cornell_box", "spheres", "shadow_study", "stairs", "many_lights", "glass"}


@pytest.mark.slow
def test_what_casts_shadows_in_shipped_scenes_is_closed() -> None:
    """Shadow volumes need closed casters: open planes must not cast. Leaves are masked, for shadow maps alone."""
    for path in shipped_scenes().values():
        scene = load(path)
        for entry in scene.objects:
            if scene.materials[entry.material].alpha_mode == "mask":
                continue
            assert not (entry.casts_shadow and scene.meshes[entry.mesh].edges.gap), (path.name, entry.name)


def test_cornell_box_is_lit_by_a_spot_under_its_ceiling() -> None:
    scene = load(shipped_scenes()["cornell_box"])
    (lamp,) = scene.lights
    assert lamp.type == "spot"
    assert lamp.direction == (0, -1, 0)
    inward = {entry.name: entry.transform[:3, 1].round(6).tolist() for entry in scene.objects}
    assert inward["ceiling"] == [0, -1, 0]
    assert inward["left"] == [1, 0, 0]
    assert inward["right"] == [-1, 0, 0]
    assert inward["back"] == [0, 0, 1]
