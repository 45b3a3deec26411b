"""What people meet first: lists, explanations, completion, colour, `--quiet`, and running from a checkout."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from io import BytesIO, TextIOWrapper
from pathlib import Path
from typing import Any

import pytest

from rendergraph.errors import EXIT_CODES
from rendergraph.resources import folder, shipped_pipelines, shipped_scenes

ROOT = Path(__file__).parents[2]


@pytest.mark.parametrize(("verb", "shipped"), [("pipelines", shipped_pipelines()), ("scenes", shipped_scenes())])
def test_what_comes_along_is_listed_with_a_line_each(cli: Any, verb: str, shipped: dict[str, Path]) -> None:
    told = cli(verb, "--json").json[verb]
    assert [one["name"] for one in told] == sorted(shipped)
    assert all(len(one["line"]) > 20 and one["line"].endswith(".") for one in told)
    lines = cli(verb).out.splitlines()
    assert all(line.startswith(name) for name, line in zip(sorted(shipped), lines, strict=False))


def test_environments_are_listed_with_a_line_each(cli: Any) -> None:
    told = cli("environments", "--json").json["environments"]
    assert {one["name"] for one in told} >= {"studio", "sky"}
    shown = cli("environments").out
    assert all(one["name"] in shown and one["line"] in shown for one in told)


@pytest.mark.nightly(keep=12)
@pytest.mark.parametrize("name", [*shipped_pipelines(), *shipped_scenes()])
def test_what_comes_along_is_explained(cli: Any, name: str) -> None:
    result = cli("explain", name)
    assert (result.code, result.err) == (0, "")
    kind = "scene" if name in shipped_scenes() else "pipeline"
    assert f"{name}  ({kind}" in result.out
    if kind == "pipeline":
        assert shipped_pipelines()[name].read_text().splitlines()[0] in result.out
    assert cli("explain", name, "--json").json[kind] == name


def test_a_file_is_explained_as_what_it_is(cli: Any, tmp_path: Path) -> None:
    (tmp_path / "scene.yaml").write_text("scene: 1\nobjects: {box: {shape: box}}\n")
    (tmp_path / "own.yaml").write_text("# Mine.\nextends: forward\nscene: ./scene.yaml\n")
    shown = cli("explain", "own.yaml").out
    assert shown.startswith("own  (pipeline)\n\nMine.\n\nRenders scene, 1280×720;")
    assert "`rendergraph graph own.yaml`" in shown
    shown = cli("explain", "scene.yaml").out
    assert shown.startswith("scene  (scene, 12 triangles)\n")
    assert "It has no camera" in shown
    assert "It has no light" in shown
    assert "the studio is added; `--environment none` leaves it out" in shown


def test_a_name_of_two_things_is_explained_as_both(cli: Any) -> None:
    shown = cli("explain", "bloom").out
    assert shown.startswith("bloom  (display)")
    assert "\nbloom  (pipeline)\n" in shown


@pytest.mark.parametrize("name", ["sky", "studio"])
def test_environments_are_explained(cli: Any, name: str) -> None:
    result = cli("explain", name)
    assert (result.code, result.err) == (0, "")
    assert result.out.startswith(f"{name}  (environment)\n")
    assert f"--environment {name}\n" in result.out
    assert cli("explain", name, "--json").json["environment"] == name
    assert "'studio'?" in cli("explain", "studi").err
    assert "has no program" in cli("explain", name, "--glsl").err


@pytest.mark.parametrize("topic", ["RG103", "scene"])
def test_what_has_no_program_says_so(cli: Any, topic: str) -> None:
    assert f"RG511 '{topic}' has no program" in cli("explain", topic, "--glsl").err
    assert cli("explain", topic).code == 0


def test_standard_input_is_a_pipeline_or_a_patch(cli: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def typed(text: str, *words: str) -> Any:
        monkeypatch.setattr(sys, "stdin", TextIOWrapper(BytesIO(text.encode())))
        return cli(*words)

    (tmp_path / "base.yaml").write_text("extends: forward\nscene: spheres\n")
    for name in ("-", "/dev/stdin"):  # relative to the current folder
        assert typed("extends: ./base.yaml\n", "config", name, "--json").json["resolved"]["scene"] == "spheres"
    assert typed("size: [64, 36]\n", "config", "forward", "-p", "-", "--json").json["resolved"]["size"] == [64, 36]
    assert typed("nodes: {a: b}\n", "check", "-").err.startswith("stdin:1:12: RG106")
    assert "RG011 standard input is empty" in typed("", "check", "-").err


def test_a_plan_shows_steps_of_kept_values_in_one_row(cli: Any) -> None:
    shown = cli("plan", "forward").out
    assert re.search(r"^ +\d+–\d+ +environment \(\d+ steps\) .* kept: ", shown, re.M)
    assert "environment[" not in shown
    assert re.search(r"^  environment\.cells +──B───  texture", shown, re.M)
    assert cli("plan", "forward", "--every-step").out.count("environment[") > 9


def test_the_help_has_the_exit_codes(cli: Any) -> None:
    shown = cli("--help").out
    for code, meaning in EXIT_CODES.items():
        assert f"{code:<4} {meaning}" in shown


@pytest.mark.parametrize(
    ("words", "meant"),
    [
        (["-s", "taps=3"], "RG119 the pipeline has no parameter 'taps'; did you mean 'shadows.taps'?"),
        (["-s", "exposre=1"], "did you mean 'display.exposure'?"),
        (["-s", "shadows=null"], "; to leave out node 'shadows', write shadows.enabled=false"),
        (["-s", "shadows=false"], "; to leave out node 'shadows', write shadows.enabled=false"),
        (["-s", "shadows=3"], "; to set one of node 'shadows', write shadows.PARAM=VALUE"),
    ],
)
def test_a_parameter_without_its_node_is_found(cli: Any, words: list[str], meant: str) -> None:
    assert meant in cli("check", "forward", *words).err


def test_a_file_that_says_no_version_is_told(cli: Any, tmp_path: Path) -> None:
    text = shipped_pipelines()["forward"].read_text().replace("rendergraph: 1\n", "")
    (tmp_path / "old.yaml").write_text(text)
    (tmp_path / "based.yaml").write_text("extends: forward\n")
    result = cli("check", "old.yaml")
    assert result.code == 0
    assert "warning: RG016 missing format version" in result.err
    assert "RG016" not in cli("check", "based.yaml").err


def test_quiet_says_errors_alone(cli: Any, tmp_path: Path) -> None:
    (tmp_path / "old.yaml").write_text("nodes: {}\n")
    loud, quiet = cli("check", "forward"), cli("check", "forward", "--quiet")
    assert (loud.code, quiet.code) == (0, 0)
    assert loud.err
    assert not quiet.err
    assert "RG125" in cli("check", "old.yaml", "-q").err
    assert cli("check", "forward").err  # and only that once


def test_a_terminal_gets_the_word_and_colour(cli: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    plain = cli("check", "forward", "-s", "taps=3").err
    monkeypatch.delenv("NO_COLOR", raising=False)
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setattr(type(sys.stderr), "isatty", lambda self: True, raising=False)
    painted = cli("check", "forward", "-s", "taps=3").err
    assert "\x1b[1;31merror:\x1b[0m RG119 the pipeline" in painted
    monkeypatch.setenv("NO_COLOR", "1")
    assert cli("check", "forward", "-s", "taps=3").err == plain.replace("RG119", "error: RG119")
    assert "\x1b" not in plain


def test_a_name_cannot_paint_the_terminal(cli: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(type(sys.stderr), "isatty", lambda self: True, raising=False)
    monkeypatch.setenv("NO_COLOR", "1")
    assert "\x1b" not in cli("check", "\x1b[31mx.yaml").err


# --- where mistakes are, and how they are told -----------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("rendergraph: 1\nnodes: {}\noutputs: {a: b.c}\n", "own.yaml:2:1: RG125 the pipeline has no nodes"),
        ("extends: forward\nnodes: null\n", "own.yaml:1:1: RG125 the pipeline has no nodes"),
        (
            "sweep: 1\npipeline: forward\naxes:\n  shadows.tapss: [1, 2]\n",
            "own.yaml:4:3: RG103 node 'shadows' (shadow_pcf) has no param or input 'tapss'; did you mean 'taps'?",
        ),
        (
            "sweep: 1\npipeline: forward\nset: {lihgt.x: 1}\naxes: {shadows.taps: [1, 2]}\n",
            "own.yaml:3:7: RG109 there is no node 'lihgt'; did you mean 'light'?",
        ),
    ],
)
def test_mistakes_are_told_at_their_place(cli: Any, tmp_path: Path, text: str, message: str) -> None:
    (tmp_path / "own.yaml").write_text(text)
    result = cli("check", "own.yaml")
    assert (result.code, result.err.splitlines()[0].startswith(message)) == (3, True), result.err


def test_a_hundred_mistakes_say_that_there_are_more(cli: Any, tmp_path: Path) -> None:
    nodes = "".join(f"  n{number}: {{type: nothing{number}}}\n" for number in range(150))
    (tmp_path / "own.yaml").write_text(f"rendergraph: 1\nnodes:\n{nodes}outputs: {{a: n0.c}}\n")
    result = cli("check", "own.yaml")
    assert result.err.endswith("\nand at least 90 more errors; --json lists 100\n")


def test_a_number_too_large_is_not_told_to_be_none(cli: Any, tmp_path: Path) -> None:
    (tmp_path / "scene.yaml").write_text("scene: 1\nobjects: {box: {shape: box, at: [1e39, 0, 0]}}\n")
    assert (
        "'at': expected a list of 3 numbers, got [1e+39, 0, 0]; the largest number is 1e+12"
        in cli("explain", "scene.yaml").err
    )
    (tmp_path / "scene.yaml").write_text("scene: 1\nobjects: {box: {shape: box, at: [1, 0]}}\n")
    assert "numbers end" not in cli("explain", "scene.yaml").err


def test_sizes_are_written_in_plain_digits(cli: Any) -> None:
    assert "is not WIDTHxHEIGHT" in cli("check", "forward", "--size", "３２x１８").err


def test_a_port_may_be_called_image(cli: Any, tmp_path: Path) -> None:
    (tmp_path / "fade.frag").write_text(
        "// Half as bright.\nuniform sampler2D image;  // semantic: display_color\nout vec4 color;  // the picture\n"
        "void main() { color = 0.5 * texelFetch(image, ivec2(gl_FragCoord.xy), 0); }\n"
    )
    text = (
        "extends: forward\nnodes: {f: {type: ./fade.frag, inputs: {image: display.color}}}\noutputs: {image: f.color}\n"
    )
    (tmp_path / "own.yaml").write_text(text)
    assert cli("run", "own.yaml", "--size", "8x8").code == 0


# --- completion ------------------------------------------------------------------------------------------------------

COMPLETING = """
eval "$(_RENDERGRAPH_COMPLETE=bash_source rendergraph)"
compopt() { :; }
while IFS= read -r line; do
  COMP_LINE="${line#|}"; COMP_POINT=${#COMP_LINE}; COMPREPLY=()
  _rendergraph_completion rendergraph
  echo "${COMPREPLY[*]}"
done
"""


@pytest.mark.slow
def test_bash_completes_what_is_typed(tmp_path: Path) -> None:
    bash = shutil.which("bash")
    if bash is None:
        pytest.skip("needs bash")
    program = tmp_path / "rendergraph"
    program.write_text(f"#!/bin/sh\nexec '{sys.executable}' -m rendergraph \"$@\"\n")
    program.chmod(0o755)
    expected = {
        "rendergraph ru": "run",
        "rendergraph run forward-p": "forward-prepass",
        "rendergraph run forward -s shad": "shadows.",
        "rendergraph run forward -s shadows.ta": "shadows.taps=",
        "rendergraph run forward -s light.shading=p": "phong pbr",
        "rendergraph compare deferred -s gbuffer.type=gb": "gbuffer",
        "rendergraph run forward --tap sun.": "sun.shadow_map=",
        "rendergraph run forward --scene sta": "stairs",
        "rendergraph run forward --camera ": "main",
        "rendergraph run forward --environment st": "studio",
        "rendergraph explain corn": "cornell_box",
        "rendergraph explain non": "",  # `none` is a choice of environment alone
        "rendergraph nodes dis": "display",
        "rendergraph run nothing -s ": "",
    }
    environment = os.environ | {"PATH": f"{tmp_path}:{os.environ['PATH']}"}
    lines = "".join(f"|{line}\n" for line in expected)
    done = subprocess.run(
        [bash, "--norc", "-c", COMPLETING], input=lines, capture_output=True, text=True, env=environment, check=True
    )
    assert dict(zip(expected, done.stdout.splitlines(), strict=True)) == expected
    assert done.stderr == ""


# --- a checkout ------------------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_a_checkout_runs_its_own_nodes_whatever_is_installed(tmp_path: Path) -> None:
    """`python -m rendergraph` there: neither half is the other copy's."""
    if not (ROOT / "pyproject.toml").is_file():
        pytest.skip("these tests do not stand in a checkout")
    for name in ("rendergraph", "nodes", "shaders", "pipelines"):
        shutil.copytree(ROOT / name, tmp_path / name, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(ROOT / "pyproject.toml", tmp_path)
    (tmp_path / "nodes" / "display" / "bloom.py").rename(tmp_path / "nodes" / "display" / "blooming.py")
    (tmp_path / "pipelines" / "mine.yaml").write_text("# Mine.\nextends: forward\n")
    words = [sys.executable, "-m", "rendergraph"]
    done = subprocess.run([*words, "nodes"], cwd=tmp_path, capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")
    assert "  blooming " in done.stdout
    assert "  bloom " not in done.stdout
    checked = subprocess.run([*words, "check", "mine"], cwd=tmp_path, capture_output=True, text=True)
    assert (checked.returncode, checked.stdout) == (0, "")
    assert folder("rendergraph.nodes").parent != tmp_path
