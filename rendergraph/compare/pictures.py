"""Pipelines against each other: pictures, times in turn, memory, and the first pass that differs."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from rendergraph import metrics
from rendergraph.compare.divergence import every_output, first_difference, passes
from rendergraph.compare.reference import compared_output, on_one_stage, read_picture, unique_names
from rendergraph.compare.timing import Times, times_of
from rendergraph.compare.values import Comparison, Difference, Pixels, Reference, Result
from rendergraph.diff import diff

if TYPE_CHECKING:
    from rendergraph.allocate import ResourcePlan
    from rendergraph.execute import FrameTimes
    from rendergraph.session import Frame, Pipeline, Session

FRAMES_A_TURN = 2
"""Few, so that whatever else the machine does falls on all variants alike."""

Progress = Callable[[int, int], None]
"""Told how many parts of the work are done, and of how many."""


@dataclass(frozen=True, eq=False)
class _Drawn:
    """A pipeline with its plan and its picture."""

    pipeline: Pipeline
    plan: ResourcePlan
    frame: Frame


def compare(
    pipelines: Sequence[Pipeline],
    reference: Path | Pipeline | None = None,
    *,
    frames: int = 10,
    frame: int = 1,
    session: Session | None = None,
    device: int | None = None,
    progress: Progress | None = None,
) -> Comparison:
    """Draw pipelines on one scene, with one camera and at one size, and compare what comes out.

    Args:
        pipelines: what is compared; all are drawn with the scene and at the size of the first.
        reference: a picture file or another pipeline; the first of `pipelines` by default.
        frames: how many frames of each are measured; the pipelines take turns.
        frame: number of the frame whose pictures are compared.
        session: where to draw; a private one by default.
        device: GL device number where no session is given.
        progress: told about the work done.

    Raises:
        InputError: a mistake in a file, or the pictures cannot be compared.
        RenderError: it failed while drawing.
        DeviceError: there is no usable GL device.
    """
    own = [] if reference is None or isinstance(reference, Path) else [reference]
    staged, notes = on_one_stage([*pipelines, *own])
    names = unique_names([pipeline.name for pipeline in staged[: len(pipelines)]])
    plans = [pipeline.plan() for pipeline in staged]
    picture = read_picture(reference, staged[0].graph.size, names[0]) if isinstance(reference, Path) else None
    output, encoding = compared_output(staged, picture[1] if picture else None)
    step = _Steps(len(staged) + frames + 2 * len(pipelines), progress)
    with opened(session, device) as session:
        drawn = []
        for pipeline, plan in zip(staged, plans, strict=True):
            drawn.append(_Drawn(pipeline, plan, session.render(pipeline, frames=range(1, frame + 1))))
            step()
        variants = drawn[: len(pipelines)]
        base = drawn[-1] if own else drawn[0]
        if picture:
            against = Reference(str(reference), "file", *picture)
        else:
            name = base.pipeline.name if own else names[0]
            against = Reference(name, "pipeline" if own else "variant", base.frame[output], encoding)
        times = _times(session, [d.pipeline for d in variants], frames, step)
        tapped = every_output(session, base.pipeline, base.plan, frame)
        results = []
        for name, each, taken in zip(names, variants, times, strict=True):
            first = None
            if each is not base:
                seen = every_output(session, each.pipeline, each.plan, frame)
                difference = diff(base.pipeline.graph, each.pipeline.graph)
                first = first_difference(tapped, seen, each.plan, each.pipeline.graph, difference)
            step()
            results.append(_result(name, each, base, against, taken, first))
            step()
    first_one = staged[0]
    return Comparison(
        results=tuple(results),
        reference=against,
        base=(base.pipeline.name if own else names[0], base.pipeline.graph),
        scene=first_one.spec.scene.stem if first_one.spec.scene else first_one.scene.name,
        camera=first_one.camera,
        size=first_one.graph.size,
        frame=frame,
        device=drawn[0].frame.device,
        notes=tuple(notes),
        warnings=tuple(
            dict.fromkeys(
                problem
                for each in drawn
                for problem in (*each.frame.warnings, *each.pipeline.catalog.extensions.warnings)
            )
        ),
    )


def _result(
    name: str, drawn: _Drawn, base: _Drawn, reference: Reference, times: Times, first: Difference | None
) -> Result:
    graph, pixels = drawn.pipeline.graph, drawn.frame[reference.output]
    plugins = drawn.pipeline.catalog.extensions.metrics()
    if reference.pixels is pixels:
        found, map_ = metrics.same(pixels, plugins), None
    else:
        names = (name, reference.name)
        found, map_ = metrics.measure(
            pixels, reference.pixels, encoding=reference.encoding, names=names, plugins=plugins
        )
    light = None if reference.kind == "file" else base.frame.get("radiance")
    return Result(
        name=name,
        source=drawn.pipeline.source,
        pixels=pixels,
        encoding=reference.encoding,
        metrics=found,
        times=times,
        memory=drawn.plan.memory.as_json(),
        pass_count=len(passes(drawn.plan)),
        radiance_rmse=light_error(drawn.frame.get("radiance"), light),
        flip_map=map_,
        graph=graph,
        plan=drawn.plan,
        difference=diff(base.pipeline.graph, graph),
        first=first,
    )


@contextmanager
def opened(session: Session | None, device: int | None) -> Iterator[Session]:
    """The session that is given, or one of our own that ends with the block."""
    from rendergraph.session import Session

    if session is not None:
        yield session
        return
    with Session(device=device) as own:
        yield own


def light_error(light: Pixels | None, reference: Pixels | None) -> float | None:
    """RMSE of scene-linear light, None where either picture has none."""
    if light is None or reference is None:
        return None
    return metrics.rmse(metrics.colors(light), metrics.colors(reference))


def _times(session: Session, pipelines: Sequence[Pipeline], frames: int, step: Callable[[], None]) -> list[Times]:
    """Times of pipelines that take turns; each turn another one begins."""
    taken: list[list[FrameTimes]] = [[] for _ in pipelines]
    left = frames
    turn = 0
    while left:
        count = min(FRAMES_A_TURN, left)
        for place in range(len(pipelines)):
            number = (place + turn) % len(pipelines)
            taken[number] += session.render(pipelines[number], frames=range(1, count + 1)).times
        left -= count
        turn += 1
        for _ in range(count):
            step()
    return [
        times_of(times, {node.id: node.type.name for node in pipeline.graph.nodes})
        for times, pipeline in zip(taken, pipelines, strict=True)
    ]


class _Steps:
    """Counts the parts of the work for whoever watches."""

    def __init__(self, total: int, progress: Progress | None) -> None:
        self._done, self._total, self._progress = 0, total, progress

    def __call__(self) -> None:
        self._done += 1
        if self._progress is not None:
            self._progress(self._done, self._total)
