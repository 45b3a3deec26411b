"""The scene of a pipeline; pipelines that ask for the same unchanged files share one, and so its place on the GPU."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any
from weakref import WeakValueDictionary

from rendergraph import stamps
from rendergraph.scene.animate import complete
from rendergraph.scene.files import Reading, SceneLimits
from rendergraph.scene.load import load
from rendergraph.scene.model import Environment, Scene
from rendergraph.session.values import Resolved

_IN_USE: WeakValueDictionary[tuple[Any, ...], Scene] = WeakValueDictionary()


def scene_of(resolved: Resolved) -> Scene:
    """The scene, completed by a camera and a light where it has none.

    Raises:
        InputError: a file of it is missing or wrong.
    """
    selection, spec, extensions = resolved.selection, resolved.spec, resolved.catalog.extensions
    limits = SceneLimits(**selection.allowed("scene"))
    roots = spec.roots.folders if spec.scene is not None else ()
    key = (Path.cwd(), spec.scene, selection.environment, selection.camera, roots, limits, selection.plugins)
    found = _IN_USE.get(key)
    if found is not None and not stamps.changed(found.files):
        stamps.again(found.files)
        return found
    with stamps.looking() as files:
        scene = Scene("empty")
        if spec.scene is not None:
            scene = load(spec.scene, check_path=spec.roots.check, limits=limits, extensions=extensions)
        if selection.environment is not None:
            reading = Reading(selection.environment, lambda path, place: path, limits, extensions)
            image = reading.image(selection.environment, "environment")
            scene = replace(scene, environment=Environment(image))
    _IN_USE[key] = found = replace(complete(scene, selection.camera), files=files)
    return found
