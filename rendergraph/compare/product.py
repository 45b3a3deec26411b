"""The product of axes: every combination drawn, measured and kept; what is there already is not drawn again."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rendergraph.compare.axes import Axes, Space, typed
from rendergraph.compare.batches import MOST_BYTES, MOST_RUNS
from rendergraph.compare.front import pareto
from rendergraph.compare.goals import Search
from rendergraph.compare.prepare import prepare
from rendergraph.compare.reference import named_reference, scene_name
from rendergraph.compare.runs import RUN, Failure
from rendergraph.compare.study import begin, claimed, open_folder
from rendergraph.compare.values import Comparison, Reference
from rendergraph.compare.work import Events, Pictures, Work
from rendergraph.farm.bundle import make_bundle
from rendergraph.farm.executors import ExecutorChoice, make_executor
from rendergraph.session.pipeline import Pipeline, loaded
from rendergraph.session.progress import Progress, shown
from rendergraph.stamps import track_reads

if TYPE_CHECKING:
    from rendergraph.session.gpu import Gpu


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


def sweep(
    base: Pipeline | str | Path,
    axes: Axes,
    out: Path | str,
    reference: Path | Pipeline | str | None = None,
    *,
    metric: str | None = None,
    frames: int = 5,
    repeats: int = 1,
    frame: int = 1,
    kept: Pictures = "all",
    best: Sequence[str] = ("flip", "ms"),
    only: Sequence[int] | None = None,
    resume: bool = False,
    most_bytes: int = MOST_BYTES,
    session: Gpu | None = None,
    device: int | None = None,
    progress: Progress | bool | None = None,
    executor: ExecutorChoice = None,
    devices: Sequence[int] = (),
    timeout: float | None = None,
    events: Events | None = None,
) -> Sweep:
    """Draw every combination of the axes' values into a folder each, and measure it.

    A run's picture and figures are kept as soon as it is drawn, its times when they are known: what is interrupted
    loses little. A run that cannot be drawn gets a line with the reason, and the others go on.

    Args:
        base: what the axes change; a shipped name or a file, too.
        axes: paths with values or ranges: `{"ao.samples": [8, 16], "ao.radius": "log:0.1:1:5"}`; a `Space` of them for
            samples, or axes that go together.
        out: the folder; `results.jsonl` in it grows by a line a run that has been measured.
        reference: a picture or a pipeline that runs are measured against, also by its name; the first run by default.
        metric: the port whose texture is measured in place of the picture: `ao.occlusion`.
        frames: how many frames are measured, at least; runs that are there and have fewer are measured again.
        repeats: how often they are measured, each time anew: the spread of the medians says what a time is worth.
        frame: number of the frame whose pictures are kept.
        kept: which pictures stay: `all`, or `best`, those than which no other so far is better, and that of the run
            that others are measured against.
        best: what the best are least in, as for `search`.
        only: numbers of the runs, from 0, where these are but a part; they are called and measured as in the whole.
        resume: keep runs that the folder has already.
        most_bytes: of textures that variants drawn together may take.
        session: where to draw; a private one by default.
        device: GL device number where no session is given.
        progress: told how many runs are done, and of how many; True shows a bar on stderr.
        executor: who draws: `serial`, `processes`, `processes:4`, `dask`, `dask://host:8786`, a Dask `Client`, or an
            `Executor`; this process by default. No picture and no figure depends on it, but times do.
        devices: GL device numbers that processes share out.
        timeout: seconds that a worker may say nothing before it is ended and its runs are drawn by another.
        events: told what happens on the way, worker by worker, as plain mappings.

    Raises:
        InputError: an axis names nothing, a value does not fit, the folder has results already, or of another study, or
            another sweep is at work in it; or what runs are measured against cannot be drawn.
        RenderError: it failed while writing, or while drawing what runs are measured against.
        DeviceError: there is no usable GL device.
    """
    base, out, reference = loaded(base), Path(out), named_reference(reference)
    with track_reads() as files:
        planned = prepare(base, axes, out, reference, metric=metric, frame=frame, only=only)
    runs = planned.runs
    with claimed(out):
        ledger, lines, torn = open_folder(out, planned.study, resume=resume)
        work = Work(planned, ledger, lines, frame, frames, repeats, kept, most_bytes, events, best)
        resumed = sum(map(work.is_done, range(len(runs))))
        timed = len(work.results) - resumed
        redrawn = sum(number not in work.results and (run.folder / RUN).exists() for number, run in enumerate(runs))
        if work.missing or planned.other:
            with (
                make_executor(
                    executor,
                    session,
                    device,
                    tasks=-(-len(work.missing) // MOST_RUNS),
                    devices=devices,
                    timeout=timeout,
                    travels=base.catalog is None,
                ) as farm,
                shown(progress, "runs") as tell,
            ):
                farm.upload_inputs(lambda: make_bundle(files, base.selection.plugins, planned.modules))
                begin(out, planned.study)
                work.draw(farm, tell)
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
