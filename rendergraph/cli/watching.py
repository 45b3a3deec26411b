"""`run --watch`: reports while pictures follow their files."""

from __future__ import annotations

import os
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

from rendergraph.cli.app import unexpected
from rendergraph.cli.output import data_stream, emit_json, error_document, say, say_summary, warn
from rendergraph.errors import InputError, RenderError, RendergraphError
from rendergraph.resources import folder

if TYPE_CHECKING:
    from rendergraph.session.gpu import Gpu
    from rendergraph.session.watch import Turn

Draw: TypeAlias = "Callable[[Gpu], dict[str, Any]]"
"""Reads, renders and writes everything; returns the document of `run --json`."""

_SHIPPED = ("rendergraph.pipelines", "rendergraph.shaders", "rendergraph.nodes")
_MOST_NAMES = 3


def watch_and_render(draw: Draw, device: int | None, *, as_json: bool) -> None:
    """Render now and after every change; raises where the first picture fails and no edit of a file could fix it."""
    from rendergraph.session.gpu import Gpu
    from rendergraph.session.watch import turns

    reported: tuple[str, ...] = ()
    with Gpu(device) as gpu:
        for number, turn in enumerate(turns(partial(_attempt, draw), gpu)):
            if turn.error is not None:
                if number == 0 and not _is_fixable(turn.error, turn):
                    raise turn.error
                reported = _report_error(turn.error, turn.changed, reported)
            else:
                reported = ()
                if number == 0:
                    say_summary(turn.value or {})
                else:
                    say(_line(turn))
            if number == 0:
                count = sum(found is not None for found in turn.files.values())
                say(f"watching {count} files; Ctrl-C ends")
            if as_json:
                emit_json(_document(turn), line=True)
            if (stream := data_stream()) is not None:
                stream.flush()  # the reader of a pipe waits for this picture


def _attempt(draw: Draw, gpu: Gpu) -> dict[str, Any]:
    """Render; internal errors are reported like any other, and the next edit is tried."""
    try:
        return draw(gpu)
    except (RendergraphError, OSError):
        raise
    except Exception as error:
        if os.environ.get("RENDERGRAPH_TRACEBACK"):
            raise
        raise RenderError(unexpected(error)) from error


def _is_fixable(error: RendergraphError, turn: Turn[Any]) -> bool:
    """Return whether a file of the user's is involved: a misspelt name on the command line ends the program instead."""
    shipped = [folder(package) for package in _SHIPPED]
    existing = [Path(name) for name, found in turn.files.items() if found is not None]
    own = (path for path in existing if path.is_file() and not any(path.is_relative_to(place) for place in shipped))
    return isinstance(error, InputError) and any(own)


def _report_error(error: RendergraphError, changed: tuple[Path, ...], before: tuple[str, ...]) -> tuple[str, ...]:
    """Report each mistake once while it lasts, and return those that have been reported."""
    now = tuple(str(problem) for problem in error.problems)
    warn([problem for problem in error.problems if str(problem) not in before])
    if changed:
        say(f"{_names(changed)}: not rendered, keeping the last picture" + ("; same mistake" if now == before else ""))
    return now


def _line(turn: Turn[Any]) -> str:
    rebuilt = [f"{count} {name if count != 1 else name[:-1]}" for name, count in turn.made.items() if count]
    frame_ms = (turn.value or {})["frame_ms"]["median"]
    what = f"rebuilt {', '.join(rebuilt)}" if rebuilt else "nothing rebuilt"
    return f"{_names(turn.changed)}: rendered in {turn.ms:.0f} ms ({frame_ms:.1f} ms per frame), {what}"


def _names(paths: tuple[Path, ...]) -> str:
    names = [os.path.relpath(path) if path.is_relative_to(Path.cwd()) else str(path) for path in paths]
    more = f" and {len(names) - _MOST_NAMES} more" if len(names) > _MOST_NAMES else ""
    return ", ".join(names[:_MOST_NAMES]) + more


def _document(turn: Turn[Any]) -> dict[str, Any]:
    about = {"changed": [str(path) for path in turn.changed], "ms": turn.ms, "made": dict(turn.made)}
    if turn.error is not None:
        return about | {"error": error_document(turn.error.problems, turn.error.exit_code)}
    return about | (turn.value or {})
