"""Programs by source, cached while they are used or recently used; errors are located at the author's line."""

from __future__ import annotations

import ctypes
import os
from collections.abc import Iterable, Mapping, Sequence, Set
from typing import Any

from msgspec import Struct, field

from rendergraph.errors import InputError
from rendergraph.gl import programs
from rendergraph.gl.device import Device
from rendergraph.gl.programs import UNIFORM_BLOCK, Program
from rendergraph.program import StageText, used_blocks
from rendergraph.resources import folder


class ProgramCache(Struct, eq=False):
    """Programs by text, outputs and binding points of blocks, least recently used first.

    Attributes:
        limit: maximum number of programs; those of cached executables always stay.
    """

    device: Device
    limit: int
    compiled: int = 0
    _compiled_before: int = 0
    _programs: dict[tuple[object, ...], Program] = field(default_factory=dict)
    _vertex_arrays: dict[tuple[object, ...], Any] = field(default_factory=dict)

    def get(self, texts: Mapping[str, StageText], blocks: Mapping[str, int], outputs: Sequence[str]) -> Program:
        sources = {stage: text.text for stage, text in texts.items()}
        key = (*sources.items(), tuple(outputs), tuple(sorted(blocks.items())))
        if key in self._programs:
            program = self._programs[key] = self._programs.pop(key)
            return program
        shipped = os.path.join(folder("rendergraph.shaders"), "")
        for text in texts.values():
            if not all(str(file).startswith(shipped) for file in text.source.files):
                from rendergraph.glsl.expansion import check_expansion  # shipped shaders need no check

                check_expansion(text.source)
        stored = _beyond_limit(sources.values()) if self.device.stores_blocks else ()
        try:
            program = programs.link(self.device, sources, outputs, stored)
        except programs.ProgramError as error:
            from rendergraph.program.messages import compile_problems, link_problems  # only for errors of the driver

            stage, message = programs.driver_message(error)
            failed = texts.get(stage or "")
            raise InputError(compile_problems(message, failed) if failed else link_problems(message, texts)) from error
        for name, binding in blocks.items():
            program.bind_block(name, binding)
        self._programs[key] = program
        self.compiled += 1
        return program

    def vertex_array(self, program: Program, key: tuple[object, ...], content: Any, index: Any = None) -> Any:
        """Return a program's vertex array over buffers, created once; `content` is moderngl's."""
        full = (program.glo, *key)
        if full not in self._vertex_arrays:
            self._vertex_arrays[full] = self.device.ctx.vertex_array(program.object, content, index)
        return self._vertex_arrays[full]

    def forget(self, marker: object) -> None:
        """Free the vertex arrays over buffers that are released; `marker` is the first part of their keys."""
        for key in [key for key in self._vertex_arrays if len(key) > 1 and key[1] == marker]:
            self._vertex_arrays.pop(key).release()

    def trim(self, used: Set[Program]) -> None:
        """Free the least recently used programs that are not `used`: each costs Mesa's software driver about 3 MB."""
        unused = [key for key, program in self._programs.items() if program not in used]
        for key in unused[: max(0, len(self._programs) - self.limit)]:
            program = self._programs.pop(key)
            for full in [full for full in self._vertex_arrays if full[0] == program.glo]:
                self._vertex_arrays.pop(full).release()
            program.release()
        for key in [key for key, program in self._programs.items() if program in used]:
            self._programs[key] = self._programs.pop(key)
        if self.compiled != self._compiled_before:
            self._compiled_before = self.compiled
            _return_free_memory()

    def release(self) -> None:
        for table in (self._vertex_arrays, self._programs):
            while table:
                table.popitem()[1].release()


def _beyond_limit(texts: Iterable[str]) -> set[str]:
    """Return the blocks that become storage blocks so that no stage declares more than two uniform blocks.

    Views come last: helper invocations, which derivatives need, read nothing from storage blocks.
    """
    stored: set[str] = set()
    for text in texts:
        used = used_blocks(text)
        names = set(UNIFORM_BLOCK.findall(text))
        stored |= set(sorted(names, key=lambda name: (name not in used, not name.endswith("_view_block"), name))[2:])
    return stored


def _return_free_memory() -> None:
    """Return the C library's free heap to the system: compiling leaves several times the size of the programs."""
    malloc_trim = getattr(ctypes.CDLL(None), "malloc_trim", None)  # only in glibc
    if malloc_trim is not None:
        malloc_trim(0)
