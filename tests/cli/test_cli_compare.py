"""`compare` and `sweep` as they are typed."""

from __future__ import annotations

import csv
import json
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import fastjsonschema
import numpy as np
import pytest

import rendergraph as rg

SMALL = ("--size", "48x27", "-s", "sun.resolution=64")


def test_compare_prints_a_table_and_writes_a_page(cli: Any, tmp_path: Path) -> None:
    found = cli("compare", "forward", "forward-prepass", *SMALL, "-n", "2", "-o", "it's.html", "-o", "a.csv")
    assert found.code == 0
    assert "forward-prepass" in found.out
    assert "FLIP" in found.out
    assert "report: it's.html" in found.err
    page = (tmp_path / "it's.html").read_text()
    command = (
        "rendergraph compare forward forward-prepass --size 48x27 -s sun.resolution=64 -n 2 -o &#x27;it&#x27;&quot;"
    )
    assert command in page
    with (tmp_path / "a.csv").open(newline="") as file:
        assert [row["run"] for row in csv.DictReader(file)] == ["forward", "forward-prepass"]


def test_compare_speaks_json(cli: Any) -> None:
    told = cli("compare", "forward", "forward", *SMALL, "-n", "1", "--json").json
    assert [variant["name"] for variant in told["variants"]] == ["forward", "forward-2"]
    for variant in told["variants"]:
        assert (variant["rmse"], variant["psnr"], variant["ssim"], variant["flip"]) == (0, None, 1, 0)
        assert "software rasteriser" not in json.dumps(variant)


@pytest.mark.slow
def test_beyond_a_threshold_is_exit_code_4(cli: Any) -> None:
    words = ("compare", "forward", "shading-unlit", *SMALL, "-n", "1")
    within = cli(*words, "--fail-above", "flip=0.9")
    assert within.code == 0
    beyond = cli(*words, "--fail-above", "flip=0.001", "--fail-above", "rmse=0.001", "--json")
    assert beyond.code == 4
    assert len(beyond.json["exceeded"]) == 2
    assert "shading-unlit: flip is" in beyond.err
    assert "above 0.001" in beyond.err
    itself = cli("compare", "forward", "forward", *SMALL, "-n", "1", "--fail-above", "flip=0")
    assert itself.code == 0


BROKEN = """// Light that is no number in a corner, and what 8 bits show of it.
/*---
outputs:
  light: {semantic: radiance, format: rgba32f, doc: Light.}
  shown: {semantic: display_color, format: rgba8, doc: Colour.}
params:
  much: {default: 0.5, min: -1, max: 1, doc: How much.}
---*/
uniform float much;
layout(location = 0) out vec4 light;
layout(location = 1) out vec4 shown;
void main() {
    light = vec4(gl_FragCoord.x < 3.0 && gl_FragCoord.y < 2.0 ? sqrt(much) : 0.5);
    shown = vec4(0.5);
}
"""
BROKEN_FILE = (
    "rendergraph: 1\nsize: [16, 8]\nnodes: {a: {type: broken}}\noutputs: {radiance: a.light, image: a.shown}\n"
)


def test_pictures_with_nan_are_told_and_never_win(cli: Any, tmp_path: Path) -> None:
    (tmp_path / "broken.frag").write_text(BROKEN)
    (tmp_path / "p.yaml").write_text(BROKEN_FILE)
    plugin = ("--plugin", "broken.frag")
    warning = "warning: RG619 6 of 128 pixels of 'radiance' (a.light) are NaN or infinite"
    found = cli("run", "p.yaml", *plugin, "-s", "a.much=-1", "-o", "a.####.exr", "--frames", "1-3")
    assert found.code == 0
    assert found.err.count(warning) == 1
    assert "RG619" not in cli("run", "p.yaml", *plugin, "-o", "a.exr").err
    tapped = cli("run", "p.yaml", *plugin, "-s", "a.much=-1", "--tap", "a.light=b.exr", "-o", "image=b.png")
    assert "warning: RG619 6 of 128 pixels of 'a.light' are NaN" in tapped.err
    words = ("-x", "a.much=0.5,-1", "-n", "1", "-o", "out", "--fail-above", "flip=0.9", "--json")
    swept = cli("sweep", "p.yaml", *plugin, *words)
    assert swept.code == 4
    good, bad = swept.json["runs"]
    assert (good["not_finite"], bad["not_finite"], bad["flip"]) == (0, 6, 0)
    assert (good["pareto"], bad["pareto"], bad["radiance_rmse"]) == (True, False, None)
    assert "a.much=-1: warning: RG619 6 pixels of its outputs are NaN or infinite" in swept.err
    compared = cli("compare", "p.yaml", *plugin, "-s", "a.much=-1", "--reference", "p.yaml", "-n", "1")
    assert "p: warning: RG619 6 pixels" in compared.err
    again = cli("sweep", "p.yaml", *plugin, *words, "--resume")
    assert [run["not_finite"] for run in again.json["runs"]] == [0, 6]


def test_nan_is_magenta_in_a_png_and_its_first_texture_is_named(cli: Any, tmp_path: Path) -> None:
    from rendergraph.images import read

    (tmp_path / "broken.frag").write_text(BROKEN)
    (tmp_path / "p.yaml").write_text(
        "rendergraph: 1\nsize: [16, 8]\nnodes:\n  a: {type: broken}\n"
        "  blur: {type: gaussian_blur, inputs: {source: a.light}, params: {radius: 1}}\n"
        "  display: {type: tonemap, inputs: {radiance: blur.blurred}}\noutputs: {image: display.color}\n"
    )
    clean = cli("run", "p.yaml", "--plugin", "broken.frag", "-o", "a.png")
    assert "RG619" not in clean.err
    found = cli("run", "p.yaml", "--plugin", "broken.frag", "-s", "a.much=-1", "-o", "a.png")
    assert "RG619 12 of 128 pixels of 'image' (display.color) are NaN or infinite (drawn in magenta)" in found.err
    assert "the first texture with such texels is 'a.light'" in found.err
    magenta = (read(tmp_path / "a.png") == (255, 0, 255)).all(axis=-1)
    assert magenta[-3:, :4].all()
    assert magenta.sum() == 12
    (tmp_path / "broken.frag").write_text(BROKEN.replace("vec4(0.5)", "vec4(1, 0, 1, 1)"))
    assert "RG619" not in cli("run", "p.yaml", "--plugin", "broken.frag", "--tap", "a.shown=b.png", "-o", "a.png").err


@pytest.mark.parametrize(
    ("words", "code", "message"),
    [
        (("compare", "forward"), 2, "there is only one pipeline and nothing to compare it with"),
        (("compare", "forward", "forwrad"), 3, "RG015"),
        (
            ("compare", "forward", "forward", "--fail-above", "flpi=1"),
            2,
            "unknown metric 'flpi'; did you mean 'flip'?",
        ),
        (("compare", "forward", "forward", "--fail-above", "psnr=30"), 2, "psnr falls as errors grow"),
        (("compare", "forward", "forward", "--fail-above", "flip=x"), 2, "is not METRIC=NUMBER, as in flip=0.02"),
        (("compare", "forward", "forward", "-o", "page.txt"), 2, "name it 'page.html'"),
        (("compare", "forward", "forward", "-o", "none/page.html"), 3, "there is no folder 'none'"),
        (("compare", "forward", "--reference", "missing.png"), 3, "RG350"),
        (
            ("compare", "forward", "deferred", "-s", "gbuffer.oct_bits=8"),
            3,
            "--set gbuffer.oct_bits=8: RG109 in forward: there is no node 'gbuffer'; available: display, environment, light, shadows, sun; "
            "-s applies to all pipelines; for one alone: rendergraph compare deferred --reference forward -s …",
        ),
        (("sweep", "forward", "-o", "out"), 3, "RG524 the sweep has no axis"),
        (("sweep", "forward", "-x", "shadows.taps=1"), 2, "RG500 a sweep needs a folder for its runs: -o DIR"),
        (
            ("sweep", "forward", "-x", "shadows.taps=1", "-o", "all.csv"),
            2,
            "with --csv, results.csv, not a file: -o all",
        ),
        (("sweep", "forward", "-x", "shadows.taps=1:4:0", "-o", "out"), 2, "steps of 0 do not lead from 1 to 4"),
        (("sweep", "forward", "-x", "shadows.taps=1:4", "--list"), 3, "add a step (1:4:STEP) or use --samples"),
        (("sweep", "forward", "-x", "a.b=1,2", "--zip", "a.b", "--list"), 2, "is not PATH,PATH"),
        (("sweep", "forward", "-x", "shadows.taps=", "-o", "out"), 2, "axis 'shadows.taps' has no values"),
        (("sweep", "forward", "-x", "shadows.tap=1", "-o", "out"), 3, "did you mean 'taps'?"),
    ],
)
def test_mistakes(cli: Any, words: tuple[str, ...], code: int, message: str) -> None:
    found = cli(*words)
    assert found.code == code
    assert message in found.err


@pytest.mark.slow
def test_sweep_draws_keeps_and_resumes(cli: Any, tmp_path: Path) -> None:
    words = (
        "sweep",
        "forward",
        "--scene",
        "cornell_box",
        *SMALL,
        "-x",
        "shadows.taps=1,3",
        "-x",
        "display.curve=aces,none",
        "-o",
        "out",
        "-n",
        "1",
    )
    first = cli(*words)
    assert first.code == 0
    assert "4 runs against shadows.taps=1,display.curve=aces: 7 passes executed, 12 without sharing" in first.out
    assert first.out.splitlines()[-1] == "out/report.html"
    assert "Pareto front" in (tmp_path / "out" / "report.html").read_text()
    assert cli(*words).code == 3
    again = cli(*words, "--resume", "--json").json
    assert (again["executed_passes"], again["resumed"], len(again["runs"])) == (0, 4, 4)
    assert sum(run["pareto"] for run in again["runs"]) >= 1


@pytest.mark.slow
def test_a_sweep_file(cli: Any, tmp_path: Path) -> None:
    (tmp_path / "study.yaml").write_text(
        "sweep: 1\npipeline: forward\nsize: [48, 27]\nframes: 1\nset: {sun.resolution: 64}\n"
        "axes: {shadows.taps: [1, 3]}\n"
    )
    told = cli("sweep", "study.yaml", "-x", "display.curve=aces,none", "-o", "out", "--json").json
    assert told["axes"] == {"shadows.taps": [1, 3], "display.curve": ["aces", "none"]}
    assert told["size"] == [48, 27]
    assert len((tmp_path / "out" / "results.jsonl").read_text().splitlines()) == 4


def test_a_sweep_is_listed_before_it_is_drawn(cli: Any, tmp_path: Path) -> None:
    words = ("-x", "shadows.taps=1:3:1", "-x", "display.curve=aces,none", "--size", "48x27", "--list")
    told = cli("sweep", "forward", "--scene", "cornell_box", *words).out.splitlines()
    assert told[0] == "6 runs against shadows.taps=1,display.curve=aces: 10 passes to execute, 18 without sharing"
    assert [line.split() for line in told[2:6]] == [
        ["sun", "1", "6"],
        ["light", "3", "6"],
        ["display", "6", "6"],
        ["group", "shadows.taps", "display.curve"],
    ]
    assert [line.split() for line in told[6:8]] == [["1", "1", "aces"], ["1", "1", "none"]]
    found = cli("sweep", "forward", "--scene", "cornell_box", *words, "--samples", "4", "--seed", "1", "--json").json
    assert (len(found["runs"]), found["passes"][0]) == (4, {"node": "sun", "drawn": 1, "one_by_one": 4})
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("more", [(), ("--minimise", "rmse", "--budget", "2")])
def test_a_sweep_of_which_nothing_can_be_drawn_says_why(cli: Any, tmp_path: Path, more: tuple[str, ...]) -> None:
    pytest.importorskip("optuna")
    header = "/*---\ndoc: x\noutputs: {color: {semantic: radiance, format: rgba16f, doc: x}}\n"
    header += "params: {mode: {default: 1, role: define, doc: x}}\n---*/\n"
    (tmp_path / "fx.frag").write_text(
        header + "out vec4 color;\nvoid main() {\n#if MODE == 3\nx;\n#endif\ncolor = vec4(1.0); }\n"
    )
    text = "rendergraph: 1\nsize: [8, 8]\nnodes: {a: {type: fx}}\noutputs: {radiance: a.color}\n"
    (tmp_path / "p.yaml").write_text(text)
    words = ("-x", "a.mode=3", "--reference", "p.yaml", "--plugin", "fx.frag", "--csv", "-o", "out")
    found = cli("sweep", "p.yaml", *words, *more, "--json")
    assert (found.code, "a.mode=3 failed: " in found.err, "RG410" in found.err) == (1, True, True)
    assert (found.json["runs"], len(found.json["failed"]), found.json.get("report")) == ([], 1, None)
    with (tmp_path / "out" / "results.csv").open(newline="") as file:
        assert [row["run"] for row in csv.DictReader(file)] == ["a.mode=3"]


@pytest.mark.nightly
@pytest.mark.slow
def test_a_search_is_a_sweep_s_file_too(cli: Any, tmp_path: Path) -> None:
    pytest.importorskip("optuna")
    (tmp_path / "study.yaml").write_text(
        "sweep: 1\npipeline: forward\nsize: [32, 18]\nframes: 1\nreference: shading-pbr\n"
        "set: {sun.resolution: 64, light.environment: null}\n"
        "minimise: rmse\nbudget: 3\nseed: 4\naxes: {light.ambient: 0.0:0.5, display.exposure: -1:1:0.5}\n"
    )
    assert cli("check", "study.yaml").err == "study.yaml: a sweep of 3 runs\n"
    told = cli("sweep", "study.yaml", "-o", "out", "--json").json
    assert [len(told["runs"]), told["search"]["minimise"], told["search"]["budget"]] == [3, ["rmse"], 3]
    asked = {entry["name"]: entry["values"][0] for entry in told["search"]["asked"]}
    assert asked == {run["name"]: run["rmse"] for run in told["runs"]}
    assert told["search"]["front"] == [min(asked, key=lambda name: asked[name])]
    again = cli("sweep", "study.yaml", "-o", "out", "--resume").out
    assert "3 runs reused" in again
    assert f"minimum{' ' * (len(told['search']['front'][0]) - 7)}  rmse" in again


def test_what_is_odd_of_every_value_is_said_of_the_first(cli: Any, tmp_path: Path) -> None:
    (tmp_path / "study.yaml").write_text("sweep: 1\npipeline: forward\naxes: {light.ambient: [0, 0.5, 1]}\n")
    first, last = cli("check", "study.yaml").err.splitlines()
    assert first.startswith("--set light.ambient=0: warning: RG155 ")
    assert last == "study.yaml: a sweep of 3 runs"


@pytest.mark.parametrize(
    ("words", "code", "message"),
    [
        (("--minimise", "flip", "--list"), 2, "RG500 --minimise and --list: an optimiser chooses runs by the results"),
        (("--minimise", "flip", "--samples", "3", "-o", "o"), 2, "RG500 --minimise and --samples exclude each other"),
        (("--minimise", "flip", "-o", "o"), 3, "RG524 a search needs a reference to measure its runs against"),
        (("--minimise", "x", "--reference", "forward", "-o", "o"), 3, "RG524 unknown objective 'x'"),
    ],
)
def test_searches_that_cannot_be_are_told(cli: Any, words: tuple[str, ...], code: int, message: str) -> None:
    pytest.importorskip("optuna")
    found = cli("sweep", "forward", "-x", "light.ambient=0.0:1", *words)
    assert (found.code, message in found.err) == (code, True), found


@pytest.mark.parametrize(
    ("words", "code", "message"),
    [
        (("export", "study.yaml", "-o", "job.yaml"), 2, "RG500 farm export needs the kind of job: --openjd"),
        (("export", "missing.yaml", "--openjd", "-o", "job.yaml"), 3, "RG011 there is no file 'missing.yaml'"),
        (("export", "wrong.yaml", "--openjd", "-o", "job.yaml"), 3, "wrong.yaml:3:8: RG103"),
        (("measure", "study.yaml", "-o", "out"), 2, "RG500 farm measure needs --runs, such as --runs 1-16"),
        (("measure", "study.yaml", "--runs", "3", "-o", "out"), 2, "there is no run 3; the sweep has 2 runs"),
        (("measure", "study.yaml", "--runs", "2-1", "-o", "out"), 2, "'2-1' is not N or A-B"),
        (
            ("frames", "study.yaml", "--runs", "1", "-o", "out"),
            2,
            "RG500 farm frames needs --frames, such as --frames 1-24",
        ),
    ],
)
def test_jobs_that_cannot_be_are_told(
    cli: Any, tmp_path: Path, words: tuple[str, ...], code: int, message: str
) -> None:
    for name, path in (("study", "shadows.taps"), ("wrong", "shadows.tap")):
        (tmp_path / f"{name}.yaml").write_text(f"sweep: 1\npipeline: forward\naxes: {{{path}: [1, 3]}}\n")
    found = cli("farm", *words)
    assert (found.code, message in found.err) == (code, True), found
    assert not (tmp_path / "out").exists()


def test_a_sweep_s_file_is_checked_without_drawing(cli: Any, tmp_path: Path) -> None:
    file = tmp_path / "study.yaml"
    text = "sweep: 1\npipeline: forward\nreference: shading-pbr\naxes: {shadows.taps: [1, 3], display.curve: [aces, none]}\n"
    file.write_text(text)
    found = cli("check", "study.yaml")
    assert (found.code, found.err) == (0, "study.yaml: a sweep of 4 runs\n")
    assert cli("check", "study.yaml", "--json").json == {"sweep": "study.yaml", "runs": 4, "warnings": []}
    file.write_text(text.replace("none", "acse").replace("shadows.taps", "shadows.tap"))
    found = cli("check", "study.yaml")
    assert found.code == 3
    assert "study.yaml:4:29: RG104" in found.err
    assert "study.yaml:4:8: RG103" in found.err
    for verb in ("run", "plan", "graph"):
        found = cli(verb, "study.yaml")
        assert found.code == 3
        assert found.err.splitlines()[0] == (
            "study.yaml:1:1: RG101 this file is a sweep, not a pipeline; run it with: rendergraph sweep FILE -o FOLDER"
        )
        assert found.err.count("RG") == 1


def test_a_sweep_writes_its_chart_as_a_picture(cli: Any, tmp_path: Path) -> None:
    words = ("sweep", "forward", "--scene", "cornell_box", *SMALL, "-x", "shadows.taps=1", "-n", "1", "-o", "out")
    found = cli(*words)
    assert found.out.startswith("1 run against shadows.taps=1: 3 passes executed")
    assert found.out.splitlines()[-2:] == ["out/quality.svg", "out/report.html"]
    assert (tmp_path / "out" / "quality.svg").read_text().startswith("<svg xmlns")


@pytest.mark.slow
def test_an_interrupted_sweep_keeps_what_is_drawn_and_says_how_to_go_on(cli: Any, tmp_path: Path) -> None:
    words = ["sweep", "forward", "-x", f"display.exposure={','.join(map(str, range(18)))}", *SMALL, "-n", "400"]
    process = subprocess.Popen(
        [sys.executable, "-m", "rendergraph", *words, "-o", "out"],
        cwd=tmp_path,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),  # a background job's suite ignores SIGINT
    )
    while process.poll() is None and len(list(tmp_path.glob("out/*/run.json"))) < 2:
        time.sleep(0.01)
    process.send_signal(signal.SIGINT)
    told = process.communicate(timeout=60)[1].splitlines()
    kept = len(list(tmp_path.glob("out/*/run.json")))
    assert process.returncode == 130
    assert 2 <= kept < 18
    assert told[-2].startswith(
        f"{kept} runs kept in out; continue with: rendergraph sweep forward -x display.exposure=0,"
    )
    assert told[-2].endswith("-n 400 -o out --resume")
    whole = [file.with_name("image.png") for file in tmp_path.glob("out/*/run.json")]  # one may have been begun
    before = {file: file.stat().st_mtime_ns for file in whole}
    words[-1] = "1"
    report = cli(*words, "-o", "out", "--resume", "--json").json
    assert (report["timed_again"], report["redrawn"], len(report["runs"])) == (kept, 0, 18)
    assert {file: file.stat().st_mtime_ns for file in before} == before


# --- variants by settings, ports, tables -----------------------------------------------------------------------------


@pytest.mark.slow
def test_settings_make_variants_of_one_pipeline(cli: Any) -> None:
    words = ("--size", "32x18", "-n", "1", "--json")
    told = cli(
        "compare", "forward", "--with", "shadows.taps=1", "--with", "shadows.taps=1 display.curve=aces", *words
    ).json
    assert [variant["name"] for variant in told["variants"]] == ["shadows.taps=1", "shadows.taps=1 display.curve=aces"]
    assert [change["name"] for change in told["variants"][1]["diff"]["parameters"]] == ["curve"]
    alone = cli("compare", "forward", "--with", "display.curve=aces", *words).json
    assert [variant["name"] for variant in alone["variants"]] == ["forward", "display.curve=aces"]
    assert alone["variants"][1]["flip"] > 0.01


@pytest.mark.parametrize(
    ("words", "code", "message"),
    [
        (
            ["--with", "shadows.tps=1"],
            3,
            "--with 'shadows.tps=1': RG103 node 'shadows' (shadow_pcf) has no param or input",
        ),
        (["--reference", "path-traced:light.sed=1"], 3, "--reference 'light.sed=1': RG103 node 'light' (path_traced)"),
        (["deferred", "--with", "shadows.taps=1"], 2, "RG500 --with makes variants of one pipeline"),
        (["--with", "taps"], 2, "'taps' is not PATH=VALUE"),
        (["deferred", "--metric", "ao.occlusion"], 3, "--metric ao.occlusion: RG109 in forward: there is no node 'ao'"),
        (["--with", "light.samples=4", "--metric", "light.radiance"], 3, "--metric light.radiance: RG523 "),
    ],
)
def test_variants_and_ports_that_cannot_be_are_told(cli: Any, words: list[str], code: int, message: str) -> None:
    result = cli("compare", "forward", *words, "--size", "16x9", "-n", "1")
    assert result.code == code, result
    assert message in result.err


@pytest.mark.nightly
def test_any_port_is_measured(cli: Any, gl: rg.Session, tmp_path: Path) -> None:
    size = (32, 18)
    names = ("ssao-hemisphere", "ssao-disc")
    one, other = (gl.render(name, size, taps="ao.occlusion").arrays["ao.occlusion"] for name in names)
    told = cli("compare", *names, "--metric", "ao.occlusion", "--size", "32x18", "-n", "1", "--json").json
    expected = np.sqrt(np.mean((one.astype(float) - other) ** 2))
    assert told["metric"] == "ao.occlusion"
    assert told["variants"][1]["rmse"] == pytest.approx(expected)
    # against a picture of the same port
    assert cli("run", names[0], "--size", "32x18", "--tap", "ao.occlusion=truth.exr").code == 0
    words = ("--reference", "truth.exr", "--metric", "ao.occlusion", "--size", "32x18", "-n", "1", "--json")
    against = cli("compare", *names, *words).json
    assert [variant["rmse"] for variant in against["variants"]] == pytest.approx([0, expected], abs=2e-3)


@pytest.mark.slow
def test_a_sweep_keeps_typed_values_and_a_table(cli: Any, tmp_path: Path) -> None:
    axes = ("-x", "ao.samples=8,16", "-x", "light.ambient=0.5,[0.1, 0.2, 0.3]")
    words = ("--metric", "ao.occlusion", "--size", "16x9", "-n", "1", "--csv", "-o", "out")
    result = cli("sweep", "ssao-hemisphere", *axes, *words)
    assert result.code == 0, result
    assert result.out.endswith("out/results.csv\n")
    lines = [json.loads(line) for line in (tmp_path / "out" / "results.jsonl").read_text().splitlines()]
    assert [line["settings"] for line in lines] == [
        {"ao.samples": samples, "light.ambient": ambient} for samples in (8, 16) for ambient in (0.5, [0.1, 0.2, 0.3])
    ]
    with (tmp_path / "out" / "results.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [row["ao.samples"] for row in rows] == ["8", "8", "16", "16"]
    assert [float(row["rmse"]) for row in rows] == [line["rmse"] for line in lines]
    assert [float(row["rmse"]) for row in rows][:2] == [0, 0]  # what is measured does not see the light
    assert float(rows[2]["rmse"]) > 0
    assert {row["pareto"] for row in rows} <= {"True", "False"}
    of_a_line = fastjsonschema.compile(cli("schema", "results").json)
    for line in lines:
        of_a_line(line)
    with pytest.raises(fastjsonschema.JsonSchemaException):
        of_a_line({**lines[0], "flip": "0"})
    fields = {field["name"]: field["type"] for field in cli("schema", "results-csv").json["fields"]}
    assert [name for name in rows[0] if name in fields] == list(fields)
    assert [name for name in rows[0] if name not in fields] == ["ao.samples", "light.ambient"]
    as_python: dict[str, Any] = {
        "integer": int,
        "number": float,
        "string": str,
        "boolean": {"True": True, "False": False}.__getitem__,
    }
    for row, line in zip(rows, lines, strict=True):
        read = {name: as_python[fields[name]](row[name]) for name in fields if row[name]}
        assert read["gpu_ms"] == line["gpu_ms"]["median"]
        assert (read["run"], read["frames"], read["passes"]) == (line["name"], 1, line["pass_count"])
        assert json.loads(row["light.ambient"]) == line["settings"]["light.ambient"]
    assert (tmp_path / "out" / rows[0]["run"] / "metric.exr").is_file()
    assert cli("sweep", "ssao-hemisphere", *axes, *words, "--resume", "--json").json["resumed"] == 4


@pytest.mark.nightly
def test_layers_of_an_array_are_measured_together(cli: Any) -> None:
    """The shadow map of one light is an array of one layer."""
    told = cli("compare", "forward", "deferred", *SMALL, "--metric", "sun.shadow_map", "-n", "1", "--json").json
    assert [run["rmse"] for run in told["variants"]] == [0, 0]
