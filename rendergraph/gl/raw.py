"""The OpenGL functions that moderngl lacks, as a small table over the driver's own loader.

PyOpenGL would do the same at 0.13 s of import time; these prototypes take well under a millisecond.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from pathlib import Path
from typing import Any

_TYPES: dict[str, Any] = {
    "v": None, "u": ctypes.c_uint, "i": ctypes.c_int, "f": ctypes.c_float, "d": ctypes.c_double, "b": ctypes.c_ubyte,
    "q": ctypes.c_uint64, "s": ctypes.c_ssize_t, "p": ctypes.c_void_p,
}  # fmt: skip
_TABLE = Path(__file__).with_name("functions.txt").read_text(encoding="ascii")
PROTOTYPES = {name: letters for letters, *names in map(str.split, _TABLE.splitlines()) for name in names}
"""Functions with the letters of their result and arguments."""

_ERRORS = {
    0x500: "INVALID_ENUM", 0x501: "INVALID_VALUE", 0x502: "INVALID_OPERATION", 0x503: "STACK_OVERFLOW",
    0x504: "STACK_UNDERFLOW", 0x505: "OUT_OF_MEMORY", 0x506: "INVALID_FRAMEBUFFER_OPERATION",
}  # fmt: skip


class RawGL:
    """Raw functions by name, without moderngl's checks: `raw.glDepthFunc(0x0203)`.

    A function that the driver lacks raises AttributeError on first use.
    """

    def __init__(self, load: Callable[[str], int]) -> None:
        self._load = load

    def __getattr__(self, name: str) -> Any:
        if name not in PROTOTYPES:
            raise AttributeError(name)
        address = self._load(name)
        if not address:
            raise AttributeError(f"this driver has no {name}")
        function = ctypes.CFUNCTYPE(*[_TYPES[letter] for letter in PROTOTYPES[name]])(address)
        setattr(self, name, function)  # the next look-up finds the attribute
        return function

    def make(self, function: str, *arguments: int) -> int:
        """Return one new name from a `glCreate…` or `glGen…` function."""
        name = ctypes.c_uint()
        getattr(self, function)(*arguments, 1, ctypes.byref(name))
        return name.value

    def delete(self, function: str, name: int) -> None:
        getattr(self, function)(1, ctypes.byref(ctypes.c_uint(name)))

    def integer(self, parameter: int, *index: int) -> int:
        value = ctypes.c_int()
        (self.glGetIntegeri_v if index else self.glGetIntegerv)(parameter, *index, ctypes.byref(value))
        return value.value

    def current_query(self, target: int) -> int:
        """Return the active query of a target, 0 if there is none."""
        value = ctypes.c_int()
        self.glGetQueryiv(target, 0x8865, ctypes.byref(value))
        return value.value

    def error(self) -> str | None:
        """Return the name of the first pending GL error, None if there is none; clears them all."""
        first: int = self.glGetError()
        code = first
        while code:
            code = self.glGetError()
        return _ERRORS.get(first, hex(first)) if first else None
