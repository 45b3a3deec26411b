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
    from rendergraph.compare.sweepfile import SweepFile
    from rendergraph.session import Pipeline


def _numbers(text: str) -> tuple[int, ...]:
    from rendergraph.compare.export.openjd import parse_numbers

    return parse_numbers(text)


RUNS = options.Parsed("N,A-B", _numbers)


@click.command("farm", no_args_is_help=True)
@click.argument("action", type=click.Choice(["export", "measure", "frames"]))
@click.argument("sweep", type=options.NamedPath(dir_okay=False))
@click.option("--openjd", is_flag=True, help="Export an Open Job Description template, the one kind there is.")
@click.option("--runs", type=RUNS, help="Which runs a worker draws, from 1.")
@click.option("--frames", type=options.FRAMES, help="Draw these frames of each run, too.")
@click.option("--chunk", type=click.IntRange(1, 100_000), default=24, show_default=True, help="Frames of a task.")
@click.option(
    "-o",
    "--output",
    "out",
    type=options.NamedPath(),
    metavar="PATH",
    required=True,
    help="The template; a folder of runs.",
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

    `export` writes a job: runs that share passes together, chunks of --frames, and a report when all are done.
    `measure` and `frames` are what its tasks call on the workers, where rendergraph is installed, too. What a sweep
    needs stands in its file.

    \b
    Examples:
      rendergraph farm export study.yaml --openjd -o job.yaml
      rendergraph farm export study.yaml --openjd --frames 1-240 --chunk 24 -o job.yaml
      rendergraph farm measure study.yaml --runs 1-2 -o study
      rendergraph farm frames study.yaml --runs 2 --frames 3-4 -o study
    """
    from rendergraph.compare.sweepfile import read_sweep

    file = read_sweep(sweep)
    with at_its_lines(file):
        given = _given(file)
        if action == "export":
            if not openjd:
                raise UsageError(Problem("RG500", "say which kind of job: --openjd"))
            _export(given, file, sweep, out, frames, chunk, as_json=as_json)
            return
        if runs is None:
            raise UsageError(Problem("RG500", f"farm {action} draws some runs: --runs 1-16"))
        if (most := max(runs)) > (count := len(file.space.runs())):
            raise UsageError(Problem("RG500", f"--runs: there is no run {most}; the sweep has {amount(count, 'run')}"))
        only = sorted(number - 1 for number in runs)
        if action == "measure":
            _measure(given, file, only, out, device, as_json=as_json)
        elif frames is None:
            raise UsageError(Problem("RG500", "farm frames draws some frames: --frames 1-24"))
        else:
            _frames(given, file, only, out, frames, device, as_json=as_json)


def _given(file: SweepFile) -> tuple[Pipeline, Path | Pipeline | None]:
    """The pipeline of a sweep's file, and what its runs are measured against."""
    from rendergraph.session import Pipeline, Selection

    select = with_file(file, Selection)
    return Pipeline(select(file.pipeline)), shared.load_reference(file.reference, select)


def _export(
    given: tuple[Pipeline, Path | Pipeline | None],
    file: SweepFile,
    sweep: Path,
    out: Path,
    frames: range | None,
    chunk: int,
    *,
    as_json: bool,
) -> None:
    import yaml  # only what writes it takes it

    from rendergraph.compare.export.openjd import template
    from rendergraph.compare.listing import list_sweep
    from rendergraph.compare.prepare import prepare

    base, reference = given
    prepared = prepare(base, file.space, Path(), reference, metric=file.options.get("metric"))
    if frames is not None and any(
        resource.role == "history" for run in prepared.runs for resource in run.planned.plan.resources.values()
    ):
        say(f"a frame remembers those before, which each chunk would draw again: {amount(len(frames), 'frame')} a task")
        chunk = len(frames)
    job = template(list_sweep(prepared), sweep, out.parent, frames=frames, chunk=chunk)
    options.put(yaml.dump(job, Dumper=_dumper(), sort_keys=False, allow_unicode=True, width=110), out, as_json=as_json)


def _dumper() -> Any:
    import yaml  # only what writes it takes it

    class Plain(yaml.SafeDumper):
        """Writes a value out wherever it stands."""

        def ignore_aliases(self, data: Any) -> bool:
            return True

    return Plain


def _measure(
    given: tuple[Pipeline, Path | Pipeline | None],
    file: SweepFile,
    only: list[int],
    out: Path,
    device: int | None,
    *,
    as_json: bool,
) -> None:
    from rendergraph.compare import SweepOptions
    from rendergraph.compare.export.shards import measure

    base, reference = given
    how = SweepOptions(**{**file.options, "kept": "all"}, device=device)
    found = measure(base, file.space, out, reference, only, how)
    drawn = [] if found is None else [result.name for result in found.comparison.results]
    failed = () if found is None else found.failures
    if as_json:
        emit_json({"drawn": drawn, "failed": [failure.as_json() for failure in failed], "kept": len(only) - len(drawn)})
    else:
        for name in drawn:
            emit(str(out / name))
    for failure in failed:  # the report has it as a row; another worker would have no more luck
        say(f"{failure.name} failed: {failure.text}", always=True)


def _frames(
    given: tuple[Pipeline, Path | Pipeline | None],
    file: SweepFile,
    only: list[int],
    out: Path,
    frames: range,
    device: int | None,
    *,
    as_json: bool,
) -> None:
    from rendergraph.compare.export.shards import render_frames
    from rendergraph.session.gpu import Gpu

    paths = []
    with Gpu(device) as gpu:
        for path in render_frames(given[0], file.space, out, only, frames, gpu, metric=file.options.get("metric")):
            paths.append(str(path))
            if not as_json:
                emit(str(path))
    if as_json:
        emit_json({"outputs": paths})
