"""Generated textures: what each kind looks like in numbers, closed forms of the maps, and the keys of materials."""

from __future__ import annotations

import inspect
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from rendergraph.pipelines.shapes import mesh
from rendergraph.pipelines.textures import TEXTURES

import rendergraph as rg
from rendergraph.catalog import Catalog
from rendergraph.compile.generated import TextureGenerator
from rendergraph.compile.programs import ProgramCache
from rendergraph.errors import InputError
from rendergraph.images import from_srgb
from rendergraph.scene.load import load
from rendergraph.scene.model import Scene

SIDE = 128
SCENE = "scene: 1\nobjects: {a: {shape: plane, size: [2, 2], material: m}}\nmaterials: {m: {%s}}\n"
PLUGIN = """
from rendergraph.api import Extension, SceneKey, TextureKind
WAVES = TextureKind("Waves along u and v.", "waves.glsl", (SceneKey("high", float, "Amplitude.", 0.02),))
EXTENSION = Extension(textures={"waves": WAVES, "groove": TextureKind("A groove.", "groove.glsl")})
"""
WAVES = """
#include <texture_sample.glsl>
uniform float high;
TextureSample texture_sample(vec2 uv) {
    float height = high * (sin(6.2831853 * uv.x) + 0.5 * cos(6.2831853 * uv.y));
    return TextureSample(vec3(0.5, 0.2, 0.05), 1.0, height, 0.25, 1.0);
}
"""
GROOVE = """
#include <texture_sample.glsl>
TextureSample texture_sample(vec2 uv) { return TextureSample(vec3(0.5), 1.0, 0.8 * abs(uv.x - 0.5), 0.5, 0.0); }
"""


def read(tmp_path: Path, material: str, **options: Any) -> Scene:
    path = tmp_path / "a.yaml"
    path.write_text(SCENE % material)
    return load(path, **options)


@pytest.fixture(scope="module")
def generator(gl: rg.Session) -> Iterator[TextureGenerator]:
    with gl.device.current():
        yield TextureGenerator(ProgramCache(gl.device, 32))


@pytest.fixture(scope="module")
def plugin(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("plugin")
    for name, text in (("extension.py", PLUGIN), ("waves.glsl", WAVES), ("groove.glsl", GROOVE)):
        (folder / name).write_text(text)
    return folder


def maps(generator: TextureGenerator, scene: Scene) -> dict[str, npt.NDArray[np.float64]]:
    """The slots' texels, 0 to 1."""
    return {slot: generator.texels(texture.image) / 255.0 for slot, texture in scene.materials[0].textures.items()}


@pytest.fixture(scope="module", params=TEXTURES)
def kind(request: pytest.FixtureRequest, generator: TextureGenerator, tmp_path_factory: pytest.TempPathFactory) -> Any:
    folder = tmp_path_factory.mktemp("kind")
    text = f"texture: {{kind: {request.param}, resolution: {SIDE}}}"
    return request.param, maps(generator, read(folder, text))


def test_opposite_sides_fit_together(kind: Any) -> None:
    """Across the tile's border texels differ as much as they do anywhere else."""
    for slot, texels in kind[1].items() if kind[0] != "leaf" else ():  # of which there is one
        for axis in (0, 1):
            inside = np.abs(np.diff(texels, axis=axis)).mean(axis=1 - axis)
            across = np.abs(np.take(texels, 0, axis) - np.take(texels, -1, axis)).mean(axis=0)
            assert (across <= inside.max(axis=0) * 1.05 + 0.01).all(), (kind[0], slot, axis)


def test_albedo_and_roughness_are_plausible(kind: Any) -> None:
    name, found = kind
    albedo = from_srgb(found["base_color"][..., :3].astype(np.float32))[found["base_color"][..., 3] > 0.5]
    low, high = {"leaf": (0.03, 0.2), "planks": (0.08, 0.4), "marble": (0.5, 0.8)}.get(name, (0.1, 0.55))
    assert low < albedo.mean() < high
    assert albedo.max() < 0.95
    assert albedo.mean(axis=-1).std() > 0.01
    assert found["metallic_roughness"][..., 1].min() > 0.1
    assert found["metallic_roughness"][..., 2].max() == 0


def test_normals_are_unit_and_upright_on_average(kind: Any) -> None:
    normals = kind[1]["normal"][..., :3] * 2 - 1
    assert np.abs(np.linalg.norm(normals, axis=-1) - 1).max() < 0.02
    assert normals[..., 2].min() > 0
    slopes = normals[..., :2] / normals[..., 2:]
    assert np.abs(slopes.mean(axis=(0, 1))).max() < 0.02  # what rises comes down again


def test_another_seed_is_another_pattern_and_the_same_is_the_same(
    tmp_path: Path, generator: TextureGenerator, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(TextureGenerator, "_evaluate", inspect.unwrap(TextureGenerator._evaluate))
    first, other = (
        maps(generator, read(tmp_path, f"texture: {{kind: noise, resolution: 64, seed: {seed}}}"))["base_color"]
        for seed in (1, 2)
    )
    again = maps(
        TextureGenerator(generator.programs), read(tmp_path, "texture: {kind: noise, resolution: 64, seed: 1}")
    )
    assert np.abs(first - other).mean() > 0.01
    assert (again["base_color"] == first).all()


def test_no_course_of_bricks_lies_like_the_next(tmp_path: Path, generator: TextureGenerator) -> None:
    """Also across the tile's edge, with an odd number of courses: their joints are apart by at least a quarter brick."""
    material = "texture: {kind: bricks, rows: 5, columns: 2, resolution: 80, wear: 0, variation: 0, mortar: 0.03}"
    slope = np.abs(
        maps(generator, read(tmp_path, material))["normal"][8::16, :, 0] - 0.5
    )  # in the middle of each course
    edges = slope > 0.5 * slope.max()
    assert edges.any(axis=1).all()
    for number in range(5):
        assert not (edges[number] & edges[(number + 1) % 5]).any(), number


def test_maps_of_a_plugins_kind_have_their_closed_forms(
    tmp_path: Path, plugin: Path, generator: TextureGenerator, gl: rg.Session
) -> None:
    (tmp_path / "a.yaml").write_text(SCENE % "texture: {kind: waves, resolution: 256, high: 0.03}")
    pipeline = rg.load("forward", scene=tmp_path / "a.yaml", plugins=[plugin])
    assert pipeline.render(size=(16, 16), session=gl)["image"].std() > 0
    extensions = Catalog.discover([plugin]).extensions
    found = maps(generator, load(tmp_path / "a.yaml", extensions=extensions))
    u = (np.arange(256) + 0.5) / 256
    slope_u = 0.03 * 2 * np.pi * np.cos(2 * np.pi * u)[None, :]
    slope_v = -0.015 * 2 * np.pi * np.sin(2 * np.pi * u)[:, None]  # v runs down, green up
    expected = np.stack(np.broadcast_arrays(-slope_u, slope_v, 1.0), axis=-1)
    expected /= np.linalg.norm(expected, axis=-1, keepdims=True)
    assert np.abs(found["normal"][..., :3] * 2 - 1 - expected).max() < 0.01
    srgb = np.array([0.735357, 0.484529, 0.247801])  # IEC 61966-2-1 of 0.5, 0.2 and 0.05
    assert np.abs(found["base_color"][..., :3] - srgb).max() < 0.003
    assert found["metallic_roughness"][0, 0].tolist()[1:] == pytest.approx([0.25, 1.0, 1.0], abs=0.003)


def test_occlusion_of_a_groove_has_its_closed_form(tmp_path: Path, plugin: Path, generator: TextureGenerator) -> None:
    """At its bottom the horizon has the slope |0.8 cos φ| along each direction φ, and hides sin² of its angle."""
    extensions = Catalog.discover([plugin]).extensions
    found = maps(generator, read(tmp_path, "texture: {kind: groove, resolution: 512}", extensions=extensions))
    slopes = 0.8 * np.abs(np.cos(np.arange(8) * np.pi / 4))
    assert found["occlusion"][100, 255:257, 0].mean() == pytest.approx((1 / (1 + slopes**2)).mean(), abs=0.02)
    assert found["occlusion"][100, 0, 0] > 0.99  # the ridge
    half = 0.5 * (1 + (1 / (1 + slopes**2)).mean())
    assert found["occlusion"][100, 128, 0] == pytest.approx(half, abs=0.02)  # a slope hides one side


def test_a_map_of_its_own_goes_before_the_texture(tmp_path: Path) -> None:
    text = (
        "texture: {kind: bricks, scale: 0.5}, normal_texture: {kind: noise, seed: 3}, emissive_texture: {kind: tiles}"
    )
    textures = read(tmp_path, text).materials[0].textures
    assert {slot: texture.image.label for slot, texture in textures.items()} == {
        "base_color": "texture bricks",
        "normal": "texture noise",
        "metallic_roughness": "texture bricks",
        "occlusion": "texture bricks",
        "emissive": "texture tiles",
    }
    assert textures["base_color"].transform == (2, 0, 0, 0, 2, 0)
    assert textures["normal"].transform is None
    assert [slot for slot, texture in textures.items() if texture.srgb] == ["base_color", "emissive"]


@pytest.mark.parametrize(
    ("material", "message"),
    [
        ("texture: {kind: brick}", "'kind': expected one of bricks, .*got 'brick'; did you mean 'bricks'"),
        ("texture: {kind: marble, mortar: 1}", "texture has no key 'mortar'"),
        ("texture: {scale: 1}", "texture needs 'kind'"),
        ("base_color_texture: {kind: tiles, resolution: 5}", "'resolution': expected"),
        ("texture: wood.png", "'texture': expected a mapping"),
    ],
)
def test_mistakes(tmp_path: Path, material: str, message: str) -> None:
    with pytest.raises(InputError, match=message):
        read(tmp_path, material)


@pytest.mark.parametrize(
    ("file", "old", "new", "message"),
    [
        (
            "extension.py",
            '"waves.glsl"',
            '"wave.glsl"',
            r"RG495 .*textures\['waves'\] has no file 'wave.glsl' beside it",
        ),
        ("extension.py", "Waves along u and v.", "", "RG495 .* has no documentation"),
        (
            "extension.py",
            'float, "Amplitude.", 0.02',
            'float, "Amplitude."',
            "RG495 .* not a number or tuple with a default",
        ),
        ("waves.glsl", "float height = high", "float height = hihg", r"waves.glsl:5:20: RG410 .* did you mean 'high'"),
    ],
)
def test_mistakes_of_a_plugins_kind_have_their_places(
    tmp_path: Path, plugin: Path, gl: rg.Session, file: str, old: str, new: str, message: str
) -> None:
    for name in ("extension.py", "waves.glsl", "groove.glsl"):
        text = (plugin / name).read_text()
        (tmp_path / name).write_text(text.replace(old, new) if name == file else text)
    (tmp_path / "a.yaml").write_text(SCENE % "texture: {kind: waves, resolution: 16}")
    with pytest.raises(InputError, match=message):
        rg.load("forward", scene=tmp_path / "a.yaml", plugins=[tmp_path]).render(size=(16, 16), session=gl)


def test_forward_and_deferred_draw_the_same(tmp_path: Path, gl: rg.Session) -> None:
    (tmp_path / "a.yaml").write_text(SCENE % "texture: {kind: bricks, resolution: 128}")
    one, other = (
        rg.load(name, scene=tmp_path / "a.yaml").render(size=(96, 64), session=gl)["image"].astype(int)
        for name in ("forward", "deferred")
    )
    assert np.abs(one - other).mean() < 0.5
    assert one.std() > 10


@pytest.mark.parametrize(
    ("shape", "values", "lengths"),
    [
        ("plane", {"size": (3, 2)}, (3, 2)),
        ("box", {"size": (1, 2, 4)}, (4, 4)),
        ("cylinder", {"radius": 0.5, "height": 3}, (3, 3)),  # 3.14 m around, rounded
        ("torus", {"radius": 1, "tube": 0.3}, (7, 2)),
    ],
)
def test_texture_coordinates_in_metres(shape: str, values: dict[str, Any], lengths: tuple[float, float]) -> None:
    uv = mesh(shape, uv="metres", **values).uv0
    assert uv is not None
    assert np.ptp(uv, axis=0) == pytest.approx(lengths, rel=1e-3)


def test_another_process_finds_the_same_texels_on_the_disk(
    generator: TextureGenerator, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("RENDERGRAPH_CACHE", str(tmp_path / "cache"))
    texture = read(tmp_path, "texture: {kind: noise, seed: 77, resolution: 64}").materials[0].textures["base_color"]
    made = generator.texels(texture.image)
    monkeypatch.setattr(TextureGenerator, "_evaluate", None)
    assert np.array_equal(TextureGenerator(generator.programs).texels(texture.image), made)
