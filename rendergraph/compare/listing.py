"""What a sweep would render, and which passes its runs share: nothing is rendered, nothing is written."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rendergraph.compare.batches import Batch, batches
from rendergraph.compare.prepare import Prepared, Run, SweepOptions
from rendergraph.compare.results import passes, typed_settings
from rendergraph.compare.store import RESULTS, ResultsLog, check_folder, find_record


@dataclass(frozen=True, eq=False)
class Listing:
    """A prepared sweep, the numbers of the runs that are complete already, and batches of the others."""

    prepared: Prepared
    kept: frozenset[int]
    groups: tuple[Batch, ...]

    @property
    def executed(self) -> int:
        return sum(group.pass_count for group in self.groups)

    def shared(self) -> dict[str, tuple[int, int]]:
        """Return for each pass, in order of execution, how often it would run, and how often without sharing."""
        shared: dict[str, set[tuple[int, str]]] = {}
        alone: dict[str, int] = {}
        for at, group in enumerate(self.groups):
            for place, number in enumerate(group.numbers):
                for name in passes(self.prepared.runs[number].planned.plan):
                    shared.setdefault(name, set()).add((at, group.names[place][name]))
                    alone[name] = alone.get(name, 0) + 1
        return {name: (len(different), alone[name]) for name, different in shared.items()}

    def group_of(self) -> dict[int, int]:
        return {number: at for at, group in enumerate(self.groups, 1) for number in group.numbers}

    def as_json(self) -> dict[str, Any]:
        group_of, shared = self.group_of(), self.shared()
        return {
            "runs": [
                {
                    "name": run.name,
                    "settings": typed_settings(run.settings),
                    "kept": number in self.kept,
                    "group": group_of.get(number),
                }
                for number, run in enumerate(self.prepared.runs)
            ],
            "groups": [
                {
                    "runs": len(group.numbers),
                    "passes": group.pass_count,
                    "passes_one_by_one": sum(
                        len(passes(self.prepared.runs[number].planned.plan)) for number in group.numbers
                    ),
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


def list_sweep(
    prepared: Prepared, out: Path | None = None, options: SweepOptions = SweepOptions(), **settings: Any
) -> Listing:
    """Return what `sweep` would render into a folder; without one, no run is complete."""
    options = options.replace(**settings)
    numbers = range(len(prepared.runs))
    kept: frozenset[int] = frozenset()
    if out is not None:
        check_folder(out, prepared.study, resume=options.resume)
        lines, _ = ResultsLog(out / RESULTS).by_key()
        kept = frozenset(number for number in numbers if is_complete(prepared.runs[number], lines, options))
    waiting = [number for number in numbers if number not in kept]
    groups = batches([run.planned for run in prepared.runs], waiting, options.most_bytes)
    return Listing(prepared, kept, tuple(groups))


def is_complete(run: Run, lines: Mapping[str, dict[str, Any]], options: SweepOptions) -> bool:
    record = find_record(run, lines, pictures=options.kept == "all")
    return record is not None and bool(record.frames) and record.times.covers(options.frames, options.repeats)
