"""The part of an executor that runs on a Dask worker: a worker process with its GL context, and uploaded files.

Tasks do not run in the Dask worker's own process: a driver that hangs there could not be ended, and one that crashes
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

from rendergraph.errors import RendergraphError
from rendergraph.farm.bundle import Bundle, check_packages
from rendergraph.farm.worker_process import WorkerProcess


class WorkerSetup(WorkerPlugin):
    """One on each worker while the executor exists; tasks find it by its name."""

    def __init__(
        self, name: str, packages: Mapping[str, tuple[str, str]], devices: Sequence[int | None], timeout: float
    ) -> None:
        self.name = name
        self._packages, self._devices, self._timeout = packages, tuple(devices), timeout

    def setup(self, worker: Any) -> None:
        self._lock = threading.Lock()
        self._bundle = ""
        self._folder = Path(tempfile.mkdtemp(prefix="rendergraph-", dir=worker.local_directory))
        (self._folder / "stored").mkdir()
        address = str(worker.address)
        number = worker.name if isinstance(worker.name, int) else 0
        device = self._devices[number % len(self._devices)]
        self._process = WorkerProcess(address, device, timeout=self._timeout)
        self.error = check_packages(self._packages, address)

    def teardown(self, worker: Any) -> None:
        self._process.kill()
        shutil.rmtree(self._folder, ignore_errors=True)

    def run(
        self, task: bytes, values: Mapping[str, bytes], bundle: Bundle, files: Mapping[str, bytes]
    ) -> list[tuple[str, Any]]:
        """Return all outputs of a task, each with its kind; the last one is `finished`, `failed` or `lost`."""
        with self._lock:
            if self.error is not None:
                return [("lost", self.error)]
            root = self._folder / bundle.digest[:16]
            if bundle.digest != self._bundle:
                self._process.kill()
                self._write(bundle, root, files)
            messages: list[tuple[str, Any]] = []
            try:
                self._process.send(
                    pickle.loads(task), values, bundle.environment(root), root=str(root), home=bundle.home
                )
                while not messages or messages[-1][0] == "item":
                    messages.append(self._process.receive())
            except RendergraphError as error:
                messages.append(("lost", error))
            return messages

    def _write(self, bundle: Bundle, root: Path, files: Mapping[str, bytes]) -> None:
        for digest, content in files.items():
            path = self._folder / "stored" / digest
            if not path.exists():
                path.write_bytes(content)
        bundle.write(root, self._folder / "stored")
        self._bundle = bundle.digest


def run_task(
    setup: str, task: bytes, needs: Sequence[str], bundle: Bundle, digests: Sequence[str], *contents: bytes
) -> tuple[str, list[tuple[str, Any]]]:
    """Run one of our tasks as a Dask task; `contents` are the files' by digest, then the values that the task needs."""
    worker: Any = get_worker()
    files = dict(zip(digests, contents[: len(digests)], strict=True))
    values = dict(zip(needs, contents[len(digests) :], strict=True))
    return str(worker.address), worker.plugins[setup].run(task, values, bundle, files)


def setup_error(setup: str, dask_worker: Any) -> RendergraphError | None:
    error: RendergraphError | None = dask_worker.plugins[setup].error
    return error
