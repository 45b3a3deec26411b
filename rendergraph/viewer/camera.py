"""Move a camera by hand: orbit, pan, zoom, fly, and frame the whole scene."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
from msgspec.structs import replace

from rendergraph.projection import look_at, unit
from rendergraph.scene.geometry import vec3
from rendergraph.scene.model import Camera, Vec3

_STEEPEST = math.radians(89.0)  # at the pole, left and right would swap
_FARTHEST = 1000.0  # radii of the scene: at that distance it covers a few texels

Sphere = tuple[Vec3, float]
"""Centre and radius around the scene."""


def orbit(camera: Camera, sphere: Sphere, right: float, up: float) -> Camera:
    """Orbit the target by angles in radians: to the right, and upwards up to the pole."""
    target = _target(camera, sphere)
    arm = _eye(camera) - target
    distance = float(np.linalg.norm(arm))
    yaw = math.atan2(arm[0], arm[2]) - right
    pitch = math.asin(np.clip(arm[1] / distance, -1.0, 1.0))
    pitch = min(max(pitch + up, -_STEEPEST), _STEEPEST)
    turned = np.array([math.sin(yaw) * math.cos(pitch), math.sin(pitch), math.cos(yaw) * math.cos(pitch)])
    return _aim(camera, target + turned * distance, target, sphere)


def pan(camera: Camera, sphere: Sphere, right: float, up: float) -> Camera:
    """Move sideways together with the target, by fractions of the picture's height."""
    target = _target(camera, sphere)
    distance = float(np.linalg.norm(_eye(camera) - target))
    height = camera.height if camera.type == "orthographic" else 2.0 * distance * math.tan(_half_angle(camera))
    move = camera.transform[:3, 0] * (right * height) + camera.transform[:3, 1] * (up * height)
    return _aim(camera, _eye(camera) + move, target + move, sphere)


def zoom(camera: Camera, sphere: Sphere, factor: float) -> Camera:
    """Move nearer to the target (`factor` below 1) or farther; an orthographic view shrinks or grows."""
    if camera.type == "orthographic":
        return replace(camera, height=_within(camera.height, factor, 1e-4 * sphere[1], sphere))
    target = _target(camera, sphere)
    arm = _eye(camera) - target
    distance = _within(float(np.linalg.norm(arm)), factor, max(2.0 * camera.near, 1e-4 * sphere[1]), sphere)
    return _aim(camera, target + unit(arm) * distance, target, sphere)


def _within(length: float, factor: float, least: float, sphere: Sphere) -> float:
    """Return a length, scaled as far as the scene stays visible."""
    return max(min(length * factor, max(_FARTHEST * sphere[1], length)), least)


def fly(camera: Camera, sphere: Sphere, right: float, up: float, forward: float) -> Camera:
    """Move along the camera's axes, by fractions of the scene's radius."""
    target = _target(camera, sphere)
    move = camera.transform[:3, :3] @ np.array([right, up, -forward]) * sphere[1]
    return _aim(camera, _eye(camera) + move, target + move, sphere)


def frame(camera: Camera, sphere: Sphere) -> Camera:
    """Move back until the whole scene is in the picture."""
    center, radius = np.array(sphere[0]), sphere[1]
    distance = radius / math.sin(_half_angle(camera)) if camera.type != "orthographic" else 2.0 * radius
    closer = replace(camera, near=min(camera.near, 0.1 * radius), height=2.0 * radius)
    return _aim(closer, center + camera.transform[:3, 2] * distance, center, sphere)


def _eye(camera: Camera) -> npt.NDArray[np.float64]:
    eye: npt.NDArray[np.float64] = camera.transform[:3, 3]
    return eye


def _half_angle(camera: Camera) -> float:
    if camera.type == "frustum" and camera.frustum is not None:
        return math.atan((camera.frustum[3] - camera.frustum[2]) / 2.0 / camera.near)
    return camera.fov_y / 2.0


def _target(camera: Camera, sphere: Sphere) -> npt.NDArray[np.float64]:
    """Return the target; without one, the point on the view axis closest to the scene's centre."""
    eye, forward = _eye(camera), -camera.transform[:3, 2]
    if camera.target is not None:
        target = np.array(camera.target)
        if np.linalg.norm(target - eye) > 1e-9:
            return target
    distance = float((np.array(sphere[0]) - eye) @ forward)
    nearest: npt.NDArray[np.float64] = eye + forward * max(distance, 0.1 * sphere[1])
    return nearest


def _aim(camera: Camera, eye: npt.ArrayLike, target: npt.ArrayLike, sphere: Sphere) -> Camera:
    farthest = float(np.linalg.norm(np.asarray(eye) - np.array(sphere[0]))) + sphere[1]
    return replace(camera, transform=look_at(eye, target), target=vec3(target), far=max(camera.far, 1.01 * farthest))
