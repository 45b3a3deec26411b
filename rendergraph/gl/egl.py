"""The EGL devices of this machine, listed without opening one."""

from __future__ import annotations

import ctypes
from typing import Any

from rendergraph.system import EGL

_VENDOR, _EXTENSIONS, _RENDERER, _DRM, _RENDER_NODE, _CUDA = 0x3053, 0x3055, 0x335F, 0x3233, 0x3377, 0x323A
_MOST_DEVICES = 32


def devices() -> list[dict[str, Any]]:
    """Return the EGL devices by number (EGL_EXT_device_enumeration, EGL_EXT_device_query).

    Raises:
        OSError: EGL is missing, or lists no devices.
    """
    egl = ctypes.CDLL(EGL)
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


def hardware() -> tuple[int, ...]:
    """Return the numbers of the devices that are not software rasterisers; none if they cannot be listed."""
    try:
        return tuple(device["number"] for device in devices() if not device["software"])
    except OSError:
        return ()
