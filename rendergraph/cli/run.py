"""`rendergraph run`: pictures."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rendergraph.cli import options
from rendergraph.cli.options import Target
from rendergraph.cli.output import Progress, Warnings, emit, emit_json, say
from rendergraph.cli.words import click
from rendergraph.errors import InputError, Problem, UsageError

if TYPE_CHECKING:
    import rendergraph as rg


@click.command("run", no_args_is_help=True)
@options.pipeline_options
@click.option("--frames", type=options.FRAMES, help="Render these frames; `####` in a file's name numbers them.")
@click.option("--fps", type=options.POSITIVE, default=30.0, show_default=True, help="Frames a second.")
@click.option("-o", "--output", "outputs", multiple=True, type=options.OUTPUT, help="Write an output to a file.")
@click.option("--tap", "taps", multiple=True, type=options.TAP, help="Write any port's texture to a file.")
@options.json_option
@options.device_option
@click.option("--watch", is_flag=True, help="Stay, and render again whenever a file that went into it changes.")
@click.option("--no-alias", is_flag=True, help="Give every texture memory of its own.")
@click.option("--poison", is_flag=True, help="Overwrite textures that are dead, to show who still reads them.")
@click.option("--shuffle", type=int, metavar="SEED", help="Run the steps in another legal order.")
def command(
    frames: range | None,
    fps: float,
    outputs: tuple[Target, ...],
    taps: tuple[Target, ...],
    as_json: bool,
    device: int | None,
    watch: bool,
    no_alias: bool,
    poison: bool,
    shuffle: int | None,
    **selection: Any,
) -> None:
    """Render a pipeline to picture files.

    The extension chooses the format, and the output where none is named: PNG and JPEG take `image`, EXR and HDR take
    `radiance`. Without -o the picture goes to PIPELINE.png in the current folder.

    \b
    Examples:
      rendergraph run forward
      rendergraph run forward --scene spheres --size 640x360 -o spheres.exr --json
      rendergraph run forward -s light.ambient=0 -o image=dark.jpg --tap sun.shadow_map=depth.exr
      rendergraph run forward --frames 1-3 --size 320x180 -o turn.####.png
      rendergraph run my.yaml --watch
    """
    numbers = frames or range(1, 2)
    modes = {"alias": not no_alias, "poison": poison, "shuffle": shuffle, "fps": fps, "device": device}
    draw = partial(_draw, selection, numbers, outputs, taps, modes, quiet=as_json)
    if watch:
        from rendergraph.cli.watching import keep_drawing

        keep_drawing(draw, selection, device, as_json=as_json)
        return
    report = draw(Warnings())
    say_summary(report)
    if as_json:
        emit_json(report)


def _draw(
    selection: dict[str, Any],
    numbers: range,
    outputs: tuple[Target, ...],
    taps: tuple[Target, ...],
    modes: dict[str, Any],
    warnings: Warnings,
    session: rg.Session | None = None,
    *,
    quiet: bool,
) -> dict[str, Any]:
    """Read, draw and write everything; the document of `--json`. Paths are printed unless `quiet`."""
    from rendergraph import images

    pipeline = options.make(**selection)
    warnings.say(pipeline.warnings)
    if not outputs and not taps:
        stem = Path(selection["pipeline"]).stem
        outputs = (Target(None, Path(f"{stem}.####.png" if len(numbers) > 1 else f"{stem}.png")),)
    known = pipeline.graph.outputs
    outputs = tuple(t if t.name else replace(t, name=images.output_for(t.path, known)) for t in outputs)
    targets = [*outputs, *taps]
    wanted = list(dict.fromkeys(target.name for target in outputs if target.name))
    tapped = list(dict.fromkeys(target.name for target in taps if target.name))
    for name, end in pipeline.wanted(wanted, tapped).items():
        if pipeline.graph.textures[end].desc is None:
            text = f"'{name}' is a buffer, which no picture file holds; from Python it is frame['{name}']"
            raise InputError(Problem("RG508", text))
    _check(targets, numbers, selection)

    written: list[str] = []
    progress = Progress(len(numbers))

    def save(frame: Any) -> None:
        files = [
            images.Saved(images.numbered(t.path, frame.number), frame[t.name], frame.info(t.name), raw=t in taps)
            for t in targets
            if t.name
        ]
        images.save_outputs(files, frame.metadata)
        progress.clear()
        for file in files:
            written.append(str(file.path))
            if not quiet:
                emit(str(file.path))
        progress.show(len(written) // len(targets))

    frame = pipeline.render(frames=numbers, outputs=wanted, taps=tapped, on_frame=save, session=session, **modes)
    progress.clear()
    warnings.say(frame.warnings)
    return frame.as_json() | {"outputs": written}


def _check(targets: Sequence[Target], numbers: range, selection: dict[str, Any]) -> None:
    """Everything that can be said about the files before anything is rendered."""
    from rendergraph import images
    from rendergraph.images.saving import extension

    inputs = {os.path.realpath(str(selection[key])) for key in ("pipeline", "scene", "environment") if selection[key]}
    seen: dict[str, Path] = {}
    for target in targets:
        extension(target.path)
        place = os.path.realpath(target.path)
        if place in seen:
            raise UsageError(Problem("RG502", f"two pictures go to '{target.path}'; give each a file of its own"))
        seen[place] = target.path
        if place in inputs and os.path.exists(place):
            raise UsageError(Problem("RG502", f"'{target.path}' is read by this very run; write to another file"))
        if len(numbers) > 1 and not images.is_numbered(target.path):
            name = target.path.with_name(f"{target.path.stem}.####{target.path.suffix}")
            text = f"{len(numbers)} frames do not fit one file '{target.path}'; number them: '{name}'"
            raise UsageError(Problem("RG503", text))
        images.check_target(target.path)


def say_summary(report: dict[str, Any]) -> None:
    """What was not drawn, how large, how long and on what."""
    for node, reason in report["culled"].items():
        say(f"not drawn: {node}: {reason}")
    device, (width, height) = report["device"], report["size"]
    passes = len(report["passes"])
    count = f"{passes} pass{'' if passes == 1 else 'es'}"
    text = f"{width}×{height}, {count}, {report['frame_ms']['median']:.1f} ms a frame"
    say(f"{text} on {device['renderer']}" + (" (software: no measure of a GPU)" if device["software"] else ""))
