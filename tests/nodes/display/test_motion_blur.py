"""Motion blur: against the mean of many moments, and against the box filter of a uniform motion."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import rendergraph as rg

SCENE = """scene: 1
objects:
  wall: {shape: box, size: [40, 40, 1], at: [0, 0, -3], material: grey}
  post: {shape: box, size: [0.3, 4, 0.3], at: [1, 0, -1], rotate_degrees: [0, 0, 25], material: blue}
  ball: {shape: sphere, radius: 0.7, at: [-1.5, 0, 0], material: white}
  stick: {shape: box, size: [2, 0.2, 0.2], at: [0, -0.8, 0.5], material: blue}
materials:
  grey: {base_color: [0.1, 0.12, 0.1]}
  blue: {base_color: [0.1, 0.2, 0.7]}
  white: {base_color: [1, 0.9, 0.8]}
lights: {sun: {type: directional, direction: [-1, -2, -1], casts_shadow: false}}
cameras: {main: {eye: [0, 0, 6], target: [0, 0, 0], fov_y_degrees: 40, shutter: 0.5}}
"""
MOVING = (
    SCENE
    + "keyframes: {objects.ball.at: {0: [-1.5, 0, 0], 0.4: [1.5, 0, 0]},"
    + " objects.stick.rotate_degrees: {0: [0, 0, 0], 1: [0, 0, 720]}}\n"
)
MOVES = "{0: [-2, 0, 6], 0.4: [2, 0, 6]}, cameras.main.target: {0: [-2, 0, 0], 0.4: [2, 0, 0]}"
PASSING = SCENE + f"keyframes: {{cameras.main.eye: {MOVES}}}\n"
FED = """rendergraph: 1
size: [192, 24]
scene: ./scene.yaml
nodes:
  seen: {type: depth_prepass}
  fed: {type: ./fed.frag}
  blur: {type: motion_blur, inputs: {radiance: fed.picture, depth: seen.depth, velocity: fed.velocity}, params: PARAMS}
outputs: {radiance: blur.radiance}
"""
PICTURE = """/*---
doc: A pattern that moves along x by 48 pixels a frame.
outputs:
  picture: {semantic: radiance, format: rgba32f, doc: Sines.}
  velocity: {semantic: velocity, format: rg32f, doc: Of the plane.}
---*/
out vec4 picture;
out vec2 velocity;
void main() {
    float x = gl_FragCoord.x;
    picture = vec4(0.5 + 0.4 * sin(x * 6.2831853 / vec3(96.0, 48.0, 32.0)), 1.0);
    velocity = vec2(0.25, 0.0);
}
"""


def rmse(a: Any, b: Any) -> float:
    return float(np.sqrt(((a - b) ** 2).mean()))


def with_scene(folder: Path, text: str) -> rg.Pipeline:
    (folder / "scene.yaml").write_text(text)
    return rg.load("motion-blur", scene=folder / "scene.yaml", size=(192, 128))


def light(session: rg.Session, pipeline: rg.Pipeline, frame: int = 6, **options: Any) -> Any:
    return session.render(pipeline, outputs=["radiance"], frames=range(frame, frame + 1), **options)["radiance"]


@pytest.mark.parametrize(("text", "most"), [(MOVING, 0.4), (PASSING, 0.5)], ids=["objects", "camera"])
def test_it_is_near_to_the_mean_of_many_moments(session: rg.Session, tmp_path: Path, text: str, most: float) -> None:
    pipeline = with_scene(tmp_path, text)
    truth = light(session, pipeline, subframes=64)
    sharp, blurred, of_paper = (
        rmse(light(session, one), truth)
        for one in (pipeline.set("blur.enabled", False), pipeline, pipeline.set("blur.weights", "cones"))
    )
    assert sharp > 0.003
    assert blurred < most * sharp
    assert blurred < of_paper < sharp


def test_the_motions_of_camera_and_objects_are_separate(session: rg.Session, tmp_path: Path) -> None:
    both = with_scene(tmp_path, MOVING + "orbit: {degrees_per_second: 90}\n")
    camera, objects = both.set("blur.object_motion", False), both.set("blur.camera_motion", False)
    sharp, neither = both.set("blur.enabled", False), camera.set("blur.camera_motion", False)
    np.testing.assert_array_equal(light(session, neither), light(session, sharp))
    wall = np.s_[4:24, 60:130]  # nothing but the wall, whose texture is none: its shading alone moves
    moved = [np.abs(light(session, one) - light(session, sharp)) for one in (camera, objects)]
    assert moved[1][wall].max() == 0
    assert moved[0].max() > 0.01
    assert moved[1].max() > 0.01
    without = both.set("blur.velocity", None)
    assert rmse(light(session, without), light(session, camera)) < 0.05 * rmse(
        light(session, camera), light(session, sharp)
    )


def test_a_uniform_motion_is_the_box_filter_of_the_shutter(session: rg.Session, tmp_path: Path) -> None:
    """Of sines: the mean over a window is the sine times sin(a)/a. No value leaves the range of the picture."""
    plane = "".join(line for line in SCENE.splitlines(True) if line.lstrip()[:4] not in ("post", "ball", "stic"))
    (tmp_path / "scene.yaml").write_text(plane.replace("[40, 40, 1]", "[400, 40, 1]"))
    (tmp_path / "fed.frag").write_text(PICTURE)
    params = "{samples: 96, radius: 0.25, jitter: 0}"
    width, shutter = 192, 0.25  # 12 pixels, 6 to each side: as far as a quarter of the height
    (tmp_path / "fed.yaml").write_text(FED.replace("PARAMS", params))
    found = session.render(rg.load(tmp_path / "fed.yaml").select(shutter=shutter))["radiance"][12, :, :3]
    x = np.arange(width) + 0.5
    wave = 2 * np.pi / np.array([96.0, 48.0, 32.0])
    phase, half = x[:, None] * wave, 0.5 * shutter * 0.25 * width * wave
    expected = 0.5 + 0.4 * np.sin(phase) * np.sin(half) / half
    inner = np.s_[8:-8]  # beyond the border nothing is known
    np.testing.assert_allclose(found[inner], expected[inner], atol=0.01)
    assert np.abs(found[inner] - (0.5 + 0.4 * np.sin(phase))[inner]).max() > 0.05
    assert found.min() >= 0.1 - 1e-6
    assert found.max() <= 0.9 + 1e-6


def test_an_edge_is_a_ramp_on_both_sides(session: rg.Session, tmp_path: Path) -> None:
    """Of a nearer surface that moves, also where it reaches into the tile beside it, in which nothing else moves."""
    walls = "far: {shape: box, size: [400, 40, 1], at: [0, 0, -3]}\n  near: {shape: box, size: [200, 40, 1], at: [100, 0, -1]}"
    cameras = SCENE[SCENE.index("lights:") :]
    (tmp_path / "scene.yaml").write_text(f"scene: 1\nobjects:\n  {walls}\n{cameras}")
    half = "    float on = step(96.0, gl_FragCoord.x);\n    picture = vec4(vec3(on), 1.0);\n    velocity = vec2(0.25 * on, 0.0);\n}"
    (tmp_path / "fed.frag").write_text(PICTURE[: PICTURE.index("    float x")] + half)
    (tmp_path / "fed.yaml").write_text(FED.replace("PARAMS", "{samples: 96, radius: 0.25, jitter: 0}"))
    found = session.render(rg.load(tmp_path / "fed.yaml").select(shutter=0.25))["radiance"][12, :, 0]
    expected = np.clip(0.5 + (np.arange(192) + 0.5 - 96) / 12, 0, 1)  # 12 pixels of motion while the shutter is open
    assert np.abs(found - expected).max() < 0.06


def test_without_a_shutter_it_costs_nothing(session: rg.Session, tmp_path: Path) -> None:
    pipeline = with_scene(tmp_path, MOVING).select(shutter=0.0)
    plain = pipeline.set("blur.enabled", False)
    assert pipeline.plan().memory == plain.plan().memory
    assert "gbuffer.velocity" not in pipeline.plan().resources
    np.testing.assert_array_equal(light(session, pipeline), light(session, plain))


def test_what_stands_still_stays_as_it_is(session: rg.Session, tmp_path: Path) -> None:
    """To the bit, with the shutter open, also beside things that move."""
    pipeline = with_scene(tmp_path, SCENE)
    np.testing.assert_array_equal(light(session, pipeline), light(session, pipeline.set("blur.enabled", False)))
    moving = with_scene(tmp_path, MOVING)
    far = np.s_[:, 150:]  # post and wall
    changed = light(session, moving) - light(session, moving.set("blur.enabled", False))
    assert changed.any()
    assert not changed[far].any()


def test_keyframes_open_the_shutter(session: rg.Session, tmp_path: Path) -> None:
    text = MOVING.replace(", shutter: 0.5", "").replace(
        "keyframes: {", "keyframes: {cameras.main.shutter: {0: 0, 0.3: 0.9}, "
    )
    opening = with_scene(tmp_path, text)
    np.testing.assert_allclose(light(session, opening), light(session, opening.select(shutter=0.5)), atol=1)
    half_open = with_scene(tmp_path, MOVING)
    np.testing.assert_allclose(light(session, opening), light(session, half_open), atol=1e-3)
