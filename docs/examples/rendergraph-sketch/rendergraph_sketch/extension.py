"""What this plugin adds beside node types."""

from __future__ import annotations

from rendergraph.api import Extension

from .stl import read_stl

EXTENSION = Extension(
    choices={"shading": {"toon": "toon.glsl"}},
    meshes={".stl": read_stl},
)
