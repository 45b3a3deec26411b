"""Values that the CPU computes for textures and buffers, recomputed only if their sources have changed."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy.typing as npt
from msgspec import Struct

from rendergraph.compile.gpu_scene import GpuScene
from rendergraph.compile.memory import Memory
from rendergraph.errors import Misuse, Place, shown_file
from rendergraph.gl import textures
from rendergraph.scene.facts import FrameScene
from rendergraph.steps import Step, Upload
from rendergraph.steps.checks import texels

SCENE_CHANGES = {
    "transforms": "instances",
    "lights": "light_block",
    "materials": "material_block",
    "environment": "environment_block",
    "camera": "camera",
}
"""The parts of a scene that can change, by the counters of `GpuScene.changes`."""


class UploadedValues(Struct, eq=False):
    """The values of one upload step; `step` returns it with the current parameters of its node."""

    step: Callable[[], Step]
    scene: GpuScene
    memory: Memory
    _array: npt.NDArray[Any] | None = None
    _made_of: object = None

    @property
    def is_stale(self) -> bool:
        """Return whether the values must be computed, for the first time or again."""
        return self._made_of != self._sources

    @property
    def _sources(self) -> object:
        upload = self.upload
        return upload, [self.scene.changes[SCENE_CHANGES[source]] for source in upload.sources]

    @property
    def upload(self) -> Upload:
        """The upload of the step."""
        found = dict(self.step().uniforms)["values"]
        assert isinstance(found, Upload)
        return found

    def compute(self) -> None:
        """Compute the values; exceptions of third-party functions propagate."""
        values, (write,) = self.upload.values, self.step().writes
        if callable(values):
            desc = self.memory.plan.resources[write.resource].desc
            code = getattr(getattr(values, "__func__", values), "__code__", None)
            array = values(FrameScene(self.scene.scene, decode=self.scene.decode))
            try:
                values = texels(write.name, array, desc, write.mip, write.layer)
            except Misuse as error:  # the function has returned, so its first line is the closest place
                place = Place(shown_file(code.co_filename), code.co_firstlineno, 1) if code is not None else None
                raise Misuse(str(error), error.code, place) from None
        self._array, self._made_of = values, self._sources

    def write(self, parity: int) -> None:
        """Upload the values."""
        (write,) = self.step().writes
        assert self._array is not None
        if write.use == "buffer":
            self.memory.buffer(write.resource, parity).write(self._array)
        else:
            texture = self.memory.texture(write.resource, parity)
            textures.upload(self.memory.device, texture, self._array, mip=write.mip or 0, layer=write.layer)
