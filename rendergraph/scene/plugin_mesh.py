"""Mesh files that a plugin reads: its triangles checked whole, as a scene."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt

from rendergraph.declare import Added, MeshData
from rendergraph.declare.extension import MeshLoader
from rendergraph.document import shown
from rendergraph.errors import InputError, Place, Problem, shown_file
from rendergraph.scene.files import Reading, UniqueNames
from rendergraph.scene.geometry import face_normals, filled_normals
from rendergraph.scene.model import FARTHEST, Floats, Material, Mesh, Object, Scene

_WIDTHS = {"positions": (3,), "normals": (3,), "uv0": (2,), "uv1": (2,), "colors": (3, 4)}


def read_plugin_mesh(path: Path, loader: Added[MeshLoader], reading: Reading) -> Scene:
    """The scene in a mesh file: an object for each `MeshData` that the loader gives.

    Raises:
        InputError: the file is missing or too large, the loader raises, or what it gives is no mesh.
    """
    reading.exists(path, "scene file")
    if path.stat().st_size > reading.limits.file_bytes:
        raise reading.over(f"mesh '{reading.named(path)}' has {path.stat().st_size:,} bytes", "file_bytes")
    what = f"mesh '{shown(path.name)}'"
    given = loader.run("RG497", f"{what} cannot be read", path)
    parts = [given] if isinstance(given, MeshData) else given
    if not isinstance(parts, Sequence) or not all(isinstance(part, MeshData) for part in parts):
        raise _unusable(loader, what, f"gave {type(given).__name__}, not MeshData or a list of it")
    if not parts:
        reading.warn("RG332", "empty", "holds no triangle; nothing is drawn")
    names = UniqueNames()
    objects, meshes, materials = [], [], []
    vertices = 0
    for number, part in enumerate(parts):
        name = names.unique(str(part.name), path.stem)
        try:
            mesh = _mesh(name, part)
            material = Material(
                name,
                (*_color(part.base_color), 1.0),
                _share("metallic", part.metallic),
                _share("roughness", part.roughness),
            )
        except (ValueError, TypeError, OverflowError) as error:
            raise _unusable(loader, what, f"gave a mesh ({number}) whose {error}") from None
        vertices += len(mesh.positions)
        if vertices > reading.limits.vertices:
            raise reading.over(f"{what} has {vertices:,} vertices", "vertices")
        objects.append(Object(name, number, number, np.eye(4), node=name))
        meshes.append(mesh)
        materials.append(material)
    return Scene(path.stem, path, tuple(objects), tuple(meshes), tuple(materials))


def _unusable(loader: Added[MeshLoader], what: str, text: str) -> InputError:
    text = f"{what} cannot be read: the loader of plugin '{loader.plugin}' {text}"
    return InputError(Problem("RG498", text, Place(shown_file(loader.file))))


def _mesh(name: str, part: MeshData) -> Mesh:
    """A loader's mesh.

    Raises:
        ValueError: with what is wrong, as a sentence that begins with the part's name.
    """
    arrays = {key: _floats(key, getattr(part, key)) for key in _WIDTHS}
    positions = arrays.pop("positions")
    if positions is None or not len(positions):
        raise ValueError("positions are missing")
    indices = _indices(part.indices, len(positions))
    for key, array in arrays.items():
        if array is not None and len(array) != len(positions):
            raise ValueError(f"{key} are {len(array)}, its positions {len(positions)}")
    colors = arrays["colors"]
    if colors is not None and colors.shape[1] == 3:
        arrays["colors"] = np.concatenate([colors, np.ones((len(colors), 1), np.float32)], axis=1)
    normals = arrays.pop("normals")
    wanted = np.zeros(positions.shape) if normals is None else normals.astype(np.float64)
    filled, _ = filled_normals(positions, indices, wanted)
    proper = face_normals(positions, indices).any(axis=1)
    return Mesh(name, positions, indices[proper], filled, **arrays)


def _floats(key: str, given: npt.ArrayLike | None) -> Floats | None:
    if given is None:
        return None
    with np.errstate(over="ignore"):  # what single precision cannot hold becomes infinite
        array = np.ascontiguousarray(given, np.float32)
    if array.ndim != 2 or array.shape[1] not in _WIDTHS[key]:
        wanted = " or ".join(f"(n, {width})" for width in _WIDTHS[key])
        raise ValueError(f"{key} have the shape {array.shape}, not {wanted}")
    if not (np.abs(array) <= FARTHEST).all():
        raise ValueError(f"{key} are not all finite, or beyond {FARTHEST:g}")
    return array


def _indices(given: npt.ArrayLike, count: int) -> npt.NDArray[np.uint32]:
    array = np.asarray(given)
    if array.ndim != 2 or array.shape[1] != 3 or not np.issubdtype(array.dtype, np.integer):
        raise ValueError(f"indices are {array.dtype} of shape {array.shape}, not whole numbers of shape (m, 3)")
    if len(array) and (int(array.min()) < 0 or int(array.max()) >= count):
        raise ValueError(f"indices go from {array.min()} to {array.max()}, its positions are {count}")
    return np.ascontiguousarray(array, np.uint32)


def _color(given: Sequence[float]) -> tuple[float, float, float]:
    r, g, b = (_share("base_color", part) for part in given)
    return r, g, b


def _share(key: str, given: float) -> float:
    if not 0 <= given <= 1:
        raise ValueError(f"{key} is {given}, not from 0 to 1")
    return float(given)
