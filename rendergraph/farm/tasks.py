"""What is done, where, and what comes back; and the plainest place to do it, this process."""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, ExitStack
from dataclasses import dataclass, field
from types import TracebackType
from typing import TYPE_CHECKING, Any, Self, TypeAlias

from rendergraph.errors import DeviceError, InputError, Problem, RenderError, RendergraphError

if TYPE_CHECKING:
    from rendergraph.session.gpu import Gpu

ATTEMPTS = 2
"""How often a task is begun, where what ends it may be the worker's fault."""
_OF_THE_DEVICE = frozenset({"RG612", "RG613", "RG614", "RG616"})
"""Errors that may be another on another device, or when less is done at once: memory, read-back, driver."""


class Task(ABC):
    """A piece of work that any worker can do: plain values that can be pickled, no GL and no open files.

    Attributes:
        name: what messages and events call it.
    """

    name: str

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
        kept: what a task leaves for the next ones here, by keys of its own.
    """

    def __init__(self, name: str, gpu: Gpu | None = None, device: int | None = None) -> None:
        self.name = name
        self.kept: dict[Any, Any] = {}
        self.data: Mapping[str, bytes] = {}
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

    def close(self) -> None:
        """End the context, where it is its own."""
        self._stack.close()


@dataclass(frozen=True, eq=False)
class Item:
    """A task has handed out a value."""

    task: Task
    value: Any
    worker: str


@dataclass(frozen=True, eq=False)
class Finished:
    """A task is done; all its items have come."""

    task: Task
    worker: str
    seconds: float


@dataclass(frozen=True, eq=False)
class Lost:
    """A worker was lost with a task, or gave up for reasons of its own; another one begins the task again."""

    task: Task
    worker: str
    problems: tuple[Problem, ...]


@dataclass(frozen=True, eq=False)
class Failed:
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


Event: TypeAlias = "Item | Finished | Lost | Failed"


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

    def share(self, files: Sequence[Any]) -> None:
        """Make data known to the workers; where they are this process there is nothing to do."""

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


def of_the_worker(error: BaseException) -> bool:
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
                    yield Item(task, value, self._worker.name)
            except (InputError, RenderError) as error:
                yield Failed(task, self._worker.name, error)
            else:
                yield Finished(task, self._worker.name, time.monotonic() - begun)

    def close(self) -> None:
        """End the context, where it is its own."""
        self._waiting.clear()
        self._worker.close()
