"""A compiled pipeline with its scene and camera: draws frames, and reads them back."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

from rendergraph.compile import Executable, GpuScene
from rendergraph.errors import Problem, RenderError
from rendergraph.execute import FrameTimes, Runner, median_times, summary
from rendergraph.images import PictureInfo, channel_names
from rendergraph.scene import animate
from rendergraph.scene.cameras import view_matrices
from rendergraph.session.frame import Frame, OutputInfo
from rendergraph.session.gpu import Gpu
from rendergraph.session.values import Expanded, Wanted
from rendergraph.textures import FORMATS, Semantic, TextureDesc
from rendergraph.version import __version__


@dataclass(eq=False)
class Drawing:
    """What `stages.compile` makes; to be used inside `with gpu.current()`, until something else is drawn there.

    Attributes:
        expanded: what is drawn.
        executable: compiled.
        scene: its scene on the GPU.
        gpu: where.
        runner: the bare frame, without scene and camera at its time and without what is read back.
        times: what the frames since `begin` took.
        number: of the frame that was drawn last.
    """

    expanded: Expanded
    executable: Executable
    scene: GpuScene
    gpu: Gpu
    times: list[FrameTimes] = field(default_factory=list)
    number: int = 0

    def __post_init__(self) -> None:
        self.runner = Runner(self.executable, self.expanded.linked.graph)

    def begin(self) -> None:
        """Warm up where that is asked for, and start history afresh."""
        options = self.expanded.options
        if options.warm_up:
            self.draw(options.frames[0])
            self.gpu.device.ctx.finish()
        self.runner.reset()
        self.times = []

    def draw(self, number: int) -> None:
        """Draw a frame, with the scene and the camera as they are at its time.

        Raises:
            RenderError: the driver reported an error, a node's `update` failed, or something else was drawn meanwhile.
        """
        if self.gpu.cache.drawing is not self:
            text = "the session has begun to draw something else; take all frames of one drawing before the next"
            raise RenderError(Problem("RG615", text))
        linked, fps = self.expanded.linked, self.expanded.options.fps
        time, scene = (number - 1) / fps, linked.scene
        if animate.moves(scene):
            scene = animate.at(scene, time)
            self.scene.update(scene)
        name = linked.selection.camera or next(iter(scene.cameras))
        camera = view_matrices(scene.cameras[name], linked.graph.size)
        times = self.runner.run(number, time, 1.0 / fps, scene, camera, timed=True)
        assert times is not None
        self.times.append(times)
        self.runner.check()
        self.number = number

    def read(self) -> Frame:
        """What was wanted of the frame that was drawn last."""
        graph, plan = self.expanded.linked.graph, self.executable.plan
        resources = plan.schedule.wanted
        infos = {}
        for name, port in self.expanded.wanted.items():
            infos[name] = _output_info(
                name, port, graph.textures[port.end].semantic, plan.resources[resources[name]].desc
            )
        passes = tuple(
            {"node": t.node, "type": graph[t.node].type.name, "gpu_ms": t.gpu_ms, "cpu_ms": t.cpu_ms}
            for t in median_times(self.times)
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
            passes=passes,
            frame_ms=summary([t.frame_ms for t in self.times]),
            memory=plan.memory.as_json(),
            culled=dict(plan.schedule.culled),
            metadata=self._metadata,
            times=tuple(self.times),
            warnings=tuple(dict.fromkeys(self.gpu.cache.image_warnings)),
        )

    @cached_property
    def _metadata(self) -> Mapping[str, str]:
        import moderngl
        import numpy
        import OpenImageIO

        libraries = (moderngl, numpy, OpenImageIO)  # they know; asking for their metadata takes 20 ms
        versions = {"rendergraph": __version__} | {library.__name__: library.__version__ for library in libraries}
        device = self.gpu.device
        return {
            "rendergraph:pipeline": self.expanded.linked.spec.to_yaml(origins=False),
            "rendergraph:versions": ", ".join(f"{name} {version}" for name, version in versions.items()),
            "rendergraph:device": f"{device.renderer}, OpenGL {device.as_json()['version']}",
        }


def _output_info(name: str, port: Wanted, semantic: Semantic, desc: object) -> OutputInfo:
    if not isinstance(desc, TextureDesc):
        return OutputInfo(name, semantic.name, "bytes", "buffer", None, ())
    meaning, format, encoding = semantic.name, desc.format, semantic.encoding
    if port.stencil:
        meaning, format, encoding = "stencil", "r8ui", None
    channels = channel_names(PictureInfo(meaning, format, encoding), FORMATS[format].components)
    return OutputInfo(name, meaning, format, desc.kind if port.layer is None else "texture2d", encoding, channels)
