"""Processes of this machine: what is lost with one is done by another, and nothing is done for ever."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from rendergraph.errors import DeviceError, UsageError
from rendergraph.farm import worker_process
from rendergraph.farm.executors import Processes, make_executor
from rendergraph.farm.tasks import Serial, TaskFailed, TaskFinished, TaskOutput, TaskRetried

Chores = Callable[..., Any]


def of(events: list[Any], name: str) -> list[type]:
    return [type(event) for event in events if event.task.name == name]


def test_a_process_that_hangs_before_it_reads_is_given_up(
    chore: Chores, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "sitecustomize.py").write_text("import time\n\ntime.sleep(60)\n")
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    monkeypatch.setattr(worker_process, "STARTUP_TIMEOUT", 0.3)
    begun = time.monotonic()
    with Processes(1) as farm:
        farm.submit(chore("any", needs=(farm.put(bytes(1 << 22)),)))  # more than a pipe takes that nobody reads
        retried, failed = farm.events()
    assert isinstance(retried, TaskRetried)
    assert isinstance(failed, TaskFailed)
    assert "worker 'process-0' did not start within 0.3 s and was terminated" in str(failed.error)
    assert time.monotonic() - begun < 20


@pytest.mark.slow
def test_what_is_lost_is_tried_again_and_given_up_at_last(chore: Chores, tmp_path: Path) -> None:
    """Two processes, and every way in which a task ends, in one go."""
    with Processes(2, timeout=2.0) as farm:
        handle = farm.put([1, 2, 3])
        assert farm.put([1, 2, 3]) == handle
        for does in ("nothing", "dies once", "dies", "fails", "hangs", "lacks memory"):
            farm.submit(chore(does, does, tmp_path / does.replace(" ", "-"), (handle,)))
        events = list(farm.events())
        farm.submit(chore("later"))
        assert [type(event) for event in farm.events()] == [TaskOutput, TaskFinished]
    assert of(events, "nothing") == [TaskOutput, TaskFinished]
    assert of(events, "dies once") == [TaskOutput, TaskRetried, TaskOutput, TaskFinished]
    assert of(events, "fails") == [TaskOutput, TaskFailed]
    for does in ("dies", "hangs", "lacks memory"):
        assert of(events, does) == [TaskOutput, TaskRetried, TaskOutput, TaskFailed]
    failed = {event.task.name: event for event in events if isinstance(event, TaskFailed)}
    assert {name: event.lost for name, event in failed.items()} == {
        "dies": True,
        "fails": False,
        "hangs": True,
        "lacks memory": True,
    }
    assert "ended (SIGKILL)" in str(failed["dies"].error)
    assert "timed out after 2 s" in str(failed["hangs"].error)
    items = [event for event in events if isinstance(event, TaskOutput)]
    assert all(event.value[2] == [1, 2, 3] for event in items)
    pids = {event.value[1] for event in items}
    assert 7 <= len(pids) <= 9  # seven were lost, and two are there at a time
    for pid in pids:
        with pytest.raises(ProcessLookupError):
            os.kill(pid, 0)


def test_processes_without_a_device_say_so(chore: Chores) -> None:
    with Processes(2, (77,)) as farm:
        farm.submit(chore("a"))
        with pytest.raises(DeviceError, match="RG611"):
            list(farm.events())


CLIENT = """
import signal
from chores import Chore
from rendergraph.farm.executors import Processes
signal.signal(signal.SIGINT, signal.default_int_handler)  # which whoever runs the tests in the background ignores
with Processes(2) as farm:
    for number in range(2):
        farm.submit(Chore(str(number), "hangs"))
    for event in farm.events():
        print(event.value[1], flush=True)
"""


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGINT])
def test_whatever_ends_the_client_ends_its_processes_within_a_second(number: int, chore: Chores) -> None:
    client = subprocess.Popen(
        [sys.executable, "-c", CLIENT], cwd=Path(__file__).parent, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL
    )
    assert client.stdout is not None
    with client, client.stdout:
        pids = [int(client.stdout.readline()) for _ in range(2)]
        client.send_signal(number)
        client.wait(30)
    for _ in range(100):  # whose parent is gone are reaped by another process, in its own time
        left = [pid for pid in pids if alive(pid)]
        if not left:
            break
        time.sleep(0.1)
    assert not left


def alive(pid: int) -> bool:
    try:
        return "\nState:\tZ" not in Path(f"/proc/{pid}/status").read_text()
    except OSError:
        return False


@pytest.mark.parametrize("word", ["threads", "processes:0", "processes:x", "dask://", "dask://host"])
def test_executors_that_there_are_not_are_told(word: str) -> None:
    with pytest.raises(UsageError, match=r"RG641 unknown executor .*processes:N"), make_executor(word, tasks=2):
        pass


def test_little_work_stays_here_and_much_goes_out_where_there_is_room(monkeypatch: pytest.MonkeyPatch) -> None:
    from rendergraph.farm import executors

    def made(tasks: int, cores: int, devices: tuple[int, ...] = ()) -> tuple[type, int]:
        monkeypatch.setattr(executors, "cores", lambda: cores)
        monkeypatch.setattr("rendergraph.gl.egl.hardware", lambda: devices)
        with make_executor(None, tasks=tasks) as farm:
            return type(farm), farm.workers

    assert made(1, 64) == (Serial, 1)
    assert made(9, 2) == (Serial, 1)
    assert made(9, 64) == (Processes, 9)
    assert made(9, 4) == (Processes, 4)
    assert made(9, 2, (0, 1)) == (Processes, 2)
    assert made(9, 64, (0,)) == (Serial, 1)
