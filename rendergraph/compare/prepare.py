"""A sweep before anything is drawn: its runs, planned, and what they are measured against. Needs no GL."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rendergraph.compare.axes import Axes, Space, pipelines, run_name
from rendergraph.compare.reference import compared_output, measured_at, on_one_stage, read_picture, unique_names
from rendergraph.compare.runs import Run, key_of
from rendergraph.compare.sources import file_digest
from rendergraph.compare.study import study_of
from rendergraph.compare.values import Pixels, Reference
from rendergraph.metrics import Encoding

if TYPE_CHECKING:
    from rendergraph.session import Pipeline
    from rendergraph.session.values import Planned


@dataclass(frozen=True, eq=False)
class Prepared:
    """A sweep of which nothing is drawn yet: everything that can be wrong without GL has been looked at.

    Attributes:
        space: what is swept.
        runs: in the order of the product.
        encoding: of the output that is compared.
        picture: what they are measured against, where that is a file.
        other: likewise, where it is a pipeline of its own.
        study: what the folder is about.
        notes: what was changed to put all on one stage.
    """

    space: Space
    runs: tuple[Run, ...]
    encoding: Encoding
    picture: Reference | None
    other: Planned | None
    study: Mapping[str, Any]
    notes: tuple[str, ...]

    @property
    def modules(self) -> set[str]:
        """The modules of the node classes in use."""
        planned = [run.planned for run in self.runs] + ([self.other] if self.other else [])
        return {type(node.node).__module__ for each in planned for node in each.linked.graph.nodes}


def prepare(
    base: Pipeline,
    axes: Axes,
    out: Path,
    reference: Path | Pipeline | None = None,
    *,
    metric: str | None = None,
    frame: int = 1,
    only: Sequence[int] | None = None,
) -> Prepared:
    """The runs of a sweep, planned, with the arguments of `sweep`.

    Args:
        base, axes, out, reference, metric, frame: as for `sweep`.
        only: numbers of the runs, from 0, where these are but a part; they are called and measured as in the whole.

    Raises:
        InputError: as from `sweep`, of what is not the folder.
    """
    space = Space.of(axes)
    space.check()
    settings = space.runs()
    names = unique_names([run_name(run) for run in settings])
    base, reference = _measured(base, reference, metric)
    told = names[0]
    if reference is not None:
        told = str(reference) if isinstance(reference, Path) else reference.resolve().spec.name
    if only is not None:
        if reference is None and 0 not in only:
            (reference,) = pipelines(base, settings[:1])
        settings, names = [settings[number] for number in only], [names[number] for number in only]
    staged, notes, picture, output, encoding = _looked_at(base, settings, reference, metric)
    planned = [pipeline.check() for pipeline in staged]
    variants, other = planned[: len(settings)], planned[-1] if len(staged) > len(settings) else None
    against = file_digest(Path(str(reference))) if picture else key_of(other or variants[0], frame, "")
    runs = tuple(
        Run(name, run, variant, output, frame, key_of(variant, frame, against), out / name)
        for name, run, variant in zip(names, settings, variants, strict=True)
    )
    measured = Reference(told, "file", picture[0], encoding, output) if picture else None
    return Prepared(space, runs, encoding, measured, other, study_of(base, frame, told), tuple(notes))


def check_sweep(
    base: Pipeline, axes: Axes, reference: Path | Pipeline | None = None, metric: str | None = None
) -> list[Pipeline]:
    """The pipelines that `sweep` would draw; everything that can be wrong without GL is found.

    Raises:
        InputError: as from `sweep`.
    """
    base, reference = _measured(base, reference, metric)
    space = Space.of(axes)
    space.check()
    settings = space.runs()
    staged, *_ = _looked_at(base, settings, reference, metric)
    for pipeline in staged:
        pipeline.check()
    return staged[: len(settings)]


def _measured(
    base: Pipeline, reference: Path | Pipeline | None, metric: str | None
) -> tuple[Pipeline, Path | Pipeline | None]:
    """Both with the port that is measured."""
    own = reference if reference is None or isinstance(reference, Path) else measured_at(reference, metric)
    return measured_at(base, metric), own


def _looked_at(
    base: Pipeline, settings: Sequence[Mapping[str, str]], reference: Path | Pipeline | None, metric: str | None
) -> tuple[list[Pipeline], list[str], tuple[Pixels, Encoding] | None, str, Encoding]:
    """Runs on one stage and what was changed for that, a reference picture, and the compared output's name and kind."""
    variants = pipelines(base, settings)
    own = [] if reference is None or isinstance(reference, Path) else [reference]
    staged, notes = on_one_stage([*variants, *own])
    name = run_name(settings[0])
    picture = read_picture(reference, staged[0].link().graph.size, name) if isinstance(reference, Path) else None
    return (
        staged,
        notes,
        picture,
        *compared_output(staged, picture[1] if picture else None, measured=metric is not None),
    )
