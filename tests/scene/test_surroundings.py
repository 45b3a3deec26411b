"""What lights a scene that does not say it: the key light, studio and ground, and lights in photometric units."""

from __future__ import annotations

from pathlib import Path

import pytest
from msgspec.structs import replace
from rendergraph.nodes.shadows._light_views import receiving_box
from rendergraph.pipelines.environments.surroundings import (
    GROUND_EXTENT,
    GROUND_HEIGHT,
    KEY_LUX,
    STUDIO_FILL,
    typical_illuminance,
)

from rendergraph.errors import InputError
from rendergraph.scene import animate
from rendergraph.scene.facts import FrameScene
from rendergraph.scene.load import load
from rendergraph.scene.model import Scene

FLOOR = "scene: 1\nobjects: {floor: {shape: plane, size: [2, 2]}}\nlights: {sun: {%s}}\n"


def read(folder: Path, light: str) -> Scene:
    (folder / "scene.yaml").write_text(FLOOR % light)
    return load(folder / "scene.yaml")


def mesh_file(scene: Scene) -> Scene:
    """The same scene as if a mesh file had it."""
    return replace(scene, source=Path("lamp.glb"))


@pytest.mark.parametrize(
    ("light", "expected"),
    [
        ("type: directional, direction: [0, -1, 0], intensity: 40", 40),
        ("type: directional, direction: [0, -1, -1], intensity: 40", 40 / 2**0.5),
        ("type: directional, direction: [0, 1, 0], intensity: 40", 0),
        ("type: point, at: [0, 50, 0], intensity: 1000", 0.4),
        ("type: point, at: [0, 50, 0], intensity: 1000, color: [0, 1, 0]", 0.4 * 0.7152),
        ("type: point, at: [0, 50, 0], intensity: 1000, range: 100", 0.4 * (1 - 0.5**4)),
        ("type: spot, at: [0, 50, 0], direction: [0, -1, 0], intensity: 1000", 0.4),
        ("type: spot, at: [0, 50, 0], direction: [1, 0, 0], intensity: 1000", 0),
    ],
)
def test_illuminance_of_a_floor(tmp_path: Path, light: str, expected: float) -> None:
    assert typical_illuminance(read(tmp_path, light)) == pytest.approx(expected, rel=5e-3)


def test_illuminance_follows_turned_and_scaled_objects(tmp_path: Path) -> None:
    scene = read(tmp_path, "type: directional, direction: [0, -1, 0], intensity: 10")
    text = (tmp_path / "scene.yaml").read_text().replace("[2, 2]", "[2, 2], rotate_degrees: [60, 0, 0], scale: 3")
    (tmp_path / "scene.yaml").write_text(text)
    assert typical_illuminance(scene) == pytest.approx(10)
    assert typical_illuminance(load(tmp_path / "scene.yaml")) == pytest.approx(5)


@pytest.mark.parametrize("lux", [0.001, 1000.0])
def test_lights_in_other_units_are_scaled(tmp_path: Path, lux: float) -> None:
    scene = mesh_file(read(tmp_path, f"type: directional, direction: [0, -1, 0], intensity: {lux}"))
    made = animate.complete(scene)
    assert made.lights[0].intensity == pytest.approx(KEY_LUX)
    assert [problem.code for problem in made.warnings] == ["RG334"]
    bare = animate.complete(scene, bare=True)
    assert (bare.lights, bare.environment, bare.warnings) == (scene.lights, None, ())


def test_a_mesh_file_with_lights_stands_in_the_studio(tmp_path: Path) -> None:
    scene = read(tmp_path, "type: directional, direction: [0, -1, 0], intensity: 2")
    made = animate.complete(mesh_file(scene))
    assert made.environment is not None
    assert (made.environment.intensity, made.lights, made.warnings) == (STUDIO_FILL, scene.lights, ())
    assert animate.complete(scene).environment is None, "a scene file says itself what is around it"


def test_a_ground_touches_the_lowest_point_and_is_no_part_of_the_bounds(tmp_path: Path) -> None:
    """The box of a turned ball reaches below the ball itself."""
    (tmp_path / "scene.yaml").write_text(
        "scene: 1\nobjects: {ball: {shape: sphere, radius: 1, segments: 64, rings: 32, rotate_degrees: [45, 0, 0]}}\n"
        "environment: {ground: true}\n"
    )
    scene = load(tmp_path / "scene.yaml")
    made, without = animate.complete(scene), animate.complete(replace(scene, ground=None))
    ground = made.objects[-1]
    assert (ground.name, ground.casts_shadow) == ("ground", False)
    assert ground.transform[1, 3] == pytest.approx(-1, abs=2e-3)
    assert without.bounds[0][1] == pytest.approx(-(2**0.5))
    assert made.bounds == without.bounds == FrameScene(made).bounds
    assert (made.cameras["default"].transform == without.cameras["default"].transform).all()
    assert made.environment is not None
    assert without.environment is not None
    assert made.lights == without.lights
    assert made.environment == replace(without.environment, projection=made.environment.projection)
    x, y, z, reach = made.environment.projection
    radius = (1 + 2 + 2) ** 0.5
    assert (x, z) == pytest.approx((0, 0))
    assert (y + 1, reach) == pytest.approx((GROUND_HEIGHT * radius, GROUND_EXTENT * radius), rel=2e-3)


@pytest.mark.parametrize(
    ("environment", "image"), [("ground: true", "studio"), ("file: sky, ground: true, ground_height: 1.6", "sky")]
)
def test_a_scene_file_asks_for_a_ground(tmp_path: Path, environment: str, image: str) -> None:
    scene = read(tmp_path, "type: directional, direction: [0, -1, 0], intensity: 2")
    text = (tmp_path / "scene.yaml").read_text()
    (tmp_path / "scene.yaml").write_text(f"{text}environment: {{{environment}}}\n")
    made = animate.complete(load(tmp_path / "scene.yaml"))
    assert made.objects[-1].name == "ground"
    assert made.environment is not None
    assert made.environment.image.label == image
    if "1.6" in environment:
        assert made.environment.projection[1] == pytest.approx(1.6, abs=1e-3)
    bare = animate.complete(replace(scene, ground=0.0), bare=True)
    assert (bare.environment, bare.objects[-1].name) == (None, "ground")


def test_low_suns_cast_whole_shadows_on_the_ground(tmp_path: Path) -> None:
    """A shadow map covers the shadow although the bounds do not: 4° above the horizon it is 14 times as long as high."""
    (tmp_path / "scene.yaml").write_text(
        "scene: 1\nobjects: {box: {shape: box, size: [1, 1, 1], at: [0, 0.5, 0]}}\nenvironment: {ground: true}\n"
        "lights: {sun: {type: directional, direction: [1, -0.07, 0]}}\n"
    )
    made = animate.complete(load(tmp_path / "scene.yaml"))
    low, high = receiving_box(FrameScene(made), made.lights[0])
    assert (low[1], high[1]) == pytest.approx((0, 1), abs=1e-3)
    assert high[0] == pytest.approx(min(0.5 + 1 / 0.07, GROUND_EXTENT * 0.75**0.5), abs=0.01)
    assert (low[0], low[2], high[2]) == pytest.approx((-0.5, -0.5, 0.5))


@pytest.mark.parametrize("environment", ["{}", "{intensity: 2}", "{ground: true, intensity: 2}", "{ground_height: 2}"])
def test_an_environment_needs_a_file_or_a_ground(tmp_path: Path, environment: str) -> None:
    (tmp_path / "scene.yaml").write_text(f"scene: 1\nenvironment: {environment}\n")
    with pytest.raises(InputError, match="environment needs 'file', or `ground: true` alone"):
        load(tmp_path / "scene.yaml")
