"""Texture units: each pair of texture and sampler has its own, bound once per frame.

If a pipeline has more pairs than the driver has units, the last units are shared, and steps bind them themselves. If
full-screen draws of one program read different textures through one sampler (a chain of blurs), the sampler keeps its
unit and each draw binds its texture there: drivers validate a program again when its samplers change units.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from functools import partial
from typing import Any

from msgspec import Struct, field

from rendergraph.gl.device import Device

SHARED_UNITS = 24


class Units(Struct, eq=False):
    """Assigns units while compiling, and binds them once per frame."""

    device: Device
    parities: int
    parity: int = 0
    _pairs: dict[tuple[tuple[int, ...], int], int] = field(default_factory=dict)
    _changing: list[int] = field(default_factory=list)
    _wrapped: dict[int, Any] = field(default_factory=dict)

    def unit(self, textures: tuple[int, ...], sampler: int, taken: list[Callable[[], object]]) -> int:
        """Return the unit of a texture (one GL name per parity) with a sampler.

        `taken` collects the bindings that the draw must make itself; it stays empty unless units run out.
        """
        pair = (textures, sampler)
        if pair in self._pairs:
            return self._pairs[pair]
        own = self._own
        if len(self._pairs) < own:
            self._pairs[pair] = len(self._pairs)
            return self._pairs[pair]
        unit = own + sum(isinstance(call, partial) and call.func == self._rebind for call in taken)
        taken.append(partial(self._rebind, unit, textures, sampler))
        return unit

    def _rebind(self, unit: int, textures: tuple[int, ...], sampler: int) -> None:
        self.device.raw.glBindTextureUnit(unit, textures[self.parity % len(textures)])
        self.device.raw.glBindSampler(unit, sampler)

    @property
    def _own(self) -> int:
        return self.device.limits["units"] - SHARED_UNITS

    def changing(self, sampler: int) -> int | None:
        """Return a unit with a sampler whose texture draws bind; None if all are taken. Call it after `unit`."""
        if len(self._pairs) + len(self._changing) >= self._own:
            return None
        self._changing.append(sampler)
        return len(self._pairs) + len(self._changing) - 1

    def bind(self, texture: int, unit: int) -> Callable[[], object]:
        """Return a call that binds a plain 2D texture; moderngl's takes a quarter of the time of a raw one."""
        if texture not in self._wrapped:
            self._wrapped[texture] = self.device.ctx.external_texture(texture, (1, 1), 4, 0, "f1")
        return partial(self._wrapped[texture].use, unit)

    def binds(self) -> list[list[Callable[[], object]]]:
        """Return the calls that bind everything, one list per parity."""
        raw = self.device.raw
        pairs = [*self._pairs, *(((0,), sampler) for sampler in self._changing)]
        count = len(pairs)
        result: list[list[Callable[[], object]]] = []
        for parity in range(self.parities):
            names = (ctypes.c_uint * count)(*(t[parity % len(t)] for t, _ in pairs))
            samplers = (ctypes.c_uint * count)(*(sampler for _, sampler in pairs))
            calls: list[Callable[[], object]] = []
            if count:
                calls += [partial(raw.glBindTextures, 0, count, names), partial(raw.glBindSamplers, 0, count, samplers)]
            if self.parities > 1:
                calls.append(partial(setattr, self, "parity", parity))
            result.append(calls)
        return result
