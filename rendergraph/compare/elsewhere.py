"""Pipelines compared by workers: each draws one of them, measures it, and finds where it begins to differ."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from rendergraph import metrics
from rendergraph.compare.divergence import every_output, first_difference, passes
from rendergraph.compare.groups import Against, First, Variant, drawn_from
from rendergraph.compare.timing import Times, times_of
from rendergraph.compare.values import Difference, Pixels, Reference, Result, light_error, not_finite_pixels
from rendergraph.diff import diff
from rendergraph.farm import Executor, Handle, Task, TaskFailed, TaskOutput, Worker
from rendergraph.metrics import Encoding, Metrics
from rendergraph.session import stages

if TYPE_CHECKING:
    from rendergraph.errors import Problem
    from rendergraph.session.values import Planned


@dataclass(frozen=True, eq=False)
class Found:
    """What a worker has found out about a variant, as a `Result` has it."""

    number: int
    pixels: Pixels
    metrics: Metrics
    flip_map: Pixels | None
    radiance_rmse: float | None
    times: Times
    first: Difference | None
    not_finite: int
    figures: Mapping[str, float | list[float]]
    warnings: tuple[Problem, ...]
    device: Mapping[str, object]


@dataclass(frozen=True, eq=False)
class Comparing(Task):
    """One variant against the base.

    Attributes:
        variant: which.
        base: what its outputs are held against; None of the base itself.
        against: what its picture is measured against.
        frame: number of the frame whose pictures are compared.
        frames: how many are measured.
    """

    variant: Variant
    base: Variant | None
    against: Handle
    frame: int
    frames: int

    @property
    def name(self) -> str:  # type: ignore[override]  # a value, said once
        """The variant's."""
        return self.variant.name

    @property
    def needs(self) -> tuple[Handle, ...]:  # type: ignore[override]  # see above
        """The reference."""
        return (self.against,)

    def run(self, worker: Worker) -> Iterator[Found]:
        """Everything about it."""
        against: Against = worker.value(self.against)
        planned, gpu = self.variant.plan(worker), worker.gpu
        graph, plugins = planned.linked.graph, planned.linked.catalog.extensions.metrics()
        shown = stages.draw_last(planned.for_frames(range(1, self.frame + 1)), gpu)
        timed = stages.draw_last(planned.for_frames(range(1, self.frames + 1), timed=True), gpu).times
        pixels, light, first = shown[self.variant.output], shown.get("radiance"), None
        if self.base is None:
            found, map_ = metrics.same(pixels, plugins), None
        else:
            key = "outputs", self.base.digest, self.frame
            if key not in worker.cache:
                base = self.base.plan(worker)
                worker.cache[key] = base.linked.graph, every_output(gpu, base, self.frame)
            base_graph, tapped = worker.cache[key]
            seen = every_output(gpu, planned, self.frame)
            first = first_difference(tapped, seen, planned.plan, graph, diff(base_graph, graph))
            names = (self.variant.name, against.name)
            found, map_ = metrics.measure(
                pixels, against.pixels, encoding=against.encoding, names=names, plugins=plugins
            )
        yield Found(
            self.variant.number,
            pixels,
            found,
            map_,
            light_error(light, against.light),
            times_of(timed, {node.id: node.type.name for node in graph.nodes}),
            first,
            not_finite_pixels(graph, shown),
            shown.figures,
            shown.warnings,
            shown.device,
        )


def compared(
    farm: Executor,
    planned: Sequence[Planned],
    names: Sequence[str],
    own: bool,
    picture: Reference | None,
    output: str,
    encoding: Encoding,
    frame: int,
    frames: int,
    step: Callable[[], None],
) -> tuple[Reference, list[Result], list[Problem], Mapping[str, object]]:
    """What `compare` makes of its pipelines, found out by workers.

    Args:
        farm: who works.
        planned: the pipelines, and last the reference, where that is one of its own.
        names: of the variants.
        own: whether it is.
        picture: the reference, where that is a file.
        output, encoding: what is compared.
        frame: number of the frame whose pictures are compared.
        frames: how many are measured; each variant has its worker to itself meanwhile.
        step: told when a variant is done.

    Raises:
        InputError: a mistake in a shader.
        RenderError: it failed while drawing.
    """
    called = [*names, planned[-1].linked.graph.name]
    variants = [
        Variant(number, called[number], each.linked.selection, drawn_from(each), output, ".png", {}, False, each)
        for number, each in enumerate(planned)
    ]
    base = variants[-1] if own else variants[0]
    farm.submit(First(base, frame, encoding))
    drawn: dict[int, Found] = {}
    device: Mapping[str, object] = {}
    against: Against | None = None
    for event in farm.events():
        if isinstance(event, TaskFailed):
            raise type(event.error)(event.error.problems) from event.error
        if not isinstance(event, TaskOutput):
            continue
        if isinstance(event.value, Found):
            drawn[event.value.number] = event.value
            step()
        elif against is None:
            against, device = event.value
            if picture is not None:
                against = Against(picture.name, encoding, picture.pixels, None)
            handle = farm.put(against)
            for variant in variants[: len(names)]:
                itself = variant is base and picture is None
                farm.submit(Comparing(variant, None if itself else base, handle, frame, frames))
    assert against is not None  # it came first
    base_graph = planned[base.number].linked.graph
    results = [
        Result(
            name=names[number],
            source=each.linked.selection.source,
            pixels=found.pixels,
            encoding=encoding,
            metrics=found.metrics,
            times=found.times,
            memory=each.plan.memory.as_json(),
            pass_count=len(passes(each.plan)),
            radiance_rmse=found.radiance_rmse,
            flip_map=found.flip_map,
            graph=each.linked.graph,
            plan=each.plan,
            difference=diff(base_graph, each.linked.graph),
            first=found.first,
            not_finite=found.not_finite,
            figures=found.figures,
        )
        for number, each in enumerate(planned[: len(names)])
        for found in [drawn[number]]
    ]
    reference = picture or Reference(base.name, "pipeline" if own else "variant", against.pixels, encoding, output)
    return reference, results, [problem for each in drawn.values() for problem in each.warnings], device
