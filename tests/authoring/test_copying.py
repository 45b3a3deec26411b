"""Copies of what is shipped: they work at once, as the shipped ones do, and nothing is overwritten."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import rendergraph as rg
from rendergraph.authoring import copy_shipped
from rendergraph.catalog import Catalog
from rendergraph.errors import InputError
from rendergraph.resources import shipped_pipelines, shipped_scenes

SIZE = (48, 27)


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_copies_of_pipelines_and_scenes_are_resolved_as_the_shipped_ones(here: Path) -> None:
    for name in ("pipeline:bloom", "ssgi-hemicube", "salamander"):
        copy_shipped(name)
    assert sorted(path.relative_to(here).as_posix() for path in here.rglob("*.*")) == [
        "bloom.yaml",
        "parts/lit_view.yaml",
        "salamander.glb",
        "salamander.yaml",
        "ssgi-hemicube.yaml",
    ]
    for name in ("bloom", "ssgi-hemicube"):
        assert rg.load(f"./{name}.yaml").resolve().spec.nodes.keys() == rg.load(name).resolve().spec.nodes.keys()
    scene = rg.load("forward", scene="./salamander.yaml").link().scene
    assert len(scene.objects) == len(rg.load("forward", scene="salamander").link().scene.objects)


@pytest.mark.nightly(keep=1)
@pytest.mark.parametrize(
    ("node", "type", "pipeline"),
    [("display", "tonemap", "forward"), ("ao", "hbao", "ssao-hbao"), ("shadows", "shadow_vsm", "shadow-vsm")],
)
def test_a_copy_of_a_node_draws_the_same_and_is_valid(gl: rg.Session, node: str, type: str, pipeline: str) -> None:
    copied = copy_shipped(type)
    assert copied.files[0] == Path(f"my_{type}.py")
    own = rg.load(pipeline, size=SIZE, sets=[f"{node}.type=my_{type}"], plugins=[f"my_{type}.py"])
    np.testing.assert_array_equal(gl.render(own)["image"], gl.render(rg.load(pipeline, size=SIZE))["image"])
    shader = next(file for file in copied.files if file.stem.endswith(type) and file.suffix != ".py")
    shader.write_text("nonsense\n")
    with pytest.raises(InputError, match=f"{shader.name}"):
        gl.render(own)


def test_every_shipped_node_can_be_copied() -> None:
    names = Catalog.discover().names()
    copies = [Path(name) / copy_shipped(f"node:{name}", Path(name)).files[0] for name in names]
    types, mistakes = Catalog.discover(copies).usable([path.stem for path in copies])
    assert (len(types), mistakes) == (len(names), [])


@pytest.mark.nightly(keep=12)
@pytest.mark.parametrize(
    "name", sorted({f"pipeline:{n}" for n in shipped_pipelines()} | {f"scene:{n}" for n in shipped_scenes()})
)
def test_every_shipped_file_can_be_copied(name: str) -> None:
    (file, *_) = copy_shipped(name).files
    kind = name.partition(":")[0]
    (rg.load(f"./{file}") if kind == "pipeline" else rg.load("forward", scene=f"./{file}")).link()


def test_nothing_is_overwritten_and_names_are_suggested() -> None:
    Path("forward.yaml").write_text("mine")
    with pytest.raises(InputError, match=r"RG531 'forward\.yaml' already exists and was not changed"):
        copy_shipped("forward")
    with pytest.raises(
        InputError, match="'bloom' is the name of a pipeline and of a node; write pipeline:bloom or node:bloom"
    ):
        copy_shipped("bloom")
    with pytest.raises(InputError, match="RG511 there is no shipped scene 'cornel_box'; did you mean 'cornell_box'"):
        copy_shipped("scene:cornel_box")
    with pytest.raises(
        InputError, match="RG511 there is no shipped pipeline, scene or node 'tonmap'; did you mean 'tonemap'"
    ):
        copy_shipped("tonmap")
    assert Path("forward.yaml").read_text() == "mine"
