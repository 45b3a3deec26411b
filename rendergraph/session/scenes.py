"""The scene of a pipeline, shared by pipelines with the same unchanged scene files, and its motion."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal
from weakref import WeakValueDictionary

from msgspec.structs import replace

from rendergraph import stamps
from rendergraph.declare import Extensions
from rendergraph.document import YamlLimits
from rendergraph.errors import InputError, Option, Place, Problem, UsageError, suggestion
from rendergraph.link import Graph
from rendergraph.pipelines.environments import named
from rendergraph.resolve.spec import flow
from rendergraph.scene import animate
from rendergraph.scene.load import load
from rendergraph.scene.model import Environment, ImageSource, Scene, SceneLimits
from rendergraph.scene.reading import Reading
from rendergraph.scene.rig import Curve
from rendergraph.session.selection import Selection
from rendergraph.session.values import Expanded, Resolved

if TYPE_CHECKING:
    from rendergraph.compile import Executable

CIRCLE_SECONDS = 4.0
"""Length of a turntable by default."""
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
        animate.complete(scene, selection.camera, shape, bare=bare, shutter=selection.shutter), files=files
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


# Motion ---------------------------------------------------------------------------------------------------------------


def film_frames(
    scene: Scene,
    fps: float,
    frames: range | Literal["clip"] | None = None,
    seconds: float | None = None,
    *,
    turntable: bool = False,
) -> range:
    """Return the frames of a film: those given, as many as `seconds` take, or the scene's motion once."""
    if frames is not None and seconds is not None:
        raise UsageError(Problem("RG500", "frames and seconds both say how long the film is; leave out one"))
    if seconds is not None and not (isinstance(seconds, int | float) and 0 < seconds < math.inf):
        raise UsageError(Problem("RG500", f"seconds: expected a number above 0, got {seconds!r}"))
    if not (isinstance(fps, int | float) and 0 < fps < math.inf):
        raise UsageError(Problem("RG500", f"fps: expected a number above 0, got {fps!r}"))
    if isinstance(frames, range) and (frames.step == 1 or len(frames) < 2):
        return frames
    if frames not in (None, "clip"):
        text = f"frames: expected consecutive numbers, as in range(1, 31), or 'clip', got {frames!r}"
        raise UsageError(Problem("RG500", text))
    length = animate.length(scene)
    if frames == "clip" and not length:
        raise UsageError(Problem("RG500", "frames: the scene has no clip, keyframes or orbit to be as long as"))
    seconds = seconds or (CIRCLE_SECONDS if turntable and frames is None else length)
    return range(1, max(1, round(seconds * fps)) + 1)


def standstill_warning(expanded: Expanded, *, film: bool, turntable: str = "--turntable") -> list[Problem]:
    """Return a warning about a film or several frames of a scene in which nothing moves; `turntable` is the way out."""
    linked, count = expanded.linked, len(expanded.options.frames)
    if animate.moves(linked.scene) or expanded.options.turntable or (count == 1 and not film):
        return []
    span = f" during {count} frames" if count > 1 else ", so the film is one frame"
    text = f"nothing in the scene moves{span}; {turntable} takes the camera around it"
    return [Problem("RG629", text, Place(linked.graph.name), severity="warning")]


def check_keyframes(graph: Graph, scene: Scene) -> list[Problem]:
    """Check the keyframes of `nodes.ID.PARAM`; return warnings about nodes that another pipeline may have."""
    problems, warnings = [], []
    for node, name, curve in scene.node_curves:
        what = f"keyframes of 'nodes.{node}.{name}'"
        if node not in graph:
            text = f"{what}: the pipeline has no node '{node}'{suggestion(node, graph.members)}"
            warnings.append(Problem("RG218", text, curve.place, severity="warning"))
            continue
        parameters = graph[node].type.cls.parameters()
        if name not in parameters or parameters[name].role != "param":
            driven = [known for known, one in parameters.items() if one.role == "param"]
            why = "is fixed when the pipeline is compiled" if name in parameters else "is not a parameter"
            problems.append(Problem("RG219", f"{what}: '{name}' {why}{suggestion(name, driven, most=9)}", curve.place))
            continue
        for value in curve.values.tolist():
            try:
                kind = int if parameters[name].type is int else float
                parameters[name].convert(tuple(map(kind, value)) if isinstance(value, list) else kind(value))
            except (TypeError, ValueError) as error:
                shown = str(value) if isinstance(value, list) else f"{value:g}"
                problems.append(Problem("RG219", f"{what}: {shown}: it {error}", curve.place))
                break
    if problems:
        raise InputError(problems)
    return warnings


class Driven:
    """The driven parameters of a compiled pipeline, with their places in its programs."""

    def __init__(self, graph: Graph, scene: Scene, executable: Executable) -> None:
        """Find the places; InputError if there is none, or a program cannot take the value."""
        self._executable = executable
        self._curves: list[tuple[Curve, bool, int, list[Any]]] = []
        for node, name, curve in scene.node_curves:
            if node not in graph or name not in executable.uniforms.get(node, ()):
                continue  # its outputs are not requested
            parameter = graph[node].type.cls.parameters()[name]
            fill = int(parameter.glsl[3]) if parameter.glsl.startswith("vec") and curve.values.ndim == 1 else 0
            mismatch = executable.set_uniform(node, name, _value(curve, 0.0, parameter.type is int, fill))
            cells = executable.cells(node, name)
            if mismatch is not None or not cells:
                text = mismatch or "no shader that runs in every frame reads it"
                raise InputError(Problem("RG219", f"keyframes of 'nodes.{node}.{name}': {text}", curve.place))
            self._curves.append((curve, parameter.type is int, fill, cells))

    def set(self, time: float) -> None:
        """Set the uniforms to their values at a time."""
        for curve, whole, fill, cells in self._curves:
            value = _value(curve, time, whole, fill)
            for cell in cells:
                self._executable.write_uniform(cell, value)


def _value(curve: Curve, time: float, whole: bool, fill: int) -> Any:
    """Return the value of a uniform: rounded for a `whole` number, repeated to `fill` a vector."""
    value = curve.at(time)
    return round(value) if whole else (value,) * fill if fill else value
