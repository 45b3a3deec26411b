"""What this plugin adds beside node types."""

from __future__ import annotations

from rendergraph.api import Choice, Extension

from .stl import read_stl

EXTENSION = Extension(
    choices={"shading": {"toon": Choice("toon.glsl", needs=("phong",))}},
    meshes={".stl": read_stl},
)
