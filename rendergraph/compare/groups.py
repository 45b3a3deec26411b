"""Variants of a sweep that are drawn together, as work for whatever worker: drawn, compared, measured, encoded."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, TypeAlias

from rendergraph import metrics
from rendergraph.compare.batches import Batch, draw, fitting, measure
from rendergraph.compare.runs import Run, picture_bytes
from rendergraph.compare.sources import sources_digest
from rendergraph.compare.timing import Times
from rendergraph.compare.values import Pixels, light_error, machine, not_finite_pixels
from rendergraph.errors import InputError, Problem, RenderError
from rendergraph.farm import Handle, Task, Worker
from rendergraph.farm.bundle import map_remote_paths, relocate_selection
from rendergraph.farm.tasks import is_retryable
from rendergraph.metrics import Encoding, Metrics
from rendergraph.session import stages
from rendergraph.session.frame import figures_of
from rendergraph.session.pipeline import Pipeline

if TYPE_CHECKING:
    from rendergraph.catalog import Catalog
    from rendergraph.session.selection import Selection
    from rendergraph.session.values import Planned


@dataclass(frozen=True, eq=False)
class Variant:
    """One run, as a worker has to know it.

    Attributes:
        number: of the run.
        name: the run's.
        selection: what is drawn.
        digest: of what it is drawn from, as it was when the sweep began.
        output: the output that is compared and kept.
        ending: of the picture's file, which chooses its format.
        metadata: of the picture.
        drawn: its picture is there already, only times are wanted.
        planned: the pipeline itself, where the worker is the process that made it.
    """

    number: int
    name: str
    selection: Selection
    digest: str
    output: str
    ending: str
    metadata: Mapping[str, str]
    drawn: bool
    planned: Planned | None = field(default=None, repr=False)

    @classmethod
    def of(cls, run: Run, number: int, *, drawn: bool) -> Variant:
        """A run as a worker has to know it."""
        selection, digest = run.planned.linked.selection, drawn_from(run.planned)
        ending, metadata = run.picture.suffix, run.metadata
        return cls(number, run.name, selection, digest, run.output, ending, metadata, drawn, run.planned)

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "planned": None}

    def plan(self, worker: Worker, catalog: Catalog | None = None) -> Planned:
        """The pipeline with order and memory.

        Args:
            worker: where it is to be drawn.
            catalog: that of another variant, which takes a while to make.

        Raises:
            InputError: it is not what it was when the sweep began.
        """
        if self.planned is not None:
            return self.planned
        pipeline = Pipeline(relocate_selection(self.selection, worker.root), catalog)
        planned = stages.plan(stages.expand(pipeline.link()))
        if drawn_from(planned) != self.digest:
            text = f"what '{self.name}' is drawn from is not the same on worker '{worker.name}' as when the work began"
            raise InputError(Problem("RG642", f"{text}: a file has changed, or another version is installed there"))
        return planned


def drawn_from(planned: Planned) -> str:
    """What decides the picture and its figures beside the resolved file."""
    metrics = sorted(metric.name for metric in planned.linked.catalog.extensions.metrics())
    return f"{sources_digest(planned)} {' '.join(metrics)}"


@dataclass(frozen=True, eq=False)
class Against:
    """What pictures are measured against.

    Attributes:
        name: a variant's, a pipeline's or a file's.
        encoding: what its values are.
        pixels: top row first.
        light: its scene-linear light, where it has any.
    """

    name: str
    encoding: Encoding
    pixels: Pixels
    light: Pixels | None


@dataclass(frozen=True, eq=False)
class Pictured:
    """A variant has been drawn and compared.

    Attributes:
        number: of the run.
        pixels: the output that is compared.
        picture: its file.
        light: scene-linear, of the first of all alone: others are measured against it.
        found: the metrics.
        radiance_rmse, flip_map, not_finite, figures: as a `Result` has them.
        device, machine: what drew.
    """

    number: int
    pixels: Pixels
    picture: bytes
    light: Pixels | None
    found: Metrics
    radiance_rmse: float | None
    flip_map: Pixels | None
    not_finite: int
    figures: Mapping[str, float | list[float]]
    device: Mapping[str, object]
    machine: Mapping[str, str]


@dataclass(frozen=True, eq=False)
class Timed:
    """A variant has been measured."""

    number: int
    times: Times
    device: Mapping[str, object]
    machine: Mapping[str, str]


@dataclass(frozen=True, eq=False)
class Unable:
    """A variant cannot be drawn or compared, wherever that is tried."""

    number: int
    error: InputError | RenderError


@dataclass(frozen=True)
class Passes:
    """So many passes have been drawn for a batch."""

    count: int


Told: TypeAlias = "Pictured | Timed | Unable | Passes"


@dataclass(frozen=True, eq=False)
class Group(Task):
    """Variants that are drawn together; what they share is drawn once.

    Attributes:
        variants: all with one scene, camera and size.
        against: what they are measured against; of the first group None, whose first variant is it.
        frame: number of the frame whose pictures are wanted.
        frames, repeats: how many are measured, and how often.
        encoding: of the output that is compared.
        most_bytes: of textures in a batch.
    """

    variants: tuple[Variant, ...]
    against: Handle | None
    frame: int
    frames: int
    repeats: int
    encoding: Encoding
    most_bytes: int

    @property
    def name(self) -> str:  # type: ignore[override]  # a value, said once
        """The first variant's, and how many more there are."""
        first, *more = self.variants
        return f"{first.name} and {len(more)} more" if more else first.name

    @property
    def needs(self) -> tuple[Handle, ...]:  # type: ignore[override]  # see above
        """The reference."""
        return () if self.against is None else (self.against,)

    def run(self, worker: Worker) -> Iterator[Told]:
        """Each variant's picture, then its times, batch after batch.

        Raises:
            InputError: the first of all, which others are measured against, cannot be drawn.
            RenderError: likewise, or the worker lacks memory or its device.
        """
        planned: list[Planned | None] = []
        catalog: Catalog | None = None
        for variant in self.variants:
            try:
                planned.append(variant.plan(worker, catalog))
                catalog = planned[-1].linked.catalog if planned[-1] is not None else None
            except InputError as error:
                if self.against is None:
                    raise
                planned.append(None)
                yield Unable(variant.number, _at_home(error, worker))
        variants = [each for each in planned if each is not None]
        own = [variant for variant, each in zip(self.variants, planned, strict=True) if each is not None]
        against: Against | None = worker.value(self.against) if self.against is not None else None
        waiting = fitting(variants, range(len(variants)), self.most_bytes) if variants else []
        done: set[int] = set()
        while waiting:
            batch = waiting.pop(0)
            try:
                for told in self._batch(worker, batch, variants, own, against):
                    if isinstance(told, Pictured) and against is None:
                        against = Against(own[0].name, self.encoding, told.pixels, told.light)
                    if isinstance(told, Timed):
                        done.add(told.number)
                    yield told
            except (InputError, RenderError) as error:
                left = [place for place in batch.numbers if own[place].number not in done]
                if len(batch.numbers) > 1:  # each alone, so that only the one at fault fails, and in its own words
                    waiting[:0] = [alone for place in left for alone in fitting(variants, [place], self.most_bytes)]
                elif against is None or is_retryable(error):
                    raise
                else:
                    yield Unable(own[next(iter(batch.numbers))].number, _at_home(error, worker))

    def _batch(
        self, worker: Worker, batch: Batch, variants: Sequence[Planned], own: Sequence[Variant], against: Against | None
    ) -> Iterator[Told]:
        undrawn = [place for place in batch.numbers if not own[place].drawn]
        on = worker.cache.setdefault("machine", machine())
        if undrawn:
            for drawn in list(draw(worker.gpu, variants, batch, self.frame)):
                if drawn.number in undrawn:
                    variant, planned = own[drawn.number], variants[drawn.number]
                    told = _compared(variant, planned, drawn.arrays, against, self.encoding)
                    told = replace(told, device=drawn.device, machine=on)
                    if against is None:
                        against = Against(variant.name, self.encoding, told.pixels, told.light)
                    else:
                        told = replace(told, light=None)
                    yield told
        device = worker.gpu.device.as_json()
        taken = measure(worker.gpu, variants, batch, self.frames, warm=bool(undrawn), repeats=self.repeats)
        for place, times in taken:
            yield Timed(own[place].number, times, device, on)
        yield Passes(batch.pass_count)


def _at_home(error: InputError | RenderError, worker: Worker) -> InputError | RenderError:
    found = map_remote_paths(error, worker.root)
    assert isinstance(found, InputError | RenderError)  # of the same kind
    return found


def _compared(
    variant: Variant, planned: Planned, arrays: Mapping[str, Pixels], against: Against | None, encoding: Encoding
) -> Pictured:
    graph, plugins = planned.linked.graph, planned.linked.catalog.extensions.metrics()
    pixels, light = arrays[variant.output], arrays.get("radiance")
    if against is None:
        found, map_ = metrics.same(pixels, plugins), None
    else:
        names = (variant.name, against.name)
        found, map_ = metrics.measure(pixels, against.pixels, encoding=encoding, names=names, plugins=plugins)
    return Pictured(
        number=variant.number,
        pixels=pixels,
        picture=picture_bytes(graph, variant.output, variant.ending, pixels, variant.metadata),
        light=light,
        found=found,
        radiance_rmse=light_error(light, light if against is None else against.light),
        flip_map=map_,
        not_finite=not_finite_pixels(graph, arrays),
        figures=figures_of(arrays),
        device={},
        machine={},
    )


@dataclass(frozen=True, eq=False)
class First(Task):
    """What all runs are measured against, where it is none of those that are drawn: its picture and its light."""

    variant: Variant
    frame: int
    encoding: Encoding

    @property
    def name(self) -> str:  # type: ignore[override]  # a value, said once
        """The variant's."""
        return self.variant.name

    def run(self, worker: Worker) -> Iterator[tuple[Against, Mapping[str, object]]]:
        """It, and what drew it."""
        planned = self.variant.plan(worker)
        shown = stages.draw_last(planned.for_frames(range(1, self.frame + 1)), worker.gpu)
        yield (
            Against(self.variant.name, self.encoding, shown[self.variant.output], shown.get("radiance")),
            shown.device,
        )
