"""Which reader a mesh file is for, by its ending: OBJ, glTF, or a plugin's."""

from __future__ import annotations

from pathlib import Path

from rendergraph.errors import InputError, Problem
from rendergraph.scene.files import Reading
from rendergraph.scene.model import Scene

MESHES = (".obj", ".gltf", ".glb")


def read_mesh(path: Path, reading: Reading, unknown: Problem, known: tuple[str, ...] = MESHES) -> Scene:
    """The scene in a mesh file.

    Args:
        path: the file.
        reading: of that file.
        unknown: what is said where nobody reads such files; the endings that are read are added.
        known: the endings that may stand here without plugins.

    Raises:
        InputError: nobody reads such files, or the file is missing, malformed or beyond a limit.
    """
    ending = path.suffix.lower()
    if ending == ".obj":
        from rendergraph.scene.obj import read_obj  # each reader comes with its first file

        return read_obj(path, reading)
    if ending in (".gltf", ".glb"):
        from rendergraph.scene.gltf import read_gltf  # each reader comes with its first file

        return read_gltf(path, reading)
    loader = reading.extensions.mesh_loader(ending)
    if loader is None:
        endings = [*known, *(added.name for added in reading.extensions.meshes())]
        text = f"{unknown.text} {', '.join(dict.fromkeys(endings))}"
        problem = Problem(unknown.code, text, unknown.place)
        raise InputError([problem, *reading.extensions.problems])
    from rendergraph.scene.plugin_mesh import read_plugin_mesh  # each reader comes with its first file

    return read_plugin_mesh(path, loader, reading)
