"""A sweep as a job of a render farm: an Open Job Description template, specification 2023-09.

Its first step renders and measures the runs, in groups that share passes; an optional second one renders each run's
frames in chunks (RFC 1, `TASK_CHUNKING`); the last one collects the results and writes the report. The number of GPUs
that a worker needs is a parameter of the job, which requires `FEATURE_BUNDLE_1`.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from rendergraph.compare.runner import Listing
from rendergraph.errors import InputError, Problem

MOST_TASKS = 1024
"""Maximum number of values of a list in a template."""
_RANGE = re.compile(r"([0-9]{1,6})(?:-([0-9]{1,6}))?\Z")


def template(
    listing: Listing, sweep: Path, folder: Path, *, frames: range | None, chunk: int, most_tasks: int = MOST_TASKS
) -> dict[str, Any]:
    """Return the job's template; its defaults are paths relative to `folder`, in which it will be written.

    With `frames`, these frames of each run are rendered in addition, `chunk` frames per task.
    """
    groups = [numbers_text(number + 1 for number in group.numbers) for group in listing.groups]
    if len(groups) > most_tasks:
        text = f"the sweep has {len(groups)} groups of runs, more than the {most_tasks} of a template; split the sweep"
        raise InputError(Problem("RG524", text))
    parameters = _parameters(sweep, folder)
    steps = [_step("Measure", [{"name": "Runs", "type": "STRING", "range": groups}], _MEASURE)]
    if frames is not None:
        chunks = {"defaultTaskCount": "{{Param.Chunk}}", "rangeConstraint": "CONTIGUOUS"}
        run = {"name": "Run", "type": "INT", "range": f"1-{len(listing.prepared.runs)}"}
        frame = {"name": "Frame", "type": "CHUNK[INT]", "range": "{{Param.Frames}}", "chunks": chunks}
        steps.append(_step("Frames", [run, frame], _FRAMES))
        first_last = f"{frames[0]}-{frames[-1]}"
        parameters.append(_parameter("Frames", "STRING", "The frames to render of each run.", default=first_last))
        parameters.append(_parameter("Chunk", "INT", "Frames per task.", minValue=1, default=chunk))
    after = [{"dependsOn": step["name"]} for step in steps]
    report = {"name": "Report", "dependencies": after, **_NEEDS, "script": _script(_REPORT)}
    name = listing.prepared.study["pipeline"]
    runs = len(listing.prepared.runs)
    return {
        "specificationVersion": "jobtemplate-2023-09",
        "extensions": ["FEATURE_BUNDLE_1", *(["TASK_CHUNKING"] if frames is not None else [])],
        "name": f"Sweep of {re.sub(r'[^ -~]|[{}]', '_', name)[:100]}",
        "description": f"{runs} runs, in groups that share passes; by rendergraph farm export.",
        "parameterDefinitions": parameters,
        "steps": [*steps, report],
    }


def _parameters(sweep: Path, folder: Path) -> list[dict[str, Any]]:
    beneath = sweep.resolve().is_relative_to(folder.resolve())
    where = sweep.resolve().relative_to(folder.resolve()) if beneath else None
    file, files = ({"default": where.as_posix()}, {"default": where.parent.as_posix()}) if where else ({}, {})
    results = f"{sweep.stem}-results"
    inputs = "The files of its pipelines, scenes and nodes. A farm that transfers files transfers these."
    return [
        _parameter("Sweep", "PATH", "The file of the sweep.", objectType="FILE", dataFlow="IN", **file),
        _parameter("Files", "PATH", inputs, objectType="DIRECTORY", dataFlow="IN", **files),
        _parameter(
            "Output",
            "PATH",
            "The folder of the results, shared by all workers.",
            objectType="DIRECTORY",
            dataFlow="OUT",
            default=results,
        ),
        _parameter("GPUs", "INT", "GPUs that a worker needs; 0 for a rasteriser on the CPU.", minValue=0, default=1),
        _parameter("Rendergraph", "STRING", "The program, as workers call it.", default="rendergraph"),
    ]


def _parameter(name: str, type_: str, description: str, **more: Any) -> dict[str, Any]:
    return {"name": name, "type": type_, **more, "description": description}


_SWEEP, _OUT = "{{Param.Sweep}}", "{{Param.Output}}"
_MEASURE = ("farm", "measure", _SWEEP, "--runs", "{{Task.Param.Runs}}", "-o", _OUT)
_FRAMES = ("farm", "frames", _SWEEP, "--runs", "{{Task.Param.Run}}", "--frames", "{{Task.Param.Frame}}", "-o", _OUT)
_REPORT = ("sweep", _SWEEP, "-o", _OUT, "--resume", "--csv")
_NEEDS = {"hostRequirements": {"amounts": [{"name": "amount.worker.gpu", "min": "{{Param.GPUs}}"}]}}


def _step(name: str, parameters: Sequence[dict[str, Any]], words: Sequence[str]) -> dict[str, Any]:
    space = {"taskParameterDefinitions": list(parameters)}
    return {"name": name, **_NEEDS, "parameterSpace": space, "script": _script(words)}


def _script(words: Sequence[str]) -> dict[str, Any]:
    return {"actions": {"onRun": {"command": "{{Param.Rendergraph}}", "args": list(words)}}}


def numbers_text(numbers: Iterable[int]) -> str:
    """Return whole numbers in order, neighbours as ranges: `1-16,20`."""
    ranges: list[list[int]] = []
    for number in sorted(numbers):
        if ranges and number == ranges[-1][1] + 1:
            ranges[-1][1] = number
        else:
            ranges.append([number, number])
    return ",".join(str(first) if first == last else f"{first}-{last}" for first, last in ranges)


def parse_numbers(text: str) -> tuple[int, ...]:
    """Parse the text of `numbers_text`; a ValueError says what is wrong."""
    numbers: list[int] = []
    for part in text.split(","):
        match = _RANGE.match(part.strip())
        first, last = (int(match[1]), int(match[2] or match[1])) if match else (0, 0)
        if not 1 <= first <= last:
            raise ValueError(f"'{text}' is not N or A-B, several with commas between, as in 1-16,20")
        numbers += range(first, last + 1)
    return tuple(dict.fromkeys(numbers))
