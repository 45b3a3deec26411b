"""Which files a piece of work looked at, and whether they are still as they were.

Whoever opens a file, or finds none where it looked, says so with `look`. Whoever keeps the result of such work collects
what was looked at meanwhile (`looking`), and does the work again when something of it has changed (`changed`). A result
that is taken from where it was kept says what it was made from (`again`), so that the collection is always complete.

Files are told apart by modification time, size and inode: a `stat` each, the same on every system, and no file is read.
"""

from __future__ import annotations

import os
import stat
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path
from typing import TypeAlias

Stamp: TypeAlias = "tuple[object, ...] | None"
"""What tells one state of a file from the next; the names in a folder; None where there is nothing."""

Stamps: TypeAlias = "Mapping[str, Stamp]"
"""Absolute paths, in the order they were looked at."""

_SOURCES = (".py", ".frag", ".vert", ".geom", ".comp", ".glsl", ".yaml", ".yml", ".toml", "")
_LOOKED: ContextVar[dict[str, Stamp] | None] = ContextVar("looked", default=None)


def stamp(path: Path | str) -> Stamp:
    """The state of a file or folder; of a folder only what may be source text: pictures written into it are none."""
    try:
        status = os.stat(path)
        if stat.S_ISDIR(status.st_mode):
            return tuple(sorted(name for name in os.listdir(path) if _is_source(name)))
    except (OSError, ValueError):
        return None
    return status.st_mtime_ns, status.st_size, status.st_ino


def look(path: Path | str) -> None:
    """Note a file or folder, before it is opened; the first look counts."""
    looked = _LOOKED.get()
    if looked is not None and os.fspath(path) not in looked:
        name = os.path.abspath(path)
        if name not in looked:
            looked[name] = stamp(name)


def again(stamps: Stamps) -> None:
    """Note what a kept result was made from."""
    looked = _LOOKED.get()
    if looked is not None:
        for path, found in stamps.items():
            looked.setdefault(path, found)


@contextmanager
def looking() -> Iterator[dict[str, Stamp]]:
    """Collect what is looked at in the block, also where it fails; a collection around it is given the same."""
    outer = _LOOKED.get()
    looked: dict[str, Stamp] = {}
    token = _LOOKED.set(looked)
    try:
        yield looked
    finally:
        _LOOKED.reset(token)
        if outer is not None:
            for path, found in looked.items():
                outer.setdefault(path, found)


def changed(stamps: Stamps) -> list[Path]:
    """What is no longer as it was, in the order it was looked at."""
    return [Path(path) for path, found in stamps.items() if stamp(path) != found]


def _is_source(name: str) -> bool:
    return name[0] not in "._" + "#" and os.path.splitext(name)[1] in _SOURCES
