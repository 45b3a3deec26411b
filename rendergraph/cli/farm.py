"""`rendergraph farm`: a sweep as a job of a render farm."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from rendergraph.cli import compare as shared
from rendergraph.cli import options
from rendergraph.cli.lazy_click import click
from rendergraph.cli.output import amount, emit, emit_json, say
from rendergraph.cli.sweep import at_its_lines, with_file
from rendergraph.errors import Problem, UsageError

if TYPE_CHECKING:
    from rendergraph.compare import Sweep
    from rendergraph.compare.prepare import Prepared


RUNS = options.Parsed("N,A-B", "rendergraph.compare.export.openjd:parse_numbers")


@click.command("farm", no_args_is_help=True)
@click.argument("action", type=click.Choice(["export", "measure", "frames"]))
@click.argument("sweep", type=options.NamedPath(dir_okay=False))
@click.option("--openjd", is_flag=True, help="Export an Open Job Description template, the only kind of job.")
@click.option("--runs", type=RUNS, help="Runs that a worker renders, from 1.")
@click.option("--frames", type=options.FRAMES, help="Render these frames of each run, too.")
@click.option("--chunk", type=click.IntRange(1, 100_000), default=24, show_default=True, help="Frames per task.")
@click.option(
    "-o",
    "--output",
    "out",
    type=options.NamedPath(),
    metavar="PATH",
    required=True,
    help="The template, or a folder of runs.",
)
@options.json_option
@options.device_option
def command(
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
    with at_its_lines(file):
        select = with_file(file, Selection)
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
        only = sorted(number - 1 for number in runs)
        how = how.replace(only=only)
        if action == "measure":
            from rendergraph.compare.export.shards import measure

            _report(measure(base, file.space, out, reference, how), out, len(only), as_json=as_json)
        elif frames is None:
            raise UsageError(Problem("RG500", "farm frames needs --frames, such as --frames 1-24"))
        else:
            from rendergraph.compare.export.shards import render_frames
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
        failures = [failure.as_json() for failure in failed]
        emit_json({"drawn": rendered, "failed": failures, "kept": count - len(rendered)})
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
