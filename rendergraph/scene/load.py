"""A scene from a file: scene YAML, OBJ, glTF."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from rendergraph.document import shown
from rendergraph.errors import InputError, Place, Problem
from rendergraph.scene.files import CheckPath, Limits, Reading, inside
from rendergraph.scene.model import Scene

EXTENSIONS = (".yaml", ".yml", ".obj", ".gltf", ".glb")


def load(path: Path, *, check_path: CheckPath | None = None, limits: Limits = Limits()) -> Scene:
    """The scene in a file, checked whole; the extension says what it is.

    Args:
        path: a scene file (.yaml), or a mesh (.obj, .gltf, .glb).
        check_path: the root rule for every path the file names: returns it resolved or raises InputError. By default
            paths stay under the file's own folder, links followed.
        limits: how much the file may ask for.

    Returns:
        The scene as the file has it: `animate.complete` adds a camera and a light where there are none. What a reader
        left out, replaced or clamped is in `warnings`.

    Raises:
        InputError: the file or one it names is missing, malformed, out of range, outside the roots, or beyond a limit.
    """
    reading = Reading(path, check_path or inside(path.parent), limits)
    suffix = path.suffix.lower()
    if suffix not in EXTENSIONS:
        text = f"'{shown(path.name)}' is no scene; a scene ends in {', '.join(EXTENSIONS)}"
        raise InputError(Problem("RG303", text, Place(str(path))))
    reading.exists(path, "scene file")
    if suffix in (".yaml", ".yml"):
        from rendergraph.scene.scene_yaml import read_scene

        scene = read_scene(path, reading)
    elif suffix == ".obj":
        from rendergraph.scene.obj import read_obj

        scene = read_obj(path, reading)
    else:
        from rendergraph.scene.gltf import read_gltf

        scene = read_gltf(path, reading)
    return replace(scene, warnings=reading.warnings)
