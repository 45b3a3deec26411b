"""Whether a step drew anything, and steps that the device leaves out where it did not."""

from __future__ import annotations

from msgspec import Struct

from rendergraph.gl.device import Device

_ANY_SAMPLES_PASSED, _QUERY_WAIT = 0x8C2F, 0x8E13


class Passed(Struct, eq=False):
    """Whether any sample of what is drawn between `start` and `stop` passed; nobody on the CPU waits for the answer."""

    device: Device
    _glo: int = 0
    _counts: bool = False
    _decides: bool = False

    def start(self) -> None:
        """Begin."""
        if not self._glo:
            self._glo = self.device.raw.make("glCreateQueries", _ANY_SAMPLES_PASSED)
        self.device.raw.glBeginQuery(_ANY_SAMPLES_PASSED, self._glo)
        self._counts = True

    def stop(self) -> None:
        """End."""
        self.device.raw.glEndQuery(_ANY_SAMPLES_PASSED)
        self._counts = False

    def only_if(self) -> None:
        """From here on nothing is drawn if none did."""
        self.device.raw.glBeginConditionalRender(self._glo, _QUERY_WAIT)
        self._decides = True

    def anyway(self) -> None:
        """From here on all is drawn again."""
        self.device.raw.glEndConditionalRender()
        self._decides = False

    def break_off(self) -> None:
        """End what is under way, if anything is: a step was broken off, and others are drawn after it."""
        if self._counts:
            self.stop()
        if self._decides:
            self.anyway()

    def release(self) -> None:
        """Free it."""
        if self._glo:
            self.device.raw.delete("glDeleteQueries", self._glo)
            self._glo = 0
