"""The caches of a session on the GPU: programs, a scene, compiled pipelines, values of kept steps."""

from __future__ import annotations

from collections.abc import Hashable
from functools import partial
from typing import TYPE_CHECKING, Any

from msgspec.structs import replace

from rendergraph import stamps
from rendergraph.compile import Executable, GpuScene, KeptValues, ProgramCache, TexturePool, compile_plan
from rendergraph.compile.generated import TextureGenerator
from rendergraph.declare import Node
from rendergraph.errors import Problem
from rendergraph.expand import Expansion
from rendergraph.gl.device import Device, check_memory
from rendergraph.images import decode, decode_light
from rendergraph.scene import pack
from rendergraph.scene.model import ImageSource, Scene
from rendergraph.session.scenes import scene_limits
from rendergraph.session.values import Expanded, Linked, Planned
from rendergraph.settings import CacheLimits
from rendergraph.stamps import Stamps

if TYPE_CHECKING:
    import numpy.typing as npt

_MOST_EXECUTABLES = 4


class GpuCache:
    """One scene, and everything that a session caches within limits, where the least recently used is freed first."""

    def __init__(self, device: Device, limits: CacheLimits) -> None:
        self._device = device
        self.limits = limits
        self.programs = ProgramCache(device, limits.programs)
        self.kept = KeptValues(device, limits.bytes // 16)  # values that kept steps have computed
        self._pool = TexturePool(device)
        self._generator = TextureGenerator(self.programs)
        self.scenes_made = 0  # number of scenes that have been uploaded so far
        self.image_warnings: list[Problem] = []  # of the current scene
        self.active: Executable | None = None  # the last one that was compiled or found
        self.drawing: object = None  # the one that may render; all earlier ones are invalid
        # Compiled pipelines with the shader files that they were compiled from, the least recently used first.
        self._entries: dict[Hashable, tuple[Executable, Stamps]] = {}
        self._scene: tuple[Scene, GpuScene] | None = None

    @property
    def executables(self) -> list[Executable]:
        """The cached executables, the least recently used first."""
        return [executable for executable, _ in self._entries.values()]

    def upload(self, linked: Linked) -> GpuScene:
        """Return a pipeline's scene on the GPU, in place of the previous scene."""
        if self._scene is not None and self._scene[0] is linked.scene:
            return self._scene[1]
        self.clear_scene()
        limits = scene_limits(linked.selection)
        warnings: list[Problem] = []

        def decoded(source: ImageSource, srgb: bool) -> npt.NDArray[Any]:
            if source.generated is not None:
                return self._generator.texels(source)
            return decode(source, srgb=srgb, warn=warnings.append, limits=limits)

        light = partial(decode_light, warn=warnings.append, limits=limits)
        self.scenes_made += 1
        self.image_warnings = warnings
        scene = GpuScene(self._device, linked.scene, pack.pack(linked.scene), decoded, light)
        if linked.selection.environment is not None and linked.scene.environment is not None:
            scene.environment()  # the user named it: a broken one is an error whether or not it is read
        self._scene = linked.scene, scene
        return scene

    def find(self, expanded: Expanded) -> tuple[Hashable, Executable | None]:
        """Return a cached executable with the values of these steps, or None, and the key under which it is cached."""
        key = key_of(expanded)
        entry = self._entries.pop(key, None)
        if entry is None:
            return key, None
        executable, files = entry
        if not stamps.unchanged(files):
            self._save()
            executable.release()
            return key, None
        self._entries[key] = entry
        values = {step.key: step for step in expanded.expansion.steps}
        if executable is not self.active or not executable.changed(values).isdisjoint(executable.kept):
            self._save()
        executable.set_uniforms(values)
        self.kept.restore(executable)
        return key, executable

    def compile(self, key: Hashable, planned: Planned, scene: GpuScene) -> Executable:
        """Compile a plan, and cache it in place of the least recently used ones."""
        self._save()
        linked, needed = planned.linked, planned.plan.memory.allocated_bytes
        self._make_room(needed)
        check_memory(self._device, needed, linked.selection.allowed("plan").get("memory"))
        types, views, poison = linked.node_types, planned.expansion.views, planned.options.poison
        try:
            with stamps.track_reads() as files:
                executable = compile_plan(planned.plan, types, views, scene, self.programs, self._pool, poison=poison)
            self._entries[key] = executable, files
        finally:
            self.programs.trim({program for kept in self.executables for program in kept.programs})
        executable.recorded_steps = planned.expansion.steps
        executable.shares_kept = planned.options.shares
        self.kept.restore(executable)
        return executable

    def release(self) -> None:
        """Free everything."""
        self.active = None  # there is no later executable to pass values to
        self.clear_scene()
        self.kept.release()
        self.programs.release()

    def clear_scene(self) -> None:
        """Free the scene and everything that was compiled for it."""
        self._save()
        for executable in self.executables:
            executable.release()
        self._entries.clear()
        self.active = self.drawing = None
        scene, self._scene = self._scene, None  # releasing may fail, and a released scene must not be used again
        if scene is not None:
            scene[1].release(self.programs)

    def _make_room(self, needed: int) -> None:
        """Free executables, until one more of `needed` bytes can be cached."""
        while self._entries and (
            len(self._entries) >= _MOST_EXECUTABLES
            or needed + sum(each.plan.memory.allocated_bytes for each in self.executables) > self.limits.bytes
        ):
            self._entries.pop(next(iter(self._entries)))[0].release()

    def _save(self) -> None:
        """Copy the kept values of the active executable, before they are lost or something else is rendered."""
        if self.active is not None:
            self.kept.save(self.active)


def key_of(expanded: Expanded) -> Hashable:
    """Return what decides that an executable can be used for these steps: everything but the values of uniforms."""
    linked, options = expanded.linked, expanded.options
    sources = tuple(
        (node.id, node.type.shaders, node.type.inherited, _declaration(node.type.cls)) for node in linked.graph.nodes
    )
    modes = options.alias, options.heap, options.poison, options.shuffle
    return _structure(expanded.expansion), sources, id(linked.scene), modes


def _declaration(cls: type[Node]) -> tuple[Any, ...]:
    """Return what program text takes from a class besides the recorded steps; a reloaded module may differ in it."""
    words = ("kind", "semantic", "signature")
    return tuple((name, type(p), *(getattr(p, word, None) for word in words)) for name, p in cls.ports().items())


def _structure(expansion: Expansion) -> tuple[Any, ...]:
    """Return an expansion without the values that can change in an executable."""
    steps = tuple(
        replace(
            step,
            uniforms=tuple((name, None) for name, _ in step.uniforms),
            functions=tuple(replace(f, uniforms=()) for f in step.functions),
        )
        for step in expansion.steps
    )
    resources = tuple(expansion.resources.values())
    return steps, resources, tuple(expansion.outputs.items()), tuple(expansion.views.items())
