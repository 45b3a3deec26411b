"""The product of axes: every combination drawn, measured and kept; what is there already is not drawn again."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, TypeAlias

from rendergraph import metrics
from rendergraph.compare.axes import Axes, Space, typed
from rendergraph.compare.batches import MOST_BYTES, Batch, Drawn, batches, draw, measure
from rendergraph.compare.divergence import passes
from rendergraph.compare.goals import Search
from rendergraph.compare.ledger import Ledger
from rendergraph.compare.pictures import light_error
from rendergraph.compare.prepare import prepare
from rendergraph.compare.reference import scene_name
from rendergraph.compare.runs import (
    RUN,
    Failure,
    Run,
    drop,
    found_again,
    give_up,
    keep,
    restored,
    settle,
    without_picture,
)
from rendergraph.compare.study import begin, claimed, open_folder
from rendergraph.compare.timing import NO_TIMES, enough
from rendergraph.compare.values import Comparison, Pixels, Reference, Result, not_finite_pixels
from rendergraph.errors import InputError, RenderError
from rendergraph.metrics import Encoding
from rendergraph.session import stages
from rendergraph.session.frame import figures_of
from rendergraph.session.progress import Progress, shown

Pictures: TypeAlias = Literal["all", "best"]
"""Which pictures of a sweep stay."""

if TYPE_CHECKING:
    from rendergraph.session import Pipeline
    from rendergraph.session.gpu import Gpu
    from rendergraph.session.values import Planned


@dataclass(frozen=True, eq=False)
class Sweep:
    """What a sweep has found.

    Attributes:
        comparison: every run as a variant, in the order of the product.
        space: what was swept.
        executed: passes that were drawn for the runs of this time.
        alone: passes those runs would have drawn one by one.
        resumed: runs that were there already.
        timed: runs of which the picture was there, and not as many measured frames.
        redrawn: runs that were there, drawn from files that have changed since.
        torn: lines of the results that were not whole.
        failures: runs that could not be drawn or compared; they are no variants.
        search: what was looked for, where an optimiser chose the runs.
    """

    comparison: Comparison
    space: Space
    executed: int
    alone: int
    resumed: int
    timed: int
    redrawn: int
    torn: int
    failures: tuple[Failure, ...]
    search: Search | None = None

    def __repr__(self) -> str:
        return f"<Sweep of {', '.join(axis.path for axis in self.space.axes)}: {len(self.comparison.results)} runs>"

    def _repr_html_(self) -> str:
        return self.comparison._repr_html_()

    def as_json(self) -> dict[str, Any]:
        """The document of `sweep --json`."""
        found = self.comparison.as_json()
        runs = found.pop("variants")
        front = {result.name for result in pareto(self.comparison.results)}
        return (
            found
            | {
                "axes": {
                    axis.path: axis.text if axis.span else list(map(typed, axis.values)) for axis in self.space.axes
                },
                "executed_passes": self.executed,
                "passes_one_by_one": self.alone,
                "resumed": self.resumed,
                "timed_again": self.timed,
                "redrawn": self.redrawn,
                "runs": [run | {"pareto": run["name"] in front} for run in runs],
                "failed": [failure.as_json() for failure in self.failures],
            }
            | ({"search": self.search.as_json()} if self.search else {})
        )


@dataclass(eq=False)
class _Work:
    """What goes from one part of a sweep to the next.

    Attributes:
        runs: all of them, in the order of the product.
        encoding: of the output that is compared.
        other: the reference, where it is a pipeline of its own.
        ledger: where results go.
        lines: those that it had, by key.
        results, records: what is there, by the run's number; results may lack times.
        failures: what cannot be drawn, likewise.
        frames, repeats: how many are to be measured, and how often.
        pictures: which stay.
        device: what drew.
        reference, light: what is measured against, once it is there.
    """

    runs: list[Run]
    encoding: Encoding
    other: Planned | None
    ledger: Ledger
    lines: Mapping[str, dict[str, Any]]
    frames: int
    repeats: int = 1
    pictures: Pictures = "all"
    results: dict[int, Result] = field(default_factory=dict)
    records: dict[int, Mapping[str, Any]] = field(default_factory=dict)
    failures: dict[int, Failure] = field(default_factory=dict)
    device: Mapping[str, object] = field(default_factory=dict)
    reference: Reference | None = None
    light: Pixels | None = None
    executed: int = 0
    alone: int = 0

    @property
    def missing(self) -> list[int]:
        """Numbers of the runs that have no result, or one of fewer frames than asked for; failed ones are not asked."""
        return [n for n in range(len(self.runs)) if n not in self.failures and not self.is_done(n)]

    def is_done(self, number: int) -> bool:
        """Whether a run is drawn and measured."""
        return number in self.results and enough(self.results[number].times, self.frames, self.repeats)


def sweep(
    base: Pipeline,
    axes: Axes,
    out: Path | str,
    reference: Path | Pipeline | None = None,
    *,
    metric: str | None = None,
    frames: int = 5,
    repeats: int = 1,
    frame: int = 1,
    kept: Pictures = "all",
    only: Sequence[int] | None = None,
    resume: bool = False,
    most_bytes: int = MOST_BYTES,
    session: Gpu | None = None,
    device: int | None = None,
    progress: Progress | bool | None = None,
) -> Sweep:
    """Draw every combination of the axes' values into a folder each, and measure it.

    A run's picture and figures are kept as soon as it is drawn, its times when they are known: what is interrupted
    loses little. A run that cannot be drawn gets a line with the reason, and the others go on.

    Args:
        base: what the axes change.
        axes: paths with values or ranges: `{"ao.samples": [8, 16], "ao.radius": "log:0.1:1:5"}`; a `Space` of them for
            samples, or axes that go together.
        out: the folder; `results.jsonl` in it grows by a line a run that has been measured.
        reference: a picture or a pipeline that runs are measured against; the first run by default.
        metric: the port whose texture is measured in place of the picture: `ao.occlusion`.
        frames: how many frames are measured, at least; runs that are there and have fewer are measured again.
        repeats: how often they are measured, each time anew: the spread of the medians says what a time is worth.
        frame: number of the frame whose pictures are kept.
        kept: which pictures stay: `all`, or `best`, those of the Pareto front of what is drawn so far, and of the run
            that others are measured against.
        only: numbers of the runs, from 0, where these are but a part; they are called and measured as in the whole.
        resume: keep runs that the folder has already.
        most_bytes: of textures that variants drawn together may take.
        session: where to draw; a private one by default.
        device: GL device number where no session is given.
        progress: told how many runs are done, and of how many; True shows a bar on stderr.

    Raises:
        InputError: an axis names nothing, a value does not fit, the folder has results already, or of another study, or
            another sweep is at work in it; or what runs are measured against cannot be drawn.
        RenderError: it failed while writing, or while drawing what runs are measured against.
        DeviceError: there is no usable GL device.
    """
    from rendergraph.session.gpu import opened  # a sweep is checked without GL

    out = Path(out)
    planned = prepare(base, axes, out, reference, metric=metric, frame=frame, only=only)
    runs, other, picture = planned.runs, planned.other, planned.picture
    with claimed(out):
        ledger, lines, torn = open_folder(out, planned.study, resume=resume)
        work = _Work(list(runs), planned.encoding, other, ledger, lines, frames, repeats, kept, reference=picture)
        _take_kept(work)
        resumed = sum(map(work.is_done, range(len(runs))))
        timed = len(work.results) - resumed
        redrawn = sum(number not in work.results and (run.folder / RUN).exists() for number, run in enumerate(runs))
        if work.missing or other:
            with opened(session, device) as gpu, shown(progress, "runs") as tell:
                begin(out, planned.study)
                _draw_missing(work, gpu, frame, most_bytes, tell)
    results = tuple(work.results[number] for number in sorted(work.results))
    failures = tuple(work.failures[number] for number in sorted(work.failures))
    first, measured = runs[0].planned.linked, work.reference
    if measured is None:
        pixels = results[0].pixels
        assert pixels is not None  # the first run's stays
        measured = Reference(runs[0].name, "variant", pixels, planned.encoding, runs[0].output)
    comparison = Comparison(
        results=results,
        reference=measured,
        base=(runs[0].name, first.graph),
        scene=scene_name(first),
        camera=first.selection.camera,
        size=first.graph.size,
        frame=frame,
        metric=metric,
        device=work.device,
        notes=planned.notes,
        warnings=tuple(
            dict.fromkeys(
                [problem for run in runs for problem in run.planned.linked.warnings]
                + [problem for result in results for problem in result.warnings]
            )
        ),
    )
    return Sweep(comparison, planned.space, work.executed, work.alone, resumed, timed, redrawn, torn, failures)


def pareto(results: Sequence[Result]) -> list[Result]:
    """The results than which none is both quicker and better, quickest first; quality is FLIP.

    Pictures that hold NaN or infinity are none of them.
    """
    found: list[Result] = []
    for result in sorted(results, key=lambda r: (r.times.headline.median, r.metrics.flip)):
        flip = result.metrics.flip
        if math.isfinite(flip) and not result.not_finite and (not found or flip < found[-1].metrics.flip):
            found.append(result)
    return found


def _draw_missing(work: _Work, gpu: Gpu, frame: int, most_bytes: int, progress: Progress) -> None:
    """Draw, measure and keep the runs that are not there; the reference first, where it is not the first of them."""
    output, missing = work.runs[0].output, work.missing
    if work.reference is None and (work.other or 0 in work.results):
        planned = work.other or work.runs[0].planned
        shown = stages.draw_last(planned.for_frames(range(1, frame + 1)), gpu)
        if work.other:
            work.reference = Reference(work.other.linked.graph.name, "pipeline", shown[output], work.encoding, output)
        else:
            work.reference = Reference(work.runs[0].name, "variant", shown[output], work.encoding, output)
        work.light, work.device = shown.get("radiance"), shown.device
    variants = [run.planned for run in work.runs]
    waiting = batches(variants, missing, most_bytes)
    while waiting:
        batch = waiting.pop(0)
        try:
            work.executed += _draw_batch(work, gpu, batch, variants, frame)
        except _DrawingFailed as failed:
            if len(batch.numbers) > 1:  # each alone, so that only the one at fault fails, and in its own words
                left = [number for number in batch.numbers if not work.is_done(number)]
                waiting[:0] = [alone for number in left for alone in batches(variants, [number], most_bytes)]
                continue
            number = next(iter(batch.numbers))
            if work.reference is None:
                raise type(failed.error)(failed.error.problems) from failed.error
            work.failures[number] = give_up(work.runs[number], failed.error.problems, work.ledger, work.lines)
        progress(len(work.runs) - len(work.missing), len(work.runs))


class _DrawingFailed(Exception):
    """Drawing or comparing did not go well, which is the fault of the runs and of nothing that they share."""

    def __init__(self, error: InputError | RenderError) -> None:
        super().__init__(str(error))
        self.error = error


@contextmanager
def _drawing() -> Iterator[None]:
    try:
        yield
    except (InputError, RenderError) as error:
        raise _DrawingFailed(error) from error


def _draw_batch(work: _Work, gpu: Gpu, batch: Batch, variants: Sequence[Planned], frame: int) -> int:
    """Draw, compare, keep and measure the runs of a batch, and count the passes it draws.

    Raises:
        _DrawingFailed: one of them cannot be drawn or compared.
        RenderError: the disk does not take it.
    """
    undrawn = [number for number in batch.numbers if number not in work.results]
    if undrawn:
        with _drawing():
            drawn = [each for each in draw(gpu, variants, batch, frame) if each.number in undrawn]
        for each in drawn:
            _keep(work, each)
    with _drawing():
        taken = list(measure(gpu, variants, batch, work.frames, warm=bool(undrawn), repeats=work.repeats))
    for number, times in taken:
        work.results[number] = replace(work.results[number], times=times)
    beaten = _beaten(work)
    for number, times in taken:
        record = without_picture(work.records[number]) if number in beaten else work.records[number]
        work.records[number] = settle(work.runs[number], record, times, work.device, work.ledger)
        work.alone += work.results[number].pass_count
    _drop(work, beaten)
    return batch.pass_count


def _beaten(work: _Work) -> set[int]:
    """Runs whose pictures go: another is both quicker and better."""
    if work.pictures == "all":
        return set()
    measured = {number: result for number, result in work.results.items() if result.times.frames}
    best = {result.name for result in pareto(list(measured.values()))}
    if work.other is None and (work.reference is None or work.reference.kind == "variant"):
        best.add(work.runs[0].name)
    return {number for number, result in measured.items() if result.name not in best}


def _drop(work: _Work, beaten: set[int]) -> None:
    """Let pictures go, from the folder and from memory."""
    for number in beaten:
        if work.records[number]["picture"] is not None:
            work.records[number] = drop(work.runs[number], work.records[number], work.ledger)
        work.results[number] = replace(work.results[number], pixels=None, flip_map=None)


def _take_kept(work: _Work) -> None:
    """What is there already; a run whose line was lost gets it again."""
    for number, run in enumerate(work.runs):
        if record := found_again(run, work.lines, pictures=work.pictures == "all"):
            if record["frames"] and run.key not in work.lines:
                work.ledger.append(record)
            work.results[number], work.records[number] = restored(run, record, work.encoding), record
            work.device = record["device"]
    _drop(work, _beaten(work))


def _keep(work: _Work, drawn: Drawn) -> None:
    """Compare a run with the reference, which it may be itself, and write down what is known before its times are."""
    run = work.runs[drawn.number]
    work.device = drawn.device
    if work.reference is None:
        work.reference = Reference(run.name, "variant", drawn.arrays[run.output], work.encoding, run.output)
        work.light = drawn.arrays.get("radiance")
    with _drawing():
        result = _compared(run, drawn, work.reference, work.light)
    work.records[drawn.number] = keep(run, result, drawn.arrays, drawn.device)
    work.results[drawn.number] = result


def _compared(run: Run, drawn: Drawn, reference: Reference, light: Pixels | None) -> Result:
    pixels, own = drawn.arrays[run.output], drawn.arrays.get("radiance")
    linked, plan = run.planned.linked, run.planned.plan
    plugins = linked.catalog.extensions.metrics()
    if reference.pixels is pixels:
        found, map_ = metrics.same(pixels, plugins), None
    else:
        names = (run.name, reference.name)
        found, map_ = metrics.measure(
            pixels, reference.pixels, encoding=reference.encoding, names=names, plugins=plugins
        )
    return Result(
        name=run.name,
        source=linked.selection.source,
        pixels=pixels,
        encoding=reference.encoding,
        metrics=found,
        times=NO_TIMES,
        memory=plan.memory.as_json(),
        pass_count=len(passes(plan)),
        settings=run.settings,
        radiance_rmse=light_error(own, light),
        flip_map=map_,
        graph=linked.graph,
        plan=plan,
        not_finite=not_finite_pixels(linked.graph, drawn.arrays),
        figures=figures_of(drawn.arrays),
    )
