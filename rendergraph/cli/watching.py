"""`run --watch`: what is said while pictures follow their files."""

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
"""Reads, draws and writes everything; returns the document of `run --json`."""

_SHIPPED = ("rendergraph.pipelines", "rendergraph.shaders", "rendergraph.nodes")
_MOST_NAMES = 3


def keep_drawing(draw: Draw, device: int | None, *, as_json: bool) -> None:
    """Draw, and again after every change; ends with the program.

    Raises:
        RendergraphError: the first picture failed, and no file of the user's could mend it.
    """
    from rendergraph.session.gpu import Gpu
    from rendergraph.session.watch import turns

    told: tuple[str, ...] = ()
    with Gpu(device) as gpu:
        for number, turn in enumerate(turns(partial(_attempt, draw), gpu)):
            if turn.error is not None:
                if number == 0 and not _can_be_mended(turn.error, turn):
                    raise turn.error
                told = _say_error(turn.error, turn.changed, told)
            else:
                told = ()
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
                stream.flush()  # whoever reads a pipe waits for this picture, not for a full buffer


def _attempt(draw: Draw, gpu: Gpu) -> dict[str, Any]:
    """Draw; a mistake of the program's own is said like any other, and the next edit tried."""
    try:
        return draw(gpu)
    except (RendergraphError, OSError):
        raise
    except Exception as error:
        if os.environ.get("RENDERGRAPH_TRACEBACK"):
            raise
        raise RenderError(unexpected(error)) from error


def _can_be_mended(error: RendergraphError, turn: Turn[Any]) -> bool:
    """Whether the user has a file in this at all: a misspelt name on the command line is better said at once."""
    shipped = [folder(package) for package in _SHIPPED]
    there = [Path(name) for name, found in turn.files.items() if found is not None]
    own = (path for path in there if path.is_file() and not any(path.is_relative_to(place) for place in shipped))
    return isinstance(error, InputError) and any(own)


def _say_error(error: RendergraphError, changed: tuple[Path, ...], told: tuple[str, ...]) -> tuple[str, ...]:
    """Say what is wrong, each mistake once while it lasts; what has been said."""
    now = tuple(str(problem) for problem in error.problems)
    warn([problem for problem in error.problems if str(problem) not in told])
    if changed:
        say(f"{_names(changed)}: not drawn, the last picture stays" + ("; the same mistake" if now == told else ""))
    return now


def _line(turn: Turn[Any]) -> str:
    made = [f"{count} {name if count != 1 else name[:-1]}" for name, count in turn.made.items() if count]
    frame_ms = (turn.value or {})["frame_ms"]["median"]
    what = f"made {', '.join(made)}" if made else "nothing made anew"
    return f"{_names(turn.changed)}: drawn again in {turn.ms:.0f} ms ({frame_ms:.1f} ms a frame), {what}"


def _names(paths: tuple[Path, ...]) -> str:
    names = [os.path.relpath(path) if path.is_relative_to(Path.cwd()) else str(path) for path in paths]
    more = f" and {len(names) - _MOST_NAMES} more" if len(names) > _MOST_NAMES else ""
    return ", ".join(names[:_MOST_NAMES]) + more


def _document(turn: Turn[Any]) -> dict[str, Any]:
    about = {"changed": [str(path) for path in turn.changed], "ms": turn.ms, "made": dict(turn.made)}
    if turn.error is not None:
        return about | {"error": error_document(turn.error.problems, turn.error.exit_code)}
    return about | (turn.value or {})
