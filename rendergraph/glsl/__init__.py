"""GLSL as text: files with their includes, and the names that a text declares. No GL."""

from __future__ import annotations

from rendergraph.glsl.names import declared
from rendergraph.glsl.source import MAX_BYTES, MAX_DEPTH, Includes, Origin, SourceText, expand, strip_comments

__all__ = [
    "MAX_BYTES",
    "MAX_DEPTH",
    "Includes",
    "Origin",
    "SourceText",
    "declared",
    "expand",
    "strip_comments",
]
