"""Queries around single steps, because OpenGL does not nest them: time, and whether anything was drawn."""

from __future__ import annotations

import ctypes
from typing import ClassVar

from msgspec import Struct

from rendergraph.gl.device import TIME_ELAPSED, Device

_ANY_SAMPLES_PASSED, _QUERY_WAIT, _QUERY_RESULT = 0x8C2F, 0x8E13, 0x8866
_NO_ANSWER = 1 << 40
"""Nanoseconds, 18 minutes: a driver without an answer returns its largest number."""


class _Query(Struct, eq=False):
    target: ClassVar[int]

    device: Device
    _glo: int = 0  # created when the query is first started
    _started: bool = False

    def start(self) -> None:
        if not self._glo:
            self._glo = self.device.raw.make("glCreateQueries", self.target)
        self.device.raw.glBeginQuery(self.target, self._glo)
        self._started = True

    def stop(self) -> None:
        self.device.raw.glEndQuery(self.target)
        self._started = False

    def release(self) -> None:
        if self._glo:
            self.device.raw.delete("glDeleteQueries", self._glo)
            self._glo = 0


class Timer(_Query):
    """Measures what is drawn between `start` and `stop`."""

    target = TIME_ELAPSED

    def milliseconds(self) -> float | None:
        """Return the time, or None if the driver has no answer; waits for the device."""
        nanoseconds = ctypes.c_uint64()
        self.device.raw.glGetQueryObjectui64v(self._glo, _QUERY_RESULT, ctypes.byref(nanoseconds))
        return None if nanoseconds.value >= _NO_ANSWER else nanoseconds.value * 1e-6


class OcclusionQuery(_Query):
    """Whether any sample drawn between `start` and `stop` passed; the device decides, so the CPU never waits."""

    target = _ANY_SAMPLES_PASSED

    _conditional: bool = False

    def begin_conditional(self) -> None:
        """Skip the following draws if no sample passed."""
        self.device.raw.glBeginConditionalRender(self._glo, _QUERY_WAIT)
        self._conditional = True

    def end_conditional(self) -> None:
        self.device.raw.glEndConditionalRender()
        self._conditional = False

    def abort(self) -> None:
        """End an active query or condition after a step was interrupted, because others are drawn later."""
        if self._started:
            self.stop()
        if self._conditional:
            self.end_conditional()
