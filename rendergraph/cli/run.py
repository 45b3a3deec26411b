"""`rendergraph run`: render pictures."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from msgspec.structs import replace

from rendergraph.cli import options
from rendergraph.cli.lazy_click import click
from rendergraph.cli.options import Target
from rendergraph.cli.output import emit, emit_json, progress_bar, say_event, say_summary, warn
from rendergraph.errors import InputError, Place, Problem, UsageError
from rendergraph.stamps import track_reads

if TYPE_CHECKING:
    from rendergraph.farm import Executor
    from rendergraph.images import Saved
    from rendergraph.session import Frame, RenderOptions, Selection
    from rendergraph.session.gpu import Gpu
    from rendergraph.session.values import Expanded, Linked


@click.command("run", no_args_is_help=True)
@options.pipeline_options
@click.option(
    "--frames",
    type=options.FRAMES_OR_CLIP,
    help="Frames to render, or `clip` for the scene's motion once (the default of films); `####` in a file name "
    "becomes the number.",
)
@click.option("--seconds", type=options.POSITIVE, help="Render this many seconds from frame 1 on.")
@click.option("--turntable", is_flag=True, help="Move the camera once around its target; 4 seconds by default.")
@click.option("--resume", is_flag=True, help="Skip numbered frames that an interrupted run has already written.")
@click.option("--fps", type=options.POSITIVE, help="Frames per second.  [default: 30]")
@click.option(
    "--subframes",
    type=click.IntRange(1, 4096),
    metavar="N",
    help="Render each frame at N moments while the shutter is open, and average their light.",
)
@click.option("-o", "--output", "outputs", multiple=True, type=options.OUTPUT, help="Write an output to a file.")
@click.option("--tap", "taps", multiple=True, type=options.TAP, help="Write any port's texture to a file.")
@click.option(
    "--tap-all",
    type=options.NamedPath(file_okay=False),
    metavar="FOLDER",
    help="Write every port's texture as a picture, and a contact sheet of all.",
)
@options.executor_options
@options.json_option
@options.device_option
@click.option("--watch", is_flag=True, help="Keep running, and render again whenever an input file changes.")
@click.option(
    "--reuse/--no-reuse",
    default=None,
    help="Skip steps whose results are unchanged since the previous frame.  [default: unless --json, which times them]",
)
@click.option(
    "--no-cull", "cull", is_flag=True, flag_value=False, default=True, help="Draw objects outside the view frustum too."
)
@options.alias_option
@options.heap_option
@click.option("--poison", is_flag=True, help="Overwrite textures after their last use, to reveal later reads.")
@click.option("--shuffle", type=int, metavar="SEED", help="Run the steps in another legal order.")
def run(
    selection: Selection,
    frames: range | Literal["clip"] | None,
    seconds: float | None,
    turntable: bool,
    resume: bool,
    fps: float | None,
    subframes: int | None,
    outputs: tuple[Target, ...],
    taps: tuple[Target, ...],
    tap_all: Path | None,
    executor: str | None,
    devices: tuple[int, ...],
    timeout: float | None,
    as_json: bool,
    device: int | None,
    watch: bool,
    **modes: Any,
) -> None:
    """Render a pipeline to picture files.

    The extension selects the format, and the output if none is named: PNG and JPEG get `image`, EXR and HDR get
    `radiance`. Without -o the picture is PIPELINE.png in the current folder. A PNG or EXR picture written by `run` can
    be used as PIPELINE: it contains the pipeline, camera and frame that made it. FILE.mp4, .webp or .gif is a film of
    all frames, by default as long as the scene's motion.
    With --executor several processes or machines share the frames; the pictures are the same.

    \b
    Examples:
      rendergraph run forward
      rendergraph run forward --scene spheres --size 640x360 -o spheres.exr --json
      rendergraph run forward -s display.exposure=-2 -o image=dark.jpg --tap sun.shadow_map=depth.exr
      rendergraph run forward --tap-all inside
      rendergraph run forward --frames 1-3 --size 320x180 -o turn.####.png
      rendergraph run forward --scene salamander --size 160x90 --seconds 0.2 -o walk.mp4
      rendergraph run forward --frames 1-12 --size 64x36 --executor processes:2 -o turn.####.png
      rendergraph run my.yaml --watch
      rendergraph run spheres.exr -s display.exposure=-1 -o darker.png
    """
    from rendergraph.images.video import is_film
    from rendergraph.session import RenderOptions
    from rendergraph.session.gpu import Gpu
    from rendergraph.session.scenes import film_frames

    def render_options(linked: Linked) -> RenderOptions:
        number, rate = linked.frames, fps or linked.fps
        if frames or seconds or turntable or any(is_film(target.path) for target in outputs):
            number = film_frames(linked.scene, rate, frames, seconds, turntable=turntable)
        moments, circle = subframes or linked.subframes, number if turntable else None
        return RenderOptions(number, rate, timed=as_json, subframes=moments, turntable=circle, **modes)

    warned: set[object] = set()
    read = partial(_read, selection, render_options, (*outputs, *taps), tap_all, warned, resume=resume)
    draw = partial(_draw, sheet=tap_all, warned=warned, quiet=as_json)
    if watch:
        if executor is not None:
            raise UsageError(Problem("RG500", "--watch renders in this process; leave out --executor"))
        from rendergraph.cli.watching import watch_and_render

        watch_and_render(lambda gpu: draw(*read(), gpu), device, as_json=as_json)
        return
    with track_reads() as files:
        expanded, targets = read()
    if executor in (None, "serial"):
        with Gpu(devices[0] if devices and device is None else device) as gpu:
            report = draw(expanded, targets, gpu)
    else:
        from rendergraph.farm.bundle import make_bundle
        from rendergraph.farm.executors import make_executor

        if tap_all is not None:
            raise UsageError(Problem("RG500", "--tap-all renders in this process; leave out --executor"))
        modules = {type(node.node).__module__ for node in expanded.linked.graph.nodes}
        with make_executor(executor, None, device, tasks=2, devices=devices, timeout=timeout) as farm:
            farm.upload_inputs(lambda: make_bundle(files, selection.plugins, modules))
            report = draw_in_parts(expanded, targets, farm, warned=warned, quiet=as_json)
    say_summary(report)
    if as_json:
        emit_json(report)


def _read(
    selection: Selection,
    modes_of: Callable[[Linked], RenderOptions],
    targets: tuple[Target, ...],
    tap_all: Path | None,
    warned: set[object],
    *,
    resume: bool,
) -> tuple[Expanded, list[Target]]:
    """Do everything that needs no GL device: return the expanded pipeline, and the output files by their names."""
    from rendergraph import images
    from rendergraph.images.saving import extension
    from rendergraph.images.video import ENDINGS, is_film
    from rendergraph.session import stages
    from rendergraph.session.scenes import standstill_warning
    from rendergraph.session.values import every_port, figures

    with track_reads() as files:
        linked = stages.link(stages.resolve(selection))
    warn(linked.warnings, warned)
    modes = modes_of(linked)
    ending = ".####.png" if len(modes.frames) > 1 else ".png"
    if not targets and tap_all is None:
        targets = (Target("", _default(selection.label, ending)),)
    if tap_all is not None:
        ports = every_port(stages.plan(stages.expand(linked, modes)))
        targets += tuple(
            Target(port, tap_all / f"{number:02d}-{port.replace('/', '-')}{ending}", is_tap=True, on_sheet=True)
            for number, port in enumerate(ports, start=1)
        )
    named = []
    for target in targets:
        picture = target.path.with_suffix(".png") if is_film(target.path) else target.path  # films consist of pictures
        if not target.is_tap:
            extension(picture, ENDINGS)
        named.append(replace(target, name=target.name or images.output_for(picture, linked.graph.outputs)))
    wanted = dict.fromkeys((*(target.name for target in named if not target.is_tap), *figures(linked.graph)))
    tapped = dict.fromkeys(target.name for target in named if target.is_tap)
    expanded = stages.expand(linked, replace(modes, outputs=tuple(wanted), taps=tuple(tapped)))
    if tap_all is not None:
        _make_folder(tap_all)
    _check(named, expanded, map(Path, files))
    warn(standstill_warning(expanded, film=any(is_film(target.path) for target in named)), warned)
    return (_resumed(expanded, named) if resume else expanded), named


def _resumed(expanded: Expanded, targets: Sequence[Target]) -> Expanded:
    """Return the run without the frames before the first one that lacks a file."""
    from rendergraph.images import is_numbered, numbered
    from rendergraph.session.picture_metadata import frame_metadata, metadata, pipeline_metadata, turntable_metadata

    if single := next((target for target in targets if not is_numbered(target.path)), None):
        text = f"--resume continues numbered frames, and '{single.path}' has no `####`; leave one of them out"
        raise UsageError(Problem("RG500", text))
    options, frames = expanded.options, expanded.options.frames
    film = pipeline_metadata(expanded.linked) | turntable_metadata(expanded)
    # The camera of a turntable's frame follows from the turntable's own metadata.
    free = {"versions", "device", *(["camera"] if options.turntable else [])}
    for number in frames:
        paths = [numbered(target.path, number) for target in targets]
        if not all(path.is_file() for path in paths):
            frames = frames[frames.index(number) :]
            break
        made = film | frame_metadata(number, options.fps, options.subframes)
        own = {name.removeprefix("rendergraph:"): text for name, text in made.items()}
        for path in (path for path in paths if path.suffix.lower() in (".png", ".exr")):
            found = metadata(path)
            other = [name for name in (own.keys() | found) - free if own.get(name) != found.get(name)]
            if other:
                text = f"differs from this film in its {max(other)}; without --resume all frames are rendered again"
                raise InputError(Problem("RG512", text, Place(str(path))))
    else:
        frames = frames[-1:]  # all exist; the report describes the last one
    return replace(expanded, options=replace(expanded.options, frames=frames))


def _default(source: str, ending: str) -> Path:
    """Return the file to write without -o; a picture given as PIPELINE is not overwritten."""
    from rendergraph.session.picture_metadata import is_picture

    if is_picture(source):
        kind = ".exr" if source.lower().endswith(".exr") else ".png"
        return Path(f"{Path(source).stem}-again{ending.removesuffix('.png')}{kind}")
    return Path(f"{Path(source).stem}{ending}")


def _make_folder(folder: Path) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        text = f"cannot be created: {error.strerror or error}"
        raise InputError(Problem("RG504", text, Place(str(folder)))) from error


def _draw(
    expanded: Expanded, targets: Sequence[Target], gpu: Gpu, *, sheet: Path | None, warned: set[object], quiet: bool
) -> dict[str, Any]:
    """Render and write everything, print the paths unless `quiet`, and return the document of `--json`."""
    from rendergraph import images
    from rendergraph.images.video import films, is_film
    from rendergraph.session import stages

    written: list[str] = []

    def show(path: Path) -> None:
        written.append(str(path))
        if not quiet:
            emit(str(path))

    contact = "contact.####.png" if len(expanded.options.frames) > 1 else "contact.png"
    pictures = [target for target in targets if not is_film(target.path)]
    moving = [target for target in targets if is_film(target.path)]
    progress = progress_bar(len(expanded.options.frames))
    frame: Frame | None = None
    suspect: Frame | None = None
    with films([target.path for target in moving], expanded.options.fps, expanded.options.frames[0]) as open_films:
        for done, frame in enumerate(stages.draw(expanded, gpu), start=1):
            files = [
                images.Saved(images.numbered(t.path, frame.number), frame.arrays[t.name], frame.info(t.name), t.is_tap)
                for t in pictures
            ]
            if sheet is not None:
                files = _with_sheet(files, pictures, images.numbered(sheet / contact, frame.number))
            if files:
                images.save_outputs(files, frame.metadata)
            for target in moving:
                shown = images.viewable_as(frame.arrays[target.name], frame.info(target.name))
                open_films[target.path].add(frame.number, shown)
            progress.clear()
            for file in files:
                show(file.path)
            progress(done, len(expanded.options.frames))
            suspect = suspect or (frame if frame.unsound else None)
    progress.clear()
    for target in moving:
        show(target.path)
    assert frame is not None  # a range of frames is never empty
    broken = stages.not_finite_warnings(suspect, expanded, gpu) if suspect else ()
    warn([*frame.warnings, *(broken or stages.exposure_warnings(frame, expanded.linked))], warned)
    return frame.as_json() | {"outputs": written}


def _with_sheet(files: Sequence[Saved], targets: Sequence[Target], path: Path) -> list[Saved]:
    """Return the files, those of the contact sheet as viewable pictures, and the sheet."""
    from rendergraph import images

    viewed = images.PictureInfo("display_color", "rgba8", "display")
    done, tiles = [], []
    for file, target in zip(files, targets, strict=True):
        if target.on_sheet:
            height, width = file.pixels.shape[-3:-1]
            layers = f", {len(file.pixels)} layers" if file.pixels.ndim == 4 and len(file.pixels) > 1 else ""
            note = f"{file.info.format} {width}×{height}{layers}"
            file = file._replace(pixels=images.viewable_as(file.pixels, file.info), info=viewed)
            tiles.append((file.pixels, f"{target.path.name.partition('-')[0]} {target.name}", note))
        done.append(file)
    from rendergraph.images.viewable import contact_sheet

    return [*done, images.Saved(path, contact_sheet(tiles), viewed)]


def _check(targets: Sequence[Target], expanded: Expanded, files: Iterable[Path]) -> None:
    """Refuse output files that cannot be written, before anything is rendered; `files` are those that were read."""
    from rendergraph import images
    from rendergraph.images.video import check_film, is_film

    linked, numbers = expanded.linked, expanded.options.frames
    for name, port in expanded.requests.items():
        if linked.graph.textures[port.end].desc is None:
            text = f"'{name}' is a buffer, which picture files cannot store; read it in Python as frame['{name}']"
            raise InputError(Problem("RG508", text))
    selection = linked.selection
    named = [Path(name) for name in (selection.label, selection.scene, selection.environment) if name]
    inputs = {os.path.realpath(name) for name in (*named, *files) if name.is_file()}
    seen: set[str] = set()
    for target in targets:
        if is_film(target.path):
            check_film(target.path)
        place = os.path.realpath(target.path)
        if place in seen:
            raise UsageError(Problem("RG502", f"two outputs have the same file '{target.path}'; name two files"))
        seen.add(place)
        if place in inputs or any(images.stands_for(target.path, name) for name in inputs):
            raise UsageError(Problem("RG502", f"'{target.path}' is also an input of this run; write to another file"))
        if len(numbers) > 1 and not images.is_numbered(target.path) and not is_film(target.path):
            better = target.path.with_name(f"{target.path.stem}.####{target.path.suffix}")
            text = f"{len(numbers)} frames do not fit one file '{target.path}'; number them: '{better}'"
            raise UsageError(Problem("RG503", text))
        images.check_target(target.path)


def draw_in_parts(
    expanded: Expanded, targets: Sequence[Target], farm: Executor, *, warned: set[object], quiet: bool
) -> dict[str, Any]:
    """Render and write everything, and return the document of `--json`. Paths are printed unless `quiet`."""
    import dataclasses  # not needed by --help

    from rendergraph import images
    from rendergraph.farm.frames import FrameFile, RenderedFrame, render_chunks, split_frames
    from rendergraph.images.files import write_file
    from rendergraph.images.video import films, is_film

    warm_up = expanded.linked.spec.tree.get("warm_up")
    files = [FrameFile(t.name, "" if is_film(t.path) else t.path.suffix, t.is_tap) for t in targets]
    chunks = split_frames(expanded, files, farm.workers, None if warm_up is None else int(warm_up.plain()))
    frames, written = expanded.options.frames, dict[int, list[str]]()
    progress, lasts = progress_bar(len(frames)), list["Frame"]()
    with films([t.path for t in targets if is_film(t.path)], expanded.options.fps, frames[0]) as open_films:
        for item in render_chunks(farm, chunks):
            if not isinstance(item, RenderedFrame):
                lasts.append(item)
                continue
            paths = written.setdefault(item.number, [])
            for target, data in zip(targets, item.files, strict=True):
                if not isinstance(data, bytes):
                    open_films[target.path].add(item.number, data)
                    continue
                path = images.numbered(target.path, item.number)
                write_file(path, data)
                paths.append(str(path))
                if not quiet:
                    progress.clear()
                    emit(str(path))
            progress(len(written), len(frames))
            if quiet:
                say_event({"event": "frame", "frame": item.number, "done": len(written), "of": len(frames)})
    progress.clear()
    lasts.sort(key=lambda frame: frame.number)
    warn([problem for frame in lasts for problem in frame.warnings], warned)
    whole = dataclasses.replace(lasts[-1], times=tuple(times for frame in lasts for times in frame.times))
    for path in open_films if not quiet else ():
        emit(str(path))
    outputs = [path for number in sorted(written) for path in written[number]]
    return whole.as_json() | {"outputs": [*outputs, *map(str, open_films)]}
