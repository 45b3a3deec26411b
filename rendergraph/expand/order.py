"""Order recorded steps if nodes form a cycle: steps, not nodes, are scheduled."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping
from itertools import pairwise
from pathlib import Path
from typing import TypeAlias

from rendergraph.declare import Function, InOut, Input, Part
from rendergraph.errors import InputError, Problem
from rendergraph.expand.recording import Recording, part_of, written_names
from rendergraph.link import Endpoint, Graph
from rendergraph.link.graph import upstream_first

_Step: TypeAlias = tuple[str, int]
_Follow: TypeAlias = Callable[[Endpoint], Endpoint]
_Cause: TypeAlias = tuple[str, str, Endpoint]
"""Why a step waits for another: the reading node, its input or port, and the source of the link."""


def step_order(graph: Graph, recordings: Mapping[str, Recording], follow: _Follow) -> list[_Step]:
    """Return node and number of every recorded step in topological order; raise RG117 if there is a cycle."""
    order = _StepOrder(graph, recordings, follow)
    steps = [(name, number) for name, one in recordings.items() for number in range(len(one.requests))]
    waits = {(name, number): order.waits(name, number) for name, number in steps}
    sorted_steps = upstream_first(waits)
    if len(sorted_steps) < len(waits):
        raise InputError(order.cycle(waits))
    return sorted_steps


class _StepOrder:
    def __init__(self, graph: Graph, recordings: Mapping[str, Recording], follow: _Follow) -> None:
        self.graph, self.recordings, self.follow = graph, recordings, follow
        self.writers: dict[Endpoint, list[int]] = defaultdict(list)
        for name, recording in self.recordings.items():
            for number, request in enumerate(recording.requests):
                for port in written_names(request):
                    self.writers[Endpoint(name, port)].append(number)

    def waits(self, name: str, number: int) -> dict[_Step, _Cause]:
        """Return the steps that a step waits for, each with a cause."""
        found: dict[_Step, _Cause] = {}
        requests = self.recordings[name].requests
        for target in (*requests[number].reads, *(part for _, part in requests[number].out)):
            for key, cause in self._before(name, part_of(target), number):
                found.setdefault(key, cause)
        written = written_names(requests[number])
        for earlier in range(number):  # reads a version that this step overwrites
            for part in map(part_of, requests[earlier].reads):
                if part.port.name in written and not part.previous:
                    found.setdefault((name, earlier), (name, part.port.name, Endpoint(name, part.port.name)))
        found.pop((name, number), None)
        return found

    def _before(self, name: str, part: Part, number: int | None) -> Iterator[tuple[_Step, _Cause]]:
        """Yield the steps that decide what a port holds before step `number` of its node; None: after all steps."""
        port = part.port
        if part.previous:
            return
        if isinstance(port, Function):
            ports = self.graph[name].node.ports()
            for read_name, read in zip(port.read_names, port.reads, strict=True):
                if not (isinstance(read, Part) and read.previous):
                    yield from self._before(name, ports[read_name].whole, number)
            return
        own = Endpoint(name, port.name)
        for earlier in self.writers.get(own, ()):
            if number is None or earlier < number:
                yield (name, earlier), (name, port.name, own)
        links = self.recordings[name].links.get(port.name, ()) if isinstance(port, Input | InOut) else ()
        for at, end in enumerate(links):
            source = self.follow(end)
            if end.previous or part.link not in (None, at) or source.node not in self.recordings:
                continue
            for key, _ in self._before(source.node, self.graph[source.node].node.ports()[source.port].whole, None):
                yield key, (name, port.name, end)

    def cycle(self, waits: Mapping[_Step, Mapping[_Step, _Cause]]) -> Problem:
        """Return the problem of one cycle, with its steps, nodes and links."""
        from graphlib import CycleError, TopologicalSorter  # only to name a cycle

        steps: list[_Step] = []
        try:
            TopologicalSorter(waits).prepare()
        except CycleError as error:
            steps = error.args[1]
        hops, place = [], None
        for earlier, later in pairwise(steps):
            node, name, end = waits[later][earlier]
            value = self.graph.cyclic.get((node, name, end))
            where = f" ({'line ' + str(value.place.line)})" if value is not None and value.place.line else ""
            by = "" if node == later[0] else f" of '{node}'"
            hops.append(f"{self._name(later)} reads '{end}'{by}{where}")
            place = value if value is not None else place
        if len(hops) > 6:
            hops[3:-2] = ["…"]
        every = [key for _, key in pairwise(steps) if self.recordings[key[0]].requests[key[1]].reads_all]
        way = "append '@previous' to a link to read last frame's value"
        if every:
            way = f"{self._name(every[0])} names no input, so it reads all: name in `record` what it reads; or {way}"
        text = f"the steps form a cycle: {', '.join(hops)}; {way}"
        return place.problem("RG117", text) if place is not None else Problem("RG117", text)

    def _name(self, key: _Step) -> str:
        name, number = key
        request = self.recordings[name].requests[number]
        label = f"{number} {request.options.get('label') or ''}".rstrip()
        step = f"'{name}'" if len(self.recordings[name].requests) == 1 else f"step {label} of '{name}'"
        return step + (f" ({Path(request.caller[0]).name}:{request.caller[1]})" if request.caller else "")
