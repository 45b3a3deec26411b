"""Plain NumPy scenes: the model, the readers, generated shapes, and packing for the GPU. No GL, no image decoding."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rendergraph.scene.files import Limits
    from rendergraph.scene.load import load

__all__ = ["Limits", "load"]


def __getattr__(name: str) -> Any:
    # NumPy and the readers are imported where a scene is really loaded: `check` of a wrong file starts faster.
    if name == "load":
        from rendergraph.scene.load import load

        return load
    if name == "Limits":
        from rendergraph.scene.files import Limits

        return Limits
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
