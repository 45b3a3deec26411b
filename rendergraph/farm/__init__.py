"""Work done beside this process: by several processes, or by a Dask cluster; or in this one, in the same words.

A `Task` is what is done, a `Worker` where, an `Executor` takes tasks and says in `Event`s what becomes of them. Results
do not depend on which executor it is.
"""

from __future__ import annotations

from rendergraph.farm.tasks import (
    Event,
    Executor,
    Handle,
    Serial,
    Task,
    TaskFailed,
    TaskFinished,
    TaskOutput,
    TaskRetried,
    Worker,
)

__all__ = [
    "Event",
    "Executor",
    "Handle",
    "Serial",
    "Task",
    "TaskFailed",
    "TaskFinished",
    "TaskOutput",
    "TaskRetried",
    "Worker",
]
