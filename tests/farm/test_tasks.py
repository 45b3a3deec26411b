"""Tasks and what becomes of them, in this process."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from rendergraph.errors import InputError, Problem, RenderError
from rendergraph.farm.tasks import Event, Serial, Task, TaskFailed, TaskFinished, TaskOutput, Worker


@dataclass(frozen=True)
class Count(Task):
    """Hands out numbers, and fails at one of them."""

    name: str
    to: int
    fails_at: int | None = None

    def run(self, worker: Worker) -> Iterator[Any]:
        for number in range(self.to):
            if number == self.fails_at:
                raise InputError(Problem("RG104", f"{number} is too much"))
            yield worker.name, number


def told(events: Iterator[Event]) -> list[tuple[Any, ...]]:
    found: list[tuple[Any, ...]] = []
    for event in events:
        if isinstance(event, TaskOutput):
            found.append((event.task.name, event.value))
        else:
            found.append((event.task.name, type(event)))
    return found


def test_items_come_in_order_and_a_failed_task_does_not_stop_the_next() -> None:
    with Serial() as farm:
        farm.submit(Count("a", 2))
        farm.submit(Count("b", 3, fails_at=1))
        events = farm.events()
        assert [next(events) for _ in range(2)][1].task.name == "a"
        farm.submit(Count("c", 0))
        assert told(events) == [("a", TaskFinished), ("b", ("here", 0)), ("b", TaskFailed), ("c", TaskFinished)]


def test_what_a_task_says_of_itself_is_no_fault_of_the_worker() -> None:
    from rendergraph.farm.tasks import is_retryable

    assert not is_retryable(InputError(Problem("RG104", "x")))
    assert not is_retryable(RenderError(Problem("RG508", "x")))
    assert is_retryable(RenderError(Problem("RG612", "x")))
    assert is_retryable(MemoryError())
