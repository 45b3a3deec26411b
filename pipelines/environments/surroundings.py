"""What a scene does not say of its surroundings: a key light and the studio, at suitable levels, and a ground."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from msgspec.structs import replace
from rendergraph.pipelines.environments import shipped

from rendergraph.errors import Place, Problem
from rendergraph.projection import unit
from rendergraph.scene.cameras import lowest_point
from rendergraph.scene.geometry import vec3
from rendergraph.scene.model import Camera, Light, Material, Mesh, Object, Scene

KEY_LUX = 3.0
STUDIO_FILL = 0.6
"""Intensity of the studio beside a key light: at full strength, both together overexpose a white surface."""
MOST_CHANGE = 8.0
"""Lights that illuminate by less or more than `KEY_LUX` by this factor are in other units, and are scaled."""
GROUND = Material("ground", base_color=(0.3, 0.3, 0.3, 1.0), roughness=0.2, shadow_catcher=True)
GROUND_EXTENT = 12.0
"""From the middle of the ground to its sides, where nothing is seen of it, as a multiple of the objects' radius."""
GROUND_HEIGHT = 2.5
"""Height from which the environment is projected on the ground, also in radii."""
_BRIGHT = 90  # percentile of the illuminance of surfaces: what is well lit, without the vertices beside a lamp
_MOST_POINTS = 4096
_LUMINANCE = np.array([0.2126, 0.7152, 0.0722])


def key_light(scene: Scene, camera: Camera) -> Light:
    """Return the light of a scene without one: 3 lux over the viewer's left shoulder."""
    taken = {light.name for light in scene.lights}
    direction = unit(camera.transform[:3, :3] @ np.array([1.0, -1.0, -1.0]))
    return Light(
        "key" if "key" not in taken else "key_light", "directional", direction=vec3(direction), intensity=KEY_LUX
    )


def grounded(scene: Scene) -> Scene:
    """Return the scene with a ground that touches its lowest point, if it wants one.

    The ground is a square that casts no shadow and catches those of others. It shows the environment from a point above
    the middle of the objects, and towards its sides more and more as the background does, so that no edge is seen.
    """
    if scene.ground is None:
        return scene
    low, high = (np.array(corner) for corner in scene.bounds)
    center, radius = (low + high) / 2, float(np.linalg.norm(high - low)) / 2
    half = GROUND_EXTENT * radius
    center[1] = lowest_point(scene) - 1e-4 * radius  # not in the plane of what stands on it
    corners = np.array([(-half, 0, -half), (-half, 0, half), (half, 0, half), (half, 0, -half)], np.float32)
    normals = np.tile(np.array([(0, 1, 0)], np.float32), (4, 1))
    mesh = Mesh("ground", corners, np.array([(0, 1, 2), (0, 2, 3)], np.uint32), normals)
    transform = np.eye(4)
    transform[:3, 3] = center
    taken = {placed.name for placed in scene.objects}
    name = next(name for name in ("ground", "environment_ground") if name not in taken)
    placed = Object(name, len(scene.meshes), len(scene.materials), transform, casts_shadow=False, node=name)
    environment = scene.environment
    if environment is not None:
        x, y, z = center.tolist()
        environment = replace(environment, projection=(x, y + (scene.ground or GROUND_HEIGHT * radius), z, half))
    return replace(
        scene,
        objects=(*scene.objects, placed),
        meshes=(*scene.meshes, mesh),
        materials=(*scene.materials, GROUND),
        environment=environment,
    )


def lit(scene: Scene, camera: Camera, *, bare: bool = False) -> Scene:
    """Return the scene with light; `bare` adds no surroundings.

    A sky brings its sun, if the scene has no directional light. A scene with neither lights nor an environment gets a
    key light and the `studio`. A mesh file cannot say what is around it, so the studio also fills the shadows of its
    own lights, and those of a scene that wants a ground. Files in photometric units have lights that are thousands of
    times brighter: all of them are scaled by one factor, with a warning.
    """
    studio = shipped("studio")
    if not scene.lights and scene.environment is None:
        environment = None if bare else replace(studio, intensity=STUDIO_FILL)
        return replace(scene, lights=(key_light(scene, camera),), environment=environment)
    if scene.environment is not None and (sun := scene.environment.sunlight) is not None:
        name = "sun" if all(light.name != "sun" for light in scene.lights) else "sky_sun"
        return replace(scene, lights=(*scene.lights, replace(sun, name=name)))
    if bare or scene.source is None or scene.source.suffix.lower() in (".yaml", ".yml"):
        if not bare and scene.ground is not None and scene.environment is None:
            return replace(scene, environment=replace(studio, intensity=STUDIO_FILL))
        return scene
    level = typical_illuminance(scene)
    if level > 0 and not KEY_LUX / MOST_CHANGE < level < KEY_LUX * MOST_CHANGE:
        scene = _scaled(scene, KEY_LUX / level)
    environment = scene.environment or replace(studio, intensity=STUDIO_FILL)
    return replace(scene, environment=environment)


def typical_illuminance(scene: Scene) -> float:
    """Return the illuminance in lux, or what stands for it, of well lit surfaces without shadows; 0 if none is lit."""
    points, normals = _surface_points(scene)
    total = np.zeros(len(points))
    for light in scene.lights:
        if light.type == "directional":
            toward = np.broadcast_to(-np.array(light.direction), points.shape)
            level = np.full(len(points), light.intensity)
        else:
            offset = np.array(light.position) - points
            distance = np.maximum(np.linalg.norm(offset, axis=1), 1e-6)
            toward = offset / distance[:, None]
            level = light.intensity / distance**2
            if light.range:
                level = level * np.clip(1 - (distance / light.range) ** 4, 0, 1)
            if light.type == "spot":
                cosine = -(toward @ np.array(light.direction))
                inner, outer = np.cos(light.inner), np.cos(light.outer)
                level = level * np.clip((cosine - outer) / max(0.001, inner - outer), 0, 1) ** 2
        total += level * (np.array(light.color) @ _LUMINANCE) * np.maximum((toward * normals).sum(axis=1), 0)
    found = total[total > 0]
    return float(np.percentile(found, _BRIGHT)) if found.size else 0.0


def _surface_points(scene: Scene) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    """Return positions and unit normals of vertices of all visible objects, in world space, each of shape (n, 3)."""
    visible = [entry for entry in scene.objects if not entry.hidden]
    points, normals = [np.zeros((0, 3))], [np.zeros((0, 3))]
    for entry in visible[:: max(1, len(visible) // _MOST_POINTS)]:
        mesh, linear = scene.meshes[entry.mesh], entry.transform[:3, :3]
        step = max(1, len(mesh.positions) * len(visible) // _MOST_POINTS)
        streams = {"positions": mesh.positions, "normals": mesh.normals} if not entry.pose else entry.pose.vertices()
        points.append(streams["positions"][::step].astype(np.float64) @ linear.T + entry.transform[:3, 3])
        normals.append(streams["normals"][::step].astype(np.float64) @ np.linalg.pinv(linear))
    directions = np.concatenate(normals)
    return np.concatenate(points), directions / np.maximum(np.linalg.norm(directions, axis=1, keepdims=True), 1e-30)


def _scaled(scene: Scene, factor: float) -> Scene:
    lights = tuple(replace(light, intensity=light.intensity * factor) for light in scene.lights)
    level = KEY_LUX / factor
    lux = f"{level:,.0f}" if level >= 10 else f"{level:.2g}"
    text = (
        f"the lights illuminate by about {lux} lux, so all of them are scaled by {factor:.3g}; "
        "`--environment none` leaves them as they are"
    )
    place = Place(str(scene.source)) if scene.source else None
    problem = Problem("RG334", text, place, severity="warning")
    return replace(scene, lights=lights, warnings=(*scene.warnings, problem))
