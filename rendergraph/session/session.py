"""A session owns a GL context, and shares programs and scenes between pipelines."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any

from rendergraph import stamps
from rendergraph.compile import Executable, GpuScene, ProgramCache, compile_plan
from rendergraph.errors import Problem, RenderError, UsageError
from rendergraph.execute import FrameTimes, Runner, median_times, summary
from rendergraph.gl.device import Device, borrow_device, open_device
from rendergraph.gl.memory import check_memory
from rendergraph.images import Limits, PictureInfo, channel_names, decode
from rendergraph.scene import animate, pack
from rendergraph.scene.cameras import view_matrices
from rendergraph.scene.model import ImageSource, Scene
from rendergraph.session.frame import Frame, OutputInfo
from rendergraph.session.kept import Kept
from rendergraph.session.pipeline import Pipeline, load
from rendergraph.textures import FORMATS, TextureDesc

if TYPE_CHECKING:
    import moderngl
    import numpy.typing as npt

    from rendergraph.declare import Node
    from rendergraph.expand import Expansion
    from rendergraph.link import Endpoint


class Session:
    """Draws pipelines on one GL context.

    Programs live as long as the session, keyed by source and macros; a scene stays on the GPU until another pipeline
    asks for a different one; compiled pipelines and their textures are kept for the last few that were drawn, so that
    variants can be drawn in turns. A changed shader or include is noticed, and only the programs whose text it changes
    are compiled anew. A session is bound to the thread that made it.

    Attributes:
        device: the GL device.
        programs: the programs that were compiled.
        scenes_made: how many scenes have been put on the GPU so far.
        active: what was drawn last.
    """

    def __init__(self, device: int | None = None, *, ctx: moderngl.Context | None = None) -> None:
        """Open a context.

        Args:
            device: EGL device number as `doctor` lists them.
            ctx: the caller's own current context, borrowed: drawn in whatever its state, given back as it was found.

        Raises:
            DeviceError: there is no usable GL device.
        """
        self._thread = threading.get_ident()
        self.device: Device = open_device(device) if ctx is None else borrow_device(ctx)
        self.programs = ProgramCache(self.device)
        self._scenes: dict[int, tuple[Scene, GpuScene]] = {}
        self.active: Executable | None = None
        self.scenes_made = 0
        self._kept = Kept()
        self._closed = False
        self._image_warnings: list[Problem] = []

    def __enter__(self) -> Session:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Free everything; the context too, unless it was borrowed."""
        if self._closed:
            return
        self._closed = True
        with self.device.current():
            self.device.raw.glUseProgram(0)  # one in use would outlive its deletion
            self._forget_executables()
            for _, scene in self._scenes.values():
                scene.release(self.programs)
            self._scenes.clear()
            self.programs.release()
        self.device.release()

    def _check_usable(self) -> None:
        if self._closed:
            raise RenderError(
                Problem("RG615", "the session is closed; draw before its `with` block ends, or make another")
            )
        if threading.get_ident() != self._thread:
            raise RenderError(Problem("RG615", "a session must be used by the thread that made it; make one a thread"))

    # Drawing ---------------------------------------------------------------------------------------------------------

    def render(
        self,
        pipeline: Pipeline | str | Path,
        size: tuple[int, int] | None = None,
        *,
        frames: range | None = None,
        outputs: Sequence[str] | None = None,
        taps: Sequence[str] = (),
        alias: bool = True,
        poison: bool = False,
        shuffle: int | None = None,
        fps: float = 30.0,
        on_frame: Callable[[Frame], None] | None = None,
        warm_up: bool = True,
    ) -> Frame:
        """Draw a pipeline, or the one of a name or a file, and return the last frame; see `Pipeline.render`.

        `warm_up` draws the first frame once more beforehand, unmeasured, and starts history afresh after it.
        """
        self._check_usable()
        if isinstance(pipeline, str | Path):
            pipeline = load(pipeline)
        if size is not None:
            pipeline = pipeline.with_size(size)
        wanted = pipeline.wanted(outputs, taps)
        frames = range(1, 2) if frames is None else frames
        if not isinstance(frames, range) or not frames or min(frames) < 1:
            text = f"frames is {frames!r}; it is a range of numbers from 1, as in range(1, 31) for the first 30"
            raise UsageError(Problem("RG500", text))
        if not fps > 0:
            raise UsageError(Problem("RG500", f"fps is {fps}; it is a number above 0"))
        with self.device.current():
            runner = self.prepare(pipeline, outputs, taps, alias=alias, poison=poison, shuffle=shuffle)
            if warm_up:
                self._frame(pipeline, runner, frames[0], fps)
                runner.check()
                self.device.ctx.finish()
            runner.reset()
            times: list[FrameTimes] = []
            frame: Frame | None = None
            for number in frames:
                times.append(self._frame(pipeline, runner, number, fps))
                runner.check()
                if number == frames[-1] or on_frame is not None:
                    frame = self._collect(pipeline, runner, wanted, number, times)
                    if on_frame is not None:
                        on_frame(frame)
        assert frame is not None
        return frame

    def _frame(self, pipeline: Pipeline, runner: Runner, number: int, fps: float) -> FrameTimes:
        time = (number - 1) / fps
        scene = pipeline.scene
        if animate.moves(scene):
            scene = animate.at(scene, time)
            self._scenes[id(pipeline.scene)][1].update(scene)
        name = pipeline.camera or next(iter(scene.cameras))
        camera = view_matrices(scene.cameras[name], pipeline.graph.size)
        times = runner.run(number, time, 1.0 / fps, scene, camera, timed=True)
        assert times is not None
        return times

    def prepare(
        self,
        pipeline: Pipeline,
        outputs: Sequence[str] | None = None,
        taps: Sequence[str] = (),
        *,
        alias: bool = True,
        poison: bool = False,
        shuffle: int | None = None,
    ) -> Runner:
        """Compile a pipeline without drawing it; one that is kept is taken again where only uniforms differ.

        The runner's `run` is the bare frame: what `render` does before and after it (warming up, reading back) is the
        caller's. To be called, and its runner run, inside `with session.device.current()`.
        """
        self._check_usable()
        from rendergraph.allocate import allocate
        from rendergraph.schedule import schedule

        expansion = pipeline.expansion(outputs, taps)
        scene = self._scene(pipeline)
        types = {node.id: node.type for node in pipeline.graph.nodes}
        sources = tuple((name, found.shaders, found.inherited, _declared(found.cls)) for name, found in types.items())
        key = (_structure(expansion), sources, id(pipeline.scene), alias, poison, shuffle)
        executable = self._kept.take(key)
        if executable is None:
            plan = allocate(schedule(expansion, shuffle=shuffle), alias=alias)
            needed = plan.memory.allocated_bytes
            self._kept.make_room(needed)
            check_memory(self.device, needed, pipeline.allowed("plan").get("memory"))
            with stamps.looking() as files:
                executable = compile_plan(
                    self.device, plan, types, expansion.views, scene, self.programs, poison=poison
                )
            self._kept.add(key, executable, files)
            self.programs.discard(self._kept.unused())
        else:
            executable.set_uniforms(expansion.steps)
        if executable is not self.active:
            executable.fresh = True  # another pipeline may have written other values into shared programs
        self.active = executable
        return Runner(executable, pipeline.graph)

    def _scene(self, pipeline: Pipeline) -> GpuScene:
        scene = pipeline.scene
        if id(scene) not in self._scenes:
            for _, old in self._scenes.values():
                old.release(self.programs)
            self._scenes = {}  # what follows may fail, and a released scene must not be met again
            self._forget_executables()
            self._image_warnings = []
            allowed = pipeline.allowed("scene")
            names = {"image_side": "side", "image_bytes": "bytes", "image_ratio": "ratio"}
            self._limits = Limits(**{names[name]: most for name, most in allowed.items() if name in names})
            self.scenes_made += 1
            self._scenes = {id(scene): (scene, GpuScene(self.device, scene, pack.pack(scene), self._decode))}
            if pipeline.environment is not None and scene.environment is not None:
                self._decode(scene.environment.image, False)  # named by the user: a broken one is said, used or not
        return self._scenes[id(scene)][1]

    def _decode(self, source: ImageSource, srgb: bool) -> npt.NDArray[Any]:
        return decode(source, srgb=srgb, warn=self._image_warnings.append, limits=self._limits)

    def _forget_executables(self) -> None:
        self._kept.clear()
        self.active = None

    # Results ---------------------------------------------------------------------------------------------------------

    def _collect(
        self,
        pipeline: Pipeline,
        runner: Runner,
        wanted: Mapping[str, Endpoint],
        number: int,
        times: Sequence[FrameTimes],
    ) -> Frame:
        graph, plan = pipeline.graph, runner.executable.plan
        resources = plan.schedule.wanted
        arrays = {name: runner.read(resources[name]) for name in wanted}
        infos = {}
        for name, end in wanted.items():
            info = graph.textures[end]
            desc = plan.resources[resources[name]].desc
            infos[name] = _output_info(name, info.semantic.name, info.semantic.encoding, desc)
        passes = tuple(
            {"node": t.node, "type": graph[t.node].type.name, "gpu_ms": t.gpu_ms, "cpu_ms": t.cpu_ms}
            for t in median_times(times)
        )
        return Frame(
            number=number,
            pipeline=graph.name,
            size=graph.size,
            arrays=arrays,
            infos=infos,
            device=self.device.as_json(),
            passes=passes,
            frame_ms=summary([t.frame_ms for t in times]),
            memory=plan.memory.as_json(),
            culled=dict(plan.schedule.culled),
            metadata=self._metadata(pipeline),
            times=tuple(times),
            warnings=tuple(dict.fromkeys(self._image_warnings)),
        )

    def _metadata(self, pipeline: Pipeline) -> dict[str, str]:
        import moderngl
        import numpy
        import OpenImageIO

        import rendergraph

        libraries = (rendergraph, moderngl, numpy, OpenImageIO)  # they know; asking for their metadata takes 20 ms
        return {
            "rendergraph:pipeline": pipeline.spec.to_yaml(origins=False),
            "rendergraph:versions": ", ".join(f"{library.__name__} {library.__version__}" for library in libraries),
            "rendergraph:device": f"{self.device.renderer}, OpenGL {self.device.as_json()['version']}",
        }


def _declared(cls: type[Node]) -> tuple[Any, ...]:
    """What program text takes from a class beside the steps it recorded: a module that is imported anew may differ."""
    return tuple(
        (
            name,
            type(port),
            getattr(port, "kind", None),
            getattr(port, "semantic", None),
            getattr(port, "signature", None),
        )
        for name, port in cls.ports().items()
    )


def _structure(expansion: Expansion) -> tuple[Any, ...]:
    """An expansion without the values that can change in a compiled pipeline."""
    steps = tuple(
        replace(
            step,
            uniforms=tuple((name, None) for name, _ in step.uniforms),  # type: ignore[misc]
            functions=tuple(replace(f, uniforms=()) for f in step.functions),
        )
        for step in expansion.steps
    )
    resources = tuple(expansion.resources.values())
    return steps, resources, tuple(expansion.wanted.items()), tuple(expansion.views.items())


def _output_info(name: str, semantic: str, encoding: str | None, desc: object) -> OutputInfo:
    if not isinstance(desc, TextureDesc):
        return OutputInfo(name, semantic, "bytes", "buffer", None, ())
    channels = channel_names(PictureInfo(semantic, desc.format, encoding), FORMATS[desc.format].components)
    return OutputInfo(name, semantic, desc.format, desc.kind, encoding, channels)
