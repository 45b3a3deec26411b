"""What a node's own Python does to OpenGL behind the framework's back: state it changes, objects it leaves."""

from __future__ import annotations

import types
from collections.abc import Callable
from typing import Any

from rendergraph.declare import Node
from rendergraph.gl.device import Device
from rendergraph.gl.saved_state import SavedState

KINDS = ("Texture", "Buffer", "Framebuffer", "VertexArray", "Sampler", "Program", "Query", "Renderbuffer")
_KEPT = {
    "enabled": "what is enabled",
    "indexed": "blending or the scissor test",
    "units": "bound textures and samplers",
    "images": "bound images",
    "blocks": "bound blocks",
    "settings": "settings such as the depth function",
}
"""What `SavedState` holds, in words."""


def living(device: Device, most: int) -> dict[str, int]:
    """How many GL objects of each kind exist among the names up to `most`."""
    raw = device.raw
    return {kind: sum(bool(getattr(raw, f"glIs{kind}")(name)) for name in range(1, most)) for kind in KINDS}


def let_go(device: Device) -> None:
    """Make the driver let go of deleted programs: Mesa keeps the last one of a kind until the other kind has run.

    What it keeps afterwards is of this function's own, so it is called before and after what is compared.
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


def watched(cls: type[Node], device: Device, tell: Callable[[str, str], None]) -> type[Node]:
    """The same class, whose `record` and `update` are held against the GL state before and after.

    Args:
        cls: an author's class.
        device: the current context.
        tell: called with the method and what it does wrong, for each thing that was changed.
    """
    names = [name for name in ("record", "update") if getattr(cls, name) is not getattr(Node, name)]
    if not names:
        return cls
    body: dict[str, Any] = {name: _compared(cls, name, device, tell) for name in names}
    body |= {"__module__": cls.__module__, "__doc__": cls.__doc__}
    return types.new_class(cls.__name__, (cls,), exec_body=lambda space: space.update(body))


def _compared(cls: type[Node], name: str, device: Device, tell: Callable[[str, str], None]) -> Any:
    inner = getattr(cls, name)

    def call(self: Node, argument: Any) -> None:
        before = _state(device)
        inner(self, argument)
        error = device.raw.error()
        after = _state(device)
        if error:
            tell(name, f"leaves the GL error {error} behind")
        for key, words in _KEPT.items():
            if before[key] != after[key]:
                tell(name, f"changes OpenGL's state: {words}")

    return call


def _state(device: Device) -> dict[str, Any]:
    """The state now; without the buffer that is bound for uploads, which uploading itself changes."""
    found = dict(vars(SavedState(device.raw, device.ctx)))
    bind = device.raw.glBindBuffer
    found["settings"] = [setting for setting in found["settings"] if setting[0] is not bind]
    return found
