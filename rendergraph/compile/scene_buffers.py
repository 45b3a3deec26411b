"""The buffers behind inputs of `SceneData`, made when a step first reads them and kept with the scene."""

from __future__ import annotations

import moderngl
import numpy as np
import numpy.typing as npt
from msgspec import Struct

from rendergraph.gl.device import Device
from rendergraph.scene import scene_data
from rendergraph.scene.model import Scene
from rendergraph.scene.pack import PackedScene, Records


class SceneBuffers(Struct, eq=False):
    """Storage buffers by the names of their blocks in `scene.glsl`.

    Attributes:
        instances: the records that the instance buffer holds.
    """

    buffers: dict[str, moderngl.Buffer]
    instances: Records

    @classmethod
    def make(cls, device: Device, scene: Scene, packed: PackedScene) -> SceneBuffers:
        """Upload all buffers of a scene."""
        instances = scene_data.instance_data(scene, packed)
        arrays: dict[str, npt.NDArray[np.generic]] = {
            "scene_vertex_block": scene_data.vertex_data(packed),
            "scene_index_block": packed.indices,
            "scene_instance_block": instances,
            "scene_emitter_block": scene_data.emitter_data(scene, packed),
        }
        buffers = {name: device.ctx.buffer(array.tobytes() or bytes(128)) for name, array in arrays.items()}
        return cls(buffers, instances)

    def release(self) -> None:
        for buffer in self.buffers.values():
            buffer.release()
