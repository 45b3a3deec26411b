"""Frames of a pipeline, drawn in parts by several workers, and what comes of each."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy.typing as npt
from msgspec import structs

from rendergraph.errors import InputError, Place, Problem
from rendergraph.farm.bundle import relocate_selection
from rendergraph.farm.tasks import Executor, Task, TaskFailed, TaskOutput, Worker
from rendergraph.images.saving import Saved, encoded, viewable_as
from rendergraph.session import stages
from rendergraph.session.pipeline import Pipeline

if TYPE_CHECKING:
    from rendergraph.errors import RendergraphError
    from rendergraph.session.frame import Frame
    from rendergraph.session.selection import RenderOptions, Selection
    from rendergraph.session.values import Expanded

PARTS = 4
"""For each worker: enough that none waits long for the last, few enough that programs are compiled seldom."""
MOST = 64
"""Frames of a part: what is lost with a worker."""


@dataclass(frozen=True)
class Wanted:
    """A file of each frame.

    Attributes:
        name: the output, or the tap.
        ending: of the file, which chooses its format; empty for bare pixels, as a film takes them.
        raw: a tap.
    """

    name: str
    ending: str
    raw: bool


@dataclass(frozen=True, eq=False)
class Shown:
    """A frame has been drawn: its files, or pixels 0…255 of shape (height, width, 3 or 4)."""

    number: int
    files: tuple[bytes | npt.NDArray[Any], ...]
    unsound: tuple[tuple[str, Problem], ...]


@dataclass(frozen=True, eq=False)
class Chunk(Task):
    """Frames that follow each other.

    Attributes:
        selection, options: what is drawn; its frames are the part's.
        lead: frames that are drawn before the first, where those before matter.
        wanted: what is made of each.
    """

    selection: Selection
    options: RenderOptions
    lead: int
    wanted: tuple[Wanted, ...]

    @property
    def name(self) -> str:  # type: ignore[override]  # a value, said once
        """Which frames."""
        frames = self.options.frames
        return f"frames {frames[0]}-{frames[-1]}"

    def run(self, worker: Worker) -> Iterator[Shown | Frame]:
        """Each frame; and at last the last one without its pictures, for its times."""
        pipeline = Pipeline(relocate_selection(self.selection, worker.root))
        expanded = stages.expand(pipeline.link(), self.options)
        frame: Frame | None = None
        for frame in stages.draw(expanded, worker.gpu, lead=self.lead):
            files = tuple(_made(frame, each) for each in self.wanted)
            yield Shown(frame.number, files, tuple(frame.unsound.items()))
        assert frame is not None  # a part has one at least
        figures = {name: array for name, array in frame.arrays.items() if array.shape[:-1] == (1, 1)}
        yield replace(frame, arrays=figures)


def _made(frame: Frame, wanted: Wanted) -> bytes | npt.NDArray[Any]:
    pixels, info = frame[wanted.name], frame.info(wanted.name)
    if not wanted.ending:
        return viewable_as(pixels, info)
    return encoded(Saved(Path(f"frame{wanted.ending}"), pixels, info, raw=wanted.raw), frame.metadata)


def chunks(expanded: Expanded, wanted: Sequence[Wanted], workers: int, warm_up: int | None) -> list[Chunk]:
    """The frames in parts.

    Args:
        expanded: what is drawn.
        wanted: what is made of each frame.
        workers: who draws.
        warm_up: how many frames decide the next one, where the file says so.

    Raises:
        InputError: each frame depends on all before it, and the file does not say that fewer decide it.
    """
    resources = stages.plan(expanded).plan.resources.values()
    remembers = sorted({resource.id.partition(".")[0] for resource in resources if resource.role == "history"})
    if remembers and warm_up is None:
        text = f"a frame depends on those before it, by '{remembers[0]}': it cannot be drawn in parts; say how many "
        text += "decide it, as in warm_up: 16, or draw with --executor serial"
        raise InputError(Problem("RG643", text, Place(expanded.linked.graph.name)))
    lead = warm_up if remembers and warm_up is not None else 1  # without a history one shows where things were
    frames = expanded.options.frames
    each = max(1, min(MOST, -(-len(frames) // (PARTS * workers))), 2 * lead if remembers else 1)
    parts = [frames[at : at + each] for at in range(0, len(frames), each)]
    options = [structs.replace(expanded.options, frames=part) for part in parts]
    return [Chunk(expanded.linked.selection, own, lead, tuple(wanted)) for own in options]


def drawn(farm: Executor, parts: Sequence[Chunk]) -> Iterator[Shown | Frame]:
    """What comes of the parts: each frame once, in any order; a last word of each part.

    Raises:
        RendergraphError: a part cannot be drawn, wherever that was tried.
    """
    seen: set[int] = set()
    for part in parts:
        farm.submit(part)
    for event in farm.events():
        if isinstance(event, TaskFailed):
            error: RendergraphError = event.error
            raise type(error)(error.problems) from error
        if isinstance(event, TaskOutput):
            if isinstance(event.value, Shown):
                if event.value.number in seen:  # by a worker that was lost afterwards
                    continue
                seen.add(event.value.number)
            yield event.value
