"""`rendergraph sweep` and `farm`: the product of axes, on this machine or as a job of a render farm."""

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
    from rendergraph.compare import Axis, Space, Sweep
    from rendergraph.compare.prepare import Prepared
    from rendergraph.compare.runner import Listing
    from rendergraph.compare.sweepfile import SweepFile
    from rendergraph.session import Selection


def _group(text: str) -> tuple[str, ...]:
    paths = tuple(part.strip() for part in text.split(","))
    if len(paths) < 2 or "" in paths:
        raise ValueError(f"'{text}' is not PATH,PATH: two axes or more")
    return paths


@click.command("sweep", no_args_is_help=True)
@click.argument("pipeline", type=options.PIPELINE)
@click.option(
    "-x",
    "--axis",
    "axes",
    multiple=True,
    type=options.Parsed("PATH=V,V,…", "rendergraph.compare.space:parse_axis", "settings"),
    help="Values of a path that -s takes: 8,16, 8:64:8 or log:0.1:10:5; with --samples 0.1:2.",
)
@click.option(
    "--zip",
    "zipped",
    multiple=True,
    type=options.Parsed("PATH,PATH", _group),
    help="Step through the values of these axes together.",
)
@click.option("--samples", type=click.IntRange(1, 10_000), metavar="N", help="Render N samples, not all combinations.")
@click.option(
    "--sampling", type=click.Choice(["latin", "random"]), help="One sample per interval of each axis, or random ones."
)
@click.option("--seed", type=click.IntRange(0), metavar="N", help="Random seed.  [default: 0]")
@click.option(
    "-o", "--output", "out", type=options.FOLDER, help="A folder for the runs, results.jsonl and report.html."
)
@click.option("--resume", is_flag=True, help="Keep the runs that DIR already has.")
@click.option("--list", "listing", is_flag=True, help="List the runs and the passes they share; render nothing.")
@click.option(
    "--keep", "kept", type=click.Choice(["all", "best"]), help="Keep all pictures, or only those on the Pareto front."
)
@click.option(
    "--minimise",
    multiple=True,
    metavar="METRIC",
    help="Minimise flip, rmse, radiance_rmse, ms, bytes, … with an optimiser instead of a full grid; repeatable.",
)
@click.option(
    "--budget", type=click.IntRange(1, 10_000), metavar="N", help="Maximum number of runs of --minimise.  [default: 50]"
)
@click.option("--csv", "as_csv", is_flag=True, help="Also write results.csv, with a row for each run.")
@shared.measure_options
@click.option("-n", "--frames", type=click.IntRange(1, 10_000), help="Measured frames.  [default: 5]")
@click.option(
    "--repeats", type=click.IntRange(1, 1000), metavar="N", help="Measure N times, and report the spread.  [default: 1]"
)
@shared.at_option
@shared.report_options
def sweep(
    pipeline: str,
    axes: tuple[Axis, ...],
    out: Path | None,
    listing: bool,
    as_csv: bool,
    reference: str | None,
    thresholds: tuple[shared.Threshold, ...],
    title: str,
    note: str,
    as_json: bool,
    select: options.Select,
    **settings: Any,
) -> None:
    """Render and measure every combination of parameters.

    PIPELINE is a pipeline, or a file with `sweep: 1`, `pipeline`, `axes` and other keys (see `explain sweep`), which
    options override. A path is what -s takes: a parameter, an input or a node's type. Commas inside brackets belong to
    a value; ranges include both ends. Passes that several runs share are executed once. With --json, stderr has a line
    of JSON for each event: runs done, worker, speed and seconds left.

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
    from rendergraph.compare import SweepOptions, search, sweep
    from rendergraph.compare.store import kept_runs
    from rendergraph.compare.sweepfile import is_sweep, read_sweep
    from rendergraph.session import Pipeline

    file = read_sweep(Path(pipeline)) if is_sweep(Path(pipeline)) else None
    space = _space(file, axes, **{name: settings.pop(name) for name in ("zipped", "samples", "sampling", "seed")})
    given = {name: value for name, value in settings.items() if value not in (None, ())}
    if file is not None:
        given = {**file.options, **given}
        reference, pipeline, select = reference or file.reference, file.pipeline, _with_file(file, select)
    how = SweepOptions(
        **given, seed=space.seed, progress=on_terminal() and not as_json, events=say_event if as_json else None
    )
    base = Pipeline(select(pipeline))
    extensions = base.resolve().catalog.extensions
    shared.check_thresholds(thresholds, extensions)
    against = shared.load_reference(reference, select)
    if how.minimise and listing:
        raise UsageError(Problem("RG500", "--minimise and --list: an optimiser chooses runs by the results of others"))
    if how.minimise and space.samples:
        raise UsageError(Problem("RG500", "--minimise and --samples exclude each other"))
    if listing:
        from rendergraph.compare.prepare import prepare
        from rendergraph.compare.runner import list_sweep

        with _at_its_lines(file):
            prepared = prepare(base, space, out or Path(), against, how)
            runs = list_sweep(prepared, out, how)
        emit_json(runs.as_json()) if as_json else _show(runs)
        return
    if out is None:
        raise UsageError(Problem("RG500", "a sweep needs a folder for its runs: -o DIR; --list needs none"))
    if out.suffix in {".csv", ".html", ".json", ".jsonl"} and not out.is_dir():
        text = f"-o takes a folder for report.html and, with --csv, results.csv, not a file: -o {out.with_suffix('')}"
        raise UsageError(Problem("RG500", text))
    try:
        with _at_its_lines(file):
            outcome = (search if how.minimise else sweep)(base, space, out, against, how)
    except KeyboardInterrupt:
        kept = kept_runs(out)
        way = f"; continue with: {options.command_line()} --resume" if kept else ""
        say(f"{amount(kept, 'run')} kept in {out}{way}")
        raise
    warn([*outcome.comparison.warnings, *extensions.warnings])
    for line in outcome.comparison.notes:
        say(line)
    if outcome.timed:
        say(f"{amount(outcome.timed, 'run')} reused, timed again over {amount(how.frames, 'frame')}")
    if outcome.redrawn:
        say(f"{amount(outcome.redrawn, 'run')} rendered again: their input files or pictures have changed")
    if outcome.torn:
        say(f"{amount(outcome.torn, 'incomplete line')} in results.jsonl skipped; affected runs repeated")
    files = _write_files(outcome, out, title=title, note=note, as_csv=as_csv)
    beyond = shared.exceeded(outcome.comparison.results, thresholds)
    if as_json:
        emit_json(outcome.as_json() | {name: str(path) for name, path in files.items()} | {"exceeded": beyond})
    else:
        emit(_text(outcome))
        for path in files.values():
            emit(str(path))
    for text in (*beyond, *(f"{failure.name} failed: {failure.text}" for failure in outcome.failures)):
        say(text, always=True)
    if outcome.failures:
        raise click.exceptions.Exit(RenderError.exit_code)
    if beyond:
        raise click.exceptions.Exit(shared.BEYOND)


def _write_files(outcome: Sweep, out: Path, *, title: str, note: str, as_csv: bool) -> dict[str, Path]:
    from rendergraph.compare.export.table import csv_text
    from rendergraph.compare.report import quality_svg, sweep_page

    files: dict[str, Path] = {}
    if outcome.comparison.results:  # not all runs have failed
        files |= {"chart": out / "quality.svg", "report": out / "report.html"}
        options.write(sweep_page(outcome, options.command_line(), title=title, note=note), files["report"])
        options.write(quality_svg(outcome.comparison), files["chart"])
    if as_csv:
        files["csv"] = out / "results.csv"
        options.write(csv_text(outcome), files["csv"])
    return files


@contextmanager
def _at_its_lines(file: SweepFile | None) -> Iterator[None]:
    """Relocate mistakes in the paths of a sweep's file to its lines."""
    try:
        yield
    except InputError as error:
        raise error if file is None else error.relocated(file.relocate) from None


def _space(file: SweepFile | None, axes: tuple[Axis, ...], **sampling: Any) -> Space:
    """Return the axes of a file and of the options, which override those of the file."""
    import dataclasses  # not needed by --help

    from rendergraph.compare import Space

    base = Space(()) if file is None else file.space
    named = {axis.path for axis in axes}
    merged = (*(axis for axis in base.axes if axis.path not in named), *axes)
    given = {name: value for name, value in sampling.items() if value not in (None, ())}
    return dataclasses.replace(base, axes=merged, **given)


def check_file(path: Path, select: options.Select) -> tuple[int, tuple[Problem, ...]]:
    """Check a sweep's file and its runs, and return the number of runs and the warnings."""
    from rendergraph.compare import SweepOptions, check_search
    from rendergraph.compare.prepare import prepare
    from rendergraph.compare.sweepfile import read_sweep
    from rendergraph.session import Pipeline

    file = read_sweep(path)
    select = _with_file(file, select)
    how = SweepOptions(**file.options)
    with _at_its_lines(file):
        against = shared.load_reference(file.reference, select)
        base = Pipeline(select(file.pipeline))
        if how.minimise:
            prepared = check_search(base, file.space, against, how.minimise, how.metric)
        else:
            prepared = prepare(base, file.space, Path(), against, how)
    warnings = dict.fromkeys(problem for run in prepared.runs for problem in run.planned.linked.warnings)
    return how.budget if how.minimise else len(prepared.runs), tuple(warnings)


def _with_file(file: SweepFile, select: options.Select) -> options.Select:
    """Return the options, completed by those of a sweep's file."""

    def selected(name: str) -> Selection:
        found = select(name)
        sets = (*file.sets, *found.sets)
        return replace(found, scene=found.scene or file.scene, size=found.size or file.size, sets=sets)

    return selected


def _text(outcome: Sweep) -> str:
    from rendergraph.compare.results import pareto

    comparison = outcome.comparison
    front = {result.name for result in pareto(comparison.results)}
    heads, rows = shared.summary(comparison.results)
    heads, rows = (*heads, "Pareto"), [(*row, "front" if row[0] in front else "") for row in rows]
    lines = [
        f"{amount(len(rows), 'run')} against {comparison.reference.name}: "
        f"{amount(outcome.executed, 'pass', 'passes')} executed, {outcome.alone} without sharing"
        + (f"; {amount(outcome.resumed, 'run')} reused" if outcome.resumed else "")
        + (f"; {amount(len(outcome.failures), 'run')} failed" if outcome.failures else ""),
        table(rows, heads, right=range(1, len(heads) - 1)),
    ]
    if comparison.software:
        lines.append(shared.SOFTWARE)
    lines += shared.truth_lines(comparison)
    if (search := outcome.search) is not None:
        front_rows = [(name, *map(_value, search.values[name])) for name in search.front]
        lines.append(table(front_rows, ("minimum", *search.minimise)))
    return "\n".join(lines)


def _value(value: float) -> str:
    return f"{value:.0f}" if value >= 1e4 else f"{value:.4g}"


def _show(outcome: Listing) -> None:
    document, runs = outcome.as_json(), outcome.prepared.runs
    emit(
        f"{amount(len(runs), 'run')} against {document['reference']}: "
        f"{amount(outcome.executed, 'pass', 'passes')} to execute, {document['passes_one_by_one']} without sharing"
        + (f"; {amount(len(outcome.kept), 'run')} kept" if outcome.kept else "")
    )
    if outcome.groups:
        rows = [(name, str(drawn), str(alone)) for name, (drawn, alone) in outcome.shared().items()]
        emit(table(rows, ("pass", "executed", "without sharing"), right=(1, 2)))
    paths, group_of = [axis.path for axis in outcome.prepared.space.axes], outcome.group_of()
    values = [[run.settings[path] for path in paths] for run in runs]
    emit(table([(group_of.get(number, "kept"), *row) for number, row in enumerate(values)], ("group", *paths)))


# --- on a render farm -------------------------------------------------------------------------------------------------


@click.command("farm", no_args_is_help=True)
@click.argument("action", type=click.Choice(["export", "measure", "frames"]))
@click.argument("sweep", type=options.FILE)
@click.option("--openjd", is_flag=True, help="Export an Open Job Description template, the only kind of job.")
@click.option(
    "--runs",
    type=options.Parsed("N,A-B", "rendergraph.compare.export.openjd:parse_numbers"),
    help="Runs that a worker renders, from 1.",
)
@click.option("--frames", type=options.FRAMES, help="Render these frames of each run, too.")
@click.option("--chunk", type=click.IntRange(1, 100_000), default=24, show_default=True, help="Frames per task.")
@click.option("-o", "--output", "out", type=options.PATH, required=True, help="The template, or a folder of runs.")
@options.json_option
@options.device_option
def farm(
    action: str,
    sweep: Path,
    openjd: bool,
    runs: tuple[int, ...] | None,
    frames: range | None,
    chunk: int,
    out: Path,
    as_json: bool,
    device: int | None,
) -> None:
    """Hand a sweep to a render farm.

    `export` writes a job: groups of runs that share passes, chunks of --frames, and a report at the end. Its tasks call
    `measure` and `frames` on the workers, where rendergraph must be installed. All settings come from the sweep's file.

    \b
    Examples:
      rendergraph farm export study.yaml --openjd -o job.yaml
      rendergraph farm export study.yaml --openjd --frames 1-240 --chunk 24 -o job.yaml
      rendergraph farm measure study.yaml --runs 1-2 -o study
      rendergraph farm frames study.yaml --runs 2 --frames 3-4 -o study
    """
    from rendergraph.compare import SweepOptions
    from rendergraph.compare.prepare import prepare
    from rendergraph.compare.sweepfile import read_sweep
    from rendergraph.session import Pipeline, Selection

    file = read_sweep(sweep)
    with _at_its_lines(file):
        select = _with_file(file, Selection)
        base, reference = Pipeline(select(file.pipeline)), shared.load_reference(file.reference, select)
        how = SweepOptions(**{**file.options, "kept": "all"}, device=device)
        if action == "export":
            if not openjd:
                raise UsageError(Problem("RG500", "farm export needs the kind of job: --openjd"))
            job = _template(prepare(base, file.space, Path(), reference, how), sweep, out.parent, frames, chunk)
            options.put(job, out, as_json=as_json)
            return
        if runs is None:
            raise UsageError(Problem("RG500", f"farm {action} needs --runs, such as --runs 1-16"))
        if (most := max(runs)) > (count := len(file.space.runs())):
            raise UsageError(Problem("RG500", f"--runs: there is no run {most}; the sweep has {amount(count, 'run')}"))
        how = how.replace(only=sorted(number - 1 for number in runs))
        if action == "measure":
            from rendergraph.compare.export.openjd import measure

            _report(measure(base, file.space, out, reference, how), out, len(runs), as_json=as_json)
        elif frames is None:
            raise UsageError(Problem("RG500", "farm frames needs --frames, such as --frames 1-24"))
        else:
            from rendergraph.compare.export.openjd import render_frames
            from rendergraph.session.gpu import Gpu

            paths = []
            with Gpu(device) as gpu:
                for path in render_frames(base, file.space, out, how, frames, gpu):
                    paths.append(str(path))
                    if not as_json:
                        emit(str(path))
            if as_json:
                emit_json({"outputs": paths})


def _report(sweep: Sweep | None, out: Path, count: int, *, as_json: bool) -> None:
    rendered = [] if sweep is None else [result.name for result in sweep.comparison.results]
    failed = () if sweep is None else sweep.failures
    if as_json:
        emit_json({"drawn": rendered, "failed": [one.as_json() for one in failed], "kept": count - len(rendered)})
    else:
        for name in rendered:
            emit(str(out / name))
    for failure in failed:  # the report lists it; another worker would fail, too
        say(f"{failure.name} failed: {failure.text}", always=True)


def _template(prepared: Prepared, sweep: Path, folder: Path, frames: range | None, chunk: int) -> str:
    import yaml  # only for this action

    from rendergraph.compare.export.openjd import template
    from rendergraph.compare.runner import list_sweep

    class Plain(yaml.SafeDumper):
        def ignore_aliases(self, data: Any) -> bool:
            return True

    resources = (resource for run in prepared.runs for resource in run.planned.plan.resources.values())
    if frames is not None and any(resource.role == "history" for resource in resources):
        say(f"each frame depends on earlier ones, so a task renders all frames of its run: {len(frames)}")
        chunk = len(frames)
    job = template(list_sweep(prepared), sweep, folder, frames=frames, chunk=chunk)
    text: str = yaml.dump(job, Dumper=Plain, sort_keys=False, allow_unicode=True, width=110)
    return text
