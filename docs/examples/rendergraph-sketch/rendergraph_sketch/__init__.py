"""Drawings instead of photographs: outlines, a cartoon's shading, STL files."""
