"""Limit the memory of a plan to what the driver reports as free on the device, or to what the machine has."""

from __future__ import annotations

import ctypes
import os

from rendergraph import system
from rendergraph.errors import Problem, RenderError, UsageError
from rendergraph.gl.device import Device

VARIABLE = "RENDERGRAPH_MEMORY_LIMIT"
_NVX_CURRENT_AVAILABLE, _ATI_TEXTURE_FREE = 0x9049, 0x87FC


def check_memory(device: Device, needed: int, allowed: int | None = None) -> None:
    """Refuse a plan before allocating it: some drivers end the process where others return an error.

    Args:
        needed: bytes.
        allowed: MiB; by default RENDERGRAPH_MEMORY_LIMIT, else three quarters of the device's free memory.
    """
    named = os.environ.get(VARIABLE, "")
    if allowed is None and named:
        if not named.isdecimal():
            raise UsageError(Problem("RG500", f"{VARIABLE} is '{named}', not a number of MiB, as in 4096"))
        allowed = int(named)
    if allowed is not None:
        limit, of = allowed << 20, ""
    else:
        free = free_on_device(device) or system.free_memory()
        if free is None:
            return
        limit = free * 3 // 4
        of = f", three quarters of the {free / 2**20:.0f} MiB that are free"
    if needed > limit:
        text = (
            f"the plan needs {needed / 2**20:.0f} MiB of textures, {limit / 2**20:.0f} MiB may be used{of}; "
            f"a smaller --size helps, --limit plan-memory=MiB allows more, as does {VARIABLE}"
        )
        raise RenderError(Problem("RG616", text))


def free_on_device(device: Device) -> int | None:
    """Return the bytes that the driver reports as free for textures, None if it does not or the device is the CPU."""
    if device.software:
        return None
    for extension, parameter in (
        ("GL_NVX_gpu_memory_info", _NVX_CURRENT_AVAILABLE),
        ("GL_ATI_meminfo", _ATI_TEXTURE_FREE),
    ):
        if extension in device.ctx.extensions:
            kibibytes = (ctypes.c_int * 4)()  # the second query returns four numbers, the total first
            device.raw.glGetIntegerv(parameter, ctypes.byref(kibibytes))
            if kibibytes[0] > 0:
                return kibibytes[0] * 1024
    return None
