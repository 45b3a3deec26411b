"""Meshes in files of NumPy arrays, with the names that `MeshData` gives them: `positions`, `indices`, `normals`, …"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from rendergraph.declare import MeshData
from rendergraph.scene.model import Material, Object, Scene
from rendergraph.scene.repeat import read_arrays

if TYPE_CHECKING:
    from rendergraph.scene.reading import Reading

_NAMES = ("positions", "indices", "normals", "uv0", "uv1", "colors")


def read_npz(path: Path, reading: Reading) -> Scene:
    """Return the scene of one mesh, which has the material that `MeshData` has by default."""
    from rendergraph.scene.reading import check_mesh  # which finds this reader

    data = reading.read(path, "mesh")
    try:
        arrays = read_arrays(data, reading.limits.memory_bytes)
        if lacking := {"positions", "indices"} - arrays.keys():
            raise ValueError(f"{min(lacking)} are missing")
        part = MeshData(**{name: arrays[name] for name in _NAMES if name in arrays})
        mesh = check_mesh(part, path.stem)
    except (ValueError, TypeError, OverflowError) as error:
        raise reading.error("RG304", f"the mesh cannot be read: {error}") from None
    if len(mesh.positions) > reading.limits.vertices:
        raise reading.over(f"the mesh has {len(mesh.positions):,} vertices", "vertices")
    material = Material("default", (*part.base_color, 1.0), part.metallic, part.roughness)
    return Scene(path.stem, path, (Object(path.stem, 0, 0, np.eye(4), node=path.stem),), (mesh,), (material,))
