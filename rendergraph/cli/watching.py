"""`run --watch`: render again whenever an input file of the picture changes, and report it.

Files are polled (`stamps`): a few dozen `stat` calls ten times a second cost nothing measurable, work on every file
system, network and container included, and follow a file that an editor replaces by another of its name. Files that the
last attempt did not find, such as a missing include, are watched, too.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

from rendergraph.cli.app import unexpected
from rendergraph.cli.output import data_stream, emit_json, error_document, say, say_summary, warn
from rendergraph.errors import InputError, RenderError, RendergraphError
from rendergraph.resources import folder
from rendergraph.stamps import Stamps, modified, stamp, track_reads

if TYPE_CHECKING:
    from rendergraph.session.gpu import Gpu

Draw: TypeAlias = "Callable[[Gpu], dict[str, Any]]"
"""Reads, renders and writes everything; returns the document of `run --json`."""

INTERVAL = 0.1
"""Seconds between two checks."""
REST = 0.05
"""Seconds for which a file must be unchanged before it is read: editors write in several steps."""
PATIENCE = 1.0
"""Seconds to wait for a file that has vanished or keeps changing."""
_SHIPPED = ("rendergraph.pipelines", "rendergraph.shaders", "rendergraph.nodes")
_MOST_NAMES = 3


@dataclass(frozen=True)
class Turn:
    """One attempt to render: its result or error, the files that caused it, its time, and the files to watch now.

    `created` is the number of `programs`, `textures` and `scenes` that were created.
    """

    value: dict[str, Any] | None
    error: RendergraphError | None
    changed: tuple[Path, ...]
    ms: float
    created: Mapping[str, int]
    files: Stamps


def turns(draw: Draw, gpu: Gpu) -> Iterator[Turn]:
    """Render, and again after every change of an input file; yield every attempt, without end.

    `draw` starts from reading the pipeline; what has not changed comes from the caches of `gpu`. A mistake is an
    attempt, too, and the next change may fix it.
    """
    seen: tuple[Path, ...] = ()
    while True:
        start, before = time.perf_counter(), _creation_counts(gpu)
        value: dict[str, Any] | None = None
        error: RendergraphError | None = None
        with track_reads() as files:
            try:
                value = draw(gpu)
            except RendergraphError as problem:
                error = problem
            except Exception as problem:  # an internal error is reported like any other, and the next edit is tried
                if isinstance(problem, OSError) or os.environ.get("RENDERGRAPH_TRACEBACK"):
                    raise
                error = RenderError(unexpected(problem))
        created = {name: count - before[name] for name, count in _creation_counts(gpu).items()}
        yield Turn(value, error, seen, (time.perf_counter() - start) * 1e3, created, files)
        seen = tuple(wait(files))


def wait(files: Stamps) -> list[Path]:
    """Block until a file has changed and is stable again, and return which.

    A file that has vanished is given a moment to return: many editors write by renaming.
    """
    while True:
        changed = modified(files)
        if changed:
            _settle(changed)
            if changed := modified(files):  # it may be back, just as it was
                return changed
        time.sleep(INTERVAL)


def _settle(paths: list[Path]) -> None:
    end = time.monotonic() + PATIENCE
    before = [stamp(path) for path in paths]
    while time.monotonic() < end:
        time.sleep(REST)
        now = [stamp(path) for path in paths]
        if now == before and None not in now:
            return
        before = now


def _creation_counts(gpu: Gpu) -> dict[str, int]:
    cache = gpu.cache
    return {"programs": cache.programs.compiled, "textures": gpu.device.textures_made, "scenes": cache.scenes_made}


def watch_and_render(draw: Draw, device: int | None, *, as_json: bool) -> None:
    """Render now and after every change; raise if the first picture fails and no edit of a file could fix it."""
    from rendergraph.session.gpu import Gpu

    reported: tuple[str, ...] = ()
    with Gpu(device) as gpu:
        for number, turn in enumerate(turns(draw, gpu)):
            if turn.error is not None:
                if number == 0 and not _is_fixable(turn.error, turn):
                    raise turn.error
                reported = _report_error(turn.error, turn.changed, reported)
            elif turn.value is not None:
                reported = ()
                say(_line(turn, turn.value)) if number else say_summary(turn.value)
            if number == 0:
                count = sum(stamp is not None for stamp in turn.files.values())
                say(f"watching {count} files; Ctrl-C ends")
            if as_json:
                emit_json(_document(turn), line=True)
            if (stream := data_stream()) is not None:
                stream.flush()  # the reader of a pipe waits for this picture


def _is_fixable(error: RendergraphError, turn: Turn) -> bool:
    """Return whether a file of the user's is involved: a misspelt name on the command line ends the program instead."""
    shipped = [folder(package) for package in _SHIPPED]
    existing = [Path(name) for name, stamp in turn.files.items() if stamp is not None]
    own = (path for path in existing if path.is_file() and not any(path.is_relative_to(place) for place in shipped))
    return isinstance(error, InputError) and any(own)


def _report_error(error: RendergraphError, changed: tuple[Path, ...], before: tuple[str, ...]) -> tuple[str, ...]:
    """Report each mistake once while it lasts, and return those that have been reported."""
    now = tuple(str(problem) for problem in error.problems)
    warn([problem for problem in error.problems if str(problem) not in before])
    if changed:
        say(f"{_names(changed)}: not rendered, keeping the last picture" + ("; same mistake" if now == before else ""))
    return now


def _line(turn: Turn, report: dict[str, Any]) -> str:
    rebuilt = [f"{count} {name if count != 1 else name[:-1]}" for name, count in turn.created.items() if count]
    what = f"rebuilt {', '.join(rebuilt)}" if rebuilt else "nothing rebuilt"
    times = f"{turn.ms:.0f} ms ({report['frame_ms']['median']:.1f} ms per frame)"
    return f"{_names(turn.changed)}: rendered in {times}, {what}"


def _names(paths: tuple[Path, ...]) -> str:
    names = [os.path.relpath(path) if path.is_relative_to(Path.cwd()) else str(path) for path in paths]
    more = f" and {len(names) - _MOST_NAMES} more" if len(names) > _MOST_NAMES else ""
    return ", ".join(names[:_MOST_NAMES]) + more


def _document(turn: Turn) -> dict[str, Any]:
    about = {"changed": [str(path) for path in turn.changed], "ms": turn.ms, "made": dict(turn.created)}
    if turn.error is not None:
        return about | {"error": error_document(turn.error.problems, turn.error.exit_code)}
    return about | (turn.value or {})
