"""Clearing textures that share storage: every format in the storage of every other of its texel class."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

import rendergraph as rg
from rendergraph.allocate import Physical
from rendergraph.compile.memory import Memory, TexturePool
from rendergraph.gl import textures
from rendergraph.gl.state import settle
from rendergraph.steps import Resource
from rendergraph.textures import FORMATS, TextureDesc

VALUES = {"uint": (3.0, 5.0, 7.0, 9.0), "int": (-3.0, 5.0, 7.0, 9.0)}
COLOR = (0.25, 0.5, 0.75, 1.0)
BYTE = 1 / 255
STEP = {"rgb10_a2": 1 / 1023, "r11f_g11f_b10f": 1 / 64, "r8": BYTE, "rg8": BYTE, "rgba8": BYTE, "srgb8_a8": BYTE}
SHARED = sorted(
    (one.name, other.name)
    for one in FORMATS.values()
    for other in FORMATS.values()
    if one.name != other.name and one.view_class == other.view_class
)


def memory_of(device: Any, storage: str, viewed: str) -> Memory:
    """One texture of three layers and two mips that two resources live in."""
    descs = {name: TextureDesc("texture2d_array", name, 8, 4, layers=3, mips=2) for name in (storage, viewed)}
    plan: Any = SimpleNamespace(
        physicals=(Physical(0, descs[storage], (storage, viewed), descs[storage].bytes),),
        placement=dict.fromkeys(descs, (0,)),
        resources={name: Resource(name, desc) for name, desc in descs.items()},
    )
    return Memory(device, plan, pytest.fail, TexturePool(device))


def expected(name: str) -> npt.NDArray[np.float64]:
    fmt = FORMATS[name]
    return np.array(VALUES.get(fmt.family, COLOR)[: fmt.components])


def texels(device: Any, memory: Memory, name: str, mip: int) -> npt.NDArray[np.float64]:
    found = textures.read(device, memory.texture(name), mip=mip).astype(np.float64)
    return found / 255 if FORMATS[name].is_bytes and not FORMATS[name].srgb else found


@pytest.mark.parametrize(("storage", "viewed"), SHARED)
def test_a_view_holds_what_it_is_cleared_to(gl: rg.Session, storage: str, viewed: str) -> None:
    with gl.current():
        settle(gl.device.raw)
        memory = memory_of(gl.device, storage, viewed)
        try:
            for name in (storage, viewed):
                for call in memory.clear(name, 0, VALUES.get(FORMATS[name].family, COLOR)):
                    call()
                for mip in (0, 1):
                    found = texels(gl.device, memory, name, mip)
                    wanted = np.broadcast_to(expected(name), found.shape)
                    np.testing.assert_allclose(found, wanted, atol=STEP.get(name, 1 / 65535))
            for call in memory.clear(viewed, 0, 0.0, mip=1, layer=2):
                call()
            np.testing.assert_array_equal(texels(gl.device, memory, viewed, 1)[2], 0)
            for found in (texels(gl.device, memory, viewed, 0), texels(gl.device, memory, viewed, 1)[:2]):
                wanted = np.broadcast_to(expected(viewed), found.shape)
                np.testing.assert_allclose(found, wanted, atol=STEP.get(viewed, 1 / 65535))
            assert gl.device.raw.error() is None
        finally:
            memory.release()


def test_what_is_too_large_to_be_read_at_once_is_read_in_parts(gl: rg.Session, monkeypatch: pytest.MonkeyPatch) -> None:
    values = np.arange(3 * 7 * 5 * 4, dtype=np.float32).reshape(3, 7, 5, 4)
    with gl.current():
        texture = textures.create(gl.device, TextureDesc("texture2d_array", "rgba16f", 5, 7, layers=3))
        textures.upload(gl.device, texture, values)
        whole = textures.read(gl.device, texture)
        np.testing.assert_array_equal(whole, values[:, ::-1])
        for most in (1, 5 * 16 * 2, 5 * 16 * 7):
            monkeypatch.setattr(textures, "MOST_READ", most)
            np.testing.assert_array_equal(textures.read(gl.device, texture), whole)
            np.testing.assert_array_equal(textures.read(gl.device, texture, layer=1), whole[1:2])
        textures.delete(gl.device, texture)


def test_ten_bits_are_read_as_ten_bits(gl: rg.Session) -> None:
    levels = np.arange(1024, dtype=np.float32) / 1023
    with gl.current():
        texture = textures.create(gl.device, TextureDesc("texture2d", "rgb10_a2", 1024, 1))
        textures.upload(gl.device, texture, np.stack([levels] * 4, axis=-1)[None, None])
        found = textures.read(gl.device, texture)[0, 0]
        textures.delete(gl.device, texture)
    np.testing.assert_allclose(found[:, :3], np.stack([levels] * 3, axis=-1), atol=1e-6)
    np.testing.assert_allclose(found[:, 3], np.round(levels * 3) / 3, atol=1e-6)
