"""End the process where a signal cannot: Python handles none while a driver renders or compiles.

A second process waits for the byte that Python's C-level signal handler writes at once, gives the first one time to
end by itself, and then kills it. It costs a fork before anything is imported, half a millisecond. With `--executor`
other processes render; this one is never in a driver, and ends them and itself at once.
"""

from __future__ import annotations

import os
import select
import signal
import time
from typing import NoReturn

PATIENCE = 20.0
"""Seconds from a signal to the end: finished files are on the disk by then, and files appear whole or not at all."""
_ENDING = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


def watch() -> None:
    """Watch this process; called once, before it has threads."""
    reader, writer = os.pipe()
    os.set_blocking(writer, False)
    watched = os.getpid()
    if os.fork() == 0:
        _wait(watched, reader, writer)
    os.close(reader)
    signal.set_wakeup_fd(writer, warn_on_full_buffer=False)


def _wait(watched: int, reader: int, writer: int) -> NoReturn:
    """Wait until the watched process has ended, by itself or by us; its end of the pipe is then closed."""
    for number in _ENDING:
        signal.signal(number, signal.SIG_IGN)
    for stream in (0, 1, 2, writer):  # their readers wait for the watched process alone
        os.close(stream)
    try:
        end = None
        while True:
            left = None if end is None else max(0.0, end - time.monotonic())
            if not select.select([reader], [], [], left)[0]:
                os.kill(watched, signal.SIGKILL)
                break
            signals = os.read(reader, 64)
            if not signals:
                break
            if end is None and any(number in signals for number in _ENDING):
                end = time.monotonic() + PATIENCE
    finally:
        os._exit(0)
