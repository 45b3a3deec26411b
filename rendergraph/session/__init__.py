"""The Python API: load, set, render; and `stages`, the way that every verb goes.

Everything is looked up on first use: `check` and `plan` work without GL, and `--help` needs none of it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rendergraph.session.frame import Frame, OutputInfo
    from rendergraph.session.pipeline import Pipeline, load
    from rendergraph.session.selection import RenderOptions, Selection
    from rendergraph.session.session import Session

__all__ = ["Frame", "OutputInfo", "Pipeline", "RenderOptions", "Selection", "Session", "load"]

_WHERE = {
    "Frame": "frame",
    "OutputInfo": "frame",
    "Pipeline": "pipeline",
    "RenderOptions": "selection",
    "Selection": "selection",
    "Session": "session",
    "load": "pipeline",
}


def __dir__() -> list[str]:
    return __all__


def __getattr__(name: str) -> Any:
    if name in _WHERE:
        import importlib

        return getattr(importlib.import_module(f"rendergraph.session.{_WHERE[name]}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
