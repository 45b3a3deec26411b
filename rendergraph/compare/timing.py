"""Times with their spread: whole frames and passes, on the GPU and on the CPU."""

from __future__ import annotations

import math
import statistics
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rendergraph.execute import FrameTimes, StepTime


@dataclass(frozen=True)
class Spread:
    """Milliseconds over frames: median, least and most, tenth and ninetieth percentile."""

    median: float
    min: float
    max: float
    p10: float
    p90: float

    @classmethod
    def of(cls, values: Sequence[float]) -> Spread:
        """The spread of one or more values."""
        if len(values) < 2:
            return cls(*[values[0]] * 5)
        tenths = statistics.quantiles(values, n=10, method="inclusive")
        return cls(statistics.median(values), min(values), max(values), tenths[0], tenths[-1])


@dataclass(frozen=True)
class PassTime:
    """One pass: the sum of its steps in each frame; `gpu_ms` is None where the driver has no timer."""

    node: str
    type: str
    gpu_ms: Spread | None
    cpu_ms: Spread


@dataclass(frozen=True)
class Times:
    """What a pipeline took.

    Attributes:
        frames: how many were measured.
        frame_ms: from the first call until the device was done; None where frames were not drawn alone.
        gpu_ms: the passes' time on the device, summed.
        cpu_ms: the passes' time in Python and the driver, summed.
        passes: each in order of execution.
        repeats: the headline's median, in milliseconds, of each time that it was measured anew; empty where once.
    """

    frames: int
    frame_ms: Spread | None
    gpu_ms: Spread | None
    cpu_ms: Spread
    passes: tuple[PassTime, ...]
    repeats: tuple[float, ...] = ()

    @property
    def headline(self) -> Spread:
        """The figure that stands for all of it: time on the GPU, or of the whole frame where that is unknown."""
        return self.gpu_ms or self.frame_ms or self.cpu_ms

    @property
    def repeated(self) -> Spread | None:
        """The spread of the repeats; None of less than two."""
        return Spread.of(self.repeats) if len(self.repeats) > 1 else None

    def as_json(self) -> dict[str, Any]:
        """The fields as plain JSON values."""
        return asdict(self)

    @classmethod
    def from_json(cls, found: Mapping[str, Any]) -> Times:
        """What `as_json` gave."""
        return cls(
            frames=found["frames"],
            frame_ms=_spread(found["frame_ms"]),
            gpu_ms=_spread(found["gpu_ms"]),
            cpu_ms=Spread(**found["cpu_ms"]),
            passes=tuple(
                PassTime(entry["node"], entry["type"], _spread(entry["gpu_ms"]), Spread(**entry["cpu_ms"]))
                for entry in found["passes"]
            ),
            repeats=tuple(found.get("repeats", ())),
        )


def enough(times: Times, frames: int, repeats: int = 1) -> bool:
    """Whether as many frames were measured as are asked for, as often."""
    return times.frames >= frames * repeats and max(1, len(times.repeats)) >= repeats


def _spread(found: Mapping[str, float] | None) -> Spread | None:
    return None if found is None else Spread(**found)


NO_TIMES = Times(0, None, None, Spread(*[math.nan] * 5), ())
"""Of what was drawn and not measured, or not drawn at all."""


def times_of(frames: Sequence[FrameTimes], types: Mapping[str, str]) -> Times:
    """Times of frames that one pipeline had to itself.

    Args:
        frames: what each took.
        types: node to the name of its type.
    """
    nodes = list(dict.fromkeys(step.node for step in frames[0].steps))
    own = {node: [_sum(frame.steps, {node}) for frame in frames] for node in nodes}
    whole = [_sum(frame.steps, None) for frame in frames]
    passes = tuple(PassTime(node, types[node], _gpu(own[node]), _cpu(own[node])) for node in nodes)
    return Times(len(frames), Spread.of([frame.frame_ms for frame in frames]), _gpu(whole), _cpu(whole), passes)


def step_times(frames: Sequence[FrameTimes]) -> list[dict[str, Any]]:
    """Each step in order of execution: `node`, its number there, `label`, and `gpu_ms` and `cpu_ms` as passes have."""
    own: dict[tuple[str, int, str], list[tuple[float, float | None]]] = {}
    for frame in frames:
        for step in frame.steps:
            own.setdefault((step.node, step.index, step.label), []).append((step.cpu_ms, step.gpu_ms))
    return [
        {
            "node": node,
            "step": index,
            "label": label,
            "gpu_ms": asdict(gpu) if (gpu := _gpu(values)) else None,
            "cpu_ms": asdict(_cpu(values)),
        }
        for (node, index, label), values in own.items()
    ]


def times_repeated(
    repeats: Sequence[Sequence[FrameTimes]], names: Mapping[str, str], types: Mapping[str, str]
) -> Times:
    """Times over all frames of several measurements, and the median of each measurement.

    Args:
        repeats: what each frame of each took.
        names, types: as for `times_within`.
    """
    found = times_within([frame for frames in repeats for frame in frames], names, types)
    if len(repeats) < 2:
        return found
    return replace(found, repeats=tuple(times_within(frames, names, types).headline.median for frames in repeats))


def times_within(frames: Sequence[FrameTimes], names: Mapping[str, str], types: Mapping[str, str]) -> Times:
    """Times of one of several pipelines that were drawn in the same frames.

    Args:
        frames: what each frame took.
        names: node of the pipeline to node of the drawn graph, for all that the pipeline draws; two may be one there.
        types: node of the pipeline to the name of its type.
    """
    place = {node: number for number, node in enumerate(dict.fromkeys(step.node for step in frames[0].steps))}
    nodes = sorted((node for node in names if names[node] in place), key=lambda node: place[names[node]])
    own = {node: [_sum(frame.steps, {names[node]}) for frame in frames] for node in nodes}
    whole = [_total([own[node][number] for node in nodes]) for number in range(len(frames))]
    passes = tuple(PassTime(node, types[node], _gpu(own[node]), _cpu(own[node])) for node in nodes)
    return Times(len(frames), None, _gpu(whole), _cpu(whole), passes)


def _total(values: Sequence[tuple[float, float | None]]) -> tuple[float, float | None]:
    gpu = [value for _, value in values if value is not None]
    return sum(cpu for cpu, _ in values), sum(gpu) if gpu else None


def _sum(steps: Sequence[StepTime], nodes: set[str] | None) -> tuple[float, float | None]:
    mine = [step for step in steps if nodes is None or step.node in nodes]
    gpu = [step.gpu_ms for step in mine if step.gpu_ms is not None]
    return sum(step.cpu_ms for step in mine), sum(gpu) if gpu else None


def _gpu(values: Sequence[tuple[float, float | None]]) -> Spread | None:
    found = [gpu for _, gpu in values if gpu is not None]
    return Spread.of(found) if found else None


def _cpu(values: Sequence[tuple[float, float | None]]) -> Spread:
    return Spread.of([cpu for cpu, _ in values])
