"""What is not drawn as it lies outside of the view: that it is little, and that no picture shows it."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from rendergraph.api import Depth, Node, Output, State, Steps, projection
from rendergraph.compile.geometry import visible_objects
from rendergraph.scene import pack
from rendergraph.scene.cameras import view_matrices
from rendergraph.scene.load import load
from rendergraph.scene.model import Camera

if TYPE_CHECKING:
    from pathlib import Path

CORNERS = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])


def views_of(executable: Any) -> Any:
    """The views of an executable with the lists of objects that are drawn in them."""
    return executable.cull_and_sort.func.__self__.views.values()


def _scattered(count: int) -> str:
    """Turned and stretched boxes of half a metre around the origin, two of three with a material of their own."""
    random = np.random.default_rng(count)
    lines = ["scene: 1", "objects:"]
    for number in range(count):
        at, turn = random.uniform(-4, 4, 3).tolist(), random.uniform(0, 360, 3).tolist()
        sides = random.uniform(0.05, 1, 3).tolist()
        material = ["", ", material: glass", ", material: leaf"][number % 3]
        lines.append(f"  o{number}: {{shape: box, size: {sides}, at: {at}, rotate_degrees: {turn}{material}}}")
    return "\n".join(
        [
            *lines,
            "materials:",
            "  glass: {base_color: [0.2, 0.5, 0.9, 0.5], alpha_mode: blend, double_sided: true}",
            "  leaf: {base_color: [0.1, 0.6, 0.1]}",
            "lights:",
            "  sun: {type: directional, direction: [-1, -2, -1], intensity: 3}",
            "  bulb: {type: point, at: [0.5, 1, 0.5], intensity: 5}",
            "",
        ]
    )


def _cameras(count: int) -> list[Camera]:
    """Cameras in the middle of such a scene, of every type, with near and far planes within it."""
    random = np.random.default_rng(count)
    found = []
    for number in range(count):
        pose = np.linalg.inv(projection.view_along(random.normal(size=3), random.normal(size=3)))
        pose[:3, 3] = random.uniform(-4, 4, 3)
        kind = ("perspective", "orthographic", "frustum")[number % 3]
        far = math.inf if number % 2 and kind == "perspective" else random.uniform(1, 8)
        sides = (-0.02, 0.09, -0.05, 0.01)
        found.append(Camera("any", pose, kind, random.uniform(0.1, 2), 1.5, sides, near=0.1, far=far))  # type: ignore[arg-type]
    return found


def test_nothing_that_a_view_sees_is_left_out_and_little_else_is_drawn(tmp_path: Path) -> None:
    """Against points all over each box, brought to clip space in float64."""
    (tmp_path / "s.yaml").write_text(_scattered(60))
    scene = load(tmp_path / "s.yaml")
    packed = pack.pack(scene)
    points = np.random.default_rng(0).uniform(-1, 1, (400, 3))
    drawn = there = 0
    for camera in _cameras(30):
        view = view_matrices(camera, (32, 16))
        for clamped in (False, True):
            found = visible_objects(packed, view, clamped=clamped)
            for number, entry in enumerate(scene.objects):
                low, high = np.asarray(scene.meshes[entry.mesh].box)
                local = (low + high) / 2 + (high - low) / 2 * np.concatenate([CORNERS, points])
                world = local @ entry.transform[:3, :3].T + entry.transform[:3, 3]
                clip = np.column_stack([world, np.ones(len(world))]) @ (view.projection @ view.view).T
                axes = clip[:, :2] if clamped else clip[:, :3]
                inside = bool((np.abs(axes) <= clip[:, 3:]).all(axis=1).any())
                assert found[number] or not inside
                drawn, there = drawn + bool(found[number]), there + inside
    assert there > 300
    assert drawn < 1.5 * there


@pytest.mark.parametrize(
    ("pipeline", "sets"),
    [
        ("forward", ["sun.resolution=64"]),
        ("forward", ["light.evaluate=face", "light.lookup=null"]),
        ("shadow-cube", ["sun.resolution=32"]),
        ("shadow-volumes-zfail", []),
    ],
)
def test_pictures_are_the_same_to_the_last_bit(gl: Any, tmp_path: Path, pipeline: str, sets: list[str]) -> None:
    import rendergraph as rg

    (tmp_path / "s.yaml").write_text(_scattered(40))
    made = rg.load(pipeline, scene=tmp_path / "s.yaml", size=(32, 20), sets=sets)
    cameras = _cameras(4)
    pictures: list[list[Any]] = [[], []]
    lists = []
    with gl.device.current():
        for cull, found in zip((False, True), pictures, strict=True):
            drawing = gl.compile(made, warm_up=False, cull=cull)
            drawing.begin()
            for number, camera in enumerate(cameras, 1):
                drawing.draw(number, camera)
                found.append(drawing.read()["image"])
                lists.append([len(one.drawn) for each in views_of(drawing.executable) for one in each.lists])
    for plain, culled in zip(*pictures, strict=True):
        np.testing.assert_array_equal(plain, culled)
    all_of_it, left = np.array(lists[: len(cameras)]), np.array(lists[len(cameras) :])
    assert left.sum() < all_of_it.sum()


class Hoisted(Node):
    """Depth of the scene, lifted to where the camera looks by a vertex shader of its own."""

    depth = Output(Depth, format="depth32f", clear=0.0, doc="Depth.")

    def record(self, steps: Steps) -> None:
        steps.geometry(None, vertex="up.vert", out=self.depth, materials="none", state=State(cull="none"))


UP = {
    "up.vert": "#include <transform.glsl>\n"
    "void main() { gl_Position = world_to_clip(object_to_world(in_position) + vec3(0.0, 50.0, 0.0)); }"
}
BELOW = (
    "objects: {box: {shape: box, at: [0, -50, 0]}}\n"
    "cameras: {main: {eye: [0, 0, 5], target: [0, 0, 0], height: 2, near: 0.1, far: 50}}\n"
)


def test_what_a_shader_moves_elsewhere_is_drawn_from_wherever_it_stands(bench: Any) -> None:
    text = "nodes: {h: {type: hoisted}}\noutputs: {depth: h.depth}"
    assert bench.draw(text, Hoisted, shaders=UP, scene=BELOW, size=(8, 8)).arrays["depth"].max() > 0


def test_commands_are_written_only_where_others_are_drawn(gl: Any, tmp_path: Path) -> None:
    import rendergraph as rg

    (tmp_path / "s.yaml").write_text(_scattered(9))
    made = rg.load("forward", scene=tmp_path / "s.yaml", size=(8, 8), sets=["light.lookup=null"])
    camera = _cameras(1)[0]
    turned = camera.transform.copy()
    turned[:3, 3] += turned[:3, 2] * 1e-4  # a little farther back: nothing comes or goes, and nothing is passed
    with gl.device.current():
        drawing = gl.compile(made)
        drawing.begin()
        lists = [one for each in views_of(drawing.executable) for one in each.lists]
        drawing.draw(1, camera)
        before = [one.drawn for one in lists]
        drawing.draw(2, Camera("any", turned, camera.type, camera.fov_y, near=camera.near, far=camera.far))
        assert all(one.drawn is drawn for one, drawn in zip(lists, before, strict=True))
        turned[:3, :3] *= (-1, 1, -1)  # looks back
        drawing.draw(3, Camera("any", turned, camera.type, camera.fov_y, near=camera.near, far=camera.far))
        assert any(one.drawn is not drawn for one, drawn in zip(lists, before, strict=True))
