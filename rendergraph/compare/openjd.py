"""A sweep as a job of a render farm: an Open Job Description template, specification 2023-09.

Its first step draws and measures the runs, those together that share passes; a second one, where frames are asked for,
draws each run's frames by chunks (RFC 1, `TASK_CHUNKING`); the last one gathers all and writes the report. How many
GPUs a worker needs is a parameter of the job, which takes `FEATURE_BUNDLE_1`.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from rendergraph.compare.listing import Listing
from rendergraph.errors import InputError, Problem

MOST_TASKS = 1024
"""Values of a list that a template may have."""
_ONE = re.compile(r"([0-9]{1,6})(?:-([0-9]{1,6}))?\Z")


def template(listing: Listing, sweep: Path, folder: Path, *, frames: range | None, chunk: int) -> dict[str, Any]:
    """The job's template.

    Args:
        listing: the sweep, with the groups in which its runs are drawn.
        sweep: its file.
        folder: where the template will stand; what lies in it or beneath is named by the template.
        frames: which frames of each run are drawn beside; None for none.
        chunk: how many a task.

    Raises:
        InputError: there are more groups than a template may have tasks.
    """
    groups = [numbers_text(number + 1 for number in group.numbers) for group in listing.groups]
    if len(groups) > MOST_TASKS:
        text = f"the sweep has {len(groups)} groups of runs, and a template {MOST_TASKS} at most; export it in parts"
        raise InputError(Problem("RG524", text))
    steps = [_step("Measure", [{"name": "Runs", "type": "STRING", "range": groups}], _MEASURE)]
    if frames is not None:
        steps.append(_step("Frames", _chunks(len(listing.prepared.runs)), _FRAMES))
    after = [{"dependsOn": step["name"]} for step in steps]
    report = {"name": "Report", "dependencies": after, **_NEEDS, "script": _script(_REPORT)}
    name = listing.prepared.study["pipeline"]
    runs = len(listing.prepared.runs)
    return {
        "specificationVersion": "jobtemplate-2023-09",
        "extensions": ["FEATURE_BUNDLE_1", *(["TASK_CHUNKING"] if frames is not None else [])],
        "name": f"Sweep of {re.sub(r'[^ -~]|[{}]', '_', name)[:100]}",
        "description": f"{runs} runs, those that share passes together; by rendergraph farm export.",
        "parameterDefinitions": _parameters(sweep, folder, frames, chunk),
        "steps": [*steps, report],
    }


def _parameters(sweep: Path, folder: Path, frames: range | None, chunk: int) -> list[dict[str, Any]]:
    beneath = sweep.resolve().is_relative_to(folder.resolve())
    where = sweep.resolve().relative_to(folder.resolve()) if beneath else None
    found: list[dict[str, Any]] = [
        {
            "name": "Sweep",
            "type": "PATH",
            "objectType": "FILE",
            "dataFlow": "IN",
            "description": "The sweep's file.",
            **({"default": where.as_posix()} if where else {}),
        },
        {
            "name": "Files",
            "type": "PATH",
            "objectType": "DIRECTORY",
            "dataFlow": "IN",
            "description": "What it is drawn from: pipelines, scenes, nodes. A farm that sends files sends these.",
            **({"default": where.parent.as_posix()} if where else {}),
        },
        {
            "name": "Output",
            "type": "PATH",
            "objectType": "DIRECTORY",
            "dataFlow": "OUT",
            "description": "The folder of the results, which all workers see.",
            "default": f"{sweep.stem}-results",
        },
        {
            "name": "GPUs",
            "type": "INT",
            "minValue": 0,
            "default": 1,
            "description": "How many a worker must have; 0 for a rasteriser on the CPU.",
        },
        {
            "name": "Rendergraph",
            "type": "STRING",
            "default": "rendergraph",
            "description": "The program, as workers call it.",
        },
    ]
    if frames is not None:
        about = "Which frames of each run are drawn."
        found.append({"name": "Frames", "type": "STRING", "default": _range(frames), "description": about})
        about = "How many a task."
        found.append({"name": "Chunk", "type": "INT", "minValue": 1, "default": chunk, "description": about})
    return found


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


def _chunks(runs: int) -> list[dict[str, Any]]:
    """Each run by itself, its frames by chunks."""
    chunks = {"defaultTaskCount": "{{Param.Chunk}}", "rangeConstraint": "CONTIGUOUS"}
    return [
        {"name": "Run", "type": "INT", "range": f"1-{runs}"},
        {"name": "Frame", "type": "CHUNK[INT]", "range": "{{Param.Frames}}", "chunks": chunks},
    ]


def _range(frames: range) -> str:
    return f"{frames[0]}-{frames[-1]}"


def numbers_text(numbers: Iterable[int]) -> str:
    """Whole numbers in order, neighbours as ranges: `1-16,20`."""
    found: list[list[int]] = []
    for number in sorted(numbers):
        if found and number == found[-1][1] + 1:
            found[-1][1] = number
        else:
            found.append([number, number])
    return ",".join(str(first) if first == last else f"{first}-{last}" for first, last in found)


def parse_numbers(text: str) -> tuple[int, ...]:
    """What `numbers_text` wrote.

    Raises:
        ValueError: it is written in another way, in words.
    """
    found: list[int] = []
    for part in text.split(","):
        match = _ONE.match(part.strip())
        first, last = (int(match[1]), int(match[2] or match[1])) if match else (0, 0)
        if not 1 <= first <= last:
            raise ValueError(f"'{text}' is not N or A-B, several with commas between, as in 1-16,20")
        found += range(first, last + 1)
    return tuple(dict.fromkeys(found))
