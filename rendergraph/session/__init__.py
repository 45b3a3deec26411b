"""The Python API: load, set, render; a `Session` owns the GL context and shares programs and scenes."""

from __future__ import annotations

from rendergraph.session.frame import Frame, OutputInfo
from rendergraph.session.pipeline import Pipeline, load
from rendergraph.session.session import Session

__all__ = ["Frame", "OutputInfo", "Pipeline", "Session", "load"]
