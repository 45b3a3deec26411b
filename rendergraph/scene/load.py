"""Scenes and meshes from files, in shipped formats and in those of plugins."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from msgspec.structs import replace

from rendergraph.declare import NO_EXTENSIONS, Added, Extensions, MeshData
from rendergraph.declare.extensions import MeshLoader
from rendergraph.document import Value, shown
from rendergraph.errors import InputError, Place, Problem, shown_file
from rendergraph.pipelines.formats import MESHES as MESHES
from rendergraph.pipelines.formats import read
from rendergraph.scene.geometry import face_normals, filled_normals
from rendergraph.scene.model import FARTHEST, Floats, Material, Mesh, Object, Scene, SceneLimits
from rendergraph.scene.reading import CheckPath, Reading, UniqueNames, inside

EXTENSIONS = (".yaml", ".yml", *MESHES)
_WIDTHS = {"positions": (3,), "normals": (3,), "uv0": (2,), "uv1": (2,), "colors": (3, 4)}


def load(
    path: Path | None,
    *,
    changes: Value | None = None,
    check_path: CheckPath | None = None,
    limits: SceneLimits = SceneLimits(),
    extensions: Extensions = NO_EXTENSIONS,
) -> Scene:
    """Load the scene in a file and check all of it; the extension chooses the reader.

    The scene has only what the file has: `animate.complete` adds a camera and a light if there are none. `warnings`
    lists what a reader left out, replaced or clamped. `check_path` is the root rule for every path in the file; by
    default paths stay under the file's own folder, with symbolic links resolved. `changes`, with the keys of scene
    files, are merged into the scene; without a file they are the scene.
    """
    reading = Reading(path or Path("scene.yaml"), check_path or inside((path or Path("x")).parent), limits, extensions)
    suffix = path.suffix.lower() if path is not None else ""
    if path is not None and suffix in EXTENSIONS:
        reading.check_file(path, "scene file")
    if path is None or changes is not None or suffix in (".yaml", ".yml"):
        from rendergraph.scene.scene_file import read_scene  # the largest of the readers

        scene = read_scene(path, reading, changes)
    else:
        unknown = Problem("RG303", f"'{shown(path.name)}' is not a scene; a scene ends in", Place(str(path)))
        scene = read_mesh(path, reading, unknown, EXTENSIONS)
        if scene.rigs:
            from rendergraph.scene.animate import at_rest, play  # only for animated files

            scene = play(scene) if scene.rigs[0].clips else at_rest(scene)
    return replace(scene, warnings=reading.warnings)


def read_mesh(path: Path, reading: Reading, unknown: Problem, known: tuple[str, ...] = MESHES) -> Scene:
    """Read a mesh file as a scene; `unknown` is the problem if its extension is neither `known` nor a plugin's."""
    extension = path.suffix.lower()
    if extension in MESHES:
        return read(path, reading)
    if (of_scenes := reading.extensions.scene_loader(extension)) is not None:
        reading.check_file(path, "scene file")
        what = f"scene '{shown(path.name)}'"
        result = of_scenes.run("RG497", f"{what} cannot be read", path, reading)
        if not isinstance(result, Scene):
            raise _unusable(of_scenes, what, f"{type(result).__name__}, not a Scene")
        return result
    if (loader := reading.extensions.mesh_loader(extension)) is None:
        added: list[Added[Any]] = [*reading.extensions.scenes(), *reading.extensions.meshes()]
        names = [*known, *(one.name for one in added)]
        text = f"{unknown.text} {', '.join(dict.fromkeys(names))}"
        raise InputError([Problem(unknown.code, text, unknown.place), *reading.extensions.problems])
    return _read_plugin_mesh(path, loader, reading)


# Meshes of plugins ----------------------------------------------------------------------------------------------------


def _read_plugin_mesh(path: Path, loader: Added[MeshLoader], reading: Reading) -> Scene:
    """Return the scene of a plugin's loader: an object for each `MeshData`, whose arrays are all checked."""
    reading.check_file(path, "scene file")
    reading.check_bytes(path, "mesh")
    what = f"mesh '{shown(path.name)}'"
    result = loader.run("RG497", f"{what} cannot be read", path)
    parts = [result] if isinstance(result, MeshData) else result
    if not isinstance(parts, Sequence) or not all(isinstance(part, MeshData) for part in parts):
        raise _unusable(loader, what, f"{type(result).__name__}, not MeshData or a list of it")
    if not parts:
        reading.warn("RG332", "empty", "contains no triangle; nothing is drawn")
    names = UniqueNames()
    objects, meshes, materials = [], [], []
    vertices = 0
    for number, part in enumerate(parts):
        name = names.unique(str(part.name), path.stem)
        try:
            mesh = check_mesh(part, name)
            r, g, b = (_factor("base_color", value) for value in part.base_color)
            metallic, roughness = _factor("metallic", part.metallic), _factor("roughness", part.roughness)
        except (ValueError, TypeError, OverflowError) as error:
            raise _unusable(loader, what, f"a mesh ({number}) whose {error}") from None
        vertices += len(mesh.positions)
        if vertices > reading.limits.vertices:
            raise reading.over(f"{what} has {vertices:,} vertices", "vertices")
        objects.append(Object(name, number, number, np.eye(4), node=name))
        meshes.append(mesh)
        materials.append(Material(name, (r, g, b, 1.0), metallic, roughness))
    return Scene(path.stem, path, tuple(objects), tuple(meshes), tuple(materials))


def _unusable(loader: Added[Any], what: str, text: str) -> InputError:
    text = f"{what} cannot be read: the loader of plugin '{loader.plugin}' returned {text}"
    return InputError(Problem("RG498", text, Place(shown_file(loader.file))))


def check_mesh(part: MeshData, name: str = "") -> Mesh:
    """Return the mesh of arrays; raise ValueError for a mistake, with a text that begins with the attribute's name."""
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
    doubles = np.zeros(positions.shape) if normals is None else normals.astype(np.float64)
    filled, _ = filled_normals(positions, indices, doubles)
    has_area = face_normals(positions, indices).any(axis=1)
    return Mesh(name, positions, indices[has_area], filled, None, arrays["uv0"], arrays["uv1"], arrays["colors"])


def _floats(key: str, values: npt.ArrayLike | None) -> Floats | None:
    if values is None:
        return None
    with np.errstate(over="ignore"):  # values beyond single precision become infinite
        array = np.ascontiguousarray(values, np.float32)
    if array.ndim != 2 or array.shape[1] not in _WIDTHS[key]:
        expected = " or ".join(f"(n, {width})" for width in _WIDTHS[key])
        raise ValueError(f"{key} have the shape {array.shape}, not {expected}")
    if not (np.abs(array) <= FARTHEST).all():
        raise ValueError(f"{key} are not all finite, or beyond {FARTHEST:g}")
    return array


def _indices(values: npt.ArrayLike, count: int) -> npt.NDArray[np.uint32]:
    array = np.asarray(values)
    if array.ndim != 2 or array.shape[1] != 3 or not np.issubdtype(array.dtype, np.integer):
        raise ValueError(f"indices are {array.dtype} of shape {array.shape}, not whole numbers of shape (m, 3)")
    if len(array) and (int(array.min()) < 0 or int(array.max()) >= count):
        raise ValueError(f"indices go from {array.min()} to {array.max()}, its positions are {count}")
    return np.ascontiguousarray(array, np.uint32)


def _factor(key: str, value: float) -> float:
    if not 0 <= value <= 1:
        raise ValueError(f"{key} is {value}, not from 0 to 1")
    return float(value)
