"""Lights in their stencil volumes against all lights everywhere, and how much less they shade."""

from __future__ import annotations

import ctypes
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import rendergraph as rg
from rendergraph.scene.cameras import view_matrices

pytestmark = pytest.mark.slow  # many lights

FULL = "gbuffer.precision=full"
SIZE = (120, 90)
_SAMPLES_PASSED = 0x8914


def room(folder: Path, lights: str, camera: str = "{eye: [0, 1.2, 4], target: [0, 0.5, 0], far: 30}") -> Path:
    (folder / "room.yaml").write_text(f"""scene: 1
objects:
  floor: {{shape: plane, size: [8, 8], material: white}}
  ball: {{shape: sphere, radius: 0.6, at: [0.4, 0.6, 0], material: white}}
  wall: {{shape: box, size: [6, 2, 0.1], at: [0, 1, -2], material: white}}
materials: {{white: {{base_color: [0.8, 0.8, 0.8], roughness: 0.5}}}}
lights: {lights}
cameras: {{main: {camera}}}
""")
    return folder / "room.yaml"


LIGHTS = {
    "a point light before the eye": "{l: {type: point, at: [0.5, 1, 1], intensity: 3, range: 1.5}}",
    "the eye inside the volume": "{l: {type: point, at: [0, 1.2, 3.8], intensity: 30, range: 6}}",
    "the eye on the volume's face": "{l: {type: point, at: [0, 1.2, 2], intensity: 5, range: 2}}",
    "no range": "{l: {type: point, at: [0, 2, 0], intensity: 3}}",
    "behind the eye": "{l: {type: point, at: [0, 1, 6], intensity: 20, range: 5}}",
    "a spot light": "{l: {type: spot, at: [0, 2.5, 1], direction: [0.1, -1, -0.2], intensity: 9, range: 5, "
    "inner_degrees: 10, outer_degrees: 25}}",
    "a spot light from the eye": "{l: {type: spot, at: [0, 1.2, 4], direction: [0, -0.2, -1], intensity: 40, "
    "inner_degrees: 5, outer_degrees: 15}}",
    "half of everything": "{l: {type: spot, at: [0, 1, 1], direction: [1, -0.3, 0], intensity: 6, inner_degrees: 60, "
    "outer_degrees: 90}}",
    "one behind the other": "{a: {type: point, at: [0.4, 0.7, 0.9], intensity: 2, range: 0.9}, "
    "b: {type: point, at: [0.4, 0.7, -1.6], intensity: 2, range: 1.1}}",
    "several and the sun": "{s: {type: directional, direction: [-1, -2, -1], intensity: 1}, a: {type: point, "
    "at: [1, 1, 0.8], intensity: 2, range: 2}, b: {type: point, at: [-1, 0.5, 0], intensity: 2, range: 2}}",
}


@pytest.mark.nightly(keep=1)
@pytest.mark.parametrize("name", LIGHTS)
def test_it_draws_the_deferred_picture(radiance: Any, steps_off: Any, tmp_path: Path, name: str) -> None:
    scene = room(tmp_path, LIGHTS[name])
    off = steps_off(radiance("deferred-stencil-lights", scene, FULL), radiance("deferred", scene, FULL))
    assert off.max() <= 1.001


@pytest.mark.nightly(keep=2)
@pytest.mark.parametrize(
    "camera",
    [
        "{eye: [0, 1.2, 4], target: [0, 0.5, 0], height: 4, near: 0.1, far: 30}",
        "{eye: [0, 1.2, 4], target: [0, 0.5, 0], near: 0.1, far: .inf}",
    ],
)
@pytest.mark.parametrize("light", ["no range", "a spot light", "a spot light from the eye"])
def test_cameras_of_every_kind(radiance: Any, steps_off: Any, tmp_path: Path, camera: str, light: str) -> None:
    scene = room(tmp_path, LIGHTS[light], camera)
    off = steps_off(radiance("deferred-stencil-lights", scene, FULL), radiance("deferred", scene, FULL))
    assert off.max() <= 1.001


@pytest.mark.nightly(keep=1)
@pytest.mark.parametrize("scene", ["cornell_box", "many_lights", "spheres"])
def test_shipped_scenes(radiance: Any, steps_off: Any, scene: str) -> None:
    off = steps_off(radiance("deferred-stencil-lights", scene), radiance("deferred", scene))
    assert off.max() <= 1.001


@pytest.mark.nightly(keep=1)
@pytest.mark.parametrize("shading", ["phong", "anisotropic", "unlit"])
def test_every_shading_model(radiance: Any, steps_off: Any, tmp_path: Path, shading: str) -> None:
    scene, model = room(tmp_path, LIGHTS["several and the sun"]), f"light.shading={shading}"
    off = steps_off(radiance("deferred-stencil-lights", scene, FULL, model), radiance("deferred", scene, FULL, model))
    assert off.max() <= 1.001


# --- how many pixels a light is computed on --------------------------------------------------------------------------


def fragments(session: rg.Session, pipeline: rg.Pipeline) -> list[int]:
    """Fragments that each step of `light` lets through, in order."""
    camera = view_matrices(next(iter(pipeline.link().scene.cameras.values())), pipeline.link().graph.size)
    raw, counts = session.device.raw, []
    with session.device.ctx:
        runner = session.compile(pipeline).runner
        runner.run(1, 0.0, 0.0, pipeline.link().scene, camera)
        for step in runner.executable.lists[0]:
            query = raw.make("glCreateQueries", _SAMPLES_PASSED)
            raw.glBeginQuery(_SAMPLES_PASSED, query)
            for call in step.calls:
                call()
            raw.glEndQuery(_SAMPLES_PASSED)
            value = ctypes.c_uint64()
            raw.glGetQueryObjectui64v(query, 0x8866, ctypes.byref(value))
            raw.delete("glDeleteQueries", query)
            if step.step.node == "light":
                counts.append(value.value)
    return counts


@pytest.mark.nightly(keep=2)
@pytest.mark.parametrize(
    "name", ["a point light before the eye", "the eye on the volume's face", "a spot light", "one behind the other"]
)
def test_a_light_is_computed_where_it_reaches(session: rg.Session, tmp_path: Path, name: str) -> None:
    """The pixels whose surface lies in the ball or cone, counted in NumPy, and few more: the volume has flat faces."""
    pipeline = rg.load("deferred-stencil-lights", scene=room(tmp_path, LIGHTS[name]), size=SIZE, sets=[FULL])
    depth = np.asarray(session.render(pipeline, taps=["gbuffer.depth"]).arrays["gbuffer.depth"], np.float64)[..., 0]
    view = view_matrices(next(iter(pipeline.link().scene.cameras.values())), SIZE)
    x = (np.arange(SIZE[0]) + 0.5) / SIZE[0] * 2 - 1
    y = 1 - (np.arange(SIZE[1]) + 0.5) / SIZE[1] * 2
    clip = np.stack([*np.meshgrid(x, y), 1 - 2 * depth, np.ones_like(depth)], -1)
    world = clip @ np.linalg.inv(view.projection @ view.view).T
    everywhere, copied, *draws = fragments(session, pipeline)
    assert everywhere == copied == SIZE[0] * SIZE[1]
    local = [light for light in pipeline.link().scene.lights if light.type != "directional"]
    assert len(draws) == 2 * len(local)
    for light, shaded in zip(local, draws[1::2], strict=True):
        towards = world[..., :3] / world[..., 3:] - light.position
        distance = np.linalg.norm(towards, axis=-1)
        assert light.range is not None
        reached = (distance < light.range) & (depth > 0)
        if light.type == "spot":
            reached &= towards @ np.asarray(light.direction) > distance * np.cos(light.outer)
        assert 100 < reached.sum() <= shaded <= 1.3 * reached.sum() + 20
        assert shaded < 0.6 * SIZE[0] * SIZE[1]


def test_two_draws_a_local_light() -> None:
    def drawn(*sets: str) -> int:
        plan = rg.load("deferred-stencil-lights", scene="many_lights", size=(64, 48), sets=sets).plan()
        return sum(step.node == "light" for step in plan.schedule.steps)

    assert drawn() == 2 + 2 * 18
    assert drawn("light.terms=ambient") == 1
