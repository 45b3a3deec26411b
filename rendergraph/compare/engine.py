"""The comparisons themselves: of pipelines, of picture files, and of all combinations of a sweep."""

from __future__ import annotations

import itertools
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, Unpack

from rendergraph.catalog import Catalog
from rendergraph.compare.batches import MOST_RUNS
from rendergraph.compare.prepare import (
    SweepKeywords,
    SweepOptions,
    View,
    by_view,
    measured_at,
    named_reference,
    prepare,
    prepare_variants,
    read_picture,
)
from rendergraph.compare.results import Comparison, Reference, Result, Results, Search, measure_against, pareto
from rendergraph.compare.runner import Runner, SweepRunner
from rendergraph.compare.space import Axes, Space, typed, unique_names
from rendergraph.compare.store import RUN, Failure, SweepFolder, locked
from rendergraph.diff import diff
from rendergraph.errors import InputError, Problem, UsageError
from rendergraph.farm.bundle import make_bundle
from rendergraph.link import Graph
from rendergraph.metrics import check_sizes
from rendergraph.session.pipeline import Pipeline, as_pipeline, load
from rendergraph.session.progress import report_progress
from rendergraph.stamps import track_reads


@dataclass(frozen=True, eq=False)
class Sweep(Results):
    """The results of a sweep.

    Attributes:
        comparison: every run as a variant, in the order of the product.
        executed, alone: passes executed this time, and passes that the same runs would have executed without sharing.
        resumed: runs that were already complete.
        timed: runs that had been rendered before, and were measured this time.
        redrawn: stored runs that were rendered again because files have changed since.
        torn: incomplete lines of the results.
        failures: runs that could not be rendered or compared; they are not variants.
        search: the result of an optimiser, where one chose the runs.
    """

    comparison: Comparison
    space: Space
    executed: int
    alone: int
    resumed: int
    timed: int
    redrawn: int
    torn: int
    failures: tuple[Failure, ...] = ()
    search: Search | None = None

    def __repr__(self) -> str:
        return f"<Sweep of {', '.join(axis.path for axis in self.space.axes)}: {len(self.comparison.results)} runs>"

    def _repr_html_(self) -> str:
        return self.comparison._repr_html_()

    @property
    def results(self) -> tuple[Result, ...]:  # type: ignore[override]  # which never changes there either
        """One for each run, in the order of the product."""
        return self.comparison.results

    @property
    def whole(self) -> Comparison:
        """The comparison of all runs."""
        return self.comparison

    def as_json(self) -> dict[str, Any]:
        document = self.comparison.as_json()
        runs = document.pop("variants")
        front = {result.name for result in pareto(self.comparison.results)}
        axes = {axis.path: axis.text if axis.span else list(map(typed, axis.values)) for axis in self.space.axes}
        document |= {
            "axes": axes,
            "executed_passes": self.executed,
            "passes_one_by_one": self.alone,
            "resumed": self.resumed,
            "timed_again": self.timed,
            "redrawn": self.redrawn,
            "runs": [run | {"pareto": run["name"] in front} for run in runs],
            "failed": [failure.as_json() for failure in self.failures],
        }
        return document | ({"search": self.search.as_json()} if self.search else {})


def compare(
    pipelines: Sequence[Pipeline | str | Path] | Pipeline | str | Path,
    reference: Path | Pipeline | str | None = None,
    options: SweepOptions = SweepOptions(frames=10),
    *,
    names: Sequence[str] = (),
    size: tuple[int, int] | None = None,
    **settings: Unpack[SweepKeywords],
) -> Comparison:
    """Render pipelines with one scene, one camera and at one size, and compare the pictures.

    Args:
        pipelines: pipelines, or their names or files; all use the scene and size of the first one.
        reference: a picture file, or another pipeline or its name, such as `path-traced:light.seed=1`; the first of
            `pipelines` by default. A pipeline with the outputs `radiance` and `variance` is ground truth: it is
            rendered until its noise is small.
        options: how to render and measure. By default this process renders, and the pipelines take turns.
        names: of the pipelines; those of their files by default.
        size: width and height of the pictures; those of the first pipeline by default.
        settings: attributes of `SweepOptions` by name: `frames=20, metric="ao.occlusion"`.

    Raises:
        UsageError: there is nothing to compare.
        InputError: a mistake in a file, or the pictures cannot be compared.
        RenderError: rendering failed.
        DeviceError: there is no usable GL device.
    """
    options = options.replace(**settings)
    options = options.replace(executor=options.executor or "serial")
    if isinstance(pipelines, (Pipeline, str, Path, Mapping)):
        pipelines = [pipelines]
    if not pipelines:
        raise UsageError(Problem("RG500", "there is no pipeline to compare"))
    given, reference = [as_pipeline(each).with_size(size) for each in pipelines], named_reference(reference)
    with track_reads() as files:
        if isinstance(reference, Pipeline):
            reference = measured_at(reference, options.metric)
        variants = [measured_at(each, options.metric) for each in given]
        prepared = prepare_variants(variants, reference, options, names, twins=True)
    runner = Runner(prepared, options)
    travels = all(each.travels for each in (*given, reference) if isinstance(each, Pipeline))
    with (
        options.open_executor(len(given), travels=travels) as farm,
        report_progress(options.progress, "steps") as report,
    ):
        farm.upload_inputs(lambda: make_bundle(files, given[0].selection.plugins, prepared.modules))
        runner.execute(farm, report)
    catalogs = [run.planned.linked.catalog for run in (*prepared.runs, *prepared.references)]
    return runner.comparison(warnings=[problem for catalog in catalogs for problem in catalog.extensions.warnings])


def sweep(
    base: Pipeline | str | Path | Mapping[str, Any],
    axes: Axes,
    out: Path | str | None = None,
    reference: Path | Pipeline | str | None = None,
    options: SweepOptions = SweepOptions(),
    *,
    size: tuple[int, int] | None = None,
    **settings: Unpack[SweepKeywords],
) -> Sweep:
    """Render every combination of the axes' values into a folder each, and measure it.

    A run's picture and figures are stored as soon as it is rendered, and its times once it has been measured, so an
    interruption loses little. If a run cannot be rendered, its line has the reason, and the others continue.

    Args:
        base: the pipeline that the axes change, or its name or file.
        axes: paths with values or ranges: `{"ao.samples": [8, 16], "ao.radius": "log:0.1:1:5"}`; or a `Space`, for
            samples and zipped axes.
        out: the folder; `results.jsonl` in it gets a line for each measured run. Without one, results are kept in
            memory alone.
        reference: the picture file, pipeline or name of a pipeline to measure the runs against; the first run by
            default.
        options: how to render and measure.
        size: width and height of the pictures; those of the pipeline by default.
        settings: attributes of `SweepOptions` by name: `frames=20, resume=True`.

    Raises:
        InputError: an axis names no parameter, a value does not fit, the folder already has results or results of
            another study, another sweep is running in it, or there is a mistake in the reference.
        RenderError: writing the results or rendering the reference failed.
        DeviceError: there is no usable GL device.
    """
    options = options.replace(**settings)
    if out is None:
        with tempfile.TemporaryDirectory(prefix="rendergraph-") as folder:
            return sweep(base, axes, folder, reference, options, size=size)
    base, out = as_pipeline(base).with_size(size), Path(out)
    reference, space = named_reference(reference), Space.of(axes)
    space.check()
    if views := by_view(space, reference, options):
        return _sweep_of_views(base, views, out, options, space)
    with track_reads() as files:
        prepared = prepare(base, space, out, reference, options)
    runs = prepared.runs
    with locked(out):
        store = SweepFolder.open(out, prepared.study, resume=options.resume)
        runner = SweepRunner(prepared, options, store)
        missing = runner.missing
        resumed, timed = len(runs) - len(missing), sum(number in runner.results for number in missing)
        redrawn = sum((runs[n].folder / RUN).exists() for n in missing if n not in runner.results)
        if missing or prepared.references:
            with (
                options.open_executor(-(-len(missing) // MOST_RUNS), travels=base.travels) as farm,
                report_progress(options.progress, "runs") as report,
            ):
                farm.upload_inputs(lambda: make_bundle(files, base.selection.plugins, prepared.modules))
                store.begin(prepared.study)
                runner.execute(farm, report)
    if runner.reference is None:  # all runs are complete, and the first one is what they are measured against
        pixels = runner.results[0].pixels
        assert pixels is not None  # the first run's picture is always kept
        runner.reference = Reference(runs[0].name, "variant", pixels, prepared.encoding, prepared.output)
    comparison = runner.comparison(warnings=[p for run in runs for p in run.planned.linked.warnings])
    failures = tuple(runner.failures[number] for number in sorted(runner.failures))
    return Sweep(
        comparison=comparison,
        space=prepared.space,
        executed=runner.executed,
        alone=runner.alone,
        resumed=resumed,
        timed=timed,
        redrawn=redrawn,
        torn=store.incomplete,
        failures=failures,
    )


def _sweep_of_views(base: Pipeline, views: Sequence[View], out: Path, options: SweepOptions, space: Space) -> Sweep:
    """Sweep each scene, camera and environment separately: pictures of two scenes are not compared."""
    parts: list[Sweep] = []
    with report_progress(options.progress, "runs") as report:
        for part, reference, own in views:
            done = sum(map(len, parts))
            count = partial(lambda done, number, _: report(done + number, space.count()), done)
            own = own.replace(resume=options.resume or bool(parts), progress=count)
            parts.append(sweep(base, part, out, reference, own))
    order = {name: number for number, name in enumerate(space.run_names())}
    comparisons = [part.comparison for part in parts]
    first = comparisons[0]
    comparison = replace(
        first,
        results=tuple(sorted(itertools.chain.from_iterable(parts), key=lambda result: order[result.name])),
        scene=", ".join(dict.fromkeys(each.scene for each in comparisons)),
        reference=first.reference if views[0][1] else replace(first.reference, name="the first of each scene"),
        notes=tuple(dict.fromkeys(note for each in comparisons for note in each.notes)),
        warnings=tuple(dict.fromkeys(problem for each in comparisons for problem in each.warnings)),
    )
    names = ("executed", "alone", "resumed", "timed", "redrawn", "torn")
    counts: dict[str, Any] = {name: sum(getattr(part, name) for part in parts) for name in names}
    failures = tuple(failure for part in parts for failure in part.failures)
    return Sweep(comparison, space, failures=failures, **counts)


def compare_pictures(
    pictures: Sequence[str | Path], reference: str | Path | None = None, *, plugins: Sequence[Path] = ()
) -> Comparison:
    """Compare picture files pixel by pixel, and the graphs that they were made with, where their metadata has them.

    Args:
        pictures: the files.
        reference: the file to measure them against; the first of them by default.
        plugins: files or folders that may add metrics, and types of the nodes that made the pictures.

    Raises:
        InputError: a picture cannot be read, differs in size, or holds linear light where others hold display values.
    """
    paths = [Path(picture) for picture in pictures]
    names = unique_names([path.stem for path in paths])
    against = Path(reference) if reference else paths[0]
    extensions = Catalog.discover(tuple(plugins)).extensions
    target, encoding = read_picture(against)
    output = "image" if encoding == "display" else "radiance"
    reference_picture = Reference(str(against), "file" if reference else "variant", target, encoding, output)
    graphs = [_graph_of(load(path, plugins=plugins)) for path in paths]
    results = []
    for name, path, graph in zip(names, paths, graphs, strict=True):
        pixels = target if path is against else _read_like(path, reference_picture)
        errors, flip_map = measure_against(pixels, reference_picture, str(path), extensions.metrics())
        change = diff(graphs[0], graph) if graphs[0] and graph else None
        results.append(
            Result(name, str(path), pixels, encoding, errors, flip_map=flip_map, graph=graph, difference=change)
        )
    return Comparison(
        results=tuple(results),
        reference=reference_picture if reference else replace(reference_picture, name=names[0]),
        base=(names[0], graphs[0]) if graphs[0] else None,
        scene="",
        camera=None,
        size=(target.shape[1], target.shape[0]),
        frame=1,
        device={},
        warnings=tuple(extensions.warnings),
    )


def _read_like(path: Path, reference: Reference) -> Any:
    pixels, encoding = read_picture(path)
    check_sizes(pixels, reference.pixels, (str(path), reference.name))
    if encoding != reference.encoding:
        words = {"display": "display values", "linear": "light"}
        holds = f"'{path}' holds {words[encoding]}, but '{reference.name}' {words[reference.encoding]}"
        raise InputError(Problem("RG521", f"{holds}; write both as PNG, or both as EXR"))
    return pixels


def _graph_of(picture: Pipeline) -> Graph | None:
    """Return the graph a picture was made with, None without metadata or where its nodes no longer exist."""
    try:
        return picture.link().graph
    except InputError:
        return None
