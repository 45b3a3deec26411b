"""Examine GL in a child process of `doctor`, because a broken driver may crash it; the answer is JSON on stdout.

Without an argument it lists the EGL devices; with a number it opens that device.
"""

from __future__ import annotations

import ctypes
import json
import sys
from typing import Any

from rendergraph.gl.egl import devices
from rendergraph.system import EGL, GL

_STORED_BLOCKS = "a crash of this driver is avoided: more than two uniform blocks a stage are storage blocks"


def libraries() -> dict[str, str | None]:
    found: dict[str, str | None] = {}
    for name in (EGL, GL):
        try:
            ctypes.CDLL(name)
            found[name] = None
        except OSError as error:
            found[name] = str(error)
    return found


def context(index: int) -> dict[str, Any]:
    from rendergraph.gl.device import open_device

    device = open_device(index)
    try:
        extensions, version = device.ctx.extensions, device.ctx.version_code
        return device.as_json() | {
            "gl": f"{version // 100}.{version // 10 % 10}",
            "features": {
                "OpenGL 4.5": version >= 450,
                "compute shaders": version >= 430 or "GL_ARB_compute_shader" in extensions,
                "texture views": version >= 430 or "GL_ARB_texture_view" in extensions,
                "indirect multi-draw": version >= 430 or "GL_ARB_multi_draw_indirect" in extensions,
                "depth bounds": bool(device.limits["depth_bounds"]),
                "memory objects": "GL_EXT_memory_object" in extensions,
            },
            "limits": dict(device.limits),
            "workarounds": [_STORED_BLOCKS] if device.stores_blocks else [],
        }
    finally:
        device.release()


def _main() -> None:
    if len(sys.argv) > 1:
        from rendergraph.errors import RendergraphError

        try:
            print(json.dumps(context(int(sys.argv[1]))))
        except RendergraphError as error:
            print(json.dumps({"problem": "; ".join(problem.message for problem in error.problems)}))
        except Exception as error:  # `doctor` reports any failure
            print(json.dumps({"problem": f"{type(error).__name__}: {error}"}))
        return
    try:
        print(json.dumps({"libraries": libraries(), "devices": devices(), "problem": None}))
    except OSError as error:
        print(json.dumps({"libraries": libraries(), "devices": [], "problem": str(error)}))


if __name__ == "__main__":
    _main()
