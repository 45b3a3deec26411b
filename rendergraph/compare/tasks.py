"""Tasks that any worker can do: render variants, compare them with the reference, and measure them.

`first_difference` finds the first pass, in order of execution, whose output differs between two pipelines.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Literal, TypeAlias

import numpy as np

from rendergraph.compare.batches import Batch, fitting_batches, measure_batch, node_types, render_batch
from rendergraph.compare.light import LIGHT, with_light
from rendergraph.compare.prepare import Run
from rendergraph.compare.results import Difference, Reference, light_errors, machine, measure_against, passes
from rendergraph.compare.timing import Times, times_of
from rendergraph.declare import InOut, Output
from rendergraph.diff import GraphDiff, diff
from rendergraph.errors import InputError, Problem, RenderError, RendergraphError
from rendergraph.farm import Handle, Task, Worker
from rendergraph.farm.bundle import map_remote_paths
from rendergraph.farm.tasks import is_retryable
from rendergraph.link import Endpoint, Graph
from rendergraph.metrics import Encoding, Pixels
from rendergraph.session import Frame, RenderOptions, stages
from rendergraph.session.frame import figures_of, not_finite

if TYPE_CHECKING:
    from rendergraph.allocate import ResourcePlan
    from rendergraph.execute import FrameTimes
    from rendergraph.session.gpu import Gpu
    from rendergraph.session.values import Planned

Origin: TypeAlias = Mapping[str, Mapping[str, Any]]
"""The GL device and the machine of a worker: `device`, `machine`."""
FRAMES_PER_TURN = 2
"""Few, so that other load on the machine affects all variants alike."""


@dataclass(frozen=True, eq=False)
class ReferenceResult:
    reference: Reference
    origin: Origin


@dataclass(frozen=True, eq=False)
class RenderedResult:
    """A run has been rendered and compared: fields of its `Result`, and the picture's file."""

    number: int
    measured: Mapping[str, Any]
    picture: bytes
    origin: Origin
    warnings: tuple[Problem, ...] = ()


@dataclass(frozen=True, eq=False)
class TimingResult:
    number: int
    times: Times
    origin: Origin


@dataclass(frozen=True, eq=False)
class TaskError:
    """A run cannot be rendered or compared, on any worker."""

    number: int
    error: RendergraphError


@dataclass(frozen=True)
class PassCount:
    count: int


TaskEvent: TypeAlias = "ReferenceResult | RenderedResult | TimingResult | TaskError | PassCount"


@dataclass(frozen=True, eq=False, kw_only=True)
class VariantTask(Task):
    """Runs of one scene, camera and size that are rendered together; shared passes are executed once.

    Without a reference in `needs`, they are measured against the first one.
    """

    name: str
    needs: tuple[Handle, ...]
    runs: tuple[Run, ...]
    encoding: Encoding
    frames: int
    repeats: int
    most_bytes: int

    def reference(self, worker: Worker) -> Reference | None:
        reference: Reference | None = worker.value(self.needs[0]) if self.needs else None
        return reference

    def run(self, worker: Worker) -> Iterator[TaskEvent]:
        """Yield each run's picture, then its times, batch after batch; a run that fails does not end the others."""
        runs: list[tuple[Run, Planned]] = []
        for run in self.runs:
            try:
                planned_run = run.plan(worker, runs[-1][1].linked.catalog if runs else None)
                runs.append((run, with_light(planned_run, run.light)))
            except InputError as error:
                if not self.needs:
                    raise
                yield TaskError(run.number, map_remote_paths(error, worker.root))
        planned = [each for _, each in runs]
        reference = self.reference(worker)
        waiting = fitting_batches(planned, range(len(runs)), self.most_bytes) if runs else []
        done: set[int] = set()
        while waiting:
            batch = waiting.pop(0)
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
                    yield TaskError(runs[min(batch.numbers)][0].number, map_remote_paths(error, worker.root))

    def _batch(
        self, worker: Worker, batch: Batch, runs: Sequence[tuple[Run, Planned]], reference: Reference | None
    ) -> Iterator[TaskEvent]:
        planned = [each for _, each in runs]
        unrendered = [place for place in batch.numbers if not runs[place][0].is_rendered]
        for place, arrays in list(render_batch(worker.gpu, batch, self.runs[0].frame)) if unrendered else ():
            if place not in unrendered:
                continue
            run, own = runs[place]
            if reference is None:
                reference = _reference(run, arrays, self.encoding)
                yield ReferenceResult(reference, origin_of(worker))
            yield _rendered(run, own, arrays, reference, worker, encode=True)
        warm = bool(unrendered)
        for place, times in measure_batch(worker.gpu, planned, batch, self.frames, self.repeats, warm=warm):
            yield TimingResult(runs[place][0].number, times, origin_of(worker))
        yield PassCount(batch.pass_count)


@dataclass(frozen=True, eq=False, kw_only=True)
class ComparisonTask(VariantTask):
    """Runs of any structure, each rendered separately; they are measured in turns and compared with a base."""

    base: Run

    def run(self, worker: Worker) -> Iterator[TaskEvent]:
        """Yield the pictures of all runs with their first differences, then their times."""
        planned = [run.plan(worker) for run in self.runs]
        reference = self.reference(worker)
        for run, each in zip(self.runs, planned, strict=True):
            lit = with_light(each, run.light)  # measured without: another output needs memory
            frame = stages.draw_last(lit.for_frames(range(1, run.frame + 1)), worker.gpu)
            if reference is None:
                reference = _reference(run, frame.arrays, self.encoding)
                yield ReferenceResult(reference, origin_of(worker))
            rendered = _rendered(run, lit, frame.arrays, reference, worker, warnings=frame.warnings)
            yield replace(rendered, measured={**rendered.measured, **self._difference(run, each, worker)})
        for run, each, times in zip(self.runs, planned, _take_turns(worker.gpu, planned, self.frames), strict=True):
            yield TimingResult(run.number, times_of(times, node_types(each)), origin_of(worker))

    def _difference(self, run: Run, planned: Planned, worker: Worker) -> dict[str, Any]:
        graph, key = planned.linked.graph, ("outputs", self.base.digest, run.frame)
        if run.number == self.base.number:
            return {"difference": diff(graph, graph)}
        if key not in worker.cache:
            base = self.base.plan(worker)
            worker.cache[key] = base.linked.graph, every_output(worker.gpu, base, run.frame)
        base_graph, base_frame = worker.cache[key]
        difference, frame = diff(base_graph, graph), every_output(worker.gpu, planned, run.frame)
        first = first_difference(base_frame, frame, planned.plan, graph, difference)
        return {"difference": difference, "first": first}


@dataclass(frozen=True, eq=False)
class ReferenceTask(Task):
    name: str
    base: Run
    encoding: Encoding

    def run(self, worker: Worker) -> Iterator[ReferenceResult]:
        planned = self.base.plan(worker).for_frames(range(1, self.base.frame + 1))
        arrays = stages.draw_last(planned, worker.gpu).arrays
        yield ReferenceResult(_reference(self.base, arrays, self.encoding), origin_of(worker))


def _reference(run: Run, arrays: Mapping[str, Pixels], encoding: Encoding) -> Reference:
    kind: Literal["variant", "pipeline"] = "variant" if run.number >= 0 else "pipeline"
    return Reference(run.name, kind, _one_picture(arrays[run.output]), encoding, run.output, arrays.get("radiance"))


def _one_picture(pixels: Pixels) -> Pixels:
    """Return an array of layers as one picture, with the layers one below the other."""
    return pixels if pixels.ndim == 3 else pixels.reshape(-1, *pixels.shape[-2:])


def _rendered(
    run: Run,
    planned: Planned,
    arrays: Mapping[str, Pixels],
    reference: Reference,
    worker: Worker,
    *,
    encode: bool = False,
    warnings: tuple[Problem, ...] = (),
) -> RenderedResult:
    graph, pixels = planned.linked.graph, _one_picture(arrays[run.output])
    errors, flip_map = measure_against(pixels, reference, run.name, planned.linked.catalog.extensions.metrics())
    measured = {
        "pixels": pixels,
        "encoding": reference.encoding,
        "metrics": errors,
        "flip_map": flip_map,
        **light_errors(arrays.get(LIGHT, arrays.get("radiance")), reference),
        "not_finite": sum(not_finite(a, graph.textures[graph.outputs[n]].semantic.name) for n, a in arrays.items()),
        "figures": figures_of(arrays),
    }
    picture = _encoded(run, graph, pixels) if encode else b""
    return RenderedResult(run.number, measured, picture, origin_of(worker), warnings)


def _encoded(run: Run, graph: Graph, pixels: Pixels) -> bytes:
    from rendergraph.images import PictureInfo, Saved, encoded  # a sweep is checked without OpenImageIO

    info = graph.textures[graph.outputs[run.output]]
    picture = PictureInfo(info.semantic.name, info.desc.format if info.desc else "", info.semantic.encoding)
    return encoded(Saved(run.picture, pixels, picture, raw=False), run.metadata)


def _take_turns(gpu: Gpu, planned: Sequence[Planned], frames: int) -> list[list[FrameTimes]]:
    """Measure pipelines in turns, each turn starting with another one."""
    times: list[list[FrameTimes]] = [[] for _ in planned]
    for turn, first in enumerate(range(0, frames, FRAMES_PER_TURN)):
        count = min(FRAMES_PER_TURN, frames - first)
        for place in range(len(planned)):
            number = (place + turn) % len(planned)
            times[number] += stages.draw_last(planned[number].for_frames(range(1, count + 1), timed=True), gpu).times
    return times


def origin_of(worker: Worker) -> Origin:
    if "origin" not in worker.cache:
        worker.cache["origin"] = {"device": worker.gpu.device.as_json(), "machine": machine()}
    origin: Origin = worker.cache["origin"]
    return origin


def every_output(gpu: Gpu, planned: Planned, frame: int) -> Frame:
    """Render a frame with every texture that a pass hands to others."""
    ports = taps(planned.linked.graph, planned.plan)
    options = RenderOptions(frames=range(1, frame + 1), outputs=(), taps=tuple(ports))
    return stages.draw_last(stages.expand(planned.linked, options), gpu)


def taps(graph: Graph, plan: ResourcePlan) -> list[str]:
    """Return the ports, in order of execution, whose texture another node or an output of the graph reads."""
    read = {end.now for node in graph.nodes for ends in node.inputs.values() for end in ends}
    read |= set(graph.outputs.values())
    ports = []
    for node in passes(plan):
        for name, port in graph[node].node.outputs().items():
            end = Endpoint(node, name)
            desc = graph.textures[end].desc if end in read and end in graph.textures else None
            if isinstance(port, Output | InOut) and desc is not None and desc.layers and desc.samples == 1:
                ports.append(str(end))
    return ports


def first_difference(
    base: Frame, variant: Frame, plan: ResourcePlan, graph: Graph, difference: GraphDiff
) -> Difference | None:
    """Return the first pass of the variant whose output differs from its counterpart in the base in any bit.

    A pass without a counterpart is not a difference by itself: the passes that read it show whether it matters.
    The frames are from `every_output`; plan and graph are the variant's.
    """
    import networkx as nx  # needed for a difference alone, and slow to import

    counterparts = {new: old for old, new in difference.nodes.items()}
    differing: dict[str, str] = {}  # node to its first output that differs
    for node in (name for name in passes(plan) if name in counterparts):
        for port in graph[node].node.outputs():
            a, b = base.arrays.get(f"{counterparts[node]}.{port}"), variant.arrays.get(f"{node}.{port}")
            if a is not None and b is not None and not _same(a, b):
                differing.setdefault(node, port)
    # Passes are in the order of their first steps. If that only fills a table, a node may read one that follows.
    leading = {node: nx.ancestors(graph.dag, node) for node in differing}
    first = next((node for node in differing if leading[node].isdisjoint(differing)), next(iter(differing), None))
    if first is None:
        return None
    end, other = f"{first}.{differing[first]}", counterparts[first]
    pixels = base.arrays[f"{other}.{differing[first]}"], variant.arrays[end]
    changed = {*difference.changed(), *difference.added}
    causes = tuple(n.id for n in graph.nodes if n.id in changed and n.id in {first, *leading[first]})
    added = tuple(cause for cause in causes if cause in difference.added)
    semantic = variant.info(end).semantic
    return Difference(first, other, differing[first], *_amount(*pixels), causes, added, pixels, semantic)


def _same(a: Pixels, b: Pixels) -> bool:
    if a.shape != b.shape or a.dtype != b.dtype:
        return False
    return np.array_equal(a, b, equal_nan=bool(np.issubdtype(a.dtype, np.floating)))


def _amount(a: Pixels, b: Pixels) -> tuple[float | None, float]:
    if a.shape != b.shape:
        return None, 1.0
    differ = (a != b) & ~((a != a) & (b != b))  # NaN is the one value that differs from itself
    texels = differ.any(axis=-1)
    distance = np.abs(a.astype(np.float64) - b.astype(np.float64))[differ]
    if a.dtype == np.uint8:
        distance = distance / 255
    return (float(distance.max()) if distance.size else 0.0), float(texels.mean())
