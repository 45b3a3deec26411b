"""The preparation of a comparison, without GL: it plans the runs and their reference."""

from __future__ import annotations

import contextlib
import json
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, Self, TypeAlias, TypedDict

import numpy as np
from msgspec import Struct, structs

from rendergraph.compare.batches import MOST_BYTES
from rendergraph.compare.fingerprint import file_digest, run_key, worker_digest
from rendergraph.compare.light import light_of
from rendergraph.compare.results import Reference, TwinError
from rendergraph.compare.space import Axes, Space, pipelines, run_name, unique_names
from rendergraph.errors import InputError, Option, Place, Problem, UsageError
from rendergraph.farm.bundle import relocate_selection
from rendergraph.metrics import Encoding, Pixels, check_sizes
from rendergraph.pipelines.references import reference_selection
from rendergraph.session import stages
from rendergraph.session.picture_metadata import frame_metadata, is_picture, pipeline_metadata
from rendergraph.session.pipeline import Pipeline
from rendergraph.session.selection import VIEW, Selection
from rendergraph.textures import FORMATS

if TYPE_CHECKING:
    from rendergraph.catalog import Catalog, NodeType
    from rendergraph.farm import Executor, Worker
    from rendergraph.farm.executors import ExecutorChoice
    from rendergraph.link import Endpoint, Graph
    from rendergraph.resolve import PipelineSpec
    from rendergraph.session.gpu import Gpu
    from rendergraph.session.progress import Progress
    from rendergraph.session.values import Planned

REFERENCE_NOISE, REFERENCE_SECONDS = 0.1, 120.0
METRIC = "metric"
"""Name of the output that is added for a measured port."""
_INTEGER_FORMATS = frozenset(name for name, format in FORMATS.items() if format.family in ("int", "uint"))

Pictures: TypeAlias = Literal["all", "best"]
Events: TypeAlias = Callable[[Mapping[str, Any]], None]
View: TypeAlias = "tuple[Space, Path | Pipeline | None, SweepOptions]"
"""The runs of one scene, camera and environment, their reference, and which of them to render."""


class SweepKeywords(TypedDict, total=False):
    """The attributes of `SweepOptions` as keywords."""

    metric: str | None
    frame: int
    frames: int
    repeats: int
    kept: Pictures
    best: Sequence[str]
    only: Sequence[int] | None
    resume: bool
    most_bytes: int
    minimise: Sequence[str]
    budget: int
    seed: int
    session: Gpu | None
    device: int | None
    executor: ExecutorChoice
    devices: Sequence[int]
    timeout: float | None
    progress: Progress | bool | None
    events: Events | None
    reference_noise: float
    reference_samples: int | None
    reference_seconds: float


class TruthLimits(Struct, frozen=True):
    """When ground truth is accurate enough: its noise is this part of the smallest error, or a limit is reached."""

    noise: float
    samples: int | None
    seconds: float

    @property
    def most_samples(self) -> float:
        return self.samples or math.inf


class SweepOptions(Struct, frozen=True, kw_only=True, eq=False):
    """How a sweep renders and measures; `compare` uses what applies to it.

    Attributes:
        metric: the port whose texture is measured instead of the picture: `ao.occlusion`.
        frame: number of the frame whose pictures are compared.
        frames: minimum number of measured frames; resumed runs with fewer are measured again.
        repeats: number of measurements, each from the start; the spread of their medians shows how reliable times are.
        kept: which pictures are kept: `all`, or `best`, those on the Pareto front so far and the reference's.
        best: objectives of that front, as for `minimise`.
        only: numbers of the runs to render, from 0; names and errors are those of the whole sweep.
        resume: keep the runs that the folder already has.
        most_bytes: memory limit for textures of variants that are rendered together.
        minimise: objectives of a search: `flip`, `rmse`, `radiance_rmse`, `ms` (time of a frame), `bytes` (of
            textures), a plugin's metric, or a figure of the pipeline; several give a Pareto front.
        budget: maximum number of runs of a search.
        seed: random seed of a search.
        session: where to render; a private session by default.
        device: GL device number where no session is given.
        executor: `serial`, `processes`, `processes:4`, `dask`, `dask://host:8786`, a Dask `Client`, or an `Executor`;
            by default chosen for the machine. It affects times, but neither pictures nor metrics.
        devices: GL device numbers to distribute over worker processes.
        timeout: seconds without progress before a worker process is replaced.
        progress: a function that receives the number of completed runs and of all runs; True shows a bar on stderr.
        events: a function that receives an event for each step of each worker, as a mapping of plain values.
        reference_noise: render ground truth until its own noise is this part of the smallest error.
        reference_samples, reference_seconds: limits for that, in samples per pixel and in seconds.
    """

    metric: str | None = None
    frame: int = 1
    frames: int = 5
    repeats: int = 1
    kept: Pictures = "all"
    best: Sequence[str] = ("flip", "ms")
    only: Sequence[int] | None = None
    resume: bool = False
    most_bytes: int = MOST_BYTES
    minimise: Sequence[str] = ()
    budget: int = 50
    seed: int = 0
    session: Gpu | None = None
    device: int | None = None
    executor: ExecutorChoice = None
    devices: Sequence[int] = ()
    timeout: float | None = None
    progress: Progress | bool | None = None
    events: Events | None = None
    reference_noise: float = REFERENCE_NOISE
    reference_samples: int | None = None
    reference_seconds: float = REFERENCE_SECONDS

    @property
    def limits(self) -> TruthLimits:
        return TruthLimits(self.reference_noise, self.reference_samples, self.reference_seconds)

    def replace(self, **settings: Any) -> Self:
        return structs.replace(self, **settings)

    def open_executor(self, tasks: int, *, travels: bool) -> AbstractContextManager[Executor]:
        """Open the executor for a number of tasks; `travels` tells whether other processes can do them."""
        from rendergraph.farm.executors import make_executor  # a sweep is checked without it

        return make_executor(
            self.executor,
            self.session,
            self.device,
            tasks=tasks,
            devices=self.devices,
            timeout=self.timeout,
            travels=travels,
        )


@dataclass(frozen=True, eq=False)
class Run:
    """One variant of a comparison, or one combination of a sweep, which has settings and a folder.

    It travels to other processes without its plan; they plan it again.

    Attributes:
        number: from 0; -1 for a pipeline that is only the reference.
        reference_key: identifies the picture that it is measured against.
        selection, digest: the pipeline, and what its picture depends on, as they were when the run's task was created.
        is_rendered: its picture exists already; only times are needed.
        light: the port whose light is measured against a truth.
    """

    number: int
    name: str
    planned: Planned
    output: str
    frame: int
    settings: Mapping[str, str] = field(default_factory=dict)
    folder: Path = Path()
    reference_key: str = ""
    selection: Selection | None = None
    digest: str = ""
    metadata: Mapping[str, str] = field(default_factory=dict)
    is_rendered: bool = False
    light: Endpoint | None = None

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "planned": None}

    @cached_property
    def key(self) -> str:
        """Identifies its picture and figures when a sweep is resumed."""
        return run_key(self.planned, self.frame, self.reference_key)

    @property
    def picture(self) -> Path:
        return self.folder / (f"{self.output}.png" if self.output == "image" else f"{self.output}.exr")

    def for_task(self, *, is_rendered: bool = False) -> Run:
        """Return the run with everything that other processes need to plan it again and to write its picture."""
        linked, digest = self.planned.linked, worker_digest(self.planned)
        metadata = {**pipeline_metadata(linked), **frame_metadata(self.frame, 30.0)}
        return replace(self, selection=linked.selection, digest=digest, metadata=metadata, is_rendered=is_rendered)

    def plan(self, worker: Worker, catalog: Catalog | None = None) -> Planned:
        """Return the planned pipeline; the catalog of another run saves the time to create one.

        Raises:
            InputError: it is not what it was when its task was created.
        """
        if self.planned is not None or self.selection is None:
            return self.planned
        planned = stages.plan(stages.expand(Pipeline(relocate_selection(self.selection, worker.root), catalog).link()))
        if worker_digest(planned) != self.digest:
            text = f"input files of '{self.name}' differ on worker '{worker.name}' from those when the work began"
            raise InputError(Problem("RG642", f"{text}: a file has changed, or another version is installed there"))
        return planned


@dataclass(frozen=True, eq=False)
class Twin:
    """A run with the twin of one of its nodes in that node's place, and the error of its light once it is known."""

    number: int
    run: Run
    error: TwinError


@dataclass(frozen=True, eq=False)
class Prepared:
    """A comparison before rendering; everything that can be checked without GL has been checked.

    Attributes:
        output, encoding: what is compared.
        reference: a picture file or a pipeline of its own; None if it is the first run.
        is_truth: the reference is a pipeline that converges to ground truth.
        twins: runs that show how much of an error comes from which technique.
        notes: changes that made the pipelines comparable.
        space, study: the axes of a sweep, and what identifies its folder.
    """

    runs: tuple[Run, ...]
    output: str
    encoding: Encoding
    reference: Reference | Run | None
    is_truth: bool
    notes: tuple[str, ...]
    twins: tuple[Twin, ...] = ()
    space: Space = field(default_factory=lambda: Space(()))
    study: Mapping[str, Any] = field(default_factory=dict)

    @property
    def base(self) -> Run:
        """What the runs are compared with in structure: the reference pipeline, or the first run."""
        return self.runs[0] if self.is_truth else next(iter(self.references), self.runs[0])

    @property
    def references(self) -> list[Run]:
        """The reference, if it is a pipeline of its own."""
        return [self.reference] if isinstance(self.reference, Run) else []

    @property
    def modules(self) -> set[str]:
        runs = [*self.runs, *self.references, *(twin.run for twin in self.twins)]
        return {type(node.node).__module__ for run in runs for node in run.planned.linked.graph.nodes}


def prepare(
    base: Pipeline,
    axes: Axes,
    out: Path,
    reference: Path | Pipeline | None = None,
    options: SweepOptions = SweepOptions(),
) -> Prepared:
    """Plan the runs of a sweep, with the arguments of `sweep`."""
    space = Space.of(axes)
    space.check()
    if views := by_view(space, reference, options):
        parts = [prepare(base, part, out, own_reference, own) for part, own_reference, own in views]
        by_name = {run.name: run for part in parts for run in part.runs}
        ordered = [by_name[name] for name in space.run_names() if name in by_name]
        runs = tuple(replace(run, number=number) for number, run in enumerate(ordered))
        return replace(parts[0], runs=runs, space=space)
    combinations, names = space.runs(), space.run_names()
    base = measured_at(base, options.metric)
    reference_name = run_name({path: value for path, value in combinations[0].items() if path not in VIEW})
    if isinstance(reference, Pipeline):
        reference, reference_name = measured_at(reference, options.metric), reference.resolve().spec.name
    elif reference is not None:
        reference_name = str(reference)
    if options.only is not None:
        if reference is None and 0 not in options.only:
            (reference,) = pipelines(base, combinations[:1])
        combinations = [combinations[number] for number in options.only]
        names = [names[number] for number in options.only]
    prepared = prepare_variants(pipelines(base, combinations), reference, options, names)
    if isinstance(prepared.reference, Reference):
        key = file_digest(Path(prepared.reference.name))
    else:
        key = run_key((prepared.reference or prepared.runs[0]).planned, options.frame, "")
    key += f" {options.limits}" if prepared.is_truth else ""
    runs = tuple(
        replace(run, settings=setting, folder=out / run.name, reference_key=key)
        for run, setting in zip(prepared.runs, combinations, strict=True)
    )
    return replace(prepared, runs=runs, space=space, study=_study(base, options.frame, reference_name))


def by_view(space: Space, reference: Path | Pipeline | None, options: SweepOptions) -> list[View]:
    """Return the runs of each scene, camera and environment that axes choose, which are compared with each other alone.

    Against a pipeline, so are those of each value in a scene: the reference is rendered with it, too. The list is empty
    if all runs are compared with each other.
    """
    scene_too = isinstance(reference, Pipeline)
    paths = [a.path for a in space.axes if a.path in VIEW or (scene_too and a.path.startswith("scene."))]
    groups: dict[tuple[tuple[str, str], ...], list[int]] = {}
    runs, names = space.runs(), space.run_names()
    for number, run in enumerate(runs):
        groups.setdefault(tuple((path, run[path]) for path in paths), []).append(number)
    if len(groups) < 2:
        return []
    if options.only is not None:
        groups = {view: numbers for view, numbers in groups.items() if not set(options.only).isdisjoint(numbers)}
    if isinstance(reference, Path):
        text = f"a picture cannot be the reference of several scenes; name a pipeline instead of '{reference}'"
        raise UsageError(Problem("RG500", text))
    views: list[View] = []
    for view, numbers in groups.items():
        own, only = None if reference is None else reference.set(dict(view)), options.only
        places = None if only is None else [place for place, number in enumerate(numbers) if number in only]
        part = replace(space, chosen=tuple(runs[n] for n in numbers), names=tuple(names[n] for n in numbers))
        views.append((part, own, options.replace(only=places)))
    return views


def prepare_variants(
    variants: Sequence[Pipeline],
    reference: Path | Pipeline | None,
    options: SweepOptions,
    names: Sequence[str] = (),
    *,
    twins: bool = False,
) -> Prepared:
    """Plan pipelines, which already have the measured port, with the scene and size of the first one.

    With `twins`, and against a truth, their techniques' twins are planned, too.
    """
    others = [reference] if isinstance(reference, Pipeline) else []
    accumulates = any({"radiance", "variance"} <= other.resolve().spec.outputs.keys() for other in others)
    is_truth, count = accumulates and options.metric is None, len(variants)
    matched, notes = match_scene_and_size([*variants, *others])
    names = unique_names(names or [pipeline.link().graph.name for pipeline in matched[:count]])
    if is_truth:
        matched[-1] = _seen_as(matched[:-1], names, matched[-1], notes)
    planned = [pipeline.check() for pipeline in matched]
    if not is_truth and options.limits != SweepOptions().limits:
        text = "--reference-noise, --reference-samples and --reference-seconds belong to a reference that accumulates"
        raise UsageError(Problem("RG500", f"{text}: a pipeline with the outputs `radiance` and `variance`"))
    graphs = [each.linked.graph for each in planned]
    picture = read_picture(reference, graphs[0].size, names[0]) if isinstance(reference, Path) else None
    compared = graphs[:count] if is_truth else graphs
    output, encoding = compared_output(compared, picture[1] if picture else None, measured=options.metric is not None)
    runs = [
        Run(number, name, each, output, options.frame, light=light_of(each.linked.graph) if is_truth else None)
        for number, (name, each) in enumerate(zip(names, planned[:count], strict=True))
    ]
    against: Reference | Run | None = None
    if picture is not None:
        against = Reference(str(reference), "file", picture[0], encoding, output)
    elif others:
        against = Run(-1, graphs[-1].name, planned[-1], output, options.frame)
    pairs = zip(runs, matched[:count], strict=True) if is_truth and twins else ()
    found = [twin for run, pipeline in pairs for twin in _twins(run, pipeline, notes)]
    return Prepared(
        runs=tuple(runs),
        output=output,
        encoding=encoding,
        reference=against,
        is_truth=is_truth,
        twins=tuple(found),
        notes=tuple(notes),
    )


def _seen_as(variants: Sequence[Pipeline], names: Sequence[str], truth: Pipeline, notes: list[str]) -> Pipeline:
    """Return ground truth with the camera, the environment and the materials of the compared pipelines.

    Its own camera and environment take precedence. Where one of its nodes replaces a node of another type, it takes
    over that node's parameters, such as `shading`.
    """
    own, other = truth.selection, variants[0].selection
    truth = truth.select(camera=own.camera or other.camera, environment=own.environment or other.environment)
    first, *others = (_told(variant, truth) for variant in variants)
    if first:
        settings = ", ".join(f"{path}={value}" for path, value in first.items())
        notes.append(f"'{truth.link().graph.name}' is drawn with {settings}, as '{names[0]}' has it")
    if differing := [name for name, told in zip(names[1:], others, strict=True) if told != first]:
        paths = ", ".join(dict.fromkeys(path for told in (first, *others) for path in told))
        notes.append(f"measured against the truth of '{names[0]}', with another {paths}: {', '.join(differing)}")
    for path, value in first.items():
        truth = truth.set(path, value)
    return truth


def _told(variant: Pipeline, truth: Pipeline) -> dict[str, Any]:
    """Return the parameters that nodes of the truth take over from the nodes of other types that they replace.

    They have the same name, unit and default in both, another value, and are not set by the truth itself.
    """
    graph, written, found = truth.link().graph, truth.resolve().spec.nodes, {}
    for node in variant.link().graph.nodes:
        twin = graph.members.get(node.id)
        if twin is None or twin.type.name == node.type.name:
            continue
        taken = twin.type.cls.parameters()
        for name, parameter in node.type.cls.parameters().items():
            value = getattr(node.node, name)
            if name not in taken or name in written[node.id].params or value == getattr(twin.node, name):
                continue
            if (taken[name].unit, taken[name].default) == (parameter.unit, parameter.default):
                with contextlib.suppress(TypeError, ValueError):  # a value that the truth does not know
                    found[f"{node.id}.{name}"] = taken[name].convert(value)
    return found


def _twins(run: Run, pipeline: Pipeline, notes: list[str]) -> Iterator[Twin]:
    """Yield a run for each technique that has a twin, with the twin in its place; add a note where it does not fit."""
    linked = run.planned.linked
    catalog, needed = linked.catalog, run.planned.plan.schedule.steps
    used = {step.node for step in needed} | {function.node for step in needed for function in step.functions}
    for node in linked.graph.nodes:
        twin = node.type.cls.twin
        if twin is None or twin == node.type.name or node.id not in used:
            continue
        try:
            changed = replace(_with_twin(pipeline, node.id, catalog.get(twin)), catalog=catalog).check()
            light = run.light if run.light in changed.linked.graph.textures else light_of(changed.linked.graph)
        except InputError as error:
            reason = error.problems[0].message
            notes.append(f"'{node.id}' of '{run.name}' cannot be replaced by its twin '{twin}': {reason}")
            continue
        own = Run(-1, f"{run.name} with {twin}", changed, run.output, run.frame, light=light)
        yield Twin(run.number, own, TwinError(node.id, node.type.name, twin))


def _with_twin(pipeline: Pipeline, node: str, twin: NodeType) -> Pipeline:
    """Return the pipeline with another type for a node; parameters set by `-s` that the type lacks are removed."""
    known = {*twin.cls.parameters(), *twin.cls.inputs(), *twin.cls.groups(), "enabled"}

    def fits(setting: str) -> bool:
        owner, _, name = setting.partition("=")[0].strip().rpartition(".")
        return owner != node or name in known

    return pipeline.select(sets=(*filter(fits, pipeline.selection.sets), f"{node}.type={twin.name}"))


def _study(base: Pipeline, frame: int, reference: str) -> dict[str, Any]:
    """Return what all runs of a sweep have in common.

    Adding values to an axis does not change the study. Nor do edited shaders: their runs are rendered again.
    """
    view, spec = base.selection.view_fields, base.resolve().spec
    width, height = spec.size
    return {
        "pipeline": spec.name,
        "scene": spec.scene_name or None,
        **{name: view.get(name) for name in ("environment", "camera", "variant", "ground", "shutter")},
        "size": f"{width}x{height}",
        "frame": frame,
        "reference": reference,
        "resolved": json.loads(json.dumps(spec.tree.plain(), default=str)),
    }


# --- what is compared ------------------------------------------------------------------------------------------------


def named_reference(reference: Path | Pipeline | str | None) -> Path | Pipeline | None:
    """Return a reference; a name becomes a picture's path or a pipeline."""
    if not isinstance(reference, str):
        return reference
    return Path(reference) if is_picture(reference) else Pipeline(reference_selection(Selection(reference)))


def read_picture(path: Path, size: tuple[int, int] | None = None, name: str = "") -> tuple[Pixels, Encoding]:
    """Read a reference picture; floats are linear light, integers are display-referred.

    If a size is given, the picture must have it; `name` is the variant of this size, for the message.
    """
    from rendergraph.images import read  # a sweep is checked without OpenImageIO

    pixels = read(path)
    if pixels.ndim != 3:
        text = "the image has layers; expected a single picture with channels R, G, B or Y"
        raise InputError(Problem("RG354", text, Place(str(path))))
    if size is not None:
        check_sizes(np.empty((size[1], size[0])), pixels, (name, str(path)))
    return pixels, "linear" if np.issubdtype(pixels.dtype, np.floating) else "display"


def measured_at(pipeline: Pipeline, metric: str | None) -> Pipeline:
    """Return the pipeline with an additional output: the port that is measured instead of its picture."""
    if metric is None:
        return pipeline
    measured, place = pipeline.patch({"outputs": {METRIC: metric}}), Place(Option("--metric", metric))
    try:
        graph = measured.link().graph
    except InputError as error:
        context = f"in {measured.selection.label}"
        raise error.relocated(
            lambda problem: (
                problem.relocate(place, context=context) if problem.place and problem.place.option("patch") else problem
            )
        ) from None
    desc = graph.textures[graph.outputs[METRIC]].desc
    kinds = ("texture2d", "texture2d_array")
    if desc is None or desc.kind not in kinds or desc.samples > 1 or desc.format in _INTEGER_FORMATS:
        what = "a buffer" if desc is None else f"{desc.kind} {desc.format}, samples: {desc.samples}"
        needed = "expected a 2D texture or array of them, with one sample, not of an integer format"
        text = f"'{metric}' of pipeline '{graph.name}' is {what}; {needed}"
        raise InputError(Problem("RG523", text, place))
    return measured


def match_scene_and_size(pipelines: Sequence[Pipeline]) -> tuple[list[Pipeline], list[str]]:
    """Return the pipelines with the first one's scene and size, and the changes in words."""
    specs = [pipeline.resolve().spec for pipeline in pipelines]
    first, notes = specs[0], []
    if (first.scene or first.scene_changes) and (strange := [spec for spec in specs if not _has_scene_of(spec, first)]):
        notes += [f"'{spec.name}' is rendered with the scene of '{first.name}': {first.scene_name}" for spec in strange]
        base = {"extends": str(first.scene)} if first.scene else {"scene": 1}
        changed = {**base, **first.scene_changes.plain()} if first.scene_changes is not None else None
        # The first one too, so that all name the scene alike: it is then read once and stays on the GPU.
        pipelines = [
            pipeline.with_scene(changed or first.scene or "") if spec in strange or changed is None else pipeline
            for pipeline, spec in zip(pipelines, specs, strict=True)
        ]
    sizes = [pipeline.link().spec.size for pipeline in pipelines]
    width, height = sizes[0]
    others = [spec.name for spec, size in zip(specs, sizes, strict=True) if size != sizes[0]]
    notes += [f"'{name}' is rendered at the size of '{first.name}': {width}×{height}" for name in others]
    return [
        pipeline.with_size(sizes[0]) if size != sizes[0] else pipeline
        for pipeline, size in zip(pipelines, sizes, strict=True)
    ], notes


def _has_scene_of(spec: PipelineSpec, first: PipelineSpec) -> bool:
    """Whether two pipelines have the same scene file, whatever each changes in it."""
    if spec.scene is not None or first.scene is not None:
        return spec.scene == first.scene
    return bool(spec.scene_changes and first.scene_changes) and spec.scene_name == first.scene_name


def compared_output(graphs: Sequence[Graph], encoding: Encoding | None, *, measured: bool) -> tuple[str, Encoding]:
    """Return the output that all pipelines have and that fits the reference picture, and its own encoding."""
    if measured:
        return METRIC, graphs[0].textures[graphs[0].outputs[METRIC]].semantic.encoding or "values"
    names = {"display": ["image"], "linear": ["radiance"]}.get(encoding or "", ["image", "radiance"])
    for name in names:
        if all(name in graph.outputs for graph in graphs):
            return name, "display" if name == "image" else "linear"
    lacking = next(graph for graph in graphs if names[0] not in graph.outputs)
    text = f"pipeline '{lacking.name}' has no output '{names[0]}' to compare; available: {', '.join(lacking.outputs)}"
    raise InputError(Problem("RG522", text))
