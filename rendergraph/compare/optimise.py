"""Axes searched in place of swept: an optimiser asks for a few runs at a time, and learns from what they give.

The optimiser is Optuna's tree-structured Parzen estimator (Bergstra et al. 2011), of several objectives too (Ozaki et
al. 2020). It keeps nothing itself: a search that goes on asks the same questions again, and what is in the folder
answers them, so that one that was interrupted ends where it would have ended.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from rendergraph.compare.axes import Axes, Axis, Space, typed
from rendergraph.compare.goals import OBJECTIVES, Search, front_of, values_of
from rendergraph.compare.prepare import check_sweep
from rendergraph.compare.product import Sweep, sweep
from rendergraph.compare.values import Result
from rendergraph.errors import InputError, Problem, suggestion
from rendergraph.farm.executors import ExecutorChoice, make_executor
from rendergraph.installed import require
from rendergraph.session.progress import Progress, shown
from rendergraph.session.wanted import figures

if TYPE_CHECKING:
    from rendergraph.session import Pipeline
    from rendergraph.session.gpu import Gpu

AT_ONCE = 8
"""Runs that are asked for before any of them has answered: they are drawn together."""
MOST_AGAIN = 50
"""Runs in a row that are known already, after which there are taken to be no others."""


@dataclass(frozen=True)
class _Knob:
    """A group of axes that go together, as the optimiser sees them: one place, or one of several values."""

    axes: tuple[Axis, ...]

    @property
    def name(self) -> str:
        return self.axes[0].path

    def distribution(self) -> Any:
        """A place 0…1 of spans; of numbers in order the next one is near, other values are as far from each other."""
        from optuna import distributions  # an extra

        values = self.axes[0].values
        if not values:
            return distributions.FloatDistribution(0.0, 1.0)
        numbers = [typed(value) for value in values]
        is_number = all(isinstance(value, int | float) and not isinstance(value, bool) for value in numbers)
        if is_number and numbers in (sorted(numbers), sorted(numbers, reverse=True)):
            return distributions.IntDistribution(0, len(values) - 1)
        return distributions.CategoricalDistribution(tuple(range(len(values))))

    def settings(self, given: float) -> dict[str, str]:
        """Path to value."""
        if self.axes[0].span is None:
            return {axis.path: axis.values[int(given)] for axis in self.axes}
        place = (given, max(0.0, given - 1e-4), min(1.0, given + 1e-4))
        return {axis.path: axis.at(place) for axis in self.axes}


def search(
    base: Pipeline,
    axes: Axes,
    out: Path,
    reference: Path | Pipeline | None,
    *,
    minimise: Sequence[str],
    budget: int = 50,
    seed: int = 0,
    resume: bool = False,
    session: Gpu | None = None,
    device: int | None = None,
    executor: ExecutorChoice = None,
    devices: Sequence[int] = (),
    timeout: float | None = None,
    progress: Progress | bool | None = None,
    **options: Any,
) -> Sweep:
    """Look for the settings that make one thing, or several at once, as small as can be.

    Args:
        base, axes, out, reference, session, device, progress: as for `sweep`; spans are as good as values.
        executor, devices, timeout: likewise; it stays from one batch of runs to the next.
        minimise: `flip`, `rmse`, `radiance_rmse`, `ms` (the time of a frame), `bytes` (of textures), a metric that a
            plugin adds, or a figure of the pipeline; of several the whole front is looked for.
        budget: how many runs are drawn; fewer where the axes have no more.
        seed: of the optimiser: the same one asks the same of the same answers.
        resume: keep runs that the folder has already, and go on from there, also with a larger budget.
        options: what else `sweep` takes.

    Raises:
        InputError: as from `sweep`; or there is no reference, or nothing of such a name to be minimised.
        UsageError: Optuna is not installed.
        RenderError, DeviceError: as from `sweep`.
    """
    require("--minimise", "search", "optuna")
    space = Space.of(axes)
    check_search(base, space, reference, minimise, options.get("metric"))
    knobs = {knob.name: knob for knob in map(_Knob, space.groups)}
    trials: list[tuple[dict[str, str], Result | None]] = []
    who = make_executor(
        executor, session, device, tasks=1, devices=devices, timeout=timeout, travels=base.catalog is None
    )  # a few runs at a time are one group: this process, unless somebody is named
    with who as farm, shown(progress, "runs") as tell:

        def drawn(runs: Sequence[Mapping[str, str]], *, again: bool) -> Sweep:
            chosen, begun = replace(space, chosen=tuple(runs)), len(trials)
            given = {**options, "best": minimise, "resume": again, "executor": farm}
            return sweep(
                base, chosen, out, reference, **given, progress=lambda done, _: tell(min(begun + done, budget), budget)
            )

        study = _study(len(minimise), seed)
        told = {name: knob.distribution() for name, knob in knobs.items()}
        parts: list[Sweep] = []
        while len(trials) < budget:
            known = {_key(settings): result for settings, result in trials}
            asked = _ask(study, told, knobs, known, minimise, min(AT_ONCE, budget - len(trials)))
            if not asked:
                break  # there is nothing else
            parts.append(drawn([run for _, run in asked], again=resume or bool(trials)))
            answers = {_key(result.settings): result for result in parts[-1].comparison.results}
            for trial, run in asked:
                result = answers.get(_key(run))
                trials.append((run, result))
                _tell(study, trial, values_of(result, minimise))
        different = [run for run, _ in trials]
        whole = drawn(different, again=True)
    return replace(
        whole,
        space=replace(space, chosen=tuple(different)),
        executed=sum(part.executed for part in parts),
        alone=sum(part.alone for part in parts),
        resumed=sum(part.resumed for part in parts),
        timed=sum(part.timed for part in parts),
        redrawn=sum(part.redrawn for part in parts),
        torn=sum(part.torn for part in parts),
        search=_summary(whole.comparison.results, trials, minimise, budget),
    )


def _ask(
    study: Any,
    told: Mapping[str, Any],
    knobs: Mapping[str, _Knob],
    known: Mapping[tuple[tuple[str, str], ...], Result | None],
    minimise: Sequence[str],
    count: int,
) -> list[tuple[Any, dict[str, str]]]:
    """As many runs as are wanted that are not known yet, or less where the optimiser comes upon no others.

    What it asks for again it is told again at once; of two alike in one batch the second is taken back.
    """
    found: dict[tuple[tuple[str, str], ...], tuple[Any, dict[str, str]]] = {}
    again = 0
    while len(found) < count and again < MOST_AGAIN:
        trial = study.ask(told)
        run = _joined(knobs, trial.params)
        if _key(run) not in known and _key(run) not in found:
            found[_key(run)] = trial, run
            again = 0
            continue
        again += 1
        _tell(study, trial, values_of(known.get(_key(run)), minimise))
    return list(found.values())


def check_search(
    base: Pipeline, space: Space, reference: Path | Pipeline | None, minimise: Sequence[str], metric: str | None
) -> list[Pipeline]:
    """The pipelines at the ends of the axes; everything that can be wrong with a search is found without GL.

    Raises:
        InputError: as from `search`.
    """
    space.check(spans=True)
    problems = []
    if reference is None:
        text = "a search needs what its runs are measured against: --reference PIPELINE, or a picture"
        problems.append(Problem("RG524", text))
    known = [*OBJECTIVES, *(added.name for added in base.resolve().catalog.extensions.metrics())]
    known += figures(base.link().graph)
    for name in minimise:
        if name not in known:
            text = (
                f"there is nothing called '{name}' to minimise{suggestion(name, known)}; available: {', '.join(known)}"
            )
            problems.append(Problem("RG524", text))
    if problems:
        raise InputError(problems)
    return check_sweep(base, replace(space, chosen=tuple(_ends(space))), reference, metric)


def _ends(space: Space) -> Iterator[dict[str, str]]:
    """Every value, and both ends of every span, each once beside the first of the others."""
    ends = {axis.path: axis.values or (axis.at((0.0, 0.0, 0.0)), axis.at((1.0, 1.0, 1.0))) for axis in space.axes}
    first = {path: values[0] for path, values in ends.items()}
    yield first
    for path, values in ends.items():
        yield from ({**first, path: value} for value in values[1:])


def _summary(
    results: Sequence[Result],
    trials: Sequence[tuple[Mapping[str, str], Result | None]],
    minimise: Sequence[str],
    budget: int,
) -> Search:
    values = {result.name: found for result in results if (found := values_of(result, minimise)) is not None}
    names = {_key(result.settings): result.name for result in results}
    order = tuple(names.get(_key(run)) for run, _ in trials)
    return Search(tuple(minimise), budget, order, values, front_of(values))


def _joined(knobs: Mapping[str, _Knob], params: Mapping[str, Any]) -> dict[str, str]:
    return {path: value for name, knob in knobs.items() for path, value in knob.settings(params[name]).items()}


def _key(settings: Mapping[str, str]) -> tuple[tuple[str, str], ...]:
    return tuple(sorted(settings.items()))


@contextmanager
def _hushed() -> Iterator[None]:
    """Optuna tells of every trial, and of what may change in later versions."""
    import warnings  # only here

    import optuna  # an extra

    optuna.logging.set_verbosity(optuna.logging.WARNING)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", optuna.exceptions.ExperimentalWarning)
        yield


def _study(objectives: int, seed: int) -> Any:
    import optuna  # an extra

    with _hushed():
        sampler = optuna.samplers.TPESampler(seed=seed, multivariate=True, constant_liar=True)
        directions: list[Literal["minimize"]] = ["minimize"] * objectives
        return optuna.create_study(sampler=sampler, directions=directions)


def _tell(study: Any, trial: Any, values: Sequence[float] | None) -> None:
    from optuna.trial import TrialState  # an extra

    with _hushed():
        if values is None:
            study.tell(trial, state=TrialState.FAIL)
        else:
            study.tell(trial, list(values))
