"""The shipped environments: skies with their suns, and the studio's boxes."""

from __future__ import annotations

import math
from datetime import datetime
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
from rendergraph.pipelines import environments
from rendergraph.pipelines.environments.sky import OVERCAST_LUX, SUN_LUX, sun_position
from rendergraph.pipelines.environments.studio import studio

from rendergraph.errors import InputError
from rendergraph.scene import animate
from rendergraph.scene.load import load
from rendergraph.scene.model import MadeImage, Scene

Floats = npt.NDArray[np.float64]


def direction(row: npt.ArrayLike, column: npt.ArrayLike) -> Floats:
    """Of the middle of a texel of 512×256; components first."""
    azimuth = (np.asarray(column, np.float64) + 0.5) / 512 * 2 * np.pi - np.pi
    polar = (np.asarray(row, np.float64) + 0.5) / 256 * np.pi
    return np.array([np.sin(polar) * np.cos(azimuth), np.cos(polar) + 0 * azimuth, np.sin(polar) * np.sin(azimuth)])


def test_the_studios_light_comes_from_above() -> None:
    """Neutral; the box overhead is the brightest, the floor the darkest."""
    picture = studio().astype(np.float64)
    np.testing.assert_array_equal(picture[..., 0], picture[..., 2])
    assert picture[:40].max() == pytest.approx(3.6, rel=1e-3)
    assert picture[200:, :, 0].mean() < 0.2 < picture[:, :, 0].mean() < picture[:56, :, 0].mean()


def read(folder: Path, environment: str, rest: str = "") -> Scene:
    (folder / "scene.yaml").write_text(
        f"scene: 1\nobjects: {{b: {{shape: box}}}}\nenvironment: {{{environment}}}\n{rest}"
    )
    return load(folder / "scene.yaml")


def picture(scene: Scene) -> Floats:
    assert scene.environment is not None
    assert isinstance(scene.environment.image, MadeImage)
    return scene.environment.image.make()[..., :3].astype(np.float64)


@pytest.mark.parametrize("to_sun", [(0.5, 0.7, 0.4), (-0.6, 0.5, 0.3), (0.2, 0.05, -0.9)])
def test_the_sun_is_seen_where_its_light_comes_from(tmp_path: Path, to_sun: tuple[float, float, float]) -> None:
    scene = animate.complete(read(tmp_path, f"file: sky, sun: [{', '.join(str(-v) for v in to_sun)}]"))
    seen = picture(scene)[..., 0]
    peak = np.unravel_index(int(seen.argmax()), seen.shape)
    (sun,) = scene.lights
    assert direction(*peak) @ -np.array(sun.direction) > math.cos(math.radians(1))


def test_the_sun_turns_and_dims_with_its_sky(tmp_path: Path) -> None:
    """`world_to_environment` of environment.glsl turns a direction by the same angle the other way."""
    frames = "keyframes: {environment.rotate_degrees: {0: 30, 1: 90}}"
    scene = animate.complete(read(tmp_path, "file: sky, sun: [-1, -1, 0], intensity: 0.5", frames))
    still = animate.complete(read(tmp_path, "file: sky, sun: [-1, -1, 0]"))
    for time, angle in ((0, 30), (1, 90)):
        (sun,), c, s = animate.at(scene, time).lights, math.cos(math.radians(angle)), math.sin(math.radians(angle))
        x, y, z = -np.array(sun.direction)
        assert np.allclose([c * x - s * z, y, s * x + c * z], np.sqrt([0.5, 0.5, 0]))
        assert sun.intensity == pytest.approx(still.lights[0].intensity / 2)


def test_a_scene_with_a_directional_light_keeps_its_own(tmp_path: Path) -> None:
    scene = animate.complete(read(tmp_path, "file: sky", "lights: {key: {type: directional, direction: [-1, -2, 0]}}"))
    assert [light.name for light in scene.lights] == ["key"]
    seen = picture(scene)[..., 0]
    toward = direction(*np.unravel_index(int(seen.argmax()), seen.shape))
    assert toward @ np.array([1, 2, 0]) / 5**0.5 > math.cos(math.radians(1)), "the sky follows the light"
    lamp = "lights: {sun: {type: point, at: [0, 3, 0]}}"
    assert [light.name for light in animate.complete(read(tmp_path, "file: sky", lamp)).lights] == ["sun", "sky_sun"]


def test_clouds_hide_the_sun() -> None:
    clear, hazy, overcast = (environments.shipped("sky", values={"overcast": o}) for o in (0, 0.5, 1))
    assert overcast.sun is None
    assert clear.sun is not None
    assert hazy.sun is not None
    assert hazy.sun.intensity == pytest.approx(clear.sun.intensity / 2)
    assert isinstance(overcast.image, MadeImage)
    light = overcast.image.make()[..., 1].astype(np.float64)
    rows = np.arange(256)
    up = np.cos((rows + 0.5) / 256 * np.pi)
    weight = np.sin((rows + 0.5) / 256 * np.pi) * (np.pi / 256) * (2 * np.pi)
    assert (light[:, 0] * weight * np.maximum(up, 0)).sum() == pytest.approx(OVERCAST_LUX, rel=2e-3)
    assert light[0, 0] == pytest.approx(3 * light[127, 0], rel=0.02), "three times as bright as the horizon"


@pytest.mark.parametrize(
    ("time", "place", "elevation", "azimuth"),
    [
        ("2026-06-21T12:00Z", (51.4778, 0), 61.96, 179.4),  # NOAA's solar calculator
        ("2026-12-21T12:00+01:00", (48.137, 11.575), 18.2, 177.0),
        ("2026-03-20T06:07:00", (0, 0), 0.0, 90.0),  # an equinox at the equator: the sun rises in the east
        ("2026-06-21T00:00Z", (69.65, 18.96), 3.8, 17.4),  # the midnight sun of Tromso
    ],
)
def test_sun_position(time: str, place: tuple[float, float], elevation: float, azimuth: float) -> None:
    x, y, z = sun_position(datetime.fromisoformat(time), *place)
    assert math.degrees(math.asin(y)) == pytest.approx(elevation, abs=0.4)
    assert math.degrees(math.atan2(x, -z)) == pytest.approx(azimuth, abs=0.6)


def test_ways_to_say_where_the_sun_is(tmp_path: Path) -> None:
    angles = read(tmp_path, "file: sky, elevation_degrees: 30, azimuth_degrees: 90").environment
    assert angles is not None
    assert angles.sun is not None
    assert np.allclose(angles.sun.direction, [-math.cos(math.pi / 6), -0.5, 0])
    dated = read(tmp_path, "file: sky, place: [51.4778, 0], time: 2026-06-21T12:00Z").environment
    assert dated is not None
    assert dated.sun is not None
    assert math.degrees(math.asin(-dated.sun.direction[1])) == pytest.approx(61.96, abs=0.4)


@pytest.mark.parametrize(
    ("values", "text"),
    [
        ("file: studio, turbidity: 3", "'turbidity' requires a sky"),
        ("file: sky, place: [1, 2]", "'place' needs 'time' beside it"),
        ("file: sky, time: 2026-06-21T12:00Z", "'time' needs 'place' beside it"),
        ("file: sky, place: [1, 2], time: 2026-13-21T12:00Z", "'time' is not a date and time"),
        ("file: sky, place: [1, 2], time: noon", "a date and time such as"),
        ("file: sky, sun: [0, -1, 0], elevation_degrees: 3", "both say where the sun is"),
    ],
)
def test_mistakes(tmp_path: Path, values: str, text: str) -> None:
    with pytest.raises(InputError, match=text):
        read(tmp_path, values)


def test_the_sun_of_dawn_is_redder_and_never_dimmer_than_the_key_light() -> None:
    suns = [environments.shipped("sky", values={"elevation_degrees": angle}).sun for angle in (90, 30, 5, 1, -2)]
    assert suns.pop() is None, "it has set"
    colors = np.array([np.array(sun.color) * sun.intensity for sun in suns if sun is not None])
    assert np.all(np.diff(colors[:, 0] / colors[:, 2]) > 0)
    lux = colors @ [0.2126, 0.7152, 0.0722]
    np.testing.assert_allclose(lux[:3], SUN_LUX, rtol=1e-5)
    assert lux[3] < SUN_LUX / 2, "twilight is darker"
