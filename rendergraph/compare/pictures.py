"""Pipelines against each other: pictures, times in turn, memory, and the first pass that differs."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from rendergraph import metrics
from rendergraph.compare.divergence import every_output, first_difference, passes
from rendergraph.compare.elsewhere import compared
from rendergraph.compare.reference import (
    compared_output,
    measured_at,
    named_reference,
    on_one_stage,
    read_picture,
    scene_name,
    unique_names,
)
from rendergraph.compare.timing import Times, times_of
from rendergraph.compare.values import Comparison, Difference, Reference, Result, light_error, not_finite_pixels
from rendergraph.diff import diff
from rendergraph.errors import Problem, UsageError
from rendergraph.farm.bundle import make_bundle
from rendergraph.farm.executors import ExecutorChoice, make_executor
from rendergraph.link import Graph
from rendergraph.session import stages
from rendergraph.session.pipeline import Pipeline, loaded
from rendergraph.session.progress import Progress, shown
from rendergraph.stamps import track_reads

if TYPE_CHECKING:
    from rendergraph.execute import FrameTimes
    from rendergraph.session import Frame
    from rendergraph.session.gpu import Gpu
    from rendergraph.session.values import Planned

FRAMES_A_TURN = 2
"""Few, so that whatever else the machine does falls on all variants alike."""


@dataclass(frozen=True, eq=False)
class _Drawn:
    """A pipeline's plan and its picture."""

    planned: Planned
    frame: Frame

    @property
    def graph(self) -> Graph:
        """What was drawn."""
        return self.planned.linked.graph


def compare(
    pipelines: Sequence[Pipeline | str | Path] | Pipeline | str | Path,
    reference: Path | Pipeline | str | None = None,
    *,
    metric: str | None = None,
    names: Sequence[str] = (),
    frames: int = 10,
    frame: int = 1,
    session: Gpu | None = None,
    device: int | None = None,
    progress: Progress | bool | None = None,
    executor: ExecutorChoice = "serial",
    devices: Sequence[int] = (),
    timeout: float | None = None,
) -> Comparison:
    """Draw pipelines on one scene, with one camera and at one size, and compare what comes out.

    Args:
        pipelines: what is compared, shipped names and files too; all are drawn with the first one's scene and size.
        reference: a picture file or another pipeline, also by its name; the first of `pipelines` by default.
        metric: the port whose texture is measured in place of the picture: `ao.occlusion`.
        names: what the pipelines are called; as their files by default.
        frames: how many frames of each are measured; the pipelines take turns.
        frame: number of the frame whose pictures are compared.
        session: where to draw; a private one by default.
        device: GL device number where no session is given.
        progress: told how many parts of the work are done, and of how many; True shows a bar on stderr.
        executor: who draws, as for `sweep`; in this process the pipelines take turns, elsewhere each is measured alone.
        devices, timeout: as for `sweep`.

    Raises:
        UsageError: there is nothing to compare.
        InputError: a mistake in a file, or the pictures cannot be compared.
        RenderError: it failed while drawing.
        DeviceError: there is no usable GL device.
    """
    from rendergraph.session.gpu import opened  # a sweep is checked without GL

    if isinstance(pipelines, (Pipeline, str, Path)):
        pipelines = [pipelines]
    if not pipelines:
        raise UsageError(Problem("RG500", "there is no pipeline to compare"))
    loaded_ones, reference = [loaded(each) for each in pipelines], named_reference(reference)
    own = [] if reference is None or isinstance(reference, Path) else [reference]
    with track_reads() as files:
        staged, notes = on_one_stage([measured_at(pipeline, metric) for pipeline in [*loaded_ones, *own]])
        planned = [stages.plan(pipeline.expand()) for pipeline in staged]
    first_one = planned[0].linked
    names = unique_names(names or [each.linked.graph.name for each in planned[: len(pipelines)]])
    picture = read_picture(reference, first_one.graph.size, names[0]) if isinstance(reference, Path) else None
    output, encoding = compared_output(staged, picture[1] if picture else None, measured=metric is not None)
    if executor not in (None, "serial"):
        measured = Reference(str(reference), "file", picture[0], encoding, output) if picture else None
        travels, modules = all(each.catalog is None for each in [*loaded_ones, *own]), _modules(planned)
        who = make_executor(
            executor, None, device, tasks=len(pipelines), devices=devices, timeout=timeout, travels=travels
        )
        with who as farm, shown(progress, "pipelines") as tell:
            farm.upload_inputs(lambda: make_bundle(files, loaded_ones[0].selection.plugins, modules))
            step = _Steps(len(pipelines), tell)
            against, results, noticed, drew = compared(
                farm, planned, names, bool(own), measured, output, encoding, frame, frames, step
            )
        base_name, base_graph = against.name if own else names[0], planned[-1 if own else 0].linked.graph
    else:
        with opened(session, device) as gpu, shown(progress, "steps") as tell:
            step = _Steps(len(staged) + frames + 2 * len(pipelines), tell)
            drawn = []
            for each in planned:
                drawn.append(_Drawn(each, stages.draw_last(each.for_frames(range(1, frame + 1)), gpu)))
                step()
            variants = drawn[: len(pipelines)]
            base = drawn[-1] if own else drawn[0]
            base_name = base.graph.name if own else names[0]
            if picture:
                against = Reference(str(reference), "file", picture[0], encoding, output)
            else:
                against = Reference(base_name, "pipeline" if own else "variant", base.frame[output], encoding, output)
            times = _times(gpu, [variant.planned for variant in variants], frames, step)
            tapped = every_output(gpu, base.planned, frame)
            results = []
            for name, variant, taken in zip(names, variants, times, strict=True):
                first = None
                if variant is not base:
                    seen = every_output(gpu, variant.planned, frame)
                    difference = diff(base.graph, variant.graph)
                    first = first_difference(tapped, seen, variant.planned.plan, variant.graph, difference)
                step()
                results.append(_result(name, variant, base, against, taken, first))
                step()
        noticed, drew, base_graph = (
            [one for each in drawn for one in each.frame.warnings],
            drawn[0].frame.device,
            base.graph,
        )
    return Comparison(
        results=tuple(results),
        reference=against,
        base=(base_name, base_graph),
        scene=scene_name(first_one),
        camera=first_one.selection.camera,
        size=first_one.graph.size,
        frame=frame,
        metric=metric,
        device=drew,
        notes=tuple(notes),
        warnings=tuple(
            dict.fromkeys(
                noticed
                + [problem for each in planned for problem in each.linked.catalog.extensions.warnings]
                + [problem for result in results for problem in result.warnings]
            )
        ),
    )


def _result(
    name: str, drawn: _Drawn, base: _Drawn, reference: Reference, times: Times, first: Difference | None
) -> Result:
    linked, plan, pixels = drawn.planned.linked, drawn.planned.plan, drawn.frame[reference.output]
    plugins = linked.catalog.extensions.metrics()
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
        source=linked.selection.source,
        pixels=pixels,
        encoding=reference.encoding,
        metrics=found,
        times=times,
        memory=plan.memory.as_json(),
        pass_count=len(passes(plan)),
        radiance_rmse=light_error(drawn.frame.get("radiance"), light),
        flip_map=map_,
        graph=linked.graph,
        plan=plan,
        difference=diff(base.graph, linked.graph),
        first=first,
        not_finite=not_finite_pixels(linked.graph, drawn.frame),
        figures=drawn.frame.figures,
    )


def _modules(planned: Sequence[Planned]) -> set[str]:
    """The modules of the node classes in use."""
    return {type(node.node).__module__ for each in planned for node in each.linked.graph.nodes}


def _times(gpu: Gpu, variants: Sequence[Planned], frames: int, step: Callable[[], None]) -> list[Times]:
    """Times of pipelines that take turns; each turn another one begins."""
    taken: list[list[FrameTimes]] = [[] for _ in variants]
    left = frames
    turn = 0
    while left:
        count = min(FRAMES_A_TURN, left)
        for place in range(len(variants)):
            number = (place + turn) % len(variants)
            taken[number] += stages.draw_last(variants[number].for_frames(range(1, count + 1), timed=True), gpu).times
        left -= count
        turn += 1
        for _ in range(count):
            step()
    return [
        times_of(times, {node.id: node.type.name for node in variant.linked.graph.nodes})
        for times, variant in zip(taken, variants, strict=True)
    ]


class _Steps:
    """Counts the parts of the work for whoever watches."""

    def __init__(self, total: int, progress: Progress) -> None:
        self._done, self._total, self._progress = 0, total, progress

    def __call__(self) -> None:
        self._done += 1
        self._progress(self._done, self._total)
