"""What several processes give a sweep: `python tests/bench/bench_farm.py`; two measured, up to a thousand modelled.

Costs are CPU seconds, which other work on the machine changes little: of the client for each variant (planned, sent,
kept), of a worker for its start, and for groups of variants by their size. The model deals groups out to whoever is free
first; the client plans all variants before, the first run is drawn alone, what comes back is kept one after the other.
"""

from __future__ import annotations

import heapq
import pickle
import resource
import tempfile
from collections.abc import Iterator
from itertools import count
from pathlib import Path
from statistics import fmean
from time import perf_counter, process_time

import rendergraph as rg
from rendergraph.compare.batches import MOST_RUNS
from rendergraph.compare.engine import Sweep, sweep
from rendergraph.compare.tasks import VariantTask
from rendergraph.farm.tasks import Event, Serial, Task, TaskFinished, TaskOutput, Worker

AXES: dict[str, list[float | str]] = {
    "shadows.taps": [1, 2, 3, 4],
    "ao.samples": [8, 12, 16, 24],
    "display.curve": ["aces", "none", "neutral", "reinhard"],
}
RUNS = 64
MODELLED = 2000


class Metered(Serial):
    """This process, cut as for many workers, and everything planned anew from what would be sent."""

    def __init__(self, workers: int) -> None:
        super().__init__()
        self.workers = workers
        self.costs: dict[int, list[float]] = {}
        begun = process_time()
        assert self._worker.gpu
        self.start = process_time() - begun

    def submit(self, task: Task) -> None:
        """As it would arrive elsewhere."""
        handles = {handle.digest: self._worker.value(handle) for handle in task.needs}
        super().submit(pickle.loads(pickle.dumps(task)))
        assert handles or not task.needs

    def events(self) -> Iterator[Event]:
        """With what each task costs, without what is done with it between its items."""
        while self._waiting:
            task, spent = self._waiting.popleft(), 0.0
            assert isinstance(task, VariantTask)
            own = Worker("elsewhere", self._worker.gpu)
            own._values = self._worker._values
            values = task.run(own)
            while True:
                begun = process_time()
                value = next(values, None)
                spent += process_time() - begun
                if value is None:
                    break
                yield TaskOutput(task, "elsewhere", value)
            self.costs.setdefault(len(task.runs), []).append(spent)
            yield TaskFinished(task, "elsewhere", spent)


def modelled(workers: int, costs: dict[int, float], client: float, start: float) -> tuple[float, int]:
    """Seconds until the last of the runs is kept, and the size of the groups."""
    size = max(each for each in costs if each <= max(1, min(MOST_RUNS, -(-MODELLED // (2 * workers)))))
    planned = MODELLED * client / 2  # the other half is keeping
    first = planned + start + costs[1]
    free = [first] * workers
    done = []
    for _ in range(-(-MODELLED // size)):
        end = heapq.heappop(free) + costs[size]
        heapq.heappush(free, end)
        done.append(end)
    clock = first
    for end in sorted(done):
        clock = max(clock, end) + size * client / 2
    return clock, size


def main() -> None:
    """Measure, and print."""
    base = rg.load("ssao-hemisphere", size=(160, 90))
    base.check()
    costs, clients, starts = dict[int, float](), list[float](), list[float]()
    with tempfile.TemporaryDirectory() as folder:
        names = count()

        def swept(executor: object) -> Sweep:
            return sweep(base, AXES, Path(folder) / str(next(names)), frames=1, executor=executor)

        swept("serial")  # imports, files in memory
        for workers in (2, 4, 8, 32):
            with Metered(workers) as farm:
                begun = process_time()
                found = swept(farm)
                spent = process_time() - begun
            clients.append((spent - sum(map(sum, farm.costs.values()))) / RUNS)
            starts.append(farm.start)
            costs |= {size: fmean(each) for size, each in farm.costs.items()}
            print(f"groups of {max(farm.costs)}: {found.executed} of {found.alone} passes drawn, {spent:.1f} s")
        for executor in ("serial", "processes:2") * 2:
            before, wall, own = resource.getrusage(resource.RUSAGE_CHILDREN), perf_counter(), process_time()
            swept(executor)
            after = resource.getrusage(resource.RUSAGE_CHILDREN)
            there = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
            print(
                f"{executor}: {perf_counter() - wall:.1f} s, CPU {process_time() - own:.1f} s here, {there:.1f} s there"
            )
    client, start = min(clients), min(starts)
    print(f"client {1e3 * client:.0f} ms a variant; a worker's device {start:.2f} s; groups: ", end="")
    print(", ".join(f"{size} in {cost:.2f} s" for size, cost in sorted(costs.items())))
    alone, _ = modelled(1, costs, client, start)
    for workers in (1, 2, 4, 8, 16, 32, 64, 128, 256, 512, 1000):
        seconds, size = modelled(workers, costs, client, start)
        print(f"{workers:5} workers: {seconds:7.1f} s, {alone / seconds:6.1f} times as fast, groups of {size}")


if __name__ == "__main__":
    main()
