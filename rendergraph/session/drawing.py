"""A compiled pipeline with its scene and camera: draws frames, and reads them back."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import cached_property
from time import perf_counter

from msgspec import Struct, field

from rendergraph.compile import Executable, GpuScene
from rendergraph.errors import Place, Problem, RenderError
from rendergraph.execute import FrameTimes, Runner
from rendergraph.images import PictureInfo, channel_names
from rendergraph.installed import versions
from rendergraph.scene import animate
from rendergraph.scene.cameras import view_matrices
from rendergraph.scene.model import Camera
from rendergraph.session.frame import Frame, OutputInfo
from rendergraph.session.gpu import Gpu
from rendergraph.session.made import at_time, described
from rendergraph.session.values import Expanded, Wanted
from rendergraph.textures import FORMATS, Semantic, TextureDesc
from rendergraph.version import __version__


class Drawing(Struct, eq=False, dict=True):
    """What `stages.compile` makes; to be used inside `with gpu.current()`, until something else is drawn there.

    Attributes:
        expanded: what is drawn.
        executable: compiled.
        scene: its scene on the GPU.
        gpu: where.
        runner: the bare frame, without scene and camera at its time and without what is read back.
        times: what the frames since `begin` took.
        number: of the frame that was drawn last.
        camera: what that was seen with, None before there is one.
    """

    expanded: Expanded
    executable: Executable
    scene: GpuScene
    gpu: Gpu
    times: list[FrameTimes] = field(default_factory=list)
    number: int = 0
    camera: Camera | None = None

    def __post_init__(self) -> None:
        options = self.expanded.options
        self.runner = Runner(self.executable, self.expanded.linked.graph, options.reuses, options.cull)
        history = any(r.role == "history" for r in self.executable.plan.resources.values())
        self._remembers = history or self.executable.looks_back

    def begin(self) -> None:
        """Warm up where that is asked for, and start history afresh."""
        options = self.expanded.options
        if options.warms_up:
            self._draw(options.frames[0])
            self.gpu.device.ctx.finish()
            self.executable.reuse.forget()  # what is measured is done
        self.runner.reset()
        self.times, self.number = [], 0

    def begin_at(self, number: int) -> None:
        """Leave out the frames before this one, as though nothing had been remembered of them."""
        self.number = max(0, number - 1)

    def draw(self, number: int, camera: Camera | None = None) -> None:
        """Draw a frame, with the scene as it is at its time.

        Where something is remembered from frame to frame, those before that have not been drawn are drawn first: a
        frame is the same whichever others are looked at. With a camera of the caller's, which those before may not have
        had, it goes on from what was drawn last.

        Args:
            number: of the frame.
            camera: what it is seen with; by default what was selected, as it is at that time.

        Raises:
            RenderError: the driver reported an error, a node's `update` failed, or something else was drawn meanwhile.
        """
        if self.gpu.cache.drawing is not self:
            text = "the session has begun to draw something else; take all frames of one drawing before the next"
            raise RenderError(Problem("RG615", text))
        if self._remembers and camera is None:
            if number <= self.number:
                self.runner.reset()
                self.number = 0
            for earlier in range(self.number + 1, number):
                self._draw(earlier)
        self.times.append(self._draw(number, camera))
        self.runner.check()
        self.number = number

    def _draw(self, number: int, camera: Camera | None = None) -> FrameTimes:
        linked, fps = self.expanded.linked, self.expanded.options.fps
        time, scene = (number - 1) / fps, linked.scene
        if self.runner.drawn:
            self.scene.advance()
        if animate.moves(scene):
            scene = animate.at(scene, time)
            self.scene.update(scene)
        if not self.runner.drawn:
            self.scene.advance()  # nothing has moved before the first frame
        self.camera = camera or scene.cameras[linked.selection.camera or next(iter(scene.cameras))]
        view = view_matrices(self.camera, linked.graph.size)
        begun = perf_counter()
        times = self.runner.run(number, time, 1.0 / fps, scene, view, timed=self.expanded.options.timed)
        if times is not None:
            return times
        self.gpu.device.ctx.finish()
        return FrameTimes((perf_counter() - begun) * 1e3, (), self.runner.ran)

    def read(self) -> Frame:
        """What was wanted of the frame that was drawn last."""
        linked, plan = self.expanded.linked, self.executable.plan
        graph = linked.graph
        resources = plan.schedule.wanted
        infos = {}
        for name, port in self.expanded.wanted.items():
            infos[name] = _output_info(
                name, port, graph.textures[port.end].semantic, plan.resources[resources[name]].desc
            )
        return Frame(
            number=self.number,
            pipeline=graph.name,
            size=graph.size,
            arrays={
                name: self.runner.read(resources[name], mip=port.mip or 0, layer=port.layer, stencil=port.stencil)
                for name, port in self.expanded.wanted.items()
            },
            infos=infos,
            device=self.gpu.device.as_json(),
            types={node: graph[node].type.name for node in self._drawn},
            memory=plan.memory.as_json(),
            culled=dict(plan.schedule.culled),
            metadata={**self._metadata, **at_time(self.number, self.expanded.options.fps)},
            times=tuple(self.times),
            warnings=(*dict.fromkeys(self.gpu.cache.image_warnings), *self._alone()),
        )

    def _alone(self) -> Iterator[Problem]:
        """What is to be said of one frame where a node puts many together."""
        node = self.runner.jittering
        if node is not None and self.expanded.options.frames == range(1, 2):
            text = f"'{node}' puts pictures of many frames together, and this is the first of them"
            text += "; --frames 16-16 shows more"
            yield Problem("RG620", text, Place(self.expanded.linked.graph.name), severity="warning")

    @cached_property
    def _drawn(self) -> tuple[str, ...]:
        """The nodes that draw, or compute something for those that do, in order."""
        drawing = dict.fromkeys(step.node for step in self.executable.plan.schedule.steps)
        return (*(node for node in self.runner.updating if node not in drawing), *drawing)

    @cached_property
    def _metadata(self) -> Mapping[str, str]:
        found = {"rendergraph": __version__} | versions(("moderngl", "numpy", "OpenImageIO"))
        device = self.gpu.device
        return {
            **described(self.expanded.linked),
            "rendergraph:versions": ", ".join(f"{name} {version}" for name, version in found.items()),
            "rendergraph:device": f"{device.renderer}, OpenGL {device.as_json()['version']}",
        }


def _output_info(name: str, port: Wanted, semantic: Semantic, desc: object) -> OutputInfo:
    if not isinstance(desc, TextureDesc):
        return OutputInfo(name, str(port.end), semantic.name, "bytes", "buffer", None, ())
    meaning, format, encoding = semantic.name, desc.format, semantic.encoding
    if port.stencil:
        meaning, format, encoding = "stencil", "r8ui", None
    channels = channel_names(PictureInfo(meaning, format, encoding), FORMATS[format].components)
    kind = desc.kind if port.layer is None else "texture2d"
    return OutputInfo(name, str(port.end), meaning, format, kind, encoding, channels)
