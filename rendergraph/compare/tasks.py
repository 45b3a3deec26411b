"""Tasks that any worker can do: render variants, compare them with the reference, and measure them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, TypeAlias

from rendergraph.compare.batches import Batch, fitting_batches, measure_batch, node_types, render_batch
from rendergraph.compare.divergence import every_output, first_difference
from rendergraph.compare.fingerprint import worker_digest
from rendergraph.compare.prepare import Run
from rendergraph.compare.results import (
    Pixels,
    Reference,
    light_error,
    machine,
    measure_against,
    not_finite_pixels,
)
from rendergraph.compare.timing import Times, times_of
from rendergraph.diff import diff
from rendergraph.errors import InputError, Problem, RenderError
from rendergraph.farm import Handle, Task, Worker
from rendergraph.farm.bundle import map_remote_paths, relocate_selection
from rendergraph.farm.tasks import is_retryable
from rendergraph.metrics import Encoding
from rendergraph.session import stages
from rendergraph.session.frame import figures_of
from rendergraph.session.pipeline import Pipeline

if TYPE_CHECKING:
    from rendergraph.catalog import Catalog
    from rendergraph.execute import FrameTimes
    from rendergraph.link import Graph
    from rendergraph.session.gpu import Gpu
    from rendergraph.session.selection import Selection
    from rendergraph.session.values import Planned

FRAMES_PER_TURN = 2
"""Few, so that other work of the machine affects all variants alike."""


@dataclass(frozen=True, eq=False)
class RunSpec:
    """A run as a worker needs it.

    Attributes:
        digest: of what the picture depends on, as it was when the work began.
        extension: of the picture's file.
        metadata: of the picture.
        is_rendered: its picture exists already; only times are needed.
        planned: the pipeline, where the worker is the process that planned it.
    """

    number: int
    name: str
    selection: Selection
    digest: str
    output: str
    extension: str
    metadata: Mapping[str, str]
    is_rendered: bool
    planned: Planned | None = field(default=None, repr=False)

    @classmethod
    def of(cls, run: Run, number: int, *, is_rendered: bool = False) -> RunSpec:
        return cls(
            number=number,
            name=run.name,
            selection=run.planned.linked.selection,
            digest=worker_digest(run.planned),
            output=run.output,
            extension=run.picture.suffix,
            metadata=run.metadata,
            is_rendered=is_rendered,
            planned=run.planned,
        )

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "planned": None}

    def plan(self, worker: Worker, catalog: Catalog | None = None) -> Planned:
        """Return the planned pipeline; the catalog of another run saves the time to make one.

        Raises:
            InputError: it is not what it was when the work began.
        """
        if self.planned is not None:
            return self.planned
        pipeline = Pipeline(relocate_selection(self.selection, worker.root), catalog)
        planned = stages.plan(stages.expand(pipeline.link()))
        if worker_digest(planned) != self.digest:
            text = f"input files of '{self.name}' differ on worker '{worker.name}' from those when the work began"
            raise InputError(Problem("RG642", f"{text}: a file has changed, or another version is installed there"))
        return planned


@dataclass(frozen=True, eq=False)
class ReferenceResult:
    """The reference has been rendered."""

    reference: Reference
    device: Mapping[str, object]


@dataclass(frozen=True, eq=False)
class RenderedResult:
    """A run has been rendered and compared: fields of its `Result`, and the picture's file."""

    number: int
    measured: Mapping[str, Any]
    picture: bytes
    device: Mapping[str, object]
    machine: Mapping[str, str]
    warnings: tuple[Problem, ...] = ()


@dataclass(frozen=True, eq=False)
class TimingResult:
    """A run has been measured."""

    number: int
    times: Times
    device: Mapping[str, object]
    machine: Mapping[str, str]


@dataclass(frozen=True, eq=False)
class TaskError:
    """A run cannot be rendered or compared, on any worker."""

    number: int
    error: InputError | RenderError


@dataclass(frozen=True)
class PassCount:
    """This many passes have been executed for a batch."""

    count: int


TaskEvent: TypeAlias = "ReferenceResult | RenderedResult | TimingResult | TaskError | PassCount"


@dataclass(frozen=True, eq=False, kw_only=True)
class VariantTask(Task):
    """Runs that are rendered together; passes that they share are executed once.

    They have the same scene, camera and size. Unless they need a reference, they are measured against the first one.
    """

    name: str
    needs: tuple[Handle, ...]
    runs: tuple[RunSpec, ...]
    encoding: Encoding
    frame: int
    frames: int
    repeats: int
    most_bytes: int

    def reference(self, worker: Worker) -> Reference | None:
        reference: Reference | None = worker.value(self.needs[0]) if self.needs else None
        return reference

    def run(self, worker: Worker) -> Iterator[TaskEvent]:
        """Yield each run's picture, then its times, batch after batch; a faulty run ends only itself."""
        runs: list[tuple[RunSpec, Planned]] = []
        for run in self.runs:
            try:
                runs.append((run, run.plan(worker, runs[-1][1].linked.catalog if runs else None)))
            except InputError as error:
                if not self.needs:
                    raise
                yield TaskError(run.number, _mapped(error, worker))
        planned = [each for _, each in runs]
        reference = self.reference(worker)
        waiting = fitting_batches(planned, range(len(runs)), self.most_bytes) if runs else []
        done: set[int] = set()
        while waiting:
            batch = waiting.pop(0)
            first = batch.numbers[0]
            try:
                for event in self._batch(worker, batch, runs, reference):
                    if isinstance(event, ReferenceResult):
                        reference = event.reference
                    if isinstance(event, TimingResult):
                        done.add(event.number)
                    yield event
            except (InputError, RenderError) as error:
                left = [place for place in batch.numbers if runs[place][0].number not in done]
                if len(batch.numbers) > 1:  # each alone, so that only the faulty one fails, with its own message
                    waiting[:0] = [one for place in left for one in fitting_batches(planned, [place], self.most_bytes)]
                elif reference is None or is_retryable(error):
                    raise
                else:
                    yield TaskError(runs[first][0].number, _mapped(error, worker))

    def _batch(
        self, worker: Worker, batch: Batch, runs: Sequence[tuple[RunSpec, Planned]], reference: Reference | None
    ) -> Iterator[TaskEvent]:
        planned = [each for _, each in runs]
        unrendered = [place for place in batch.numbers if not runs[place][0].is_rendered]
        if unrendered:
            for rendered in list(render_batch(worker.gpu, planned, batch, self.frame)):
                if rendered.number not in unrendered:
                    continue
                run, own = runs[rendered.number]
                if reference is None:
                    reference = _reference(run, rendered.arrays, self.encoding)
                    yield ReferenceResult(reference, rendered.device)
                yield _rendered(run, own, rendered.arrays, reference, rendered.device, worker, encode=True)
        device = worker.gpu.device.as_json()
        warm = bool(unrendered)
        for place, times in measure_batch(worker.gpu, planned, batch, self.frames, self.repeats, warm=warm):
            yield TimingResult(runs[place][0].number, times, device, _machine(worker))
        yield PassCount(batch.pass_count)


@dataclass(frozen=True, eq=False, kw_only=True)
class ComparisonTask(VariantTask):
    """Runs of any structure, each rendered by itself; they take turns in measuring, and are compared with a base."""

    base: RunSpec

    def run(self, worker: Worker) -> Iterator[TaskEvent]:
        """Yield the pictures of all runs with their first differences, then their times."""
        gpu = worker.gpu
        planned = [run.plan(worker) for run in self.runs]
        reference = self.reference(worker)
        for run, each in zip(self.runs, planned, strict=True):
            frame = stages.draw_last(each.for_frames(range(1, self.frame + 1)), gpu)
            if reference is None:
                reference = _reference(run, frame.arrays, self.encoding)
                yield ReferenceResult(reference, frame.device)
            rendered = _rendered(run, each, frame.arrays, reference, frame.device, worker, warnings=frame.warnings)
            yield replace(rendered, measured={**rendered.measured, **self._difference(run, each, worker)})
        for run, each, times in zip(self.runs, planned, _take_turns(gpu, planned, self.frames), strict=True):
            device = gpu.device.as_json()
            yield TimingResult(run.number, times_of(times, node_types(each)), device, _machine(worker))

    def _difference(self, run: RunSpec, planned: Planned, worker: Worker) -> dict[str, Any]:
        graph, key = planned.linked.graph, ("outputs", self.base.digest, self.frame)
        if run.number == self.base.number:
            return {"difference": diff(graph, graph)}
        if key not in worker.cache:
            base = self.base.plan(worker)
            worker.cache[key] = base.linked.graph, every_output(worker.gpu, base, self.frame)
        base_graph, base_frame = worker.cache[key]
        difference = diff(base_graph, graph)
        frame = every_output(worker.gpu, planned, self.frame)
        first = first_difference(base_frame, frame, planned.plan, graph, difference)
        return {"difference": difference, "first": first}


@dataclass(frozen=True, eq=False)
class ReferenceTask(Task):
    """The reference, where it is not one of the runs that are rendered."""

    name: str
    spec: RunSpec
    kind: Literal["variant", "pipeline"]
    encoding: Encoding
    frame: int

    def run(self, worker: Worker) -> Iterator[ReferenceResult]:
        planned = self.spec.plan(worker)
        frame = stages.draw_last(planned.for_frames(range(1, self.frame + 1)), worker.gpu)
        yield ReferenceResult(_reference(self.spec, frame.arrays, self.encoding, self.kind), frame.device)


def _reference(
    run: RunSpec,
    arrays: Mapping[str, Pixels],
    encoding: Encoding,
    kind: Literal["variant", "pipeline"] = "variant",
) -> Reference:
    return Reference(run.name, kind, arrays[run.output], encoding, run.output, arrays.get("radiance"))


def _rendered(
    run: RunSpec,
    planned: Planned,
    arrays: Mapping[str, Pixels],
    reference: Reference,
    device: Mapping[str, object],
    worker: Worker,
    *,
    encode: bool = False,
    warnings: tuple[Problem, ...] = (),
) -> RenderedResult:
    graph, pixels = planned.linked.graph, arrays[run.output]
    errors, flip_map = measure_against(pixels, reference, run.name, planned.linked.catalog.extensions.metrics())
    measured = {
        "pixels": pixels,
        "encoding": reference.encoding,
        "metrics": errors,
        "flip_map": flip_map,
        "radiance_rmse": light_error(arrays.get("radiance"), reference.light),
        "not_finite": not_finite_pixels(graph, arrays),
        "figures": figures_of(arrays),
    }
    picture = _encoded(run, graph, pixels) if encode else b""
    return RenderedResult(run.number, measured, picture, device, _machine(worker), warnings)


def _encoded(run: RunSpec, graph: Graph, pixels: Pixels) -> bytes:
    """Return the file of a run's picture."""
    from rendergraph.images import PictureInfo, Saved, encoded  # a sweep is checked without OpenImageIO

    info = graph.textures[graph.outputs[run.output]]
    picture = PictureInfo(info.semantic.name, info.desc.format if info.desc else "", info.semantic.encoding)
    return encoded(Saved(Path(f"{run.output}{run.extension}"), pixels, picture, raw=False), run.metadata)


def _take_turns(gpu: Gpu, planned: Sequence[Planned], frames: int) -> list[list[FrameTimes]]:
    """Measure pipelines in turns, each turn starting with another one."""
    times: list[list[FrameTimes]] = [[] for _ in planned]
    for turn, first in enumerate(range(0, frames, FRAMES_PER_TURN)):
        count = min(FRAMES_PER_TURN, frames - first)
        for place in range(len(planned)):
            number = (place + turn) % len(planned)
            times[number] += stages.draw_last(planned[number].for_frames(range(1, count + 1), timed=True), gpu).times
    return times


def _machine(worker: Worker) -> dict[str, str]:
    if "machine" not in worker.cache:
        worker.cache["machine"] = machine()
    described: dict[str, str] = worker.cache["machine"]
    return described


def _mapped(error: InputError | RenderError, worker: Worker) -> InputError | RenderError:
    mapped = map_remote_paths(error, worker.root)
    assert isinstance(mapped, InputError | RenderError)  # of the same class
    return mapped
