"""What stays on the GPU from one drawing to the next: programs, a scene, compiled pipelines."""

from __future__ import annotations

from collections.abc import Hashable
from typing import TYPE_CHECKING, Any

from rendergraph import stamps
from rendergraph.compile import Executable, GpuScene, KeptValues, ProgramCache, compile_plan
from rendergraph.errors import Problem
from rendergraph.gl.device import Device
from rendergraph.gl.memory import check_memory
from rendergraph.images import decode, decode_light
from rendergraph.scene import pack
from rendergraph.scene.model import ImageSource, MadeImage, Scene
from rendergraph.session.executables import ExecutableCache, key_of
from rendergraph.session.scenes import scene_limits
from rendergraph.session.values import Expanded, Linked, Planned

if TYPE_CHECKING:
    import numpy.typing as npt


class GpuCache:
    """Programs, and what kept steps have made, live as long as it does; one scene, and the last few pipelines compiled
    for it, until others come.

    Attributes:
        programs: the programs that were compiled.
        scenes_made: how many scenes have been put on the GPU so far.
        image_warnings: what was replaced in the images of the scene that is there.
        active: what was compiled or taken last.
        drawing: who draws it; whoever drew before comes too late.
    """

    def __init__(self, device: Device) -> None:
        self._device = device
        self.programs = ProgramCache(device)
        self.scenes_made = 0
        self.image_warnings: list[Problem] = []
        self.active: Executable | None = None
        self.drawing: object = None
        self._kept = KeptValues(device)
        self._executables = ExecutableCache()
        self._scene: tuple[Scene, GpuScene] | None = None

    def upload(self, linked: Linked) -> GpuScene:
        """A pipeline's scene on the GPU, in place of another that was there.

        Raises:
            InputError: the environment that was named cannot be decoded.
        """
        if self._scene is not None and self._scene[0] is linked.scene:
            return self._scene[1]
        self._forget()
        limits = scene_limits(linked.selection)
        warnings: list[Problem] = []

        def decoded(source: ImageSource, srgb: bool) -> npt.NDArray[Any]:
            return decode(source, srgb=srgb, warn=warnings.append, limits=limits)

        def around(source: ImageSource | MadeImage) -> npt.NDArray[Any]:
            return decode_light(source, warn=warnings.append, limits=limits)

        self.scenes_made += 1
        self.image_warnings = warnings
        scene = GpuScene(self._device, linked.scene, pack.pack(linked.scene), decoded, around)
        if linked.selection.environment is not None:
            scene.environment()  # named by the user: a broken one is said, used or not
        self._scene = linked.scene, scene
        return scene

    def take(self, expanded: Expanded) -> tuple[Hashable, Executable | None]:
        """What was compiled of the same before, with the values of these steps, and the key it is kept by."""
        key = key_of(expanded)
        executable = self._executables.take(key, losing=self._save)
        if executable is not None:
            values = {step.key: step for step in expanded.expansion.steps}
            if executable is not self.active or not executable.changed(values).isdisjoint(executable.kept):
                self._save()
            executable.set_uniforms(values)
            self._kept.restore(executable)
        return key, executable

    def make(self, key: Hashable, planned: Planned, scene: GpuScene) -> Executable:
        """Compile a plan, and keep it in place of those that were drawn longest ago.

        Raises:
            InputError: a mistake in a shader.
            RenderError: the device cannot hold it.
        """
        self._save()
        linked, needed = planned.linked, planned.plan.memory.allocated_bytes
        types = {node.id: node.type for node in linked.graph.nodes}
        self._executables.make_room(needed)
        check_memory(self._device, needed, linked.selection.allowed("plan").get("memory"))
        views, poison = planned.expansion.views, planned.options.poison
        with stamps.track_reads() as files:
            executable = compile_plan(self._device, planned.plan, types, views, scene, self.programs, poison=poison)
        self._executables.add(key, executable, files)
        executable.shares_kept = planned.options.shares
        self._kept.restore(executable)
        self.programs.discard(self._executables.unused())
        return executable

    def release(self) -> None:
        """Free everything."""
        self.active = None  # nobody is left to pass anything on to
        self._forget()
        self._kept.release()
        self.programs.release()

    def _save(self) -> None:
        """What was drawn last has made, others may want: this comes before it is lost or something else is drawn."""
        if self.active is not None:
            self._kept.save(self.active)

    def _forget(self) -> None:
        """Free the scene and all that was compiled for it."""
        self._save()
        self._executables.clear()
        self.active = self.drawing = None
        scene, self._scene = self._scene, None  # what follows may fail, and a released scene must not be met again
        if scene is not None:
            scene[1].release(self.programs)
