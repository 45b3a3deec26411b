"""A sweep under way: tasks go out, what comes back is kept at once, and what is lost is tried again."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Literal, TypeAlias

from rendergraph.compare.batches import MOST_BYTES, MOST_RUNS, cuts
from rendergraph.compare.divergence import passes
from rendergraph.compare.goals import front_of, values_of
from rendergraph.compare.groups import Against, First, Group, Passes, Pictured, Timed, Unable, Variant
from rendergraph.compare.ledger import Ledger
from rendergraph.compare.prepare import Prepared
from rendergraph.compare.runs import Failure, drop, found_again, give_up, keep, restored, settle, without_picture
from rendergraph.compare.timing import NO_TIMES, enough
from rendergraph.compare.values import Reference, Result
from rendergraph.errors import RendergraphError
from rendergraph.farm import Executor, Handle, TaskFailed, TaskFinished, TaskOutput, TaskRetried

Pictures: TypeAlias = Literal["all", "best"]
"""Which pictures of a sweep stay."""
Events: TypeAlias = Callable[[Mapping[str, Any]], None]
"""Told what happens while work is done: plain values, `event` first."""


@dataclass(eq=False)
class Work:
    """What there is of a sweep, and what is not.

    Attributes:
        prepared: its runs.
        ledger: where results go; nobody else writes there.
        lines: those that it had, by key.
        frame: whose pictures are compared.
        frames, repeats: how many are to be measured, and how often.
        pictures: which stay: `all`, or `best`.
        most_bytes: of textures that variants drawn together may take.
        best: what makes a picture one of the best.
        results, records: what is there, by the run's number; results may lack times.
        failures: what cannot be drawn, likewise.
        device: what drew last; devices: everything that did, by renderer.
        reference: what is measured against, once it is there.
        executed: passes that were drawn; alone: those that would have been one by one.
        retries: how often a group was begun again.
    """

    prepared: Prepared
    ledger: Ledger
    lines: Mapping[str, dict[str, Any]]
    frame: int
    frames: int
    repeats: int = 1
    pictures: Pictures = "all"
    most_bytes: int = MOST_BYTES
    events: Events | None = None
    best: Sequence[str] = ("flip", "ms")
    results: dict[int, Result] = field(default_factory=dict)
    records: dict[int, Mapping[str, Any]] = field(default_factory=dict)
    failures: dict[int, Failure] = field(default_factory=dict)
    device: Mapping[str, object] = field(default_factory=dict)
    reference: Reference | None = None
    executed: int = 0
    alone: int = 0
    retries: int = 0
    _against: Handle | None = None
    _waiting: list[list[int]] = field(default_factory=list)
    _begun: float = field(default_factory=time.monotonic)
    _settled: int = 0

    def __post_init__(self) -> None:
        self.reference = self.prepared.picture
        runs = self.prepared.runs
        for number, run in enumerate(runs):  # a run whose line was lost gets it again
            if record := found_again(run, self.lines, pictures=self.pictures == "all"):
                if record["frames"] and run.key not in self.lines:
                    self.ledger.append(record)
                self.results[number], self.records[number] = restored(run, record, self.prepared.encoding), record
                self.device = record["device"]
        self._drop(self._beaten())

    @property
    def missing(self) -> list[int]:
        """Numbers of the runs that have no result, or one of fewer frames than asked for; failed ones are not asked."""
        numbers = range(len(self.prepared.runs))
        return [number for number in numbers if number not in self.failures and not self.is_done(number)]

    def is_done(self, number: int) -> bool:
        """Whether a run is drawn and measured."""
        return number in self.results and enough(self.results[number].times, self.frames, self.repeats)

    def draw(self, farm: Executor, progress: Callable[[int, int], None]) -> None:
        """Draw, measure and keep the runs that are not there.

        Raises:
            InputError: what runs are measured against cannot be drawn.
            RenderError: likewise, the disk does not take it, or the cluster is gone.
            DeviceError: there is no usable GL device.
        """
        self._begun = time.monotonic()
        missing, others = self.missing, self.prepared.other
        self._waiting = self._cut(missing, farm.workers)
        if self.reference is not None:
            self._measured_against(
                farm, Against(self.reference.name, self.reference.encoding, self.reference.pixels, None)
            )
        elif others is not None or 0 in self.results:
            farm.submit(First(self._first(), self.frame, self.prepared.encoding))
        elif self._waiting:
            group = self._waiting.pop(0)
            if farm.workers > 1 and len(group) > 1:  # all others wait for the first run
                self._waiting.insert(0, [number for number in group if number != missing[0]])
                group = [missing[0]]
            self._submit(farm, group)
        for event in farm.events():
            if isinstance(event, TaskOutput):
                self._take(farm, event.value, event.worker)
            elif isinstance(event, TaskRetried):
                self.retries += 1
                self._say("lost", event.worker, task=event.task.name, reason=_text(event.problems))
            elif isinstance(event, TaskFailed):
                self._failed(farm, event)
            else:
                assert isinstance(event, TaskFinished)
                self._say("finished", event.worker, task=event.task.name, seconds=round(event.seconds, 3))
            progress(len(self.prepared.runs) - len(self.missing), len(self.prepared.runs))

    def _cut(self, numbers: Sequence[int], workers: int) -> list[list[int]]:
        """Groups of runs, those together that share most; small enough that each worker gets two at least."""
        most = MOST_RUNS if workers == 1 else max(1, min(MOST_RUNS, -(-len(numbers) // (2 * workers))))
        return cuts([run.planned for run in self.prepared.runs], numbers, most)

    def _first(self) -> Variant:
        """What runs are measured against, where that is to be drawn by itself."""
        run, other = self.prepared.runs[0], self.prepared.other
        if other is not None:
            run = replace(run, name=other.linked.graph.name, planned=other)
        return Variant.of(run, -1, drawn=False)

    def _submit(self, farm: Executor, numbers: Sequence[int]) -> None:
        variants = tuple(
            Variant.of(self.prepared.runs[number], number, drawn=number in self.results) for number in numbers
        )
        encoding = self.prepared.encoding
        farm.submit(Group(variants, self._against, self.frame, self.frames, self.repeats, encoding, self.most_bytes))

    def _measured_against(self, farm: Executor, against: Against) -> None:
        """From now on there is a reference: everything that waits for it goes out."""
        self._against = farm.put(against)
        waiting, self._waiting = self._waiting, []
        for numbers in waiting:
            self._submit(farm, numbers)

    def _take(self, farm: Executor, told: Any, worker: str) -> None:
        """Keep what a worker has handed out."""
        if isinstance(told, Passes):
            self.executed += told.count
        elif isinstance(told, Unable):
            self._unable(told.number, told.error)
            self._say("run", worker, run=self.prepared.runs[told.number].name, failed=True)
        elif isinstance(told, Pictured):
            if told.number not in self.results:  # else it was drawn by a worker that was lost afterwards
                self._keep(told)
            if self.reference is None:
                run = self.prepared.runs[told.number]
                encoding = self.prepared.encoding
                self.reference = Reference(run.name, "variant", told.pixels, encoding, run.output)
                self._measured_against(farm, Against(run.name, encoding, told.pixels, told.light))
        elif isinstance(told, Timed):
            if not self.is_done(told.number):
                self._settle(told)
                self._say("run", worker, run=self.prepared.runs[told.number].name, failed=False)
        else:
            against, self.device = told
            output, own = self.prepared.runs[0].output, self.prepared.other is None
            self.reference = Reference(
                against.name, "variant" if own else "pipeline", against.pixels, against.encoding, output
            )
            self._measured_against(farm, against)

    def _keep(self, told: Pictured) -> None:
        run = self.prepared.runs[told.number]
        linked, plan = run.planned.linked, run.planned.plan
        self.device = told.device
        self.results[told.number] = Result(
            name=run.name,
            source=linked.selection.source,
            pixels=told.pixels,
            encoding=self.prepared.encoding,
            metrics=told.found,
            times=NO_TIMES,
            memory=plan.memory.as_json(),
            pass_count=len(passes(plan)),
            settings=run.settings,
            radiance_rmse=told.radiance_rmse,
            flip_map=told.flip_map,
            graph=linked.graph,
            plan=plan,
            not_finite=told.not_finite,
            figures=told.figures,
        )
        self.records[told.number] = keep(run, self.results[told.number], told.picture, told.device, told.machine)

    def _settle(self, told: Timed) -> None:
        number, run, record = told.number, self.prepared.runs[told.number], self.records[told.number]
        self.results[number] = replace(self.results[number], times=told.times)
        beaten = self._beaten()
        record = without_picture(record) if number in beaten else record
        self.records[number] = settle(run, record, told.times, told.device, told.machine, self.ledger)
        self._drop(beaten)
        self.alone += self.results[number].pass_count
        self._settled += 1

    def _beaten(self) -> set[int]:
        """Runs whose pictures go: another is as good in everything that counts, and better in something.

        Once beaten is always beaten: only those are asked that still have theirs.
        """
        if self.pictures == "all":
            return set()
        shown = [result for result in self.results.values() if result.times.frames and result.pixels is not None]
        best = set(front_of({result.name: own for result in shown if (own := values_of(result, self.best))}))
        if self.prepared.other is None and (self.reference is None or self.reference.kind == "variant"):
            best.add(self.prepared.runs[0].name)
        names = {result.name for result in shown} - best
        return {number for number, result in self.results.items() if result.name in names}

    def _drop(self, beaten: set[int]) -> None:
        """Let pictures go, from the folder and from memory."""
        for number in beaten:
            if self.records[number]["picture"] is not None:
                self.records[number] = drop(self.prepared.runs[number], self.records[number], self.ledger)
            if self.results[number].pixels is not None:
                self.results[number] = replace(self.results[number], pixels=None, flip_map=None)

    def _failed(self, farm: Executor, event: TaskFailed) -> None:
        """A task came to nothing: its runs are tried each alone, and a run that was alone is given up."""
        if not isinstance(event.task, Group):
            raise event.error
        left = [variant.number for variant in event.task.variants if variant.number in self._left]
        if self.reference is None and (not event.lost or len(event.task.variants) == 1):
            raise type(event.error)(event.error.problems) from event.error
        self._say("failed", event.worker, task=event.task.name, reason=_text(event.problems))
        if len(event.task.variants) > 1:
            for number in left:
                self._submit(farm, [number])
        else:
            for number in left:
                self._unable(number, event.error)

    @property
    def _left(self) -> frozenset[int]:
        return frozenset(self.missing)

    def _unable(self, number: int, error: RendergraphError) -> None:
        run = self.prepared.runs[number]
        self.failures[number] = give_up(run, error.problems, self.ledger, self.lines)
        self._settled += 1

    def _say(self, event: str, worker: str, **more: Any) -> None:
        """Tell what happened, how fast it goes and what is left."""
        if self.events is None:
            return
        seconds, left = time.monotonic() - self._begun, len(self.missing)
        rate = self._settled / seconds if seconds > 0 else 0.0
        self.events(
            {
                "event": event,
                "worker": worker,
                **more,
                "done": len(self.prepared.runs) - left,
                "of": len(self.prepared.runs),
                "runs_per_second": round(rate, 3),
                "seconds_left": round(left / rate, 1) if rate else None,
            }
        )


def _text(problems: Sequence[Any]) -> str:
    return "; ".join(str(problem).splitlines()[0] for problem in problems)
