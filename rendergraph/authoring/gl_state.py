"""Detect what a node's Python code does to OpenGL on its own: state that it changes, objects that it leaks."""

from __future__ import annotations

import types
from collections.abc import Callable
from typing import Any

from rendergraph.declare import Node
from rendergraph.gl.device import Device
from rendergraph.gl.saved_state import SavedState

KINDS = ("Texture", "Buffer", "Framebuffer", "VertexArray", "Sampler", "Program", "Query", "Renderbuffer")
_STATE = {  # what `SavedState` holds, in words
    "enabled": "enabled capabilities",
    "indexed": "blending or the scissor test",
    "units": "bound textures and samplers",
    "images": "bound images",
    "blocks": "bound buffers",
    "settings": "settings such as the depth function",
}


def count_objects(device: Device, most: int) -> dict[str, int]:
    raw = device.raw
    return {kind: sum(bool(getattr(raw, f"glIs{kind}")(name)) for name in range(1, most)) for kind in KINDS}


def flush_deleted_programs(device: Device) -> None:
    """Make the driver free deleted programs: Mesa keeps the last one of a kind until the other kind has run.

    What Mesa keeps afterwards belongs to this function, so call it before and after what is compared.
    """
    drawing = device.ctx.program(
        vertex_shader="#version 450 core\nvoid main() { gl_Position = vec4(0.0); }",
        fragment_shader="#version 450 core\nvoid main() {}",
    )
    shaping = device.ctx.program(
        vertex_shader="#version 450 core\nvoid main() { gl_Position = vec4(0.0); }",
        geometry_shader="#version 450 core\nlayout(points) in;\nlayout(points, max_vertices = 1) out;\nvoid main() {}",
        fragment_shader="#version 450 core\nvoid main() {}",
    )
    computing = device.ctx.compute_shader("#version 450 core\nlayout(local_size_x = 1) in;\nvoid main() {}")
    for name in (shaping.glo, drawing.glo, computing.glo, drawing.glo, 0):
        device.raw.glUseProgram(name)
    shaping.release()
    drawing.release()
    computing.release()
    device.ctx.gc()


def guard_state(cls: type[Node], device: Device, report: Callable[[str, str], None]) -> type[Node]:
    """Return the class with a `record` and `update` that report each change of the GL state."""
    names = [name for name in ("record", "update") if getattr(cls, name) is not getattr(Node, name)]
    if not names:
        return cls
    body: dict[str, Any] = {name: _guarded(cls, name, device, report) for name in names}
    body |= {"__module__": cls.__module__, "__doc__": cls.__doc__}
    return types.new_class(cls.__name__, (cls,), exec_body=lambda space: space.update(body))


def _guarded(cls: type[Node], name: str, device: Device, report: Callable[[str, str], None]) -> Any:
    method = getattr(cls, name)

    def call(self: Node, argument: Any) -> None:
        before = _state(device)
        method(self, argument)
        error = device.raw.error()
        after = _state(device)
        if error:
            report(name, f"leaves the GL error {error} behind")
        for key, words in _STATE.items():
            if before[key] != after[key]:
                report(name, f"changes OpenGL state: {words}")

    return call


def _state(device: Device) -> dict[str, Any]:
    """Return the state, without the buffer that is bound for uploads, which uploading itself changes."""
    state = dict(vars(SavedState(device.raw, device.ctx)))
    bind = device.raw.glBindBuffer
    state["settings"] = [setting for setting in state["settings"] if setting[0] is not bind]
    return state
