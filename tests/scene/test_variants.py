"""Variants of glTF files (KHR_materials_variants): what they change, where they are chosen, mistakes."""

from __future__ import annotations

import base64
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from msgspec.structs import replace

import rendergraph as rg
from rendergraph.errors import InputError
from rendergraph.scene.load import load

POINTS = np.array([(-1, -1, 0), (1, -1, 0), (0, 1, 0)], np.float32)
COLORS = {"red": [1, 0, 0, 1], "green": [0, 1, 0, 1], "blue": [0, 0, 1, 1]}


def shoe(**changes: Any) -> dict[str, Any]:
    """A triangle that is red, and green or blue in variants; and one that is always red."""
    data = base64.b64encode(POINTS.tobytes()).decode()
    mappings = [{"material": 1, "variants": [0, 2]}, {"material": 2, "variants": [1]}]
    plain = {"attributes": {"POSITION": 0}, "material": 0}
    varied = {**plain, "extensions": {"KHR_materials_variants": {"mappings": mappings}}}
    return {
        "asset": {"version": "2.0"},
        "extensionsUsed": ["KHR_materials_variants"],
        "extensions": {"KHR_materials_variants": {"variants": [{"name": n} for n in ("meadow", "sea", "moss")]}},
        "buffers": [{"byteLength": 36, "uri": f"data:application/octet-stream;base64,{data}"}],
        "bufferViews": [{"buffer": 0, "byteLength": 36}],
        "accessors": [
            {
                "bufferView": 0,
                "componentType": 5126,
                "count": 3,
                "type": "VEC3",
                "min": [-1, -1, 0],
                "max": [1, 1, 0],
            }
        ],
        "materials": [{"name": name, "pbrMetallicRoughness": {"baseColorFactor": c}} for name, c in COLORS.items()],
        "meshes": [{"primitives": [plain]}, {"primitives": [varied]}],
        "nodes": [{"mesh": 0, "name": "sole"}, {"mesh": 1, "name": "cloth"}],
        "scenes": [{"nodes": [0, 1]}],
        **changes,
    }


@pytest.fixture
def file(tmp_path: Path) -> Path:
    (tmp_path / "shoe.gltf").write_text(json.dumps(shoe()))
    return tmp_path / "shoe.gltf"


def colors(scene: Any) -> list[str]:
    return [scene.materials[placed.material].name.rpartition("/")[2] for placed in scene.objects]


def test_variants_change_the_materials_that_they_map(file: Path) -> None:
    scene = load(file)
    assert colors(scene) == ["red", "red"]
    assert {name: colors(scene.with_variant(name)) for name in scene.variants} == {
        "meadow": ["red", "green"],
        "sea": ["red", "blue"],
        "moss": ["red", "green"],
    }
    assert not scene.warnings


@pytest.fixture
def selected(file: Path) -> Callable[..., list[str]]:
    def find(name: str = "shoe.gltf", **selection: Any) -> list[str]:
        return colors(rg.load("forward", scene=file.parent / name, **selection).link().scene)

    return find


def test_the_selection_chooses_a_variant(selected: Callable[..., list[str]]) -> None:
    assert selected() == ["red", "red"]
    assert selected(variant="sea") == ["red", "blue"]
    with pytest.raises(InputError, match=r"--variant se: RG322 the scene has no variant 'se'; it has 'meadow', 'sea'"):
        selected(variant="se")
    with pytest.raises(InputError, match="RG322 the scene has no variant 'sea'; it has none"):
        rg.load("forward", scene="spheres", variant="sea").link()


def test_objects_of_a_scene_file_have_variants(file: Path, selected: Callable[..., list[str]]) -> None:
    """The command line chooses for those that say nothing of it; a `material` goes before both."""
    (file.parent / "scene.yaml").write_text(
        "scene: 1\nobjects:\n  a: {file: shoe.gltf}\n  b: {file: shoe.gltf, variant: meadow}\n"
        "  c: {file: shoe.gltf, material: grey}\nmaterials: {grey: {base_color: 0.5}}\n"
    )
    assert selected("scene.yaml") == ["red", "red", "red", "green", "grey", "grey"]
    assert selected("scene.yaml", variant="sea") == ["red", "blue", "red", "green", "grey", "grey"]
    text = (file.parent / "scene.yaml").read_text().replace("variant: meadow", "variant: maedow")
    (file.parent / "scene.yaml").write_text(text)
    with pytest.raises(
        InputError, match=r"scene.yaml:4:33: RG322 object 'b': its file has no variant 'maedow'; it has"
    ):
        selected("scene.yaml")


def test_the_picture_knows_its_variant(gl: rg.Session, file: Path, tmp_path: Path) -> None:
    pipeline = rg.load("forward", scene=file, variant="sea", size=(16, 16))
    gl.render(pipeline).save(tmp_path / "sea.png")
    again = rg.load(tmp_path / "sea.png", asset_roots=[tmp_path]).link()
    assert colors(again.scene) == ["red", "blue"]


@pytest.mark.parametrize(
    ("mappings", "message"),
    [
        ([{"material": 9, "variants": [0]}], "material is 9, but there are 3 materials"),
        ([{"material": 1, "variants": [3]}], "a variant is 3, but there are 3 variants"),
        ([{"material": -1, "variants": [0]}], ""),
    ],
)
def test_mistakes_in_mappings(tmp_path: Path, mappings: list[dict[str, Any]], message: str) -> None:
    made = shoe()
    made["meshes"][1]["primitives"][0]["extensions"]["KHR_materials_variants"]["mappings"] = mappings
    (tmp_path / "shoe.gltf").write_text(json.dumps(made))
    with pytest.raises(InputError, match=f"RG304 .*{message}"):
        load(tmp_path / "shoe.gltf")


def test_animated_files_keep_their_variants(tmp_path: Path) -> None:
    scene = replace(load(_animated(tmp_path)))
    assert colors(scene.with_variant("sea")) == ["red", "blue"]


def _animated(folder: Path) -> Path:
    times = base64.b64encode(np.array([0, 1], np.float32).tobytes() + np.zeros((2, 3), np.float32).tobytes()).decode()
    made = shoe()
    made["buffers"].append({"byteLength": 32, "uri": f"data:application/octet-stream;base64,{times}"})
    made["bufferViews"] += [
        {"buffer": 1, "byteLength": 8},
        {"buffer": 1, "byteOffset": 8, "byteLength": 24},
    ]
    made["accessors"] += [
        {"bufferView": 1, "componentType": 5126, "count": 2, "type": "SCALAR", "min": [0], "max": [1]},
        {"bufferView": 2, "componentType": 5126, "count": 2, "type": "VEC3"},
    ]
    channel = {"sampler": 0, "target": {"node": 1, "path": "translation"}}
    made["animations"] = [{"channels": [channel], "samplers": [{"input": 1, "output": 2}]}]
    (folder / "moving.gltf").write_text(json.dumps(made))
    return folder / "moving.gltf"
