"""Frames that several workers draw: their files are written here, in whatever order they come."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from rendergraph.cli.options import Target
from rendergraph.cli.output import Progress, Warnings, emit, say_event

if TYPE_CHECKING:
    from rendergraph.farm import Executor
    from rendergraph.session import Frame
    from rendergraph.session.values import Expanded


def draw_in_parts(
    expanded: Expanded, targets: Sequence[Target], farm: Executor, *, warnings: Warnings, quiet: bool
) -> dict[str, Any]:
    """Render and write everything, and return the document of `--json`. Paths are printed unless `quiet`."""
    from rendergraph import images
    from rendergraph.farm.frames import FrameFile, RenderedFrame, render_chunks, split_frames
    from rendergraph.images.files import write_file
    from rendergraph.images.video import films, is_film

    said = expanded.linked.spec.tree.get("warm_up")
    wanted = [FrameFile(t.name, "" if is_film(t.path) else t.path.suffix, t.is_tap) for t in targets]
    chunks = split_frames(expanded, wanted, farm.workers, None if said is None else int(said.plain()))
    frames, written = expanded.options.frames, dict[int, list[str]]()
    progress, lasts, unsound = Progress(len(frames)), list["Frame"](), dict[int, Any]()
    with films([t.path for t in targets if is_film(t.path)], expanded.options.fps, frames[0]) as open_films:
        for shown in render_chunks(farm, chunks):
            if not isinstance(shown, RenderedFrame):
                lasts.append(shown)
                continue
            paths = written.setdefault(shown.number, [])
            for target, made in zip(targets, shown.files, strict=True):
                if not isinstance(made, bytes):
                    open_films[target.path].add(shown.number, made)
                    continue
                path = images.numbered(target.path, shown.number)
                write_file(path, made)
                paths.append(str(path))
                if not quiet:
                    progress.clear()
                    emit(str(path))
            unsound[shown.number] = dict(shown.unsound)
            progress.show(len(written))
            if quiet:
                say_event({"event": "frame", "frame": shown.number, "done": len(written), "of": len(frames)})
    progress.clear()
    lasts.sort(key=lambda frame: frame.number)
    first = {name: problem for number in sorted(unsound, reverse=True) for name, problem in unsound[number].items()}
    warnings.say([*(problem for frame in lasts for problem in frame.warnings), *first.values()])
    whole = replace(lasts[-1], times=tuple(times for frame in lasts for times in frame.times))
    for path in open_films:
        if not quiet:
            emit(str(path))
    outputs = [path for number in sorted(written) for path in written[number]]
    return whole.as_json() | {"outputs": [*outputs, *map(str, open_films)]}
