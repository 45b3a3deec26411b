"""Compiled pipelines that a session keeps, each with its textures."""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from rendergraph.compile import Executable
from rendergraph.gl.programs import Program
from rendergraph.stamps import Stamp, again, changed

MOST = 4
"""Compiled pipelines that are kept."""

MOST_BYTES = 1 << 30
"""Bytes of their textures and buffers together; what was drawn last is kept whatever it takes."""


@dataclass(eq=False)
class _Entry:
    executable: Executable
    files: Mapping[Path, Stamp]

    @property
    def bytes(self) -> int:
        return self.executable.plan.memory.allocated_bytes


@dataclass(eq=False)
class Kept:
    """The last few that were drawn, as long as their shader files stay as they were.

    Attributes:
        stale: programs of executables that a changed file has ended; some may be in use elsewhere.
    """

    stale: set[Program] = field(default_factory=set)
    _entries: dict[Hashable, _Entry] = field(default_factory=dict)

    def take(self, key: Hashable) -> Executable | None:
        """Look one up, to be drawn next; None where there is none or one of its files has changed."""
        entry = self._entries.pop(key, None)
        if entry is None:
            return None
        if changed(entry.files):
            self.stale |= _programs(entry.executable)
            entry.executable.release()
            return None
        again(entry.files)
        self._entries[key] = entry
        return entry.executable

    def make_room(self, needed: int) -> None:
        """Free the ones that were drawn longest ago, until one more of `needed` bytes may be kept."""
        while self._entries and (
            len(self._entries) >= MOST or needed + sum(entry.bytes for entry in self._entries.values()) > MOST_BYTES
        ):
            self._entries.pop(next(iter(self._entries))).executable.release()

    def add(self, key: Hashable, executable: Executable, files: Mapping[Path, Stamp]) -> None:
        """Keep one that has just been compiled from these files."""
        self._entries[key] = _Entry(executable, files)

    def unused(self) -> set[Program]:
        """The stale programs that no kept executable runs; they are forgotten here."""
        used = {program for entry in self._entries.values() for program in _programs(entry.executable)}
        found, self.stale = self.stale - used, set()
        return found

    def clear(self) -> None:
        """Free all."""
        for entry in self._entries.values():
            entry.executable.release()
        self._entries.clear()


def _programs(executable: Executable) -> set[Program]:
    return {draw.program for steps in executable.steps for step in steps for draw in step.all_draws}
