"""What plugins add beside node types: finding it, looking it up, and what is wrong with it."""

from __future__ import annotations

import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

import rendergraph as rg
from rendergraph.catalog import Catalog
from rendergraph.errors import InputError
from rendergraph.resources import folder

HEAD = "from rendergraph.api import Extension, MeshData, Semantic\n"
TOON = """// Three steps of light.
#include "steps.glsl"
ReflectedLight shade(Surface s, vec3 light_dir) {
    return ReflectedLight(s.diffuse * stepped(max(dot(s.normal, light_dir), 0.0)), vec3(0.0));
}
"""
STEPS = "float stepped(float NoL) { return floor(NoL * 3.0) / 3.0; }\n"
Write = Callable[..., Path]


@pytest.fixture
def write(tmp_path: Path) -> Write:
    """Writes a plugin's folder: the module of the extension, and files beside it."""

    def make(extension: str, name: str = "sketch", **files: str) -> Path:
        home = tmp_path / name
        home.mkdir()
        (home / "extension.py").write_text(HEAD + extension)
        for stem, text in ({"toon_glsl": TOON, "steps_glsl": STEPS} | files).items():
            (home / stem.replace("_", ".")).write_text(text)
        return home

    return make


def found(*folders: Path) -> Catalog:
    return Catalog.discover(folders, installed=False)


def page(code: str) -> dict[str, Any]:
    (path,) = folder("rendergraph.errors").glob(f"{code}-*.yaml")
    read: dict[str, Any] = yaml.safe_load(path.read_text())
    return read


# --- finding -------------------------------------------------------------------------------------------------------


def test_nothing_is_imported_before_a_name_is_asked_for(write: Write) -> None:
    home = write("raise SystemExit")
    catalog = found(home)
    assert catalog.names() == []
    rg.load("forward", plugins=[home], size=(8, 8)).check()
    assert [problem.code for problem in catalog.extensions.problems] == ["RG494"]


def test_an_installed_extension_comes_by_its_entry_point(write: Write, tmp_path: Path) -> None:
    home = write('EXTENSION = Extension(semantics=(Semantic("heat", "Kelvin."),))', "hot_plugin")
    (home / "__init__.py").touch()
    info = tmp_path / "hot_plugin-1.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: hot-plugin\nVersion: 1\n")
    (info / "entry_points.txt").write_text("[rendergraph.extensions]\nx = hot_plugin.extension:EXTENSION\n")
    program = (
        "import sys; from rendergraph.catalog import Catalog\n"
        "extensions = Catalog.discover().extensions\n"
        "assert 'hot_plugin' not in sys.modules\n"
        "print(extensions.semantic('radiance').name, 'hot_plugin' in sys.modules)\n"
        "print(extensions.semantic('heat').doc, extensions.semantics()[0].plugin)\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", program], env={"PYTHONPATH": str(tmp_path)}, capture_output=True, text=True, check=False
    )
    assert done.stdout.split() == ["radiance", "False", "Kelvin.", "hot-plugin"], done.stderr


# --- mistakes ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("code", ["RG494", "RG495"])
def test_the_pages_tell_the_truth(code: str, write: Write, monkeypatch: pytest.MonkeyPatch) -> None:
    home = write("")
    monkeypatch.chdir(home)
    (home / "stl.py").write_text("def read_stl(path): ...\n")
    for text, said in ((page(code)["wrong"], [page(code)["message"]]), (page(code)["right"], [])):
        (home / "extension.py").write_text(text)
        assert [str(problem) for problem in found(home).extensions.problems] == said


def test_a_name_of_two_plugins_is_an_error_for_who_asks(write: Write, monkeypatch: pytest.MonkeyPatch) -> None:
    homes = [write('EXTENSION = Extension(choices={"shading": {"toon": "toon.glsl"}})', n) for n in ("first", "second")]
    monkeypatch.chdir(homes[0].parent)
    rg.load("forward", plugins=homes, size=(8, 8)).check()
    with pytest.raises(InputError) as caught:
        rg.load("forward", plugins=homes, size=(8, 8)).set("light.shading", "toon").check()
    assert str(caught.value) == page("RG496")["message"]


def test_plugins_may_share_a_meaning_but_not_disagree(write: Write) -> None:
    same = [write('EXTENSION = Extension(semantics=(Semantic("heat", "K."),))', name) for name in ("a", "b")]
    heat = found(*same).extensions.semantic("heat")
    assert heat is not None
    assert heat.doc == "K."
    other = write('EXTENSION = Extension(semantics=(Semantic("heat", "Joule."),))', "c")
    with pytest.raises(InputError, match=r"RG496 semantic 'heat' comes from 'a' \(.*\) and 'c' \("):
        found(*same, other).extensions.semantic("heat")


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ("EXTENSION = 3", "is int, not an Extension"),
        ("EXTENSIONS = Extension()", "AttributeError: module .* has no attribute 'EXTENSION'"),
        ("EXTENSION = Extension(", r"SyntaxError: '\(' was never closed"),
        ("import nowhere_to_be_found", "ModuleNotFoundError: No module named 'nowhere_to_be_found'"),
        ("EXTENSION = Extension(semantics=(3,))", r"semantics\[0\] is 3, not a Semantic"),
        (
            "EXTENSION = Extension(semantics=Semantic('a', 'b'))",
            "semantics is the Semantic 'a', not a tuple of Semantic",
        ),
        ("EXTENSION = Extension(meshes=[1])", r"meshes is \[1\], not a mapping"),
        ("EXTENSION = Extension(meshes={'.stl': 1})", r"meshes\['\.stl'\] is 1, not a function"),
        (
            "EXTENSION = Extension(meshes={'stl': len})",
            "meshes has the key 'stl', which is not a file's ending, a dot and lower-case letters",
        ),
        ("EXTENSION = Extension(meshes={'.obj': len})", "meshes has '.obj', which rendergraph reads itself"),
        ("EXTENSION = Extension(images={'.png': len})", "images has '.png', which rendergraph reads itself"),
        ("EXTENSION = Extension(metrics={'flip': len})", "metric 'flip' is one of rendergraph's own"),
        (
            "EXTENSION = Extension(metrics={'l-1': len})",
            "metrics has the key 'l-1', which is not a word of lower-case letters",
        ),
        (
            "EXTENSION = Extension(choices={'shading': 'toon.glsl'})",
            r"choices\['shading'\] is 'toon.glsl', not a mapping",
        ),
        (
            "EXTENSION = Extension(choices={'shading': {'Toon': 'toon.glsl'}})",
            "has the key 'Toon', which is not a word of lower-case letters",
        ),
        ("EXTENSION = Extension(choices={'shading': {'toon': 3}})", "is 3, not the name of an include"),
    ],
)
def test_mistakes_name_the_plugin_and_its_file(write: Write, wrong: str, said: str) -> None:
    home = write(wrong)
    (problem,) = found(home).extensions.problems
    assert problem.place is not None
    assert problem.place.file == str(home / "extension.py")
    assert "'sketch'" in problem.message
    assert re.search(said, problem.message), problem.message


def test_what_a_choice_needs_must_be_on_offer(write: Write) -> None:
    toon = "// A model.\n#pragma needs(grain, fong)\n" + TOON
    home = write('EXTENSION = Extension(choices={"shading": {"toon": "toon.glsl"}})', toon_glsl=toon)
    with pytest.raises(
        InputError, match=r"toon\.glsl:2:1: RG495 'shading' offers no 'fong' to need; did you mean 'phong'"
    ):
        rg.load("forward", plugins=[home], size=(8, 8)).set("light.shading", "toon").check()


def test_a_broken_plugin_is_said_beside_the_unknown_word(write: Write) -> None:
    home = write("1 / 0")
    with pytest.raises(InputError) as caught:
        rg.load("forward", plugins=[home], size=(8, 8)).set("light.shading", "toon").check()
    assert sorted(problem.code for problem in caught.value.problems) == ["RG104", "RG494"]


# --- choices -------------------------------------------------------------------------------------------------------

CHOICES = """EXTENSION = Extension(choices={
    "shading": {"toon": "toon.glsl", "combed": "combed.glsl"},
    "curve": {"halve": "halve.glsl"},
})"""
COMBED = """// Looks at everything there is.
#pragma needs(phong, grain)
ReflectedLight shade(Surface s, vec3 light_dir) {
    return ReflectedLight(s.diffuse * max(dot(s.normal, light_dir), 0.0), s.f0 * (s.anisotropy + 0.001 * s.exponent));
}
"""
HALVE = "// Half of it.\nvec3 tone_curve(vec3 color) { return 0.5 * color; }\n"


@pytest.fixture
def sketch(write: Write) -> Path:
    return write(CHOICES, combed_glsl=COMBED, halve_glsl=HALVE)


def image(gl: rg.Session, name: str, plugin: Path, **settings: str) -> Any:
    pipeline = rg.load(name, plugins=[plugin], scene="cornell_box", size=(48, 48))
    for path, value in settings.items():
        pipeline = pipeline.set(path.replace("__", "."), value)
    return gl.render(pipeline)["image"].astype(int)


@pytest.mark.nightly(keep=1)
@pytest.mark.slow
@pytest.mark.parametrize("shading", ["toon", "combed"])
def test_every_lighting_node_takes_a_plugins_model(gl: rg.Session, sketch: Path, shading: str) -> None:
    forward = image(gl, "forward", sketch, light__shading=shading)
    for name in ("forward-multipass", "deferred", "deferred-stencil-lights"):
        other = image(gl, name, sketch, light__shading=shading)
        # A step of light may fall on the other side where the G-buffer rounds.
        assert (np.abs(forward - other).max(axis=-1) > 2).mean() < 0.005, name
    for evaluate in ("vertex", "face"):
        assert image(gl, "forward", sketch, light__shading=shading, light__evaluate=evaluate).max() > 100
    assert np.abs(forward - image(gl, "forward", sketch)).max() > 10


def test_a_g_buffer_keeps_what_a_plugins_model_needs(sketch: Path) -> None:
    def drawn(shading: str) -> set[str]:
        pipeline = rg.load("deferred", plugins=[sketch], size=(8, 8)).set("light.shading", shading)
        return {
            write.name for step in pipeline.expand().expansion.steps if step.node == "gbuffer" for write in step.writes
        }

    assert "grain" not in drawn("toon")
    assert "phong_diffuse" not in drawn("toon")
    assert {"grain", "phong_diffuse", "phong_specular"} <= drawn("combed")


def test_a_plugins_curve(gl: rg.Session, sketch: Path) -> None:
    plain = image(gl, "forward", sketch, display__curve="none", display__exposure="-1")
    halved = image(gl, "forward", sketch, display__curve="halve")
    assert np.abs(plain - halved).max() <= 1
    assert plain.max() > 50


def test_other_choices_of_plugins_leave_the_program_as_it_is(sketch: Path) -> None:
    steps = rg.load("forward", plugins=[sketch], size=(8, 8)).expand().expansion.steps
    assert not any("TOON" in name for step in steps for name, _ in step.defines)
    assert {file.name for step in steps for _, file in step.includes} == {"pbr.glsl", "neutral.glsl"}


def test_a_pragma_that_is_written_otherwise_is_said(write: Write) -> None:
    home = write(CHOICES, toon_glsl="#pragma needs phong\n" + TOON, combed_glsl=COMBED, halve_glsl=HALVE)
    with pytest.raises(InputError, match=r"toon\.glsl:1:1: RG405 '#pragma needs phong' is not '#pragma needs\(word\)'"):
        rg.load("forward", plugins=[home], size=(8, 8)).set("light.shading", "toon").check()


def test_a_mistake_in_a_plugins_glsl_has_its_file_and_line(gl: rg.Session, write: Write) -> None:
    home = write(CHOICES, combed_glsl=COMBED, halve_glsl=HALVE, steps_glsl="\nfloat stepped(float NoL) { return n; }\n")
    for name in ("forward", "deferred"):
        with pytest.raises(InputError, match=r"steps\.glsl:2:\d+: RG410 .*'?n'? undeclared") as caught:
            image(gl, name, home, light__shading="toon")
        assert "return n;" in str(caught.value)


def test_an_include_of_a_plugin_stays_in_its_folder(gl: rg.Session, write: Write) -> None:
    home = write(CHOICES, combed_glsl=COMBED, halve_glsl='#include "../secret.glsl"\n')
    (home.parent / "secret.glsl").write_text(HALVE)
    with pytest.raises(InputError, match=r"halve\.glsl:1:1: RG406"):
        image(gl, "forward", home, display__curve="halve")


def test_an_unknown_choice_is_answered_with_the_plugins_too(sketch: Path) -> None:
    with pytest.raises(InputError) as caught:
        rg.load("forward", plugins=[sketch], size=(8, 8)).set("light.shading", "tooon").check()
    assert str(caught.value) == (
        "--set light.shading=tooon: RG104 'light.shading': expected one of unlit, phong, blinn_phong, anisotropic, pbr, "
        "toon, combed, got 'tooon'; did you mean 'toon'?"
    )


# --- meanings ------------------------------------------------------------------------------------------------------

HEAT = 'HEAT = Semantic("heat", "Kelvin.")\nEXTENSION = Extension(semantics=(HEAT,))\n'
NODE = '''"""A node."""
from rendergraph.api import Input, Node, Output
from .extension import HEAT


class Warm(Node):
    """Warms."""

    source = Input(HEAT, optional=True, doc="Before.")
    warmer = Output(HEAT, doc="After.")
'''
CELLAR = """rendergraph: 1
inputs: {x: {semantic: %s, optional: true}}
nodes: {again: {type: warm, inputs: {source: inputs.x}}}
outputs: {y: again.warmer}
"""
HOUSE = """rendergraph: 1
size: [8, 8]
nodes:
  first: {type: warm}
  cellar: {type: ./cellar.yaml, inputs: {x: first.warmer}}
outputs: {image: cellar.y}
"""


@pytest.mark.parametrize("said", ["heat", "het"])
def test_a_meaning_in_a_node_and_in_a_sub_pipeline(write: Write, tmp_path: Path, said: str) -> None:
    home = write(HEAT)
    (home / "warm.py").write_text(NODE)
    (tmp_path / "house.yaml").write_text(HOUSE)
    (tmp_path / "cellar.yaml").write_text(CELLAR % said)
    pipeline = rg.load(tmp_path / "house.yaml", plugins=[home])
    if said == "heat":
        pipeline.link()
        return
    with pytest.raises(InputError, match=r"'cellar\.x' expects het, but .* is heat; did you mean 'heat'\?"):
        pipeline.link()


# --- loaders -------------------------------------------------------------------------------------------------------

LOADERS = """
import numpy as np
from .loaders import read_tri, read_raw
EXTENSION = Extension(meshes={".tri": read_tri}, images={".raw": read_raw})
"""
READ = """
import numpy as np
from rendergraph.api import MeshData

def read_tri(path):
    numbers = np.loadtxt(path, ndmin=2)
    if numbers.shape[1] != 3:
        raise ValueError("a row has three numbers")
    return [MeshData(numbers, np.arange(len(numbers)).reshape(-1, 3), name="Piece", colors=numbers * 0 + [0.2, 0, 0])]

def read_raw(data):
    return np.frombuffer(data, np.float32).reshape(2, -1, 3)
"""
TRI = "-1 0 0\n1 0 0\n0 1 0\n"
SCENE = """scene: 1
objects:
  one: {file: a.tri, at: [2, 0, 0]}
  two: {file: a.tri, material: red, overrides: {Piece: {hidden: true}}}
materials:
  red: {base_color: [1, 0, 0]}
environment: {file: sky.raw}
"""


@pytest.fixture
def loaders(write: Write, tmp_path: Path) -> Path:
    home = write(LOADERS, loaders_py=READ)
    (tmp_path / "a.tri").write_text(TRI)
    (tmp_path / "s.yaml").write_text(SCENE)
    np.arange(24, dtype=np.float32).tofile(tmp_path / "sky.raw")
    return home


def test_a_plugins_mesh_is_a_scene(gl: rg.Session, loaders: Path, tmp_path: Path) -> None:
    pipeline = rg.load("forward", plugins=[loaders], scene=tmp_path / "a.tri", size=(32, 32))
    (mesh,) = pipeline.link().scene.meshes
    np.testing.assert_array_equal(mesh.positions, [[-1, 0, 0], [1, 0, 0], [0, 1, 0]])
    np.testing.assert_array_equal(mesh.normals, [[0, 0, 1]] * 3)
    assert mesh.colors is not None
    np.testing.assert_allclose(mesh.colors[0], [0.2, 0, 0, 1])
    assert mesh.name == "Piece"
    assert mesh.indices.dtype == np.uint32
    drawn = gl.render(pipeline)["image"].reshape(-1, 4)
    assert (drawn[:, 0] > 2 * drawn[:, 1].astype(int)).mean() > 0.1


def test_a_plugins_mesh_and_image_in_a_scene_file(gl: rg.Session, loaders: Path, tmp_path: Path) -> None:
    from rendergraph.images import decode_light

    pipeline = rg.load("forward", plugins=[loaders], scene=tmp_path / "s.yaml", size=(8, 8))
    scene = pipeline.link().scene
    assert [thing.name for thing in scene.objects] == ["one/Piece", "two/Piece"]
    assert [thing.hidden for thing in scene.objects] == [False, True]
    assert len(scene.meshes) == 1
    assert scene.materials[scene.objects[1].material].base_color[:3] == (1, 0, 0)
    assert scene.environment is not None
    pixels = decode_light(scene.environment.image)
    assert pixels.shape == (2, 4, 4)
    assert pixels.dtype == np.float16
    np.testing.assert_array_equal(pixels[1, 3], [21, 22, 23, 1])
    gl.render(pipeline)


def test_a_plugins_texture(gl: rg.Session, loaders: Path, tmp_path: Path) -> None:
    reader = "def read_raw(data):\n    return np.full((2, 2, 3), [255, 0, 0], np.uint8)\n"
    (loaders / "loaders.py").write_text(READ.partition("def read_raw")[0] + reader)
    (tmp_path / "t.yaml").write_text(
        "scene: 1\nobjects: {a: {shape: sphere, material: m}}\nmaterials: {m: {base_color_texture: sky.raw}}\n"
    )
    drawn = gl.render(rg.load("forward", plugins=[loaders], scene=tmp_path / "t.yaml", size=(16, 16)))["image"]
    red, green = drawn[8, 8, :2].astype(int)
    assert red > 4 * green + 50


SCENES = """
import numpy as np
from rendergraph.scene.model import Camera, Light, Material, Mesh, Object, Scene

def read_room(path, reading):
    size = float(reading.read(path, "room"))
    if size <= 0:
        raise reading.error("RG304", "a room is larger than 0", line=1)
    plane = np.array([[-size, 0, -size], [-size, 0, size], [size, 0, size], [size, 0, -size]], np.float32)
    up = np.tile(np.array([0, 1, 0], np.float32), (4, 1))
    mesh = Mesh("floor", plane, np.array([[0, 1, 2], [0, 2, 3]], np.uint32), up)
    place = np.eye(4)
    place[:3, 3] = 0, 1, 3
    lamp = Light("lamp", "point", (0.0, 2.0, 0.0), intensity=9.0)
    objects, materials = (Object("floor", 0, 0, np.eye(4), node="floor"),), (Material("red", (1.0, 0.0, 0.0, 1.0)),)
    return Scene("room", path, objects, (mesh,), materials, (lamp,), {"door": Camera("door", place)})

EXTENSION = Extension(scenes={".room": read_room})
"""


def test_a_plugin_reads_a_whole_scene(write: Write, gl: rg.Session, tmp_path: Path) -> None:
    """With its lights and cameras, alone and as an object; the reader says of mistakes in the file itself."""
    home = write(SCENES)
    (tmp_path / "a.room").write_text("4")
    pipeline = rg.load("forward", plugins=[home], scene=tmp_path / "a.room", size=(16, 16), environment="none")
    scene = pipeline.link().scene
    assert ([light.name for light in scene.lights], [*scene.cameras]) == (["lamp"], ["door"])
    red, green, _ = gl.render(pipeline)["image"][15, 8, :3].astype(int)
    assert red > 4 * green + 50
    (tmp_path / "s.yaml").write_text("scene: 1\nobjects: {a: {file: a.room, at: [0, 1, 0]}}\n")
    (object_,) = rg.load("forward", plugins=[home], scene=tmp_path / "s.yaml").link().scene.objects
    assert object_.transform[1, 3] == 1
    (tmp_path / "a.room").write_text("-1")
    with pytest.raises(InputError, match=r"a\.room:1:1: RG304 a room is larger than 0"):
        rg.load("forward", plugins=[home], scene=tmp_path / "a.room").link()


def test_without_the_plugin_its_files_are_nothing(loaders: Path, tmp_path: Path) -> None:
    with pytest.raises(
        InputError,
        match=r"RG303 'a\.tri' is not a scene; a scene ends in \.yaml, \.yml, \.obj, .*, \.glb, \.npz, .*, \.usdz$",
    ):
        rg.load("forward", scene=tmp_path / "a.tri").check()
    with pytest.raises(InputError, match=r"s\.yaml:3:\d+: RG303 'a\.tri' is not a mesh file; a mesh ends in \.obj"):
        rg.load("forward", scene=tmp_path / "s.yaml").check()
    (tmp_path / "a.try").write_text(TRI)
    with pytest.raises(InputError, match=r"a mesh ends in .*, \.tri$|a scene ends in .*, \.tri$"):
        rg.load("forward", plugins=[loaders], scene=tmp_path / "a.try").check()


def test_a_loader_that_raises_is_named_with_its_line(loaders: Path, tmp_path: Path) -> None:
    (tmp_path / "a.tri").write_text("1 2\n")
    line = READ.splitlines().index('        raise ValueError("a row has three numbers")') + 1
    for scene in ("a.tri", "s.yaml"):
        with pytest.raises(InputError) as caught:
            rg.load("forward", plugins=[loaders], scene=tmp_path / scene).check()
        assert (
            f"loaders.py:{line}:1: RG497 mesh 'a.tri' cannot be read: ValueError: a row has three numbers (plugin "
            in (str(caught.value))
        )


@pytest.mark.parametrize(
    ("gives", "said"),
    [
        ("None", "returned NoneType, not MeshData or a list of it"),
        ("[1]", "returned list, not MeshData or a list of it"),
        ("MeshData([[0, 0]], [[0, 0, 0]])", r"whose positions have the shape \(1, 2\), not \(n, 3\)"),
        ("MeshData([[0, 0, float('nan')]], [[0, 0, 0]])", "whose positions are not all finite"),
        ("MeshData([], [])", r"whose positions have the shape \(0,\)"),
        ("MeshData([[0, 0, 0]], [[0, 0, 1]])", "whose indices go from 0 to 1, its positions are 1"),
        ("MeshData([[0, 0, 0]], [[0, 0, -1]])", "whose indices go from -1 to 0"),
        ("MeshData([[0, 0, 0]], [[0., 0, 0]])", "whose indices are float64 of shape"),
        ("MeshData([[0, 0, 0]], [[0, 0, 0]], normals=[[0, 0, 1]] * 2)", "whose normals are 2, its positions 1"),
        ("MeshData([['a', 0, 0]], [[0, 0, 0]])", "whose could not convert string to float"),
        ("MeshData([[0, 0, 0]], [[0, 0, 0]], roughness=2)", "whose roughness is 2, not from 0 to 1"),
    ],
)
def test_what_a_mesh_loader_gives_is_checked(loaders: Path, tmp_path: Path, gives: str, said: str) -> None:
    with (loaders / "loaders.py").open("a") as file:
        file.write(f"\ndef read_tri(path):\n    return {gives}\n")
    with pytest.raises(InputError, match=f"RG498 .*{said}"):
        rg.load("forward", plugins=[loaders], scene=tmp_path / "a.tri").check()


@pytest.mark.parametrize(
    ("gives", "said"),
    [
        ("None", "RG498 .* returned NoneType, not an array"),
        ("np.zeros(3)", r"RG498 .* returned an array of shape \(3,\)"),
        ("np.zeros((2, 2, 5))", r"RG498 .* returned an array of shape \(2, 2, 5\)"),
        ("np.zeros((2, 2), int)", "RG498 .* returned int64 values, not uint8 or floats"),
        ("np.zeros((1, 20000), np.uint8)", "RG498 .* returned 20000×1 pixels; the limit is 16384"),
        ("1 / 0", r"loaders\.py:\d+:1: RG497 image 'sky\.raw' cannot be read: ZeroDivisionError"),
    ],
)
def test_what_an_image_loader_gives_is_checked(loaders: Path, tmp_path: Path, gives: str, said: str) -> None:
    with (loaders / "loaders.py").open("a") as file:
        file.write(f"\ndef read_raw(data):\n    return {gives}\n")
    pipeline = rg.load("forward", plugins=[loaders], scene=tmp_path / "s.yaml")
    with pytest.raises(InputError, match=said):
        pipeline.link()  # which asks how large it is


def test_a_session_notices_changed_files_of_a_plugin(sketch: Path) -> None:
    """Its include, and its module: the same pipeline is drawn anew, without a new session."""
    with rg.Session() as session:
        first = image(session, "forward", sketch, display__curve="halve")
        (sketch / "halve.glsl").write_text("vec3 tone_curve(vec3 color) { return vec3(1.0, 0.0, 0.0); }\n")
        red = image(session, "forward", sketch, display__curve="halve")
        assert (red[..., :3] == [255, 0, 0]).all()
        assert not (first[..., :3] == [255, 0, 0]).all()
        (sketch / "green.glsl").write_text("vec3 tone_curve(vec3 color) { return vec3(0.0, 1.0, 0.0); }\n")
        text = (sketch / "extension.py").read_text()
        (sketch / "extension.py").write_text(text.replace('"halve.glsl"', '"green.glsl"'))
        assert (image(session, "forward", sketch, display__curve="halve")[..., :3] == [0, 255, 0]).all()


def test_a_meaning_in_a_shader_files_header(write: Write, tmp_path: Path) -> None:
    home = write(HEAT)
    header = "/*---\ninputs: {source: {semantic: %s, optional: true, doc: Before.}}\n"
    header += "outputs: {warmer: {semantic: heat, doc: After.}}\n---*/\n"
    body = "uniform sampler2D source;\nout vec4 warmer;\nvoid main() { warmer = vec4(1.0); }\n"
    (home / "warm.frag").write_text(header % "heat" + body)
    catalog = found(home)
    assert catalog.get("warm").cls.inputs()["source"].semantic == catalog.extensions.semantic("heat")
    (tmp_path / "house.yaml").write_text(HOUSE)
    (tmp_path / "cellar.yaml").write_text(CELLAR % "heat")
    rg.load(tmp_path / "house.yaml", plugins=[home]).check()
    (home / "warm.frag").write_text(header % "het" + body)
    with pytest.raises(InputError, match=r"'het'.*; did you mean 'heat'\?"):
        found(home).get("warm")
