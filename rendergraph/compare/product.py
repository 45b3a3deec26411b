"""The product of axes: every combination drawn, measured and kept; what is there already is not drawn again."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rendergraph import metrics
from rendergraph.compare.axes import Axis, check_axes, combinations, pipelines, run_name
from rendergraph.compare.batches import MOST_BYTES, Drawn, batches, draw, measure
from rendergraph.compare.divergence import passes
from rendergraph.compare.ledger import Ledger
from rendergraph.compare.pictures import Progress, light_error
from rendergraph.compare.reference import compared_output, on_one_stage, read_picture, scene_name, unique_names
from rendergraph.compare.runs import NO_TIMES, RUN, Run, found_again, keep, key_of, restored, settle
from rendergraph.compare.sources import file_digest
from rendergraph.compare.study import begin, open_folder, study_of
from rendergraph.compare.values import Comparison, Pixels, Reference, Result
from rendergraph.metrics import Encoding
from rendergraph.session import stages

if TYPE_CHECKING:
    from rendergraph.session import Pipeline
    from rendergraph.session.gpu import Gpu
    from rendergraph.session.values import Planned


@dataclass(frozen=True, eq=False)
class Sweep:
    """What a sweep has found.

    Attributes:
        comparison: every run as a variant, in the order of the product.
        axes: what was swept.
        executed: passes that were drawn for the runs of this time.
        alone: passes those runs would have drawn one by one.
        resumed: runs that were there already.
        timed: runs of which the picture was there, and not as many measured frames.
        redrawn: runs that were there, drawn from files that have changed since.
        torn: lines of the results that were not whole.
    """

    comparison: Comparison
    axes: tuple[Axis, ...]
    executed: int
    alone: int
    resumed: int
    timed: int
    redrawn: int
    torn: int

    def as_json(self) -> dict[str, Any]:
        """The document of `sweep --json`."""
        found = self.comparison.as_json()
        runs = found.pop("variants")
        front = {result.name for result in pareto(self.comparison.results)}
        return found | {
            "axes": {axis.path: list(axis.values) for axis in self.axes},
            "executed_passes": self.executed,
            "passes_one_by_one": self.alone,
            "resumed": self.resumed,
            "timed_again": self.timed,
            "redrawn": self.redrawn,
            "runs": [run | {"pareto": run["name"] in front} for run in runs],
        }


@dataclass(eq=False)
class _Work:
    """What goes from one part of a sweep to the next.

    Attributes:
        runs: all of them, in the order of the product.
        encoding: of the output that is compared.
        other: the reference, where it is a pipeline of its own.
        ledger: where results go.
        results, records: what is there, by the run's number; results may lack times.
        frames: how many are to be measured.
        device: what drew.
        reference, light: what is measured against, once it is there.
    """

    runs: list[Run]
    encoding: Encoding
    other: Planned | None
    ledger: Ledger
    frames: int
    results: dict[int, Result] = field(default_factory=dict)
    records: dict[int, Mapping[str, Any]] = field(default_factory=dict)
    device: Mapping[str, object] = field(default_factory=dict)
    reference: Reference | None = None
    light: Pixels | None = None
    executed: int = 0
    alone: int = 0

    @property
    def missing(self) -> list[int]:
        """Numbers of the runs that have no result, or one of fewer frames than asked for."""
        return [number for number in range(len(self.runs)) if not self.is_done(number)]

    def is_done(self, number: int) -> bool:
        """Whether a run is drawn and measured."""
        return number in self.results and self.results[number].times.frames >= self.frames


def sweep(
    base: Pipeline,
    axes: Sequence[Axis],
    out: Path,
    reference: Path | Pipeline | None = None,
    *,
    frames: int = 5,
    frame: int = 1,
    resume: bool = False,
    most_bytes: int = MOST_BYTES,
    session: Gpu | None = None,
    device: int | None = None,
    progress: Progress | None = None,
) -> Sweep:
    """Draw every combination of the axes' values into a folder each, and measure it.

    A run's picture and figures are kept as soon as it is drawn, its times when they are known: what is interrupted
    loses little.

    Args:
        base: what the axes change.
        axes: paths with values.
        out: the folder; `results.jsonl` in it grows by a line a run that has been measured.
        reference: a picture or a pipeline that runs are measured against; the first run by default.
        frames: how many frames are measured, at least; runs that are there and have fewer are measured again.
        frame: number of the frame whose pictures are kept.
        resume: keep runs that the folder has already.
        most_bytes: of textures that variants drawn together may take.
        session: where to draw; a private one by default.
        device: GL device number where no session is given.
        progress: told about the runs done.

    Raises:
        InputError: an axis names nothing, a value does not fit, or the folder has results already, or of another study.
        RenderError: it failed while drawing or writing.
        DeviceError: there is no usable GL device.
    """
    from rendergraph.session.gpu import opened  # a sweep is checked without GL

    staged, notes, picture, output, encoding = _looked_at(base, axes, reference)
    settings, planned = combinations(axes), [pipeline.check() for pipeline in staged]
    variants, other = planned[: len(settings)], planned[-1] if len(staged) > len(settings) else None
    names = unique_names([run_name(run) for run in settings])
    against = key_of(other or variants[0], frame, "") if picture is None else file_digest(Path(str(reference)))
    study = study_of(base, frame, str(reference) if picture else other.linked.graph.name if other else names[0])
    ledger, records, torn = open_folder(out, study, resume=resume)
    runs = [
        Run(name, run, variant, output, key_of(variant, frame, against), out / name)
        for name, run, variant in zip(names, settings, variants, strict=True)
    ]
    work = _Work(runs, encoding, other, ledger, frames)
    if picture:
        work.reference = Reference(str(reference), "file", *picture)
    for number, run in enumerate(runs):
        if record := found_again(run, records):
            work.results[number], work.records[number] = restored(run, record, encoding), record
            work.device = record["device"]
    resumed = sum(map(work.is_done, range(len(runs))))
    timed = len(work.results) - resumed
    redrawn = sum(number not in work.results and (run.folder / RUN).exists() for number, run in enumerate(runs))
    if work.missing or other:
        with opened(session, device) as gpu:
            begin(out, study)
            _draw_missing(work, gpu, frame, most_bytes, progress or (lambda done, total: None))
    results = tuple(work.results[number] for number in range(len(runs)))
    first = variants[0].linked
    comparison = Comparison(
        results=results,
        reference=work.reference or Reference(names[0], "variant", results[0].pixels, encoding),
        base=(names[0], first.graph),
        scene=scene_name(first),
        camera=first.selection.camera,
        size=first.graph.size,
        frame=frame,
        device=work.device,
        notes=tuple(notes),
        warnings=tuple(dict.fromkeys(problem for variant in variants for problem in variant.linked.warnings)),
    )
    return Sweep(comparison, tuple(axes), work.executed, work.alone, resumed, timed, redrawn, torn)


def check_sweep(base: Pipeline, axes: Sequence[Axis], reference: Path | Pipeline | None = None) -> list[Pipeline]:
    """The pipelines that `sweep` would draw; everything that can be wrong without GL is found.

    Raises:
        InputError: as from `sweep`.
    """
    staged, *_ = _looked_at(base, axes, reference)
    for pipeline in staged:
        pipeline.check()
    return staged[: len(combinations(axes))]


def _looked_at(
    base: Pipeline, axes: Sequence[Axis], reference: Path | Pipeline | None
) -> tuple[list[Pipeline], list[str], tuple[Pixels, Encoding] | None, str, Encoding]:
    """Runs on one stage and what was changed for that, a reference picture, and the compared output's name and kind."""
    check_axes(axes)
    variants = pipelines(base, combinations(axes))
    own = [] if reference is None or isinstance(reference, Path) else [reference]
    staged, notes = on_one_stage([*variants, *own])
    name = run_name(combinations(axes)[0])
    picture = read_picture(reference, staged[0].link().graph.size, name) if isinstance(reference, Path) else None
    return staged, notes, picture, *compared_output(staged, picture[1] if picture else None)


def pareto(results: Sequence[Result]) -> list[Result]:
    """The results than which none is both quicker and better, quickest first; quality is FLIP."""
    found: list[Result] = []
    for result in sorted(results, key=lambda r: (r.times.headline.median, r.metrics.flip)):
        flip = result.metrics.flip
        if math.isfinite(flip) and (not found or flip < found[-1].metrics.flip):
            found.append(result)
    return found


def _draw_missing(work: _Work, gpu: Gpu, frame: int, most_bytes: int, progress: Progress) -> None:
    """Draw, measure and keep the runs that are not there; the reference first, where it is not the first of them."""
    output, missing = work.runs[0].output, work.missing
    if work.reference is None and (work.other or 0 in work.results):
        planned = work.other or work.runs[0].planned
        shown = stages.draw_last(planned.for_frames(range(1, frame + 1)), gpu)
        if work.other:
            work.reference = Reference(work.other.linked.graph.name, "pipeline", shown[output], work.encoding)
        else:
            work.reference = Reference(work.runs[0].name, "variant", shown[output], work.encoding)
        work.light, work.device = shown.get("radiance"), shown.device
    variants = [run.planned for run in work.runs]
    for batch in batches(variants, missing, most_bytes):
        work.executed += batch.pass_count
        if undrawn := any(number not in work.results for number in batch.numbers):
            for drawn in draw(gpu, variants, batch, frame):
                if drawn.number not in work.results:
                    _keep(work, drawn)
        for number, times in measure(gpu, variants, batch, work.frames, warm=undrawn):
            run, result = work.runs[number], replace(work.results[number], times=times)
            work.records[number] = settle(run, work.records[number], times, work.device, work.ledger)
            work.results[number] = result
            work.alone += result.pass_count
            progress(len(work.runs) - len(work.missing), len(work.runs))


def _keep(work: _Work, drawn: Drawn) -> None:
    """Compare a run with the reference, which it may be itself, and write down what is known before its times are."""
    run = work.runs[drawn.number]
    work.device = drawn.device
    if work.reference is None:
        work.reference = Reference(run.name, "variant", drawn.arrays[run.output], work.encoding)
        work.light = drawn.arrays.get("radiance")
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
    )
