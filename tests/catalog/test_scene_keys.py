"""Keys that plugins add to scene files: declaration, values for nodes, motion, images, lists and mistakes."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pytest

import rendergraph as rg
from rendergraph import images
from rendergraph.api import Extension, Image, SceneKey
from rendergraph.catalog import Catalog
from rendergraph.declare.extensions import extension_mistakes
from rendergraph.errors import InputError
from rendergraph.keys import file_schema
from rendergraph.reference import file_keys, table_of
from rendergraph.scene import animate
from rendergraph.scene.facts import FrameScene
from rendergraph.scene.load import load
from rendergraph.scene.model import Scene

KEYS = """
from typing import Literal

from rendergraph.api import Extension, Image, SceneKey

LENS = SceneKey("lens_radius", float, "Radius of the lens.", 0.0, "m", min=0, max=1)
TINT = SceneKey("tint", tuple[float, float, float], "Colour of the coat.", (1.0, 1.0, 1.0), min=0)
HEIGHT = SceneKey("height_texture", Image, "Height in red.")
SIDES = SceneKey("sides", int, "Sides of an area light.", 4, min=3, max=12)
PHASE = SceneKey("phase", float, "Moment of its motion.", 0.25)
KIND = SceneKey("fur", Literal["short", "long"], "Kind of fur.", "short")
SOLID = SceneKey("solid", bool, "Whether it is solid.", True)
EXTENSION = Extension(
    scene_keys={
        "cameras": (LENS,),
        "materials": (TINT, HEIGHT, KIND),
        "lights": (SIDES, PHASE),
        "objects": (PHASE, SOLID),
    }
)
"""
NODE = '''
import numpy as np

from rendergraph.api import Any, Internal, Node, Output, Radiance, Steps

from .extension import HEIGHT, LENS, PHASE, TINT

calls = []


class Values(Node):
    """Values of plugins' keys as texels."""

    tints = Output(Radiance, format="rgba32f", size=lambda node, facts: (len(facts.materials), 1), doc="By material.")
    lens = Output(Radiance, format="r32f", size=(2, 1), doc="Of the camera.")
    phases = Output(Any, format="r32f", size=lambda node, facts: (len(facts.objects), 1), doc="By object.")
    height = Output(Any, format="r32f", size=lambda node, facts: image(facts.materials).size, doc="The first image.")

    def record(self, steps: Steps) -> None:
        steps.upload(self.tints, of_materials, changes_with=["materials"])
        steps.upload(self.lens, lambda scene: np.array([[LENS.of(scene.camera), LENS.of(steps.facts.camera)]], np.float32),
                     changes_with=["camera"])
        steps.upload(self.phases, lambda scene: np.array([[PHASE.of(o) for o in scene.objects]], np.float32),
                     changes_with=["transforms"])
        steps.upload(self.height, lambda scene: scene.pixels(image(scene.materials))[..., :1], changes_with=["materials"])


def image(materials):
    return next(found for found in map(HEIGHT.of, materials) if found is not None)


def of_materials(scene):
    calls.append(len(scene.materials))
    return np.array([[(*TINT.of(material), 1) for material in scene.materials]], np.float32)
'''
SCENE = """
scene: 1
objects:
  a: {shape: box, phase: 2, material: plain}
  b: {shape: box, material: coated, repeat: {line: 2}}
materials:
  plain: {}
  coated: {tint: [1, 0.5, 0.25], height_texture: images/bumps.png, fur: long}
lights:
  key: {type: directional}
  lamp: {type: point, sides: 6, repeat: {line: 2}}
cameras:
  main: {lens_radius: 0.02}
"""
Home = Callable[..., Path]


@pytest.fixture
def home(tmp_path: Path) -> Path:
    """A plugin's folder with a scene, its image and a pipeline in it."""
    folder = tmp_path / "coats"
    (folder / "images").mkdir(parents=True)
    (folder / "extension.py").write_text(KEYS)
    (folder / "values.py").write_text(NODE)
    ramp = np.zeros((2, 3, 3), np.uint8)
    ramp[..., 0] = [[0, 51, 102], [153, 204, 255]]
    images.write(folder / "images" / "bumps.png", ramp)
    (folder / "scene.yaml").write_text(SCENE)
    outputs = ", ".join(f"{name}: values.{name}" for name in ("tints", "lens", "phases", "height"))
    text = f"rendergraph: 1\nsize: [8, 8]\nscene: scene.yaml\nnodes: {{values: {{type: values}}}}\noutputs: {{{outputs}}}\n"
    (folder / "p.yaml").write_text(text)
    return folder


def read(home: Path, text: str) -> Scene:
    (home / "scene.yaml").write_text(text if text.startswith("\nscene") else f"scene: 1\n{text}\n")
    return load(home / "scene.yaml", extensions=Catalog.discover([home], installed=False).extensions)


def keys_of(home: Path) -> Any:
    """The module of the plugin's extension, which has the keys."""
    Catalog.discover([home], installed=False).extensions.scene_keys("cameras")
    return next(m for m in sys.modules.values() if getattr(m, "__file__", "") == str(home / "extension.py"))


def test_entries_have_their_values_and_defaults(home: Path) -> None:
    scene, keys = read(home, SCENE), keys_of(home)
    frame = FrameScene(animate.complete(scene))
    assert [keys.TINT.of(material) for material in frame.materials] == [(1, 1, 1), (1, 0.5, 0.25)]
    assert [keys.KIND.of(material) for material in frame.materials] == ["short", "long"]
    assert [keys.SIDES.of(light) for light in frame.lights] == [4, 6, 6]
    assert [keys.PHASE.of(entry) for entry in frame.objects] == [2, 0.25, 0.25]
    assert keys.LENS.of(frame.camera) == 0.02
    image = keys.HEIGHT.of(frame.materials[1])
    assert (image.size, image.channels) == ((3, 2), 3)
    assert scene.objects[1].extra == {}


def test_nodes_read_them_and_see_them_move(home: Path, gl: rg.Session) -> None:
    moving = """
keyframes:
  materials.plain.tint: {0: [0, 0, 0], 1: [4, 8, 12]}
  cameras.main.lens_radius: {0: 0.1, 1: 0.5}
  objects.b.phase: {0: 0, 1: 1}
"""
    (home / "scene.yaml").write_text(SCENE + moving)
    pipeline = rg.load(home / "p.yaml", plugins=[home])
    frames = list(pipeline.frames(session=gl, frames=range(1, 4), fps=2))
    for frame, share in zip(frames, (0.0, 0.5, 1.0), strict=True):
        np.testing.assert_allclose(frame["tints"][0, 0, :3], share * np.array([4, 8, 12]))
        np.testing.assert_allclose(frame["tints"][0, 1, :3], [1, 0.5, 0.25])
        np.testing.assert_allclose(frame.arrays["lens"].ravel(), [0.1 + 0.4 * share, 0.02], rtol=1e-6)
        np.testing.assert_allclose(frame.arrays["phases"].ravel(), [2, share, share])
        height = frame.arrays["height"].reshape(2, 3)[::-1]  # a frame begins at the top, a texture at row 0
        np.testing.assert_allclose(height, np.arange(6).reshape(2, 3) / 5, atol=1e-6)


def test_values_are_uploaded_again_only_where_they_have_changed(home: Path, gl: rg.Session) -> None:
    (home / "scene.yaml").write_text(SCENE + "\nkeyframes: {objects.a.at: {0: [0, 0, 0], 1: [1, 0, 0]}}\n")
    pipeline = rg.load(home / "p.yaml", plugins=[home])
    for _ in pipeline.frames(session=gl, frames=range(1, 4)):
        pass
    (module,) = [m for m in sys.modules.values() if getattr(m, "__file__", "") == str(home / "values.py")]
    assert module.calls == [2]


def test_a_scene_without_them_imports_nothing(home: Path) -> None:
    (home / "extension.py").write_text("raise SystemExit")
    assert read(home, "materials: {m: {}}").materials[0].extra == {}


def test_files_take_keys_of_objects_as_a_whole_and_by_part(home: Path, shared: Path) -> None:
    (home / "b.glb").write_bytes((shared / "assets/gltf/BoxTextured.glb").read_bytes())
    keys = keys_of(home)
    scene = read(home, "objects: {a: {file: b.glb, phase: 3, overrides: {node_1: {solid: false}}}}")
    (entry,) = scene.objects
    assert (keys.PHASE.of(entry), keys.SOLID.of(entry)) == (3, False)
    moved = "keyframes: {objects.a.phase: {0: 0, 1: 8}}"
    later = animate.at(
        read(home, f"objects: {{a: {{file: b.glb, overrides: {{node_1: {{solid: false}}}}}}}}\n{moved}"), 0.5
    )
    assert (keys.PHASE.of(later.objects[0]), keys.SOLID.of(later.objects[0])) == (4, False)


WRONG = {
    "materials: {m: {tnt: [1, 1, 1]}}": "2:17: RG320 material 'm' has no key 'tnt'; did you mean 'tint'?",
    "cameras: {c: {tint: [1, 1, 1]}}": "2:15: RG320 camera 'c' has no key 'tint'",
    "cameras: {c: {lens_radius: 2}}": "2:28: RG321 'lens_radius': expected a number from 0 to 1, got 2",
    "materials: {m: {tint: [1, -1, 1]}}": "2:23: RG321 'tint': expected a list of 3 numbers from 0 up, got [1, -1, 1]",
    "materials: {m: {fur: lang}}": "2:22: RG321 'fur': expected one of short, long, got 'lang'; did you mean 'long'?",
    "lights: {l: {type: point, sides: 2.5}}": "2:34: RG321 'sides': expected a whole number from 3 to 12, got 2.5",
    "materials: {m: {height_texture: gone.png}}": "2:33: RG350 image 'gone.png' does not exist",
    "materials: {m: {height_texture: ../../x.png}}": "RG302",
    "materials: {m: {}}\nkeyframes: {materials.m.fur: {0: short}}": "RG322 keyframes: materials have no moving key 'fur'",
    "materials: {m: {}}\nkeyframes: {materials.m.tint: {0: 1}}": "3:35: RG321 'tint': expected a list of 3 numbers",
    "materials: {m: {}}\nkeyframes: {materials.m.tnt: {0: 1}}": "no moving key 'tnt'; did you mean 'tint'?",
}


@pytest.mark.parametrize("text", WRONG)
def test_mistakes_are_those_of_other_keys(home: Path, text: str) -> None:
    with pytest.raises(InputError) as error:
        read(home, text)
    (problem,) = error.value.problems
    assert WRONG[text] in str(problem)


def test_a_broken_plugin_is_said_beside_the_unknown_key(home: Path) -> None:
    (home / "extension.py").write_text("1 / 0")
    with pytest.raises(InputError) as error:
        read(home, "materials: {m: {tint: [1, 1, 1]}}")
    assert sorted(problem.code for problem in error.value.problems) == ["RG320", "RG494"]


def test_a_key_of_two_plugins_is_an_error_for_who_uses_it(home: Path) -> None:
    other = home.parent / "paints"
    other.mkdir()
    (other / "extension.py").write_text(KEYS)
    (home / "scene.yaml").write_text(SCENE)
    extensions = Catalog.discover([home, other], installed=False).extensions
    with pytest.raises(InputError, match=r"RG496 key of objects 'phase' comes from 'coats' .* and 'paints'"):
        load(home / "scene.yaml", extensions=extensions)


@pytest.mark.parametrize(("section", "name"), [("materials", "roughness"), ("objects", "radius"), ("objects", "file")])
def test_a_key_of_rendergraph_cannot_be_taken(home: Path, section: str, name: str) -> None:
    head = KEYS.partition("LENS =")[0]
    text = f'{head}EXTENSION = Extension(scene_keys={{"{section}": (SceneKey("{name}", float, "x"),)}})\n'
    (home / "extension.py").write_text(text)
    with pytest.raises(InputError, match=rf"RG495 plugin 'coats': scene_keys\['{section}'\] has '{name}', a key of"):
        read(home, "lights: {l: {tpye: point}}")


@pytest.mark.parametrize(
    ("key", "says"),
    [
        (SceneKey("Lens", float, "x"), "has a name that is not a word of lower-case letters"),
        (SceneKey("lens", list, "x"), "has the type <class 'list'>; use float, int, bool, str, a Literal of words"),
        (SceneKey("lens", tuple[float], "x"), "a tuple of 2 to 16 floats or Image"),
        (SceneKey("lens", tuple[int, int], "x"), "a tuple of 2 to 16 floats or Image"),
        (SceneKey("lens", Literal[1, 2], "x"), "a Literal of words"),
        (SceneKey("lens", float, "x", 2.0, max=1), "has the default 2.0, which is not a legal value"),
        (SceneKey("lens", float, "x", min=2, max=1), "has an empty range: min 2 > max 1"),
        (SceneKey("lens", bool, "x", min=0), "has limits, which are for numbers"),
        (SceneKey("lens", Image, "x", "a.png"), "is an image, which has no default"),
        (SceneKey("lens", float, " "), "has no documentation"),
    ],
)
def test_wrong_declarations(key: SceneKey, says: str) -> None:
    (problem,) = extension_mistakes(Extension(scene_keys={"cameras": (key,)}), Path())
    assert problem.text.startswith(f"scene_keys['cameras']: the key '{key.name}' ")
    assert says in problem.text


def test_other_wrong_declarations() -> None:
    key = SceneKey("lens", float, "x", 1)
    (twice, _) = extension_mistakes(Extension(scene_keys={"cameras": (key, key)}), Path())
    assert "the key 'lens' is listed twice" in twice.text
    wrong: Any = {"camera": (key,)}
    (section,) = extension_mistakes(Extension(scene_keys=wrong), Path())
    assert "scene_keys has the key 'camera', which is not one of objects, materials, lights, cameras" in section.text


def test_lists_and_the_schema_have_them(home: Path) -> None:
    extensions = Catalog.discover([home], installed=False).extensions
    rows = {(row["section"], row["key"]): row for row in file_keys("scene", extensions)}
    row = rows["cameras", "lens_radius"]
    assert (row["value"], row["default"], row["unit"]) == ("number", 0.0, "m")
    assert row["doc"] == "Radius of the lens. (plugin 'coats')"
    assert rows["materials", "height_texture"]["value"] == "path"
    listed = {(one["kind"], one["name"], one["plugin"], one["doc"]) for one in extensions.listed()}
    assert ("key of lights", "sides", "coats", "Sides of an area light.") in listed
    fastjsonschema = pytest.importorskip("fastjsonschema")
    validate = fastjsonschema.compile(file_schema(table_of("scene", extensions)))
    frames = {"keyframes": {"materials.m.tint": {"0": [1, 1, 1]}}}
    validate({"scene": 1, "materials": {"m": {"tint": [1, 0, 0]}}, "cameras": {"c": {"lens_radius": 0.5}}} | frames)
    for wrong in ({"cameras": {"c": {"lens_radius": 2}}}, {"lights": {"l": {"type": "point", "tint": [1, 1, 1]}}}):
        with pytest.raises(fastjsonschema.JsonSchemaException):
            validate({"scene": 1, **wrong})
