"""The command line: one module for each verb, imported when it runs. It parses, prints and sets exit codes only."""

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
        os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # no matrix here is large enough for NumPy's threads
        gc.set_threshold(100_000)  # start-up objects stay; searching them for cycles takes up to 20 ms
        supervise()
        atexit.register(_leave)
    from rendergraph.cli.app import main as run  # after the process is prepared

    try:
        return run(sys.argv[1:] if args is None else args)
    finally:
        activity.note("")()  # from now on the end of the process is not a crash
        os.environ.pop(activity.DRAW_TIMEOUT, None)  # do not limit later draws of a Python program


def commands() -> dict[str, click.Command]:
    """Return the verbs by name, in the order of `--help`; the command-line reference is generated from them."""
    from rendergraph.cli.app import VERBS, verb  # see above

    return {name: verb(name) for name in VERBS}


def _leave() -> None:
    if "OpenImageIO" not in sys.modules:  # its bindings report every object that is still alive
        gc.freeze()
