"""`rendergraph run`: pictures."""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rendergraph.cli import options
from rendergraph.cli.options import Target
from rendergraph.cli.output import Progress, Warnings, emit, emit_json, say_summary
from rendergraph.cli.words import click
from rendergraph.errors import InputError, Problem, UsageError

if TYPE_CHECKING:
    from rendergraph.session import Frame, RenderOptions, Selection
    from rendergraph.session.gpu import Gpu
    from rendergraph.session.values import Expanded


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
    selection: Selection,
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
    from rendergraph.session import RenderOptions
    from rendergraph.session.gpu import Gpu

    modes = RenderOptions(frames or range(1, 2), fps, alias=not no_alias, poison=poison, shuffle=shuffle)
    warnings = Warnings()
    read = partial(_read, selection, modes, outputs, taps, warnings)
    draw = partial(_draw, warnings=warnings, quiet=as_json)
    if watch:
        from rendergraph.cli.watching import keep_drawing

        keep_drawing(lambda gpu: draw(*read(), gpu), device, as_json=as_json)
        return
    expanded, targets = read()
    with Gpu(device) as gpu:
        report = draw(expanded, targets, gpu)
    say_summary(report)
    if as_json:
        emit_json(report)


def _read(
    selection: Selection,
    modes: RenderOptions,
    outputs: tuple[Target, ...],
    taps: tuple[Target, ...],
    warnings: Warnings,
) -> tuple[Expanded, list[Target]]:
    """Everything before the device is opened: what is to be drawn, and the files it goes to, each with its name."""
    from rendergraph import images
    from rendergraph.session import stages

    linked = stages.link(stages.resolve(selection))
    warnings.say(linked.warnings)
    if not outputs and not taps:
        stem = Path(selection.source).stem
        outputs = (Target("", Path(f"{stem}.####.png" if len(modes.frames) > 1 else f"{stem}.png")),)
    known = linked.graph.outputs
    named = [t if t.name else replace(t, name=images.output_for(t.path, known)) for t in outputs]
    expanded = stages.expand(linked, replace(modes, outputs=_names(named), taps=_names(taps)))
    targets = [*named, *taps]
    _check(targets, expanded)
    return expanded, targets


def _names(targets: Iterable[Target]) -> tuple[str, ...]:
    return tuple(dict.fromkeys(target.name for target in targets))


def _draw(
    expanded: Expanded, targets: Sequence[Target], gpu: Gpu, *, warnings: Warnings, quiet: bool
) -> dict[str, Any]:
    """Draw and write everything; the document of `--json`. Paths are printed unless `quiet`."""
    from rendergraph import images
    from rendergraph.session import stages

    written: list[str] = []
    progress = Progress(len(expanded.options.frames))
    frame: Frame | None = None
    for frame in stages.draw(expanded, gpu):
        files = [
            images.Saved(images.numbered(t.path, frame.number), frame[t.name], frame.info(t.name), raw=t.is_tap)
            for t in targets
        ]
        images.save_outputs(files, frame.metadata)
        progress.clear()
        for file in files:
            written.append(str(file.path))
            if not quiet:
                emit(str(file.path))
        progress.show(len(written) // len(targets))
    progress.clear()
    assert frame is not None  # a range of frames has one at least
    warnings.say(frame.warnings)
    return frame.as_json() | {"outputs": written}


def _check(targets: Sequence[Target], expanded: Expanded) -> None:
    """Everything that can be said about the files before anything is rendered."""
    from rendergraph import images
    from rendergraph.images.saving import extension

    linked, numbers = expanded.linked, expanded.options.frames
    for name, port in expanded.wanted.items():
        if linked.graph.textures[port.end].desc is None:
            text = f"'{name}' is a buffer, which no picture file holds; from Python it is frame['{name}']"
            raise InputError(Problem("RG508", text))
    selection = linked.selection
    inputs = {os.path.realpath(name) for name in (selection.source, selection.scene, selection.environment) if name}
    seen: set[str] = set()
    for target in targets:
        extension(target.path)
        place = os.path.realpath(target.path)
        if place in seen:
            raise UsageError(Problem("RG502", f"two pictures go to '{target.path}'; give each a file of its own"))
        seen.add(place)
        if place in inputs and os.path.exists(place):
            raise UsageError(Problem("RG502", f"'{target.path}' is read by this very run; write to another file"))
        if len(numbers) > 1 and not images.is_numbered(target.path):
            better = target.path.with_name(f"{target.path.stem}.####{target.path.suffix}")
            text = f"{len(numbers)} frames do not fit one file '{target.path}'; number them: '{better}'"
            raise UsageError(Problem("RG503", text))
        images.check_target(target.path)
