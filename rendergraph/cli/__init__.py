"""The command line: one module for each verb, imported when it runs. It parses, prints and sets exit codes only."""

from __future__ import annotations

import atexit
import gc
import os
import signal
import sys
import time
from collections.abc import Sequence
from collections.abc import Set as AbstractSet
from typing import TYPE_CHECKING

from rendergraph import activity, system

if TYPE_CHECKING:
    import click

PATIENCE = 1.2
"""Seconds from a signal to SIGKILL; finished files are on disk by then, and no file appears half-written."""


def main(args: Sequence[str] | None = None) -> int:
    """Run one command line, by default the process's own, and return the exit code of design.md §7."""
    if args is None:
        os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # no matrix here is large enough for NumPy's threads
        gc.set_threshold(100_000)  # start-up objects stay; searching them for cycles takes up to 20 ms
        _supervise()
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


# --- the process that the shell waits for -----------------------------------------------------------------------------


def _supervise() -> None:
    """Fork, and return only in the worker, which does everything, with signals that end it silently.

    While a driver renders or compiles, Python handles no signals, and after a driver crash its process cannot report
    anything. The supervisor never calls a driver. It forwards signals, kills a worker that does not exit, reports a
    crash with the worker's activity, and exits as the worker does. It costs half a millisecond, as long as it is called
    once, before anything is imported and before threads exist.
    """
    if sys.platform != "linux":
        return  # only Linux has sigtimedwait, prctl and OpenGL 4.5 on EGL
    ending = {n for n in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP) if signal.getsignal(n) is not signal.SIG_IGN}
    signal.signal(signal.SIGCHLD, signal.SIG_DFL)
    signal.pthread_sigmask(signal.SIG_BLOCK, {*ending, signal.SIGCHLD})
    supervisor = os.getpid()
    worker = os.fork()
    if worker:
        os._exit(_wait(worker, ending))
    for number in ending:
        signal.signal(number, signal.SIG_DFL)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, {*ending, signal.SIGCHLD})
    system.end_with_parent(supervisor)  # takes 2 ms; Ctrl-C already works
    activity.note("preparing")()


def _wait(worker: int, ending: AbstractSet[int]) -> int:
    signalled, deadline = 0, time.monotonic() + 1e9
    while True:
        found = signal.sigtimedwait({*ending, signal.SIGCHLD}, max(0.0, deadline - time.monotonic()))
        if found is None:
            os.kill(worker, signal.SIGKILL)
            deadline += 1e9
        elif found.si_signo == signal.SIGCHLD:
            ended, status = os.waitpid(worker, os.WNOHANG)
            if ended:
                return _exit_code(os.waitstatus_to_exitcode(status), signalled, ending)
        else:
            if not signalled:
                signalled, deadline = found.si_signo, time.monotonic() + PATIENCE
            if found.si_code <= 0:  # from `kill`; a terminal sends it to the worker, too
                os.kill(worker, found.si_signo)


def _exit_code(code: int, signalled: int, ending: AbstractSet[int]) -> int:
    """Return the exit code for that of the worker; if it was killed or crashed, report why."""
    during = activity.during()
    if code >= 0 and not (code and during):
        return code
    from rendergraph.cli.app import INTERRUPTED, fail  # rarely needed
    from rendergraph.errors import Problem

    if signalled or -code in ending:
        number = signalled or -code
        os.write(2, b"interrupted\n" if 128 + number == INTERRUPTED else b"terminated\n")
        return 128 + number
    if code == -signal.SIGALRM:
        text = f"--draw-timeout exceeded{during}; allow more, or draw less at a time"
    elif code == -signal.SIGKILL:
        text = f"the process was killed (SIGKILL){during}; the system does so when memory runs out"
    else:
        how = f"crashed ({signal.Signals(-code).name})" if code < 0 else f"was ended by a library (exit code {code})"
        text = f"the process {how}{during}; too little memory can cause this, or a driver bug: "
        text += "try a smaller --size, or another driver"
    return fail([Problem("RG622", text)], 1, as_json="--json" in sys.argv)
