"""`rendergraph sweep`: the product of axes."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from msgspec.structs import replace

from rendergraph.cli import compare as shared
from rendergraph.cli import options
from rendergraph.cli.lazy_click import click
from rendergraph.cli.output import amount, emit, emit_json, on_terminal, say, say_event, table, warn
from rendergraph.errors import InputError, Problem, RenderError, UsageError

if TYPE_CHECKING:
    from rendergraph.compare.axes import Axis, Space
    from rendergraph.compare.listing import Listing
    from rendergraph.compare.product import Sweep
    from rendergraph.compare.sampling import Sampling
    from rendergraph.compare.sweepfile import SweepFile
    from rendergraph.compare.work import Pictures
    from rendergraph.session import Selection


def _axis(text: str) -> Axis:
    from rendergraph.compare.axes import parse_axis

    return parse_axis(text)


def _group(text: str) -> tuple[str, ...]:
    paths = tuple(part.strip() for part in text.split(","))
    if len(paths) < 2 or "" in paths:
        raise ValueError(f"'{text}' is not PATH,PATH, two axes or more that go together")
    return paths


AXIS = options.Parsed("PATH=V,V,…", _axis)
GROUP = options.Parsed("PATH,PATH", _group)


@click.command("sweep", no_args_is_help=True)
@click.argument("pipeline", shell_complete=options.offered("pipelines"))
@click.option(
    "-x",
    "--axis",
    "axes",
    multiple=True,
    type=AXIS,
    shell_complete=options.offered("settings"),
    help="Go through these values of a path that -s takes: 8,16, or 8:64:8, log:0.1:10:5; 0.1:2 for --samples.",
)
@click.option("--zip", "zipped", multiple=True, type=GROUP, help="Let these axes go through their values together.")
@click.option("--samples", type=click.IntRange(1, 10_000), metavar="N", help="Draw N samples, not all combinations.")
@click.option(
    "--sampling", type=click.Choice(["latin", "random"]), help="A sample in each part of every axis, or anywhere."
)
@click.option(
    "--seed", type=click.IntRange(0), metavar="N", help="Of the samples: the same gives the same.  [default: 0]"
)
@click.option(
    "-o",
    "--output",
    "out",
    type=options.NamedPath(file_okay=False),
    metavar="DIR",
    help="A folder for the runs, results.jsonl and report.html.",
)
@click.option("--resume", is_flag=True, help="Keep the runs that DIR has already.")
@click.option("--list", "listing", is_flag=True, help="Say what would be drawn, and what is shared; draw nothing.")
@click.option(
    "--keep", "kept", type=click.Choice(["all", "best"]), help="Which pictures stay: the front's alone are the best."
)
@click.option(
    "--minimise",
    multiple=True,
    metavar="METRIC",
    help="Look for the least flip, rmse, radiance_rmse, ms, bytes, … in place of all combinations; several: the front.",
)
@click.option("--budget", type=click.IntRange(1, 10_000), metavar="N", help="Runs of a search.  [default: 50]")
@click.option("--csv", "as_csv", is_flag=True, help="Write results.csv, too: a row a run, for spreadsheets.")
@shared.reference_option
@shared.metric_option
@options.selection_options
@click.option("-n", "--frames", type=click.IntRange(1, 10_000), help="Measured frames.  [default: 5]")
@click.option(
    "--repeats", type=click.IntRange(1, 1000), metavar="N", help="Measure N times, and tell the spread.  [default: 1]"
)
@shared.at_option
@click.option(
    "--fail-above", "thresholds", multiple=True, type=shared.THRESHOLD, help="Exit 4 where a metric is above."
)
@shared.title_option
@shared.note_option
@options.executor_options
@options.json_option
@options.device_option
def command(
    pipeline: str,
    axes: tuple[Axis, ...],
    zipped: tuple[tuple[str, ...], ...],
    samples: int | None,
    sampling: Sampling | None,
    seed: int | None,
    out: Path | None,
    resume: bool,
    listing: bool,
    kept: Pictures | None,
    minimise: tuple[str, ...],
    budget: int | None,
    as_csv: bool,
    reference: str | None,
    metric: str | None,
    frames: int | None,
    repeats: int | None,
    frame: int,
    thresholds: tuple[shared.Threshold, ...],
    title: str,
    note: str,
    executor: str | None,
    devices: tuple[int, ...],
    timeout: float | None,
    as_json: bool,
    device: int | None,
    select: options.Select,
) -> None:
    """Draw and measure every combination of parameters.

    PIPELINE is a pipeline, or a file with `sweep: 1`, `pipeline`, `axes`, and what else `explain sweep` lists; options
    win. A path is what -s takes: a parameter, an input, a node's type. Commas inside brackets belong to a value; ranges
    include both ends. What several runs have in common is drawn once. With --json, stderr has a line of JSON for each
    event: what is done, by which worker, how fast, and the seconds left.

    \b
    Examples:
      rendergraph sweep forward -x shadows.taps=1,2,4 -x light.shading=phong,pbr --size 320x180 -o out
      rendergraph sweep ssao-hemisphere -x ao.samples=8,16 --metric ao.occlusion --size 96x54 --csv -o ao
      rendergraph sweep ssao-hemisphere -x ao.samples=8:64:8 -x ao.radius=log:0.1:10:5 --list
      rendergraph sweep ssao-hemisphere -x ao.samples=8:64 -x ao.radius=log:0.1:10 --samples 4 --size 64x36 -o lhs
      rendergraph sweep forward -x shadows.taps=1,2,3 --executor processes:2 --size 64x36 -o two
      rendergraph sweep forward -x light.shading=phong,pbr --reference shading-pbr -o lit --size 160x90 --json
      rendergraph sweep forward -x light.shading=phong,pbr,unlit --reference shading-pbr -o lit --size 160x90 --resume
    """
    from rendergraph.compare import search, sweep
    from rendergraph.compare.listing import listed
    from rendergraph.compare.prepare import prepare
    from rendergraph.compare.report import quality_svg, sweep_page
    from rendergraph.compare.study import kept_runs
    from rendergraph.compare.table import csv_text
    from rendergraph.session import Pipeline

    words = ["sweep", pipeline, *(word for axis in axes for word in ("-x", f"{axis.path}={axis.text}"))]
    words += [word for group in zipped for word in ("--zip", ",".join(group))]
    words += ["--samples", str(samples)] if samples else []
    words += ["--sampling", sampling] if sampling else []
    words += ["--seed", str(seed)] if seed is not None else []
    words += options.words(select(pipeline)) + ([] if reference is None else ["--reference", reference])
    words += ["--metric", metric] if metric else []
    words += ["--keep", kept] if kept else []
    words += [word for name in minimise for word in ("--minimise", name)]
    words += ["--budget", str(budget)] if budget else []
    words += ["--csv"] if as_csv else []
    words += [*(["--title", title] if title else []), *(["--note", note] if note else [])]
    words += ["-n", str(frames)] if frames else []
    words += ["--repeats", str(repeats)] if repeats else []
    words += ["--at", str(frame)] if frame != 1 else []
    file = _file(pipeline)
    space = _space(file, axes, zipped, samples, sampling, seed)
    if file is not None:
        reference, frames, metric = reference or file.reference, frames or file.frames, metric or file.metric
        repeats, kept = repeats or file.repeats, kept or file.kept
        minimise, budget = minimise or file.minimise, budget or file.budget
        pipeline, select = file.pipeline, with_file(file, select)
    base = Pipeline(select(pipeline))
    extensions = base.resolve().catalog.extensions
    shared.check_thresholds(thresholds, extensions)
    against = shared.load_reference(reference, select)
    if minimise and (listing or space.samples):
        what = (
            "--list: an optimiser asks for runs when it knows of others" if listing else "--samples: take one of them"
        )
        raise UsageError(Problem("RG500", f"--minimise and {what}"))
    if listing:
        with at_its_lines(file):
            planned = prepare(base, space, out or Path(), against, metric=metric, frame=frame)
            _show(
                listed(planned, out, frames=frames or 5, repeats=repeats or 1, resume=resume, pictures=kept != "best"),
                as_json=as_json,
            )
        return
    if out is None:
        raise UsageError(Problem("RG500", "a sweep needs a folder for its runs: -o DIR; --list needs none"))
    again = shared.typed([*words, "-o", str(out)])
    try:
        with at_its_lines(file):
            given: dict[str, Any] = {
                "metric": metric,
                "frames": frames or 5,
                "repeats": repeats or 1,
                "kept": kept or "all",
                "frame": frame,
                "resume": resume,
                "device": device,
                "progress": on_terminal() and not as_json,
                "executor": executor,
                "devices": devices,
                "timeout": timeout,
                "events": say_event if as_json else None,
            }
            if minimise:
                given |= {"minimise": minimise, "budget": budget or 50, "seed": space.seed}
                found = search(base, space, out, against, **given)
            else:
                found = sweep(base, space, out, against, **given)
    except KeyboardInterrupt:
        there = kept_runs(out)
        say(f"{amount(there, 'run')} kept in {out}" + (f"; go on with: {again} --resume" if there else ""))
        raise
    warn([*found.comparison.warnings, *extensions.warnings])
    files: dict[str, Path] = {}
    if found.comparison.results:  # of a sweep that failed as a whole there is nothing to show
        files |= {"chart": out / "quality.svg", "report": out / "report.html"}
        options.write(sweep_page(found, again, title=title, note=note), files["report"])
        options.write(quality_svg(found.comparison), files["chart"])
    if found.timed:
        say(f"{amount(found.timed, 'run')} drawn before, measured now over {amount(frames or 5, 'frame')}")
    if found.redrawn:
        say(f"{amount(found.redrawn, 'run')} drawn again: what they are drawn from has changed, or their pictures have")
    if found.torn:
        say(f"{amount(found.torn, 'line')} of the results not whole; what they told was done again")
    if as_csv:
        files["csv"] = out / "results.csv"
        options.write(csv_text(found), files["csv"])
    beyond = shared.exceeded(found.comparison.results, thresholds)
    if as_json:
        emit_json(found.as_json() | {name: str(path) for name, path in files.items()} | {"exceeded": beyond})
    else:
        emit(_text(found))
        for path in files.values():
            emit(str(path))
    for text in beyond:
        say(text, always=True)
    for failure in found.failures:
        say(f"{failure.name} failed: {failure.text}", always=True)
    if found.failures:
        raise click.exceptions.Exit(RenderError.exit_code)
    if beyond:
        raise click.exceptions.Exit(shared.BEYOND)


def _file(name: str) -> SweepFile | None:
    from rendergraph.compare.sweepfile import is_sweep, read_sweep

    return read_sweep(Path(name)) if is_sweep(Path(name)) else None


@contextmanager
def at_its_lines(file: SweepFile | None) -> Iterator[None]:
    """Mistakes in what a file says of paths are told at its lines."""
    try:
        yield
    except InputError as error:
        raise error if file is None else file.placed(error) from None


def _space(
    file: SweepFile | None,
    axes: tuple[Axis, ...],
    zipped: tuple[tuple[str, ...], ...],
    samples: int | None,
    sampling: Sampling | None,
    seed: int | None,
) -> Space:
    """The axes of a file and of the options; of two with one path that of the options."""
    from rendergraph.compare.axes import Space

    said = Space(()) if file is None else file.space
    named = {axis.path for axis in axes}
    return Space(
        (*(axis for axis in said.axes if axis.path not in named), *axes),
        zipped or said.zipped,
        samples or said.samples,
        sampling or said.sampling,
        said.seed if seed is None else seed,
    )


def check_file(path: Path, select: options.Select) -> tuple[int, tuple[Problem, ...]]:
    """Find every mistake in a sweep's file and in its runs, and say how many those are and what was noticed.

    Raises:
        InputError: with all mistakes.
    """
    from rendergraph.compare import check_search, check_sweep
    from rendergraph.compare.sweepfile import read_sweep
    from rendergraph.session import Pipeline

    file = read_sweep(path)
    select = with_file(file, select)
    with at_its_lines(file):
        against = shared.load_reference(file.reference, select)
        base = Pipeline(select(file.pipeline))
        if file.minimise:
            runs = check_search(base, file.space, against, file.minimise, file.metric)
        else:
            runs = check_sweep(base, file.space, against, file.metric)
    return (file.budget or 50) if file.minimise else len(runs), tuple(
        dict.fromkeys(problem for run in runs for problem in run.link().warnings)
    )


def with_file(file: SweepFile, select: options.Select) -> options.Select:
    """The options with what a file says where they say nothing."""

    def selected(name: str) -> Selection:
        found = select(name)
        sets = (*file.sets, *found.sets)
        return replace(found, scene=found.scene or file.scene, size=found.size or file.size, sets=sets)

    return selected


def _text(found: Sweep) -> str:
    from rendergraph.compare.front import pareto

    comparison = found.comparison
    front = {result.name for result in pareto(comparison.results)}
    heads, rows = shared.summary(comparison.results)
    heads, rows = (*heads, "Pareto"), [(*row, "front" if row[0] in front else "") for row in rows]
    lines = [
        f"{amount(len(rows), 'run')} against {comparison.reference.name}: "
        f"{amount(found.executed, 'pass', 'passes')} drawn, {found.alone} one by one"
        + (f"; {amount(found.resumed, 'run')} kept from before" if found.resumed else "")
        + (f"; {amount(len(found.failures), 'run')} failed" if found.failures else ""),
        table(rows, heads, right=range(1, len(heads) - 1)),
    ]
    if comparison.software:
        lines.append(shared.SOFTWARE)
    if (search := found.search) is not None:
        told = [(name, *map(_value, search.values[name])) for name in search.front]
        lines.append(table(told, ("least", *search.minimise)))
    return "\n".join(lines)


def _value(value: float) -> str:
    """Bytes are whole, and large."""
    return f"{value:.0f}" if value >= 1e4 else f"{value:.4g}"


def _show(found: Listing, *, as_json: bool) -> None:
    if as_json:
        emit_json(found.as_json())
        return
    told, runs = found.as_json(), found.prepared.runs
    emit(
        f"{amount(len(runs), 'run')} against {told['reference']}: {amount(found.executed, 'pass', 'passes')} to draw, "
        f"{told['passes_one_by_one']} one by one" + (f"; {amount(len(found.kept), 'run')} kept" if found.kept else "")
    )
    if found.groups:
        rows = [(name, str(drawn), str(alone)) for name, (drawn, alone) in found.shared().items()]
        emit(table(rows, ("pass", "drawn", "one by one"), right=(1, 2)))
    paths, group_of = [axis.path for axis in found.prepared.space.axes], found.group_of()
    values = [[run.settings[path] for path in paths] for run in runs]
    emit(table([(group_of.get(number, "kept"), *row) for number, row in enumerate(values)], ("group", *paths)))
