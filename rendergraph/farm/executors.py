"""Executors: several processes on this machine, and the choice among all.

An executor is chosen by a name on the command line, by an object from Python, or by the size of the work.
"""

from __future__ import annotations

import os
import re
from collections import deque
from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager, nullcontext
from multiprocessing.connection import wait
from typing import TYPE_CHECKING, Any, TypeAlias

from rendergraph.errors import DeviceError, Problem, RenderError, UsageError
from rendergraph.farm.tasks import Event, Executor, Serial, Task, is_retryable
from rendergraph.farm.worker_process import TIMEOUT, WorkerProcess
from rendergraph.installed import require

if TYPE_CHECKING:
    from rendergraph.session.gpu import Gpu

ExecutorChoice: TypeAlias = "str | Executor | Any | None"
"""A name, an executor, a Dask `Client`; None leaves the choice to the size of the work."""
ENOUGH_CORES = 4
"""A software rasteriser uses all cores: with fewer than these, more processes gain nothing."""
_NAMES = "serial, processes, processes:N, dask, dask:N, dask://HOST:PORT"
_NAME = re.compile(r"serial|(processes|dask)(?::([1-9][0-9]{0,3}))?|dask://[^\s/]+:[0-9]{1,5}")
_MOST_WORKERS = 1024


class Processes(Executor):
    """Processes on this machine, which read files in place."""

    def __init__(self, count: int, devices: Sequence[int | None] = (None,), *, timeout: float = TIMEOUT) -> None:
        """Describe the processes, which are started for tasks; they get the devices in turns."""
        super().__init__()
        self.workers = count
        self._idle = [
            WorkerProcess(f"process-{number}", devices[number % len(devices)], timeout=timeout)
            for number in range(count)
        ]
        self._busy: dict[WorkerProcess, Task] = {}
        self._waiting: deque[Task] = deque()
        threads = str(max(1, (os.cpu_count() or 1) // count))  # else each software rasteriser takes all cores
        self._environment = {"LP_NUM_THREADS": os.environ.get("LP_NUM_THREADS", threads)}

    def submit(self, task: Task) -> None:
        self._waiting.append(task)

    @property
    def busy_pids(self) -> list[int]:
        return [worker.child.process.pid for worker in self._busy if worker.child is not None]

    def events(self) -> Iterator[Event]:
        while self._waiting or self._busy:
            while self._waiting and self._idle:
                yield from self._send(self._idle.pop(0), self._waiting.popleft())
            pipes: dict[Any, WorkerProcess] = {w.child.pipe: w for w in self._busy if w.child is not None}
            if not pipes:
                continue
            ready = wait(list(pipes), min(worker.seconds_left for worker in pipes.values()))
            for pipe, worker in pipes.items():
                if pipe in ready or worker.seconds_left == 0.0:
                    yield from self._receive(worker)

    def _send(self, worker: WorkerProcess, task: Task) -> Iterator[Event]:
        self._busy[worker] = task
        try:
            worker.send(task, {each.digest: self._values[each.digest] for each in task.needs}, self._environment)
        except RenderError as error:
            yield self.retry(self._free(worker), worker.name, error)

    def _receive(self, worker: WorkerProcess) -> Iterator[Event]:
        try:
            kind, value = worker.receive()
        except RenderError as error:
            kind, value = "lost", error
        except DeviceError as error:  # the others go on without it
            self._waiting.appendleft(self._busy.pop(worker))
            if not self._busy and not self._idle:
                raise error
            return
        if kind == "failed" and is_retryable(value):
            worker.kill()  # it cannot be used any more
        if kind != "ready":
            task = self._busy[worker] if kind == "item" else self._free(worker)
            yield self.event(task, worker.name, kind, value)

    def _free(self, worker: WorkerProcess) -> Task:
        self._idle.append(worker)
        return self._busy.pop(worker)

    def close(self) -> None:
        self._waiting.clear()
        for worker in (*self._idle, *self._busy):
            worker.kill()
        self._busy.clear()


def make_executor(
    choice: ExecutorChoice = None,
    session: Gpu | None = None,
    device: int | None = None,
    *,
    tasks: int,
    devices: Sequence[int] = (),
    timeout: float | None = None,
    travels: bool = True,
) -> AbstractContextManager[Executor]:
    """Return the chosen executor, for a `with` statement, which closes it unless it was given.

    The default is this process, or for several tasks as many processes as the machine has devices, or cores if it has
    only a software rasteriser. Work with in-memory node classes does not travel to other processes.
    """
    if isinstance(choice, Executor):
        return nullcontext(choice)
    timeout = timeout or TIMEOUT
    if choice == "serial" or (choice is None and (session is not None or tasks < 2 or not travels)):
        return Serial(session, devices[0] if devices and device is None else device)
    if choice is None:
        count, shared = _machine(device, devices)
        if min(count, tasks) < 2 or (shared == (None,) and count < ENOUGH_CORES):
            return Serial(None, shared[0])
        return Processes(min(count, tasks), shared, timeout=timeout)
    if not travels:
        text = "in-memory node classes cannot be sent to other processes; write them to files and pass plugins="
        raise UsageError(Problem("RG641", text))
    kind = number = None
    if isinstance(choice, str):
        try:
            check_executor_name(choice)
        except ValueError as error:
            raise UsageError(Problem("RG641", str(error))) from None
        kind, number = _NAME.fullmatch(choice).groups()  # type: ignore[union-attr]  # it was checked
    if kind == "processes":
        count, shared = _machine(device, devices)
        return Processes(int(number or count), shared, timeout=timeout)
    require("a Dask cluster", "farm", "distributed")
    from rendergraph.farm.dask_cluster import connect, start_local_cluster  # an extra

    if kind == "dask":
        count, shared = _machine(device, devices)
        return start_local_cluster(int(number or count), shared, timeout=timeout)
    return connect(choice, device, timeout=timeout)


def check_executor_name(text: str) -> str:
    found = _NAME.fullmatch(text)
    if found is None or int(found[2] or 1) > _MOST_WORKERS:
        raise ValueError(f"unknown executor '{text}'; available: {_NAMES}")
    return text


def cores() -> int:
    try:
        return max(1, len(os.sched_getaffinity(0)))
    except AttributeError:  # not on every system
        return os.cpu_count() or 1


def _machine(device: int | None, devices: Sequence[int]) -> tuple[int, tuple[int | None, ...]]:
    if devices:
        return len(devices), tuple(devices)
    if device is not None:
        return 1, (device,)
    from rendergraph.gl.egl import hardware  # asks the driver

    found = hardware() if "RENDERGRAPH_DEVICE" not in os.environ else ()
    return (len(found), found) if found else (cores(), (None,))
