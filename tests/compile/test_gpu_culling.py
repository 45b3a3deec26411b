"""Geometry steps that draw what a shader decides: the same picture as with the objects culled on the CPU."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from rendergraph.api import Depth, Input, Internal, Node, Output, Radiance, SceneData, Steps, param, structural
from rendergraph.errors import InputError

if TYPE_CHECKING:
    import rendergraph as rg


def commands_bytes(node: Node, facts: Any) -> int:
    return 20 * max(1, len(facts.objects))


class Culled(Node):
    """Normals of what a shader lets through, or of all that the CPU does not cull."""

    scene = Input(SceneData, doc="The scene's objects.")
    color = Output(Radiance, format="rgba32f", clear=0.0, doc="Normals and albedo.")
    commands = Output(Radiance, kind="buffer", bytes=commands_bytes, doc="A command for each object.")
    depth = Internal(Depth, format="depth32f", clear=0.0)

    margin: float = param(default=0.0, min=-100, max=100, doc="Metres around the view.")
    by_shader: bool = structural(default=True, doc="Whether a shader culls.")
    objects: str = structural(default="all", doc="Which objects are drawn.")

    def record(self, steps: Steps) -> None:
        steps.compute("cull.comp", over=len(steps.facts.objects), scene=self.scene, out=self.commands)
        chosen: dict[str, Any] = {"commands": self.commands} if self.by_shader else {}
        out = {"color": self.color, "depth": self.depth}
        steps.geometry("seen.frag", out=out, objects=self.objects, scene=None, **chosen)


SHADERS = {
    "cull.comp": """#include <scene.glsl>
layout(local_size_x = 64) in;
layout(std430) writeonly buffer commands { DrawCommand command[]; };
uniform float margin;

bool is_in_view(vec3 center, vec3 extent) {
    mat4 rows = transpose(camera.view_projection);
    vec4 sides[5] = vec4[](rows[3] + rows[0], rows[3] - rows[0], rows[3] + rows[1], rows[3] - rows[1],
                           rows[3] - rows[2]);  // left, right, bottom, top, near
    for (int i = 0; i < 5; ++i)
        if (dot(sides[i].xyz, center) + dot(abs(sides[i].xyz), extent) + sides[i].w < -1e-4) return false;
    return true;
}

void main() {
    int i = int(gl_GlobalInvocationID.x);
    if (i >= SCENE_INSTANCE_COUNT) return;
    SceneInstance object = scene_instances[i];
    command[i] = scene_draw_command(i, is_in_view(object.box_center.xyz, object.box_extent.xyz + margin));
}
""",
    "seen.frag": """#include <pass_view.glsl>
#include <fragment_surface.glsl>
out vec4 color;
void main() { Surface s = fragment_surface(PASS_VIEW); color = vec4(s.normal * s.base_color, 1.0); }
""",
}
SCENE = """
cameras: {main: {eye: [0, 1, 6], target: [0, 1, 0], fov_y_degrees: 30}}
materials:
  red: {base_color: [1, 0.2, 0.1]}
  two: {base_color: [0.2, 1, 0.1], double_sided: true}
objects:
"""
for number in range(30):
    x, z = 1.6 * (number % 6 - 2.5), 3.0 * (number // 6 - 2)
    material = ("red", "two")[number % 4 == 1]
    SCENE += f"  o{number}: {{shape: sphere, radius: 0.5, material: {material}, at: [{x}, 1, {z}]}}\n"
TEXT = "nodes: {a: {type: culled}}\noutputs: {image: a.color}"


def drawn(frame: rg.Frame) -> int:
    return int(frame["a.commands"].view(np.uint32).reshape(-1, 5)[:, 1].sum())


def test_a_shader_culls_what_the_view_does_not_show(bench: Any, gl: rg.Session) -> None:
    pipeline = bench.pipeline(TEXT, Culled, shaders=SHADERS, scene=SCENE, size=(48, 32))
    options: dict[str, Any] = {"outputs": ["image"], "taps": ["a.commands"]}
    plain = gl.render(pipeline.set("a.by_shader", False), **options)
    culled = gl.render(pipeline, **options)
    every = gl.render(pipeline.set("a.margin", 100), **options)
    assert drawn(every) == 30
    assert 0 < drawn(culled) < 20
    assert len(np.unique(plain["image"])) > 50
    for frame in (culled, every):
        np.testing.assert_array_equal(frame["image"], plain["image"])
    assert not np.array_equal(gl.render(pipeline.set("a.margin", -1.5), **options)["image"], plain["image"])


def test_it_follows_objects_that_move(bench: Any, gl: rg.Session) -> None:
    scene = SCENE + "keyframes:\n  objects.o14.at: {0: [0, 1, 0], 1: [50, 1, 0]}\n"
    pipeline = bench.pipeline(TEXT, Culled, shaders=SHADERS, scene=scene, size=(48, 32))
    options: dict[str, Any] = {"outputs": ["image"], "taps": ["a.commands"], "frames": range(1, 32, 30)}
    before, after = gl.frames(pipeline, **options)
    assert drawn(after) == drawn(before) - 1
    (*_, plain) = gl.frames(pipeline.set("a.by_shader", False), **options)
    np.testing.assert_array_equal(after["image"], plain["image"])


def test_a_selection_of_objects(bench: Any, gl: rg.Session) -> None:
    pipeline = bench.pipeline(TEXT, Culled, shaders=SHADERS, scene=SCENE, size=(48, 32)).set("a.objects", "o14")
    plain = gl.render(pipeline.set("a.by_shader", False))
    assert plain["image"].any()
    np.testing.assert_array_equal(gl.render(pipeline)["image"], plain["image"])


class Sorted(Culled):
    """Both an order and commands."""

    def record(self, steps: Steps) -> None:
        steps.geometry("seen.frag", out=self.color, order="back_to_front", commands=self.commands)


def test_commands_have_an_order_of_their_own(bench: Any) -> None:
    with pytest.raises(InputError, match=r"both commands and order='back_to_front' are given"):
        bench.pipeline(TEXT.replace("culled", "sorted"), Sorted, shaders=SHADERS, scene=SCENE).check()
