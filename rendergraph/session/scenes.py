"""The scene of a pipeline; pipelines that ask for the same unchanged files share one, and so its place on the GPU."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any
from weakref import WeakValueDictionary

from msgspec.structs import replace

from rendergraph import stamps
from rendergraph.declare import Extensions
from rendergraph.scene.animate import complete
from rendergraph.scene.environments import named
from rendergraph.scene.files import Reading, SceneLimits
from rendergraph.scene.load import load
from rendergraph.scene.model import Environment, ImageSource, Scene
from rendergraph.session.selection import Selection
from rendergraph.session.values import Resolved

if TYPE_CHECKING:
    from rendergraph.images import ImageLimits

_IMAGE_LIMITS = {"image_side": "side", "image_bytes": "bytes", "image_ratio": "ratio"}
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
    # One camera serves pictures of about one shape, such as a viewer's smaller ones.
    shape = max(math.floor(10 * spec.size[0] / spec.size[1] + 0.1), 1) / 10
    found = _IN_USE.get(key) or _IN_USE.get((*key, shape))
    if found is not None and stamps.unchanged(found.files):
        return found
    with stamps.track_reads() as files:
        scene = Scene("empty")
        if spec.scene is not None:
            scene = load(spec.scene, check_path=spec.roots.check, limits=limits, extensions=extensions)
        if selection.environment is not None:
            scene = replace(scene, environment=_environment(selection.environment, scene, limits, extensions))
        scene = _measured(scene, resolved)
    framed = () if scene.cameras else (shape,)
    _IN_USE[(*key, *framed)] = made = replace(complete(scene, selection.camera, shape), files=files)
    return made


def image_limits(selection: Selection) -> ImageLimits:
    """What the scene's images may claim."""
    from rendergraph.images import ImageLimits  # for scenes with images alone

    allowed = selection.allowed("scene")
    return ImageLimits(**{own: allowed[name] for name, own in _IMAGE_LIMITS.items() if name in allowed})


def _environment(path: Path, scene: Scene, limits: SceneLimits, extensions: Extensions) -> Environment:
    """What is named beside the scene, in place of its own."""
    found = named(str(path), scene.lights)
    if found is not None:
        return found
    reading = Reading(path, lambda path, place: path, limits, extensions)
    image, header = reading.image_with_header(path, "environment")
    return Environment(image, header.size)


def _measured(scene: Scene, resolved: Resolved) -> Scene:
    """The scene with its environment's size, which only decoding tells of some files."""
    environment = scene.environment
    if environment is None or environment.size is not None or not isinstance(environment.image, ImageSource):
        return scene
    from rendergraph.images import decode  # for such files alone

    height, width = decode(environment.image, srgb=True, limits=image_limits(resolved.selection)).shape[:2]
    return replace(scene, environment=replace(environment, size=(width, height)))
