"""Scenes from files: scene YAML and meshes."""

from __future__ import annotations

from pathlib import Path

from msgspec.structs import replace

from rendergraph.declare import NO_EXTENSIONS, Extensions
from rendergraph.document import Value, shown
from rendergraph.errors import Place, Problem
from rendergraph.scene.model import Scene, SceneLimits
from rendergraph.scene.reading import MESHES, CheckPath, Reading, inside, read_mesh

EXTENSIONS = (".yaml", ".yml", *MESHES)


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
