"""Run tasks in this process, in several processes, or on a Dask cluster.

A `Worker` runs a `Task`; an `Executor` takes tasks and reports `Event`s. Results do not depend on the executor.
"""

from __future__ import annotations

from rendergraph.farm.tasks import Executor, Handle, Task, TaskFailed, TaskFinished, TaskOutput, TaskRetried, Worker
