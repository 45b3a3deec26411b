"""What GL there is, asked in a process of its own, for a broken driver may take it down: `doctor` reads the JSON.

Without an argument it lists the EGL devices, with a number it opens that one.
"""

from __future__ import annotations

import ctypes
import json
import sys
from typing import Any

_VENDOR, _EXTENSIONS, _RENDERER, _DRM, _RENDER_NODE, _CUDA = 0x3053, 0x3055, 0x335F, 0x3233, 0x3377, 0x323A
_MOST_DEVICES = 32


def libraries() -> dict[str, str | None]:
    """Shared library to what the loader says against it, None where it loads."""
    found: dict[str, str | None] = {}
    for name in ("libEGL.so.1", "libGL.so.1"):
        try:
            ctypes.CDLL(name)
            found[name] = None
        except OSError as error:
            found[name] = str(error)
    return found


def devices() -> list[dict[str, Any]]:
    """The EGL devices in the order of their numbers (EGL_EXT_device_enumeration, EGL_EXT_device_query).

    Raises:
        OSError: there is no EGL, or it lists no devices.
    """
    egl = ctypes.CDLL("libEGL.so.1")
    egl.eglGetProcAddress.restype = ctypes.c_void_p
    egl.eglGetProcAddress.argtypes = [ctypes.c_char_p]

    def function(name: str, result: Any, *arguments: Any) -> Any:
        address = egl.eglGetProcAddress(name.encode())
        if not address:
            raise OSError(f"this EGL has no {name}")
        return ctypes.CFUNCTYPE(result, *arguments)(address)

    handles = ctypes.POINTER(ctypes.c_void_p)
    query = function("eglQueryDevicesEXT", ctypes.c_uint, ctypes.c_int, handles, ctypes.POINTER(ctypes.c_int))
    text = function("eglQueryDeviceStringEXT", ctypes.c_char_p, ctypes.c_void_p, ctypes.c_int)
    number = function(
        "eglQueryDeviceAttribEXT", ctypes.c_uint, ctypes.c_void_p, ctypes.c_int, ctypes.POINTER(ctypes.c_ssize_t)
    )
    table = (ctypes.c_void_p * _MOST_DEVICES)()
    count = ctypes.c_int()
    if not query(_MOST_DEVICES, table, ctypes.byref(count)):
        raise OSError("eglQueryDevicesEXT failed")
    found = []
    for index in range(count.value):
        handle = table[index]
        extensions = (text(handle, _EXTENSIONS) or b"").decode("ascii", "replace").split()
        entry: dict[str, Any] = {"number": index, "extensions": extensions}
        for key, name, needed in (
            ("vendor", _VENDOR, "EGL_EXT_device_persistent_id"),
            ("renderer", _RENDERER, "EGL_EXT_device_query_name"),
            ("drm", _DRM, "EGL_EXT_device_drm"),
            ("render_node", _RENDER_NODE, "EGL_EXT_device_drm_render_node"),
        ):
            value = text(handle, name) if needed in extensions else None
            if value:
                entry[key] = value.decode("utf-8", "replace")
        value = ctypes.c_ssize_t()
        if "EGL_NV_device_cuda" in extensions and number(handle, _CUDA, ctypes.byref(value)):
            entry["cuda"] = value.value
        entry["software"] = "EGL_MESA_device_software" in extensions
        found.append(entry)
    return found


def context(index: int) -> dict[str, Any]:
    """What a device's OpenGL is and can.

    Raises:
        DeviceError: it cannot be opened, or is older than 4.5.
    """
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
                "depth bounds": device.has_depth_bounds,
                "memory objects": "GL_EXT_memory_object" in extensions,
            },
            "limits": dict(device.limits),
        }
    finally:
        device.release()


def _main() -> None:
    if len(sys.argv) > 1:
        from rendergraph.errors import RendergraphError

        try:
            print(json.dumps(context(int(sys.argv[1]))))
        except RendergraphError as error:
            print(json.dumps({"problem": "; ".join(problem.text for problem in error.problems)}))
        except Exception as error:  # the doctor reports whatever it meets
            print(json.dumps({"problem": f"{type(error).__name__}: {error}"}))
        return
    try:
        print(json.dumps({"libraries": libraries(), "devices": devices(), "problem": None}))
    except OSError as error:
        print(json.dumps({"libraries": libraries(), "devices": [], "problem": str(error)}))


if __name__ == "__main__":
    _main()
