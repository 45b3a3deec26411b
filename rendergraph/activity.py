"""The activity of this process, in memory shared with the process that forked it.

The command line's supervisor reads it after a crash or a timeout.
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
    """Return ` while …` with the text of the last `note`, or an empty text."""
    text = _MEMORY[:].strip(b"\0 ").decode(errors="ignore")
    return text and f" while {text}"


def draw_seconds() -> float:
    """Return the limit of `limited_draw` in seconds, 0 without a limit."""
    return float(os.environ.get(DRAW_TIMEOUT, 0))


@contextmanager
def limited_draw() -> Iterator[None]:
    """Let SIGALRM end this process if the block takes longer than --draw-timeout; drivers cannot block it."""
    if not (seconds := draw_seconds()):
        yield  # the caller may have a timer
        return
    set_alarm(seconds)
    try:
        yield
    finally:
        set_alarm(0)
