"""GLSL as text: files with their includes, and the names that a text declares. No GL."""

from __future__ import annotations

from rendergraph.glsl.files import MAX_BYTES as MAX_BYTES
from rendergraph.glsl.files import Links as Links
from rendergraph.glsl.files import about as about
from rendergraph.glsl.files import read_text as read_text
from rendergraph.glsl.files import strip_comments as strip_comments
from rendergraph.glsl.names import declared as declared
from rendergraph.glsl.source import MAX_DEPTH as MAX_DEPTH
from rendergraph.glsl.source import Includes as Includes
from rendergraph.glsl.source import Origin as Origin
from rendergraph.glsl.source import SourceText as SourceText
