"""OBJ files as scenes: `parser` reads the statements, `mtl` the materials, and `reader` builds objects and meshes."""

from rendergraph.pipelines.formats.obj.reader import read_obj

__all__ = ["read_obj"]
