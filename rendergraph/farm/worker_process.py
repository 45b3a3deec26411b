"""A Python process of our own at the other end of a pipe; and what one does that works on tasks."""

from __future__ import annotations

import contextlib
import ctypes
import json
import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Mapping
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

_PR_SET_PDEATHSIG = 1


def started(main: str, words: Mapping[str, Any], environment: Mapping[str, str] | None = None) -> Child:
    """Start a process that calls a function with the file descriptor of its end of a pipe, and with words.

    It is not started by `multiprocessing`, which would run the caller's script once more, and it is no part of the
    terminal's group: Ctrl-C is this process's, which ends the other one.

    Args:
        main: `package.module:function`.
        words: keywords of the function, plain values.
        environment: variables in place of what they are here.
    """
    ours, theirs = socket.socketpair()
    module, _, function = main.partition(":")
    told = json.dumps({"path": sys.path, "words": {**words, "pipe": theirs.fileno()}, "parent": os.getpid()})
    program = (
        "import json, sys; told = json.loads(sys.argv[1]); sys.path[:] = told['path']\n"
        "from rendergraph.farm.worker_process import end_with\n"
        f"end_with(told['parent'])\nfrom {module} import {function}\n{function}(**told['words'])"
    )
    with theirs:
        process = subprocess.Popen(
            [sys.executable, "-P", "-c", program, told],
            pass_fds=(theirs.fileno(),),
            stdin=subprocess.DEVNULL,
            stdout=2,  # ours is data; what a plugin prints is none
            start_new_session=True,
            env={**os.environ, **(environment or {})},
        )
    return Child(process, Connection(ours.detach()))


class Child:
    """A process that was started, and our end of its pipe."""

    def __init__(self, process: subprocess.Popen[bytes], pipe: Connection) -> None:
        self.process, self.pipe = process, pipe

    def ended_by(self) -> str:
        """What ended a process whose pipe has closed: a signal's name, or its exit code."""
        with contextlib.suppress(subprocess.TimeoutExpired):
            self.process.wait(1.0)
        code = self.process.returncode
        if code is not None and code < 0:
            with contextlib.suppress(ValueError):
                return signal.Signals(-code).name
        return f"exit code {code}"

    def end(self) -> None:
        """End it at once."""
        self.process.kill()
        self.process.wait()
        self.pipe.close()


def end_with(parent: int) -> None:
    """Let the system end this process when the one that started it ends, however that comes about."""
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    if os.getppid() != parent:
        os._exit(1)


def work(pipe: int, name: str, device: int | None, root: str | None = None, home: str | None = None) -> None:
    """What a process does that works on tasks: one after the other, until the pipe ends.

    It is told `(give, digest, value)` and `(run, task)`, and tells `ready` or `unable` once, then of each task
    `(item, value)`s and at last `(finished, seconds)` or `(failed, error)`.

    Args:
        pipe: the file descriptor of its end.
        name: what it is called.
        device: GL device number.
        root: the folder beneath which files lie that were sent here.
        home: the current folder, as it is called where they came from.
    """
    from rendergraph.errors import DeviceError, Problem, RenderError, RendergraphError  # in the process itself alone
    from rendergraph.farm.bundle import map_remote_paths  # likewise
    from rendergraph.farm.tasks import Handle, Worker  # likewise

    worker = Worker(name, device=device)
    if root is not None and home is not None:
        worker.root = Path(root)
        os.chdir(worker.root / Path(home).relative_to("/"))
    with Connection(pipe) as end, contextlib.closing(worker), contextlib.suppress(EOFError, OSError):
        try:
            end.send(("ready", worker.gpu.device.as_json()))
        except DeviceError as error:
            end.send(("unable", error))
            return
        while True:
            kind, *told = end.recv()
            if kind == "give":
                worker.store(Handle(told[0]), told[1])
                continue
            begun = time.monotonic()
            try:
                for value in told[0].run(worker):
                    end.send(("item", value))
            except RendergraphError as error:
                end.send(("failed", map_remote_paths(error, worker.root)))
            except MemoryError:
                end.send(("failed", RenderError(Problem("RG640", "the worker ran out of memory"))))
            else:
                end.send(("finished", time.monotonic() - begun))
