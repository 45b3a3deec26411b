"""Evaluate a scene at a moment, and add missing cameras and surroundings."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from itertools import compress
from operator import is_not
from typing import TYPE_CHECKING, Any

import numpy as np
from msgspec.structs import astuple, replace

from rendergraph.errors import InputError, Option, Place, Problem, suggestion
from rendergraph.facts import NO_EXTRA, Extra
from rendergraph.pipelines.environments.surroundings import grounded, lit
from rendergraph.scene import scene_values
from rendergraph.scene.cameras import WIDE, bounding_sphere, framing_camera
from rendergraph.scene.geometry import rigid, translation, vec3
from rendergraph.scene.model import Matrix, Orbit, Placement, Scene, Vec3

if TYPE_CHECKING:
    from rendergraph.scene.rig import Pose

_MOMENTS = 12
"""Moments of a clip that a framing camera takes into account."""


def complete(
    scene: Scene,
    camera_name: str | None = None,
    aspect: float = WIDE,
    *,
    bare: bool = False,
    shutter: float | None = None,
) -> Scene:
    """Return the scene with a camera and with light and ground (`surroundings`); the chosen camera comes first.

    Call it once, before `at`: the added light stays in place while the camera moves.

    Args:
        camera_name: name of one of the scene's cameras, or a new camera as text, `eye=0,1,5 target=0,1,0 fov=40`.
        aspect: width over height of the picture for an added camera.
        bare: add no surroundings.
        shutter: shutter of all cameras.
    """
    cameras = dict(scene.cameras)
    if not cameras:
        cameras["default"] = framing_camera(_over_clips(scene), aspect)
    if shutter is not None:
        cameras = {name: replace(camera, shutter=shutter) for name, camera in cameras.items()}
        changed = {key: {**values, "shutter": shutter} for key, values in scene.recipe.items() if key[0] == "cameras"}
        scene = replace(scene, recipe={**scene.recipe, **changed})
    if camera_name is not None and "=" in camera_name:
        cameras = {"--camera": scene_values.described_camera(camera_name, next(iter(cameras.values()))), **cameras}
    elif camera_name is not None:
        if camera_name not in cameras:
            text = f"the scene has no camera '{camera_name}'{suggestion(camera_name, cameras)}"
            raise InputError(Problem("RG322", text, Place(Option("--camera", camera_name))))
        cameras = {camera_name: cameras[camera_name], **cameras}
    first = next(iter(cameras.values()))
    return grounded(lit(replace(scene, cameras=cameras), first, bare=bare))


def moves(scene: Scene) -> bool:
    return bool(scene.keyframes) or scene.orbit is not None or any(rig.length for rig in scene.rigs)


def length(scene: Scene) -> float:
    """Return the seconds until clips and keyframes end, or an orbit closes; 0 if nothing moves."""
    ends = [rig.length for rig in scene.rigs]
    ends += [float(curve.times[-1]) for curve in scene.keyframes.values()]
    orbit = abs(scene.orbit.degrees_per_second) if scene.orbit is not None else 0.0
    return max(ends, default=0.0) or (360.0 / orbit if orbit else 0.0)


def on_turntable(scene: Scene, fps: float, frames: range, aspect: float) -> Scene:
    """Return the scene with its camera on one full circle around its target, instead of the scene's own orbit.

    A camera that `complete` has added moves to where everything stays in the picture on the whole circle.
    """
    camera = scene.camera
    if camera is not None and camera.name == "default" and ("cameras", "default") not in scene.recipe:
        camera = replace(framing_camera(_over_clips(scene), aspect, around=True), shutter=camera.shutter)
        scene = replace(scene, cameras={**scene.cameras, "default": camera})
    return replace(scene, orbit=Orbit("", 360.0 * fps / len(frames), begin=(frames[0] - 1) / fps))


def play(scene: Scene, clip: str | None = None, speed: float = 1.0, start: float = 0.0) -> Scene:
    """Return the scene of an animated file at the start of a clip, by default its first one."""
    (rig,) = scene.rigs
    chosen = rig.clips[clip or next(iter(rig.clips))]
    return _posed(replace(scene, rigs=(replace(rig, clip=chosen, speed=speed, start=start),)), 0.0)


def at_rest(scene: Scene) -> Scene:
    """Return the scene of an animated file at rest, without animation."""
    return replace(baked(_posed(scene, 0.0)), rigs=(), placements={})


def baked(scene: Scene) -> Scene:
    """Return the scene at a moment with posed meshes in place of animated ones."""
    poses = {placed.mesh: placed.pose for placed in scene.objects if placed.pose is not None}
    meshes = list(scene.meshes)
    for number, pose in poses.items():
        meshes[number] = replace(meshes[number], deform=None, **pose.vertices())
    objects = tuple(replace(placed, pose=None) if placed.pose is not None else placed for placed in scene.objects)
    return replace(scene, objects=objects, meshes=tuple(meshes)) if poses else scene


def moving_plugin_keys(scene: Scene) -> set[str]:
    """Return the sections in which keyframes change plugins' keys."""
    return {
        section for section, _, curves in scene.tracks for key, _ in curves if key in scene.plugin_keys.get(section, ())
    }


def at(scene: Scene, time_s: float) -> Scene:
    """Return the scene at a time in seconds: clips, then keyframes, then the orbit. Meshes are shared, never copied."""
    if not moves(scene):
        return scene
    first, scene = scene, _posed(scene, time_s)
    cameras: dict[str, dict[str, Any]] = {}  # cameras that follow an object, which must move first
    for section, name, curves in first.tracks:
        values = {key: curve.at(time_s) for key, curve in curves}
        if section == "cameras" and name in first.follows:
            cameras[name] = values
            continue
        recipe = scene.recipe.get((section, name), {})
        added = {key: values.pop(key) for key in scene.plugin_keys.get(section, frozenset()) & values.keys()}
        if added and section == "objects":  # parts of a file may have different values
            scene = _with_extra(scene, name, added)
        elif added:
            values["extra"] = Extra({**recipe.get("extra", NO_EXTRA), **added})
        if values:
            scene = _changed(scene, section, name, {**recipe, **values})
    if first.follows:
        scene = following(scene, cameras)
    # Clips do not move the target.
    placed = scene if any(section == "objects" for section, *_ in first.tracks) else first
    return scene if scene.orbit is None else _orbited(scene, time_s, placed)


def _posed(scene: Scene, time_s: float) -> Scene:
    """Return the scene with its files' clips applied in each placement of a file."""
    for rig in scene.rigs:
        worlds, parts = rig.at(time_s)
        local: Any = [part[0] for part in parts], worlds[list(rig.lights)], worlds[list(rig.cameras)]
        objects, placements, moved = list(scene.objects), dict(scene.placements), {}
        poses: dict[int, Pose] = {}
        for name, _ in rig.placements:
            kinds = [
                [(key, now, np.array_equal(was, now)) for (key, was), now in zip(*each, strict=True)]
                for each in zip(astuple(placements[name]), local, strict=True)
            ]
            placements[name] = Placement(*(tuple((key, now) for key, now, _ in kind) for kind in kinds))
            moved[name] = Placement(*(tuple((key, now) for key, now, same in kind if not same) for kind in kinds))
            for (index, _), (_, *state) in zip(placements[name].objects, parts, strict=True):
                number = objects[index].mesh
                if (deform := scene.meshes[number].deform) is not None:
                    if number not in poses:
                        poses[number] = deform.pose(*state)
                    objects[index] = replace(objects[index], pose=poses[number])
        scene = _placed_again(replace(scene, objects=tuple(objects), placements=placements), rig.placements, moved)
    return scene


def _over_clips(scene: Scene) -> Scene:
    """Return the scene with animated objects at several moments of their clips, for a camera that frames all."""
    longest = max((rig.length for rig in scene.rigs), default=0.0)
    moments = [_posed(scene, longest * number / _MOMENTS).objects for number in range(1, _MOMENTS if longest else 0)]
    changed = [placed for moment in moments for placed in compress(moment, map(is_not, moment, scene.objects))]
    return replace(scene, objects=(*scene.objects, *changed)) if changed else scene


def following(scene: Scene, changed: Mapping[str, Mapping[str, Any]]) -> Scene:
    """Return the scene with cameras turned to the objects that they follow; `changed` are their other new values."""
    for name, parts in scene.follows.items():
        recipe = scene.recipe["cameras", name]
        scene = _changed(scene, "cameras", name, {**recipe, **changed.get(name, {})}, _middle(scene, parts))
    return scene


def _middle(scene: Scene, parts: Iterable[int]) -> Vec3:
    """Return the centre of the boxes of objects at rest; a skin moves it by the mean of its joints, which is steady."""
    corners = []
    for placed in (scene.objects[index] for index in parts):
        low, high = np.array(scene.meshes[placed.mesh].box, np.float64)
        center, extent = (low + high) / 2, (high - low) / 2
        if placed.pose is not None and len(placed.pose.joints):
            mean = placed.pose.joints.mean(axis=0)
            center = mean[:, :3] @ center + mean[:, 3]
        center = placed.transform[:3, :3] @ center + placed.transform[:3, 3]
        extent = np.abs(placed.transform[:3, :3]) @ extent
        corners += [center - extent, center + extent]
    low, high = np.min(corners, axis=0), np.max(corners, axis=0)
    return vec3((low + high) / 2)


def _orbited(scene: Scene, time_s: float, placed: Scene) -> Scene:
    """Return the scene with its camera on the orbit; `placed` has the same objects, possibly with cached bounds."""
    assert scene.orbit is not None  # checked by the caller
    name = scene.orbit.camera or next(iter(scene.cameras), "")
    if name not in scene.cameras:
        return scene
    camera = scene.cameras[name]
    target = camera.target or bounding_sphere(placed)[0]
    angle = math.radians(scene.orbit.degrees_per_second * (time_s - scene.orbit.begin))
    c, s = math.cos(angle), math.sin(angle)
    turn = np.array([[c, 0, s, 0], [0, 1, 0, 0], [-s, 0, c, 0], [0, 0, 0, 1]])
    transform = translation(target) @ turn @ translation([-value for value in target]) @ camera.transform
    return replace(scene, cameras={**scene.cameras, camera.name: replace(camera, transform=transform)})


def _changed(scene: Scene, section: str, name: str, values: Mapping[str, Any], followed: Vec3 | None = None) -> Scene:
    """Return the scene with changed values of one entry of a section."""
    if section == "objects":
        world, copies = scene_values.placed(values), scene.copies.get(("objects", name))
        return _placed_again(scene, [(name, world)] if copies is None else copies.placed(name, world), scene.placements)
    if section == "environment":
        turn, intensity = math.radians(values.get("rotate_degrees", 0.0)), values.get("intensity", 1.0)
        if scene.environment is None:
            return scene
        environment = replace(scene.environment, intensity=intensity, rotate=turn)
        sun = environment.sunlight  # the only directional light, if any
        lights = tuple(sun if sun is not None and light.type == "directional" else light for light in scene.lights)
        return replace(scene, environment=environment, lights=lights)
    try:
        if section == "cameras":
            return replace(scene, cameras={**scene.cameras, name: scene_values.camera(name, values, followed)})
        if section == "lights":
            light = scene_values.light(name, values)
            copies = scene.copies.get((section, name))
            made = {entry.name: entry for entry in ([light] if copies is None else copies.lights(light))}
            return replace(scene, lights=tuple(made.get(entry.name, entry) for entry in scene.lights))
    except ValueError as problem:  # two moving values, such as eye and target or near and far, can meet
        text = f"keyframes bring {section}.{name} to an impossible state: {problem}"
        raise InputError(Problem("RG323", text, Place(str(scene.source)) if scene.source else None)) from None
    materials = list(scene.materials)
    for number, entry in enumerate(materials):
        if entry.name == name:
            materials[number] = scene_values.material(name, values, entry.textures)
    return replace(scene, materials=tuple(materials))


def _with_extra(scene: Scene, name: str, added: Mapping[str, Any]) -> Scene:
    """Return the scene with changed values of plugins' keys in every part of an object."""
    objects = list(scene.objects)
    for index in scene.parts_of(name):
        objects[index] = replace(objects[index], extra=Extra({**objects[index].extra, **added}))
    return replace(scene, objects=tuple(objects))


def _placed_again(scene: Scene, copies: Iterable[tuple[str, Matrix]], placements: Mapping[str, Placement]) -> Scene:
    """Return the scene with copies of files and shapes moved, each to its transform."""
    objects, lights, cameras = list(scene.objects), list(scene.lights), dict(scene.cameras)
    for copy, matrix in copies:
        placement = placements.get(copy, Placement())
        for index, local in placement.objects:
            objects[index] = replace(objects[index], transform=matrix @ local)
        for index, local in placement.lights:
            lights[index] = scene_values.moved_light(lights[index], matrix @ local)
        for camera, local in placement.cameras:
            cameras[camera] = replace(cameras[camera], transform=rigid(matrix @ local))
    return replace(scene, objects=tuple(objects), lights=tuple(lights), cameras=cameras)
