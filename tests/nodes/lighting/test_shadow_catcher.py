"""Shadow catchers and the ground against closed forms, in geometry passes, deferred lighting and path tracing."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest

import rendergraph as rg
from rendergraph.images import write

Floats = npt.NDArray[np.float64]
SIZE = (96, 64)
EYE, TARGET, FOV = (1.0, 2.0, 5.0), (0.0, 0.5, 0.0), 50.0
MEAN, SLOPE = np.array([1.0, 0.8, 0.6]), np.diag([0.4, 0.3, 0.2])  # radiance MEAN + SLOPE · direction
LUX, COLOR = 2.0, np.array([1.0, 0.5, 0.25])
SCENE = """scene: 1
objects: {box: {shape: box, size: [1, 1, 1], at: [0, 0.5, 0], material: %s}}
materials:
  air: {base_color: [1, 1, 1, 0], alpha_mode: blend}
  black: {base_color: 0, specular: 0}
lights: {sun: {type: directional, direction: [1, -1, 0], intensity: 2, color: [1, 0.5, 0.25]}}
cameras: {main: {eye: [1, 2, 5], target: [0, 0.5, 0], fov_y_degrees: 50}}
environment: {file: linear.exr, ground: true, ground_height: 2}
"""
RADIUS = np.sqrt(3) / 2  # of the box's sphere


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with an environment whose radiance is linear in the direction, and scenes in it."""
    made = tmp_path_factory.mktemp("catcher")
    width, height = 256, 128
    turn = 2 * np.pi * ((np.arange(width) + 0.5) / width - 0.5)
    down = np.pi * (np.arange(height)[:, None] + 0.5) / height
    up = np.broadcast_to(np.cos(down), (height, width))
    directions = np.stack([np.sin(down) * np.cos(turn), up, np.sin(down) * np.sin(turn)], axis=-1)
    write(made / "linear.exr", radiance_of(directions).astype(np.float32))
    for name in ("air", "black"):
        (made / f"{name}.yaml").write_text(SCENE % name)
    return made


def radiance_of(directions: Floats) -> Floats:
    return np.asarray(MEAN + directions @ SLOPE)


def rays() -> Floats:
    """Unit directions through the middles of all pixels."""
    front = np.subtract(TARGET, EYE) / np.linalg.norm(np.subtract(TARGET, EYE))
    right = np.cross(front, (0, 1, 0)) / np.linalg.norm(np.cross(front, (0, 1, 0)))
    x = (2 * (np.arange(SIZE[0]) + 0.5) / SIZE[0] - 1) * SIZE[0] / SIZE[1]
    y = (1 - 2 * (np.arange(SIZE[1]) + 0.5) / SIZE[1])[:, None]
    tall = np.tan(np.radians(FOV) / 2)
    along = front + tall * (x[None, :, None] * right + y[..., None] * np.cross(right, front))
    return np.asarray(along / np.linalg.norm(along, axis=-1, keepdims=True))


def ground_points() -> tuple[Floats, npt.NDArray[np.bool_]]:
    """Where rays meet the ground, and which do, within its square."""
    along = rays()
    with np.errstate(divide="ignore"):
        points = np.array(EYE) - along * (EYE[1] / along[..., 1:2])
    met = (along[..., 1] < 0) & (abs(points[..., [0, 2]]) < 12 * RADIUS).all(axis=-1)
    return points, met


def expected_picture() -> Floats:
    """The environment as ground and background show it, without anything that shadows it."""
    along, (points, met) = rays(), ground_points()
    share = np.clip((np.linalg.norm(points[..., [0, 2]], axis=-1) / (12 * RADIUS) - 0.3) / 0.7, 0, 1)
    fade = np.where(met, share * share * (3 - 2 * share), 1)[..., None]
    projected = points - (0.0, 2.0, 0.0)
    projected /= np.linalg.norm(projected, axis=-1, keepdims=True)
    shown = projected * (1 - fade) + along * fade
    return radiance_of(shown / np.linalg.norm(shown, axis=-1, keepdims=True))


@pytest.fixture
def drawn(session: rg.Session, folder: Path) -> Callable[..., Floats]:
    """`drawn(pipeline, scene, *sets, **selection)`: scene-linear RGBA as float64."""

    def draw(pipeline: str, scene: str, *sets: str, **selection: object) -> Floats:
        keywords: dict[str, object] = {"size": SIZE, "sets": sets, **selection}
        loaded = rg.load(pipeline, scene=folder / f"{scene}.yaml", **keywords)  # type: ignore[arg-type]
        return np.asarray(session.render(loaded, outputs=["radiance"])["radiance"], np.float64)

    return draw


def at(picture: Floats, x: float, z: float) -> Floats:
    """The pixel that shows a point of the ground."""
    points, met = ground_points()
    away = np.where(met, np.hypot(points[..., 0] - x, points[..., 2] - z), np.inf)
    return np.asarray(picture[np.unravel_index(np.argmin(away), away.shape)])


@pytest.mark.nightly(keep=2)
@pytest.mark.parametrize(
    ("pipeline", "sets"),
    [
        ("forward", ()),
        ("forward-multipass", ()),
        ("deferred", ()),
        ("deferred-stencil-lights", ()),
        ("shading-phong", ()),
        ("shading-gouraud", ()),
        ("shading-unlit", ()),
        ("path-traced", ("light.samples=1", "light.antialiasing=false")),
    ],
)
def test_ground_without_shadows_is_the_environment(
    drawn: Callable[..., Floats], pipeline: str, sets: tuple[str, ...]
) -> None:
    found = drawn(pipeline, "air", *sets)
    points, _ = ground_points()
    clear = np.hypot(points[..., 0], points[..., 2]) > 0.4  # the map's filter blurs around its poles
    np.testing.assert_allclose(found[clear][:, :3], expected_picture()[clear], rtol=4e-3)
    np.testing.assert_allclose(found[..., :3], expected_picture(), rtol=0.02)
    assert ((found[..., 3] == 1) == ground_points()[1]).mean() > 0.999


@pytest.mark.nightly(keep=1)
@pytest.mark.parametrize("pipeline", ["forward", "forward-multipass", "deferred", "deferred-stencil-lights"])
def test_a_shadow_leaves_the_light_of_the_environment(drawn: Callable[..., Floats], pipeline: str) -> None:
    """The irradiance of an environment that is linear in the direction is π (MEAN + 2/3 SLOPE · normal)."""
    found, unshadowed = drawn(pipeline, "black"), expected_picture()
    environment = np.pi * (MEAN + 2 / 3 * SLOPE[1])
    sun = LUX * COLOR * np.sqrt(0.5)
    ratio = environment / (environment + sun)
    np.testing.assert_allclose(at(found, 1.0, 0.0)[:3], at(unshadowed, 1.0, 0.0) * ratio, rtol=4e-3)
    np.testing.assert_allclose(at(found, 1.0, 1.0)[:3], at(unshadowed, 1.0, 1.0), rtol=4e-3)


def test_phong_shading_leaves_it_too(drawn: Callable[..., Floats]) -> None:
    """Empirical models reflect the irradiance of lights without 1/π."""
    found, unshadowed = drawn("shading-phong", "black"), expected_picture()
    environment = MEAN + 2 / 3 * SLOPE[1]
    ratio = environment / (environment + LUX * COLOR * np.sqrt(0.5))
    np.testing.assert_allclose(at(found, 1.0, 0.0)[:3], at(unshadowed, 1.0, 0.0) * ratio, rtol=4e-3)


@pytest.mark.nightly(keep=1)
@pytest.mark.parametrize(
    ("pipeline", "sets"),
    [
        ("forward", ()),
        ("forward-multipass", ()),
        ("deferred", ()),
        ("path-traced", ("light.samples=4", "light.max_bounces=1")),
    ],
)
def test_without_a_backdrop_alpha_is_darkness(
    drawn: Callable[..., Floats], pipeline: str, sets: tuple[str, ...]
) -> None:
    """Composited over the background, shadows darken it."""
    sets = (*sets, "light.ambient=0")
    found = drawn(pipeline, "black", *sets, environment=Path("none"), ground=True)
    np.testing.assert_allclose(at(found, 1.0, 0.0), (0, 0, 0, 1), atol=1e-3)
    np.testing.assert_allclose(at(found, 1.0, 1.2), (0, 0, 0, 0), atol=1e-3)
    found = drawn(pipeline, "black", *sets, "light.background=0.5", environment=Path("none"), ground=True)
    np.testing.assert_allclose(at(found, 1.0, 0.0), (0, 0, 0, 1), atol=1e-3)
    np.testing.assert_allclose(at(found, 1.0, 1.2), (0.5, 0.5, 0.5, 0), atol=1e-3)


def test_paths_are_occluded_by_a_ball(session: rg.Session, folder: Path) -> None:
    """A ball of radius r on a plane covers 1 / (1 + (d/r)²)^1.5 of the irradiance at a distance d, if all is white."""
    write(folder / "white.exr", np.ones((64, 128, 3), np.float32))
    (folder / "ball.yaml").write_text(
        "scene: 1\nobjects: {ball: {shape: sphere, radius: 1, segments: 64, rings: 32, material: black}}\n"
        "materials: {black: {base_color: 0, specular: 0}}\n"
        "cameras: {main: {eye: [0, 9, 0], target: [0, 0, 0], up: [0, 0, -1], height: 8}}\n"
        "environment: {file: white.exr, ground: true}\n"
    )
    side = 48
    pipeline = rg.load("path-traced", scene=folder / "ball.yaml", size=(side, side), sets=["light.samples=32"])
    found = np.asarray(session.render(pipeline, outputs=["radiance"])["radiance"], np.float64)[..., :3]
    place = (np.arange(side) + 0.5) * 8 / side - 4
    distance = np.hypot(*np.meshgrid(place, place))
    for near, far in ((1.5, 2.0), (2.0, 2.5), (2.5, 3.0), (3.0, 4.0)):
        ring = (distance > near) & (distance < far)
        expected = (1 - (1 + distance[ring] ** 2) ** -1.5).mean()
        assert found[ring].mean() == pytest.approx(expected, abs=4e-3)


def test_reflections_show_the_projected_environment(session: rg.Session, folder: Path) -> None:
    """Rays that a mirror reflects to the ground meet what the camera would see there."""
    (folder / "mirror.yaml").write_text(
        "scene: 1\nobjects: {ball: {shape: sphere, radius: 1, segments: 256, rings: 128, material: mirror}}\n"
        "materials: {mirror: {base_color: 1, metallic: 1, roughness: 0}}\n"
        "cameras: {main: {eye: [1, 2, 5], target: [0, 0.5, 0], fov_y_degrees: 50}}\n"
        "environment: {file: linear.exr, ground: true, ground_height: 2}\n"
    )
    sets = ["light.occlusion=null"]
    pipeline = rg.load("hybrid", scene=folder / "mirror.yaml", size=SIZE, sets=sets)
    found = np.asarray(session.render(pipeline, outputs=["radiance"])["radiance"], np.float64)
    along, eye = rays(), np.array(EYE)
    toward = along @ eye
    inside = toward**2 - eye @ eye + 1
    near = -toward - np.sqrt(np.maximum(inside, 0))
    normal = eye + near[..., None] * along
    mirrored = along - 2 * (along * normal).sum(axis=-1, keepdims=True) * normal
    with np.errstate(divide="ignore"):
        points = normal + mirrored * ((-1 - normal[..., 1:2]) / mirrored[..., 1:2])
    far = np.linalg.norm(points[..., [0, 2]], axis=-1)
    checked = (inside > 0.1) & (mirrored[..., 1] < -0.1) & (far < 0.3 * 12 * np.sqrt(3))
    assert checked.sum() > 50
    projected = points - (0.0, 1.0, 0.0)
    expected = radiance_of(projected / np.linalg.norm(projected, axis=-1, keepdims=True))
    np.testing.assert_allclose(found[checked][:, :3], expected[checked], rtol=0.02)


def whitened(session: rg.Session, folder: Path, pipeline: str, height: float, size: tuple[int, int]) -> Floats:
    """What a white wall of this height, 5.9 m ahead, adds to the picture of a black one; its mean over the channels."""
    pictures = []
    for color in (0, 1):
        scene = folder / f"wall-{height}-{color}.yaml"
        scene.write_text(
            f"scene: 1\nobjects: {{wall: {{shape: box, size: [4, {height}, 0.2], at: [0, {height / 2}, -1], material: flat}}}}\n"
            f"materials: {{flat: {{base_color: {color}, unlit: true}}}}\n"
            "cameras: {main: {eye: [0, 1.5, 5], target: [0, 1.5, 0], fov_y_degrees: 60}}\n"
            "environment: {file: linear.exr, ground: true}\n"
        )
        loaded = rg.load(pipeline, scene=scene, size=size)
        pictures.append(np.asarray(session.render(loaded, outputs=["radiance"])["radiance"], np.float64)[..., :3])
    return np.asarray((pictures[1] - pictures[0]).mean(axis=2))


@pytest.mark.nightly(keep=1)
@pytest.mark.parametrize("pipeline", ["forward", "forward-multipass", "shading-gouraud", "deferred"])
def test_the_ground_mirrors_what_stands_on_it(session: rg.Session, folder: Path, pipeline: str) -> None:
    """Before the wall it adds the ground's reflectance for the angle, and beside it nothing."""
    difference = whitened(session, folder, pipeline, 3, (80, 64))
    y = (1 - 2 * (np.arange(64) + 0.5) / 64) * np.tan(np.radians(30))
    rows = slice(51, 60)  # of the ground, 0.4 to 2.6 m from the wall
    cosine = -y[rows] / np.hypot(1, y[rows])
    expected = 0.04 + 0.36 * (1 - cosine) ** 5
    np.testing.assert_allclose(difference[rows, 36:44].mean(axis=1), expected, rtol=0.01)
    assert np.abs(difference[rows, :8]).max() < 1e-3


@pytest.mark.nightly(keep=1)
@pytest.mark.parametrize("pipeline", ["forward", "deferred"])
def test_a_mirrored_edge_lies_as_far_below_the_ground(session: rg.Session, folder: Path, pipeline: str) -> None:
    """The mirror image of a wall ends where a wall would that goes as deep as this one is high."""
    difference = whitened(session, folder, pipeline, 0.5, (64, 256))[:, 32]
    tall = np.tan(np.radians(30))
    foot, end = (128 * (1 + y / 5.9 / tall) for y in (1.5, 2.0))  # rows of the ground line and of the mirrored edge
    below = difference[int(foot) + 2 :]
    half = int(foot) + 2 + int(np.argmax(below < below[:4].mean() / 2))
    assert half == pytest.approx(end, abs=1.5)
