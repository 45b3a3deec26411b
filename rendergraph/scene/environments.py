"""The environments that come with the program, made in code: a studio of soft boxes, and a clear sky.

Pictures are equirectangular, 512×256, float16 radiance with an alpha of 1: column `u = 0.5 + atan2(z, x) / 2π`, row
`v = acos(y) / π` from the top.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import lru_cache, partial
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from rendergraph.document import shown
from rendergraph.errors import InputError, Problem, suggestion
from rendergraph.scene.model import Environment, Light, MadeImage, Vec3

SIZE = (512, 256)
SHIPPED: Mapping[str, str] = {
    "sky": "A clear sky with its sun (Preetham, Shirley and Smits 1999); `sun` and `turbidity` say which.",
    "studio": "Soft boxes in a grey room, as product pictures are lit; neutral in colour.",
}
"""Their names, a line each."""

DEFAULT_SUN: Vec3 = (-0.5, -0.7, -0.4)
SUN_LUX = 3.0
"""What the sun sheds on a surface that faces it, where it shines from the picture: as much as the key light."""
KCD_PER_UNIT = 55.0
"""Preetham's luminance, in kcd/m², of radiance 1: a clear sky then sheds a fifth of what its sun does on the ground."""

_Plane: TypeAlias = npt.NDArray[np.float32]
_GROUND = (0.22, 0.2, 0.18)
_ROOM = 0.22
# Wall (axis and side), middle and half sides on the room's wall, radiance. The room reaches from -1 to 1.
_BOXES = (
    ((1, 1.0), (0.0, 0.1), (0.55, 0.5), 3.6),  # overhead, along x and z
    ((0, -1.0), (0.25, 0.35), (0.55, 0.6), 2.6),  # left, along y and z
    ((0, 1.0), (0.2, 0.35), (0.75, 0.18), 2.2),  # right, a strip
    ((2, -1.0), (-0.35, 0.45), (0.22, 0.3), 1.8),  # behind, a rim light, along x and y
    ((2, 1.0), (-0.2, 0.5), (0.6, 0.3), 1.5),  # in front, beside the viewer
)
_EDGE = 0.1


def named(name: str, lights: Sequence[Light] = (), values: Mapping[str, Any] = {}) -> Environment | None:
    """The shipped environment that a bare word names; None for what has a slash or an extension, a file.

    Args:
        name: what a scene file or the command line says.
        lights, values: as `shipped` takes them.
    """
    if "." in name or "/" in name:
        return None
    if name not in SHIPPED:
        raise InputError(
            Problem("RG015", f"there is no shipped environment '{shown(name)}'{suggestion(name, SHIPPED)}")
        )
    return shipped(name, lights, values)


def shipped(name: str, lights: Sequence[Light] = (), values: Mapping[str, Any] = {}) -> Environment:
    """A shipped environment, to be made when it is looked at.

    Args:
        name: one of `SHIPPED`.
        lights: the scene's. By default the sky's sun stands where the first directional one comes from; where there is
            any light at all, the sun of the sky is there to be seen and sheds no light of its own.
        values: the scene key's `sun` and `turbidity`.
    """
    if name == "studio":
        return Environment(MadeImage("studio", SIZE, studio), SIZE)
    directional = next((light.direction for light in lights if light.type == "directional"), DEFAULT_SUN)
    sun, turbidity = values.get("sun", directional), values.get("turbidity", 3.0)
    return Environment(_sky(tuple(sun), turbidity, not lights), SIZE)


@lru_cache
def _sky(sun: Vec3, turbidity: float, shines: bool) -> MadeImage:
    """One for each sky, so that scenes that stand under the same one know it."""
    return MadeImage("sky", SIZE, partial(sky, sun, turbidity, shines=shines))


def studio() -> npt.NDArray[np.float16]:
    """A grey room with soft boxes on its walls, (256, 512, 4)."""
    directions = np.moveaxis(_directions(), -1, 0)
    light = _ROOM * (0.75 + 0.25 * directions[1])  # the floor is darker than the ceiling
    for (axis, side), middle, half, radiance in _BOXES:
        first, second = (plane for at, plane in enumerate(directions) if at != axis)
        ahead = side * directions[axis]
        on_wall = ahead >= np.maximum(abs(first), abs(second))
        ahead = np.where(on_wall, ahead, 1)
        cover = on_wall.astype(np.float32)
        for plane, center, reach in zip((first, second), middle, half, strict=True):
            cover *= np.clip((reach - abs(plane / ahead - center)) / _EDGE, 0, 1)
        light += (radiance - light) * cover
    return _picture(np.broadcast_to(light[..., None], (*light.shape, 3)))


def sky(sun: Vec3, turbidity: float, *, shines: bool) -> npt.NDArray[np.float16]:
    """A clear sky over a grey ground, (256, 512, 4): Preetham, Shirley and Smits, "A Practical Analytic Model for
    Daylight", 1999.

    Args:
        sun: where its light goes; unit length is not needed, and a sun below the horizon stands on it.
        turbidity: haze, 2 (very clear) to 10.
        shines: whether the sun's own light is in the picture; else its disc is only bright enough to be seen.
    """
    directions = _directions()
    to_sun = -np.asarray(sun, np.float64) / max(float(np.linalg.norm(sun)), 1e-12)
    zenith_angle = min(math.acos(float(np.clip(to_sun[1], -1, 1))), math.radians(88))
    around = math.atan2(to_sun[2], to_sun[0])
    flat = math.sin(zenith_angle)
    to_sun = np.array([flat * math.cos(around), math.cos(zenith_angle), flat * math.sin(around)])
    height = np.maximum(directions[..., 1], 0.01)
    cosine = np.clip(directions @ to_sun.astype(np.float32), -1, 1)
    t = turbidity
    chi = (4 / 9 - t / 120) * (math.pi - 2 * zenith_angle)
    zenith = (
        max(((4.0453 * t - 4.9710) * math.tan(chi) - 0.2155 * t + 2.4192) / KCD_PER_UNIT, 0.0),
        _zenith_chromaticity(_ZENITH_X, t, zenith_angle),
        _zenith_chromaticity(_ZENITH_Y, t, zenith_angle),
    )
    luminance, x, y = (
        value * _perez(rows, t, height, cosine) / _perez(rows, t, np.float32(1), np.float32(math.cos(zenith_angle)))
        for value, rows in zip(zenith, (_LUMINANCE, _X, _Y), strict=True)
    )
    y = np.maximum(y, 1e-3)
    light = np.maximum(np.stack([luminance * x / y, luminance, luminance * (1 - x - y) / y], axis=-1) @ _TO_RGB, 0.0)

    weight = _solid_angles()
    above = directions[..., 1] > 0
    falls = (light * (weight * np.maximum(directions[..., 1], 0) * above)[..., None]).sum(axis=(0, 1))
    falls = falls + SUN_LUX * max(float(to_sun[1]), 0.0) * _SUN_COLOR
    horizon = np.clip(-directions[..., 1] / 0.03, 0, 1)[..., None]  # haze where they meet
    light = light + (np.asarray(_GROUND) * falls / math.pi - light) * horizon

    width = math.radians(0.75)  # about two texels: the real disc, 0.27°, is less than one
    disc = np.clip((cosine - math.cos(width)) / (1 - math.cos(width)) * 2, 0, 1) * above
    spread = float((disc * weight).sum())
    full = SUN_LUX / spread if spread > 0 else 0.0
    light = light + (disc * (full if shines else min(full, 40.0)))[..., None] * _SUN_COLOR
    return _picture(light)


# Perez' A to E as slope and offset over turbidity, for luminance and the chromaticities x and y.
_LUMINANCE = ((0.1787, -1.4630), (-0.3554, 0.4275), (-0.0227, 5.3251), (0.1206, -2.5771), (-0.0670, 0.3703))
_X = ((-0.0193, -0.2592), (-0.0665, 0.0008), (-0.0004, 0.2125), (-0.0641, -0.8989), (-0.0033, 0.0452))
_Y = ((-0.0167, -0.2608), (-0.0950, 0.0092), (-0.0079, 0.2102), (-0.0441, -1.6537), (-0.0109, 0.0529))
# Zenith chromaticity: rows for turbidity squared, turbidity and 1; columns for the sun's angle cubed down to 1.
_ZENITH_X = (
    (0.00166, -0.00375, 0.00209, 0.0),
    (-0.02903, 0.06377, -0.03202, 0.00394),
    (0.11693, -0.21196, 0.06052, 0.25886),
)
_ZENITH_Y = (
    (0.00275, -0.00610, 0.00317, 0.0),
    (-0.04214, 0.08970, -0.04153, 0.00516),
    (0.15346, -0.26756, 0.06670, 0.26688),
)
_TO_RGB = np.array([[3.2406, -0.9689, 0.0557], [-1.5372, 1.8758, -0.2040], [-0.4986, 0.0415, 1.0570]], np.float32)
_SUN_COLOR = np.array([1.0, 0.94, 0.86], np.float32)


def _perez(rows: Sequence[tuple[float, float]], turbidity: float, height: Any, cosine: Any) -> Any:
    """Perez' distribution at a cosine to the zenith and a cosine to the sun."""
    a, b, c, d, e = (slope * turbidity + offset for slope, offset in rows)
    return (1 + a * np.exp(b / height)) * (1 + c * np.exp(d * np.arccos(cosine)) + e * cosine**2)


def _zenith_chromaticity(rows: Sequence[Sequence[float]], turbidity: float, angle: float) -> float:
    powers = np.array([angle**3, angle**2, angle, 1.0])
    return float(np.array([turbidity**2, turbidity, 1.0]) @ np.asarray(rows) @ powers)


def _directions() -> _Plane:
    """The unit vector of each texel's middle, (256, 512, 3)."""
    width, height = SIZE
    around = (np.arange(width, dtype=np.float32) + 0.5) / width * (2 * np.pi) - np.pi
    down = (np.arange(height, dtype=np.float32) + 0.5) / height * np.pi
    flat = np.sin(down)[:, None]
    up = np.broadcast_to(np.cos(down)[:, None], (height, width))
    return np.stack([flat * np.cos(around), up, flat * np.sin(around)], axis=-1).astype(np.float32)


def _solid_angles() -> _Plane:
    """Of each texel, (256, 1), in steradians."""
    width, height = SIZE
    edges = np.cos(np.arange(height + 1) / height * np.pi)
    return ((edges[:-1] - edges[1:]) * (2 * np.pi / width))[:, None].astype(np.float32)


def _picture(light: npt.NDArray[Any]) -> npt.NDArray[np.float16]:
    made = np.ones((*light.shape[:2], 4), np.float16)
    made[..., :3] = np.minimum(light, 65504.0)
    return made
