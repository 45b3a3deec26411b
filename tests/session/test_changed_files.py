"""A session between edits: what is noticed, and what is made anew for it."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import pytest

import rendergraph as rg
from rendergraph.errors import InputError


def load(project: Path) -> rg.Pipeline:
    return rg.load(project / "flat.yaml", plugins=[project / "fx"])


def value(gl: rg.Session, pipeline: rg.Pipeline, name: str = "image") -> float:
    return float(gl.render(pipeline).arrays[name].mean())


def made(gl: rg.Session) -> tuple[int, int]:
    return gl.cache.programs.compiled, gl.device.textures_made


def test_a_changed_include_of_an_include_compiles_the_programs_that_use_it(
    gl: rg.Session, project: Path, edit: Any
) -> None:
    pipeline = load(project)
    assert value(gl, pipeline) == 0.5
    programs, _ = made(gl)
    edit("fx/inner.glsl", "0.5", "0.7")
    assert value(gl, pipeline) == pytest.approx(0.7)
    assert made(gl)[0] == programs + 1
    edit("fx/outer.glsl", "VALUE;", "VALUE * 2.0;")
    assert value(gl, pipeline) == pytest.approx(1.4)
    assert made(gl)[0] == programs + 2


def test_files_that_stay_as_they_are_make_nothing(gl: rg.Session, project: Path) -> None:
    value(gl, load(project))
    before = made(gl)
    value(gl, load(project))
    assert made(gl) == before


def test_a_parameter_makes_nothing_and_a_define_one_program(gl: rg.Session, project: Path, edit: Any) -> None:
    value(gl, load(project))
    before = made(gl)
    edit("flat.yaml", "steps: 1", "steps: 1, gain: 3")
    assert value(gl, load(project)) == 1.5
    assert made(gl) == before
    edit("flat.yaml", "steps: 1", "steps: 2")
    assert value(gl, load(project)) == 3.0
    assert made(gl)[0] == before[0] + 1


def test_a_module_and_its_helper_are_imported_anew(gl: rg.Session, project: Path, edit: Any) -> None:
    before = load(project)
    old = before.resolve().catalog.get("flat").cls
    assert value(gl, before) == 0.5
    edit("fx/_values.py", "1.0", "2.0")  # as long as before, and within the same second
    after = load(project)
    assert value(gl, after) == 1.0
    assert after.resolve().catalog.get("flat").cls is not old
    assert old not in vars(sys.modules[after.resolve().catalog.get("flat").cls.__module__]).values()
    assert load(project).resolve().catalog.get("flat").cls is after.resolve().catalog.get("flat").cls
    edit("fx/flat.py", "default=GAIN", "default=3.0")
    assert value(gl, load(project)) == 1.5
    assert value(gl, before) == 0.5  # what was loaded stays what it was


def test_a_module_that_fails_is_imported_again_when_it_is_mended(gl: rg.Session, project: Path, edit: Any) -> None:
    value(gl, load(project))
    edit("fx/_values.py", "1.0", "oops")
    for _ in range(2):
        with pytest.raises(InputError, match="NameError: name 'oops'"):
            load(project).check()
    edit("fx/_values.py", "oops", "4.0")
    assert value(gl, load(project)) == 2.0


def test_a_module_that_is_added_to_the_folder_is_found(gl: rg.Session, project: Path) -> None:
    value(gl, load(project))
    (project / "fx/third.py").write_text((project / "fx/other.py").read_text().replace("_values", "_more"))
    (project / "fx/_more.py").write_text("GAIN = 8.0\n")
    (project / "fx/third.frag").write_text((project / "fx/other.frag").read_text())
    assert value(gl, load(project).set("other.type", "third"), "other") == 2.0


def test_a_changed_mesh_is_read_again_and_an_unchanged_one_is_not(gl: rg.Session, tmp_path: Path) -> None:
    (tmp_path / "s.yaml").write_text(
        "scene: 1\nobjects: {it: {file: it.obj}}\ncameras: {main: {eye: [0, 0, 3], target: [0, 0, 0]}}\n"
    )
    triangle = "v -1 -1 0\nv 1 -1 0\nv {} 1 0\nf 1 2 3\n"
    (tmp_path / "it.obj").write_text(triangle.format(0))

    def covered() -> int:
        depth = gl.render(rg.load("deferred", scene=tmp_path / "s.yaml", size=(32, 32)), taps=["gbuffer.depth"])
        return int((depth.arrays["gbuffer.depth"] > 0).sum())

    first, scenes = covered(), gl.cache.scenes_made
    assert covered() == first
    assert gl.cache.scenes_made == scenes
    (tmp_path / "it.obj").write_text(triangle.format(0).replace("v 1", "v 0"))
    assert covered() < first * 0.7
    assert gl.cache.scenes_made == scenes + 1


def test_programs_of_texts_that_are_gone_are_freed(project: Path, edit: Any) -> None:
    with rg.Session(cache=rg.CacheLimits(programs=0)) as session:
        pipeline = load(project)
        value(session, pipeline)
        count = len(session.cache.programs._programs)
        for number in range(5):
            edit("fx/inner.glsl", "0.5" if number == 0 else str(number), str(number + 1))
            assert value(session, pipeline) == number + 1
        assert len(session.cache.programs._programs) == count
