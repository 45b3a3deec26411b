"""Frames of a pipeline, rendered in chunks by several workers."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy.typing as npt
from msgspec import Struct, structs

from rendergraph.errors import InputError, Place, Problem
from rendergraph.farm.bundle import relocate_selection
from rendergraph.farm.tasks import Executor, Task, TaskFailed, TaskOutput, Worker
from rendergraph.images.saving import Saved, encoded, viewable_as
from rendergraph.session import stages
from rendergraph.session.pipeline import Pipeline

if TYPE_CHECKING:
    from rendergraph.session.frame import Frame
    from rendergraph.session.selection import RenderOptions, Selection
    from rendergraph.session.values import Expanded

CHUNKS_PER_WORKER = 4
"""Enough that no worker waits long for the last, few enough that programs are rarely compiled."""
LONGEST_CHUNK = 64
"""Frames of a chunk: the work that is lost with a worker."""


class FrameFile(Struct, frozen=True):
    """A file of each frame, of an output or a tap; without a suffix bare pixels, as a video needs them."""

    name: str
    suffix: str
    raw: bool


class RenderedFrame(Struct, frozen=True, eq=False):
    """A frame's files: encoded, or as pixels 0…255 of shape (height, width, 3 or 4)."""

    number: int
    files: tuple[bytes | npt.NDArray[Any], ...]


@dataclass(frozen=True, eq=False)
class FrameChunk(Task):
    """Consecutive frames; `lead` more are rendered before them, if frames depend on earlier ones."""

    selection: Selection
    options: RenderOptions
    lead: int
    files: tuple[FrameFile, ...]

    @property
    def name(self) -> str:  # type: ignore[override]  # read-only here
        frames = self.options.frames
        return f"frames {frames[0]}-{frames[-1]}"

    def run(self, worker: Worker) -> Iterator[RenderedFrame | Frame]:
        """Yield each frame, and then the last one without its pictures, for its times."""
        pipeline = Pipeline(relocate_selection(self.selection, worker.root))
        expanded = stages.expand(pipeline.link(), self.options)
        frame = suspect = None
        for frame in stages.draw(expanded, worker.gpu, lead=self.lead):
            suspect = suspect or (frame if frame.unsound else None)
            yield RenderedFrame(frame.number, tuple(_encode(frame, file) for file in self.files))
        assert frame is not None  # a chunk has one at least
        warnings = stages.not_finite_warnings(suspect, expanded, worker.gpu) if suspect else ()
        figures = {name: array for name, array in frame.arrays.items() if array.shape[:-1] == (1, 1)}
        yield replace(frame, arrays=figures, warnings=(*frame.warnings, *warnings))


def _encode(frame: Frame, file: FrameFile) -> bytes | npt.NDArray[Any]:
    pixels, info = frame.arrays[file.name], frame.info(file.name)
    if not file.suffix:
        return viewable_as(pixels, info)
    return encoded(Saved(Path(f"frame{file.suffix}"), pixels, info, raw=file.raw), frame.metadata)


def split_frames(expanded: Expanded, files: Sequence[FrameFile], workers: int, warm_up: int | None) -> list[FrameChunk]:
    """Divide the frames into chunks; `warm_up` is how many earlier frames decide a frame, where the file states it."""
    resources = stages.plan(expanded).plan.resources.values()
    histories = sorted({resource.id.partition(".")[0] for resource in resources if resource.role == "history"})
    if histories and warm_up is None:
        text = f"each frame depends on earlier ones through '{histories[0]}', so frames cannot be split among workers; "
        text += "state how many earlier frames matter (warm_up: 16), or use --executor serial"
        raise InputError(Problem("RG643", text, Place(expanded.linked.graph.name)))
    lead = warm_up if histories and warm_up is not None else 1  # even without a history, motion needs one
    options, selection = expanded.options, expanded.linked.selection
    frames = options.frames
    each = max(1, min(LONGEST_CHUNK, -(-len(frames) // (CHUNKS_PER_WORKER * workers))), 2 * lead if histories else 1)
    parts = (frames[at : at + each] for at in range(0, len(frames), each))
    return [FrameChunk(selection, structs.replace(options, frames=part), lead, tuple(files)) for part in parts]


def render_chunks(executor: Executor, chunks: Sequence[FrameChunk]) -> Iterator[RenderedFrame | Frame]:
    """Yield each frame once, in any order, and the last frame of each chunk once more without pictures."""
    seen: set[int] = set()
    for chunk in chunks:
        executor.submit(chunk)
    for event in executor.events():
        if isinstance(event, TaskFailed):
            raise type(event.error)(event.error.problems) from event.error
        if isinstance(event, TaskOutput):
            if isinstance(event.value, RenderedFrame):
                if event.value.number in seen:  # from a worker that was lost afterwards
                    continue
                seen.add(event.value.number)
            yield event.value
