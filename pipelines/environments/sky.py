"""Skies and their suns."""

from __future__ import annotations

import math
from collections.abc import Mapping
from datetime import UTC, datetime
from functools import lru_cache, partial
from typing import Any

import numpy as np
import numpy.typing as npt
from msgspec import Struct
from rendergraph.pipelines.environments.atmosphere import (
    CLEAN_AIR_DEPTH,
    HAZE_DEPTH,
    atmosphere,
    lookup,
    sky_radiance,
    sun_color,
)
from rendergraph.pipelines.environments.panorama import SIZE, directions, picture

from rendergraph.projection import unit
from rendergraph.scene.geometry import vec3
from rendergraph.scene.model import Environment, Light, MadeImage, Vec3

DEFAULT_SUN: Vec3 = (-0.5, -0.7, -0.4)
DEFAULT_AZIMUTH = 140.0
CLEAR_DAY = 1.8
"""Turbidity at which the sky sheds a sixth of the light, and its shadows are about twice as blue as sunlight."""
SUN_LUX = 3.0
"""Illuminance of a surface that faces a sun at least `_DIMS_BELOW` high: as much as from the key light."""
OVERCAST_LUX = 2.4
"""Illuminance of the ground under an overcast sky."""
_DIMS_BELOW = 3.0  # degrees: under a lower sun the picture gets darker, as twilight does
_GROUND = 0.2  # reflectance, as that of `atmosphere`
_CLOUD_COLOR = np.array([0.96, 1.0, 1.06], np.float32)
_DISC = 40.0  # radiance of the sun's disc where a light stands for it
_SKY_ROWS, _SKY_COLUMNS = 97, 49
_LUMINANCE = np.array([0.2126, 0.7152, 0.0722], np.float32)


class Sky(Struct, frozen=True):
    """A sky.

    Attributes:
        to_sun: unit vector towards the sun.
        turbidity: haze, from 1 for clean air to 10; how many times more light is scattered than by clean air.
        overcast: 0 for a clear sky to 1 for one that is covered by clouds.
    """

    to_sun: Vec3
    turbidity: float = CLEAR_DAY
    overcast: float = 0.0

    @property
    def haze(self) -> float:
        """The density of aerosols that this turbidity stands for, as a factor of the atmosphere's own."""
        return (self.turbidity - 1) * CLEAN_AIR_DEPTH / HAZE_DEPTH


def sky(name: str, directional: Vec3 | None, values: Mapping[str, Any]) -> Environment:
    """Return a sky; `directional` is the direction of the scene's first directional light, if it has one."""
    made = Sky(_to_sun(values, directional), values.get("turbidity", CLEAR_DAY), values.get("overcast", 0.0))
    sun = _sun(made) if directional is None else None
    return Environment(_image(name, made), SIZE, sun=sun)


@lru_cache
def _image(name: str, sky: Sky) -> MadeImage:
    """One for each sky, so that scenes with the same sky share it."""
    return MadeImage(name, SIZE, partial(sky_picture, sky))


def _to_sun(values: Mapping[str, Any], directional: Vec3 | None) -> Vec3:
    """Return the unit vector towards the sun: given by its light, by place and time, by angles, or by the scene."""
    if "sun" in values:
        return vec3(-unit(np.asarray(values["sun"], np.float64)))
    if "time" in values:
        return sun_position(datetime.fromisoformat(values["time"]), *values["place"])
    if "elevation_degrees" in values or "azimuth_degrees" in values:
        up, around = (
            math.radians(values.get(key, default))
            for key, default in (("elevation_degrees", 45.0), ("azimuth_degrees", DEFAULT_AZIMUTH))
        )
        return vec3((math.cos(up) * math.sin(around), math.sin(up), -math.cos(up) * math.cos(around)))
    return vec3(-unit(np.asarray(directional or DEFAULT_SUN, np.float64)))


def sun_position(time: datetime, latitude: float, longitude: float) -> Vec3:
    """Return the unit vector towards the sun: +x is east, +y is up, -z is north. J. W. Spencer, "Fourier Series
    Representation of the Position of the Sun", 1971, which is within 0.3 degrees.

    Args:
        time: with its offset from UTC; without one it is UTC.
        latitude, longitude: in degrees, north and east are positive.
    """
    utc = time.astimezone(UTC) if time.tzinfo else time.replace(tzinfo=UTC)
    hours = utc.hour + utc.minute / 60 + utc.second / 3600
    g = 2 * math.pi / 365 * (utc.timetuple().tm_yday - 1 + (hours - 12) / 24)
    cos, sin = ([f(n * g) for n in range(4)] for f in (math.cos, math.sin))
    minutes = 229.18 * (7.5e-5 + 0.001868 * cos[1] - 0.032077 * sin[1] - 0.014615 * cos[2] - 0.040849 * sin[2])
    declination = (0.006918 - 0.399912 * cos[1] + 0.070257 * sin[1] - 0.006758 * cos[2] + 0.000907 * sin[2]) + (
        -0.002697 * cos[3] + 0.00148 * sin[3]
    )
    turned = math.radians((60 * hours + minutes + 4 * longitude) / 4 - 180)  # since the sun was highest
    north, lat = math.sin(declination), math.radians(latitude)
    flat = math.cos(declination) * math.cos(turned)
    return vec3(
        (
            -math.cos(declination) * math.sin(turned),
            math.sin(lat) * north + math.cos(lat) * flat,
            math.sin(lat) * flat - math.cos(lat) * north,
        )
    )


def _sun(sky: Sky) -> Light | None:
    """Return the sun as a light; None if clouds or the horizon hide it."""
    color = _exposed(sky) * sun_color(sky.haze, math.asin(sky.to_sun[1])) * (1 - sky.overcast)
    brightest = float(color.max())
    if brightest < 1e-3:
        return None
    return Light(
        "sun",
        "directional",
        direction=vec3([-value for value in sky.to_sun]),
        color=vec3(color / brightest),
        intensity=brightest,
    )


def _exposed(sky: Sky) -> float:
    """The factor that brings the model's light, whose sun sheds 1 outside the atmosphere, to `SUN_LUX`."""
    elevation = max(math.asin(sky.to_sun[1]), math.radians(_DIMS_BELOW))
    return SUN_LUX / float(sun_color(sky.haze, elevation) @ _LUMINANCE)


def sky_picture(sky: Sky) -> npt.NDArray[np.float16]:
    """A sky with its sun's disc, which is bright enough to be seen but sheds little, over a grey ground."""
    ahead = directions()
    to_sun = np.asarray(sky.to_sun, np.float32)
    elevation = math.asin(sky.to_sun[1])
    # A table over latitude, denser at the horizon, and over the angle around the zenith from the sun, like the paper's.
    rows = np.linspace(-1, 1, _SKY_ROWS, dtype=np.float32)
    latitude = np.sign(rows) * rows**2 * (math.pi / 2)
    around = np.linspace(0, math.pi, _SKY_COLUMNS, dtype=np.float32)
    up = np.broadcast_to(np.sin(latitude)[:, None], (_SKY_ROWS, _SKY_COLUMNS))
    cosine = up * to_sun[1] + np.cos(latitude)[:, None] * np.cos(around) * math.cos(elevation)
    table = sky_radiance(atmosphere(sky.haze), up, np.clip(cosine, -1, 1), elevation) * _exposed(sky)

    height = np.clip(ahead[..., 1], -1, 1)
    place = np.sign(height) * np.sqrt(abs(np.arcsin(height)) / (math.pi / 2))
    turn = abs(np.arctan2(ahead[..., 2], ahead[..., 0]) - math.atan2(to_sun[2], to_sun[0]))
    light = lookup(table, (place + 1) / 2, np.minimum(turn, 2 * math.pi - turn) / math.pi)

    cosine = np.clip(ahead @ to_sun, -1, 1)
    width = math.radians(0.75)  # about two texels: the real disc, 0.27°, is less than one
    disc = np.clip((cosine - math.cos(width)) / (1 - math.cos(width)) * 2, 0, 1) * (height > 0)
    color = sun_color(sky.haze, elevation)
    light = light + (disc * _DISC)[..., None] * (color / max(float(color.max()), 1e-6))

    # Moon and Spencer 1942: three times as bright at the zenith as at the horizon.
    clouds = OVERCAST_LUX * 3 / (7 * math.pi) * (1 + 2 * np.maximum(height, 0))
    clouds = np.where(height > 0, clouds, OVERCAST_LUX * _GROUND / math.pi)[..., None] * _CLOUD_COLOR
    return picture(light + (clouds - light) * sky.overcast)
