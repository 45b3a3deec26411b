"""Counts every OpenGL call of a process by name, moderngl's own included.

moderngl and rendergraph ask the context for the address of each function. While `counting` is in force they are given
the address of a few bytes of machine code instead, which add one to a counter and jump to the function. Known for
x86-64 on systems that allow such memory; `available` says so.
"""

from __future__ import annotations

import ctypes
import mmap
import platform
import struct
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

available = platform.machine() in ("x86_64", "AMD64") and platform.system() == "Linux"
_MOST = 4096


class Calls:
    """Functions that were asked for, and how often each has been called."""

    def __init__(self) -> None:
        self._counters = (ctypes.c_uint64 * _MOST)()
        self._code = mmap.mmap(-1, _MOST * 32, prot=mmap.PROT_READ | mmap.PROT_WRITE | mmap.PROT_EXEC)
        self._base = ctypes.addressof(ctypes.c_char.from_buffer(self._code))
        self._slots: dict[tuple[str, int], int] = {}

    def stub(self, name: str, target: int) -> int:
        """The address of code that counts and goes on to `target`."""
        if not target:
            return target
        slot = self._slots.setdefault((name, target), len(self._slots))
        counter = ctypes.addressof(self._counters) + 8 * slot
        # mov r11, counter; inc qword [r11]; mov r11, target; jmp r11. No argument is passed in r11.
        self._code[32 * slot : 32 * slot + 26] = (
            b"\x49\xbb"
            + struct.pack("<Q", counter)
            + b"\x49\xff\x03"
            + b"\x49\xbb"
            + struct.pack("<Q", target)
            + b"\x41\xff\xe3"
        )
        return self._base + 32 * slot

    def taken(self) -> Counter[str]:
        """Calls so far, by name."""
        counts: Counter[str] = Counter()
        for (name, _), slot in self._slots.items():
            counts[name] += self._counters[slot]
        return +counts


class _Context:
    """A glcontext context whose functions are counted."""

    def __init__(self, context: Any, calls: Calls) -> None:
        self._context, self._calls = context, calls

    def load(self, name: str) -> int:
        return self._calls.stub(name, self._context.load(name))

    load_opengl_function = load

    def __enter__(self) -> Any:
        return self._context.__enter__()

    def __exit__(self, *error: Any) -> Any:
        return self._context.__exit__(*error)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._context, name)


@contextmanager
def counting() -> Iterator[Calls]:
    """Count the calls of all contexts opened inside."""
    from glcontext import egl  # type: ignore[import-untyped]

    calls, original = Calls(), egl.create_context
    egl.create_context = lambda **settings: _Context(original(**settings), calls)
    try:
        yield calls
    finally:
        egl.create_context = original


def made(counts: Counter[str]) -> int:
    """How many of the calls create objects."""
    creates = ("glGen", "glCreate", "glFenceSync", "glTextureView")
    return sum(
        n
        for name, n in counts.items()
        if name.startswith(creates) and name != "glGenerateTextureMipmap" and name != "glGenerateMipmap"
    )
