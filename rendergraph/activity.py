"""What this process is doing, in memory that it shares with the process it was forked from.

The command line's supervisor reads it after a crash, and after a draw that took too long.
"""

from __future__ import annotations

import mmap
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial

from rendergraph.system import set_alarm

DRAW_TIMEOUT = "_RENDERGRAPH_DRAW_TIMEOUT"
"""The environment variable with the limit of `limited_draw`: worker processes inherit it."""
_SIZE = 256
_MEMORY = mmap.mmap(-1, _SIZE)


def note(text: str) -> Callable[[], None]:
    """Return a call that makes the text the current activity; the call takes 0.1 µs and allocates nothing."""
    return partial(_MEMORY.__setitem__, slice(0, _SIZE), text.encode()[:_SIZE].ljust(_SIZE))


def during() -> str:
    """Return ` while …` with the text of the last `note`, or nothing."""
    text = _MEMORY[:].strip(b"\0 ").decode(errors="ignore")
    return text and f" while {text}"


def draw_seconds() -> float:
    """Return what `limited_draw` allows, 0 without a limit."""
    return float(os.environ.get(DRAW_TIMEOUT, 0))


@contextmanager
def limited_draw() -> Iterator[None]:
    """Let SIGALRM end this process where the block takes longer than --draw-timeout: no driver can hold that up."""
    if not (seconds := draw_seconds()):
        yield  # a timer may be the caller's
        return
    set_alarm(seconds)
    try:
        yield
    finally:
        set_alarm(0)
