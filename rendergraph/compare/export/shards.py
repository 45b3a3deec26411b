"""Shards: parts of a sweep that workers of a farm render into its runs' folders; `sweep --resume` completes it."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from rendergraph.compare.engine import Sweep, sweep
from rendergraph.compare.export.openjd import numbers_text
from rendergraph.compare.prepare import SweepOptions, prepare
from rendergraph.compare.runner import is_complete
from rendergraph.compare.store import RUN, make_folder
from rendergraph.errors import Place, Problem, RenderError

if TYPE_CHECKING:
    from rendergraph.compare.space import Axes
    from rendergraph.session import Pipeline
    from rendergraph.session.gpu import Gpu

_PRIVATE = ".parts"


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
        text = f"the run cannot be moved: {error.strerror or error}"
        raise RenderError(Problem("RG507", text, Place(str(to)))) from error


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
