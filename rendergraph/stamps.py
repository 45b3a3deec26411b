"""Track which files a computation read and whether they have changed, and cache results that depend on files.

Code that opens a file, or looks for one that may be missing, calls `record_read` first. Code that caches a result
collects the reads with `track_reads` and computes it again when `modified` names a file. Using a cached result replays
its reads (`unchanged`, `replay_reads`), so that outer collections are always complete. `FileCache` does all of this. A
file's state is its modification time, size and inode: one `stat` each, the same on every system; no file is read. A
folder is listed again only if its own modification time has changed.
"""

from __future__ import annotations

import os
import stat
import time
from collections.abc import Callable, Hashable, Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from functools import lru_cache
from pathlib import Path
from typing import Generic, TypeAlias, TypeVar

T = TypeVar("T")

Stamp: TypeAlias = "tuple[object, ...] | None"
"""The state of a file; for a folder, the names in it; None if nothing exists."""

Stamps: TypeAlias = "Mapping[str, Stamp]"
"""Absolute paths and their states, in the order they were read."""

_SOURCES = (".py", ".frag", ".vert", ".geom", ".comp", ".glsl", ".yaml", ".yml", ".toml", "")
_SETTLED = 2_000_000_000
"""Nanoseconds since a folder's last change after which another change also changes its time, on every file system."""
_NAMES: dict[str, tuple[object, tuple[str, ...]]] = {}
"""The names in folders, with the states of the folders when they were listed."""
_READ: ContextVar[dict[str, Stamp] | None] = ContextVar("read", default=None)


def stamp(path: Path | str) -> Stamp:
    """Return the state of a file or folder; a folder's has only possible source files, not outputs."""
    try:
        status = os.stat(path)
        if stat.S_ISDIR(status.st_mode):
            return _source_names(folder_names(path, status))
    except (OSError, ValueError):
        return None
    return status.st_mtime_ns, status.st_size, status.st_ino


def folder_names(path: Path | str, status: os.stat_result | None = None) -> tuple[str, ...]:
    """Return the sorted names in a folder, whose `status` may be known; raises OSError."""
    status = status or os.stat(path)
    name, state = os.path.abspath(path), (status.st_mtime_ns, status.st_ino)
    known = _NAMES.get(name)
    if known is not None and known[0] == state:
        return known[1]
    names = tuple(sorted(os.listdir(path)))
    if time.time_ns() - status.st_mtime_ns > _SETTLED:
        _NAMES[name] = state, names
    return names


def record_read(path: Path | str) -> None:
    """Record a file or folder before it is opened; the first read counts."""
    read = _READ.get()
    if read is not None and os.fspath(path) not in read:
        name = os.path.abspath(path)
        if name not in read:
            read[name] = stamp(name)


def replay_reads(stamps: Stamps) -> None:
    """Record the files from which a cached result was computed."""
    read = _READ.get()
    if read is not None:
        for path, state in stamps.items():
            read.setdefault(path, state)


@contextmanager
def track_reads() -> Iterator[dict[str, Stamp]]:
    """Collect the reads in the block, even if it fails; outer collections get them, too."""
    read: dict[str, Stamp] = {}
    token = _READ.set(read)
    try:
        yield read
    finally:
        _READ.reset(token)
        replay_reads(read)


def modified(stamps: Stamps) -> list[Path]:
    """Return the files that have changed, in the order in which they were read."""
    return [Path(path) for path, state in stamps.items() if stamp(path) != state]


def unchanged(stamps: Stamps) -> bool:
    """Return whether a result computed from these files is still valid; using it counts as reading them."""
    if modified(stamps):
        return False
    replay_reads(stamps)
    return True


class FileCache(Generic[T]):
    """Results by key, each valid until its files change; the least recently used is dropped first."""

    def __init__(self, most: int = 2048) -> None:
        self._most = most
        self._entries: dict[Hashable, tuple[T, Stamps]] = {}

    def get(self, key: Hashable, make: Callable[[], T]) -> T:
        """Return the result for a key; if `make` raises, it is called again next time."""
        entry = self._entries.pop(key, None)
        if entry is None or not unchanged(entry[1]):
            with track_reads() as files:
                entry = make(), files
            while len(self._entries) >= self._most:
                del self._entries[next(iter(self._entries))]
        self._entries[key] = entry
        return entry[0]


@lru_cache(1024)
def _source_names(names: tuple[str, ...]) -> tuple[str, ...]:
    return tuple(name for name in names if name[0] not in "._#" and os.path.splitext(name)[1] in _SOURCES)
