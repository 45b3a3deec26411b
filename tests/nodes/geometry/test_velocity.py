"""How far surfaces have moved, against matrices of two moments in float64."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import rendergraph as rg
from rendergraph.scene import animate
from rendergraph.scene.cameras import view_matrices

SIZE = (48, 32)
CAMERAS = {
    "perspective": "fov_y_degrees: 40, near: 0.1, far: 60",
    "off centre": "frustum: [-0.05, 0.03, -0.03, 0.02], near: 0.1, far: 60",
    "orthographic": "height: 4, near: 0.1, far: 60",
    "infinite": "fov_y_degrees: 40, near: 0.1, far: .inf",
}
SCENE = """scene: 1
objects: {{box: {{shape: box, size: [2, 2, 2]}}}}
cameras: {{main: {{eye: [1, 2, 5], target: [0, 0, 0], {camera}}}}}
keyframes:
  objects.box.at: {{0: [0, 0, 0], 1: [3, 1, -2]}}
  objects.box.rotate_degrees: {{0: [0, 0, 0], 1: [0, 120, 40]}}
  objects.box.scale: {{0: 1, 1: 1.5}}
orbit: {{degrees_per_second: 40}}
"""
JITTERED = """rendergraph: 1
size: [48, 32]
nodes:
  gbuffer: {type: gbuffer, params: {precision: full}}
  prepass: {type: depth_prepass}
  environment: {type: environment_light}
  light: {type: deferred_lighting, inputs: {gbuffer: gbuffer, environment: environment.light}}
  display: {type: tonemap, inputs: {radiance: light.radiance}}
  aa: {type: taa, inputs: {source: display.color, depth: gbuffer.depth, velocity: gbuffer.velocity}}
outputs: {image: aa.color, velocity: gbuffer.velocity, before: prepass.velocity, depth: gbuffer.depth}
"""


@pytest.fixture
def moving(tmp_path: Path) -> Any:
    def made(camera: str) -> rg.Pipeline:
        (tmp_path / "scene.yaml").write_text(SCENE.format(camera=CAMERAS[camera]))
        (tmp_path / "moving.yaml").write_text(JITTERED)
        return rg.load(tmp_path / "moving.yaml", scene=tmp_path / "scene.yaml")

    return made


@pytest.mark.parametrize("camera", CAMERAS)
def test_surfaces_and_camera_that_move(session: rg.Session, moving: Any, camera: str) -> None:
    """Every pixel's point, taken back to the object, along with it, and into the picture of the frame before."""
    pipeline = moving(camera)
    frames = list(session.frames(pipeline, frames=range(1, 4), outputs=["velocity", "before", "depth", "image"]))
    assert not frames[0]["velocity"].any()
    frame = frames[-1]
    scene = pipeline.link().scene
    now, then = (animate.at(scene, number / 30) for number in (2, 1))
    seen, last = (view_matrices(one.cameras["main"], SIZE) for one in (now, then))
    height, width = SIZE[::-1]
    depth = frame.arrays["depth"][..., 0].astype(np.float64)
    y, x = np.nonzero(depth)
    assert len(x) > 100
    # The picture was moved by the third of the places that frames are taken at, from the 1897th of the sequence on.
    jitter = np.array([(halton(1899, 2), halton(1899, 3))])
    place = np.stack([x + 0.5, height - y - 0.5], axis=1) - jitter
    ndc = np.column_stack([place / SIZE * 2 - 1, 1 - 2 * depth[y, x], np.ones(len(x))])
    world = ndc @ np.linalg.inv(seen.projection @ seen.view).T
    world /= world[:, 3:]
    matrix = then.objects[0].transform @ np.linalg.inv(now.objects[0].transform)
    before = world @ matrix.T @ (last.projection @ last.view).T
    expected = (ndc[:, :2] - before[:, :2] / before[:, 3:]) / 2
    assert np.abs(expected).max() * width > 1
    for name in ("velocity", "before"):
        found = frame[name][y, x, :2]
        assert np.abs((found - expected) * SIZE).max() < 0.02, name  # pixels
    assert not frame["velocity"][depth == 0].any()


def halton(index: int, base: int) -> float:
    """Digits behind the point, from the last to the first."""
    digits = np.base_repr(index, base)[::-1]
    return int(digits, base) / float(base ** len(digits)) - 0.5


@pytest.mark.nightly(keep=1)
@pytest.mark.parametrize("view", ["guard_band", "hemicube"])
def test_a_wider_view_knows_how_far_it_is_jittered(session: rg.Session, view: str) -> None:
    """Nothing moves, while the camera's picture does: by as many texels in a band, and not at all in a hemicube."""
    nodes = {
        "view": {"type": view},
        "seen": {"type": "gbuffer", "inputs": {"view": "view.view" if view == "guard_band" else "view.front"}},
    }
    patch = {"nodes": nodes, "outputs": {"velocity": "seen.velocity"}}
    pipeline = rg.load("taa", size=SIZE, patches=[patch])
    for frame in session.frames(pipeline, frames=range(1, 4), outputs=["velocity", "image"]):
        assert np.abs(frame["velocity"]).max() < 3e-6  # of the picture; it is moved by up to 1e-2


def test_a_cropped_velocity_is_that_of_the_picture(session: rg.Session, moving: Any) -> None:
    nodes = {
        "band": {"type": "guard_band"},
        "wide": {"type": "gbuffer", "inputs": {"view": "band.view"}},
        "small": {"type": "crop", "inputs": {"source": "wide.velocity"}},
    }
    pipeline = moving("perspective").patch({"nodes": nodes, "outputs": {"cropped": "small.cropped"}})
    frame = session.render(pipeline, frames=range(3, 4), outputs=["velocity", "cropped", "image"])
    velocity, cropped = frame["velocity"], frame["cropped"]
    drawn = velocity.any(axis=-1) & cropped.any(axis=-1)  # at borders of surfaces one of them may miss
    assert drawn.sum() > 100
    assert np.abs(velocity).max() * SIZE[0] > 1
    np.testing.assert_allclose(cropped[drawn], velocity[drawn], rtol=5e-3, atol=2e-5)


def test_who_reads_none_pays_for_none(session: rg.Session) -> None:
    plan = rg.load("deferred", size=SIZE).plan()
    assert "gbuffer.velocity" not in plan.resources
    with session.current():
        assert not session.compile(rg.load("deferred", size=SIZE)).executable.uses_previous


CARRIED = '''
"""An object that a vertex shader carries along."""

from __future__ import annotations

from rendergraph.api import Depth, InOut, Node, Radiance, Velocity, param


class Carried(Node):
    """An object that moves by time."""

    depth = InOut(Depth, doc="Depth.")
    radiance = InOut(Radiance, doc="Picture.")
    velocity = InOut(Velocity, doc="Motion.")
    speed: tuple[float, float, float] = param(default=(0.0, 0.0, 0.0), unit="m/s", doc="Speed.")

    def record(self, steps):
        out = {"radiance": self.radiance, "velocity": self.velocity, "depth": self.depth}
        steps.geometry("carried.frag", vertex="carried.vert", out=out, objects=["ball"], materials="none")
'''
CARRIED_SHADERS = {
    "carried.vert": """
#include <frame.glsl>
#include <geometry_vertex.glsl>
uniform vec3 speed;
void main() {
    transform_vertex();
    v_position += time * speed;
    write_velocity_varyings(
        v_position, previous_object_to_world(in_position) + max(time - delta_time, 0.0) * speed);
    gl_Position = world_to_clip(v_position);
}
""",
    "carried.frag": """
#include <fragment_velocity.glsl>
in vec3 v_normal;
out vec4 radiance;
out vec2 velocity;
void main() {
    radiance = vec4(0.5 + 0.5 * normalize(v_normal), 1.0);
    velocity = fragment_velocity();
}
""",
}
STANDING = """scene: 1
objects:
  floor: {shape: plane, size: [6, 6], at: [0, -1, 0]}
  ball: {shape: box, at: [-1, 0, 0], hidden: true}
cameras: {main: {eye: [0, 1, 5], target: [0, 0, 0]}}
lights: {sun: {type: directional, direction: [-1, -2, -1]}}
"""


def test_what_a_plugin_moves_is_followed_as_what_the_scene_moves(session: rg.Session, tmp_path: Path) -> None:
    """The same motion by a vertex shader, in a scene that stands still, and by keyframes."""
    plugins = tmp_path / "plugins"
    plugins.mkdir()
    for name, text in {"carried.py": CARRIED, **CARRIED_SHADERS}.items():
        (plugins / name).write_text(text)
    text = JITTERED.replace(", params: {precision: full}", "").replace(
        "  display:",
        """  moved:
    type: carried
    inputs: {depth: gbuffer.depth, radiance: light.radiance, velocity: gbuffer.velocity}
  display:""",
    )
    text = text.replace("{radiance: light.radiance}}\n  aa", "{radiance: moved.radiance}}\n  aa")
    text = text.replace("velocity: gbuffer.velocity}}\noutputs", "velocity: moved.velocity}}\noutputs")
    text = text.replace("depth: gbuffer.depth, velocity: moved", "depth: moved.depth, velocity: moved")
    text = text.replace("velocity: gbuffer.velocity, before", "velocity: moved.velocity, before")
    (tmp_path / "moved.yaml").write_text(text)
    (tmp_path / "standing.yaml").write_text(STANDING)
    keys = "keyframes: {objects.ball.at: {0: [-1, 0, 0], 1: [2, 0.6, 0]}}\n"
    (tmp_path / "keyed.yaml").write_text(STANDING + keys)
    drawn = {}
    for scene, speed in (("standing", (3.0, 0.6, 0.0)), ("keyed", (0.0, 0.0, 0.0))):
        pipeline = rg.load(tmp_path / "moved.yaml", scene=tmp_path / f"{scene}.yaml", plugins=[plugins])
        pipeline = pipeline.set("moved.speed", list(speed))
        outputs = ["image", "velocity"]
        drawn[scene] = list(session.frames(pipeline, frames=range(1, 9), outputs=outputs))[-1]
        lost = list(session.frames(pipeline.set("aa.velocity", None), frames=range(1, 9), outputs=["image"]))[-1]
        off = np.abs(lost["image"].astype(int) - drawn[scene]["image"])
        assert off.max() > 20
    moving = np.abs(drawn["keyed"]["velocity"]).max(axis=-1) > 1e-3
    assert 0.02 < moving.mean() < 0.5
    np.testing.assert_allclose(drawn["standing"]["velocity"], drawn["keyed"]["velocity"], atol=2e-4)
    np.testing.assert_allclose(drawn["standing"]["image"].astype(int), drawn["keyed"]["image"], atol=2)


QUAD = '''
"""A square of its own."""

from __future__ import annotations

from rendergraph.api import Depth, Node, Output, Velocity


class Quad(Node):
    """The floor, by a draw step."""

    depth = Output(Depth, format="depth32f", clear=0.0, doc="Depth.")
    velocity = Output(Velocity, format="rg16f", clear=0.0, doc="Motion.")

    def record(self, steps):
        out = {"velocity": self.velocity, "depth": self.depth}
        steps.draw("quad.frag", vertex="quad.vert", vertices=4, topology="triangle_strip", out=out)
'''
QUAD_SHADERS = {
    "quad.vert": """
#include <previous_pass_view.glsl>
centroid out vec4 v_clip_position;
centroid out vec4 v_previous_clip_position;
void main() {
    vec4 position = vec4(3.0 - 6.0 * (gl_VertexID & 1), -1.0, 3.0 - 6.0 * (gl_VertexID >> 1), 1.0);
    gl_Position = v_clip_position = PASS_VIEW.view_projection * position;
    v_previous_clip_position = PREVIOUS_PASS_VIEW.view_projection * position;
}
""",
    "quad.frag": """
#include <fragment_velocity.glsl>
out vec2 velocity;
void main() { velocity = fragment_velocity(); }
""",
}


def test_a_draw_step_writes_velocity_as_geometry_steps_do(session: rg.Session, tmp_path: Path) -> None:
    for name, text in {"quad.py": QUAD, **QUAD_SHADERS}.items():
        (tmp_path / name).write_text(text)
    (tmp_path / "scene.yaml").write_text(STANDING + "orbit: {degrees_per_second: 60}\n")
    text = "rendergraph: 1\nsize: [48, 32]\nnodes: {gbuffer: {type: gbuffer}, quad: {type: quad}}\n"
    text += "outputs: {drawn: quad.velocity, velocity: gbuffer.velocity}\n"
    (tmp_path / "quad.yaml").write_text(text)
    pipeline = rg.load(tmp_path / "quad.yaml", scene=tmp_path / "scene.yaml", plugins=[tmp_path])
    frame = list(session.frames(pipeline, frames=range(1, 4)))[-1]
    assert np.abs(frame["velocity"]).max() > 0.01
    np.testing.assert_allclose(frame["drawn"], frame["velocity"], atol=1e-4)
