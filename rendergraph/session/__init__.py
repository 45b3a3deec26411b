"""The Python API: load, set, render; and `stages`, which every verb goes through. All is imported on first use."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rendergraph.lazy import lazy_exports

if TYPE_CHECKING:
    from rendergraph.session.frame import Frame, OutputInfo
    from rendergraph.session.pipeline import Pipeline, load, loads
    from rendergraph.session.selection import RenderOptions, Selection
    from rendergraph.session.session import Session

__all__ = ["Frame", "OutputInfo", "Pipeline", "RenderOptions", "Selection", "Session", "load", "loads"]

__getattr__, __dir__ = lazy_exports(
    __name__,
    {
        "frame": ("Frame", "OutputInfo"),
        "pipeline": ("Pipeline", "load", "loads"),
        "selection": ("RenderOptions", "Selection"),
        "session": ("Session",),
    },
)
