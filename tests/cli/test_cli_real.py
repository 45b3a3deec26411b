"""Whole command lines with nothing replaced: what a user does and sees."""

from __future__ import annotations

import re
import shlex
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from rendergraph import images
from rendergraph.cli.app import VERBS
from rendergraph.resources import folder, shipped_pipelines

SMALL = ("--size", "64x36")
QUICK = (*SMALL, "-s", "sun.resolution=128")
ROUGH = (*QUICK, "-s", "environment.size=16")
SMALLEST = {  # what is added to the examples of a verb: of options that are given twice the last one counts
    "run": (*ROUGH, "--executor", "serial"),  # compare/test_executors.py has the other executors
    "gallery": ROUGH,
    "bench": (*ROUGH, "-n", "2"),
    "compare": (*QUICK, "-n", "1"),
    "sweep": (*ROUGH, "-n", "1", "--executor", "serial"),
}


def examples(cli: Any, *verb: str) -> list[list[str]]:
    text = cli(*verb, "--help").out.partition("Examples:")[2].partition("Options:")[0]
    return [shlex.split(line)[1:] for line in text.splitlines() if line.strip().startswith("rendergraph ")]


def has_no_end(words: list[str]) -> bool:
    if words[0] == "mcp":
        return "--json" not in words
    return "--watch" in words or (words[0] == "view" and "--export" not in words)


LONG = ("view", "farm", "check-node", "run", "doctor", "bench")  # their examples take seconds
LONGER = ("sweep", "compare")  # and theirs ten; README and guide run these verbs, too


def marks_of(verb: str) -> list[pytest.MarkDecorator]:
    return [pytest.mark.nightly] if verb in LONGER else [pytest.mark.slow] if verb in LONG else []


@pytest.mark.nightly(keep=4)
@pytest.mark.parametrize("verb", ["", *(pytest.param(v, marks=marks_of(v)) for v in VERBS)])
def test_the_examples_of_the_help_work(cli: Any, tmp_path: Path, verb: str) -> None:
    if verb == "config":
        assert cli("run", "forward", *SMALL).code == 0
    if verb == "compare":
        assert cli("run", "forward", *SMALL, "-o", "soft.png").code == 0
        assert cli("run", "forward", *SMALL, "-s", "shadows.taps=1", "-o", "hard.png").code == 0
    if verb == "check-node":
        assert cli("new-node", "vignette").code == cli("new-node", "grain", "--kind", "shader-only").code == 0
    text = f"extends: {'deferred' if verb == 'edit' else 'forward'}\n"
    if verb == "upgrade":
        text = shipped_pipelines()["forward"].read_text().replace("rendergraph: 1\n", "")
    (tmp_path / "my.yaml").write_text(text)
    (tmp_path / "fog.frag").write_text("#include <grain.glsl>\n")
    study = "sweep: 1\npipeline: forward\nsize: [64, 36]\naxes: {shadows.taps: [1, 3]}\n"
    (tmp_path / "study.yaml").write_text(study)
    found = [words for words in examples(cli, *filter(None, [verb])) if not has_no_end(words)]
    assert found
    for words in found:
        drawn = not (words[0] == "compare" and words[1].endswith(".png")) and "--list" not in words
        result = cli(*words, *(SMALLEST.get(words[0], ()) if drawn else ()))
        assert result.code == 0, (words, result)
        assert bool(result.out) == (words[0] not in ("check", "check-node") or "--json" in words), words
        if "--json" in words:
            assert isinstance(result.json, dict)


def test_run_json_has_the_contract_s_fields(cli: Any) -> None:
    report = cli("run", "forward", *SMALL, "-o", "a.exr", "--json").json
    assert report["pipeline"] == "forward"
    assert isinstance(report["device"]["software"], bool)
    assert report["size"] == [64, 36]
    assert [entry["node"] for entry in report["passes"]] == ["sun", "light"]
    for entry in report["passes"]:
        assert set(entry) == {"node", "type", "gpu_ms", "cpu_ms"}
    assert set(report["frame_ms"]) == {"median", "min", "max"}
    memory = {"no_reuse_bytes", "allocated_bytes", "lower_bound_bytes", "peak_node", "proven", "tier"}
    assert memory <= set(report["memory"])
    assert report["outputs"] == ["a.exr"]


@pytest.mark.slow
def test_a_picture_gives_its_pipeline_back(cli: Any, tmp_path: Path) -> None:
    for name in ("a.exr", "a.png"):
        assert cli("run", "forward", *SMALL, "-s", "light.ambient=0.25", "-o", name).code == 0
        text = cli("config", name).out
        assert "ambient: 0.25" in text
        (tmp_path / "again.yaml").write_text(text)
        assert cli("run", "again.yaml", "-o", f"b{name[1:]}").code == 0
        assert np.array_equal(images.read(name), images.read(f"b{name[1:]}"))
        told = cli("config", name, "--json").json
        assert yaml.safe_load(told["yaml"])["nodes"]["light"]["params"]["ambient"] == 0.25
        assert {"versions", "device"} <= set(told["metadata"])


def test_a_picture_that_says_nothing_is_told(cli: Any) -> None:
    cli("run", "forward", *SMALL, "-o", "a.jpg")
    result = cli("config", "a.jpg")
    assert result.code == 3
    assert result.err.startswith("a.jpg: RG510 the picture has no pipeline in its metadata")
    assert cli("config", "none.png").err == "none.png: RG350 the image does not exist\n"


@pytest.mark.slow
def test_test_modes_change_no_pixel(cli: Any) -> None:
    cli("run", "forward-prepass", *SMALL, "-o", "a.exr")
    for mode in (["--no-alias"], ["--poison"], ["--shuffle", "3"]):
        assert cli("run", "forward-prepass", *SMALL, "-o", "b.exr", *mode).code == 0
        assert np.array_equal(images.read("a.exr"), images.read("b.exr")), mode


def test_taps_keep_values_and_are_viewable(cli: Any) -> None:
    words = [
        "-s",
        "sun.resolution=256",
        "--tap",
        "sun.shadow_map=s.exr",
        "--tap",
        "light.surface_depth=d.exr",
        "--tap",
        "display.color=c.exr",
    ]
    assert cli("run", "forward", *SMALL, *words, "--tap", "sun.shadow_map=s.png").code == 0
    assert images.read("s.exr").shape == (1, 256, 256, 1)
    assert images.read("d.exr").shape == (36, 64, 1)
    assert images.read("c.exr").shape == (36, 64, 4)
    assert images.read("s.png").shape == (256, 256, 1)


def test_taps_of_parts_become_pictures_and_keep_values(cli: Any) -> None:
    words = ["bloom.glow[mip=1]=g.exr", "sun.shadow_map[0]=s.png", "sun.shadow_map[0]=s.exr"]
    assert (
        cli(
            "run",
            "bloom",
            "--scene",
            "cornell_box",
            *SMALL,
            "-s",
            "sun.resolution=256",
            *(word for tap in words for word in ("--tap", tap)),
        ).code
        == 0
    )
    assert images.read("g.exr").shape == (9, 16, 4)
    assert images.read("s.png").shape == (256, 256, 1)
    assert images.read("s.exr").shape == (256, 256, 1)


@pytest.mark.slow
def test_all_ports_become_pictures_in_order_and_a_sheet_of_them(cli: Any, tmp_path: Path) -> None:
    result = cli(
        "run",
        "bloom",
        "--scene",
        "cornell_box",
        *SMALL,
        "-s",
        "sun.resolution=64",
        "--tap-all",
        "a/inside",
        "-o",
        "b.exr",
    )
    assert result.code == 0
    names = [line.removeprefix("a/inside/") for line in result.out.splitlines()[1:]]
    assert [name.partition("-")[0] for name in names[:-1]] == [f"{n:02d}" for n in range(1, len(names))]
    assert names[-1] == "contact.png"
    ports = [name.partition("-")[2].removesuffix(".png") for name in names[:-1]]
    assert ports.index("sun.shadow_map") < ports.index("shadows.visibility") < ports.index("light.radiance")
    assert ports[-4:] == ["bloom.blurred_x", "bloom.glow", "bloom.radiance", "display.color"]
    assert sorted(path.name for path in (tmp_path / "a/inside").iterdir()) == sorted(names)
    assert images.read(f"a/inside/{names[ports.index('light.radiance')]}").shape == (36, 64, 3)
    assert images.read("a/inside/contact.png").max() > 0.9


@pytest.mark.slow
def test_all_ports_of_several_frames_are_numbered(cli: Any, tmp_path: Path) -> None:
    assert cli("run", "forward", *SMALL, "-s", "sun.resolution=64", "--tap-all", "in", "--frames", "1-2").code == 0
    assert {"contact.0001.png", "contact.0002.png"} < {path.name for path in (tmp_path / "in").iterdir()}
    assert not (tmp_path / "forward.png").exists()


def test_a_folder_that_cannot_be_is_said_before_drawing(cli: Any, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    result = cli("run", "forward", *SMALL, "--tap-all", "file/in")
    assert result.code == 3
    assert "file/in: RG504 cannot be created: Not a directory" in result.err


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["run", "forwrd"], "RG015 there is no shipped pipeline 'forwrd'; did you mean 'forward'?"),
        (["run", "forward.yaml"], "RG011 there is no file 'forward.yaml'; did you mean 'forward', which is shipped?"),
        (["run", "glass"], "'glass'; it is a scene, render it with: rendergraph run full --scene glass"),
        (["run", "forward", "--scene", "bloom"], "RG015 there is no shipped scene 'bloom'; it is a pipeline"),
        (
            ["run", "forward", "--tap", "su.shadow_map=a.exr"],
            "--tap su.shadow_map: there is no node 'su'; did you",
        ),
        (["run", "forward", "-o", "imag=a.png"], "pipeline 'forward' has no output 'imag'; did you mean 'image'?"),
        (["run", "forward", "-s", "light.ambien=1"], "no param or input 'ambien'; did you mean 'ambient'?"),
        (["check", "forward", "-s", "light.ambient=x"], "light.ambient"),
        (["check", "forward", "--scene", "none.glb"], "none.glb"),
        (["check", "forward", "--environment", "none.hdr"], "RG350 environment 'none.hdr' does not exist"),
        (["check", "forward", "--camera", "none"], "the scene has no camera 'none'; available: main"),
        (["check", "forward", "--size", "16385x1"], "RG207 "),
        (["check", "forward", "-p", "none.yaml"], "none.yaml"),
        (["plan", "none.yaml"], "RG011 there is no file 'none.yaml'"),
        (["graph", "forward", "-o", "no/a.svg"], "no/a.svg: RG504 cannot be written: there is no folder 'no'"),
        (["nodes", "shadow"], "RG511 unknown family of nodes 'shadow'; did you mean 'shadows'?"),
        (["explain", "RG1O3"], "RG511 unknown name 'RG1O3'"),
        (["explain", "RG999"], "RG511 unknown error code 'RG999'"),
    ],
)
def test_what_is_missing_or_wrong_exits_3(cli: Any, tmp_path: Path, words: list[str], message: str) -> None:
    result = cli(*words)
    assert (result.code, result.out) == (3, "")
    assert message in result.err
    told = cli(*words, "--json")
    assert told.code == 3
    assert any(problem["text"] in told.err for problem in told.json["error"]["problems"])
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("name", "text", "drawn"),
    [
        ("knot.glb", "glTF", "knot.glb"),
        ("my box.OBJ", "v 0 0 0", "'my box.OBJ'"),
        ("ball.yaml", "scene: 1\nobjects: {}", "FILE"),
    ],
)
def test_a_scene_is_no_pipeline_and_how_it_is_drawn_is_said(
    cli: Any, tmp_path: Path, name: str, text: str, drawn: str
) -> None:
    (tmp_path / name).write_text(text)
    result = cli("run", name)
    said = f"RG013 this file is a scene, not a pipeline; render it with: rendergraph run full --scene {drawn}"
    assert (result.code, result.out) == (3, "")
    assert said in result.err
    assert len(result.err.splitlines()) in (1, 3)


def test_several_mistakes_are_told_at_once(cli: Any) -> None:
    result = cli("check", "forward", "-s", "light.ambien=3", "-s", "sun.type=shadow_mp", "--json")
    assert [problem["code"] for problem in result.json["error"]["problems"]] == ["RG103", "RG102"]


@pytest.mark.slow
def test_bench_shows_the_steps_of_a_pass(cli: Any) -> None:
    told = cli("bench", "bloom", *SMALL, "-n", "2", "--steps", "--json").json
    nodes = [step["node"] for step in told["steps"]]
    assert set(nodes) == {entry["node"] for entry in told["passes"]}
    assert nodes.count("bloom") > 2
    assert "steps" not in cli("bench", "forward", *SMALL, "-n", "1", "--json").json
    lines = cli("bench", "bloom", *SMALL, "-n", "1", "--steps").out.splitlines()
    assert sum(line.startswith("  0 ") for line in lines) >= 1


def test_check_and_plan_say_what_they_found(cli: Any) -> None:
    result = cli("check", "forward")
    assert (result.code, result.out) == (0, "")
    assert result.err == "forward: 5 nodes, 4 links, 1280×720, outputs image, radiance\n"
    told = cli("check", "forward", "--json").json
    assert told["outputs"] == {"image": "display.color", "radiance": "light.radiance"}
    assert told["warnings"] == []
    assert {"order", "resources", "memory"} <= set(cli("plan", "forward", "--json").json)


@pytest.mark.parametrize(
    ("name", "start"), [("a.svg", "<svg"), ("a.dot", "digraph"), ("a.mmd", "flowchart"), ("a.txt", "")]
)
def test_a_graph_s_file_says_what_it_is_drawn_as(cli: Any, tmp_path: Path, name: str, start: str) -> None:
    result = cli("graph", "forward", "-o", name)
    assert result.out == f"{name}\n"
    assert (tmp_path / name).read_text().startswith(start)
    assert cli("graph", "forward", "-o", name, "--json").json == {"output": name}


def test_config_prints_origins_and_resolved_values(cli: Any) -> None:
    result = cli("config", "forward-prepass", "-s", "light.ambient=0.5")
    assert re.search(r"ambient: 0.5 +# --set light.ambient=0.5\n", result.out)
    assert re.search(r"visibility: shadows.visibility +# forward-prepass:\d+\n", result.out)
    told = cli("config", "forward-prepass", "--json").json
    assert told["resolved"]["nodes"]["prepass"] == {"type": "depth_prepass"}
    assert yaml.safe_load(told["yaml"]) == told["resolved"]


def test_a_disabled_node_is_in_config_and_not_drawn(cli: Any) -> None:
    off = ("-s", "bloom.enabled=false")
    assert re.search(r"enabled: false +# --set bloom.enabled=false\n", cli("config", "bloom", *off).out)
    assert "bloom" not in [entry["node"] for entry in cli("run", "bloom", *SMALL, *off, "--json").json["passes"]]
    assert "bloom.radiance" not in cli("graph", "bloom", *off).out
    needed = cli("check", "bloom", "-s", "light.enabled=false")
    assert needed.code == 3
    assert "RG132 'bloom.radiance' needs 'light.radiance', but 'light' is disabled (--set" in needed.err
    tapped = cli("run", "bloom", *SMALL, "-s", "shadows.enabled=false", "--tap", "shadows.visibility=a.exr")
    assert tapped.code == 3
    assert "node 'shadows' is disabled, and nothing replaces 'visibility'" in tapped.err


def test_bench_has_spreads(cli: Any) -> None:
    result = cli("bench", "forward", *SMALL, "-n", "3", "--json")
    report = result.json
    assert report["frames"] == 3
    for figures in (report["frame_ms"], *(entry["cpu_ms"] for entry in report["passes"])):
        assert figures["min"] <= figures["p10"] <= figures["median"] <= figures["p90"] <= figures["max"]
    assert ("say nothing about GPUs" in result.err) == report["device"]["software"]
    assert "forward_lighting" in cli("bench", "forward", *SMALL, "-n", "1").out


# --- the error pages of the command line -----------------------------------------------------------------------------


def pages() -> list[dict[str, str]]:
    files = sorted(folder("rendergraph.errors").glob("RG5*.yaml"))
    return [yaml.safe_load(file.read_text(encoding="utf-8")) for file in files]


@pytest.mark.parametrize("page", pages(), ids=lambda page: page["code"])
def test_the_wrong_line_of_a_page_prints_its_message(cli: Any, tmp_path: Path, page: dict[str, str]) -> None:
    if page["code"] in ("RG507", "RG509", "RG599"):
        pytest.skip("needs a full disk or a mistake of ours; tested elsewhere")
    outputs = "{image: null, radiance: null, ao: display.color}"
    (tmp_path / "occlusion.yaml").write_text(f"extends: forward\noutputs: {outputs}\n")
    outputs = "{image: null, variance: light.radiance}"
    (tmp_path / "truth.yaml").write_text(f"extends: forward\noutputs: {outputs}\n")
    images.write(tmp_path / "photo.png", np.zeros((2, 2, 3), np.uint8))
    lines = re.sub(r"(?m)\s#.*", "", page["wrong"]).splitlines()  # no comment begins within a word, such as `a.##.png`
    *before, wrong = (shlex.split(line)[1:] for line in lines)
    for words in before:
        assert cli(*words).code == 0
    result = cli(*wrong)
    assert result.err == page["message"] + "\n"
    assert result.code in (2, 3)
    assert not list(tmp_path.glob("a.*"))


# --- doctor ----------------------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_doctor_finds_a_device_here(cli: Any) -> None:
    result = cli("doctor", "--json")
    assert result.code == 0
    report = result.json
    assert report["ok"]
    assert report["install"] == []
    assert {"moderngl", "numpy", "OpenImageIO", "networkx"} <= set(report["packages"])
    (device, *_) = report["devices"]
    assert device["usable"]
    assert {"OpenGL 4.5", "compute shaders", "texture views", "indirect multi-draw"} <= set(device["features"])
    assert "ready to render" in cli("doctor").out


BROKEN: list[tuple[Any, str]] = [
    (("-c", "import os; os.kill(os.getpid(), 11)"), "the driver crashed (signal 11)"),
    (("-c", "print('no json')"), "the probe failed: no answer"),
    (("-c", "import sys; sys.exit('libfoo is missing')"), "the probe failed: libfoo is missing"),
    (("-c", "import time; time.sleep(60)"), "the driver did not answer within 1 s"),
    (("-c", "\0"), "the probe cannot be started: embedded null byte"),
]


@pytest.mark.parametrize(("instead", "problem"), BROKEN)
def test_doctor_survives_a_broken_driver(
    cli: Any, monkeypatch: pytest.MonkeyPatch, instead: tuple[str, ...], problem: str
) -> None:
    from rendergraph.cli import doctor

    run = subprocess.run
    monkeypatch.setattr(doctor, "_SECONDS", 1)
    broken = [sys.executable, *instead]
    monkeypatch.setattr(
        subprocess, "run", lambda words, **rest: run(broken if "rendergraph.cli.doctor" in words else words, **rest)
    )
    result = cli("doctor", "--json")
    assert result.code == 5
    assert result.json["problem"] == problem
    assert result.json["install"] == ["apt install libgl1-mesa-dri   (software rendering; or your GPU vendor's driver)"]
    assert problem in cli("doctor").out


def test_doctor_names_the_workarounds_for_a_driver(cli: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    from rendergraph.cli import doctor

    device = {"number": 0, "renderer": "zink", "version": "4.6 Mesa", "gl": "4.6", "software": True, "features": {}}
    device["workarounds"] = ["a crash of this driver is avoided"]
    monkeypatch.setattr(doctor, "_probe", lambda *number: device if number else {"devices": [{"number": 0}]})
    assert "software: not comparable to a GPU, a crash of this driver is avoided" in cli("doctor").out


def test_doctor_says_what_to_install(cli: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    from rendergraph.cli import doctor

    missing = {"libEGL.so.1": None, "libGL.so.1": "cannot open shared object file"}
    answers = {
        (): {"libraries": missing, "devices": [{"number": 0, "software": False, "vendor": "ACME"}], "problem": None},
        ("0",): {"problem": "libGL.so.1 not loaded"},
    }
    monkeypatch.setattr(doctor, "_probe", lambda *words: answers[words])
    monkeypatch.setattr(doctor, "_packages", lambda: {"numpy": "2", "moderngl": None})
    result = cli("doctor")
    assert result.code == 5
    assert "pip install moderngl" in result.out
    assert "apt install libgl1 libgl1-mesa-dri" in result.out
    assert "0       no      ACME      libGL.so.1 not loaded" in result.out
    assert "cannot render here yet" in result.out


def test_a_view_gives_what_is_not_chosen_otherwise(cli: Any, tmp_path: Path) -> None:
    (tmp_path / "mine.yaml").write_text(
        "rendergraph: 1\nextends: forward\nsize: [16, 9]\n"
        "views: {side: {camera: 'eye=4,1,0 target=0,1,0', environment: dawn, frame: 12}, out: {environment: ../x.hdr}}\n"
    )
    assert cli("run", "mine.yaml", "--view", "side", "-o", "a.png").code == 0
    assert cli("run", "a.png", "-o", "b.png").code == 0
    viewed = images.read("a.png")
    np.testing.assert_array_equal(images.read("b.png"), viewed)
    words = ("--camera", "eye=4,1,0 target=0,1,0", "--environment", "dawn", "--frames", "12-12")
    assert cli("run", "mine.yaml", *words, "-o", "c.png").code == 0
    np.testing.assert_array_equal(images.read("c.png"), viewed)
    assert cli("run", "mine.yaml", "--view", "side", "--camera", "main", "-o", "d.png").code == 0
    assert (images.read("d.png") != viewed).any()
    assert "RG500 there is no view 'sid'; did you mean 'side'?" in cli("run", "mine.yaml", "--view", "sid").err
    assert "RG500 there is no view 'sid'; the file has no views" in cli("run", "forward", "--view", "sid").err
    assert "RG012 '../x.hdr' lies outside" in cli("run", "mine.yaml", "--view", "out").err


def test_a_site_of_pipelines_is_whole(cli: Any, tmp_path: Path) -> None:
    (tmp_path / "mine.yaml").write_text("rendergraph: 1\nextends: forward\ndescription: <b>Mine</b> & yours\n")
    (tmp_path / "wrong.yaml").write_text("rendergraph: 1\nextends: forward\nnodes: {light: {params: {ambiant: 1}}}\n")
    result = cli("gallery", "forward", "mine.yaml", "-o", "site", "--title", "A & B", *ROUGH, "--json")
    names = ["index.html", "forward.html", "forward.png", "mine.html", "mine.png"]
    assert result.json["outputs"] == [f"site/{name}" for name in names]
    index = (tmp_path / "site" / "index.html").read_text()
    assert "<h1>A &amp; B</h1>" in index
    assert "&lt;b&gt;Mine&lt;/b&gt; &amp; yours" in index
    assert set(re.findall(r'(?:href|src)="([^"]+)"', index)) == set(names[1:])
    assert images.read(tmp_path / "site" / "forward.png").shape[:2] == (36, 64)
    broken = cli("gallery", "forward", "wrong.yaml", "-o", "other", *ROUGH)
    assert broken.code == 3
    assert not (tmp_path / "other").exists(), "mistakes are reported before anything is drawn"
    assert "same name" in cli("gallery", "forward", "forward", "-o", "other").err
