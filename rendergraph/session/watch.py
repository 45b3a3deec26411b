"""Drawing again whenever a file that went into the picture changes.

Files are polled (`stamps`): a few dozen `stat` calls ten times a second cost nothing that can be measured, work on
every file system, network and container included, and follow a file that an editor replaces by another of its name.
What is watched is what the last attempt looked at, also in vain, so a missing include is waited for like any other.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Generic, TypeVar

from rendergraph.errors import RendergraphError
from rendergraph.session.gpu import Gpu
from rendergraph.stamps import Stamps, modified, stamp, track_reads

T = TypeVar("T")

INTERVAL = 0.1
"""Seconds between two looks."""
REST = 0.05
"""Seconds a file has to stay as it is before it is read: editors write in several moves."""
PATIENCE = 1.0
"""Seconds a file that has vanished, or does not come to rest, is waited for."""


@dataclass(frozen=True)
class Turn(Generic[T]):
    """One attempt to draw.

    Attributes:
        value: what the drawing returned; None where it failed.
        error: why it failed.
        changed: the files that led to it, none the first time.
        ms: milliseconds from the change being noticed until everything was drawn and written.
        made: how many `programs`, `textures` and `scenes` were made for it.
        files: what it looked at, and so what is watched now.
    """

    value: T | None
    error: RendergraphError | None
    changed: tuple[Path, ...]
    ms: float
    made: Mapping[str, int]
    files: Stamps


def turns(draw: Callable[[Gpu], T], gpu: Gpu) -> Iterator[Turn[T]]:
    """Draw, and again after every change of a file that the drawing looked at; endless.

    Args:
        draw: does everything afresh, from reading the pipeline on; what has not changed is taken from there.
        gpu: where to draw.

    Yields:
        Every attempt. A mistake is one, too, and is waited upon to be mended.
    """
    seen: tuple[Path, ...] = ()
    while True:
        start, before = time.perf_counter(), _made(gpu)
        value, error = None, None
        with track_reads() as files:
            try:
                value = draw(gpu)
            except RendergraphError as problem:
                error = problem
        made = {name: count - before[name] for name, count in _made(gpu).items()}
        yield Turn(value, error, seen, (time.perf_counter() - start) * 1e3, made, files)
        seen = tuple(wait(files))


def wait(files: Stamps) -> list[Path]:
    """Block until some file is no longer as it was and has come to rest; which ones.

    A file that has vanished is given a moment to come back: many editors write by renaming.
    """
    while True:
        found = modified(files)
        if found:
            _settle(found)
            if found := modified(files):  # it may be back, just as it was
                return found
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


def _made(gpu: Gpu) -> dict[str, int]:
    return {
        "programs": gpu.cache.programs.compiled,
        "textures": gpu.device.textures_made,
        "scenes": gpu.cache.scenes_made,
    }
