"""`rendergraph compare`: pictures, times and memory of several pipelines."""

from __future__ import annotations

import math
import shlex
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from msgspec import Struct
from msgspec.structs import replace

from rendergraph.cli import options
from rendergraph.cli.lazy_click import click
from rendergraph.cli.output import emit, emit_json, on_terminal, say, table, warn
from rendergraph.errors import InputError, Option, Place, Problem, UsageError, suggestion
from rendergraph.formatting import format_bytes

if TYPE_CHECKING:
    from rendergraph.compare.values import Comparison, Result
    from rendergraph.declare import Extensions
    from rendergraph.session import Pipeline, Selection

BEYOND = 4
"""Exit code of a comparison beyond its threshold."""
_LIMITED = ("flip", "rmse", "radiance_rmse")
SOFTWARE = "times on a software rasteriser: no measure of a GPU"


class Threshold(Struct, frozen=True):
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
WITH = options.Parsed("'PATH=VALUE …'", options.settings)
reference_option = click.option(
    "--reference",
    metavar="FILE|PIPELINE",
    shell_complete=options.offered("pipelines"),
    help="Measure against this picture or pipeline; the first by default.",
)
metric_option = click.option(
    "--metric",
    metavar="NODE.PORT",
    shell_complete=options.offered("ports"),
    help="Measure this port's texture in place of the picture.",
)
title_option = click.option("--title", default="", metavar="TEXT", help="What stands above the report.")
note_option = click.option(
    "--note", default="", metavar="TEXT", help="What you say about it, beneath the title; empty lines part paragraphs."
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
@click.argument("pipelines", nargs=-1, required=True, shell_complete=options.offered("pipelines"))
@click.option(
    "--with",
    "withs",
    multiple=True,
    type=WITH,
    shell_complete=options.offered("settings"),
    help="Compare the pipeline with these settings, several in one text; one alone with the pipeline as it is.",
)
@reference_option
@metric_option
@options.selection_options
@click.option("-n", "--frames", type=click.IntRange(1, 10_000), default=10, show_default=True, help="Measured frames.")
@at_option
@click.option("-o", "--output", type=options.NamedPath(dir_okay=False), metavar="FILE", help="Write a report, HTML.")
@click.option(
    "--fail-above", "thresholds", multiple=True, type=THRESHOLD, help="Exit 4 where a metric is above: flip=0.02."
)
@title_option
@note_option
@options.executor_options
@options.json_option
@options.device_option
def command(
    pipelines: tuple[str, ...],
    withs: tuple[tuple[str, ...], ...],
    reference: str | None,
    metric: str | None,
    frames: int,
    frame: int,
    output: Path | None,
    thresholds: tuple[Threshold, ...],
    title: str,
    note: str,
    executor: str | None,
    devices: tuple[int, ...],
    timeout: float | None,
    as_json: bool,
    device: int | None,
    select: options.Select,
) -> None:
    """Compare pictures, times and memory of pipelines.

    All are drawn on one scene, with one camera and at one size: those of the first, or what the options say. Options
    such as -s hold for all pipelines, not for the reference. Times are medians of frames that the pipelines take turns
    to draw. Pictures alone, with no option that changes what they were made with, are compared as they are.

    \b
    Examples:
      rendergraph compare forward forward-prepass --size 320x180
      rendergraph compare forward shading-flat --size 320x180 -n 20 -o report.html
      rendergraph compare shadow-pcf --with shadows.taps=1 --with 'shadows.taps=8 sun.resolution=512' --size 160x90
      rendergraph compare ssao-hemisphere ssao-disc --metric ao.occlusion --size 160x90 -n 2
      rendergraph compare soft.png hard.png
      rendergraph compare forward-prepass --reference forward --size 160x90 --fail-above flip=0.02 --json
    """
    first = pipelines[0]
    if withs and len(pipelines) > 1:
        raise UsageError(Problem("RG500", "--with makes variants of one pipeline; name one, or write each as a file"))
    if len(pipelines) < 2 and reference is None and not withs:
        ways = "name another, a --reference, or settings: --with NODE.PARAM=VALUE"
        text = f"there is one pipeline and nothing to compare it with; {ways}"
        raise UsageError(Problem("RG500", text))
    if output is not None:
        check_page(output)
    elif title or note:
        raise UsageError(Problem("RG500", "--title and --note are the report's; write one: -o report.html"))
    if not withs and metric is None and _as_they_are(pipelines, reference, select):
        from rendergraph.catalog import Catalog
        from rendergraph.compare import compare_pictures

        plugins = select("").plugins
        check_thresholds(thresholds, Catalog.discover(plugins).extensions)
        found = compare_pictures(pipelines, reference, plugins=plugins)
    else:
        from rendergraph.compare import compare

        names: list[str] = []
        if withs:
            variants = [(), *withs] if len(withs) == 1 else list(withs)
            names = [" ".join(settings) or Path(first).stem for settings in variants]
            loaded = [_with(settings, select(first)) for settings in variants]
        else:
            loaded = [_load(name, pipelines, select) for name in pipelines]
        check_thresholds(thresholds, loaded[0].link().catalog.extensions)
        found = compare(
            loaded,
            load_reference(reference, select),
            metric=metric,
            names=names,
            frames=frames,
            frame=frame,
            device=device,
            progress=on_terminal(),
            executor=executor or "serial",
            devices=devices,
            timeout=timeout,
        )
    warn(found.warnings)
    for note in found.notes:
        say(note)
    beyond = exceeded(found.results, thresholds)
    written: dict[str, Any] = {}
    if output is not None:
        from rendergraph.compare.report import comparison_page

        words = ["compare", *pipelines, *(w for settings in withs for w in ("--with", " ".join(settings)))]
        words += ["--metric", metric] if metric else []
        words += [*options.words(select(first)), *_reference_words(reference)]
        words += ["-n", str(frames), *(["--at", str(frame)] if frame != 1 else []), "-o", str(output)]
        words += [*(["--title", title] if title else []), *(["--note", note] if note else [])]
        options.write(comparison_page(found, typed(words), title=title, note=note), output)
        written["report"] = str(output)
    if as_json:
        emit_json(found.as_json() | written | {"exceeded": beyond})
    else:
        emit(_text(found))
        if output is not None:
            say(f"report: {output}")
    for text in beyond:
        say(text, always=True)
    if beyond:
        raise click.exceptions.Exit(BEYOND)


def _as_they_are(names: Sequence[str], reference: str | None, select: options.Select) -> bool:
    """Whether these are pictures that need not be drawn: nothing is said that changes them, or how they are drawn."""
    from rendergraph.session import Selection
    from rendergraph.session.made import is_picture

    source, context = click.core.ParameterSource, click.get_current_context()
    drawn = {"frames", "frame", "device", "executor"} & {
        name for name in context.params if context.get_parameter_source(name) is source.COMMANDLINE
    }
    changed = select("") != Selection("", plugins=select("").plugins)
    return not drawn and not changed and all(map(is_picture, [*names, *([reference] if reference else [])]))


def _load(name: str, names: Sequence[str], select: options.Select) -> Pipeline:
    """One of the pipelines; an -s that does not fit it and may be meant for another says how to do that.

    Raises:
        InputError: with every mistake found on the way.
    """
    try:
        return options.linked(select(name))
    except InputError as error:
        if error.problems[0].code == "RG510":
            way = f"; to measure pipelines against it: --reference {name}"
            raise error.relocated(lambda problem: problem.relocate(problem.place, hint=way)) from None
        others = [other for other in names if other != name]
        if not others:
            raise
        way = f"; -s holds for all pipelines; for one alone: rendergraph compare {others[0]} --reference {name} -s …"
        raise error.relocated(
            lambda problem: (
                problem.relocate(problem.place, context=f"in {name}", hint=way)
                if problem.place and problem.place.option("--set")
                else problem
            )
        ) from None


def _with(settings: Sequence[str], selection: Selection) -> Pipeline:
    """The pipeline with the settings of one variant; what is wrong with them is said of `--with`.

    Raises:
        InputError: with every mistake found on the way.
    """
    try:
        return options.linked(replace(selection, sets=(*selection.sets, *settings)))
    except InputError as error:
        raise error.relocated(lambda problem: _of_with(problem, settings)) from None


def _of_with(problem: Problem, settings: Sequence[str]) -> Problem:
    setting = problem.place.option("--set") if problem.place else None
    typed = setting is not None and setting.text in settings
    return problem.relocate(Place(Option("--with", f"'{setting.text}'"))) if setting and typed else problem


def load_reference(reference: str | None, select: options.Select) -> Path | Pipeline | None:
    """The reference: a picture's path, or a pipeline on the same scene, without the variants' settings."""
    from rendergraph.session.made import is_picture

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
            value = values.get(threshold.metric) if not result.not_finite else math.nan
            if value is None or not value <= threshold.most:
                shown = "unknown" if value is None else f"{value:.6g}"
                found.append(f"{result.name}: {threshold.metric} is {shown}, above {threshold.most:g}")
    return found


def typed(words: Sequence[str]) -> str:
    """A command line as it can be typed again."""
    return shlex.join(["rendergraph", *words])


def _reference_words(reference: str | None) -> list[str]:
    return [] if reference is None else ["--reference", reference]


def summary(results: Sequence[Result]) -> tuple[tuple[str, ...], list[tuple[object, ...]]]:
    """What stands above the columns, and a row a variant: errors, times, passes, bytes; of pictures errors alone."""
    more = list(dict.fromkeys(name for result in results for name in result.columns))
    heads: tuple[str, ...] = ("", "FLIP", "RMSE", "PSNR", "SSIM", *more)
    rows: list[tuple[object, ...]] = []
    for result in results:
        m = result.metrics
        psnr = "∞" if m.psnr is None else f"{m.psnr:.2f}"
        errors = (f"{m.flip:.4f}", f"{m.rmse:.4f}", psnr, f"{m.ssim:.4f}")
        rows.append((result.name, *errors, *(_told(result.columns.get(name)) for name in more)))
    if not all(result.memory for result in results):
        return heads, rows
    again = ("repeats",) if any(result.times.repeated for result in results) else ()
    costs = [_costs(result, repeated=bool(again)) for result in results]
    return (*heads, "GPU ms", "10–90 %", *again, "CPU ms", "passes", "textures"), [
        (*row, *cost) for row, cost in zip(rows, costs, strict=True)
    ]


def _told(value: float | None) -> str:
    return "–" if value is None else f"{value:.4g}"


def _costs(result: Result, *, repeated: bool) -> tuple[object, ...]:
    times = result.times
    among = times.repeated
    again = (f"{among.min:.2f}–{among.max:.2f}" if among else "",) if repeated else ()
    gpu = f"{times.gpu_ms.median:.2f}" if times.gpu_ms else "–"
    spread = f"{times.gpu_ms.p10:.2f}–{times.gpu_ms.p90:.2f}" if times.gpu_ms else ""
    size = format_bytes(int(str(result.memory["allocated_bytes"])))
    return gpu, spread, *again, f"{times.cpu_ms.median:.2f}", result.pass_count, size


def _text(found: Comparison) -> str:
    width, height = found.size
    head, rows = summary(found.results)
    where = [found.scene, f"{width}×{height}", f"against {found.reference.name}"]
    where += [f"of {found.metric}"] if found.metric else []
    where += [f"on {found.device.get('renderer')}"] if found.device else []
    lines = [", ".join(filter(None, where)), table(rows, head, right=range(1, len(head)))]
    if found.software:
        lines.append(SOFTWARE)
    lines += [line for result in found.results if (line := _first(found, result) or _made(found, result))]
    return "\n".join(lines)


def _first(found: Comparison, result: Result) -> str:
    base = found.base[0] if found.base else ""
    if result.name == base or result.difference is None or result.plan is None:
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


def _made(found: Comparison, result: Result) -> str:
    """What a picture was made with and the first of them was not, as `diff` says it."""
    if result.difference is None or found.base is None or result.name == found.base[0]:
        return ""
    from rendergraph.diff import diff_text

    return diff_text(result.difference).rstrip() if result.difference else f"{result.name}: made as {found.base[0]} was"
