"""glTF 2.0 files (.gltf and .glb) as scenes.

Everything in a file is checked, whether its scene uses it or not: `schema` has the JSON as structs, `buffers` the
arrays, `materials`, `primitives` and `motion` the parts of a scene, `reader` its nodes.
"""

from rendergraph.pipelines.formats.gltf.reader import read_gltf, used_extensions

__all__ = ["read_gltf", "used_extensions"]
