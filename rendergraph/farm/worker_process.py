"""Python processes at the other end of a pipe: the general class, and the worker process that runs tasks."""

from __future__ import annotations

import contextlib
import json
import os
import pickle
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Mapping
from multiprocessing.connection import Connection
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rendergraph import system
from rendergraph.errors import DeviceError, Problem, RenderError, RendergraphError

if TYPE_CHECKING:
    from rendergraph.farm.tasks import Task

TIMEOUT = 600.0
"""Seconds without a message before a worker is replaced."""
STARTUP_TIMEOUT = 30.0
"""Seconds until a worker is ready: the process starts, imports and opens its device, which takes about a second."""


class ChildProcess:
    """A Python process that was started here, and this end of its pipe.

    It is not started by `multiprocessing`, which would run the caller's script once more, and it is not in the
    terminal's process group: Ctrl-C reaches only this process, which ends the other one.
    """

    def __init__(
        self,
        main: str,
        arguments: Mapping[str, Any],
        environment: Mapping[str, str] | None = None,
        output: int = 2,  # what third-party code prints is not data
    ) -> None:
        """Start `package.module:function` with JSON arguments and the file descriptor of its end of a pipe."""
        local, remote = socket.socketpair()
        module, _, function = main.partition(":")
        call = {"path": sys.path, "arguments": {**arguments, "pipe": remote.fileno()}, "parent": os.getpid()}
        program = (
            "import json, sys; call = json.loads(sys.argv[1]); sys.path[:] = call['path']\n"
            "from rendergraph.system import end_with_parent\n"
            f"end_with_parent(call['parent'])\nfrom {module} import {function}\n{function}(**call['arguments'])"
        )
        with remote:
            self.process = subprocess.Popen(
                [sys.executable, "-P", "-c", program, json.dumps(call)],
                pass_fds=(remote.fileno(),),
                stdin=subprocess.DEVNULL,
                stdout=output,
                stderr=None if output == 2 else subprocess.STDOUT,
                start_new_session=True,
                env={**os.environ, **(environment or {})},
            )
        self.pipe = Connection(local.detach())
        self.has_answered = False

    def receive(self, timeout: float) -> Any:
        """Wait for the next message; TimeoutError if none came in time.

        An EOFError says that the process has ended; its text is the signal's name, or the exit code.
        """
        try:
            if not self.pipe.poll(timeout):
                raise TimeoutError
            message = self.pipe.recv()
        except TimeoutError:
            raise
        except (EOFError, OSError):
            raise EOFError(self.exit_reason()) from None
        self.has_answered = True
        return message

    def exit_reason(self) -> str:
        with contextlib.suppress(subprocess.TimeoutExpired):
            self.process.wait(1.0)
        code = self.process.returncode
        if code is not None and code < 0:
            with contextlib.suppress(ValueError):
                return signal.Signals(-code).name
        return f"exit code {code}"

    def kill(self) -> None:
        system.kill_session(self.process.pid)
        self.process.wait()
        self.pipe.close()


class WorkerProcess:
    """A process that runs tasks, one at a time; it is started for a task when there is none."""

    def __init__(self, name: str, device: int | None = None, *, timeout: float = TIMEOUT) -> None:
        self.name = name
        self.child: ChildProcess | None = None
        self._device, self._timeout = device, timeout
        self._stored: set[str] = set()
        self._unsent: list[tuple[Any, ...]] = []
        self._heard = 0.0

    def send(
        self, task: Task, values: Mapping[str, bytes], environment: Mapping[str, str] | None = None, **folders: str
    ) -> None:
        """Send a task with pickled values by digest, each once; start a process if necessary.

        The environment and the folders (`root`, `home` of `run_tasks`) are of a process that is started.
        """
        if self.child is None:
            arguments = {"name": self.name, "device": self._device, **folders}
            self.child = ChildProcess("rendergraph.farm.worker_process:run_tasks", arguments, environment)
            self._stored = set()
        self._heard = time.monotonic()
        self._unsent = [("store", new, pickle.loads(values[new])) for new in values.keys() - self._stored]
        self._unsent.append(("run", task))
        self._stored |= values.keys()
        if self.child.has_answered:  # what is sent to a process that reads nothing yet may wait for ever
            self._send_all(self.child)

    def _send_all(self, child: ChildProcess) -> None:
        try:
            for message in self._unsent:
                child.pipe.send(message)
        except OSError:
            raise self._loss_error(child.exit_reason()) from None

    @property
    def seconds_left(self) -> float:
        assert self.child is not None
        patience = self._timeout if self.child.has_answered else STARTUP_TIMEOUT
        return max(0.0, self._heard + patience - time.monotonic())

    def receive(self) -> tuple[str, Any]:
        """Wait for the next message: `(ready, device)`, `(item, value)`, `(finished, seconds)` or `(failed, error)`.

        A RenderError says that the process has ended or was terminated, a DeviceError that it has no usable GL device.
        """
        assert self.child is not None
        try:
            kind, value = self.child.receive(self.seconds_left)
        except TimeoutError:
            text = f"did not start within {STARTUP_TIMEOUT:g} s and was terminated"
            if self.child.has_answered:
                text = f"timed out after {self._timeout:g} s without progress and was terminated; --timeout allows more"
            self.kill()
            raise RenderError(Problem("RG640", f"worker '{self.name}' {text}")) from None
        except EOFError as error:
            raise self._loss_error(str(error)) from None
        self._heard = time.monotonic()
        if kind == "unable":
            self.kill()
            raise value
        if kind == "ready":
            self._send_all(self.child)
        return kind, value

    def _loss_error(self, reason: str) -> RenderError:
        self.kill()
        cause = "a driver that crashes or too little memory can cause this"
        if reason == "SIGALRM":
            cause = "drawing a frame took longer than --draw-timeout allows"
        text = f"worker '{self.name}' ended ({reason}); {cause}"
        return RenderError(Problem("RG640", text))

    def kill(self) -> None:
        if self.child is not None:
            self.child.kill()
        self.child = None


def run_tasks(pipe: int, name: str, device: int | None, root: str | None = None, home: str | None = None) -> None:
    """Run tasks one after the other until the pipe ends: what a worker process does.

    It takes `(store, digest, value)` and `(run, task)`, and sends `ready` or `unable` once, then what
    `WorkerProcess.receive` returns. `root` is the folder of uploaded files, `home` the client's current folder.
    """
    from rendergraph.farm.bundle import map_remote_paths  # in the process itself alone
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
            kind, *arguments = end.recv()
            if kind == "store":
                worker.store(Handle(arguments[0]), arguments[1])
                continue
            begun = time.monotonic()
            try:
                for value in arguments[0].run(worker):
                    end.send(("item", value))
            except RendergraphError as error:
                end.send(("failed", map_remote_paths(error, worker.root)))
            except MemoryError:
                end.send(("failed", RenderError(Problem("RG640", "the worker ran out of memory"))))
            else:
                end.send(("finished", time.monotonic() - begun))
