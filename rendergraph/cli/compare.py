"""`rendergraph compare`: pictures, times and memory of several pipelines."""

from __future__ import annotations

import math
import shlex
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rendergraph.cli import options
from rendergraph.cli.output import Bar, emit, emit_json, megabytes, say, table, warn
from rendergraph.cli.words import click
from rendergraph.errors import InputError, Problem, UsageError, suggestion

if TYPE_CHECKING:
    from rendergraph.compare.values import Comparison, Result
    from rendergraph.declare import Extensions
    from rendergraph.session import Pipeline

BEYOND = 4
"""Exit code of a comparison beyond its threshold."""
_LIMITED = ("flip", "rmse", "radiance_rmse")
SOFTWARE = "times on a software rasteriser: no measure of a GPU"


@dataclass(frozen=True)
class Threshold:
    """A metric and what it may not exceed."""

    metric: str
    most: float


def _threshold(text: str) -> Threshold:
    metric, equals, value = text.partition("=")
    try:
        most = float(value)
    except ValueError:
        most = -1.0
    if not equals or not most >= 0:
        raise ValueError(f"'{text}' is not METRIC=NUMBER, as in flip=0.02")
    if metric in ("psnr", "ssim"):
        raise ValueError(f"{metric} falls as errors grow; limit {', '.join(_LIMITED)}")
    return Threshold(metric, most)


def check_thresholds(thresholds: Sequence[Threshold], extensions: Extensions) -> None:
    """Say that a threshold is of no metric; plugins are asked where we do not know it.

    Raises:
        UsageError: nobody computes it.
    """
    for metric in dict.fromkeys(one.metric for one in thresholds if one.metric not in _LIMITED):
        known = [*_LIMITED, *(added.name for added in extensions.metrics())]
        if metric not in known:
            text = f"--fail-above: there is no metric '{metric}'{suggestion(metric, known)}"
            raise UsageError([Problem("RG500", text), *extensions.problems])


THRESHOLD = options.Parsed("METRIC=NUMBER", _threshold)
reference_option = click.option(
    "--reference", metavar="FILE|PIPELINE", help="Measure against this picture or pipeline; the first by default."
)
at_option = click.option(
    "--at",
    "frame",
    type=click.IntRange(1, 100_000),
    default=1,
    show_default=True,
    help="Compare pictures of this frame.",
)


@click.command("compare", no_args_is_help=True)
@click.argument("pipelines", nargs=-1, required=True)
@reference_option
@options.selection_options
@click.option("-n", "--frames", type=click.IntRange(1, 10_000), default=10, show_default=True, help="Measured frames.")
@at_option
@click.option(
    "-o", "--output", type=click.Path(path_type=Path, dir_okay=False), metavar="FILE", help="Write a report, HTML."
)
@click.option(
    "--fail-above", "thresholds", multiple=True, type=THRESHOLD, help="Exit 4 where a metric is above: flip=0.02."
)
@options.json_option
@options.device_option
def command(
    pipelines: tuple[str, ...],
    reference: str | None,
    frames: int,
    frame: int,
    output: Path | None,
    thresholds: tuple[Threshold, ...],
    as_json: bool,
    device: int | None,
    select: options.Select,
) -> None:
    """Compare pictures, times and memory of pipelines.

    All are drawn on one scene, with one camera and at one size: those of the first, or what the options say. Options
    such as -s hold for all pipelines, not for the reference. Times are medians of frames that the pipelines take turns
    to draw.

    \b
    Examples:
      rendergraph compare forward forward-prepass --size 320x180
      rendergraph compare forward shading-flat --size 320x180 -n 20 -o report.html
      rendergraph compare forward-prepass --reference forward --size 160x90 --fail-above flip=0.02 --json
    """
    from rendergraph.compare import compare

    if len(pipelines) < 2 and reference is None:
        text = "there is one pipeline and nothing to compare it with; name another, or a --reference"
        raise UsageError(Problem("RG500", text))
    if output is not None:
        check_page(output)
    loaded = [_load(name, pipelines, select) for name in pipelines]
    check_thresholds(thresholds, loaded[0].link().catalog.extensions)
    bar = Bar("steps")
    found = compare(
        loaded, load_reference(reference, select), frames=frames, frame=frame, device=device, progress=bar.show
    )
    bar.clear()
    warn(found.warnings)
    for note in found.notes:
        say(note)
    beyond = exceeded(found.results, thresholds)
    written: dict[str, Any] = {}
    if output is not None:
        from rendergraph.compare.report import comparison_page

        words = ["compare", *pipelines, *options.words(loaded[0].selection), *_reference_words(reference)]
        words += ["-n", str(frames), *(["--at", str(frame)] if frame != 1 else []), "-o", str(output)]
        options.write(comparison_page(found, typed(words)), output)
        written["report"] = str(output)
    if as_json:
        emit_json(found.as_json() | written | {"exceeded": beyond})
    else:
        emit(_text(found))
        if output is not None:
            say(f"report: {output}")
    for text in beyond:
        say(text)
    if beyond:
        raise click.exceptions.Exit(BEYOND)


def _load(name: str, names: Sequence[str], select: options.Select) -> Pipeline:
    """One of the pipelines; an -s that does not fit it and may be meant for another says how to do that.

    Raises:
        InputError: with every mistake found on the way.
    """
    try:
        return options.linked(select(name))
    except InputError as error:
        others = [other for other in names if other != name]
        if not others:
            raise
        way = f"-s holds for all pipelines; for one alone: rendergraph compare {others[0]} --reference {name} -s …"
        raise InputError(
            [
                replace(problem, text=f"in {name}: {problem.text}; {way}") if _of_setting(problem) else problem
                for problem in error.problems
            ]
        ) from None


def _of_setting(problem: Problem) -> bool:
    return problem.place is not None and problem.place.file.startswith("--set ")


def load_reference(reference: str | None, select: options.Select) -> Path | Pipeline | None:
    """The reference: a picture's path, or a pipeline on the same scene, without the variants' settings."""
    from rendergraph.compare.reference import is_picture

    if reference is None:
        return None
    if is_picture(reference):
        return Path(reference)
    return options.linked(replace(select(reference), sets=(), patches=()))


def check_page(output: Path) -> None:
    """Say before anything is drawn that a report cannot be written there.

    Raises:
        UsageError: it is no name of a page.
        InputError: the folder is missing or cannot be written to.
    """
    from rendergraph.images import check_target

    if output.suffix.lower() not in (".html", ".htm"):
        text = f"a report is an HTML page; name it '{output.with_suffix('.html')}'"
        raise UsageError(Problem("RG501", text))
    check_target(output)


def exceeded(results: Sequence[Result], thresholds: Sequence[Threshold]) -> list[str]:
    """What is above its threshold, in words; a figure that is no number is above every one."""
    found = []
    for result in results:
        values = {**result.metrics.as_json(), "radiance_rmse": result.radiance_rmse, **result.metrics.plugins}
        for threshold in thresholds:
            value = values.get(threshold.metric)
            if value is None or not value <= threshold.most:
                shown = "unknown" if value is None else f"{value:.6g}"
                found.append(f"{result.name}: {threshold.metric} is {shown}, above {threshold.most:g}")
    return found


def typed(words: Sequence[str]) -> str:
    """A command line as it can be typed again."""
    return shlex.join(["rendergraph", *words])


def _reference_words(reference: str | None) -> list[str]:
    return [] if reference is None else ["--reference", reference]


def plugin_metrics(results: Sequence[Result]) -> list[str]:
    """The names of plugins' metrics."""
    return list(dict.fromkeys(name for result in results for name in result.metrics.plugins))


def summary_rows(results: Sequence[Result]) -> list[tuple[object, ...]]:
    """A row a variant: errors, times, passes, bytes."""
    rows: list[tuple[object, ...]] = []
    plugins = plugin_metrics(results)
    for result in results:
        m, times = result.metrics, result.times
        psnr = "∞" if m.psnr is None else f"{m.psnr:.2f}"
        gpu = f"{times.gpu_ms.median:.2f}" if times.gpu_ms else "–"
        spread = f"{times.gpu_ms.p10:.2f}–{times.gpu_ms.p90:.2f}" if times.gpu_ms else ""
        size = megabytes(int(str(result.memory["allocated_bytes"])))
        rows.append(
            (
                result.name,
                f"{m.flip:.4f}",
                f"{m.rmse:.4f}",
                psnr,
                f"{m.ssim:.4f}",
                *(f"{m.plugins.get(name, math.nan):.4g}" for name in plugins),
                gpu,
                spread,
                f"{times.cpu_ms.median:.2f}",
                result.pass_count,
                size,
            )
        )
    return rows


def heads(results: Sequence[Result]) -> tuple[str, ...]:
    """What stands above the columns."""
    times = ("GPU ms", "10–90 %", "CPU ms", "passes", "textures")
    return ("", "FLIP", "RMSE", "PSNR", "SSIM", *plugin_metrics(results), *times)


def _text(found: Comparison) -> str:
    width, height = found.size
    head = heads(found.results)
    lines = [
        f"{found.scene}, {width}×{height}, against {found.reference.name}, on {found.device.get('renderer')}",
        table(summary_rows(found.results), head, right=range(1, len(head))),
    ]
    if found.software:
        lines.append(SOFTWARE)
    lines += [line for result in found.results if (line := _first(found, result))]
    return "\n".join(lines)


def _first(found: Comparison, result: Result) -> str:
    base = found.base[0] if found.base else ""
    if result.name == base or result.difference is None:
        return ""
    if result.first is None:
        return f"{result.name}: every pass draws what it draws in {base}"
    first = result.first
    amount = (
        "in size" if first.most is None else f"in {100 * first.share:.3g} % of its texels, by up to {first.most:.4g}"
    )
    return (
        f"{result.name}: the first pass that differs from {base} is {first.node} ({first.port}){first.after}, {amount}"
    )
