"""Tasks that real processes do in tests: they find this module beside the tests."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rendergraph.errors import InputError, Problem, RenderError
from rendergraph.farm import Handle, Task, Worker


@dataclass(frozen=True, eq=False)
class Chore(Task):
    """Says who does it, then does something else.

    Attributes:
        name: of the task.
        does: `nothing`, `fails`, `dies`, `dies once`, `hangs`, `lacks memory`, `waits`.
        mark: a file by which attempts know of each other.
        needs: what it hands out.
    """

    name: str
    does: str = "nothing"
    mark: Path = Path()
    needs: tuple[Handle, ...] = ()

    def run(self, worker: Worker) -> Iterator[Any]:
        yield worker.name, os.getpid(), *(worker.value(each) for each in self.needs)
        if self.does == "fails":
            raise InputError(Problem("RG104", "wrong everywhere"))
        if self.does == "lacks memory":
            raise RenderError(Problem("RG612", "no memory on this device"))
        if self.does == "dies" or (self.does == "dies once" and not self.mark.exists()):
            self.mark.touch()
            os.kill(os.getpid(), signal.SIGKILL)
        if self.does == "hangs":
            time.sleep(600.0)
        if self.does == "waits":
            time.sleep(0.05)
