"""Parts of a sweep that workers of a farm do, each into its runs' folders; `sweep --resume` makes the whole of them."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rendergraph.compare.listing import is_done
from rendergraph.compare.openjd import numbers_text
from rendergraph.compare.prepare import prepare
from rendergraph.compare.product import Sweep, sweep
from rendergraph.compare.runs import RUN
from rendergraph.errors import Place, Problem, RenderError

if TYPE_CHECKING:
    from rendergraph.compare.axes import Axes
    from rendergraph.session import Pipeline
    from rendergraph.session.gpu import Gpu

_PRIVATE = ".parts"


def measure(
    base: Pipeline,
    axes: Axes,
    out: Path,
    reference: Path | Pipeline | None,
    only: Sequence[int],
    *,
    metric: str | None = None,
    frames: int = 5,
    repeats: int = 1,
    session: Gpu | None = None,
    device: int | None = None,
) -> Sweep | None:
    """Draw and measure some runs of a sweep; others may do so with others at the same time, in the same folder.

    What is drawn stays in a folder of its own until it is whole, so that it can be begun again after anything. None of
    it goes into `results.jsonl`: that has one writer.

    Args:
        base, axes, out, reference, metric, frames, repeats, session, device: as for `sweep`.
        only: numbers of the runs, from 0.

    Returns:
        What was found; None where all of it was there already.

    Raises:
        InputError, RenderError, DeviceError: as from `sweep`.
    """
    prepared = prepare(base, axes, out, reference, metric=metric, only=only)
    waiting = [
        number
        for number, run in zip(only, prepared.runs, strict=True)
        if not is_done(run, {}, frames=frames, repeats=repeats)
    ]
    if not waiting:
        return None
    private = out / _PRIVATE / numbers_text(waiting)
    options: dict[str, Any] = {"metric": metric, "frames": frames, "repeats": repeats, "only": waiting}
    found = sweep(base, axes, private, reference, **options, resume=True, session=session, device=device)
    for result in found.comparison.results:
        _move(private / result.name, out / result.name)
    shutil.rmtree(private, ignore_errors=True)
    return found


def _move(run: Path, to: Path) -> None:
    """A run's files to where all of them are; `run.json`, which speaks of the others, last."""
    try:
        to.mkdir(parents=True, exist_ok=True)
        for file in sorted(run.iterdir(), key=lambda file: file.name == RUN):
            os.replace(file, to / file.name)
    except OSError as error:
        text = f"the run cannot be moved: {error.strerror or error}"
        raise RenderError(Problem("RG507", text, Place(str(to)))) from error


def draw_frames(
    base: Pipeline, axes: Axes, out: Path, only: Sequence[int], frames: range, gpu: Gpu, *, metric: str | None = None
) -> Iterator[Path]:
    """Draw frames of some runs into their folders, `frames/image.0001.png`, and give each file's path.

    A frame is the same in whatever chunk it is drawn: where a pipeline remembers, those before are drawn first.

    Raises:
        InputError, RenderError: as from drawing.
    """
    from rendergraph.images import Saved, numbered, save_outputs  # whoever exports a job needs no OpenImageIO
    from rendergraph.session import RenderOptions, stages  # nor this

    for run in prepare(base, axes, out, None, metric=metric, only=only).runs:
        linked = run.planned.linked
        options = RenderOptions(frames, linked.fps, outputs=(run.output,))
        folder = run.folder / "frames"
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            text = f"the folder cannot be made: {error.strerror or error}"
            raise RenderError(Problem("RG507", text, Place(str(folder)))) from error
        pattern = folder / f"{run.output}.####{run.picture.suffix}"
        for frame in stages.draw(stages.expand(linked, options), gpu):
            path = numbered(pattern, frame.number)
            save_outputs([Saved(path, frame[run.output], frame.info(run.output), raw=False)], frame.metadata)
            yield path
