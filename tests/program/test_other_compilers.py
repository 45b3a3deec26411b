"""Compilers other than Mesa's: the reference front end takes every program, and its SPIR-V is valid for OpenGL."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

import rendergraph as rg
from rendergraph.cli.app import main
from rendergraph.program import TextSources, positions_macro, stage_texts
from rendergraph.program.scope import annotated
from rendergraph.program.variants import variants
from rendergraph.resources import shipped_pipelines
from rendergraph.scene.pack import pack

FOLDERS = os.pathsep.join([str(Path(sys.executable).parent), os.environ.get("PATH", "")])
GLSLANG, SPIRV_VAL = shutil.which("glslang", path=FOLDERS), shutil.which("spirv-val", path=FOLDERS)
ENDINGS = {"vertex": "vert", "geometry": "geom", "fragment": "frag", "compute": "comp"}
_taken: set[object] = set()  # programs that pipelines share are compiled once

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(GLSLANG is None or SPIRV_VAL is None, reason="glslang or spirv-val is not installed"),
]


def programs(pipeline: rg.Pipeline) -> Iterator[dict[str, str]]:
    """Return the texts of every program: stage to text, with any places for samples, which a device decides."""
    expanded = pipeline.expand()
    scene, made = expanded.linked.scene, expanded.expansion
    types, packed = {node.id: node.type for node in expanded.linked.graph.nodes}, pack(scene)
    for step in made.steps:
        for macros in variants(step, scene, packed, made.views) if step.shaders else ():
            texts = stage_texts(step, TextSources(types, made.resources, made.views), defines=macros)
            final = {stage: annotated(text) for stage, text in texts.items()}
            for count in (2, 4, 8, 16):
                macro, places = positions_macro(count) + "\n", f"vec2[]({', '.join(['vec2(0.5)'] * count)})\n"
                final = {stage: text.replace(macro, places) for stage, text in final.items()}
            yield final


def refused(texts: dict[str, str], folder: Path) -> str:
    """Return what the compiler or the validator says against a program; nothing if they take it."""
    folder.mkdir()
    files = [f"program.{ENDINGS[stage]}" for stage in texts]
    for file, text in zip(files, texts.values(), strict=True):
        (folder / file).write_text(text)
    strict = [str(GLSLANG), "-l", *files]
    to_spirv = [str(GLSLANG), "-G", "--auto-map-locations", "--auto-map-bindings", *files]
    checks = [[str(SPIRV_VAL), "--target-env", "opengl4.5", f"{ENDINGS[stage]}.spv"] for stage in texts]
    for words in (strict, to_spirv, *checks):
        done = subprocess.run(words, cwd=folder, capture_output=True, text=True, check=False)
        if done.returncode or "WARNING" in done.stdout:
            return done.stdout + done.stderr
    return ""


@pytest.mark.nightly(keep=1)
@pytest.mark.parametrize("name", ["forward", "shadow-volumes-zfail", "full"])
def test_some_programs_are_taken(name: str, tmp_path: Path) -> None:
    all_programs = list(programs(rg.load(name)))
    for number, texts in enumerate(all_programs[:: len(all_programs) // 3]):
        assert not refused(texts, tmp_path / str(number))


@pytest.mark.nightly
@pytest.mark.parametrize("name", shipped_pipelines())
def test_every_program_is_taken(name: str, tmp_path: Path) -> None:
    new = [texts for texts in programs(rg.load(name)) if frozenset(texts.items()) not in _taken]
    _taken.update(frozenset(texts.items()) for texts in new)
    assert not "".join(refused(texts, tmp_path / str(number)) for number, texts in enumerate(new))


def checked(capsys: pytest.CaptureFixture[str], node: str, *words: str, stage: str = "frag") -> str:
    """Return what the compiler says about a shader as `rendergraph schema --glsl` prints it."""
    assert main(["schema", "--glsl", node, *words]) == 0
    command = [str(GLSLANG), "--stdin", "-S", stage]
    return subprocess.run(command, input=capsys.readouterr().out, capture_output=True, text=True, check=False).stdout


@pytest.mark.parametrize(
    "words",
    [
        "tonemap",
        "ssgi --shader discs.frag",
        "bloom",
        "light --pipeline forward",
        "environment_light --shader environment_cells.comp",
    ],
)
def test_an_editors_checker_takes_a_shader_of_ours(words: str, capsys: pytest.CaptureFixture[str]) -> None:
    said = checked(capsys, *words.split(), stage="comp" if ".comp" in words else "frag")
    assert said == ""


def test_an_editors_checker_names_the_line_of_a_mistake(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    lines = [
        "/*---",
        "inputs: {radiance: {semantic: radiance}}",
        "outputs: {dimmed: {like: radiance}}",
        "---*/",
        "#include <luminance.glsl>",
        "uniform sampler2D radiance;",
        "uniform float share = 0.5;",
        "out vec4 dimmed;",
        "void main() {",
        "    vec3 light = texelFetch(radiance, ivec2(gl_FragCoord.xy), 0).rgb;",
        "    dimmed = vec4(share * luminance_of(light));",
        "}",
    ]
    shader = tmp_path / "dim.frag"
    shader.write_text("\n".join(lines))
    assert checked(capsys, "./dim.frag") == ""
    shader.write_text("\n".join(lines).replace("vec4(share *", "vec4(shore *"))
    assert "ERROR: 0:11: 'shore' : undeclared identifier" in checked(capsys, "./dim.frag")


def test_a_fault_is_found(tmp_path: Path) -> None:
    """A type that only lenient compilers convert, and stages that disagree."""
    vertex = "#version 450 core\nout vec3 v_a;\nvoid main() { v_a = vec3(1.0); gl_Position = vec4(0.0); }"
    fragment = "#version 450 core\nin vec3 v_a;\nout vec4 color;\nvoid main() { color = vec4(v_a, 1.0); }"
    assert not refused({"vertex": vertex, "fragment": fragment}, tmp_path / "right")
    assert "cannot convert" in refused({"fragment": fragment.replace("vec4(v_a, 1.0)", "v_a")}, tmp_path / "type")
    other = fragment.replace("in vec3 v_a", "in vec2 v_a").replace("vec4(v_a,", "vec4(v_a, 1.0,")
    assert "Types must match" in refused({"vertex": vertex, "fragment": other}, tmp_path / "stages")
