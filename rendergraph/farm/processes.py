"""Several processes on this machine, each with a context of its own; one that is lost is replaced."""

from __future__ import annotations

import hashlib
import os
import pickle
import time
from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from multiprocessing.connection import wait
from typing import Any

from rendergraph.errors import DeviceError, Problem, RenderError, RendergraphError
from rendergraph.farm.tasks import (
    ATTEMPTS,
    Event,
    Executor,
    Handle,
    Task,
    TaskFailed,
    TaskFinished,
    TaskOutput,
    TaskRetried,
    is_retryable,
)
from rendergraph.farm.worker_process import Child, started

TIMEOUT = 600.0
"""Seconds that a worker may say nothing before it is taken to hang."""
FIRST = 120.0
"""Seconds until its first word, at least: it starts, imports, and opens its device."""


@dataclass(eq=False)
class _Seat:
    """Where one process sits at a time.

    Attributes:
        name: for messages and events.
        device: GL device number.
        child: the process, None where none has been needed yet or the last one was lost.
        task: what it is at.
        heard: when it got that, or last said something.
        ready: whether it has said anything.
        has: the handles it has been given.
    """

    name: str
    device: int | None
    child: Child | None = None
    task: Task | None = None
    heard: float = 0.0
    ready: bool = False
    has: set[str] = field(default_factory=set)


class Processes(Executor):
    """Processes on this machine, which read files where they lie."""

    def __init__(
        self, count: int, devices: Sequence[int | None] = (None,), *, timeout: float = TIMEOUT, attempts: int = ATTEMPTS
    ) -> None:
        """Processes are started when there is something to do.

        Args:
            count: how many.
            devices: GL device numbers, shared out in turns.
            timeout: seconds that one may say nothing before it is ended.
            attempts: how often a task is begun that loses its process.
        """
        self.workers = count
        self.described = f"{count} processes" if count > 1 else "a process"
        self._timeout, self._attempts = timeout, attempts
        self._seats = [_Seat(f"process-{number}", devices[number % len(devices)]) for number in range(count)]
        self._waiting: deque[Task] = deque()
        self._tried: dict[Task, int] = {}
        self._values: dict[str, bytes] = {}
        threads = str(max(1, (os.cpu_count() or 1) // count))  # else each software rasteriser takes all cores
        self._environment = {"LP_NUM_THREADS": os.environ.get("LP_NUM_THREADS", threads)}

    def submit(self, task: Task) -> None:
        """One more task."""
        self._waiting.append(task)

    def put(self, value: Any) -> Handle:
        """Kept here until a process needs it."""
        data = pickle.dumps(value, protocol=pickle.HIGHEST_PROTOCOL)
        handle = Handle(hashlib.sha256(data).hexdigest())
        self._values[handle.digest] = data
        return handle

    def events(self) -> Iterator[Event]:
        """What comes from the processes, in the order in which it comes."""
        while self._waiting or any(seat.task for seat in self._seats):
            for seat in self._seats:
                if seat.task is None and self._waiting:
                    yield from self._assign(seat, self._waiting.popleft())
            busy = {seat.child.pipe: seat for seat in self._seats if seat.task is not None and seat.child is not None}
            if not busy:
                continue
            left = min(map(self._deadline, busy.values())) - time.monotonic()
            for pipe in wait(list(busy), max(0.0, left)):
                yield from self._hear(busy[pipe])  # type: ignore[index]  # these are the pipes that were waited for
            for seat in busy.values():
                if seat.task is not None and time.monotonic() > self._deadline(seat):
                    text = f"worker '{seat.name}' said nothing for {self._timeout:g} s and was ended"
                    yield self._lost(seat, RenderError(Problem("RG640", f"{text}; --timeout allows more")))

    def _deadline(self, seat: _Seat) -> float:
        """When a silent process is taken to hang."""
        return seat.heard + (self._timeout if seat.ready else max(self._timeout, FIRST))

    def _assign(self, seat: _Seat, task: Task) -> Iterator[Event]:
        if seat.child is None:
            words = {"name": seat.name, "device": seat.device}
            seat.ready = False
            seat.child, seat.has = started("rendergraph.farm.worker_process:work", words, self._environment), set()
        seat.task, seat.heard = task, time.monotonic()
        try:
            for handle in task.needs:
                if handle.digest not in seat.has:
                    seat.child.pipe.send(("give", handle.digest, pickle.loads(self._values[handle.digest])))
                    seat.has.add(handle.digest)
            seat.child.pipe.send(("run", task))
        except OSError:
            yield self._gone(seat)

    def _hear(self, seat: _Seat) -> Iterator[Event]:
        assert seat.child is not None
        assert seat.task is not None
        try:
            kind, value = seat.child.pipe.recv()
        except (EOFError, OSError):
            yield self._gone(seat)
            return
        seat.heard, seat.ready = time.monotonic(), True
        if kind == "item":
            yield TaskOutput(seat.task, value, seat.name)
        elif kind == "finished":
            task, seat.task = seat.task, None
            yield TaskFinished(task, seat.name, value)
        elif kind == "unable":
            self._retire(seat, value)
        elif kind == "failed" and is_retryable(value):
            yield self._lost(seat, value)
        elif kind == "failed":
            task, seat.task = seat.task, None
            yield TaskFailed(task, seat.name, value)

    def _gone(self, seat: _Seat) -> Event:
        """What to say of a process whose pipe has closed."""
        assert seat.child is not None
        code = seat.child.ended_by()
        text = f"worker '{seat.name}' ended ({code}); a driver that crashes, or memory that runs out, does that"
        return self._lost(seat, RenderError(Problem("RG640", text)))

    def _lost(self, seat: _Seat, error: RendergraphError) -> Event:
        """The process is no longer of use; what it was at is begun elsewhere, or has failed."""
        assert seat.task is not None
        task = seat.task
        self._end(seat)
        self._tried[task] = self._tried.get(task, 0) + 1
        if self._tried[task] < self._attempts:
            self._waiting.append(task)
            return TaskRetried(task, seat.name, tuple(error.problems))
        return TaskFailed(task, seat.name, error, lost=True)

    def _retire(self, seat: _Seat, error: DeviceError) -> None:
        """A seat without a device: the others go on.

        Raises:
            DeviceError: it was the last.
        """
        assert seat.task is not None
        self._waiting.appendleft(seat.task)
        self._end(seat)
        self._seats.remove(seat)
        if not self._seats:
            raise error

    def _end(self, seat: _Seat) -> None:
        if seat.child is not None:
            seat.child.end()
        seat.child = seat.task = None

    def close(self) -> None:
        """End all processes."""
        self._waiting.clear()
        for seat in self._seats:
            self._end(seat)
