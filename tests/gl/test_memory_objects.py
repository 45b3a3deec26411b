"""Textures of any description in one block of memory: the same pictures, and what is said where a device has none."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import permutations
from typing import Any

import numpy as np
import pytest

import rendergraph as rg
from rendergraph.errors import RenderError
from rendergraph.gl.memory_objects import MemoryBlock, make_blocks
from rendergraph.gl.textures import Clear, read
from rendergraph.textures import TextureDesc

DESCS = [
    TextureDesc("texture2d", "rgba16f", 33, 17),
    TextureDesc("texture2d", "depth32f", 64, 16),
    TextureDesc("texture2d_array", "r16", 20, 20, layers=3),
    TextureDesc("texture_cube", "rgba8", 16, 16, layers=6),
    TextureDesc("texture2d", "r11f_g11f_b10f", 40, 24, mips=3),
]


@pytest.fixture(autouse=True)
def _able(gl: rg.Session) -> None:
    """Skip where the device has no memory objects."""
    try:
        with gl.device.current():
            for block in make_blocks(gl.device, [DESCS[:1]]):
                block.release()
    except RenderError as error:
        pytest.skip(str(error))


@pytest.fixture
def block(gl: rg.Session) -> Iterator[MemoryBlock]:
    with gl.device.current():
        made = make_blocks(gl.device, [DESCS])[0]
        yield made
        made.release()


def test_each_holds_its_own_until_another_is_written(gl: rg.Session, block: MemoryBlock) -> None:
    def texels(desc: TextureDesc) -> Any:
        found = read(gl.device, block.textures[desc], layer=0)[..., 0]
        return found / 255 if found.dtype == np.uint8 else found

    for one, other in permutations(DESCS, 2):
        Clear(gl.device, block.textures[one], 1.0)()
        np.testing.assert_array_equal(texels(one), 1.0)
        Clear(gl.device, block.textures[other], 0.25)()
        np.testing.assert_allclose(texels(other), 0.25, atol=0.002)
        assert texels(one)[0, -1, 0] != 1.0  # where memory begins
    assert gl.device.raw.error() is None


def test_nothing_is_left_of_it(gl: rg.Session) -> None:
    with gl.device.current():
        made = make_blocks(gl.device, [DESCS, DESCS[:2]])
        names = [texture.glo for block in made for texture in block.textures.values()]
        assert all(gl.device.raw.glIsTexture(name) for name in names)
        for block in made:
            block.release()
        assert not any(gl.device.raw.glIsTexture(name) for name in names)
        assert gl.device.raw.error() is None


@pytest.mark.nightly(keep=2)
@pytest.mark.parametrize(
    "name",
    [
        "shadow-vsm",
        *(pytest.param(name, marks=pytest.mark.slow) for name in ("forward-msaa", "ssao-hemisphere", "taa")),
    ],
)
def test_pictures_are_the_same_to_the_bit(gl: rg.Session, name: str) -> None:
    """Frame after frame, with and without reuse, and with what is released overwritten."""
    loaded = rg.load(name, size=(48, 27), sets=("sun.resolution=64",), scene="shadow_study")
    plain = list(gl.frames(loaded, frames=range(1, 3)))
    assert loaded.plan(heap=True).memory.tier == "heap"
    for poison in (False, True):
        shared = gl.frames(loaded, frames=range(1, 3), heap=True, poison=poison)
        for one, other in zip(plain, shared, strict=True):
            for output in ("image", "radiance"):
                np.testing.assert_array_equal(one[output], other[output])


def test_a_device_of_another_api_is_refused(gl: rg.Session, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(gl.device.raw, "glGetUnsignedBytei_vEXT", lambda *_: None, raising=False)
    with gl.device.current(), pytest.raises(RenderError, match="Vulkan does not offer the device that OpenGL uses"):
        make_blocks(gl.device, [DESCS])
