"""The scene of a pipeline; pipelines with the same unchanged scene files share one, and so its place on the GPU."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any
from weakref import WeakValueDictionary

from msgspec.structs import replace

from rendergraph import stamps
from rendergraph.declare import Extensions
from rendergraph.document import YamlLimits
from rendergraph.errors import InputError, Option, Place, Problem
from rendergraph.pipelines.environments import named
from rendergraph.resolve.spec import flow
from rendergraph.scene.animate import complete
from rendergraph.scene.load import load
from rendergraph.scene.model import Environment, ImageSource, Scene, SceneLimits
from rendergraph.scene.reading import Reading
from rendergraph.session.selection import Selection
from rendergraph.session.values import Resolved

_IN_USE: WeakValueDictionary[tuple[Any, ...], Scene] = WeakValueDictionary()


def scene_of(resolved: Resolved) -> Scene:
    """Return the scene, with at least a camera and a light."""
    selection, spec, extensions = resolved.selection, resolved.spec, resolved.catalog.extensions
    limits = scene_limits(selection)
    changes = spec.scene_changes
    roots = spec.roots.folders if spec.scene is not None or changes is not None else ()
    key: tuple[Any, ...] = (Path.cwd(), spec.scene, selection.environment, selection.camera, roots, limits)
    key = (*key, selection.variant, selection.ground, selection.shutter, selection.plugins)
    key = (*key, changes and (spec.path, flow(changes)))
    # Pictures of about the same aspect ratio, such as a viewer's smaller ones, share a fitted camera.
    shape = max(math.floor(10 * spec.size[0] / spec.size[1] + 0.1), 1) / 10
    found = _IN_USE.get(key) or _IN_USE.get((*key, shape))
    if found is not None and stamps.unchanged(found.files):
        return found
    with stamps.track_reads() as files:
        scene = Scene("empty")
        if spec.scene is not None or changes is not None:
            check = spec.roots.check
            scene = load(spec.scene, changes=changes, check_path=check, limits=limits, extensions=extensions)
        if (variant := selection.variant) is not None:
            if mistake := scene.variant_mistake(variant):
                raise InputError(Problem("RG322", f"the scene {mistake}", Place(Option("--variant", variant))))
            scene = scene.with_variant(variant)
        bare = selection.environment == Path("none")
        if bare:
            scene = replace(scene, environment=None)
        elif selection.environment is not None:
            scene = replace(scene, environment=_environment(selection.environment, scene, limits, extensions))
        if selection.ground and scene.ground is None:
            scene = replace(scene, ground=0.0)
        scene = _measured(scene, limits)
    framed = () if scene.cameras else (shape,)
    _IN_USE[(*key, *framed)] = made = replace(
        complete(scene, selection.camera, shape, bare=bare, shutter=selection.shutter), files=files
    )
    return made


def scene_limits(selection: Selection) -> SceneLimits:
    """Return the limits of the scene and its images."""
    return SceneLimits(**selection.allowed("scene"), yaml=YamlLimits(**selection.allowed("yaml")))


def _environment(path: Path, scene: Scene, limits: SceneLimits, extensions: Extensions) -> Environment:
    """Return the environment with which the selection replaces the scene's own."""
    found = named(str(path), scene.lights)
    if found is not None:
        return found
    reading = Reading(path, lambda path, place: path, limits, extensions)
    image = reading.image(path, "environment")
    return Environment(image, image.size)


def _measured(scene: Scene, limits: SceneLimits) -> Scene:
    """Return the scene with the size of its environment; that of a plugin's file is known only after decoding."""
    environment = scene.environment
    if environment is None or environment.size is not None or not isinstance(environment.image, ImageSource):
        return scene
    from rendergraph.images import decode  # only for such files

    height, width = decode(environment.image, srgb=True, limits=limits).shape[:2]
    return replace(scene, environment=replace(environment, size=(width, height)))
