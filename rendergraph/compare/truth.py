"""Ground truth as a reference: a pipeline that converges from frame to frame and estimates its own noise.

Such a pipeline has the outputs `radiance`, the mean so far, and `variance`, the variance of that mean; `samples_taken`
counts the samples of each pixel. It is rendered until its noise is a small part of the smallest error to be measured.
Noise and errors are relative mean square errors of the light, so they can be compared and subtracted: a measured error
is the sum of both.
"""

from __future__ import annotations

import math
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import numpy.typing as npt

from rendergraph.compare.light import LIGHT, displayed, with_light
from rendergraph.compare.prepare import Run, TruthLimits, Twin
from rendergraph.compare.results import Reference
from rendergraph.compare.tasks import ReferenceResult, origin_of
from rendergraph.farm import Handle, Task, Worker
from rendergraph.images.cache import DiskCache
from rendergraph.metrics import Encoding, Pixels, colors, measure, relative_mse, relative_noise
from rendergraph.session import RenderOptions, stages

if TYPE_CHECKING:
    from rendergraph.session.gpu import Gpu
    from rendergraph.session.values import Planned

TWIN_FRAMES = 16
"""Frames to average for a twin's light: a single frame of a traced twin is noisy."""
_LEAST_FRAMES = 2
"""After one frame, pixels whose few samples are all equal seem to have no variance."""
_CACHE = DiskCache("truths", 1 << 30)
_MOST_LIGHTS = 512 << 20
"""Bytes of the light of the runs, which is rendered first to know the smallest error."""


class TruthProgress(NamedTuple):
    """The completed part of a truth, 0…1, its samples per pixel, and the ratio of its noise to the target."""

    part: float
    samples: int
    excess: float | None = None

    def __str__(self) -> str:
        noise = f", noise {self.excess:.2g} × the target" if self.excess is not None else ""
        return f"{self.samples} samples{noise}"


@dataclass(frozen=True, eq=False)
class Truth:
    """The light, (height, width, 3), the variance of each value, the samples per pixel, and the time taken."""

    radiance: npt.NDArray[np.float32]
    variance: npt.NDArray[np.float32]
    samples: int
    seconds: float

    @property
    def noise(self) -> float:
        """The relative mean square error that the light has by its variance; NaN if a value is not finite."""
        return relative_noise(self.variance, self.radiance)

    def with_noise_again(self) -> npt.NDArray[np.float32]:
        """Return the light with normally distributed noise of its variance, the same in all channels of a pixel."""
        normal = np.random.default_rng(0).standard_normal((*self.radiance.shape[:2], 1), dtype=np.float32)
        return np.asarray(self.radiance + np.sqrt(np.maximum(self.variance, 0)) * normal, np.float32)


@dataclass(frozen=True, eq=False, kw_only=True)
class TruthTask(Task):
    """Render the truth: yield its progress, and finally the reference.

    Attributes:
        key: identifies the truth, except for the number of samples.
        truth, base: the pipeline of the truth, and the one whose display chain makes the picture.
        runs: the runs that are measured against it.
    """

    name: str
    key: str
    truth: Run
    base: Run
    runs: tuple[Run, ...]
    encoding: Encoding
    limits: TruthLimits

    def run(self, worker: Worker) -> Iterator[TruthProgress | ReferenceResult]:
        planned, frame = self.truth.plan(worker), self.truth.frame
        lights = [_light(worker.gpu, run.plan(worker), run) for run in self.runs]
        found = _load(self.key)
        if found is None or not _is_enough(found, lights, self.limits):
            for each in draw_truth(worker.gpu, planned, frame, lights, self.limits):
                if isinstance(each, Truth):
                    found = each
                else:
                    yield each
            assert found is not None  # it comes last
            _CACHE.put(self.key, vars(found))
        base = self.base.plan(worker)
        assert self.base.light is not None
        lights = [found.radiance, found.with_noise_again()]
        pixels, noisy = (displayed(worker.gpu, base, self.base.light, p, self.base.output, frame) for p in lights)
        reference = Reference(
            name=self.truth.name,
            kind="pipeline",
            pixels=pixels,
            encoding=self.encoding,
            output=self.base.output,
            light=found.radiance,
            noise=found.noise,
            flip_noise=measure(noisy, pixels, encoding=self.encoding)[0].flip,
            samples=found.samples,
        )
        yield ReferenceResult(reference, origin_of(worker))


@dataclass(frozen=True, eq=False, kw_only=True)
class TwinTask(Task):
    name: str
    needs: tuple[Handle, ...]
    twin: Twin

    def run(self, worker: Worker) -> Iterator[Twin]:
        reference, run = worker.value(self.needs[0]), self.twin.run
        light = _light(worker.gpu, run.plan(worker), run, frames=TWIN_FRAMES)
        error = relative_mse(light, reference.light)
        known = error if math.isfinite(error) else None
        yield replace(self.twin, error=replace(self.twin.error, relative_mse=known))


def representatives(runs: Sequence[Run]) -> tuple[Run, ...]:
    """Return the runs whose light is rendered before the truth: all, or as many as fit in memory, evenly spaced."""
    width, height = runs[0].planned.linked.graph.size
    most = max(1, _MOST_LIGHTS // (12 * width * height))
    return tuple(runs[:: math.ceil(len(runs) / most)])


def draw_truth(
    gpu: Gpu, planned: Planned, frame: int, lights: Sequence[Pixels], limits: TruthLimits
) -> Iterator[TruthProgress | Truth]:
    """Render the truth at a frame's time; yield its progress after each frame, and finally the truth.

    The scene stands still, while frame numbers advance, so samples differ. `lights`, (height, width, channels) each,
    will be measured against it. Nothing else may be rendered on the GPU meanwhile.
    """
    names = tuple(name for name in ("radiance", "variance", "samples_taken") if name in planned.linked.graph.outputs)
    options = RenderOptions(frames=range(frame, frame + 1), still=frame, outputs=names)
    begun = time.monotonic()
    with gpu.current():
        drawing = stages.compile(stages.expand(planned.linked, options), gpu)
        drawing.begin(lead=0)
    drawn, due, share, excess, samples, seconds = 0, 1, 0.0, None, 0, 0.0
    while True:
        drawn += 1
        part = max(share * (drawn - 1) / due, seconds / limits.seconds)
        yield TruthProgress(min(1.0, part), samples * (drawn - 1), excess)
        with gpu.current():
            drawing.draw(frame + drawn - 1)
        seconds = time.monotonic() - begun
        if drawn < due and seconds < limits.seconds:
            continue
        with gpu.current():
            truth = _truth(drawing.read().arrays, drawn, seconds)
        if truth.samples >= limits.most_samples or seconds >= limits.seconds or not math.isfinite(truth.noise):
            break
        wanted = limits.noise * _smallest_error(truth, lights)
        if drawn >= _LEAST_FRAMES and truth.noise <= wanted:
            break
        samples = truth.samples // drawn  # of each frame
        left = truth.noise / wanted if wanted > 0 else math.inf  # noise falls as the number of samples grows
        excess = left if math.isfinite(left) else None
        left = min(2.0, left, limits.most_samples / max(1, truth.samples))
        due = max(drawn + 1, math.ceil(drawn * left))
        share = min(1.0, max(1 / excess if excess else 0.0, truth.samples / limits.most_samples)) * due / drawn
    yield truth


def _truth(arrays: Any, frames: int, seconds: float) -> Truth:
    counts = arrays.get("samples_taken")
    radiance, variance = (colors(arrays[name]).astype(np.float32) for name in ("radiance", "variance"))
    return Truth(radiance, variance, frames if counts is None else round(float(counts[..., 0].mean())), seconds)


def _smallest_error(truth: Truth, lights: Sequence[Pixels]) -> float:
    return min((relative_mse(light, truth.radiance) for light in lights), default=0.0)


def _is_enough(truth: Truth, lights: Sequence[Pixels], limits: TruthLimits) -> bool:
    if not lights or truth.radiance.shape[:2] != lights[0].shape[:2]:
        return False
    if truth.samples >= limits.most_samples or truth.seconds >= limits.seconds:
        return True
    return truth.noise <= limits.noise * _smallest_error(truth, lights)


def _light(gpu: Gpu, planned: Planned, run: Run, frames: int = 1) -> Pixels:
    """Return the light of a run's frame, or the mean of several frames in which the scene stands still."""
    linked = with_light(planned, run.light).linked
    last = run.frame + frames - 1
    options = RenderOptions(frames=range(run.frame, last + 1), still=run.frame, outputs=(LIGHT,))
    total: Any = 0.0
    for frame in stages.draw(stages.expand(linked, options), gpu):
        total = total + colors(frame.arrays[LIGHT])
    return np.asarray(total / frames)


def _load(key: str) -> Truth | None:
    """Return the cached truth; None if there is none or it cannot be read."""
    if (stored := _CACHE.get(key)) is None:
        return None
    return Truth(stored["radiance"], stored["variance"], int(stored["samples"]), float(stored["seconds"]))


def noise_note(reference: Reference, smallest: float | None, limits: TruthLimits) -> str | None:
    """Return a sentence about a truth that is noisier than wanted; None if it is accurate enough."""
    noise = reference.noise
    if noise is None or smallest is None or noise <= limits.noise * smallest:
        return None
    if not math.isfinite(noise):
        return f"'{reference.name}' contains NaN or infinity, so its noise is unknown"
    part = (
        f"{100 * noise / smallest:.0f} % of the smallest error" if smallest > 0 else "not below the smallest error, 0"
    )
    ended = "samples" if limits.samples and (reference.samples or 0) >= limits.samples else "seconds"
    ended = f"--reference-{ended} {getattr(limits, ended):g}"
    return f"the noise of '{reference.name}' after {reference.samples} samples is {part}: {ended} ended it"
