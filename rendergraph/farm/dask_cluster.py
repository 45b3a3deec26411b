"""A Dask cluster as an executor: started here, at an address, or that of a `Client`."""

from __future__ import annotations

import contextlib
import hashlib
import logging
import pickle
import queue
import shutil
import tempfile
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import CancelledError
from pathlib import Path
from typing import Any, TypeAlias
from uuid import uuid4

import distributed
from distributed import WorkerPlugin, get_worker

from rendergraph.errors import InputError, Problem, RenderError, RendergraphError, UsageError
from rendergraph.farm.bundle import Bundle, check_packages, make_bundle
from rendergraph.farm.tasks import Event, Executor, Handle, Task
from rendergraph.farm.worker_process import WorkerProcess
from rendergraph.installed import version

_distributed: Any = distributed  # most of it is not typed
Client: TypeAlias = Any
Cluster: TypeAlias = Any
Future: TypeAlias = Any

CONNECT_SECONDS = 10.0
"""Seconds for a scheduler to answer, and to answer again."""
COPIES = 2
"""Number of workers that first hold uploaded content, so that losing one of them loses nothing."""
_POLL = 0.25
_RESUME = "finished runs are saved; continue with --resume"
_WORKER_LEAVES = (OSError, KeyError, ValueError)
"""Raised by Dask's scheduler if a worker leaves while content is sent to it; Dask has no class for that."""


def start_local_cluster(count: int, devices: Sequence[int | None], *, timeout: float) -> Dask:
    _silence_logs()
    # Its workers are threads of this process, and each has a process of its own by its `WorkerSetup`: Dask's way of
    # starting processes would run the caller's script once more.
    cluster = _distributed.LocalCluster(
        n_workers=count,
        threads_per_worker=1,
        processes=False,
        dashboard_address=None,
        silence_logs=logging.CRITICAL,
        scheduler_kwargs={"dashboard_address": ":0"},  # it serves status anyway; any port that is free
    )
    return Dask(_distributed.Client(cluster, set_as_default=False), devices, timeout=timeout, cluster=cluster)


def connect(choice: Any, device: int | None, *, timeout: float) -> Dask:
    """Connect to the cluster at an address, `dask://host:port`, or to that of a `Client`, which stays open."""
    if isinstance(choice, _distributed.Client):
        return Dask(choice, (device,), timeout=timeout)
    if not isinstance(choice, str):
        text = f"expected an executor's name, an Executor or a Dask Client, got {type(choice).__name__}"
        raise UsageError(Problem("RG641", text))
    _silence_logs()
    address = choice.removeprefix("dask://")
    try:
        client = _distributed.Client(f"tcp://{address}", timeout=CONNECT_SECONDS, set_as_default=False)
    except OSError:
        text = f"no Dask scheduler answers at {address}; start one: dask scheduler"
        raise RenderError(Problem("RG641", text)) from None
    if not _workers(client):
        client.close()
        text = f"the Dask scheduler at {address} has no workers; start some: dask worker {address}"
        raise RenderError(Problem("RG641", text))
    return Dask(client, (device,), timeout=timeout, owned=True)


def _silence_logs() -> None:
    """Let Dask print critical errors only; its own `silence_logs` ends with the cluster, before connections do."""
    for handler in logging.getLogger("distributed").handlers:
        handler.setLevel(logging.CRITICAL)


def _workers(client: Client) -> dict[str, Any]:
    found: dict[str, Any] = client.scheduler_info(n_workers=-1)["workers"]
    return found


class Dask(Executor):
    """A Dask cluster. A worker runs one task at a time; where any has `resources={'GPU': 1}`, only those are used."""

    def __init__(
        self,
        client: Client,
        devices: Sequence[int | None] = (None,),
        *,
        timeout: float,
        cluster: Cluster = None,
        owned: bool = False,
    ) -> None:
        """Use a client, which is closed at the end if it is `owned`, like a cluster that was started for it."""
        super().__init__()
        workers = _workers(client)
        self._resources = {"GPU": 1} if any("GPU" in each["resources"] for each in workers.values()) else None
        self.workers = max(1, sum(self._resources is None or "GPU" in each["resources"] for each in workers.values()))
        self._client, self._cluster, self._owned = client, cluster, owned or cluster is not None
        self._devices, self._timeout = devices, timeout
        self._setup = f"rendergraph-{uuid4().hex[:12]}"
        self._bundle: Bundle | None = None
        self._paths: dict[str, Path] = {}
        self._uploaded: dict[str, Future] = {}
        self._uploads = 0
        self._done: queue.SimpleQueue[Future] = queue.SimpleQueue()
        self._tasks: dict[str, Task] = {}
        self._futures: dict[str, Future] = {}
        self._upload_of: dict[Task, int] = {}  # the upload that a task was submitted with

    def upload_inputs(self, make: Callable[[], Bundle]) -> None:
        bundle = make()
        paths = {digest: Path(path) for path, digest in bundle.files.items() if digest not in self._paths}
        self._upload({digest: path.read_bytes() for digest, path in paths.items()})
        self._paths |= paths
        if self._bundle is None:
            setup = WorkerSetup(self._setup, bundle.packages, tuple(self._devices), self._timeout)
            try:
                self._client.register_plugin(setup, name=self._setup)
                errors = self._client.run(setup_error, self._setup, on_error="return")
            except (ImportError, AttributeError, RuntimeError, OSError) as error:
                raise self._unusable(str(error)) from error
            found = {worker: error for worker, error in errors.items() if error is not None}
            if found:
                known = (e if isinstance(e, InputError) else self._unusable(f"{w}: {e}") for w, e in found.items())
                raise InputError([problem for error in known for problem in error.problems])
        self._bundle = bundle

    @staticmethod
    def _unusable(error: str) -> InputError:
        fix = f"install it there: pip install 'rendergraph[farm]=={version('rendergraph')}'"
        return InputError(Problem("RG642", f"a worker cannot use rendergraph ({' '.join(error.split())[:200]}); {fix}"))

    def _upload(self, contents: dict[str, bytes]) -> None:
        """Send contents to some workers, by their SHA-256; other workers fetch them from these when they need them."""
        begun = time.monotonic()
        named = {f"{self._setup}-{self._uploads}-{digest}": content for digest, content in contents.items()}
        while named:
            try:
                found = self._client.scatter(named, hash=False, broadcast=COPIES)
            except _WORKER_LEAVES as error:
                self._check_scheduler(None)
                if time.monotonic() - begun > CONNECT_SECONDS:
                    raise RenderError(Problem("RG641", f"the workers accept no files ({error}); {_RESUME}")) from error
                time.sleep(_POLL)
            else:
                self._uploaded |= {key.rpartition("-")[2]: future for key, future in found.items()}
                return

    def _upload_again(self) -> None:
        """Send everything again, because workers that held some of it are gone."""
        contents = dict(self._values)
        for digest, path in self._paths.items():
            contents[digest] = path.read_bytes() if path.is_file() else b""
            if hashlib.sha256(contents[digest]).hexdigest() != digest:
                text = f"the workers that had the input files are gone, and '{path}' has changed since; {_RESUME}"
                raise RenderError(Problem("RG641", text))
        self._uploads += 1
        self._upload(contents)

    def put(self, value: Any) -> Handle:
        handle = super().put(value)
        if handle.digest not in self._uploaded:
            self._upload({handle.digest: self._values[handle.digest]})
        return handle

    def submit(self, task: Task) -> None:
        if self._bundle is None:
            self.upload_inputs(lambda: make_bundle((), ()))
        assert self._bundle is not None
        future = self._client.submit(
            run_task,
            self._setup,
            pickle.dumps(task, protocol=pickle.HIGHEST_PROTOCOL),
            {handle.digest: self._uploaded[handle.digest] for handle in task.needs},
            self._bundle,
            {digest: self._uploaded[digest] for digest in self._bundle.files.values()},
            key=f"{self._setup}-{uuid4().hex}",
            pure=False,
            retries=0,
            resources=self._resources,
        )
        self._tasks[future.key], self._futures[future.key] = task, future
        self._upload_of[task] = self._uploads
        future.add_done_callback(self._done.put)

    def events(self) -> Iterator[Event]:
        gone = None
        while self._tasks:
            try:
                future = self._done.get(timeout=_POLL)
            except queue.Empty:
                gone = self._check_scheduler(gone)
                continue
            task = self._tasks.pop(future.key, None)
            self._futures.pop(future.key, None)
            if task is not None:
                yield from self._events_of(task, future)

    def _check_scheduler(self, gone: float | None) -> float | None:
        """Return when the scheduler stopped answering; None if it answers. A RenderError ends a long wait."""
        if self._client.status == "running":
            return None
        gone = gone or time.monotonic()
        if self._client.status in ("closed", "closing") or time.monotonic() - gone > CONNECT_SECONDS:
            raise RenderError(Problem("RG641", f"the Dask scheduler is gone; {_RESUME}"))
        return gone

    def _events_of(self, task: Task, future: Future) -> Iterator[Event]:
        begun = time.monotonic()
        answer, finished = None, future.status == "finished"
        if finished:
            with contextlib.suppress(CancelledError):  # the worker that held it is gone
                answer = future.result()
        if answer is None and future.status != "error":
            while self._client.status == "connecting":
                time.sleep(_POLL)
                self._check_scheduler(begun)
            self._check_scheduler(None)
            inputs_left = finished and all(upload.status == "finished" for upload in self._uploaded.values())
            if not inputs_left and self._upload_of[task] == self._uploads:  # most likely they are lost, too
                self._upload_again()
            error = RenderError(Problem("RG640", "the cluster lost the task"))
            yield self.retry(task, "scheduler", error, inputs_lost=True)
            return
        if answer is None:
            error = future.exception()
            text = f"worker lost: {type(error).__name__}: {' '.join(str(error).split())[:300]}"
            yield self.retry(task, "cluster", RenderError(Problem("RG640", text)))
            return
        worker, messages = answer
        yield from (self.event(task, worker, kind, value) for kind, value in messages)

    def close(self) -> None:
        """Leave the cluster and end our tasks there; a cluster that was started here ends, too."""
        self._tasks.clear()
        with contextlib.suppress(Exception):  # it may be gone, in any way
            if self._client.status == "running":
                self._client.cancel(list(self._futures.values()), force=True)
                if self._cluster is None and self._bundle is not None:
                    self._client.unregister_worker_plugin(self._setup)
        self._futures.clear()
        self._uploaded.clear()
        with contextlib.suppress(Exception):
            if self._owned:
                self._client.close(timeout=1)
            if self._cluster is not None:
                self._cluster.close(timeout=1)


# --- on a worker -----------------------------------------------------------------------------------------------------

# Tasks do not run in the Dask worker's own process: a driver that hangs there could not be ended, and one that crashes
# would take the worker with it.


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
        number = worker.name if isinstance(worker.name, int) else 0
        device = self._devices[number % len(self._devices)]
        self._process = WorkerProcess(str(worker.address), device, timeout=self._timeout)
        self.error = check_packages(self._packages, str(worker.address))

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
                for digest, content in files.items():
                    path = self._folder / "stored" / digest
                    if not path.exists():
                        path.write_bytes(content)
                bundle.write(root, self._folder / "stored")
                self._bundle = bundle.digest
            messages: list[tuple[str, Any]] = []
            try:
                self._process.send(
                    pickle.loads(task), values, bundle.environment(root), root=str(root), home=bundle.home
                )
                while not messages or messages[-1][0] in ("ready", "item"):
                    messages.append(self._process.receive())
            except RendergraphError as error:
                messages.append(("lost", error))
            return [message for message in messages if message[0] != "ready"]


def run_task(
    setup: str, task: bytes, values: Mapping[str, bytes], bundle: Bundle, files: Mapping[str, bytes]
) -> tuple[str, list[tuple[str, Any]]]:
    """Run one of our tasks as a Dask task, with the values that it needs and the contents of files, by digest."""
    worker: Any = get_worker()
    return str(worker.address), worker.plugins[setup].run(task, values, bundle, files)


def setup_error(setup: str, dask_worker: Any) -> RendergraphError | None:
    error: RendergraphError | None = dask_worker.plugins[setup].error
    return error
