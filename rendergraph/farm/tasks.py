"""What is done, where, and what comes back; and the plainest place to do it, this process."""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any, Self, TypeAlias

from rendergraph.errors import DeviceError, InputError, Problem, RenderError, RendergraphError

if TYPE_CHECKING:
    from rendergraph.farm.bundle import Bundle
    from rendergraph.session.gpu import Gpu

ATTEMPTS = 2
"""How often a task is begun, where what ends it may be the worker's fault."""
_OF_THE_DEVICE = frozenset({"RG612", "RG613", "RG614", "RG616"})
"""Errors that may be another on another device, or when less is done at once: memory, read-back, driver."""


@dataclass(frozen=True)
class Handle:
    """Something that several tasks need, sent to a worker once; known by its content."""

    digest: str


class Task(ABC):
    """A piece of work that any worker can do: plain values that can be pickled, no GL and no open files.

    Attributes:
        name: what messages and events call it.
        needs: what it takes from its worker, put there once.
    """

    name: str
    needs: tuple[Handle, ...] = ()

    @abstractmethod
    def run(self, worker: Worker) -> Iterator[Any]:
        """Do it, and hand out what is done as soon as it is: values that can be pickled.

        It may be begun again on another worker after some of them; whoever takes them drops what came before.

        Raises:
            RendergraphError: it cannot be done. Of the worker (device lost, memory) another one gets it, else nobody.
        """


class Worker:
    """Where tasks run: a place with one GL context.

    Attributes:
        name: for messages and events.
        cache: what a task leaves for the next ones here, by keys of its own.
        root: the folder beneath which files lie that were sent here; None where they are found at their own places.
    """

    root: Path | None = None

    def __init__(self, name: str, gpu: Gpu | None = None, device: int | None = None) -> None:
        self.name = name
        self.cache: dict[Any, Any] = {}
        self._values: dict[str, Any] = {}
        self._gpu, self._device = gpu, device
        self._stack = ExitStack()

    @property
    def gpu(self) -> Gpu:
        """Its context, opened when it is first asked for.

        Raises:
            DeviceError: there is no usable GL device.
        """
        if self._gpu is None:
            from rendergraph.session.gpu import opened  # whoever only sends tasks needs no GL

            self._gpu = self._stack.enter_context(opened(None, self._device))
        return self._gpu

    def store(self, handle: Handle, value: Any) -> None:
        """Put something here that tasks need."""
        self._values[handle.digest] = value

    def value(self, handle: Handle) -> Any:
        """What a handle stands for."""
        return self._values[handle.digest]

    def close(self) -> None:
        """End the context, where it is its own."""
        self._stack.close()


@dataclass(frozen=True, eq=False)
class TaskOutput:
    """A task has handed out a value."""

    task: Task
    value: Any
    worker: str


@dataclass(frozen=True, eq=False)
class TaskFinished:
    """A task is done; all its items have come."""

    task: Task
    worker: str
    seconds: float


@dataclass(frozen=True, eq=False)
class TaskRetried:
    """A worker was lost with a task, or gave up for reasons of its own; another one begins the task again."""

    task: Task
    worker: str
    problems: tuple[Problem, ...]


@dataclass(frozen=True, eq=False)
class TaskFailed:
    """A task will not be done.

    Attributes:
        task: which.
        worker: that had it last.
        problems: why.
        lost: whether workers were lost with it, as often as is allowed; else it said itself that it cannot be done.
        error: what it raised, or an error of these problems.
    """

    task: Task
    worker: str
    error: RendergraphError
    lost: bool = False

    @property
    def problems(self) -> tuple[Problem, ...]:
        """Why."""
        return tuple(self.error.problems)


Event: TypeAlias = "TaskOutput | TaskFinished | TaskRetried | TaskFailed"


class Executor(AbstractContextManager["Executor"], ABC):
    """Takes tasks, and says what becomes of them. One thread uses it; leaving its block ends whatever still runs.

    Attributes:
        workers: how many tasks run at once.
        described: in words, for reports.
    """

    workers: int
    described: str

    @abstractmethod
    def submit(self, task: Task) -> None:
        """One more task; also while events are taken."""

    @abstractmethod
    def events(self) -> Iterator[Event]:
        """What happens, until every task that was submitted is finished or has failed.

        Raises:
            DeviceError: no worker has a usable GL device.
            RenderError: the cluster is gone.
        """

    @abstractmethod
    def close(self) -> None:
        """End it at once, with what is still at work."""

    @abstractmethod
    def put(self, value: Any) -> Handle:
        """Something that tasks need, which can be pickled; each worker gets it once."""

    def upload_inputs(self, make: Callable[[], Bundle]) -> None:
        """Send what pipelines are drawn from to workers that do not share a disk with this process.

        Raises:
            InputError: a worker lacks a plugin that is needed, or has another version of something.
        """

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


def is_retryable(error: BaseException) -> bool:
    """Whether another worker may have more luck than the one that raised this."""
    if isinstance(error, RendergraphError):
        return isinstance(error, DeviceError) or any(problem.code in _OF_THE_DEVICE for problem in error.problems)
    return True


@dataclass(eq=False)
class Serial(Executor):
    """This process and this thread, task after task.

    Attributes:
        gpu: where to draw; a private one by default.
        device: GL device number where none is given.
    """

    gpu: Gpu | None = None
    device: int | None = None
    workers: int = field(default=1, init=False)
    described: str = field(default="this process", init=False)

    def __post_init__(self) -> None:
        self._worker = Worker("here", self.gpu, self.device)
        self._waiting: deque[Task] = deque()

    def submit(self, task: Task) -> None:
        """One more task."""
        self._waiting.append(task)

    def events(self) -> Iterator[Event]:
        """Each task's, one after the other."""
        while self._waiting:
            task, begun = self._waiting.popleft(), time.monotonic()
            try:
                for value in task.run(self._worker):
                    yield TaskOutput(task, value, self._worker.name)
            except (InputError, RenderError) as error:
                yield TaskFailed(task, self._worker.name, error)
            else:
                yield TaskFinished(task, self._worker.name, time.monotonic() - begun)

    def put(self, value: Any) -> Handle:
        """It stays where it is."""
        handle = Handle(f"{id(value):x}")
        self._worker.store(handle, value)
        return handle

    def close(self) -> None:
        """End the context, where it is its own."""
        self._waiting.clear()
        self._worker.close()
