"""What a scene's buffers hold while objects move, and how much of them is written."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from msgspec.structs import replace

from rendergraph.compile import gpu_scene
from rendergraph.compile.gpu_scene import GpuScene
from rendergraph.scene import pack
from rendergraph.scene.model import Material, Mesh, Object, Scene
from rendergraph.scene.scene_data import instance_data

if TYPE_CHECKING:
    import pytest

POINTS = np.eye(3, dtype=np.float32)
TRIANGLE = Mesh("t", POINTS, np.array([[0, 1, 2]], np.uint32), POINTS)
COUNT = 100


def _placed(random: np.random.Generator) -> Object:
    transform = np.eye(4)
    transform[:3, 3] = random.normal(size=3)
    return Object("o", 0, 0, transform)


def test_only_records_of_what_has_moved_are_written(gl: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of any set of objects, in this frame's buffer and in that of the frame before."""
    random = np.random.default_rng(2)
    scene = Scene("s", objects=tuple(_placed(random) for _ in range(COUNT)), meshes=(TRIANGLE,))
    scene = replace(scene, materials=(Material("m"),))
    written: list[int] = []
    write = gpu_scene.write_records

    def count(buffer: Any, records: Any, numbers: Any) -> None:
        written.append(len(numbers))
        write(buffer, records, numbers)

    monkeypatch.setattr(gpu_scene, "write_records", count)
    with gl.device.current():
        made = GpuScene(gl.device, scene, pack.pack(scene), None, None)  # type: ignore[arg-type]  # it has no images
        before, data = made.previous(), made.data
        for moving in (0, 1, 2, 80, 1, 0, 0, 3):  # 80 of 100 are too many runs to be written one by one
            was = made.packed.instances.tobytes()
            made.advance()
            objects = list(scene.objects)
            for number in random.choice(COUNT, moving, replace=False):
                objects[number] = _placed(random)
            scene = replace(scene, objects=tuple(objects))
            made.update(scene)
            assert made._instances.read() == made.packed.instances.tobytes() == pack.pack(scene).instances.tobytes()
            assert before.read() == was
            records = instance_data(scene, pack.pack(scene))
            assert data.buffers["scene_instance_block"].read() == records.tobytes()
        made.release(gl.cache.programs)
    assert written == [1, 1, 1, 2, 2, 2, 80, 80, 80, 1, 1, 1, 3, 3]  # both buffers, then that of the frame before
