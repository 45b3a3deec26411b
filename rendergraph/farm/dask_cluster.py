"""A Dask cluster as an executor: one that is started here, one at an address, or whatever a `Client` leads to."""

from __future__ import annotations

import contextlib
import hashlib
import pickle
import queue
import time
from collections.abc import Callable, Iterator, Sequence
from importlib import import_module
from pathlib import Path
from typing import Any, TypeAlias
from uuid import uuid4

from rendergraph.errors import InputError, Problem, RenderError, UsageError
from rendergraph.farm.bundle import Bundle, make_bundle
from rendergraph.farm.tasks import (
    ATTEMPTS,
    Event,
    Executor,
    Handle,
    Task,
    TaskFailed,
    TaskFinished,
    TaskOutput,
    TaskRetried,
    is_retryable,
)
from rendergraph.installed import require, version

Client: TypeAlias = Any  # an extra, of which most is not typed
Cluster: TypeAlias = Any
Future: TypeAlias = Any

CONNECT = 10.0
"""Seconds for a scheduler to answer, and to come back."""
COPIES = 2
"""Workers that have what was sent before any asks for it: the loss of one loses nothing."""
_POLL = 0.25
_KEPT = "what is finished is kept: --resume goes on"
_GOING = (OSError, KeyError, ValueError)
"""What Dask's scheduler raises where a worker goes while it is sent something; it has no word for it."""


def local(count: int, devices: Sequence[int | None], *, timeout: float) -> Dask:
    """A cluster on this machine, which ends with its work.

    Raises:
        UsageError: Dask is not installed.
    """
    require("a Dask cluster", "farm", "distributed")
    distributed: Any = import_module("distributed")
    # Its workers are threads of this process, and each works in a process of its own, by its station: Dask's own way of
    # starting processes would run the caller's script once more.
    cluster = distributed.LocalCluster(
        n_workers=count, threads_per_worker=1, processes=False, dashboard_address=None, silence_logs=50
    )
    return Dask(distributed.Client(cluster, set_as_default=False), devices, timeout=timeout, cluster=cluster)


def of(where: Any, device: int | None, *, timeout: float) -> Dask:
    """The cluster at an address, `dask://host:port`, or of a `Client`, which stays open.

    Raises:
        UsageError: Dask is not installed, or this is neither.
        RenderError: nobody answers there.
    """
    require("a Dask cluster", "farm", "distributed")
    distributed: Any = import_module("distributed")
    if isinstance(where, distributed.Client):
        return Dask(where, (device,), timeout=timeout)
    if not isinstance(where, str):
        text = f"an executor is a word, an Executor, or a Dask Client, not {type(where).__name__}"
        raise UsageError(Problem("RG641", text))
    address = where.removeprefix("dask://")
    try:
        client = distributed.Client(f"tcp://{address}", timeout=CONNECT, set_as_default=False)
    except OSError:
        text = f"no Dask scheduler answers at {address}; start one: dask scheduler"
        raise RenderError(Problem("RG641", text)) from None
    if not _workers(client):
        client.close()
        text = f"the Dask scheduler at {address} has no workers; start some: dask worker {address}"
        raise RenderError(Problem("RG641", text))
    return Dask(client, (device,), timeout=timeout, owned=True)


def _workers(client: Client) -> dict[str, Any]:
    found: dict[str, Any] = client.scheduler_info(n_workers=-1)["workers"]
    return found


class Dask(Executor):
    """A Dask cluster. A worker does one task at a time; where any has `resources={'GPU': 1}`, only those are used."""

    def __init__(
        self,
        client: Client,
        devices: Sequence[int | None] = (None,),
        *,
        timeout: float,
        cluster: Cluster = None,
        owned: bool = False,
    ) -> None:
        """Take a client.

        Args:
            client: of the cluster.
            devices: GL device numbers that workers named by number share out.
            timeout: seconds that a worker may say nothing.
            cluster: that ends with the work.
            owned: whether the client is closed with it.
        """
        workers = _workers(client)
        self._resources = {"GPU": 1} if any("GPU" in each["resources"] for each in workers.values()) else None
        self.workers = max(1, sum(self._resources is None or "GPU" in each["resources"] for each in workers.values()))
        self.described = f"{self.workers} Dask workers"
        self._client, self._cluster, self._owned = client, cluster, owned or cluster is not None
        self._devices, self._timeout = devices, timeout
        self._station = f"rendergraph-{uuid4().hex[:12]}"
        self._bundle: Bundle | None = None
        self._paths: dict[str, Path] = {}
        self._values: dict[str, bytes] = {}
        self._sent: dict[str, Future] = {}
        self._sendings = 0
        self._done: queue.SimpleQueue[Future] = queue.SimpleQueue()
        self._tasks: dict[str, Task] = {}
        self._futures: dict[str, Future] = {}
        self._tried: dict[Task, int] = {}
        self._gone_with: dict[Task, int] = {}  # how often what a task was given went with workers
        self._sent_with: dict[Task, int] = {}  # how often had been sent what a task was given

    def upload_inputs(self, make: Callable[[], Bundle]) -> None:
        """Send files, and ask every worker whether it can be used.

        Raises:
            InputError: one lacks a plugin that is needed, or has another version of something.
        """
        from rendergraph.farm.dask_worker import Station, fitness  # needs the extra

        bundle = make()
        paths = {digest: Path(path) for path, digest in bundle.files.items() if digest not in self._paths}
        self._send({digest: path.read_bytes() for digest, path in paths.items()})
        self._paths |= paths
        if self._bundle is None:
            station = Station(self._station, bundle.packages, tuple(self._devices), self._timeout)
            try:
                self._client.register_plugin(station, name=self._station)
                told = self._client.run(fitness, self._station, on_error="return")
            except (ImportError, AttributeError, RuntimeError, OSError) as error:
                raise self._without(str(error)) from error
            problems = []
            for worker, unfit in told.items():
                if unfit is not None:
                    found = unfit if isinstance(unfit, InputError) else self._without(f"{worker}: {unfit}")
                    problems += list(found.problems)
            if problems:
                raise InputError(problems)
        self._bundle = bundle

    @staticmethod
    def _without(error: str) -> InputError:
        way = f"install it there: pip install 'rendergraph[farm]=={version('rendergraph')}'"
        return InputError(Problem("RG642", f"a worker cannot use rendergraph ({' '.join(error.split())[:200]}); {way}"))

    def _send(self, contents: dict[str, bytes]) -> None:
        """Send contents to workers, by their SHA-256; others get them from those when they need them.

        Raises:
            RenderError: no worker takes them.
        """
        begun = time.monotonic()
        named = {f"{self._station}-{self._sendings}-{digest}": content for digest, content in contents.items()}
        while named:
            try:
                found = self._client.scatter(named, hash=False, broadcast=COPIES)
            except _GOING as error:
                self._answers(None)
                if time.monotonic() - begun > CONNECT:
                    raise RenderError(Problem("RG641", f"the workers take no files ({error}); {_KEPT}")) from error
                time.sleep(_POLL)
            else:
                self._sent |= {key.rpartition("-")[2]: future for key, future in found.items()}
                return

    def _send_again(self) -> None:
        """Send everything once more, as the workers that had something of it are gone.

        Raises:
            RenderError: a file is another one by now, or no worker takes them.
        """
        contents = dict(self._values)
        for digest, path in self._paths.items():
            contents[digest] = path.read_bytes() if path.is_file() else b""
            if hashlib.sha256(contents[digest]).hexdigest() != digest:
                text = f"workers are gone with what is drawn from, and '{path}' has changed since; {_KEPT}"
                raise RenderError(Problem("RG641", text))
        self._sendings += 1
        self._send(contents)

    def put(self, value: Any) -> Handle:
        """Sent to the cluster, and from there to workers whose tasks need it."""
        data = pickle.dumps(value, protocol=pickle.HIGHEST_PROTOCOL)
        handle = Handle(hashlib.sha256(data).hexdigest())
        if handle.digest not in self._values:
            self._send({handle.digest: data})
            self._values[handle.digest] = data
        return handle

    def submit(self, task: Task) -> None:
        """One more task."""
        from rendergraph.farm.dask_worker import perform  # needs the extra

        if self._bundle is None:
            self.upload_inputs(lambda: make_bundle((), ()))
        assert self._bundle is not None
        digests = sorted(set(self._bundle.files.values()))
        needs = [handle.digest for handle in task.needs]
        future = self._client.submit(
            perform,
            self._station,
            pickle.dumps(task, protocol=pickle.HIGHEST_PROTOCOL),
            needs,
            self._bundle,
            digests,
            *(self._sent[digest] for digest in (*digests, *needs)),
            key=f"{self._station}-{uuid4().hex}",
            pure=False,
            retries=0,
            resources=self._resources,
        )
        self._tasks[future.key], self._futures[future.key] = task, future
        self._sent_with[task] = self._sendings
        future.add_done_callback(self._done.put)

    def events(self) -> Iterator[Event]:
        """What comes from the workers, when a task is over."""
        gone = None
        while self._tasks:
            try:
                future = self._done.get(timeout=_POLL)
            except queue.Empty:
                gone = self._answers(gone)
                continue
            task = self._tasks.pop(future.key, None)
            self._futures.pop(future.key, None)
            if task is not None:
                yield from self._told(task, future)

    def _answers(self, gone: float | None) -> float | None:
        """Since when the scheduler has not answered, None where it does.

        Raises:
            RenderError: for too long.
        """
        if self._client.status == "running":
            return None
        gone = gone or time.monotonic()
        if self._client.status in ("closed", "closing") or time.monotonic() - gone > CONNECT:
            raise RenderError(Problem("RG641", f"the Dask scheduler is gone; {_KEPT}"))
        return gone

    def _told(self, task: Task, future: Future) -> Iterator[Event]:
        begun = time.monotonic()
        if future.status in ("cancelled", "lost"):
            while self._client.status == "connecting":
                time.sleep(_POLL)
                self._answers(begun)
            self._answers(None)
            if self._sent_with[task] == self._sendings:  # most likely what it was given is lost, too
                self._send_again()
            error = RenderError(Problem("RG640", "the cluster lost the task"))
            yield from self._lost(task, "scheduler", error, self._gone_with, self.workers + 1)
            return
        if future.status == "error":
            error = future.exception()
            text = f"worker lost: {type(error).__name__}: {' '.join(str(error).split())[:300]}"
            yield from self._lost(task, "cluster", RenderError(Problem("RG640", text)))
            return
        worker, told = future.result()
        for kind, value in told:
            if kind == "item":
                yield TaskOutput(task, value, worker)
            elif kind == "finished":
                yield TaskFinished(task, worker, value)
            elif kind == "lost" or is_retryable(value):
                yield from self._lost(task, worker, value)
            else:
                yield TaskFailed(task, worker, value)

    def _lost(
        self, task: Task, worker: str, error: Any, tried: dict[Task, int] | None = None, most: int = ATTEMPTS
    ) -> Iterator[Event]:
        """Begin a task again, unless that was too often; where what it was given is gone, each worker counts."""
        tried = self._tried if tried is None else tried
        tried[task] = tried.get(task, 0) + 1
        if tried[task] < most:
            self.submit(task)
            yield TaskRetried(task, worker, tuple(error.problems))
        else:
            yield TaskFailed(task, worker, error, lost=True)

    def close(self) -> None:
        """Leave the cluster: what still runs for us there ends, and so does a cluster that was started for it."""
        self._tasks.clear()
        with contextlib.suppress(Exception):  # it may be gone, in any way
            if self._client.status == "running":
                self._client.cancel(list(self._futures.values()), force=True)
                if self._cluster is None and self._bundle is not None:
                    self._client.unregister_worker_plugin(self._station)
        self._futures.clear()
        self._sent.clear()
        with contextlib.suppress(Exception):
            if self._owned:
                self._client.close(timeout=1)
            if self._cluster is not None:
                self._cluster.close(timeout=1)
