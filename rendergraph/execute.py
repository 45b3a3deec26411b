"""Execute the steps of a frame, time them, and read results back."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from itertools import chain
from time import perf_counter
from typing import Annotated, Any, Optional, TypeAlias

import numpy as np
import numpy.typing as npt
from msgspec import Struct, field

from rendergraph.compile import SCENE_CHANGES, Executable
from rendergraph.compile.executable import FrameStep
from rendergraph.compile.light_means import LightMeans, averaged_textures
from rendergraph.declare import Node, Port, Views
from rendergraph.declare.blame import author_problem
from rendergraph.document import shown
from rendergraph.errors import InputError, Misuse, Problem, RenderError, SceneError, is_interruption, suggestion
from rendergraph.expand import CAMERA
from rendergraph.gl import textures
from rendergraph.gl.queries import Timer
from rendergraph.gl.state import settle
from rendergraph.link import Graph, GraphNode
from rendergraph.ports import Count
from rendergraph.projection import shifted
from rendergraph.scene.facts import FrameScene
from rendergraph.scene.model import Scene
from rendergraph.steps import Change, Step, UniformValue, ViewMatrices, checks
from rendergraph.steps.checks import check_argument, declared_port
from rendergraph.steps.model import DepthBounds
from rendergraph.textures import BufferDesc
from rendergraph.typecheck import Range, quoted

_Scissor: TypeAlias = Annotated[tuple[int, int, Count, Count], "x, y, width and height in texels"]
_Part: TypeAlias = Annotated[float, Range(-1, 1)]
_Offset: TypeAlias = Annotated[tuple[_Part, _Part], "x and y in texels, from -1 to 1"]
_MOMENT_STRIDE = 100_003
_CHANGES = {"camera": "", "parameters": "", "size": "", **SCENE_CHANGES}


class StepTime(Struct, frozen=True):
    """Milliseconds of one step in one frame; `gpu_ms` is None if the driver has no timer.

    A node's `update` counts as part of its first step. `index` is the step's number in its node, -1 if there is only an
    `update`; `label` is the author's name for it.
    """

    node: str
    cpu_ms: float
    gpu_ms: float | None
    index: int = 0
    label: str = ""


class FrameTimes(Struct, frozen=True):
    """Times of one frame: wall time until the device was done, the steps in order if they were measured, and the number
    of steps that ran."""

    frame_ms: float
    steps: tuple[StepTime, ...]
    ran: int = 0


class FrameContext(Struct, eq=False):
    """The frame that a node's `update` receives (`steps.Frame`)."""

    executable: Executable
    graph: Graph
    node: GraphNode
    index: int
    time: float
    camera: ViewMatrices
    scene: FrameScene
    moved: Callable[[], bool]
    is_first: bool

    def connected(self, port: Port) -> bool:
        return bool(self.node.inputs.get(declared_port(self.node.node.ports(), port, "connected's argument").name))

    def views(self, port: Port) -> Sequence[ViewMatrices]:
        """Return the views with which the texture at an input was drawn."""
        links = self.node.inputs.get(declared_port(self.node.node.ports(), port, "views' argument").name, ())
        tables = [self.graph.textures[end.now].view or CAMERA for end in links]
        return [view for table in tables for view in self.executable.views.current[table]]

    def set_views(self, port: Views, views: Sequence[ViewMatrices]) -> None:
        if not isinstance(declared_port(self.node.node.ports(), port, "set_views"), Views):
            raise Misuse(f"set_views is given '{port.name}', which is not a Views port", "RG433")
        for view in views:
            if not isinstance(view, ViewMatrices):
                raise Misuse(f"set_views is given {type(view).__name__}, not ViewMatrices", "RG433")
        self.executable.views.set(f"{self.node.id}.{port.name}", views)

    def set_region(self, number: int, scissor: _Scissor | None = None, depth_bounds: DepthBounds | None = None) -> None:
        """Restrict the steps of a `region` to a part of the picture from now on."""
        check_argument("number", number, Count)
        check_argument("scissor", scissor, Optional[_Scissor])  # noqa: UP045  # pyright knows no `|` of Annotated
        check_argument("depth_bounds", depth_bounds, Optional[DepthBounds])  # noqa: UP045  # nor of this
        region = self.executable.memory.regions.get((self.node.id, number))
        if region is not None:  # otherwise its steps do not run
            region.set(scissor, depth_bounds)

    def set_uniform(self, name: str, value: UniformValue) -> None:
        known = self.executable.uniforms.get(self.node.id, ())
        if name not in known:
            text = f"set_uniform is given {quoted(name)}, which is not a parameter or a keyword of a step"
            raise Misuse(text + (suggestion(name, known) if known else ""), "RG433")
        mismatch = self.executable.set_uniform(self.node.id, name, checks.uniform(name, value))
        if mismatch is not None:
            raise Misuse(f"set_uniform: {mismatch}", "RG433")

    def changed(self, *what: Change) -> bool:
        for word in what:
            if word not in _CHANGES:
                raise Misuse(f"changed is given {quoted(word)}{suggestion(str(word), _CHANGES, most=5)}", "RG433")
        now, before = self.executable.scene.changes, self.executable.changes_seen
        return self.is_first or any(
            self.moved() if word == "camera" else now[_CHANGES[word]] != before.get(_CHANGES[word], 0)  # "" never
            for word in what or _CHANGES
        )

    def write(self, port: Port, values: npt.NDArray[Any]) -> None:
        checks.buffer(self.node.node.ports(), port, "write")
        name = f"{self.node.id}.{port.name}"
        if name not in self.executable.plan.placement:
            return  # the buffer is unused in this pipeline
        resource = self.executable.plan.resources[name]
        if resource.role == "kept":
            raise Misuse(f"it writes '{port.name}', which is kept, in each frame; remove `kept=True`", "RG433")
        if resource.role == "history":
            text = f"it writes '{port.name}', which holds last frame's values; write an Internal and copy it in a step"
            raise Misuse(text, "RG433")
        array = np.ascontiguousarray(values)
        element = resource.desc.element  # type: ignore[union-attr]  # it is a buffer
        if array.dtype.kind not in "biuf" and (element is None or array.dtype != element.dtype):
            raise Misuse(f"write is given {type(values).__name__} of {array.dtype}, not an array of numbers", "RG433")
        data, size = array.tobytes(), self.executable.memory.buffer(name).size
        if len(data) > size:
            raise Misuse(f"it writes {len(data)} bytes into '{port.name}', which holds {size}", "RG432")
        self.executable.write_buffer(name, data)


class Runner(Struct, eq=False):
    """Runs an executable frame by frame.

    Attributes:
        reuse: skip steps whose values exist and would not change.
        cull: skip objects outside the views that they would be drawn with.
        ran: the number of steps that the last frame ran.
    """

    executable: Executable
    graph: Graph
    reuse: bool = False
    cull: bool = True
    ran: int = 0
    _updating: list[GraphNode] = field(default_factory=list)
    _computed: dict[str, list[tuple[Views, Callable[[Any], Sequence[ViewMatrices]]]]] = field(default_factory=dict)
    _scene: FrameScene | None = None
    _active: set[str] = field(default_factory=set)
    _complete: bool = False
    _jittering: GraphNode | None = None
    _seen: tuple[Scene, ViewMatrices] | None = None
    _still: int = 0
    _histories: dict[str, int] = field(default_factory=dict)
    _repeats: bool = False
    _time: float = 0.0

    def __post_init__(self) -> None:
        plan, nodes = self.executable.plan, _views_first(self.graph)
        for step in plan.schedule.steps:
            computes_view = str(step.view).rpartition(".")[0]
            self._active |= {step.node, computes_view, *(function.node for function in step.functions)}
        for node in reversed(nodes):
            if node.id in self._active:  # it may request the views of its inputs
                self._active |= set(_view_makers(self.graph, node))
        nodes = [node for node in nodes if node.id in self._active]
        self._computed = {node.id: found for node in nodes if (found := self._computed_views(node))}
        updates = {node.id for node in nodes if type(node.node).update is not Node.update}
        self._updating = [node for node in nodes if node.id in updates or node.id in self._computed]
        jittering = (node for node in nodes if type(node.node).camera_jitter is not Node.camera_jitter)
        self._jittering = next(jittering, None)
        self._histories = {id: len(at) for id, at in plan.placement.items() if plan.resources[id].role == "history"}
        self.reset()

    @property
    def updating(self) -> list[str]:
        return [node.id for node in self._updating if type(node.node).update is not Node.update]

    def _computed_views(self, node: GraphNode) -> list[tuple[Views, Callable[[Any], Sequence[ViewMatrices]]]]:
        """Return the view tables of a node that have a `compute` function, and these functions."""
        tables = self.executable.views.tables
        return [
            (port, port.compute)
            for port in node.node.ports().values()
            if isinstance(port, Views) and port.compute is not None
            if (table := tables.get(f"{node.id}.{port.name}")) is not None and table.count
        ]

    @property
    def jittering(self) -> str | None:
        """The node that jitters the camera, or None."""
        return self._jittering.id if self._jittering is not None else None

    def reset(self) -> None:
        """Reset the history to the ports' first values.

        After a single frame, one of its two textures still has the first value, so the next frame uses the same one. A
        history that is written in place has only one texture.
        """
        drawn, is_double = self.executable.drawn, all(count == 2 for count in self._histories.values())
        self._repeats = is_double and (drawn == 1 or (self._repeats and not drawn))
        self.executable.drawn, self._seen = 0, None
        self.executable.reset_updates()
        if self._repeats:
            return
        memory = self.executable.memory
        for name, parity in ((name, parity) for name, count in self._histories.items() for parity in range(count)):
            resource = self.executable.plan.resources[name]
            if isinstance(resource.desc, BufferDesc):
                memory.buffer(name, parity).clear()
            else:
                textures.Clear(self.executable.device, memory.texture(name, parity), resource.first)()

    def run(
        self,
        index: int,
        time: float,
        delta: float,
        scene: Scene,
        camera: ViewMatrices,
        *,
        timed: bool = False,
        moment: int = 0,
        moments: int = 1,
    ) -> FrameTimes | None:
        """Render one frame, or one moment of it; the last moment writes the mean of the light.

        Args:
            index: frame number, from 1.
            time: seconds since frame 1.
            timed: measure each step; otherwise nothing is measured and None returned.
            moment: number of the moment, from 0, of `moments` that are rendered one after the other.
        """
        executable, views = self.executable, self.executable.views
        start = perf_counter()
        moved_from, self._seen = self._seen, (scene, camera)
        if executable.drawn and not moment:
            views.advance()
        camera = self._jittered(camera)
        views.set(CAMERA, (camera,))
        moved = False
        if self._scene is None or self._scene.placed.objects is not scene.objects:
            self._scene, moved = FrameScene(scene, self._scene, executable.scene.decode), True
        self._scene.show(scene)
        updates: dict[str, float] = {}
        has_moved, first = partial(_has_moved, moved_from, self._seen), executable.drawn == 0
        for node in self._updating:
            before = perf_counter()
            frame = FrameContext(executable, self.graph, node, index, time, camera, self._scene, has_moved, first)
            with _author_errors(node, "update"):
                node.node.update(frame)  # pyright: ignore[reportArgumentType]  # a cached_property is one to mypy
                for port, compute in self._computed.get(node.id, ()):
                    frame.set_views(port, compute(frame))
            updates[node.id] = perf_counter() - before
        if executable.uploads:
            self._compute_uploads()
        executable.end_updates()
        if executable.reads_frame:
            if not moment:
                self._count_still(moved_from, time)
            number = index + _MOMENT_STRIDE * (moments - 1 - moment)  # different noise; the last has the frame's
            if views.set_frame(time, delta, number, self._still):
                executable.touched.add("frame_block")
        if not self._complete:
            self._check_views()
        if not executable.drawn:
            views.advance()  # nothing moves in the first frame
        executable.drawn += moment == moments - 1
        if views.changed or moved:
            executable.cull_and_sort(moved=moved, cull=self.cull)
            executable.touched |= {("view", table) for table in views.changed}
            views.changed.clear()
        if views.moved_before:
            executable.touched |= {("view before", table) for table in views.moved_before}
            views.moved_before.clear()
        fresh = executable.fresh or not executable.device.owned
        if fresh:
            self.activate()
        # Counts rendered frames instead of using frame numbers.
        if not (self._repeats or moment):
            executable.parity = (executable.parity + 1) % len(executable.steps)
        if fresh or len(executable.binds) > 1:  # otherwise everything is still bound from the previous frame
            for call in executable.binds[executable.parity]:
                call()
        listed = executable.steps_for_frame(reuse=self.reuse and moments == 1, repeats=self._repeats)
        self._repeats = self._repeats and moment < moments - 1
        if moments > 1:
            listed = self._with_means(moment, moments)
        self.ran = len(listed)
        taken: list[tuple[Step, float, Timer]] = []
        measured = executable.device.can_time
        try:
            for step in listed if not timed else ():
                for call in step.calls:
                    call()
            for step in listed if timed else ():
                before = perf_counter()
                if measured:
                    step.timer.start()
                for call in step.calls:
                    call()
                if measured:
                    step.timer.stop()
                taken.append((step.step, perf_counter() - before + updates.pop(step.step.node, 0.0), step.timer))
        except BaseException:
            executable.abort()
            raise
        executable.end_frame()
        if not timed:
            return None
        executable.device.ctx.finish()
        frame_ms = (perf_counter() - start) * 1e3
        # The remaining nodes have no steps.
        steps = [StepTime(node_id, cpu * 1e3, None, -1, "update") for node_id, cpu in updates.items()]
        for done, cpu, timer in taken:
            gpu = timer.milliseconds() if measured else None
            steps.append(StepTime(done.node, cpu * 1e3, gpu, done.index, done.label))
        return FrameTimes(frame_ms, tuple(steps), self.ran)

    def _with_means(self, moment: int, moments: int) -> list[FrameStep]:
        """Return the steps of a frame that average the light of its moments."""
        executable = self.executable
        if executable.means is None:
            semantics = {str(end): info.semantic for end, info in self.graph.textures.items()}
            executable.means = LightMeans(executable, averaged_textures(executable.plan, semantics))
        executable.means.moment, executable.means.count = moment, moments
        return executable.steps_with_stops(executable.means.calls(executable.parity))

    def _compute_uploads(self) -> None:
        executable = self.executable
        restored = executable.kept.keys() - executable.due  # kept values that may come from other pipelines
        uploads = executable.uploads.items()
        stale = {key: up for key, up in uploads if up.is_stale and (key not in restored or up.upload.sources)}
        if stale:
            executable.computed(stale)  # recorded first, because one of them may fail
        for key, values in stale.items():
            with _author_errors(self.graph[key[0]], "the function of an upload"):
                values.compute()

    def activate(self) -> None:
        """Write state that is constant over frames; needed once, and again after another pipeline used the programs."""
        settle(self.executable.device.raw)
        for call in self.executable.statics:
            call()
        self.executable.fresh = False

    def _count_still(self, before: tuple[Scene, ViewMatrices] | None, time: float) -> None:
        """Count the frames since scene, camera, parameters, nodes' writes or anything moved by time has changed."""
        executable, time_before, self._time = self.executable, self._time, time
        still = before is not None and self._seen is not None and before[0] is self._seen[0] and not executable.fresh
        still = still and not _has_moved(before, self._seen) and not executable.was_updated
        self._still = self._still + 1 if still and (time == time_before or not executable.moves_with_time) else 0

    def _jittered(self, camera: ViewMatrices) -> ViewMatrices:
        """Return the camera with the jitter that a node requests."""
        node = self._jittering
        if node is None:
            return camera
        with _author_errors(node, "camera_jitter"):
            moved = node.node.camera_jitter(self.executable.drawn)
            check_argument("what camera_jitter returns", moved, _Offset)
        x, y = (value / side for value, side in zip(moved, camera.size, strict=True))
        return replace(camera, projection=shifted(camera.projection, 2 * x, 2 * y), jitter=(x, y))

    def _check_views(self) -> None:
        """Check that every view table of running nodes has been set by `update`."""
        for name, table in self.executable.views.tables.items():
            maker = name.rpartition(".")[0]
            if table.count and maker in self._active and name not in self.executable.views.current:
                node = self.graph[maker]
                text = f"{node.title} never sets the views of '{name}'; do so in `update`"
                raise InputError(Problem("RG433", text, node.place))
        self._complete = True

    def check(self) -> None:
        """Raise a RenderError for driver errors since the last check."""
        if error := self.executable.device.raw.error():
            self.executable.invalidate()
            raise RenderError(Problem("RG614", f"the driver reported {error} while drawing"))

    def read(self, resource: str, *, mip: int = 0, layer: int | None = None, stencil: bool = False) -> npt.NDArray[Any]:
        """Return a resource's texels after the last frame: (height, width, channels), preceded by layers if it has any.

        The top row comes first; samples are resolved. `layer` selects one layer, `stencil` replaces depth.
        """
        device, memory, parity = self.executable.device, self.executable.memory, self.executable.parity
        desc = self.executable.plan.resources[resource].desc
        if isinstance(desc, BufferDesc):
            device.ctx.finish()
            return np.frombuffer(memory.buffer(resource, parity).read(desc.bytes), np.uint8)
        texels = textures.read(device, memory.texture(resource, parity), mip=mip, layer=layer, stencil=stencil)
        return texels[0] if desc.kind == "texture2d" or layer is not None else texels


def _has_moved(before: tuple[Scene, ViewMatrices] | None, now: tuple[Scene, ViewMatrices] | None) -> bool:
    """Return whether the cameras of two frames differ, apart from jitter."""
    if before is None or now is None:
        return True
    return not all(np.array_equal(getattr(before[1], name), getattr(now[1], name)) for name in ("view", "projection"))


def _view_makers(graph: Graph, node: GraphNode) -> Iterator[str]:
    """Yield the nodes with whose views the inputs of a node were drawn."""
    for end in chain.from_iterable(node.inputs.values()):
        maker = "" if end.previous else (graph.textures[end.now].view or "").rpartition(".")[0]
        if maker in graph:
            yield maker


def _views_first(graph: Graph) -> list[GraphNode]:
    """Return the nodes in the file's order, but each after the nodes whose views it may request."""
    found: dict[str, GraphNode] = {}

    def visit(node: GraphNode) -> None:
        if node.id not in found:
            found[node.id] = node
            for maker in _view_makers(graph, node):
                visit(graph[maker])
            found[node.id] = found.pop(node.id)

    for node in graph.nodes:
        visit(node)
    return list(found.values())


@contextmanager
def _author_errors(node: GraphNode, method: str) -> Iterator[None]:
    """Turn an exception of a plugin's method into an error at the author's line."""
    try:
        yield
    except RenderError:
        raise
    except SceneError as error:  # addressed to the user
        text = f"{node.title}: {shown(error, 200)}"
        raise InputError(Problem("RG209", text, node.place)) from error
    except BaseException as error:
        if is_interruption(error):
            raise
        code = error.code if isinstance(error, Misuse) and error.code == "RG432" else "RG433"
        problem = author_problem(error, type(node.node), node.type.file)
        doing = f"{node.title} failed in {method}"
        raise InputError(problem.relocate(node.place, code=code, context=doing)) from error


def median_times(frames: Sequence[FrameTimes]) -> list[StepTime]:
    """Return per node, in order of execution, the median over frames of its steps' summed times; 0 if none ran."""
    runs: dict[str, list[list[StepTime]]] = {}
    for number, frame in enumerate(frames):
        for step in frame.steps:
            runs.setdefault(step.node, [[] for _ in frames])[number].append(step)
    result = []
    for node, by_frame in runs.items():
        measured = [[step.gpu_ms for step in steps if step.gpu_ms is not None] for steps in by_frame]
        # A frame without an answer of the driver does not count, unlike one in which no step ran.
        gpu = [sum(times) for times, steps in zip(measured, by_frame, strict=True) if times or not steps]
        cpu = [sum(step.cpu_ms for step in steps) for steps in by_frame]
        result.append(StepTime(node, _median(cpu), _median(gpu) if any(measured) else None))
    return result


def summary(values: Sequence[float]) -> Mapping[str, float]:
    """Return median, minimum and maximum."""
    return {"median": _median(values), "min": float(min(values)), "max": float(max(values))}


def _median(values: Sequence[float]) -> float:
    """Return the median; NumPy's and `statistics`' functions import modules that take longer than a frame."""
    ranked = sorted(values)
    return float(ranked[len(ranked) // 2] + ranked[(len(ranked) - 1) // 2]) / 2
