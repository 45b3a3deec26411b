"""Which executor is meant: by a word on the command line, by an object from Python, or by the size of the work."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, TypeAlias

from rendergraph.errors import Problem, UsageError
from rendergraph.farm.processes import TIMEOUT, Processes
from rendergraph.farm.tasks import Executor, Serial

if TYPE_CHECKING:
    from rendergraph.session.gpu import Gpu

ExecutorChoice: TypeAlias = "str | Executor | Any | None"
"""Who works: a word, an executor, a Dask `Client`; None leaves it to the size of the work."""
WORDS = "serial, processes, processes:N, dask, dask:N or dask://HOST:PORT"
ENOUGH_CORES = 4
"""A software rasteriser takes all cores by itself: on fewer than these, further processes cost what they gain."""
_MOST = 1024


@contextmanager
def make_executor(
    where: ExecutorChoice = None,
    session: Gpu | None = None,
    device: int | None = None,
    *,
    tasks: int,
    devices: Sequence[int] = (),
    timeout: float | None = None,
    travels: bool = True,
) -> Iterator[Executor]:
    """The executor that is meant; one that was given is left open.

    Args:
        where: a word, an executor, a Dask `Client`; by default this process, or for several tasks as many processes as
            the machine has devices, or cores where it has a software rasteriser alone.
        session: where to draw in this process.
        device: GL device number.
        tasks: how many there are at most.
        devices: GL device numbers that processes share out.
        timeout: seconds that a worker may say nothing.
        travels: whether the work can be done by another process; node classes at hand cannot be sent.

    Raises:
        UsageError: there is no such executor, or a package that it needs is missing.
        RenderError: the cluster cannot be reached.
    """
    if isinstance(where, Executor):
        yield where
        return
    with _made(where, session, device, tasks, tuple(devices), timeout or TIMEOUT, travels) as executor:
        yield executor


def _made(
    where: ExecutorChoice,
    session: Gpu | None,
    device: int | None,
    tasks: int,
    devices: tuple[int, ...],
    timeout: float,
    travels: bool,
) -> Executor:
    if where is None and (session is not None or tasks < 2 or not travels):
        return Serial(session, devices[0] if devices and device is None else device)
    if where is None:
        count, shared = _machine(device, devices)
        if min(count, tasks) < 2 or (shared == (None,) and count < ENOUGH_CORES):
            return Serial(None, shared[0])
        return Processes(min(count, tasks), shared, timeout=timeout)
    if where == "serial":
        return Serial(session, devices[0] if devices and device is None else device)
    if not travels:
        text = "node classes that are at hand cannot be sent to other processes; write them to files, and name plugins="
        raise UsageError(Problem("RG641", text))
    if isinstance(where, str):
        found = re.fullmatch(r"(processes|dask)(?::([0-9]{1,4}))?|(dask://[^\s/]+:[0-9]{1,5})", where)
        if found is None or not 1 <= int(found[2] or 1) <= _MOST:
            raise UsageError(Problem("RG641", f"there is no executor '{where}'; available: {WORDS}"))
        if found[1] == "processes":
            count, shared = _machine(device, devices)
            return Processes(int(found[2] or count), shared, timeout=timeout)
        if found[1] == "dask":
            from rendergraph.farm.dask_cluster import local  # an extra

            count, shared = _machine(device, devices)
            return local(int(found[2] or count), shared, timeout=timeout)
    from rendergraph.farm.dask_cluster import of  # see above

    return of(where, device, timeout=timeout)


def check_executor_name(text: str) -> str:
    """The word, if it names an executor.

    Raises:
        ValueError: it does not.
    """
    if not re.fullmatch(r"serial|(?:processes|dask)(?::[1-9][0-9]{0,3})?|dask://[^\s/]+:[0-9]{1,5}", text):
        raise ValueError(f"there is no executor '{text}'; available: {WORDS}")
    return text


def cores() -> int:
    """Cores that this process may use."""
    try:
        return max(1, len(os.sched_getaffinity(0)))
    except AttributeError:  # not on every system
        return os.cpu_count() or 1


def _machine(device: int | None, devices: tuple[int, ...]) -> tuple[int, tuple[int | None, ...]]:
    """How many processes this machine takes, and the devices they share."""
    if devices:
        return len(devices), devices
    if device is not None:
        return 1, (device,)
    from rendergraph.gl.egl import hardware  # asks the driver

    found = hardware() if "RENDERGRAPH_DEVICE" not in os.environ else ()
    return (len(found), found) if found else (cores(), (None,))
