"""A compiled pipeline with its scene and camera: renders frames, and reads them back."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property
from time import perf_counter
from typing import Any

from msgspec import Struct, field
from msgspec.structs import replace

from rendergraph import activity
from rendergraph.compile import Executable, GpuScene
from rendergraph.errors import Place, Problem, RenderError
from rendergraph.execute import FrameTimes, Runner
from rendergraph.images import PictureInfo, channel_names
from rendergraph.installed import versions
from rendergraph.program import ray_warnings
from rendergraph.scene import animate
from rendergraph.scene.cameras import view_matrices
from rendergraph.scene.model import Camera, Scene
from rendergraph.session.frame import Frame, OutputInfo
from rendergraph.session.gpu import Gpu
from rendergraph.session.picture_metadata import frame_metadata, pipeline_metadata, turntable_metadata
from rendergraph.session.scenes import Driven
from rendergraph.session.values import Expanded, OutputRequest
from rendergraph.textures import FORMATS, Semantic, TextureDesc
from rendergraph.version import __version__

_NOTE_DONE = activity.note("reading a frame back")


class Drawing(Struct, eq=False, dict=True):
    """The result of `stages.compile`, to be used inside `with gpu.current()` until something else is rendered there.

    Attributes:
        runner: renders the bare frame, without scene and camera at its time and without reading back.
        times: of the frames since `begin`.
        number, camera: of the last rendered frame.
    """

    expanded: Expanded
    executable: Executable
    scene: GpuScene
    gpu: Gpu
    times: list[FrameTimes] = field(default_factory=list)
    number: int = 0
    camera: Camera | None = None
    _held: tuple[float, Scene] | None = None
    _set_values: dict[tuple[str, str], Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        options, linked = self.expanded.options, self.expanded.linked
        self._driven = Driven(linked.graph, linked.scene, self.executable)
        self.runner = Runner(self.executable, linked.graph, options.reuses, options.cull)
        history = any(r.role == "history" for r in self.executable.plan.resources.values())
        self._remembers = history or self.executable.uses_previous
        # Without a history, a frame depends only on the positions in the one before it.
        self._lead = None if history or self.runner.jittering or self.executable.reads_frame else 1

    def begin(self, lead: int | None = None) -> None:
        """Warm up if the options say so, and clear the history."""
        options = self.expanded.options
        if options.warms_up:
            self._draw(options.frames[0])
            self.gpu.device.ctx.finish()
            self.executable.reuse.forget()  # every measured step must run
        self._set_values.clear()
        self.runner.reset()
        self.times, self.number = [], 0 if lead is None else max(0, options.frames[0] - lead - 1)

    def set(self, node: str, name: str, value: Any) -> bool:
        """Give a parameter of a node another value from the next frame on, until `begin`.

        Return False, and change nothing, unless it is only a uniform of programs that run in every frame.
        """
        graph = self.expanded.linked.graph
        parameter = graph[node].type.cls.parameters().get(name) if node in graph else None
        if parameter is None or parameter.role != "param" or node in self.runner.updating:
            return False
        try:
            converted = parameter.convert(value)
        except (TypeError, ValueError):
            return False
        if not self.executable.cells(node, name) or self.executable.set_uniform(node, name, converted) is not None:
            return False
        self._set_values[node, name] = converted
        return True

    def draw(self, number: int, camera: Camera | None = None) -> None:
        """Render a frame, with the scene as it is at its time.

        If frames depend on earlier ones, missing earlier frames are rendered first, so that a frame does not depend on
        which others are requested. With a camera of the caller's, rendering continues from the last frame instead.

        Raises:
            RenderError: the driver reported an error, an `update` failed, or something else was rendered meanwhile.
        """
        if self.gpu.cache.drawing is not self:
            text = "the session has started another drawing; take all frames of one drawing before the next"
            raise RenderError(Problem("RG615", text))
        if self._remembers and camera is None:
            if number <= self.number:
                self.runner.reset()  # of uniforms, too
                for (node, name), value in self._set_values.items():
                    self.executable.set_uniform(node, name, value)
                self.number = 0
            begin = self.number + 1 if self._lead is None else max(self.number + 1, number - self._lead)
            for earlier in range(begin, number):
                self._draw(earlier, moments=self._lead is None)
        self.times.append(self._draw(number, camera))
        self.runner.check()
        self.number = number

    def _draw(self, number: int, camera: Camera | None = None, *, moments: bool = True) -> FrameTimes:
        options, size = self.expanded.options, self.expanded.linked.graph.size
        time = ((number if options.still is None else min(number, options.still)) - 1) / options.fps
        if self.executable.drawn:
            self.scene.advance()
        times: list[FrameTimes] = []
        each = self._moments(time) if moments else [time]
        for part, moment in enumerate(each):
            scene = self._scene_at(moment)
            if not self.executable.drawn:
                self.scene.advance()  # the first frame has no motion
            self.camera = camera or scene.camera
            assert self.camera is not None  # a completed scene has one
            view = view_matrices(self.camera, size)
            self._driven.set(moment)
            begun = perf_counter()
            with activity.limited_draw():
                found = self.runner.run(
                    number, moment, 1.0 / options.fps, scene, view, moment=part, moments=len(each), timed=options.timed
                )
                if found is None:
                    self.gpu.device.ctx.finish()
                    found = FrameTimes((perf_counter() - begun) * 1e3, (), self.runner.ran)
                times.append(found)
        _NOTE_DONE()
        steps = tuple(step for found in times for step in found.steps)
        return FrameTimes(sum(found.frame_ms for found in times), steps, sum(found.ran for found in times))

    def _scene_at(self, time: float) -> Scene:
        scene = self.expanded.linked.scene
        if not animate.moves(scene):
            return scene
        # With `still`, a second update would report motion where there is none.
        if self._held is None or self.expanded.options.still is None or self._held[0] != time:
            self._held = time, animate.at(scene, time)
            self.executable.fresh |= self.scene.update(self._held[1])
        return self._held[1]

    def _moments(self, time: float) -> list[float]:
        """Return the moments of the open shutter that a frame averages, the one nearest to its own time last.

        Outputs that are not light, and what the next frame reads of this one, are those of the last moment.
        """
        options, scene = self.expanded.options, self.expanded.linked.scene
        if options.subframes == 1 or not (animate.moves(scene) or self.executable.moves_with_time):
            return [time]
        camera = animate.at(scene, time).camera
        span = camera.shutter / options.fps if camera is not None else 0.0
        offsets = [((number + 0.5) / options.subframes - 0.5) * span for number in range(options.subframes)]
        return [time + offset for offset in sorted(offsets, key=abs, reverse=True)] if span else [time]

    def read(self) -> Frame:
        """Read back the requested outputs of the last frame."""
        graph, options, plan = self.expanded.linked.graph, self.expanded.options, self.executable.plan
        infos, arrays = {}, {}
        transparent = any(getattr(node.node, "transparent", False) is True for node in graph.nodes)
        for name, port in self.expanded.requests.items():
            id = plan.schedule.outputs[name]
            info = _output_info(name, port, graph.textures[port.end].semantic, plan.resources[id].desc)
            infos[name] = replace(info, transparent=transparent and info.semantic == "display_color")
            arrays[name] = self.runner.read(id, mip=port.mip or 0, layer=port.layer, stencil=port.stencil)
        return Frame(
            number=self.number,
            pipeline=graph.name,
            size=graph.size,
            arrays=arrays,
            infos=infos,
            device=self.gpu.device.as_json(),
            types={node: graph[node].type.name for node in self._rendering_nodes},
            memory=plan.memory.as_json(),
            culled=dict(plan.schedule.culled),
            metadata=self._metadata
            | frame_metadata(self.number, options.fps, options.subframes)
            | self._turned_camera(),
            times=tuple(self.times),
            warnings=(*dict.fromkeys(self.gpu.cache.image_warnings), *self._frame_warnings(), *self._ray_notes),
        )

    def _turned_camera(self) -> dict[str, str]:
        """Return the metadata of a turntable's camera, which is not the pipeline's own."""
        if self.expanded.options.turntable is None or self.camera is None:
            return {}
        from rendergraph.scene.scene_values import camera_words  # few cameras are put in words

        return {**turntable_metadata(self.expanded), "rendergraph:camera": camera_words(self.camera)}

    def _frame_warnings(self) -> Iterator[Problem]:
        """Yield warnings about frames that show less than was asked for."""
        options, graph = self.expanded.options, self.expanded.linked.graph
        is_first = options.frames == range(1, 2)
        if (node := self.runner.jittering) is not None and is_first:
            text = f"'{node}' accumulates over frames, but only frame 1 was rendered; --frames 16-16 shows more"
            yield Problem("RG620", text, Place(graph.name), severity="warning")
        elif graph.facts.camera.shutter and self.executable.uses_previous and is_first:
            text = "motion is measured from frame to frame, but only frame 1 was rendered; --frames 2-2 shows it"
            yield Problem("RG627", text, Place(graph.name), severity="warning")
        if options.subframes > 1 and not (self.camera is None or self.camera.shutter):
            text = f"the camera's shutter is never open, so {options.subframes} subframes are one; add --shutter 0.5"
            yield Problem("RG628", text, Place(graph.name), severity="warning")

    @cached_property
    def _ray_notes(self) -> tuple[Problem, ...]:
        return tuple(ray_warnings(self.executable.plan.schedule.steps, self.expanded.linked.node_types))

    @cached_property
    def _rendering_nodes(self) -> tuple[str, ...]:
        """The nodes that render, or compute something for those that do, in order."""
        drawing = dict.fromkeys(step.node for step in self.executable.plan.schedule.steps)
        return (*(node for node in self.runner.updating if node not in drawing), *drawing)

    @cached_property
    def _metadata(self) -> dict[str, str]:
        found = {"rendergraph": __version__} | versions(("moderngl", "numpy", "OpenImageIO"))
        device = self.gpu.device
        return {
            **pipeline_metadata(self.expanded.linked),
            "rendergraph:versions": ", ".join(f"{name} {version}" for name, version in found.items()),
            "rendergraph:device": f"{device.renderer}, OpenGL {device.as_json()['version']}",
        }


def _output_info(name: str, port: OutputRequest, semantic: Semantic, desc: object) -> OutputInfo:
    if not isinstance(desc, TextureDesc):
        return OutputInfo(name, str(port.end), semantic.name, "bytes", "buffer", None, ())
    meaning, format, encoding = semantic.name, desc.format, semantic.encoding
    if port.stencil:
        meaning, format, encoding = "stencil", "r8ui", None
    channels = channel_names(PictureInfo(meaning, format, encoding), FORMATS[format].components)
    kind = desc.kind if port.layer is None else "texture2d"
    return OutputInfo(name, str(port.end), meaning, format, kind, encoding, channels)
