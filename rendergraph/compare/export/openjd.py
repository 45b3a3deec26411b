"""A sweep as a job of a render farm: an Open Job Description template, specification 2023-09.

Its first step renders and measures the runs, in groups that share passes; an optional second one renders each run's
frames in chunks (RFC 1, `TASK_CHUNKING`); the last one collects the results and writes the report. The number of GPUs
that a worker needs is a parameter of the job, which requires `FEATURE_BUNDLE_1`.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import yaml

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
    runs = len(listing.prepared.runs)
    defaults: dict[str, Any] = {"Output": f"{sweep.stem}-results", "Chunk": chunk}
    if sweep.resolve().is_relative_to(folder.resolve()):
        where = sweep.resolve().relative_to(folder.resolve())
        defaults |= {"Sweep": where.as_posix(), "Files": where.parent.as_posix()}
    job: dict[str, Any] = yaml.safe_load(Path(__file__).with_suffix(".yaml").read_text(encoding="utf-8"))
    job["name"] = f"Sweep of {re.sub(r'[^ -~]|[{}]', '_', listing.prepared.study['pipeline'])[:100]}"
    job["description"] = f"{runs} runs, in groups that share passes; by rendergraph farm export."
    measure, render, report = job["steps"]
    measure["parameterSpace"]["taskParameterDefinitions"][0]["range"] = groups
    render["parameterSpace"]["taskParameterDefinitions"][0]["range"] = f"1-{runs}"
    if frames is not None:
        defaults["Frames"] = f"{frames[0]}-{frames[-1]}"
    else:
        del job["extensions"][1], job["parameterDefinitions"][-2:], job["steps"][1], report["dependencies"][1]
    for parameter in job["parameterDefinitions"]:
        parameter["default"] = defaults.get(parameter["name"], parameter["default"])
        if parameter["default"] is None:
            del parameter["default"]
    return job


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
