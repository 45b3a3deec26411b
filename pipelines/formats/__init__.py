"""Formats of mesh files that are read without a plugin, each in a folder of its own: shipped readers are content, too.

A reader returns everything in a file as a scene. It reads through its `Reading`, which knows the limits and the roots.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rendergraph.scene.model import Scene
    from rendergraph.scene.reading import Reading

MESHES = (".obj", ".gltf", ".glb", ".npz", ".usd", ".usda", ".usdc", ".usdz")


def read(path: Path, reading: Reading) -> Scene:
    """Read the scene in a file whose extension is one of `MESHES`."""
    if path.suffix.lower() == ".obj":
        from rendergraph.pipelines.formats.obj import read_obj  # each reader comes with its first file

        return read_obj(path, reading)
    if path.suffix.lower() == ".npz":
        from rendergraph.pipelines.formats.npz import read_npz  # each reader comes with its first file

        return read_npz(path, reading)
    if path.suffix.lower().startswith(".usd"):
        from rendergraph.pipelines.formats.usd import read_usd  # each reader comes with its first file

        return read_usd(path, reading)
    from rendergraph.pipelines.formats.gltf import read_gltf  # each reader comes with its first file

    return read_gltf(path, reading)


def used_extensions(path: Path) -> list[str]:
    """Return the names of the extensions of its format that a file uses; it has been read before."""
    if path.suffix.lower() not in (".gltf", ".glb"):
        return []
    from rendergraph.pipelines.formats import gltf  # see above

    return gltf.used_extensions(path)
