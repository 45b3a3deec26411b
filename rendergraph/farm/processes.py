"""Tasks in several processes on this machine; if a process is lost, only its task begins again."""

from __future__ import annotations

import hashlib
import os
import pickle
from collections import deque
from collections.abc import Iterator, Sequence
from multiprocessing.connection import wait
from typing import Any

from rendergraph.errors import DeviceError, RenderError, RendergraphError
from rendergraph.farm.tasks import Event, Executor, Handle, Task, TaskFailed, TaskFinished, TaskOutput, is_retryable
from rendergraph.farm.worker_process import TIMEOUT, WorkerProcess


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
        self._values: dict[str, bytes] = {}
        threads = str(max(1, (os.cpu_count() or 1) // count))  # else each software rasteriser takes all cores
        self._environment = {"LP_NUM_THREADS": os.environ.get("LP_NUM_THREADS", threads)}

    def submit(self, task: Task) -> None:
        self._waiting.append(task)

    def put(self, value: Any) -> Handle:
        data = pickle.dumps(value, protocol=pickle.HIGHEST_PROTOCOL)
        handle = Handle(hashlib.sha256(data).hexdigest())
        self._values[handle.digest] = data
        return handle

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
            yield self._retry(worker, error)

    def _receive(self, worker: WorkerProcess) -> Iterator[Event]:
        try:
            kind, value = worker.receive()
        except RenderError as error:
            yield self._retry(worker, error)
        except DeviceError as error:  # the others go on without it
            self._waiting.appendleft(self._busy.pop(worker))
            if not self._busy and not self._idle:
                raise error
        else:
            if kind == "ready":
                return
            if kind == "item":
                yield TaskOutput(self._busy[worker], value, worker.name)
            elif kind == "failed" and is_retryable(value):
                yield self._retry(worker, value)
            elif kind == "failed":
                yield TaskFailed(self._free(worker), worker.name, value)
            else:
                yield TaskFinished(self._free(worker), worker.name, value)

    def _free(self, worker: WorkerProcess) -> Task:
        self._idle.append(worker)
        return self._busy.pop(worker)

    def _retry(self, worker: WorkerProcess, error: RendergraphError) -> Event:
        """End a process that cannot be used any more; its task begins again, or has failed."""
        worker.kill()
        return self.retry(self._free(worker), worker.name, error)

    def close(self) -> None:
        self._waiting.clear()
        for worker in (*self._idle, *self._busy):
            worker.kill()
        self._busy.clear()
