"""Progress of long work: calls of a function, or a bar on stderr."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TypeAlias

Progress: TypeAlias = Callable[[int, int], None]
"""Receives how many parts of the work are done, and of how many."""

_WIDTH = 30


@contextmanager
def report_progress(progress: Progress | bool | None, word: str) -> Iterator[Progress]:
    """Yield the function to call: the one that was given, one that shows a bar for `True`, else one that does nothing.

    Args:
        progress: as the caller passed it.
        word: the unit of the numbers: `frames`.
    """
    if not isinstance(progress, bool):
        yield progress or _ignore
        return
    if not progress or sys.stderr is None:
        yield _ignore
        return
    longest, begun, before = 0, time.monotonic(), 0

    def bar(done: int, total: int) -> None:
        nonlocal longest, begun, before
        if before == 0:  # what was there already took no time
            begun, before = time.monotonic(), done
        full = _WIDTH * done // max(1, total)
        text = f"{'█' * full}{'·' * (_WIDTH - full)} {done} of {total} {word}"
        text += _pace(done - before, total - done, time.monotonic() - begun)
        longest = max(longest, len(text))
        encoding = getattr(sys.stderr, "encoding", None) or "utf-8"
        sys.stderr.write("\r" + text.encode(encoding, "replace").decode(encoding))
        sys.stderr.flush()

    try:
        yield bar
    finally:
        sys.stderr.write("\r" + " " * longest + "\r")
        sys.stderr.flush()


def _pace(done: int, left: int, seconds: float) -> str:
    """Return the speed and the remaining time, once they can be estimated."""
    if done < 1 or seconds < 1 or not left:
        return ""
    wait = left * seconds / done
    time_left = f"{wait:.0f} s" if wait < 120 else f"{wait / 60:.0f} min" if wait < 7200 else f"{wait / 3600:.1f} h"
    return f", {done / seconds:.3g} a second, {time_left} left"


def _ignore(done: int, total: int) -> None:
    pass
