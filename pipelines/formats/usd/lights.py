"""Lights and cameras of USD: units are UsdLux's (radiance, or power for normalised lights), angles become radians.

Lights with a surface are drawn as points or spots of the same intensity along their axis, because the renderers here
know punctual lights.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from pxr import UsdGeom, UsdLux

from rendergraph.document import shown
from rendergraph.projection import unit
from rendergraph.scene.model import Camera, Environment, Light, MadeImage, Matrix, Vec3
from rendergraph.scene.reading import Reading

_LATITUDES = -math.pi / 2
"""Turns our images, whose middle is +X, to those of OpenEXR, whose middle is +Z."""


def lights_of(prim: Any, name: str, transform: Matrix, time: Any, reading: Reading) -> list[Light]:
    """Return the light of a prim, of the intensity that it has along its axis, in lux or candela."""

    def get(key: str, default: float) -> float:
        attribute = prim.GetAttribute(f"inputs:{key}")
        value = attribute.Get(time) if attribute else None
        return default if value is None else float(value)

    kind, color, level = prim.GetTypeName(), *_emission(prim, time)
    is_normalised = bool(get("normalize", 0.0))
    x, y, z = unit(transform[:3, :3] @ (0.0, 0.0, -1.0)).tolist()
    px, py, pz = transform[:3, 3].tolist()
    if kind == "DistantLight":
        solid_angle = math.pi * math.sin(math.radians(get("angle", 0.53)) / 2) ** 2  # seen under the cosine
        level *= 1.0 if is_normalised or not solid_angle else solid_angle
        return [Light(name, "directional", direction=(x, y, z), color=color, intensity=level)]
    u, v, w = np.linalg.norm(transform[:3, :3], axis=0).tolist()
    radius, is_round = get("radius", 0.5), kind in ("SphereLight", "DiskLight")
    if kind == "RectLight":
        area = projected = get("width", 1.0) * u * get("height", 1.0) * v
    elif is_round:
        projected = math.pi * radius * u * radius * v
        area = 4 * math.pi * (radius * (u + v + w) / 3) ** 2 if kind == "SphereLight" else projected
    else:
        reading.warn("RG330", f"light {kind}", f"'{shown(kind)}' is no light that is drawn; it is left out")
        return []
    if is_normalised or not area:
        level *= 0.25 if kind == "SphereLight" else 1.0  # of a light's surface, a quarter of a ball's is seen
    else:
        level *= projected
    cone = prim.GetAttribute("inputs:shaping:cone:angle")
    angle = math.radians(float(cone.Get(time))) if cone and cone.HasAuthoredValue() else math.pi
    if kind == "SphereLight" and angle >= math.pi / 2:
        return [Light(name, "point", (px, py, pz), color=color, intensity=level)]
    outer = min(angle, math.pi / 2)
    soft = prim.GetAttribute("inputs:shaping:cone:softness")
    inner = outer * (1 - min(max(float(soft.Get(time) or 0.0) if soft else 0.0, 0.0), 1.0))
    if kind != "SphereLight":
        text = f"'{shown(name)}' shines from its middle, as a spot; light that a surface sends has no counterpart here"
        reading.warn("RG330", "area light", text)
        inner = 0.0  # dimmer to the sides, as a surface seen aslant
    inner = min(inner, 0.999 * outer)
    return [Light(name, "spot", (px, py, pz), (x, y, z), color, level, inner=inner, outer=outer)]


def environment_of(prim: Any, transform: Matrix, time: Any, reading: Reading) -> Environment | None:
    """Return the environment of a dome light."""
    color, level = _emission(prim, time)
    forward, up = transform[:3, :3] @ (0.0, 0.0, 1.0), unit(transform[:3, :3] @ (0.0, 1.0, 0.0))
    if prim.IsA(UsdLux.DomeLight_1) and abs(up[1]) < 0.99:  # its pole follows the stage's
        forward, up = np.array([0.0, 0.0, 1.0]), np.array([0.0, 1.0, 0.0])
    if abs(up[1]) < 0.99:
        reading.warn("RG330", "dome", "a dome that is tilted stands upright; it turns about the vertical axis alone")
    rotate = _LATITUDES + math.atan2(forward[0], forward[2])
    asset = prim.GetAttribute("inputs:texture:file").Get(time)
    if not asset or not asset.path:
        texel = np.array([*color, 1.0], np.float16)
        image = MadeImage(shown(prim.GetName()), (4, 2), lambda: np.tile(texel, (2, 4, 1)))
        return Environment(image, image.size, level, rotate)
    if max(color) - min(color) > 1e-3:
        reading.warn("RG330", "dome colour", "the colour of a dome with an image is left out; its brightness is kept")
    source = reading.image(reading.resolve(asset.resolvedPath or asset.path), "environment")
    return Environment(source, source.size, level * max(color), rotate)


def camera_of(prim: Any, name: str, transform: Matrix, time: Any, to_metres: Matrix) -> Camera:
    """Return a camera; the picture's aspect decides on the horizontal angle."""
    found = UsdGeom.Camera(prim).GetCamera(time)
    rigid = np.eye(4)
    rigid[:3, :3] = transform[:3, :3] / np.linalg.norm(transform[:3, :3], axis=0)
    rigid[:3, 3] = transform[:3, 3]
    metres = float(np.linalg.norm(to_metres[:3, 0]))
    near, far = (float(value) * metres for value in (found.clippingRange.min, found.clippingRange.max))
    if found.projection == found.Orthographic:
        height = float(found.verticalAperture) / 10 * metres  # apertures are tenths of the stage's unit
        return Camera(name, rigid, "orthographic", height=height, near=near, far=far)
    angle = math.radians(float(found.GetFieldOfView(found.FOVVertical)))
    return Camera(name, rigid, fov_y=angle, near=max(near, 1e-4), far=far)


def _emission(prim: Any, time: Any) -> tuple[Vec3, float]:
    """The colour, with that of its temperature, and the intensity with its exposure."""
    light = UsdLux.LightAPI(prim)
    r, g, b = (max(0.0, float(value)) for value in light.GetColorAttr().Get(time))
    if light.GetEnableColorTemperatureAttr().Get(time):
        warm = UsdLux.BlackbodyTemperatureAsRgb(light.GetColorTemperatureAttr().Get(time))
        r, g, b = (value * float(factor) for value, factor in zip((r, g, b), warm, strict=True))
    level = float(light.GetIntensityAttr().Get(time)) * 2.0 ** float(light.GetExposureAttr().Get(time))
    return (r, g, b), max(0.0, level)
