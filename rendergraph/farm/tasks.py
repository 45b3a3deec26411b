"""Tasks, workers and executors; and the simplest executor, this process."""

from __future__ import annotations

import hashlib
import pickle
import time
from abc import ABC, abstractmethod
from collections import Counter, deque
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self, TypeAlias

from msgspec import Struct

from rendergraph.errors import DeviceError, InputError, Problem, RenderError, RendergraphError

if TYPE_CHECKING:
    from rendergraph.farm.bundle import Bundle
    from rendergraph.session.gpu import Gpu

ATTEMPTS = 2
"""Attempts per task, if the worker may be the cause of a failure."""
_DEVICE_CODES = frozenset({"RG612", "RG613", "RG614", "RG616"})
"""Errors that may not occur on another device or in smaller tasks: memory, read-back, driver."""


@dataclass(frozen=True)
class Handle:
    """A value that several tasks need, sent to a worker once; identified by its content."""

    digest: str


class Task(ABC):
    """A piece of work that any worker can do, and the values it needs: all can be pickled, no GL and no open files."""

    name: str
    needs: tuple[Handle, ...] = ()

    @abstractmethod
    def run(self, worker: Worker) -> Iterator[Any]:
        """Yield each result as soon as it exists: values that can be pickled.

        A RendergraphError says why it fails. If that `is_retryable`, the task begins again on another worker, and the
        caller drops the earlier results.
        """


class Worker:
    """Where tasks run: one GL context, a `cache` for later tasks, and the folder of uploaded files, if any."""

    root: Path | None = None

    def __init__(self, name: str, gpu: Gpu | None = None, device: int | None = None) -> None:
        self.name = name
        self.cache: dict[Any, Any] = {}
        self._values: dict[str, Any] = {}
        self._gpu, self._device = gpu, device
        self._stack = ExitStack()

    @property
    def gpu(self) -> Gpu:
        if self._gpu is None:
            from rendergraph.session.gpu import opened  # a process that only sends tasks needs no GL

            self._gpu = self._stack.enter_context(opened(None, self._device))
        return self._gpu

    def store(self, handle: Handle, value: Any) -> None:
        self._values[handle.digest] = value

    def value(self, handle: Handle) -> Any:
        return self._values[handle.digest]

    def close(self) -> None:
        self._stack.close()


class _TaskEvent(Struct, frozen=True, eq=False):
    task: Task
    worker: str


class TaskOutput(_TaskEvent, frozen=True, eq=False):
    value: Any


class TaskFinished(_TaskEvent, frozen=True, eq=False):
    seconds: float


class TaskRetried(_TaskEvent, frozen=True, eq=False):
    """A worker was lost during a task, or failed for reasons of its own; another one begins the task again."""

    problems: tuple[Problem, ...]


class TaskFailed(_TaskEvent, frozen=True, eq=False):
    """A task will not be completed: it has failed itself, or is `lost` because too many workers were lost with it."""

    error: RendergraphError
    lost: bool = False

    @property
    def problems(self) -> tuple[Problem, ...]:
        return tuple(self.error.problems)


Event: TypeAlias = "TaskOutput | TaskFinished | TaskRetried | TaskFailed"


class Executor(AbstractContextManager["Executor"], ABC):
    """Runs tasks and reports their events. Only one thread may use it; leaving its block ends all running tasks."""

    workers: int

    def __init__(self) -> None:
        self._losses: Counter[tuple[Task, bool]] = Counter()
        self._values: dict[str, bytes] = {}  # pickled, by digest

    @abstractmethod
    def submit(self, task: Task) -> None:
        """Add a task; also while events are taken."""

    @abstractmethod
    def events(self) -> Iterator[Event]:
        """Yield events until every submitted task has finished or failed.

        A DeviceError says that no worker has a usable GL device, a RenderError that the cluster is gone.
        """

    @abstractmethod
    def close(self) -> None:
        """End all running tasks."""

    def put(self, value: Any) -> Handle:
        """Make a value available to tasks; it can be pickled, and each worker gets it once."""
        data = pickle.dumps(value, protocol=pickle.HIGHEST_PROTOCOL)
        digest = hashlib.sha256(data).hexdigest()
        self._values[digest] = data
        return Handle(digest)

    def upload_inputs(self, make: Callable[[], Bundle]) -> None:
        """Send the input files to workers that do not share a disk with this process, and check their packages."""

    def event(self, task: Task, worker: str, kind: str, value: Any) -> Event:
        """Return the event of a message from a worker's process; `lost` says that the process has ended."""
        if kind == "item":
            return TaskOutput(task, worker, value)
        if kind == "finished":
            return TaskFinished(task, worker, value)
        if kind == "lost" or is_retryable(value):
            return self.retry(task, worker, value)
        return TaskFailed(task, worker, value)

    def retry(self, task: Task, worker: str, error: RendergraphError, *, inputs_lost: bool = False) -> Event:
        """Submit a task again whose worker was lost, unless that happened too often; its inputs may be lost, too."""
        self._losses[task, inputs_lost] += 1
        if self._losses[task, inputs_lost] < (self.workers + 1 if inputs_lost else ATTEMPTS):
            self.submit(task)
            return TaskRetried(task, worker, tuple(error.problems))
        return TaskFailed(task, worker, error, lost=True)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()


def is_retryable(error: BaseException) -> bool:
    """Return whether another worker might succeed where one raised this."""
    if isinstance(error, RendergraphError):
        return isinstance(error, DeviceError) or any(problem.code in _DEVICE_CODES for problem in error.problems)
    return True


@dataclass(eq=False)
class Serial(Executor):
    """This process and this thread, task after task."""

    gpu: Gpu | None = None
    device: int | None = None
    workers: int = field(default=1, init=False)

    def __post_init__(self) -> None:
        self._worker = Worker("here", self.gpu, self.device)
        self._waiting: deque[Task] = deque()

    def submit(self, task: Task) -> None:
        self._waiting.append(task)

    def events(self) -> Iterator[Event]:
        while self._waiting:
            task, begun = self._waiting.popleft(), time.monotonic()
            try:
                for value in task.run(self._worker):
                    yield TaskOutput(task, self._worker.name, value)
            except (InputError, RenderError) as error:
                yield TaskFailed(task, self._worker.name, error)
            else:
                yield TaskFinished(task, self._worker.name, time.monotonic() - begun)

    def put(self, value: Any) -> Handle:
        handle = Handle(f"{id(value):x}")
        self._worker.store(handle, value)
        return handle

    def close(self) -> None:
        self._waiting.clear()
        self._worker.close()
