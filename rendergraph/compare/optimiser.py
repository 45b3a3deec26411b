"""Search instead of sweep: an optimiser asks for a few runs at a time, and learns from their results.

The optimiser is Optuna's tree-structured Parzen estimator (Bergstra et al. 2011), also for several objectives (Ozaki et
al. 2020). It stores nothing itself: a resumed search asks the same questions again and finds the answers in the folder,
so that an interrupted search ends where it would have ended.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal, TypeAlias, Unpack

from rendergraph.compare.engine import Sweep, sweep
from rendergraph.compare.prepare import Prepared, SweepKeywords, SweepOptions, prepare
from rendergraph.compare.results import OBJECTIVES, Result, Search, objective_values, pareto_front
from rendergraph.compare.space import Axes, Axis, Space, typed
from rendergraph.errors import InputError, Problem, suggestion
from rendergraph.installed import require
from rendergraph.session import Pipeline
from rendergraph.session.progress import report_progress
from rendergraph.session.values import figures

BATCH_SIZE = 8
"""Runs that the optimiser suggests at a time; they are rendered together."""
MOST_REPEATED = 50
"""The search ends after so many known runs in a row."""

Settings: TypeAlias = "tuple[tuple[str, str], ...]"
"""Paths with values, sorted: a key of a run."""


def _distribution(axis: Axis) -> Any:
    """Return a position 0…1 for a continuous range; neighbours are close in a list of ordered numbers alone."""
    from optuna import distributions  # an extra

    if axis.span is not None:
        return distributions.FloatDistribution(0.0, 1.0)
    numbers = [typed(value) for value in axis.values]
    is_number = all(isinstance(value, int | float) and not isinstance(value, bool) for value in numbers)
    if is_number and numbers in (sorted(numbers), sorted(numbers, reverse=True)):
        return distributions.IntDistribution(0, len(numbers) - 1)
    return distributions.CategoricalDistribution(tuple(range(len(numbers))))


def _value(axis: Axis, given: float) -> str:
    """Return the value that the optimiser gave as a position, or as a number of the list of values."""
    if axis.span is None:
        return axis.values[int(given)]
    return axis.at((given, max(0.0, given - 1e-4), min(1.0, given + 1e-4)))


class _Optimiser:
    def __init__(self, space: Space, objectives: Sequence[str], seed: int) -> None:
        import optuna  # an extra

        self.objectives = objectives
        self.asked: list[dict[str, str]] = []
        self._groups = space.groups  # zipped axes are one dimension
        self._distributions = {group[0].path: _distribution(group[0]) for group in self._groups}
        self._results: dict[Settings, Result | None] = {}
        optuna.logging.set_verbosity(optuna.logging.WARNING)  # it would report every trial
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", optuna.exceptions.ExperimentalWarning)
            sampler = optuna.samplers.TPESampler(seed=seed, multivariate=True, constant_liar=True)
            directions: list[Literal["minimize"]] = ["minimize"] * len(objectives)
            self._study = optuna.create_study(sampler=sampler, directions=directions)

    def ask(self, count: int) -> list[tuple[Any, dict[str, str]]]:
        """Return trials with their settings: as many new ones, or fewer where the optimiser finds no others.

        It learns the result of a known run at once; of two equal ones in a batch the second is withdrawn.
        """
        trials: dict[Settings, tuple[Any, dict[str, str]]] = {}
        repeated = 0
        while len(trials) < count and repeated < MOST_REPEATED:
            trial = self._study.ask(self._distributions)
            given = trial.params
            run = {axis.path: _value(axis, given[group[0].path]) for group in self._groups for axis in group}
            key = _key(run)
            if key in self._results or key in trials:
                repeated += 1
                self._tell(trial, self._results.get(key))
            else:
                trials[key] = trial, run
                repeated = 0
        return list(trials.values())

    def learn(self, trials: Sequence[tuple[Any, dict[str, str]]], results: Sequence[Result]) -> None:
        by_settings = {_key(result.settings): result for result in results}
        for trial, run in trials:
            result = by_settings.get(_key(run))
            self._results[_key(run)] = result
            self.asked.append(run)
            self._tell(trial, result)

    def _tell(self, trial: Any, result: Result | None) -> None:
        from optuna.trial import TrialState  # an extra

        values = objective_values(result, self.objectives)
        if values is None:
            self._study.tell(trial, state=TrialState.FAIL)
        else:
            self._study.tell(trial, values)


def search(
    base: Pipeline,
    axes: Axes,
    out: Path,
    reference: Path | Pipeline | None,
    options: SweepOptions = SweepOptions(),
    **settings: Unpack[SweepKeywords],
) -> Sweep:
    """Search for the settings that minimise one or several objectives.

    Arguments and errors are those of `sweep`; continuous ranges need no samples, and there must be a reference.
    `minimise` has the objectives, `budget` the maximum number of runs; with `resume` the search continues, also with a
    larger budget.
    """
    require("--minimise", "search", "optuna")
    options = options.replace(**settings)
    space, objectives, budget = Space.of(axes), tuple(options.minimise), options.budget
    check_search(base, space, reference, objectives, options.metric)
    optimiser = _Optimiser(space, objectives, options.seed)
    parts: list[Sweep] = []
    # A batch is one task: this process renders it, unless an executor was named. It stays open between batches.
    with options.open_executor(1, travels=base.travels) as farm, report_progress(options.progress, "runs") as report:

        def render(runs: Sequence[Mapping[str, str]], *, resume: bool) -> Sweep:
            before = len(optimiser.asked)
            own = options.replace(
                best=objectives,
                resume=resume,
                executor=farm,
                progress=lambda done, _: report(min(before + done, budget), budget),
            )
            return sweep(base, replace(space, chosen=tuple(runs)), out, reference, own)

        while len(optimiser.asked) < budget:
            trials = optimiser.ask(min(BATCH_SIZE, budget - len(optimiser.asked)))
            if not trials:
                break
            parts.append(render([run for _, run in trials], resume=options.resume or bool(parts)))
            optimiser.learn(trials, parts[-1].comparison.results)
        runs = optimiser.asked
        whole = render(runs, resume=True)
    results = whole.comparison.results
    values = {result.name: own for result in results if (own := objective_values(result, objectives)) is not None}
    names = {_key(result.settings): result.name for result in results}
    order = tuple(names.get(_key(run)) for run in runs)
    counts = ("executed", "alone", "resumed", "timed", "redrawn", "torn")
    return replace(
        whole,
        space=replace(space, chosen=tuple(runs)),
        search=Search(objectives, budget, order, values, pareto_front(values)),
        **{name: sum(getattr(part, name) for part in parts) for name in counts},
    )


def check_search(
    base: Pipeline, space: Space, reference: Path | Pipeline | None, minimise: Sequence[str], metric: str | None = None
) -> Prepared:
    """Check everything about a search that can be checked without GL, and return the runs at the ends of the axes."""
    space.check(spans=True)
    texts = []
    if reference is None:
        texts.append("a search needs a reference to measure its runs against: --reference PIPELINE, or a picture")
    names = [*OBJECTIVES, *(added.name for added in base.resolve().catalog.extensions.metrics())]
    names += figures(base.link().graph)
    for name in minimise:
        if name not in names:
            texts.append(f"unknown objective '{name}'{suggestion(name, names)}; available: {', '.join(names)}")
    if texts:
        raise InputError([Problem("RG524", text) for text in texts])
    return prepare(base, replace(space, chosen=tuple(_ends(space))), Path(), reference, SweepOptions(metric=metric))


def _ends(space: Space) -> Iterator[dict[str, str]]:
    """Yield every value and both ends of every continuous range, each with the first values of the other axes."""
    ends = {axis.path: axis.values or (axis.at((0.0, 0.0, 0.0)), axis.at((1.0, 1.0, 1.0))) for axis in space.axes}
    first = {path: values[0] for path, values in ends.items()}
    yield first
    for path, values in ends.items():
        yield from ({**first, path: value} for value in values[1:])


def _key(settings: Mapping[str, str]) -> Settings:
    return tuple(sorted(settings.items()))
