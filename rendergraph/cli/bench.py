"""`rendergraph bench`: time each pass."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from rendergraph.cli import options
from rendergraph.cli.lazy_click import click
from rendergraph.cli.output import emit, emit_json, say, table, warn
from rendergraph.formatting import format_bytes

if TYPE_CHECKING:
    from rendergraph.session import Selection


@click.command("bench", no_args_is_help=True)
@options.pipeline_options
@click.option("-n", "--frames", type=click.IntRange(1, 100_000), default=30, show_default=True, help="Measured frames.")
@click.option("--fps", type=options.POSITIVE, default=30.0, show_default=True, help="Frames per second.")
@options.alias_option
@options.heap_option
@click.option("--steps", is_flag=True, help="Also time each step of a pass.")
@options.json_option
@options.device_option
@options.draw_timeout_option
def bench(selection: Selection, frames: int, steps: bool, as_json: bool, device: int | None, **modes: Any) -> None:
    """Time each pass.

    Prints the median time of each pass over all frames, with its spread. All of the pipeline's outputs are computed.
    One warm-up frame is rendered first and not measured. Times of a software renderer say nothing about GPUs.

    \b
    Examples:
      rendergraph bench forward --frames 5 --size 320x180
      rendergraph bench forward --frames 5 --size 320x180 --json
      rendergraph bench bloom --frames 5 --size 320x180 --steps
    """
    from msgspec import to_builtins

    from rendergraph.compare.timing import step_times, times_of
    from rendergraph.session import RenderOptions, stages
    from rendergraph.session.gpu import Gpu

    expanded = stages.expand(options.link(selection), RenderOptions(range(1, frames + 1), timed=True, **modes))
    with Gpu(device) as gpu:
        frame = stages.draw_last(expanded, gpu)
    warn(frame.warnings)
    types = {str(entry["node"]): str(entry["type"]) for entry in frame.passes}
    times = to_builtins(times_of(frame.times, types))
    report: dict[str, Any] = frame.as_json() | {name: times[name] for name in ("frames", "frame_ms", "passes")}
    if steps:
        report["steps"] = step_times(frame.times)
    emit_json(report) if as_json else emit(_text(report))
    if report["device"]["software"]:
        say(f"software rendering on {report['device']['renderer']}: these times say nothing about GPUs")


def _text(report: dict[str, Any]) -> str:
    rows: list[tuple[str, ...]] = []
    for entry in report["passes"]:
        rows.append((entry["node"], entry["type"], *_figures(entry["gpu_ms"]), *_figures(entry["cpu_ms"])))
        own = [step for step in report.get("steps", ()) if step["node"] == entry["node"]]
        for step in own if len(own) > 1 else ():
            name = f"  {step['step']} {step['label']}"
            rows.append((name, "", *_figures(step["gpu_ms"]), *_figures(step["cpu_ms"])))
    rows.append(("frame", "", "", "", *_figures(report["frame_ms"])))
    width, height = report["size"]
    device, memory = report["device"], report["memory"]
    allocated, unshared = (format_bytes(memory[name]) for name in ("allocated_bytes", "no_reuse_bytes"))
    title = f"{report['pipeline']}, {width}×{height}, {report['frames']} frames on {device['renderer']}"
    title += " (software)" if device["software"] else ""
    times = table(rows, ("pass", "type", "GPU ms", "10–90 %", "CPU ms", "10–90 %"), right=(2, 3, 4, 5))
    return f"{title}\n{times}\ntextures: {allocated}, {unshared} without reuse"


def _figures(figures: dict[str, float] | None) -> tuple[str, str]:
    if figures is None:
        return "–", ""
    return f"{figures['median']:.3f}", f"{figures['p10']:.3f}–{figures['p90']:.3f}"
