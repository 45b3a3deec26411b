"""What a Dask worker has of us: a process of its own with a context, and the files that were sent.

The work is not done in the worker's own process: a driver that hangs there could not be ended, and one that crashes
would take the worker with it.
"""

from __future__ import annotations

import pickle
import shutil
import tempfile
import threading
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from distributed import WorkerPlugin, get_worker

from rendergraph.errors import Problem, RenderError, RendergraphError
from rendergraph.farm.bundle import Bundle, unfit
from rendergraph.farm.processes import FIRST
from rendergraph.farm.worker_process import Child, started


class Station(WorkerPlugin):
    """One on each worker, as long as the work goes on; tasks find it by its name."""

    def __init__(
        self, name: str, packages: Mapping[str, tuple[str, str]], devices: Sequence[int | None], timeout: float
    ) -> None:
        self.name = name
        self._packages, self._devices, self._timeout = packages, tuple(devices), timeout

    def setup(self, worker: Any) -> None:
        """On the worker, before its first task."""
        self._lock = threading.Lock()
        self._child: Child | None = None
        self._ready = False
        self._has: set[str] = set()
        self._bundle = ""
        self._folder = Path(tempfile.mkdtemp(prefix="rendergraph-", dir=worker.local_directory))
        (self._folder / "stored").mkdir()
        self._who = str(worker.address)
        number = worker.name if isinstance(worker.name, int) else 0
        self._device = self._devices[number % len(self._devices)]
        self.error = unfit(self._packages, self._who)

    def teardown(self, worker: Any) -> None:
        """The work is done, or given up: whatever is still at it ends."""
        if self._child is not None:
            self._child.end()
        shutil.rmtree(self._folder, ignore_errors=True)

    def perform(
        self, task: bytes, needs: Sequence[str], bundle: Bundle, files: Mapping[str, bytes], values: Sequence[bytes]
    ) -> list[tuple[str, Any]]:
        """All that a task hands out, each with its kind; at last `finished`, `failed` or `lost`."""
        with self._lock:
            if self.error is not None:
                return [("lost", self.error)]
            try:
                return self._done(task, needs, bundle, files, values)
            except _Lost as lost:
                self._end()
                return [*lost.told, ("lost", lost.error)]

    def _done(
        self, task: bytes, needs: Sequence[str], bundle: Bundle, files: Mapping[str, bytes], values: Sequence[bytes]
    ) -> list[tuple[str, Any]]:
        if bundle.digest != self._bundle:
            self._end()
            self._lay_out(bundle, files)
        child = self._child or self._start(bundle)
        told: list[tuple[str, Any]] = []
        try:
            for digest, value in zip(needs, values, strict=True):
                if digest not in self._has:
                    child.pipe.send(("give", digest, pickle.loads(value)))
                    self._has.add(digest)
            child.pipe.send(("run", pickle.loads(task)))
            while True:
                patience = self._timeout if self._ready else max(self._timeout, FIRST)
                if not child.pipe.poll(patience):
                    text = f"worker '{self._who}' said nothing for {patience:g} s and was ended; --timeout allows more"
                    raise _Lost(told, RenderError(Problem("RG640", text)))
                kind, value = child.pipe.recv()
                self._ready = True
                if kind == "unable":
                    raise _Lost(told, value)
                if kind != "ready":
                    told.append((kind, value))
                if kind in ("finished", "failed"):
                    return told
        except (EOFError, OSError):
            text = f"the process of worker '{self._who}' ended ({child.ended_by()}); a driver that crashes, or memory"
            raise _Lost(told, RenderError(Problem("RG640", f"{text} that runs out, does that"))) from None

    def _lay_out(self, bundle: Bundle, files: Mapping[str, bytes]) -> None:
        for digest, content in files.items():
            place = self._folder / "stored" / digest
            if not place.exists():
                place.write_bytes(content)
        bundle.lay_out(self._root(bundle), self._folder / "stored")
        self._bundle = bundle.digest

    def _root(self, bundle: Bundle) -> Path:
        return self._folder / bundle.digest[:16]

    def _start(self, bundle: Bundle) -> Child:
        root = self._root(bundle)
        words = {"name": self._who, "device": self._device, "root": str(root), "home": bundle.home}
        self._child = started("rendergraph.farm.worker_process:work", words, bundle.environment(root))
        self._ready, self._has = False, set()
        return self._child

    def _end(self) -> None:
        if self._child is not None:
            self._child.end()
        self._child = None


class _Lost(Exception):
    def __init__(self, told: list[tuple[str, Any]], error: RendergraphError) -> None:
        super().__init__(str(error))
        self.told, self.error = told, error


def perform(
    station: str,
    task: bytes,
    needs: Sequence[str],
    bundle: Bundle,
    digests: Sequence[str],
    *sent: bytes,
) -> tuple[str, list[tuple[str, Any]]]:
    """A task of Dask: one of ours, done at a station; what `sent` holds are files, then what the task needs."""
    worker: Any = get_worker()
    found = worker.plugins[station]
    files = dict(zip(digests, sent[: len(digests)], strict=True))
    return str(worker.address), found.perform(task, needs, bundle, files, sent[len(digests) :])


def fitness(station: str, dask_worker: Any) -> RendergraphError | None:
    """Why the worker that is asked, which Dask puts in, cannot be used; None where it can."""
    error: RendergraphError | None = dask_worker.plugins[station].error
    return error
