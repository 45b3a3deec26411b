"""`rendergraph sweep`: the product of axes."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from rendergraph.cli import compare as shared
from rendergraph.cli import options
from rendergraph.cli.output import amount, emit, emit_json, on_terminal, say, table, warn
from rendergraph.cli.words import click
from rendergraph.errors import InputError, RenderError

if TYPE_CHECKING:
    from rendergraph.compare.axes import Axis, SweepFile
    from rendergraph.compare.product import Sweep
    from rendergraph.errors import Problem
    from rendergraph.session import Selection


def _axis(text: str) -> Axis:
    from rendergraph.compare.axes import parse_axis

    return parse_axis(text)


AXIS = options.Parsed("PATH=V,V,…", _axis)


@click.command("sweep", no_args_is_help=True)
@click.argument("pipeline", shell_complete=options.offered("pipelines"))
@click.option(
    "-x",
    "--axis",
    "axes",
    multiple=True,
    type=AXIS,
    shell_complete=options.offered("settings"),
    help="Go through these values of a path that -s takes.",
)
@click.option(
    "-o",
    "--output",
    "out",
    type=options.NamedPath(file_okay=False),
    metavar="DIR",
    required=True,
    help="A folder for the runs, results.jsonl and report.html.",
)
@click.option("--resume", is_flag=True, help="Keep the runs that DIR has already.")
@click.option("--csv", "as_csv", is_flag=True, help="Write results.csv, too: a row a run, for spreadsheets.")
@shared.reference_option
@shared.metric_option
@options.selection_options
@click.option("-n", "--frames", type=click.IntRange(1, 10_000), help="Measured frames.  [default: 5]")
@shared.at_option
@click.option(
    "--fail-above", "thresholds", multiple=True, type=shared.THRESHOLD, help="Exit 4 where a metric is above."
)
@shared.title_option
@shared.note_option
@options.json_option
@options.device_option
def command(
    pipeline: str,
    axes: tuple[Axis, ...],
    out: Path,
    resume: bool,
    as_csv: bool,
    reference: str | None,
    metric: str | None,
    frames: int | None,
    frame: int,
    thresholds: tuple[shared.Threshold, ...],
    title: str,
    note: str,
    as_json: bool,
    device: int | None,
    select: options.Select,
) -> None:
    """Draw and measure every combination of parameters.

    PIPELINE is a pipeline, or a file with `sweep: 1`, `pipeline` and `axes`, and `reference`, `scene`, `size`, `set`,
    `frames` where these differ from the defaults; options win. A path is what -s takes: a parameter, an input, a node's
    type. Commas inside brackets belong to a value. What several runs have in common is drawn once.

    \b
    Examples:
      rendergraph sweep forward -x shadows.taps=1,2,4 -x light.ambient=0,[0.1,0.1,0.2] --size 320x180 -o out
      rendergraph sweep ssao-hemisphere -x ao.samples=8,16 --metric ao.occlusion --size 96x54 --csv -o ao
      rendergraph sweep forward -x light.shading=phong,pbr --reference shading-pbr -o lit --size 160x90 --json
      rendergraph sweep forward -x light.shading=phong,pbr,unlit --reference shading-pbr -o lit --size 160x90 --resume
    """
    from rendergraph.compare import sweep
    from rendergraph.compare.axes import is_sweep, read_sweep
    from rendergraph.compare.report import quality_svg, sweep_page
    from rendergraph.compare.study import kept_runs
    from rendergraph.compare.table import csv_text
    from rendergraph.session import Pipeline

    words = ["sweep", pipeline, *(w for a in axes for w in ("-x", f"{a.path}={','.join(a.values)}"))]
    words += options.words(select(pipeline)) + ([] if reference is None else ["--reference", reference])
    words += ["--metric", metric] if metric else []
    words += ["--csv"] if as_csv else []
    words += [*(["--title", title] if title else []), *(["--note", note] if note else [])]
    words += ["-n", str(frames)] if frames else []
    words += ["--at", str(frame)] if frame != 1 else []
    file: SweepFile | None = None
    if is_sweep(Path(pipeline)):
        file = read_sweep(Path(pipeline))
        named = {axis.path for axis in axes}
        axes = (*(axis for axis in file.axes if axis.path not in named), *axes)
        reference, frames, metric = reference or file.reference, frames or file.frames, metric or file.metric
        pipeline, select = file.pipeline, _with_file(file, select)
    base = Pipeline(select(pipeline))
    extensions = base.resolve().catalog.extensions
    shared.check_thresholds(thresholds, extensions)
    again = shared.typed([*words, "-o", str(out)])
    against = shared.load_reference(reference, select)
    try:
        found = sweep(
            base,
            axes,
            out,
            against,
            metric=metric,
            frames=frames or 5,
            frame=frame,
            resume=resume,
            device=device,
            progress=on_terminal(),
        )
    except InputError as error:
        raise error if file is None else file.placed(error) from None
    except KeyboardInterrupt:
        kept = kept_runs(out)
        say(f"{amount(kept, 'run')} kept in {out}" + (f"; go on with: {again} --resume" if kept else ""))
        raise
    warn([*found.comparison.warnings, *extensions.warnings])
    page = out / "report.html"
    options.write(sweep_page(found, again, title=title, note=note), page)
    chart = out / "quality.svg"
    options.write(quality_svg(found.comparison), chart)
    if found.timed:
        say(f"{amount(found.timed, 'run')} drawn before, measured now over {amount(frames or 5, 'frame')}")
    if found.redrawn:
        say(f"{amount(found.redrawn, 'run')} drawn again: what they are drawn from has changed, or their pictures have")
    if found.torn:
        say(f"{amount(found.torn, 'line')} of the results not whole; what they told was done again")
    files = [chart, page]
    if as_csv:
        files.append(out / "results.csv")
        options.write(csv_text(found), files[-1])
    beyond = shared.exceeded(found.comparison.results, thresholds)
    if as_json:
        emit_json(
            found.as_json()
            | {
                "report": str(page),
                "chart": str(chart),
                **({"csv": str(files[-1])} if as_csv else {}),
                "exceeded": beyond,
            }
        )
    else:
        emit(_text(found))
        for path in files:
            emit(str(path))
    for text in beyond:
        say(text, always=True)
    for failure in found.failures:
        say(f"{failure.name} failed: {failure.text}", always=True)
    if found.failures:
        raise click.exceptions.Exit(RenderError.exit_code)
    if beyond:
        raise click.exceptions.Exit(shared.BEYOND)


def check_file(path: Path, select: options.Select) -> tuple[int, tuple[Problem, ...]]:
    """Find every mistake in a sweep's file and in its runs, and say how many those are and what was noticed.

    Raises:
        InputError: with all mistakes.
    """
    from rendergraph.compare import check_sweep
    from rendergraph.compare.axes import read_sweep
    from rendergraph.session import Pipeline

    file = read_sweep(path)
    select = _with_file(file, select)
    try:
        against = shared.load_reference(file.reference, select)
        runs = check_sweep(Pipeline(select(file.pipeline)), file.axes, against, file.metric)
    except InputError as error:
        raise file.placed(error) from None
    return len(runs), tuple(dict.fromkeys(problem for run in runs for problem in run.link().warnings))


def _with_file(file: SweepFile, select: options.Select) -> options.Select:
    """The options with what a file says where they say nothing."""

    def selected(name: str) -> Selection:
        found = select(name)
        sets = (*file.sets, *found.sets)
        return replace(found, scene=found.scene or file.scene, size=found.size or file.size, sets=sets)

    return selected


def _text(found: Sweep) -> str:
    from rendergraph.compare.product import pareto

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
    return "\n".join(lines)
