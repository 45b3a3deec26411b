"""Time on the device, by queries around leaf steps (nested ones are an error in OpenGL)."""

from __future__ import annotations

import ctypes

from msgspec import Struct

from rendergraph.gl.device import TIME_ELAPSED, Device

_QUERY_RESULT = 0x8866
_NO_ANSWER = 1 << 40
"""Nanoseconds, 18 minutes: a driver that has nothing to say answers with its largest number."""


class Timer(Struct, eq=False):
    """Measures what is drawn between `start` and `stop`; its query is made when it is first started."""

    device: Device
    _glo: int = 0

    def start(self) -> None:
        """Begin."""
        if not self._glo:
            self._glo = self.device.raw.make("glCreateQueries", TIME_ELAPSED)
        self.device.raw.glBeginQuery(TIME_ELAPSED, self._glo)

    def stop(self) -> None:
        """End; the answer comes when the device is done."""
        self.device.raw.glEndQuery(TIME_ELAPSED)

    def milliseconds(self) -> float | None:
        """What it took, None where the driver does not know; waits for the device."""
        nanoseconds = ctypes.c_uint64()
        self.device.raw.glGetQueryObjectui64v(self._glo, _QUERY_RESULT, ctypes.byref(nanoseconds))
        return None if nanoseconds.value >= _NO_ANSWER else nanoseconds.value * 1e-6

    def release(self) -> None:
        """Free it."""
        if self._glo:
            self.device.raw.delete("glDeleteQueries", self._glo)
