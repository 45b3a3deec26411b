"""A sweep as a job of a render farm: the template, checked and run by the reference tools; parts are as the whole."""

from __future__ import annotations

import csv
import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

import rendergraph as rg
from rendergraph.cli.app import main
from rendergraph.compare.engine import sweep
from rendergraph.compare.export.openjd import measure, numbers_text, parse_numbers, render_frames, template
from rendergraph.compare.prepare import SweepOptions, prepare
from rendergraph.compare.runner import list_sweep
from rendergraph.compare.store import read_results
from rendergraph.errors import InputError
from rendergraph.images import read

SHADER = """// A colour that moves.
/*---
outputs:
  color: {semantic: radiance, format: rgba16f, doc: The colour.}
params:
  gain: {default: 0.5, min: 0, max: 1, doc: How bright.}
---*/
uniform float gain, time;
out vec4 color;
void main() {
    if (gain > 0.85) { color = vec4(0.0, 1.0, 0.0, 1.0); return; }
    color = vec4(gain, fract(7.0 * time), gl_FragCoord.x / 8.0, 1.0);
}
"""
PIPELINE = "rendergraph: 1\nsize: [8, 8]\nnodes: {a: {type: fx}}\noutputs: {radiance: a.color}\n"
AXES: dict[str, Any] = {"a.gain": "0.1:0.9:0.2"}


def base(folder: Path) -> rg.Pipeline:
    (folder / "fx.frag").write_text(SHADER)
    (folder / "p.yaml").write_text(PIPELINE)
    return rg.load(folder / "p.yaml", plugins=[folder / "fx.frag"])


@settings(deadline=None)
@given(st.sets(st.integers(1, 400), min_size=1))
def test_numbers_are_written_and_read(numbers: set[int]) -> None:
    assert parse_numbers(numbers_text(numbers)) == tuple(sorted(numbers))


@pytest.mark.parametrize("text", ["", "0", "3-1", "1,,2", "a", "1-2-3", "-4"])
def test_what_are_no_numbers_is_told(text: str) -> None:
    with pytest.raises(ValueError, match="is not N or A-B"):
        parse_numbers(text)


@pytest.mark.parametrize("against", [None, "other"])
def test_parts_are_the_whole(gl: rg.Session, tmp_path: Path, against: str | None) -> None:
    """Done by three workers, one of them twice, and gathered: the same keys, figures and pictures."""
    drawn = base(tmp_path)
    reference = drawn.set("a.gain", 0.2) if against else None
    whole = sweep(drawn, AXES, tmp_path / "whole", reference, frames=1, session=gl)
    out = tmp_path / "out"
    for only in ([3, 4], [0, 2], [1], [0, 2]):
        measure(drawn, AXES, out, reference, SweepOptions(only=only, frames=1, session=gl))
    assert not (out / "results.jsonl").exists()
    gathered = sweep(drawn, AXES, out, reference, frames=1, session=gl, resume=True)
    assert (gathered.resumed, gathered.executed) == (5, 0)
    for one, other in zip(whole.comparison.results, gathered.comparison.results, strict=True):
        assert (one.name, one.metrics, one.radiance_rmse) == (other.name, other.metrics, other.radiance_rmse)
        np.testing.assert_array_equal(read(tmp_path / "whole" / one.name / "radiance.exr"), other.pixels)
    keys = [{r["name"]: r["key"] for r in read_results(tmp_path / folder)[0]} for folder in ("whole", "out")]
    assert keys[0] == keys[1]
    assert measure(drawn, AXES, out, reference, SweepOptions(only=[0, 2], frames=1, session=gl)) is None  # it is there


def test_frames_are_the_same_in_every_chunk(gl: rg.Session, tmp_path: Path) -> None:
    drawn = base(tmp_path)
    for frames in (range(1, 3), range(3, 5)):
        list(render_frames(drawn, AXES, tmp_path / "out", SweepOptions(only=[1]), frames, gl))
    expected = gl.frames(drawn.set("a.gain", 0.3), frames=range(1, 5))
    for number, frame in enumerate(expected, 1):
        found = read(tmp_path / "out" / "a.gain=0.3" / "frames" / f"radiance.{number:04d}.exr")
        np.testing.assert_array_equal(found[..., :3], frame["radiance"][..., :3].astype(found.dtype))


def test_a_template_has_groups_chunks_and_how_many_gpus(tmp_path: Path) -> None:
    model = pytest.importorskip("openjd.model")
    drawn = base(tmp_path)
    found = list_sweep(prepare(drawn, {"a.gain": "0.01:0.4:0.01"}, tmp_path))
    job = template(found, tmp_path / "study.yaml", tmp_path, frames=range(1, 49), chunk=24)
    groups = job["steps"][0]["parameterSpace"]["taskParameterDefinitions"][0]["range"]
    assert sorted(n for group in groups for n in parse_numbers(group)) == list(range(1, 41))
    assert len(groups) == 3
    extensions = ["TASK_CHUNKING", "FEATURE_BUNDLE_1"]
    parsed = model.decode_job_template(template=json.loads(json.dumps(job)), supported_extensions=extensions)
    values = {"GPUs": "2", "Chunk": "16", "Sweep": "study.yaml", "Files": ".", "Output": "out"}
    given = model.preprocess_job_parameters(
        job_template=parsed, job_parameter_values=values, job_template_dir=tmp_path, current_working_dir=tmp_path
    )
    made = model.create_job(job_template=parsed, job_parameter_values=given)
    measured, frames, report = made.steps
    assert {float(step.hostRequirements.amounts[0].min) for step in made.steps} == {2}
    tasks = list(model.StepParameterSpaceIterator(space=frames.parameterSpace))
    assert len(tasks) == 40 * 3
    assert {task["Frame"].value for task in tasks} == {"1-16", "17-32", "33-48"}
    assert [after.dependsOn for after in report.dependencies] == ["Measure", "Frames"]
    assert len(list(model.StepParameterSpaceIterator(space=measured.parameterSpace))) == 3


def test_a_sweep_elsewhere_is_named_when_the_job_is_run(tmp_path: Path) -> None:
    found = list_sweep(prepare(base(tmp_path), AXES, tmp_path))
    job = template(found, tmp_path / "study.yaml", tmp_path / "jobs", frames=None, chunk=24)
    told = {parameter["name"]: parameter.get("default") for parameter in job["parameterDefinitions"]}
    assert told == {"Sweep": None, "Files": None, "Output": "study-results", "GPUs": 1, "Rendergraph": "rendergraph"}
    assert [step["name"] for step in job["steps"]] == ["Measure", "Report"]


def test_too_many_groups_are_an_error(tmp_path: Path) -> None:
    found = list_sweep(prepare(base(tmp_path), {"a.gain": "0.01:0.4:0.01"}, tmp_path))
    with pytest.raises(InputError, match="RG524 the sweep has 3 groups of runs, more than the 2 of a template"):
        template(found, tmp_path / "study.yaml", tmp_path, frames=None, chunk=1, most_tasks=2)


@pytest.mark.nightly
def test_the_reference_tools_check_and_run_the_job(gl: rg.Session, tmp_path: Path) -> None:
    """Each task in a process of its own, as on a farm; what comes out is what one process draws."""
    programs = Path(sys.executable).parent
    if not (programs / "openjd").exists():
        pytest.skip("openjd-cli is not installed")
    (tmp_path / "study.yaml").write_text(
        "sweep: 1\npipeline: forward\nsize: [48, 27]\nframes: 1\nset: {sun.resolution: 64}\n"
        "axes: {shadows.taps: [1, 3]}\n"
    )

    def call(*words: str) -> str:
        done = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True, timeout=300)
        assert done.returncode == 0, done.stdout + done.stderr
        return done.stdout

    openjd = str(programs / "openjd")
    job = str(tmp_path / "job.yaml")
    assert main(["farm", "export", str(tmp_path / "study.yaml"), "--openjd", "--frames", "1-2", "-o", job]) == 0
    assert "passes validation checks" in call(openjd, "check", "job.yaml")
    parameters = ("-p", "GPUs=0", "-p", f"Rendergraph={programs / 'rendergraph'}")
    assert "Chunks run: 4" in call(openjd, "run", "job.yaml", "--step", "Report", "--run-dependencies", *parameters)
    out = tmp_path / "study-results"
    drawn = rg.load("forward", size=(48, 27)).set("sun.resolution", 64)
    whole = sweep(drawn, {"shadows.taps": [1, 3]}, tmp_path / "whole", frames=1, session=gl)
    rows = list(csv.DictReader((out / "results.csv").read_text().splitlines()))
    for result, row in zip(whole.comparison.results, rows, strict=True):
        assert (row["run"], float(row["flip"])) == (result.name, result.metrics.flip)
        for name in ("image.png", "frames/image.0001.png"):
            np.testing.assert_array_equal(
                read(out / result.name / name), read(tmp_path / "whole" / result.name / "image.png")
            )
        assert (out / result.name / "frames" / "image.0002.png").exists()
    assert (out / "report.html").exists()
    assert yaml.safe_load((tmp_path / "job.yaml").read_text())["specificationVersion"] == "jobtemplate-2023-09"
