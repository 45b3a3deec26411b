"""How far long work is: told to a function, or shown as a bar on stderr where that was asked for."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TypeAlias

Progress: TypeAlias = Callable[[int, int], None]
"""Told how many parts of the work are done, and of how many."""

_WIDTH = 30


@contextmanager
def shown(progress: Progress | bool | None, word: str) -> Iterator[Progress]:
    """What to tell: the function that was given, a bar where that is `True`, else nobody.

    Args:
        progress: what a caller asked for.
        word: what is counted, behind the numbers: `frames`.
    """
    if not isinstance(progress, bool):
        yield progress or _nobody
        return
    if not progress or sys.stderr is None:
        yield _nobody
        return
    longest = 0

    def bar(done: int, total: int) -> None:
        nonlocal longest
        full = _WIDTH * done // max(1, total)
        text = f"{'█' * full}{'·' * (_WIDTH - full)} {done} of {total} {word}"
        longest = max(longest, len(text))
        encoding = getattr(sys.stderr, "encoding", None) or "utf-8"
        sys.stderr.write("\r" + text.encode(encoding, "replace").decode(encoding))
        sys.stderr.flush()

    try:
        yield bar
    finally:
        sys.stderr.write("\r" + " " * longest + "\r")
        sys.stderr.flush()


def _nobody(done: int, total: int) -> None:
    pass
