"""The Python API: load, set, render; a `Session` owns the GL context and shares programs and scenes."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from rendergraph.session.pipeline import Pipeline, load

if TYPE_CHECKING:
    from rendergraph.session.frame import Frame, OutputInfo
    from rendergraph.session.session import Session

__all__ = ["Frame", "OutputInfo", "Pipeline", "Session", "load"]


def __getattr__(name: str) -> Any:
    # `check` and `plan` work without GL: the modules that need it are imported when something is drawn.
    if name == "Session":
        from rendergraph.session.session import Session

        return Session
    if name in ("Frame", "OutputInfo"):
        from rendergraph.session import frame

        return getattr(frame, name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
