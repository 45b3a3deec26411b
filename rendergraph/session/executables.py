"""Compiled pipelines that stay on the GPU, each with its textures."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from typing import Any

from msgspec import Struct, field
from msgspec.structs import replace

from rendergraph.compile import Executable
from rendergraph.declare import Node
from rendergraph.expand import Expansion
from rendergraph.gl.programs import Program
from rendergraph.session.values import Expanded
from rendergraph.stamps import Stamps, modified, replay_reads

MOST = 4
"""Compiled pipelines that are kept."""

MOST_BYTES = 1 << 30
"""Bytes of their textures and buffers together; what was drawn last is kept whatever it takes."""


class _Entry(Struct, eq=False):
    executable: Executable
    files: Stamps

    @property
    def bytes(self) -> int:
        return self.executable.plan.memory.allocated_bytes


class ExecutableCache(Struct, eq=False):
    """The last few that were drawn, as long as their shader files stay as they were.

    Attributes:
        stale: programs of executables that a changed file has ended; some may be in use elsewhere.
    """

    stale: set[Program] = field(default_factory=set)
    _entries: dict[Hashable, _Entry] = field(default_factory=dict)

    def take(self, key: Hashable, losing: Callable[[], None]) -> Executable | None:
        """Look one up, to be drawn next; None where there is none, or one of its files has changed: it is freed then.

        `losing` is called before it is.
        """
        entry = self._entries.pop(key, None)
        if entry is None:
            return None
        if modified(entry.files):
            self.stale |= _programs(entry.executable)
            losing()
            entry.executable.release()
            return None
        replay_reads(entry.files)
        self._entries[key] = entry
        return entry.executable

    def make_room(self, needed: int) -> None:
        """Free the ones that were drawn longest ago, until one more of `needed` bytes may be kept."""
        while self._entries and (
            len(self._entries) >= MOST or needed + sum(entry.bytes for entry in self._entries.values()) > MOST_BYTES
        ):
            self._entries.pop(next(iter(self._entries))).executable.release()

    def add(self, key: Hashable, executable: Executable, files: Stamps) -> None:
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


def key_of(expanded: Expanded) -> Hashable:
    """What decides that a compiled pipeline can be drawn in place of another: all but the values of uniforms."""
    linked, options = expanded.linked, expanded.options
    sources = tuple(
        (node.id, node.type.shaders, node.type.inherited, _declared(node.type.cls)) for node in linked.graph.nodes
    )
    modes = options.alias, options.heap, options.poison, options.shuffle
    return _structure(expanded.expansion), sources, id(linked.scene), modes


def _declared(cls: type[Node]) -> tuple[Any, ...]:
    """What program text takes from a class beside the steps it recorded: a module that is imported anew may differ."""
    words = ("kind", "semantic", "signature")
    return tuple((name, type(p), *(getattr(p, word, None) for word in words)) for name, p in cls.ports().items())


def _structure(expansion: Expansion) -> tuple[Any, ...]:
    """An expansion without the values that can change in a compiled pipeline."""
    steps = tuple(
        replace(
            step,
            uniforms=tuple((name, None) for name, _ in step.uniforms),
            functions=tuple(replace(f, uniforms=()) for f in step.functions),
        )
        for step in expansion.steps
    )
    resources = tuple(expansion.resources.values())
    return steps, resources, tuple(expansion.wanted.items()), tuple(expansion.views.items())


def _programs(executable: Executable) -> set[Program]:
    return {draw.program for steps in executable.steps for step in steps for draw in step.all_draws}
