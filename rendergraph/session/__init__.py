"""The Python API: load, set, render; and `stages`, the way that every verb goes.

Everything is looked up on first use: `check` and `plan` work without GL, and `--help` needs none of it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from rendergraph.lazy import lazy_exports

if TYPE_CHECKING:
    from rendergraph.session.frame import Frame, OutputInfo
    from rendergraph.session.pipeline import Pipeline, load
    from rendergraph.session.selection import RenderOptions, Selection
    from rendergraph.session.session import Session

__all__ = ["Frame", "OutputInfo", "Pipeline", "RenderOptions", "Selection", "Session", "load"]


def __dir__() -> list[str]:
    return __all__


__getattr__ = lazy_exports(
    __name__,
    {
        "frame": ("Frame", "OutputInfo"),
        "pipeline": ("Pipeline", "load"),
        "selection": ("RenderOptions", "Selection"),
        "session": ("Session",),
    },
)
