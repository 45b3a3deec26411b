"""What a sweep would draw, and what of it is shared, before it does: nothing is drawn, nothing written."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rendergraph.compare.axes import typed
from rendergraph.compare.batches import MOST_BYTES, Batch, batches
from rendergraph.compare.divergence import passes
from rendergraph.compare.ledger import Ledger
from rendergraph.compare.prepare import Prepared
from rendergraph.compare.runs import Run, found_again
from rendergraph.compare.study import RESULTS, check_folder
from rendergraph.compare.timing import Times, enough


@dataclass(frozen=True, eq=False)
class Listing:
    """Attributes:
    prepared: the sweep.
    kept: numbers of the runs that are there already, drawn and measured.
    groups: the others, as they are drawn together.
    """

    prepared: Prepared
    kept: frozenset[int]
    groups: tuple[Batch, ...]

    @property
    def executed(self) -> int:
        """Passes that would be drawn."""
        return sum(group.pass_count for group in self.groups)

    def shared(self) -> dict[str, tuple[int, int]]:
        """For each pass: how often it would be drawn, and how often one by one, in order of execution."""
        drawn: dict[str, set[tuple[int, str]]] = {}
        alone: dict[str, int] = {}
        for at, group in enumerate(self.groups):
            for place, number in enumerate(group.numbers):
                for name in passes(self.prepared.runs[number].planned.plan):
                    drawn.setdefault(name, set()).add((at, group.merged.names[place][name]))
                    alone[name] = alone.get(name, 0) + 1
        return {name: (len(different), alone[name]) for name, different in drawn.items()}

    def group_of(self) -> dict[int, int]:
        """The number of a run to that of its group, from 1."""
        return {number: at for at, group in enumerate(self.groups, 1) for number in group.numbers}

    def as_json(self) -> dict[str, Any]:
        """The document of `sweep --list --json`."""
        group_of, shared = self.group_of(), self.shared()
        return {
            "runs": [
                {
                    "name": run.name,
                    "settings": {path: typed(value) for path, value in run.settings.items()},
                    "kept": number in self.kept,
                    "group": group_of.get(number),
                }
                for number, run in enumerate(self.prepared.runs)
            ],
            "groups": [
                {
                    "runs": len(group.numbers),
                    "passes": group.pass_count,
                    "passes_one_by_one": sum(self._alone(number) for number in group.numbers),
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

    def _alone(self, number: int) -> int:
        return len(passes(self.prepared.runs[number].planned.plan))


def listed(
    prepared: Prepared,
    out: Path | None = None,
    *,
    frames: int = 5,
    repeats: int = 1,
    resume: bool = False,
    pictures: bool = True,
    most_bytes: int = MOST_BYTES,
) -> Listing:
    """What `sweep` would draw.

    Args:
        prepared: the sweep.
        out: its folder; without one nothing is there yet.
        frames, repeats, resume, most_bytes: as for `sweep`.
        pictures: runs that are there have to have theirs.

    Raises:
        InputError: the folder has results already, or those of another study.
    """
    kept: set[int] = set()
    if out is not None:
        check_folder(out, prepared.study, resume=resume)
        records, _ = Ledger(out / RESULTS).read()
        lines = {record["key"]: record for record in records if "key" in record}
        kept = {
            number
            for number, run in enumerate(prepared.runs)
            if is_done(run, lines, frames=frames, repeats=repeats, pictures=pictures)
        }
    waiting = [number for number in range(len(prepared.runs)) if number not in kept]
    groups = batches([run.planned for run in prepared.runs], waiting, most_bytes)
    return Listing(prepared, frozenset(kept), tuple(groups))


def is_done(
    run: Run, lines: Mapping[str, dict[str, Any]], *, frames: int, repeats: int = 1, pictures: bool = True
) -> bool:
    """Whether a run is there, drawn and measured.

    Args:
        run: which.
        lines: of the results, by key.
        frames, repeats, pictures: as for `listed`.
    """
    record = found_again(run, lines, pictures=pictures)
    return record is not None and bool(record["frames"]) and enough(Times.from_json(record), frames, repeats)
