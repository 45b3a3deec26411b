"""`rendergraph compare`: pictures, times and memory of several pipelines."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

from msgspec.structs import replace

from rendergraph.cli import options
from rendergraph.cli.lazy_click import click
from rendergraph.cli.output import emit, emit_json, on_terminal, say, table, warn
from rendergraph.errors import InputError, Option, Place, Problem, UsageError, suggestion
from rendergraph.formatting import format_bytes
from rendergraph.installed import require

if TYPE_CHECKING:
    from rendergraph.compare.results import Comparison, Result
    from rendergraph.declare import Extensions
    from rendergraph.session import Pipeline, Selection

BEYOND = 4
"""Exit code of a comparison that exceeds a threshold."""
_LIMITED = ("flip", "rmse", "radiance_rmse", "relative_mse")
Threshold: TypeAlias = tuple[str, float]
"""A metric and the most that it may be."""
SOFTWARE = "times on a software rasteriser: not comparable to a GPU"


def _threshold(text: str) -> Threshold:
    metric, equals, value = text.partition("=")
    try:
        most = float(value)
    except ValueError:
        most = -1.0
    if not equals or not most >= 0:
        raise ValueError(f"'{text}' is not METRIC=NUMBER, as in flip=0.02")
    if metric in ("psnr", "ssim"):
        raise ValueError(f"{metric} falls as errors grow; use {', '.join(_LIMITED)}")
    return metric, most


def check_thresholds(thresholds: Sequence[Threshold], extensions: Extensions) -> None:
    names = [*_LIMITED, *(added.name for added in extensions.metrics())]
    for metric in dict.fromkeys(metric for metric, _ in thresholds if metric not in names):
        text = f"--fail-above: unknown metric '{metric}'{suggestion(metric, names)}"
        raise UsageError([Problem("RG500", text), *extensions.problems])


_FIGURES = (".pdf", ".svg", ".png")


def _crop(text: str) -> tuple[int, int, int, int]:
    numbers = [int(part) for part in text.split(",") if part.strip().isdigit()]
    if len(numbers) != 4:
        raise ValueError(f"expected left, top, width and height in pixels, as in 40,20,32,32, got '{text}'")
    return numbers[0], numbers[1], numbers[2], numbers[3]


measure_options = options.together(
    click.option(
        "--reference",
        type=options.Parsed("FILE|PIPELINE[:PATH=VALUE,…]", offers="pipelines"),
        help="Measure against this picture or pipeline; the first by default.",
    ),
    click.option(
        "--reference-noise",
        type=click.FloatRange(0, min_open=True),
        metavar="PART",
        help="Accumulate the reference until its noise is this fraction of the smallest error.  [default: 0.1]",
    ),
    click.option(
        "--reference-samples", type=click.IntRange(1), metavar="N", help="Maximum samples per pixel of the reference."
    ),
    click.option(
        "--reference-seconds",
        type=click.FloatRange(0, min_open=True),
        metavar="SECONDS",
        help="Maximum time to render the reference.  [default: 120]",
    ),
    click.option(
        "--metric",
        type=options.Parsed("NODE.PORT", offers="ports"),
        help="Measure this port's texture instead of the picture.",
    ),
    options.selection_options,
)
"""What is measured, and against what."""
at_option = click.option(
    "--at",
    "frame",
    type=click.IntRange(1, 100_000),
    default=1,
    show_default=True,
    help="Compare pictures of this frame.",
)
report_options = options.together(
    click.option(
        "--fail-above",
        "thresholds",
        multiple=True,
        type=options.Parsed("METRIC=NUMBER", _threshold),
        help="Exit with code 4 if a metric exceeds this value: flip=0.02.",
    ),
    click.option("--title", default="", metavar="TEXT", help="Report title."),
    click.option("--note", default="", metavar="TEXT", help="Text beneath the title; empty lines separate paragraphs."),
    options.executor_options,
    options.json_option,
    options.device_option,
)
"""The last options of `compare` and `sweep`."""


@click.command("compare", no_args_is_help=True)
@click.argument("pipelines", nargs=-1, required=True, type=options.PIPELINE)
@click.option(
    "--with",
    "withs",
    multiple=True,
    type=options.Parsed("'PATH=VALUE …'", options.settings, "settings"),
    help="Add a variant with one or more settings. A single variant is compared with the unchanged pipeline.",
)
@measure_options
@click.option("-n", "--frames", type=click.IntRange(1, 10_000), default=10, show_default=True, help="Measured frames.")
@at_option
@click.option(
    "-o",
    "--output",
    "outputs",
    multiple=True,
    type=options.FILE,
    help="Write a report (.html), a figure (.pdf, .svg, .png), or a table (.tex, .csv); repeat for several files.",
)
@click.option(
    "--crop",
    "crops",
    multiple=True,
    type=options.Parsed("X,Y,W,H", _crop),
    help="Magnify this part of the picture in a figure: left, top, width and height in pixels.",
)
@report_options
def compare(
    pipelines: tuple[str, ...],
    withs: tuple[tuple[str, ...], ...],
    reference: str | None,
    outputs: tuple[Path, ...],
    crops: tuple[tuple[int, int, int, int], ...],
    thresholds: tuple[Threshold, ...],
    title: str,
    note: str,
    as_json: bool,
    select: options.Select,
    **settings: Any,
) -> None:
    """Compare pictures, times and memory of pipelines.

    All pipelines are rendered with the same scene, camera and size: those of the options, or of the first pipeline.
    Options such as -s apply to all pipelines, but not to the reference. The pipelines take turns to render frames, and
    times are medians. A reference with the outputs `radiance` and `variance`, such as a path tracer, accumulates until
    its noise is far below the errors, and is cached on disk. If only pictures are given, and no options that change how
    they were made, they are compared as they are.

    \b
    Examples:
      rendergraph compare forward forward-prepass --size 320x180
      rendergraph compare forward shading-flat --size 320x180 -n 20 -o report.html
      rendergraph compare shadow-pcf --with shadows.taps=1 --with 'shadows.taps=8 sun.resolution=512' --size 160x90
      rendergraph compare ssao-hemisphere ssao-disc --metric ao.occlusion --size 160x90 -n 2
      rendergraph compare soft.png hard.png
      rendergraph compare forward-prepass --reference forward --size 160x90 --fail-above flip=0.02 --json
    """
    from rendergraph.images import check_target

    if withs and len(pipelines) > 1:
        raise UsageError(Problem("RG500", "--with makes variants of one pipeline; name one, or write each as a file"))
    if len(pipelines) < 2 and reference is None and not withs:
        ways = "name another, a --reference, or settings: --with NODE.PARAM=VALUE"
        raise UsageError(Problem("RG500", f"there is only one pipeline and nothing to compare it with; {ways}"))
    for output in outputs:
        if output.suffix.lower() not in (".html", ".htm", *_FIGURES, ".tex", ".csv"):
            text = f"a report is an HTML page; name it '{output.with_suffix('.html')}'"
            raise UsageError(Problem("RG501", f"{text}; figures end in .pdf, .svg or .png, tables in .tex or .csv"))
        check_target(output)
        if output.suffix.lower() in _FIGURES:
            require("a figure", "figures", "matplotlib")
    if not outputs and (title or note):
        raise UsageError(Problem("RG500", "--title and --note belong to a report; write one: -o report.html"))
    if not withs and settings["metric"] is None and _are_pictures(pipelines, reference, select):
        from rendergraph.catalog import Catalog
        from rendergraph.compare import compare_pictures

        plugins = select("").plugins
        check_thresholds(thresholds, Catalog.discover(plugins).extensions)
        comparison = compare_pictures(pipelines, reference, plugins=plugins)
    else:
        from rendergraph.compare import compare

        names, variants = _variants(pipelines, withs, select)
        check_thresholds(thresholds, variants[0].link().catalog.extensions)
        against = load_reference(reference, select)
        given = {name: value for name, value in settings.items() if value is not None}
        comparison = compare(variants, against, names=names, progress=on_terminal(), **given)
    warn(comparison.warnings)
    for line in comparison.notes:
        say(line)
    beyond = exceeded(comparison.results, thresholds)
    for output in outputs:
        _write(comparison, output, crops, title=title, note=note)
    if as_json:
        written = {"report": str(outputs[0]), "outputs": [*map(str, outputs)]} if outputs else {}
        emit_json(comparison.as_json() | written | {"exceeded": beyond})
    else:
        emit(comparison_text(comparison))
        for output in outputs:
            say(f"report: {output}")
    for text in beyond:
        say(text, always=True)
    if beyond:
        raise click.exceptions.Exit(BEYOND)


def _variants(
    names: Sequence[str], withs: Sequence[Sequence[str]], select: options.Select
) -> tuple[list[str], list[Pipeline]]:
    """Return the variants, and their names where these are not the pipelines'."""
    if not withs:
        return [], [_load(name, names, select) for name in names]
    variants = [(), *withs] if len(withs) == 1 else list(withs)
    base, pipelines = select(names[0]), []
    for settings in variants:
        pipelines.append(_set_by("--with", settings, replace(base, sets=(*base.sets, *settings))))
        warn(pipelines[-1].link().warnings)
    return [" ".join(settings) or Path(names[0]).stem for settings in variants], pipelines


def _are_pictures(names: Sequence[str], reference: str | None, select: options.Select) -> bool:
    """Whether all are pictures, and no option changes them or how they are rendered."""
    from rendergraph.session import Selection
    from rendergraph.session.picture_metadata import is_picture

    source, context = click.core.ParameterSource, click.get_current_context()
    drawn = {"frames", "frame", "device", "executor", "reference_noise", "reference_samples", "reference_seconds"}
    if any(context.get_parameter_source(name) is source.COMMANDLINE for name in drawn):
        return False
    changed = select("") != Selection("", plugins=select("").plugins)
    return not changed and all(map(is_picture, [*names, *([reference] if reference else [])]))


def _load(name: str, names: Sequence[str], select: options.Select) -> Pipeline:
    """Return one of the pipelines; where an -s fits only another one, the message says how to apply it there."""
    other = next((other for other in names if other != name), None)

    def explained(problem: Problem) -> Problem:
        if problem.code == "RG510":
            return problem.relocate(problem.place, hint=f"; to measure pipelines against it: --reference {name}")
        if other is None or problem.place is None or not problem.place.option("--set"):
            return problem
        way = f"; -s applies to all pipelines; for one alone: rendergraph compare {other} --reference {name} -s …"
        return problem.relocate(problem.place, context=f"in {name}", hint=way)

    try:
        return options.linked(select(name))
    except InputError as error:
        raise error.relocated(explained) from None


def _set_by(option: str, settings: Sequence[str], selection: Selection) -> Pipeline:
    """Return the pipeline with settings from an option; mistakes in them are located at this option."""
    from rendergraph.session import Pipeline

    def located(problem: Problem) -> Problem:
        setting = problem.place.option("--set") if problem.place else None
        typed = setting is not None and setting.text in settings
        return problem.relocate(Place(Option(option, f"'{setting.text}'"))) if setting and typed else problem

    pipeline = Pipeline(selection)
    try:
        pipeline.link()
    except InputError as error:
        raise error.relocated(located) from None
    return pipeline


def load_reference(reference: str | None, select: options.Select) -> Path | Pipeline | None:
    """Return the reference: a picture's path, or a pipeline with the same scene, without the variants' settings."""
    from rendergraph.pipelines.references import reference_selection
    from rendergraph.session.picture_metadata import is_picture

    if reference is None:
        return None
    if is_picture(reference):
        return Path(reference)
    selection = reference_selection(select(reference))
    return _set_by("--reference", selection.sets, selection)  # it gets another scene, so its warnings do not apply


def _write(comparison: Comparison, output: Path, crops: Sequence[Any], *, title: str, note: str) -> None:
    """Write a comparison as a page, a figure or a table, by the extension."""
    suffix = output.suffix.lower()
    if suffix in _FIGURES:
        comparison.figure(crops, caption=note or title, errors=not crops).savefig(output, dpi=300)
        return
    if suffix == ".tex":
        from rendergraph.compare.report.figure import latex_table

        text = latex_table(*summary(comparison.results))
    elif suffix == ".csv":
        from rendergraph.compare.export.table import csv_text

        text = csv_text(comparison)
    else:
        from rendergraph.compare.report import comparison_page

        text = comparison_page(comparison, options.command_line(), title=title, note=note)
    options.write(text, output)


def exceeded(results: Sequence[Result], thresholds: Sequence[Threshold]) -> list[str]:
    """Return a line for each value above its threshold; NaN and unknown values are above every one."""
    lines = []
    for result in results:
        values = {**result.metrics.as_json(), "radiance_rmse": result.radiance_rmse, **result.metrics.plugins}
        values["relative_mse"] = result.relative_mse
        for metric, most in thresholds:
            value = values.get(metric) if not result.not_finite else math.nan
            if value is None or not value <= most:
                shown = "unknown" if value is None else f"{value:.6g}"
                lines.append(f"{result.name}: {metric} is {shown}, above {most:g}")
    return lines


def summary(results: Sequence[Result]) -> tuple[tuple[str, ...], list[tuple[object, ...]]]:
    """Return the headings and a row for each variant: errors, times, passes, bytes; for pictures only errors."""
    own = dict.fromkeys(name for result in results for name in result.columns)
    columns: list[tuple[str, Callable[[Result], object]]] = [
        ("", lambda r: r.name),
        ("FLIP", lambda r: f"{r.metrics.flip:.4f}"),
        ("RMSE", lambda r: f"{r.metrics.rmse:.4f}"),
        ("PSNR", lambda r: "∞" if r.metrics.psnr is None else f"{r.metrics.psnr:.2f}"),
        ("SSIM", lambda r: f"{r.metrics.ssim:.4f}"),
        *((name, lambda r, name=name: _number(r.columns.get(name))) for name in own),
    ]
    if any(result.relative_mse is not None for result in results):
        columns.insert(3, ("rel. MSE", lambda r: _number(r.relative_mse)))
    if all(result.memory for result in results):
        columns.append(("GPU ms", lambda r: f"{r.times.gpu_ms.median:.2f}" if r.times.gpu_ms else "–"))
        columns.append(("10–90 %", lambda r: f"{gpu.p10:.2f}–{gpu.p90:.2f}" if (gpu := r.times.gpu_ms) else ""))
        if any(result.times.repeated for result in results):
            columns.append(("repeats", lambda r: f"{s.min:.2f}–{s.max:.2f}" if (s := r.times.repeated) else ""))
        columns.append(("CPU ms", lambda r: f"{r.times.cpu_ms.median:.2f}"))
        columns.append(("passes", lambda r: r.pass_count))
        columns.append(("textures", lambda r: format_bytes(r.allocated_bytes)))
    rows = [tuple(value_of(result) for _, value_of in columns) for result in results]
    return tuple(name for name, _ in columns), rows


def _number(value: float | None) -> str:
    return "–" if value is None else f"{value:.4g}"


def comparison_text(comparison: Comparison) -> str:
    """Return what `compare` prints."""
    width, height = comparison.size
    heads, rows = summary(comparison.results)
    where = [comparison.scene, f"{width}×{height}", f"against {comparison.reference.name}"]
    where += [f"of {comparison.metric}"] if comparison.metric else []
    where += [f"on {comparison.device.get('renderer')}"] if comparison.device else []
    lines = [", ".join(filter(None, where)), table(rows, heads, right=range(1, len(heads)))]
    if comparison.software:
        lines.append(SOFTWARE)
    lines += truth_lines(comparison)
    lines += [_difference(comparison, result) for result in comparison.results]
    return "\n".join(filter(None, lines))


def truth_lines(comparison: Comparison) -> list[str]:
    """Return the noise of a ground truth, and the technique that causes most of each variant's error."""
    reference, share = comparison.reference, comparison.noise_share
    if reference.noise is None:
        return []
    part = f", {100 * share:.2g} % of the smallest error" if share is not None else ""
    noise = f"relative MSE {reference.noise:.3g}{part}; FLIP {reference.flip_noise:.2g}"
    causes = [f"{result.name}: {result.cause}" for result in comparison.results if result.cause]
    return [f"noise of {reference.name} after {reference.samples} samples: {noise}", *causes]


def _difference(comparison: Comparison, result: Result) -> str:
    """Return the first pass that differs from the base; for a picture, the differences of its pipeline."""
    base = comparison.base[0] if comparison.base else ""
    if result.name == base or result.difference is None:
        return ""
    if result.plan is not None:
        if (first := result.first) is None:
            return f"{result.name}: every pass renders the same as in {base}"
        where = f"{first.node} ({first.port}){first.after}"
        return f"{result.name}: the first pass that differs from {base} is {where}, {first.amount}"
    if not result.difference:
        return f"{result.name}: made with the same pipeline as {base}"
    from rendergraph.diff import diff_text

    return diff_text(result.difference).rstrip()
