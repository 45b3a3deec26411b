"""Ends the process where a signal cannot: while a driver draws or compiles, Python hears of none.

A second process waits for the byte that Python's own handler writes in the kernel's moment, gives the first one time to
end by itself, and kills it then. It costs a fork before anything is imported, half a millisecond.

Where `--executor` names other processes, this one never is in a driver, and ends them and itself at once: the watch is
for what is drawn here.
"""

from __future__ import annotations

import os
import select
import signal
import time
from typing import NoReturn

PATIENCE = 20.0
"""Seconds from a signal to the end: what is finished is on the disk by then, and files appear whole or not at all."""
_ENDING = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


def watch() -> None:
    """Begin to watch over this process; to be called once, before it has threads."""
    heard, told = os.pipe()
    os.set_blocking(told, False)
    watched = os.getpid()
    if os.fork() == 0:
        _wait(watched, heard, told)
    os.close(heard)
    signal.set_wakeup_fd(told, warn_on_full_buffer=False)


def _wait(watched: int, heard: int, told: int) -> NoReturn:
    """Until the watched process has ended, by itself or by us; it has then closed its end of the pipe."""
    for number in _ENDING:
        signal.signal(number, signal.SIG_IGN)
    for stream in (0, 1, 2, told):  # whoever reads those waits for the watched process alone
        os.close(stream)
    try:
        end = None
        while True:
            left = None if end is None else max(0.0, end - time.monotonic())
            if not select.select([heard], [], [], left)[0]:
                os.kill(watched, signal.SIGKILL)
                break
            signals = os.read(heard, 64)
            if not signals:
                break
            if end is None and any(number in signals for number in _ENDING):
                end = time.monotonic() + PATIENCE
    finally:
        os._exit(0)
