"""A sweep as a job of a render farm: an Open Job Description template, specification 2023-09.

Its first step renders and measures the runs, in groups that share passes; an optional second one renders each run's
frames in chunks (RFC 1, `TASK_CHUNKING`); the last one collects the results and writes the report. The number of GPUs
that a worker needs is a parameter of the job, which requires `FEATURE_BUNDLE_1`.

`measure` and `render_frames` are what the tasks of the first two steps do; `sweep --resume` completes the sweep.
"""

from __future__ import annotations

import os
import re
import shutil
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import yaml

from rendergraph.compare.engine import Sweep, sweep
from rendergraph.compare.prepare import SweepOptions, prepare
from rendergraph.compare.runner import Listing, is_complete
from rendergraph.compare.store import RUN, make_folder, write_error
from rendergraph.errors import InputError, Problem

if TYPE_CHECKING:
    from rendergraph.compare.space import Axes
    from rendergraph.session import Pipeline
    from rendergraph.session.gpu import Gpu

MOST_TASKS = 1024
"""Maximum number of values of a list in a template."""
_PRIVATE = ".parts"
"""Folder in the sweep's folder for runs that are not complete."""
_RANGE = re.compile(r"([0-9]{1,6})(?:-([0-9]{1,6}))?\Z")


def template(
    listing: Listing, file: Path, folder: Path, *, frames: range | None, chunk: int, most_tasks: int = MOST_TASKS
) -> dict[str, Any]:
    """Return the job's template; its defaults are paths relative to `folder`, in which it will be written.

    With `frames`, these frames of each run are rendered in addition, `chunk` frames per task.
    """
    groups = [numbers_text(number + 1 for number in group.numbers) for group in listing.groups]
    if len(groups) > most_tasks:
        text = f"the sweep has {len(groups)} groups of runs, more than the {most_tasks} of a template; split the sweep"
        raise InputError(Problem("RG524", text))
    runs = len(listing.prepared.runs)
    defaults: dict[str, Any] = {"Output": f"{file.stem}-results", "Chunk": chunk}
    if file.resolve().is_relative_to(folder.resolve()):
        where = file.resolve().relative_to(folder.resolve())
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


# --- what the tasks do ------------------------------------------------------------------------------------------------


def measure(
    base: Pipeline, axes: Axes, out: Path, reference: Path | Pipeline | None, options: SweepOptions
) -> Sweep | None:
    """Render and measure `only` some runs of a sweep, while other workers may do others in the same folder.

    They stay in a private folder until they are complete, so that they can be started again at any time. Nothing is
    added to `results.jsonl`, which has a single writer. The arguments are those of `sweep`.
    Returns None if all runs were complete already.
    """
    runs = prepare(base, axes, out, reference, options).runs
    waiting = [
        number for number, run in zip(options.only or (), runs, strict=True) if not is_complete(run, {}, options)
    ]
    if not waiting:
        return None
    private = out / _PRIVATE / numbers_text(waiting)
    found = sweep(base, axes, private, reference, options, only=waiting, resume=True)
    for result in found.comparison.results:
        _move(private / result.name, out / result.name)
    shutil.rmtree(private, ignore_errors=True)
    return found


def _move(run: Path, to: Path) -> None:
    """Move a run's files; `run.json`, which describes the others, comes last."""
    try:
        to.mkdir(parents=True, exist_ok=True)
        for file in sorted(run.iterdir(), key=lambda file: file.name == RUN):
            os.replace(file, to / file.name)
    except OSError as error:
        raise write_error(to, "the run cannot be moved", error) from error


def render_frames(
    base: Pipeline, axes: Axes, out: Path, options: SweepOptions, frames: range, gpu: Gpu
) -> Iterator[Path]:
    """Render frames of some runs into their folders, `frames/image.0001.png`, and yield each file's path.

    A frame does not depend on its chunk: where a pipeline has a history, the frames before are rendered first.
    """
    from rendergraph.images import Saved, numbered, save_outputs  # exporting a job needs no OpenImageIO
    from rendergraph.session import RenderOptions, stages  # nor this

    for run in prepare(base, axes, out, None, options).runs:
        linked = run.planned.linked
        render_options = RenderOptions(frames, linked.fps, outputs=(run.output,))
        folder = run.folder / "frames"
        make_folder(folder)
        pattern = folder / f"{run.output}.####{run.picture.suffix}"
        for frame in stages.draw(stages.expand(linked, render_options), gpu):
            path = numbered(pattern, frame.number)
            save_outputs([Saved(path, frame.arrays[run.output], frame.info(run.output), raw=False)], frame.metadata)
            yield path
