"""`compare` and `sweep` as they are typed."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest

SMALL = ("--size", "48x27", "-s", "sun.resolution=64")


def test_compare_prints_a_table_and_writes_a_page(cli: Any, tmp_path: Path) -> None:
    found = cli("compare", "forward", "forward-prepass", *SMALL, "-n", "2", "-o", "it's.html")
    assert found.code == 0
    assert "forward-prepass" in found.out
    assert "FLIP" in found.out
    assert "report: it's.html" in found.err
    page = (tmp_path / "it's.html").read_text()
    command = (
        "rendergraph compare forward forward-prepass --size 48x27 -s sun.resolution=64 -n 2 -o &#x27;it&#x27;&quot;"
    )
    assert command in page


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


@pytest.mark.parametrize(
    ("words", "code", "message"),
    [
        (("compare", "forward"), 2, "there is one pipeline and nothing to compare it with"),
        (("compare", "forward", "forwrad"), 3, "RG015"),
        (
            ("compare", "forward", "forward", "--fail-above", "flpi=1"),
            2,
            "there is no metric 'flpi'; did you mean 'flip'?",
        ),
        (("compare", "forward", "forward", "--fail-above", "psnr=30"), 2, "psnr falls as errors grow"),
        (("compare", "forward", "forward", "--fail-above", "flip=x"), 2, "is not METRIC=NUMBER, as in flip=0.02"),
        (("compare", "forward", "forward", "-o", "page.pdf"), 2, "name it 'page.html'"),
        (("compare", "forward", "forward", "-o", "none/page.html"), 3, "there is no folder 'none'"),
        (("compare", "forward", "--reference", "missing.png"), 3, "RG350"),
        (
            ("compare", "forward", "deferred", "-s", "gbuffer.oct_bits=8"),
            3,
            "--set gbuffer.oct_bits=8: RG109 in forward: there is no node 'gbuffer'; there is display, light, shadows, sun; "
            "-s holds for all pipelines; for one alone: rendergraph compare deferred --reference forward -s …",
        ),
        (("sweep", "forward", "-o", "out"), 3, "RG524 the sweep has no axis"),
        (("sweep", "forward", "-x", "shadows.taps=1"), 2, "Missing option".lower()),
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
    assert "4 runs against shadows.taps=1,display.curve=aces: 7 passes drawn, 12 one by one" in first.out
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
    assert told["axes"] == {"shadows.taps": ["1", "3"], "display.curve": ["aces", "none"]}
    assert told["size"] == [48, 27]
    assert len((tmp_path / "out" / "results.jsonl").read_text().splitlines()) == 4


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
    assert "-x display.curve=acse: RG104" in found.err
    assert "-x shadows.tap=1: RG103" in found.err
    for verb in ("run", "plan", "graph"):
        found = cli(verb, "study.yaml")
        assert found.code == 3
        assert found.err.splitlines()[0] == (
            "study.yaml:1:1: RG101 this is no pipeline but a sweep; draw it with: rendergraph sweep FILE -o FOLDER"
        )
        assert found.err.count("RG") == 1


def test_a_sweep_writes_its_chart_as_a_picture(cli: Any, tmp_path: Path) -> None:
    words = ("sweep", "forward", *SMALL, "-x", "shadows.taps=1", "-n", "1", "-o", "out")
    found = cli(*words)
    assert found.out.startswith("1 run against shadows.taps=1: 3 passes drawn")
    assert found.out.splitlines()[-2:] == ["out/quality.svg", "out/report.html"]
    assert (tmp_path / "out" / "quality.svg").read_text().startswith("<svg xmlns")


@pytest.mark.slow
def test_an_interrupted_sweep_keeps_what_is_drawn_and_says_how_to_go_on(cli: Any, tmp_path: Path) -> None:
    words = ["sweep", "forward", "-x", f"display.exposure={','.join(map(str, range(18)))}", *SMALL, "-n", "400"]
    process = subprocess.Popen(
        [sys.executable, "-m", "rendergraph.cli", *words, "-o", "out"],
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
    assert told[-2].startswith(f"{kept} runs kept in out; go on with: rendergraph sweep forward -x display.exposure=0,")
    assert told[-2].endswith("-n 400 -o out --resume")
    before = {file: file.stat().st_mtime_ns for file in tmp_path.glob("out/*/image.png")}
    words[-1] = "1"
    report = cli(*words, "-o", "out", "--resume", "--json").json
    assert (report["timed_again"], report["redrawn"], len(report["runs"])) == (kept, 0, 18)
    assert {file: file.stat().st_mtime_ns for file in before} == before
