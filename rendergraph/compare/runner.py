"""Runners: they send tasks to an executor and collect the results, in memory or in a sweep's folder."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from rendergraph.compare import store, tasks
from rendergraph.compare.batches import MOST_RUNS, Batch, batches, group_similar
from rendergraph.compare.fingerprint import run_key
from rendergraph.compare.prepare import Prepared, Run, SweepOptions, Twin
from rendergraph.compare.results import (
    Comparison,
    Reference,
    Result,
    objective_values,
    pareto_front,
    passes,
    smallest_error,
    typed_settings,
)
from rendergraph.compare.truth import TruthProgress, TruthTask, TwinTask, noise_note, representatives
from rendergraph.errors import Problem, RendergraphError
from rendergraph.farm import Executor, Handle, TaskFailed, TaskFinished, TaskOutput, TaskRetried
from rendergraph.session.progress import report_progress


class Runner:
    """Compares the runs of a comparison in memory; a failed run ends it.

    Results are stored by the run's number, and may not have times yet. The reference may be one of the results.
    """

    def __init__(self, prepared: Prepared, options: SweepOptions) -> None:
        self.prepared, self.options = prepared, options
        self.results: dict[int, Result] = {}
        self.reference = prepared.reference if isinstance(prepared.reference, Reference) else None
        self.device: Mapping[str, object] = {}
        self.warnings: list[Problem] = []
        self.twins: dict[int, list[Twin]] = {}
        self._handle: Handle | None = None
        self._waiting: list[list[int]] = []
        self._outputs = 0

    @property
    def missing(self) -> list[int]:
        return [number for number in range(len(self.prepared.runs)) if number not in self.results]

    def execute(self, farm: Executor, progress: Callable[[int, int], None]) -> None:
        self._waiting = self._groups(self.missing, farm.workers)
        if self.prepared.is_truth:
            self.reference = self._draw_truth(farm, *self.prepared.references)
        if self.reference is not None:
            self._distribute(farm, self.reference)
        elif self.prepared.references or 0 in self.results:
            base = self.prepared.base.for_task()
            farm.submit(tasks.ReferenceTask(base.name, base, self.prepared.encoding))
        elif self._waiting:
            first = self._waiting.pop(0)
            if farm.workers > 1 and len(first) > 1:  # all others wait for the first run
                self._waiting.insert(0, first[1:])
                first = first[:1]
            self._submit(farm, first)
        for event in farm.events():
            if isinstance(event, TaskOutput):
                self._take(farm, event.value, event.worker)
            else:
                self._task_event(farm, event)
            progress(*self._progress())

    def _draw_truth(self, farm: Executor, truth: Run) -> Reference:
        """Render ground truth until it is accurate enough for all runs, and return it as a reference."""
        found: Reference | None = None
        farm.submit(
            TruthTask(
                name=truth.name,
                key=run_key(truth.planned, truth.frame, ""),
                truth=truth.for_task(),
                base=self.prepared.runs[0].for_task(),
                runs=tuple(run.for_task() for run in representatives(self.prepared.runs)),
                encoding=self.prepared.encoding,
                limits=self.options.limits,
            )
        )
        at: TruthProgress | None = None
        with report_progress(self.options.progress is True, lambda: f"% of {truth.name}, {at}") as tell:
            for event in farm.events():
                if not isinstance(event, TaskOutput):
                    self._task_event(farm, event)
                elif isinstance(event.value, tasks.ReferenceResult):
                    found, self.device = event.value.reference, event.value.origin["device"]
                elif isinstance(event.value, TruthProgress):
                    at = event.value
                    tell(round(100 * at.part), 100)
        assert found is not None  # a task that fails raises
        return found

    def comparison(self, *, warnings: Sequence[Problem]) -> Comparison:
        assert self.reference is not None
        base, linked = self.prepared.base, self.prepared.runs[0].planned.linked
        results = tuple(self._with_errors(number) for number in sorted(self.results))
        noisy = noise_note(self.reference, smallest_error(results), self.options.limits)
        more = [problem for result in results for problem in result.warnings]
        return Comparison(
            results=results,
            reference=self.reference,
            base=(base.name, base.planned.linked.graph),
            scene=linked.spec.scene_name or linked.scene.name,
            camera=linked.selection.camera,
            size=linked.graph.size,
            frame=self.options.frame,
            metric=self.options.metric,
            device=self.device,
            notes=(*self.prepared.notes, *([noisy] if noisy else [])),
            warnings=tuple(dict.fromkeys([*self.warnings, *warnings, *more])),
        )

    def _with_errors(self, number: int) -> Result:
        """Return a result with the errors that remain with each twin, the smallest first."""
        result, errors = self.results[number], []
        for error in (twin.error for twin in self.twins.get(number, ())):
            left = error.relative_mse
            reduction = 1 - left / result.relative_mse if left is not None and result.relative_mse else None
            errors.append(replace(error, reduction=reduction))
        errors.sort(key=lambda error: math.inf if error.relative_mse is None else error.relative_mse)
        return replace(result, error_by=tuple(errors))

    def _groups(self, numbers: Sequence[int], workers: int) -> list[list[int]]:
        """Return the runs of each task: in this process all of them, to measure them in turns."""
        return [list(numbers)] if workers == 1 else [[number] for number in numbers]

    def _progress(self) -> tuple[int, int]:
        """Return the number of outputs so far, and their total: two for each run and one for each twin."""
        total = 2 * len(self.prepared.runs) + len(self.prepared.twins)
        return min(self._outputs, total), total

    def _submit(self, farm: Executor, numbers: Sequence[int]) -> None:
        farm.submit(tasks.ComparisonTask(**self._work(numbers), base=self.prepared.base.for_task()))

    def _work(self, numbers: Sequence[int]) -> dict[str, Any]:
        runs, options = self.prepared.runs, self.options
        first = runs[numbers[0]].name
        return {
            "name": f"{first} and {len(numbers) - 1} more" if len(numbers) > 1 else first,
            "needs": (self._handle,) if self._handle else (),
            "runs": tuple(runs[n].for_task(is_rendered=n in self.results) for n in numbers),
            "encoding": self.prepared.encoding,
            **{name: getattr(options, name) for name in ("frames", "repeats", "most_bytes")},
        }

    def _distribute(self, farm: Executor, reference: Reference) -> None:
        self.reference = reference
        self._handle = farm.put(reference)
        waiting, self._waiting = self._waiting, []
        for numbers in waiting:
            self._submit(farm, numbers)
        for twin in self.prepared.twins:
            own = replace(twin, run=twin.run.for_task())
            farm.submit(TwinTask(name=own.run.name, needs=(self._handle,), twin=own))

    def _take(self, farm: Executor, output: Any, worker: str) -> None:
        """Store an output of a task; a task that was restarted yields some of them twice."""
        if isinstance(output, tasks.ReferenceResult):
            self.device = output.origin["device"]
            if self.reference is None:
                self._distribute(farm, output.reference)
            return
        self._outputs += 1
        if isinstance(output, tasks.RenderedResult):
            self.warnings += output.warnings
            if output.number not in self.results:
                self._rendered(output)
        elif isinstance(output, tasks.TimingResult):
            self._timed(output, worker)
        elif isinstance(output, Twin):
            self.twins.setdefault(output.number, []).append(output)

    def _rendered(self, output: tasks.RenderedResult) -> None:
        run = self.prepared.runs[output.number]
        self.device = output.origin["device"]
        self.results[output.number] = Result.of(run.name, run.planned, settings=run.settings, **output.measured)

    def _timed(self, output: tasks.TimingResult, worker: str) -> None:
        self.results[output.number] = replace(self.results[output.number], times=output.times)

    def _task_event(self, farm: Executor, event: TaskFinished | TaskRetried | TaskFailed) -> None:
        if isinstance(event, TaskFailed) and isinstance(event.task, TwinTask):
            self.twins.setdefault(event.task.twin.number, []).append(event.task.twin)
            self.warnings += [problem.as_warning() for problem in event.problems]
        elif isinstance(event, TaskFailed):
            raise type(event.error)(event.error.problems) from event.error


class SweepRunner(Runner):
    """Renders the runs of a sweep into a folder; a failed run becomes a line with the reason.

    Records and failures are stored by the run's number. `executed` counts executed passes, `alone` those that the
    runs would need without sharing.
    """

    def __init__(self, prepared: Prepared, options: SweepOptions, folder: store.SweepFolder) -> None:
        super().__init__(prepared, options)
        self.folder = folder
        self.records: dict[int, store.RunRecord] = {}
        self.failures: dict[int, store.Failure] = {}
        self.executed = self.alone = 0
        self._begun, self._completed = time.monotonic(), 0
        for number, run in enumerate(prepared.runs):
            record = store.find_record(run, folder.lines, pictures=options.kept == "all")
            if record is None:
                continue
            if record.frames and run.key not in folder.lines:  # its line was lost
                folder.append(record.as_json())
            self.results[number], self.records[number] = store.restored_result(run, record, prepared.encoding), record
            self.device = record.device
        self._drop_pictures(self._beaten())

    @property
    def missing(self) -> list[int]:
        numbers = range(len(self.prepared.runs))
        return [number for number in numbers if number not in self.failures and not self.is_complete(number)]

    def is_complete(self, number: int) -> bool:
        return number in self.results and self.results[number].times.covers(self.options.frames, self.options.repeats)

    def _groups(self, numbers: Sequence[int], workers: int) -> list[list[int]]:
        """Group runs that share most of their passes; groups are small enough that each worker gets at least two."""
        most = MOST_RUNS if workers == 1 else max(1, min(MOST_RUNS, -(-len(numbers) // (2 * workers))))
        return group_similar([run.planned for run in self.prepared.runs], numbers, most)

    def _progress(self) -> tuple[int, int]:
        total = len(self.prepared.runs)
        return total - len(self.missing), total

    def _submit(self, farm: Executor, numbers: Sequence[int]) -> None:
        farm.submit(tasks.VariantTask(**self._work(numbers)))

    def _take(self, farm: Executor, output: Any, worker: str) -> None:
        if isinstance(output, tasks.PassCount):
            self.executed += output.count
        elif isinstance(output, tasks.TaskError):
            self._fail(output.number, output.error)
            self._report("run", worker, run=self.prepared.runs[output.number].name, failed=True)
        else:
            super()._take(farm, output, worker)

    def _rendered(self, output: tasks.RenderedResult) -> None:
        super()._rendered(output)
        run, result = self.prepared.runs[output.number], self.results[output.number]
        self.records[output.number] = self.folder.keep(run, result, output.picture, output.origin)

    def _timed(self, output: tasks.TimingResult, worker: str) -> None:
        number = output.number
        if self.is_complete(number):
            return
        super()._timed(output, worker)
        run, record, beaten = self.prepared.runs[number], self.records[number], self._beaten()
        record = record.without_picture() if number in beaten else record
        self.records[number] = record.timed(output.times, output.origin)
        self.folder.write(run, self.records[number])
        self._drop_pictures(beaten)
        self.alone += self.results[number].pass_count
        self._completed += 1
        self._report("run", worker, run=run.name, failed=False)

    def _beaten(self) -> set[int]:
        """Return the runs whose pictures are dropped: they are not on the Pareto front.

        A run that has left the front never returns to it, so only runs with a picture are compared.
        """
        if self.options.kept == "all":
            return set()
        rendered = {n: own for n, own in self.results.items() if own.times.frames and own.pixels is not None}
        kept = set(pareto_front({n: objective_values(own, self.options.best) for n, own in rendered.items()}))
        if not self.prepared.references and (self.reference is None or self.reference.kind == "variant"):
            kept.add(0)
        return set(rendered) - kept

    def _drop_pictures(self, numbers: set[int]) -> None:
        for number in numbers:
            if self.records[number].picture is not None:
                self.records[number] = self.records[number].without_picture()
                self.folder.write(self.prepared.runs[number], self.records[number])
            self.results[number] = replace(self.results[number], pixels=None, flip_map=None)

    def _task_event(self, farm: Executor, event: TaskFinished | TaskRetried | TaskFailed) -> None:
        name = event.task.name
        if isinstance(event, TaskFinished):
            self._report("finished", event.worker, task=name, seconds=round(event.seconds, 3))
        elif isinstance(event, TaskRetried):
            self._report("lost", event.worker, task=name, reason=_reason(event.problems))
        else:
            self._task_failed(farm, event)

    def _task_failed(self, farm: Executor, event: TaskFailed) -> None:
        """Retry each run of a failed task alone; a task of one run is not retried."""
        if not isinstance(event.task, tasks.VariantTask):
            raise event.error
        missing = set(self.missing)
        left = [run.number for run in event.task.runs if run.number in missing]
        if self.reference is None and (not event.lost or len(event.task.runs) == 1):
            raise type(event.error)(event.error.problems) from event.error
        self._report("failed", event.worker, task=event.task.name, reason=_reason(event.problems))
        for number in left:
            if len(event.task.runs) > 1:
                self._submit(farm, [number])
            else:
                self._fail(number, event.error)

    def _fail(self, number: int, error: RendergraphError) -> None:
        self.failures[number] = self.folder.fail(self.prepared.runs[number], error.problems)
        self._completed += 1

    def _report(self, event: str, worker: str, **more: Any) -> None:
        if self.options.events is None:
            return
        seconds, left, total = time.monotonic() - self._begun, len(self.missing), len(self.prepared.runs)
        rate = self._completed / seconds if seconds > 0 else 0.0
        speed = {"runs_per_second": round(rate, 3), "seconds_left": round(left / rate, 1) if rate else None}
        self.options.events({"event": event, "worker": worker, **more, "done": total - left, "of": total, **speed})


def _reason(problems: Sequence[Problem]) -> str:
    return "; ".join(str(problem).splitlines()[0] for problem in problems)


@dataclass(frozen=True, eq=False)
class Listing:
    """A prepared sweep, the numbers of the runs that are already complete, and batches of the others."""

    prepared: Prepared
    kept: frozenset[int]
    groups: tuple[Batch, ...]

    @property
    def executed(self) -> int:
        return sum(group.pass_count for group in self.groups)

    def shared(self) -> dict[str, tuple[int, int]]:
        """Return how often each pass would run, with and without sharing, in order of execution."""
        drawn: dict[str, list[tuple[int, str]]] = {}
        for at, group in enumerate(self.groups):
            for number, names in zip(group.numbers, group.names, strict=True):
                for name in passes(self.prepared.runs[number].planned.plan):
                    drawn.setdefault(name, []).append((at, names[name]))
        return {name: (len(set(each)), len(each)) for name, each in drawn.items()}

    def group_of(self) -> dict[int, int]:
        return {number: at for at, group in enumerate(self.groups, 1) for number in group.numbers}

    def as_json(self) -> dict[str, Any]:
        group_of, shared, runs = self.group_of(), self.shared(), self.prepared.runs
        return {
            "runs": [
                {
                    "name": run.name,
                    "settings": typed_settings(run.settings),
                    "kept": n in self.kept,
                    "group": group_of.get(n),
                }
                for n, run in enumerate(runs)
            ],
            "groups": [
                {
                    "runs": len(group.numbers),
                    "passes": group.pass_count,
                    "passes_one_by_one": sum(len(passes(runs[number].planned.plan)) for number in group.numbers),
                    "allocated_bytes": group.planned.plan.memory.allocated_bytes,
                }
                for group in self.groups
            ],
            "passes": [{"node": name, "drawn": drawn, "one_by_one": alone} for name, (drawn, alone) in shared.items()],
            "executed_passes": self.executed,
            "passes_one_by_one": sum(alone for _, alone in shared.values()),
            "kept": len(self.kept),
            "reference": self.prepared.study["reference"],
            "notes": list(self.prepared.notes),
        }


def list_sweep(prepared: Prepared, out: Path | None = None, options: SweepOptions = SweepOptions()) -> Listing:
    """Return what `sweep` would render into a folder; without one, no run is complete."""
    kept = frozenset[int]()
    if out is not None:
        store.check_folder(out, prepared.study, resume=options.resume)
        lines = store.SweepFolder.read(out).lines
        kept = frozenset(number for number, run in enumerate(prepared.runs) if is_complete(run, lines, options))
    waiting = [number for number in range(len(prepared.runs)) if number not in kept]
    groups = batches([run.planned for run in prepared.runs], waiting, options.most_bytes)
    return Listing(prepared, kept, tuple(groups))


def is_complete(run: Run, lines: Mapping[str, dict[str, Any]], options: SweepOptions) -> bool:
    record = store.find_record(run, lines, pictures=options.kept == "all")
    return record is not None and bool(record.frames) and record.times.covers(options.frames, options.repeats)
