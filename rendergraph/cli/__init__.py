"""The command line: one file a verb, imported when it is called; nothing here but words, files and exit codes."""

from __future__ import annotations

import atexit
import gc
import os
import sys
from collections.abc import Sequence
from typing import TYPE_CHECKING

from rendergraph import activity
from rendergraph.cli.supervisor import supervise

if TYPE_CHECKING:
    import click


def main(args: Sequence[str] | None = None) -> int:
    """Run one command line, by default the process's own, and return the exit code of design.md §7."""
    if args is None:
        os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # NumPy's threads wait for matrices that nothing here has
        gc.set_threshold(100_000)  # what is made at the start stays: to look for cycles in it takes up to 20 ms
        supervise()
        atexit.register(_leave)
    from rendergraph.cli.app import main as run  # after the process is prepared

    try:
        return run(sys.argv[1:] if args is None else args)
    finally:
        activity.note("")()  # what ends the process from now on is no crash
        os.environ.pop(activity.DRAW_TIMEOUT, None)  # nor are other draws of a Python program limited


def commands() -> dict[str, click.Command]:
    """Return the verbs by name, in the order of `--help`: what the documentation of the command line is made from."""
    from rendergraph.cli.app import VERBS, verb  # see above

    return {name: verb(name) for name in VERBS}


def _leave() -> None:
    if "OpenImageIO" not in sys.modules:  # whose bindings tell of every object that is still there
        gc.freeze()
