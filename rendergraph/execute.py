"""Walks the steps, times them, reads back."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from time import perf_counter
from typing import Any

import numpy as np
import numpy.typing as npt

from rendergraph.compile import Executable
from rendergraph.declare import Node, Port, Views
from rendergraph.declare.blame import happened
from rendergraph.errors import InputError, Misuse, Problem, RenderError, node_named
from rendergraph.expand import CAMERA
from rendergraph.gl import textures
from rendergraph.gl.saved_state import settle
from rendergraph.gl.timer import Timer
from rendergraph.link import Graph, GraphNode
from rendergraph.scene.animate import bounds
from rendergraph.scene.model import Light, Material, Mesh, Object, Scene, Vec3
from rendergraph.steps import Step, ViewMatrices
from rendergraph.steps.checks import buffer as buffer_of
from rendergraph.steps.checks import own_port
from rendergraph.textures import BufferDesc


@dataclass(frozen=True)
class StepTime:
    """Milliseconds of one step in one frame; `gpu_ms` is None where the driver has no timer.

    A node's `update` counts as part of its first step. `index` is the step's number in its node, -1 where there is only
    an `update`, and `label` what the author calls it.
    """

    node: str
    cpu_ms: float
    gpu_ms: float | None
    index: int = 0
    label: str = ""


@dataclass(frozen=True)
class FrameTimes:
    """What one frame took: wall time until the device was done, and each step in order."""

    frame_ms: float
    steps: tuple[StepTime, ...]


@dataclass(frozen=True, eq=False)
class FrameScene:
    """The scene of one frame as `update` sees it; see `steps.FrameScene`."""

    scene: Scene
    _bounds: list[tuple[Vec3, Vec3]] = field(default_factory=list)

    @property
    def lights(self) -> tuple[Light, ...]:
        """The scene's lights, in its order."""
        return self.scene.lights

    @property
    def objects(self) -> tuple[Object, ...]:
        """Placed objects."""
        return self.scene.objects

    @property
    def materials(self) -> tuple[Material, ...]:
        """What `Object.material` counts through."""
        return self.scene.materials

    @property
    def meshes(self) -> tuple[Mesh, ...]:
        """What `Object.mesh` counts through."""
        return self.scene.meshes

    @property
    def bounds(self) -> tuple[Vec3, Vec3]:
        """Least and greatest corner of what is drawn, found once."""
        if not self._bounds:
            self._bounds.append(bounds(self.scene))
        return self._bounds[0]


@dataclass(eq=False)
class FrameContext:
    """What a node's `update` sees and does in one frame (`steps.Frame`)."""

    executable: Executable
    node: GraphNode
    index: int
    time: float
    camera: ViewMatrices
    scene: FrameScene

    def connected(self, port: Port) -> bool:
        """Whether anything is linked to an input."""
        return bool(self.node.inputs.get(own_port(self.node.node.ports(), port, "connected's argument").name))

    def set_views(self, port: Views, views: Sequence[ViewMatrices]) -> None:
        """Set the views of a declared table."""
        if not isinstance(own_port(self.node.node.ports(), port, "set_views"), Views):
            raise Misuse(f"set_views is given '{port.name}', which is no Views port", "RG433")
        for view in views:
            if not isinstance(view, ViewMatrices):
                raise Misuse(f"set_views is given {type(view).__name__}, not ViewMatrices", "RG433")
        self.executable.views.set(f"{self.node.id}.{port.name}", views)

    def write(self, port: Port, values: npt.NDArray[Any]) -> None:
        """Upload into a declared buffer."""
        buffer_of(own_port(self.node.node.ports(), port, "write"), "write")
        name = f"{self.node.id}.{port.name}"
        if name not in self.executable.plan.placement:
            return  # nobody reads the buffer in this pipeline
        if self.executable.plan.resources[name].role == "kept":
            raise Misuse(f"it writes '{port.name}', which is kept, in each frame; take `kept=True` away", "RG433")
        array = np.ascontiguousarray(values)
        if array.dtype.kind not in "biuf":
            raise Misuse(f"write is given {type(values).__name__} of {array.dtype}, not an array of numbers", "RG433")
        data = array.tobytes()
        buffer = self.executable.memory.buffer(name)
        if len(data) > buffer.size:
            raise Misuse(f"it writes {len(data)} bytes into '{port.name}', which holds {buffer.size}", "RG432")
        buffer.write(data)


@dataclass(eq=False)
class Runner:
    """Runs an executable frame by frame.

    Attributes:
        executable: what runs.
        graph: for the nodes that compute something each frame.
    """

    executable: Executable
    graph: Graph
    _updating: list[GraphNode] = field(default_factory=list)
    _scene: FrameScene | None = None
    _parity: int = 0
    _active: set[str] = field(default_factory=set)
    _complete: bool = False

    def __post_init__(self) -> None:
        active = {step.node for step in self.executable.plan.schedule.steps}
        active |= {f.node for step in self.executable.plan.schedule.steps for f in step.functions}
        active |= {str(step.view).rpartition(".")[0] for step in self.executable.plan.schedule.steps}  # makers of views
        self._active = active
        self._updating = [
            node for node in self.graph.nodes if node.id in active and type(node.node).update is not Node.update
        ]
        self.reset()

    def reset(self) -> None:
        """Start history afresh: both copies hold the port's first value."""
        memory, plan = self.executable.memory, self.executable.plan
        for name, places in plan.placement.items():
            resource = plan.resources[name]
            if len(places) < 2 or isinstance(resource.desc, BufferDesc):
                continue
            for parity in (0, 1):
                textures.Clear(self.executable.device, memory.texture(name, parity), resource.first)()

    def run(
        self, index: int, time: float, delta: float, scene: Scene, camera: ViewMatrices, *, timed: bool = False
    ) -> FrameTimes | None:
        """Draw one frame.

        Args:
            index: frame number, from 1.
            time: seconds since frame 1.
            delta: seconds since the frame before.
            scene: the scene at that time.
            camera: its camera's view.
            timed: measure each step; otherwise nothing is measured and None returned.

        Raises:
            InputError: a node's `update` failed (RG432, RG433).
        """
        executable, views = self.executable, self.executable.views
        start = perf_counter()
        if executable.reads_frame:
            views.set_frame(time, delta, index)
        views.set(CAMERA, (camera,))
        moved = False
        if self._scene is None or self._scene.scene is not scene:
            self._scene, moved = FrameScene(scene), True
        updates: dict[str, float] = {}
        for node in self._updating:
            before = perf_counter()
            self._update(node, index, time, camera, self._scene)
            updates[node.id] = perf_counter() - before
        if not self._complete:
            self._check_views()
        if views.changed or moved:
            for sort in executable.sorters:
                sort(views)
            views.changed = False
        fresh = executable.fresh or not executable.device.owned
        if fresh:
            self.activate()
        # Counted by frames drawn, not by their numbers: of every second frame, too, each has the one before as history.
        parity = self._parity = (self._parity + 1) % len(executable.steps)
        if fresh or len(executable.binds) > 1:  # else everything is still bound from the frame before
            for call in executable.binds[parity]:
                call()
        listed = executable.lists[parity]
        if not timed:
            for step in listed:
                for call in step.calls:
                    call()
            executable.done()
            return None
        taken: list[tuple[Step, float, Timer]] = []
        measured = executable.device.can_time
        for step in listed:
            before = perf_counter()
            if measured:
                step.timer.start()
            for call in step.calls:
                call()
            if measured:
                step.timer.stop()
            node_id = step.step.node
            taken.append((step.step, perf_counter() - before + updates.pop(node_id, 0.0), step.timer))
        executable.done()
        executable.device.ctx.finish()
        frame_ms = (perf_counter() - start) * 1e3
        steps = [
            StepTime(node_id, cpu * 1e3, None, -1, "update") for node_id, cpu in updates.items()
        ]  # those that draw nothing
        for done, cpu, timer in taken:
            gpu = timer.milliseconds() if measured else None
            steps.append(StepTime(done.node, cpu * 1e3, gpu, done.index, done.label))
        return FrameTimes(frame_ms, tuple(steps))

    def activate(self) -> None:
        """Write what holds for all frames; needed once, and again when another pipeline used the programs."""
        settle(self.executable.device.raw)
        for call in self.executable.statics:
            call()
        self.executable.fresh = False

    def _update(self, node: GraphNode, index: int, time: float, camera: ViewMatrices, scene: FrameScene) -> None:
        frame = FrameContext(self.executable, node, index, time, camera, scene)
        try:
            node.node.update(frame)
        except RenderError:
            raise
        except (Exception, SystemExit) as error:  # a stranger's code
            code = error.code if isinstance(error, Misuse) and error.code == "RG432" else "RG433"
            mistake = happened(error, type(node.node), node.type.file)
            doing = f"{node_named(node.id, node.type.name)} failed in update"
            raise InputError(mistake.problem(code, doing, node.place)) from error

    def _check_views(self) -> None:
        """Every table of a node that runs has been filled by its `update`."""
        for name, table in self.executable.views.tables.items():
            maker = name.rpartition(".")[0]
            if table.count and maker in self._active and name not in self.executable.views.current:
                node = self.graph[maker]
                text = f"{node_named(maker, node.type.name)} never sets the views of '{name}'; do so in `update`"
                raise InputError(Problem("RG433", text, node.place))
        self._complete = True

    def check(self) -> None:
        """Raise what the driver has complained about since the last check.

        Raises:
            RenderError: there was a GL error.
        """
        error = self.executable.device.raw.error()
        if error:
            self.executable.renew()
            raise RenderError(Problem("RG614", f"the driver reported {error} while drawing"))

    def read(self, resource: str, *, mip: int = 0, layer: int | None = None, stencil: bool = False) -> npt.NDArray[Any]:
        """A resource's texels after the last frame: (height, width, channels), with layers before where it has them.

        The top row comes first; samples are resolved. A `layer` stands alone, `stencil` instead of depth.
        """
        executable = self.executable
        desc = executable.plan.resources[resource].desc
        if isinstance(desc, BufferDesc):
            executable.device.ctx.finish()
            return np.frombuffer(executable.memory.buffer(resource).read(desc.bytes), np.uint8)
        texture = executable.memory.texture(resource, self._parity)
        texels = textures.read(executable.device, texture, mip=mip, layer=layer, stencil=stencil)
        return texels[0] if desc.kind == "texture2d" or layer is not None else texels


def median_times(frames: Sequence[FrameTimes]) -> list[StepTime]:
    """Per node, in order of execution, the median over frames of its steps' summed times; 0 where none of them ran."""
    sums: dict[str, list[tuple[float, float | None]]] = {}
    for frame in frames:
        totals: dict[str, tuple[float, float | None]] = {}
        for step in frame.steps:
            cpu, gpu = totals.get(step.node, (0.0, None))
            if step.gpu_ms is not None:
                gpu = (gpu or 0.0) + step.gpu_ms
            totals[step.node] = (cpu + step.cpu_ms, gpu)
        for node, total in totals.items():
            sums.setdefault(node, []).append(total)
    result = []
    for node, totals_of in sums.items():
        measured = any(gpu is not None for _, gpu in totals_of)
        totals_of += [(0.0, 0.0 if measured else None)] * (len(frames) - len(totals_of))
        gpus = [gpu for _, gpu in totals_of if gpu is not None]
        result.append(StepTime(node, _median([cpu for cpu, _ in totals_of]), _median(gpus) if gpus else None))
    return result


def summary(values: Sequence[float]) -> Mapping[str, float]:
    """Median, least and most."""
    return {"median": _median(values), "min": float(min(values)), "max": float(max(values))}


def _median(values: Sequence[float]) -> float:
    """NumPy's imports masked arrays first, `statistics` exact fractions: both take longer than a frame."""
    ranked = sorted(values)
    return float(ranked[len(ranked) // 2] + ranked[(len(ranked) - 1) // 2]) / 2


__all__ = ["FrameContext", "FrameTimes", "Runner", "StepTime", "median_times", "summary"]
