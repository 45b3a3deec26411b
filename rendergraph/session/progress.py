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
def report_progress(progress: Progress | bool | None, word: str | Callable[[], str]) -> Iterator[Progress]:
    """Yield the function to call: the one that was given, a `Bar` for `True`, else one that does nothing."""
    if progress is not True:
        yield progress or (lambda done, total: None)
        return
    bar = Bar(word)
    try:
        yield bar
    finally:
        bar.clear()


class Bar:
    """A bar on stderr with the speed and the remaining time.

    `word` is the unit of the numbers, such as `frames`, or a function that returns it with further text.
    """

    def __init__(self, word: str | Callable[[], str], *, shown: bool = True) -> None:
        self._shown = shown and sys.stderr is not None
        self._word, self._longest, self._begun, self._before = word, 0, time.monotonic(), -1

    def __call__(self, done: int, total: int) -> None:
        """Redraw the bar."""
        if not self._shown:
            return
        if self._before < 0:  # work that was already done took no time
            self._begun, self._before = time.monotonic(), done
        full, word = _WIDTH * done // max(1, total), self._word() if callable(self._word) else self._word
        text = f"{'█' * full}{'·' * (_WIDTH - full)} {done} of {total} {word}"
        text += _pace(done - self._before, total - done, time.monotonic() - self._begun)
        self._longest = max(self._longest, len(text))
        encoding = getattr(sys.stderr, "encoding", None) or "utf-8"
        self._print(text.ljust(self._longest).encode(encoding, "replace").decode(encoding))

    def clear(self) -> None:
        """Erase the bar, before something else is printed."""
        if self._longest:
            self._print(" " * self._longest + "\r")

    def _print(self, text: str) -> None:
        sys.stderr.write("\r" + text)
        sys.stderr.flush()


def _pace(done: int, left: int, seconds: float) -> str:
    """Return the speed and the remaining time, once they can be estimated."""
    if done < 1 or seconds < 1 or not left:
        return ""
    wait = left * seconds / done
    time_left = f"{wait:.0f} s" if wait < 120 else f"{wait / 60:.0f} min" if wait < 7200 else f"{wait / 3600:.1f} h"
    return f", {done / seconds:.3g} per second, {time_left} left"
