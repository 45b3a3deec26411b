"""What lights a scene that does not say it: the key light, the studio, and lights in photometric units."""

from __future__ import annotations

from pathlib import Path

import pytest
from msgspec.structs import replace

from rendergraph.scene import animate
from rendergraph.scene.load import load
from rendergraph.scene.model import Scene
from rendergraph.scene.surroundings import KEY_LUX, STUDIO_FILL, typical_illuminance

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
