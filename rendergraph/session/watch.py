"""Render again whenever an input file of the picture changes.

Files are polled (`stamps`): a few dozen `stat` calls ten times a second cost nothing measurable, work on every file
system, network and container included, and follow a file that an editor replaces by another of its name. Files that the
last attempt looked for in vain are watched, too, such as a missing include.
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
"""Seconds between two checks."""
REST = 0.05
"""Seconds for which a file must be unchanged before it is read: editors write in several steps."""
PATIENCE = 1.0
"""Seconds to wait for a file that has vanished or keeps changing."""


@dataclass(frozen=True)
class Turn(Generic[T]):
    """One attempt to render.

    Attributes:
        value: the returned value; None if it failed.
        error: why it failed.
        changed: the files that caused it; none the first time.
        ms: milliseconds from noticing the change until everything was rendered and written.
        made: number of `programs`, `textures` and `scenes` that were created.
        files: the files that it looked for, which are watched now.
    """

    value: T | None
    error: RendergraphError | None
    changed: tuple[Path, ...]
    ms: float
    made: Mapping[str, int]
    files: Stamps


def turns(draw: Callable[[Gpu], T], gpu: Gpu) -> Iterator[Turn[T]]:
    """Render, and again after every change of an input file; yield every attempt, without end.

    `draw` starts from reading the pipeline; what has not changed comes from the caches of `gpu`. A mistake is an
    attempt, too, and the next change may fix it.
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
    """Block until a file has changed and is stable again, and return which.

    A file that has vanished is given a moment to return: many editors write by renaming.
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
