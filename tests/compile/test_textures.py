"""Textures of materials: how they are filtered."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest

import rendergraph as rg
from rendergraph.compile import gpu_scene

FLOOR = """scene: 1
objects: {floor: {shape: plane, size: [40, 40], at: [0, 0, -15], material: stripes}}
materials: {stripes: {base_color: [1, 1, 1], unlit: true, base_color_texture: stripes.png}}
cameras: {main: {eye: [0, 0.7, 4], target: [0, 0, -4], fov_y_degrees: 40, near: 0.05, far: 100}}
"""


def striped(folder: Path) -> Path:
    """A floor whose texture has 64 stripes along the way one looks."""
    iio = pytest.importorskip("OpenImageIO")
    texels = np.zeros((512, 512, 3), np.uint8)
    texels[:, np.arange(512) // 4 % 2 == 1] = 255
    image = iio.ImageOutput.create(str(folder / "stripes.png"))
    image.open(str(folder / "stripes.png"), iio.ImageSpec(512, 512, 3, "uint8"))
    image.write_image(texels)
    image.close()
    (folder / "floor.yaml").write_text(FLOOR)
    return folder / "floor.yaml"


@pytest.mark.slow
def test_what_is_seen_at_an_angle_stays_sharp_along_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    scene = striped(tmp_path)

    def drawn(size: tuple[int, int]) -> npt.NDArray[np.float64]:
        with rg.Session() as session:  # samplers are the session's
            pipeline = rg.load("forward", scene=scene, size=size)
            return np.asarray(session.render(pipeline, outputs=["radiance"])["radiance"][..., 0], np.float64)

    sharp = drawn((96, 54))
    monkeypatch.setattr(gpu_scene, "_ANISOTROPY", 1)
    blurred = drawn((96, 54))
    exact = drawn((96 * 8, 54 * 8)).reshape(54, 8, 96, 8).mean(axis=(1, 3))
    below = np.s_[30:]  # the floor; beyond it nothing is
    off = [float(np.sqrt(((picture - exact)[below] ** 2).mean())) for picture in (sharp, blurred)]
    assert off[0] < 0.5 * off[1], off
