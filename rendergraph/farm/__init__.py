"""Run tasks in this process, in several processes, or on a Dask cluster.

A `Worker` runs a `Task`; an `Executor` takes tasks and reports `Event`s. Results do not depend on the executor.
"""

from __future__ import annotations

from rendergraph.farm.tasks import Event as Event
from rendergraph.farm.tasks import Executor as Executor
from rendergraph.farm.tasks import Handle as Handle
from rendergraph.farm.tasks import Serial as Serial
from rendergraph.farm.tasks import Task as Task
from rendergraph.farm.tasks import TaskFailed as TaskFailed
from rendergraph.farm.tasks import TaskFinished as TaskFinished
from rendergraph.farm.tasks import TaskOutput as TaskOutput
from rendergraph.farm.tasks import TaskRetried as TaskRetried
from rendergraph.farm.tasks import Worker as Worker
