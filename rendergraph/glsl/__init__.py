"""GLSL as text: files with their includes, and the names that a text declares. No GL."""

from __future__ import annotations

from rendergraph.glsl.files import MAX_BYTES, Links, about, read_text, strip_comments
from rendergraph.glsl.names import declared
from rendergraph.glsl.source import MAX_DEPTH, Includes, Origin, SourceText, is_shadertoy
