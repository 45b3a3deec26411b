"""Geometry nodes: vertex attributes by name, constants where a mesh has none, objects by kind and name, wire frames."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

if TYPE_CHECKING:
    import rendergraph as rg

QUAD = "mtllib none.mtl\no {name}\nv -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\nvn 0 0 1\n"
PLAIN = QUAD.format(name="plain").replace("mtllib none.mtl\n", "") + "f 1//1 2//1 3//1 4//1\n"
SCENE = """objects:
  quad: {file: quad.obj}
cameras:
  main: {eye: [0, 0, 2], target: [0, 0, 0], height: 2, near: 0.1, far: 10}
"""
SHOWN = """
color = Output(Radiance, clear=-1.0, format="rgba32f", doc="The attribute.")

def record(self, steps):
    steps.geometry("wrong.frag", vertex="wrong.vert", state=State(cull="none"))
"""


def show(name: str, kind: str, value: str) -> dict[str, str]:
    """Shaders that show one attribute."""
    return {
        "wrong__vert": f"#include <transform.glsl>\nin {kind} {name};\nout vec4 v_shown;\nvoid main() {{\n"
        f"    v_shown = {value};\n    gl_Position = world_to_clip(object_to_world(in_position));\n}}",
        "wrong__frag": "in vec4 v_shown;\nout vec4 color;\nvoid main() { color = v_shown; }",
    }


@pytest.mark.parametrize(
    ("name", "kind", "value", "expected"),
    [
        ("in_uv0", "vec2", "vec4(in_uv0, 0.0, 0.0)", (0, 0, 0, 0)),
        ("in_uv1", "vec2", "vec4(in_uv1, 0.0, 0.0)", (0, 0, 0, 0)),
        ("in_color", "vec4", "in_color", (1, 1, 1, 1)),
        ("in_tangent", "vec4", "in_tangent", (0, 0, 0, 0)),
        ("in_normal", "vec3", "vec4(in_normal, 0.0)", (0, 0, 1, 0)),
        ("in_ids", "ivec2", "vec4(in_ids, 0.0, 0.0)", (0, 1, 0, 0)),
    ],
)
def test_attributes_that_no_mesh_has_are_constant(
    author: Any, gl: rg.Session, name: str, kind: str, value: str, expected: tuple[float, ...]
) -> None:
    """The second object, so that a constant which is not there for every instance would show."""
    author.node(SHOWN)
    author.write(**show(name, kind, value))
    (author.folder / "quad.obj").write_text(PLAIN)
    scene = SCENE.replace("objects:\n", "objects:\n  first: {file: quad.obj, at: [50, 0, 0]}\n")
    image = gl.render(author.pipeline(scene=scene))["image"]
    np.testing.assert_array_equal(image[4, 8], expected)


SELECTED = SHOWN.replace('state=State(cull="none")', 'state=State(cull="none"), objects={objects}')
TWO = """objects:
  left: {shape: box, size: [1.8, 1.8, 0.1], at: [-1, 0, 0]}
  right: {shape: box, size: [1.8, 1.8, 0.1], at: [1, 0, 0]}
cameras:
  main: {eye: [0, 0, 2], target: [0, 0, 0], height: 2, near: 0.1, far: 10}
"""


@pytest.mark.parametrize(
    ("objects", "drawn"),
    [
        ("'all'", (True, True)),
        ("['right']", (False, True)),
        ("('left', 'right')", (True, True)),
        ("'left'", (True, False)),
        ("[]", (False, False)),
        ("'transparent'", (False, False)),
    ],
)
def test_objects_by_kind_and_by_name(author: Any, gl: rg.Session, objects: str, drawn: tuple[bool, bool]) -> None:
    author.node(SELECTED.replace("{objects}", objects))
    author.write(**show("in_normal", "vec3", "vec4(1.0)"))
    (author.folder / "quad.obj").write_text(PLAIN)
    image = gl.render(author.pipeline(scene=TWO, size="[32, 16]"))["image"]
    assert (image[8, 8, 0] == 1, image[8, 24, 0] == 1) == drawn


WIRES = """
color = Output(Radiance, clear=0.0, format="r32f", doc="1 on edges.")
thickness: float = param(default=1.0, unit="texels", min=0.1, max=8, doc="Half the width of a line.")

def record(self, steps):
    steps.geometry("wrong.frag", geometry="wrong.geom", materials="none", state=State(cull="none"))
"""
GEOM = """// Barycentric coordinates, so that a fragment knows how far the nearest edge is.
layout(triangles) in;
layout(triangle_strip, max_vertices = 3) out;
out vec3 v_corner;
void main() {
    for (int i = 0; i < 3; ++i) {
        v_corner = vec3(i == 0, i == 1, i == 2);
        gl_Position = gl_in[i].gl_Position;
        EmitVertex();
    }
}
"""
WIRE_FRAG = """in vec3 v_corner;
uniform float thickness;  // texels
out float color;
void main() {
    vec3 texels = v_corner / fwidth(v_corner);
    if (min(texels.x, min(texels.y, texels.z)) > thickness) discard;
    color = 1.0;
}
"""


def test_a_wire_frame_by_a_geometry_shader(author: Any, gl: rg.Session) -> None:
    author.node(WIRES)
    author.write(wrong__geom=GEOM, wrong__frag=WIRE_FRAG)
    (author.folder / "quad.obj").write_text(PLAIN)
    image = gl.render(author.pipeline(scene=SCENE, size="[64, 64]")).arrays["image"][..., 0]
    assert image[0].min() == image[63].min() == image[:, 0].min() == image[:, 63].min() == 1  # the square's sides
    assert np.fliplr(image).diagonal().min() == 1  # and its diagonal
    assert image[10:25, 10:25].max() == image[40:55, 40:55].max() == 0  # not what lies between


def test_a_wire_frame_by_state(author: Any, gl: rg.Session) -> None:
    author.node(WIRES.replace('geometry="wrong.geom", ', "").replace('cull="none"', 'cull="none", wireframe=True'))
    author.write(wrong__frag="uniform float thickness;\nout float color;\nvoid main() { color = thickness; }")
    (author.folder / "quad.obj").write_text(PLAIN)
    scene = SCENE.replace("height: 2", "height: 3")
    image = gl.render(author.pipeline(scene=scene, size="[64, 64]")).arrays["image"][..., 0]
    assert 0 < image.sum() < 64 * 5


GIVEN = """
corners = Input(AnyTexel, kind="buffer", doc="Two coordinates and a value nobody wants.")
color = Output(Radiance, clear=0.0, format="r32f", doc="1 in the triangle.")

def record(self, steps):
    steps.draw("wrong.frag", vertex="wrong.vert", vertices=3, attributes={"2f 1f in_corner in_spare": self.corners})
"""
MADE = """
corners = Output(AnyTexel, kind="buffer", bytes=36, doc="A triangle.")

def record(self, steps):
    steps.compute("made.comp", over=1)
"""


def test_a_draw_over_a_buffer_that_another_node_filled(author: Any, gl: rg.Session) -> None:
    author.node(GIVEN)
    author.node(MADE, "made")
    author.write(
        made__comp="layout(local_size_x = 1) in;\nlayout(std430) buffer corners { float values[9]; };\nvoid main() {\n"
        "    values = float[](-1.0, -1.0, 9.0, 3.0, -1.0, 9.0, -1.0, 3.0, 9.0);\n}",
        wrong__vert="in vec2 in_corner;\nvoid main() { gl_Position = vec4(in_corner, 0.0, 1.0); }",
        wrong__frag="out float color;\nvoid main() { color = 1.0; }",
    )
    text = "nodes:\n  m: {type: made}\n  a: {type: wrong, inputs: {corners: m.corners}}\noutputs: {image: a.color}\n"
    assert gl.render(author.pipeline(text)).arrays["image"].min() == 1


LIMITS = {
    'color = Output(Radiance, samples=16, doc="Colour.")': ("samples", 16, "'a.color' has 16 samples per texel"),
    'color = Output(Radiance, kind="texture2d_array", layers=100_000, size=(1, 1), doc="Colour.")': (
        "layers",
        100_000,
        "'a.color' has 100000 layers",
    ),
}


@pytest.mark.parametrize("body", LIMITS)
def test_what_the_device_cannot_hold_is_said_with_numbers(author: Any, gl: rg.Session, body: str) -> None:
    limit, asked, text = LIMITS[body]
    if gl.device.limits[limit] >= asked:
        pytest.skip("this device can")
    author.node(body)
    (said,) = author.said(lambda: gl.render(author.pipeline()))
    assert said.rpartition("3: ")[2] == f"RG435 {text}, which is more than this device's {gl.device.limits[limit]}"


def test_more_views_than_a_block_holds(author: Any, gl: rg.Session) -> None:
    author.node(
        'color = Output(Radiance, doc="Colour.")\nviews = Views(count=200, doc="Many.")\n\n'
        'def record(self, steps):\n    steps.geometry("wrong.frag", view=self.views)\n\n'
        "def update(self, frame):\n    frame.set_views(self.views, [frame.camera] * 200)"
    )
    most = gl.device.limits["uniform_block"] // 448
    if most >= 200:
        pytest.skip("this device can")
    (said,) = author.said(lambda: gl.render(author.pipeline(scene=SCENE.replace("file: quad.obj", "shape: box"))))
    assert said == f"RG435 view table 'a.views' has 200 views; a uniform block of this device holds {most}"


def test_more_targets_than_the_device_takes(author: Any, gl: rg.Session) -> None:
    names = [f"color{number}" for number in range(gl.device.limits["color_targets"] + 1)]
    author.node("\n".join(f'{name} = Output(Radiance, doc="One of many.")' for name in names))
    outputs = ", ".join(f"{name}: a.{name}" for name in names)
    (said,) = author.said(lambda: gl.render(author.pipeline(f"nodes:\n  a: {{type: wrong}}\noutputs: {{{outputs}}}\n")))
    count = gl.device.limits["color_targets"]
    assert (
        said
        == f"test.yaml:4:3: RG435 node 'a' (wrong): it has {count + 1} colour targets; this device supports {count}"
    )


def test_more_tables_and_buffers_than_the_device_binds(
    author: Any, gl: rg.Session, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(gl.device.limits, "uniform_bindings", 7)
    monkeypatch.setitem(gl.device.limits, "storage_bindings", 7)
    author.node(
        'color = Output(Radiance, doc="Colour.")\nviews = Views(doc="One.")\none = Internal(kind="buffer", bytes=8)\n'
        'two = Internal(kind="buffer", bytes=8)\n\ndef record(self, steps):\n'
        '    steps.fullscreen("wrong.frag", one=self.one, two=self.two)\n\n'
        "def update(self, frame):\n    frame.set_views(self.views, [frame.camera])"
    )
    said = author.said(lambda: gl.render(author.pipeline()))
    assert said == [
        "RG435 there are 2 view tables; this device binds 1 at once",
        f"test.yaml:4:3: RG435 node 'a' (wrong): wrong.py:{author.line('steps.full')}: it has 2 buffers; this device supports 1",
    ]


GLOW = """
radiance = InOut(Radiance, doc="What is drawn on.")

def record(self, steps):
    steps.fullscreen("glow.frag", state=State(blend=ADD))
"""


def test_a_plan_tells_what_is_continued_from_what_is_read_and_says_what_a_copy_is_for(author: Any) -> None:
    from rendergraph.diagrams.plan import plan_text

    author.node('color = Output(Radiance, clear=0, doc="White.")')
    author.node(GLOW, "glow")
    author.write(glow__frag="out vec4 radiance;\nvoid main() { radiance = vec4(1.0); }\n")
    pipeline = author.pipeline(
        "nodes:\n  a: {type: wrong}\n  g: {type: glow, inputs: {radiance: a.color}}\n"
        "outputs: {before: a.color, image: g.radiance}\n"
    )
    rows = plan_text(pipeline.plan()).split("lifetimes")[0].splitlines()[2:]
    cells = [re.split(r"  +", row.strip())[1:4] for row in rows if row.strip()]
    assert cells == [
        ["a", "-", "a.color"],
        ["copy of a.color, kept for output 'before'", "a.color", "a.color kept"],
        ["g", "-", "a.color (continued)"],
    ]
    rows = plan_text(pipeline.plan(outputs=[], taps=["a.color", "g.radiance"])).splitlines()
    assert any("copy of a.color, kept for tap 'a.color'" in row for row in rows)
