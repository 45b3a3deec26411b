"""Times with their spread: whole frames and passes, on the GPU and on the CPU."""

from __future__ import annotations

import math
import statistics
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, TypeAlias

from msgspec import Struct, structs, to_builtins

if TYPE_CHECKING:
    from rendergraph.execute import FrameTimes

Cost: TypeAlias = "tuple[float, float | None]"
"""Milliseconds on the CPU and on the GPU; None if the driver has no timer."""


class Spread(Struct, frozen=True, forbid_unknown_fields=True):
    """Milliseconds over frames: median, minimum and maximum, tenth and ninetieth percentile."""

    median: float
    min: float
    max: float
    p10: float
    p90: float

    @classmethod
    def of(cls, values: Sequence[float]) -> Spread:
        if len(values) < 2:
            return cls(*[values[0]] * 5)
        tenths = statistics.quantiles(values, n=10, method="inclusive")
        return cls(statistics.median(values), min(values), max(values), tenths[0], tenths[-1])


class PassTime(Struct, frozen=True, forbid_unknown_fields=True):
    """One pass: the sum of its steps in each frame; `gpu_ms` is None where the driver has no timer."""

    node: str
    type: str
    gpu_ms: Spread | None
    cpu_ms: Spread


class Times(Struct, frozen=True):
    """How long a pipeline takes.

    Attributes:
        frames: number of measured frames.
        frame_ms: from the first call until the device has finished; None if other pipelines shared the frames.
        gpu_ms, cpu_ms: time of all passes together, on the GPU, and in Python and the driver.
        repeats: the median of the headline time, in milliseconds, of each measurement; empty for a single one.
    """

    frames: int
    frame_ms: Spread | None
    gpu_ms: Spread | None
    cpu_ms: Spread
    passes: tuple[PassTime, ...]
    repeats: tuple[float, ...] = ()

    @property
    def headline(self) -> Spread:
        """The figure that tables sort by: GPU time, or the time of the whole frame if that is unknown."""
        return self.gpu_ms or self.frame_ms or self.cpu_ms

    @property
    def repeated(self) -> Spread | None:
        return Spread.of(self.repeats) if len(self.repeats) > 1 else None

    def covers(self, frames: int, repeats: int) -> bool:
        return self.frames >= frames * repeats and max(1, len(self.repeats)) >= repeats


NO_TIMES = Times(0, None, None, Spread(*[math.nan] * 5), ())
"""Of a picture that has not been measured."""


def times_of(frames: Sequence[FrameTimes], types: Mapping[str, str], names: Mapping[str, str] | None = None) -> Times:
    """Return the times of one pipeline.

    If several pipelines were rendered as one graph, `names` maps its nodes to those of that graph; two may map to one.
    """
    order = {node: place for place, node in enumerate(dict.fromkeys(step.node for step in frames[0].steps))}
    rendered = names if names is not None else {node: node for node in order}
    nodes = sorted((node for node in rendered if rendered[node] in order), key=lambda node: order[rendered[node]])
    costs = {
        node: [_total((s.cpu_ms, s.gpu_ms) for s in frame.steps if s.node == rendered[node]) for frame in frames]
        for node in nodes
    }
    whole = [_total(costs[node][number] for node in nodes) for number in range(len(frames))]
    return Times(
        frames=len(frames),
        frame_ms=Spread.of([frame.frame_ms for frame in frames]) if names is None else None,
        gpu_ms=_gpu(whole),
        cpu_ms=_cpu(whole),
        passes=tuple(PassTime(node, types[node], _gpu(costs[node]), _cpu(costs[node])) for node in nodes),
    )


def times_repeated(
    repeats: Sequence[Sequence[FrameTimes]], types: Mapping[str, str], names: Mapping[str, str]
) -> Times:
    """Return the times over all frames of several measurements, with the median of each measurement."""
    times = times_of([frame for frames in repeats for frame in frames], types, names)
    medians = tuple(times_of(frames, types, names).headline.median for frames in repeats)
    return structs.replace(times, repeats=medians) if len(repeats) > 1 else times


def step_times(frames: Sequence[FrameTimes]) -> list[dict[str, Any]]:
    """Return each step in order of execution: `node`, `step` (its number), `label`, and `gpu_ms` and `cpu_ms`."""
    costs: dict[tuple[str, int, str], list[Cost]] = {}
    for frame in frames:
        for step in frame.steps:
            costs.setdefault((step.node, step.index, step.label), []).append((step.cpu_ms, step.gpu_ms))
    keys = ("node", "step", "label", "gpu_ms", "cpu_ms")
    rows = ((*step, to_builtins(_gpu(values)), to_builtins(_cpu(values))) for step, values in costs.items())
    return [dict(zip(keys, row, strict=True)) for row in rows]


def _total(costs: Iterable[Cost]) -> Cost:
    values = list(costs)
    gpu = [value for _, value in values if value is not None]
    return sum(cpu for cpu, _ in values), sum(gpu) if gpu else None


def _gpu(costs: Sequence[Cost]) -> Spread | None:
    values = [gpu for _, gpu in costs if gpu is not None]
    return Spread.of(values) if values else None


def _cpu(costs: Sequence[Cost]) -> Spread:
    return Spread.of([cpu for cpu, _ in costs])
