"""Geometry steps: which objects, how they are culled, in what order, and how few calls draw them."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import pytest

from rendergraph.api import (
    ALPHA,
    Depth,
    InOut,
    Input,
    Luminance,
    Node,
    Output,
    Radiance,
    State,
    Steps,
    View,
    Views,
    structural,
)
from rendergraph.api import Frame as FrameOfNode
from rendergraph.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    import rendergraph as rg

    Draw = Callable[..., rg.Frame]

CAMERA = "cameras: {main: {eye: [0, 0, 5], target: [0, 0, 0], height: 2, near: 0.1, far: 50}}\n"


class Ids(Node):
    """The object's number plus one, 0 where nothing is."""

    color = Output(Radiance, format="r32f", clear=0.0, doc="Object.")
    depth = Output(Depth, format="depth32f", clear=0.0, doc="Depth.")
    objects: str | tuple[str, ...] = structural(default="all", doc="Which.")

    def record(self, steps: Steps) -> None:
        steps.geometry(
            "ids.frag", out={"color": self.color, "depth": self.depth}, objects=self.objects, materials="none"
        )


SHADERS = {"ids.frag": "flat in int v_object; out float color; void main() { color = float(v_object + 1); }"}
TEXT = "nodes: {i: {type: ids}}\noutputs: {image: i.color}"
BOXES = (
    "objects:\n"
    "  left: {shape: box, size: [1, 2, 1], at: [-0.5, 0, 0]}\n"
    "  rightNS: {shape: box, size: [1, 2, 1], at: [0.5, 0, 0], casts_shadow: false}\n"
    "  before: {shape: box, size: [0.5, 0.5, 0.5], at: [-0.5, 0, 1], material: thin}\n"
    "materials: {thin: {alpha_mode: blend}}\n" + CAMERA
)


@pytest.mark.parametrize(
    ("objects", "seen"),
    [
        ("all", {1, 2, 3}),
        ("opaque", {1, 2}),
        ("transparent", {0, 3}),
        ("casters", {0, 1}),
        (["before", "left"], {0, 1, 3}),
    ],
)
def test_a_step_draws_the_objects_it_names(draw: Draw, objects: Any, seen: set[int]) -> None:
    text = f"nodes: {{i: {{type: ids, params: {{objects: {json.dumps(objects)}}}}}}}\noutputs: {{image: i.color}}"
    image = draw(text, Ids, shaders=SHADERS, scene=BOXES, size=(16, 16)).arrays["image"]
    assert {int(value) for value in np.unique(image)} == seen
    if objects == "all":
        assert image[8, 4, 0] == 3  # nearest wins, whatever the order of drawing
        assert image[0, 0, 0] == 1
        assert image[0, -1, 0] == 2


def test_an_object_that_the_scene_lacks_is_named_by_check(bench: Any) -> None:
    text = "nodes: {i: {type: ids, params: {objects: [nobody]}}}\noutputs: {image: i.color}"
    with pytest.raises(InputError, match=r"RG431 node 'i' .*: it draws object 'nobody', which the scene does not have"):
        bench.pipeline(text, Ids, shaders=SHADERS, scene=BOXES).check()


class Over(Node):
    """Draws objects onto a picture that somebody else made."""

    picture = InOut(Radiance, format="r32f", optional=True, clear=7.0, doc="The picture.")
    objects: str = structural(default="transparent", doc="Which.")

    def record(self, steps: Steps) -> None:
        steps.geometry("over.frag", objects=self.objects, materials="none")


OVER = SHADERS | {"over.frag": "flat in int v_object; out float picture; void main() { picture = 100.0 + v_object; }"}
OPAQUE = BOXES.replace("alpha_mode: blend", "roughness: 1")


def test_what_would_draw_nothing_onto_a_picture_is_left_out_and_said(draw: Draw) -> None:
    text = "nodes: {i: {type: ids}, o: {type: over, inputs: {picture: i.color}}}\noutputs: {image: o.picture}"
    frame = draw(text, Ids, Over, shaders=OVER, scene=OPAQUE, size=(16, 16))
    assert set(np.unique(frame.arrays["image"])) == {1, 2, 3}
    assert frame.culled == {"o": "the scene has no transparent objects: there is nothing to draw"}
    assert set(np.unique(draw(text, Ids, Over, shaders=OVER, scene=BOXES, size=(16, 16)).arrays["image"])) == {
        1,
        2,
        102,
    }


def test_what_begins_a_picture_is_drawn_even_if_empty(draw: Draw) -> None:
    """Somebody must fill it with what it first holds."""
    text = "nodes: {o: {type: over}}\noutputs: {image: o.picture}"
    assert np.all(draw(text, Over, shaders=OVER, scene=OPAQUE, size=(16, 16)).arrays["image"] == 7.0)


class Behind(Node):
    """Draws objects where they are nearer than a depth that another of its steps samples, seen as that was."""

    depth = Input(Depth, doc="Depth.")
    color = Output(Radiance, format="r32f", doc="Object; the depth where none is.")

    def record(self, steps: Steps) -> None:
        steps.fullscreen("shown.frag", out=self.color, depth=self.depth)
        steps.geometry(
            "ids.frag",
            out=self.color,
            objects="all",
            materials="none",
            depth=self.depth.tested(),
            view=self.depth,
            state=State(depth_write=False, depth_func="greater"),
        )


class Back(Node):
    """A view and no step of its own."""

    views = Views(doc="The camera, turned round.")

    def update(self, frame: FrameOfNode) -> None:
        turn = np.diag([-1.0, 1.0, -1.0, 1.0]) @ frame.camera.view
        frame.set_views(self.views, [replace(frame.camera, view=turn)])


class Through(Node):
    """The scene's depth through a view."""

    view = Input(View, kind="view", doc="Which.")
    depth = Output(Depth, format="depth32f", clear=0.0, doc="Depth.")

    def record(self, steps: Steps) -> None:
        steps.geometry(None, vertex="<depth.vert>", out=self.depth, materials="none")


class Onto(Node):
    """Adds the scene to a depth with the view that it was drawn with."""

    depth = InOut(Depth, format="depth32f", doc="Depth.")

    def record(self, steps: Steps) -> None:
        steps.geometry(None, vertex="<depth.vert>", out=self.depth, materials="none", view=self.depth)


def test_a_continued_texture_brings_its_view(draw: Draw) -> None:
    scene = CAMERA + "objects: {box: {shape: box, size: [1, 1, 1], at: [0, 0, 10]}}\n"  # behind the camera
    nodes = "b: {type: back}, t: {type: through, inputs: {view: b.views}}, o: {type: onto, inputs: {depth: t.depth}}"
    once, twice = (
        draw(f"nodes: {{{nodes}}}\noutputs: {{depth: {end}}}", Back, Through, Onto, scene=scene).arrays["depth"]
        for end in ("t.depth", "o.depth")
    )
    assert once.max() > 0.0
    np.testing.assert_array_equal(once, twice)


def test_a_node_that_makes_nothing_but_views_is_updated(draw: Draw) -> None:
    scene = CAMERA + "objects: {box: {shape: box, size: [1, 1, 1], at: [0, 0, 10]}}\n"  # behind the camera
    text = "nodes: {b: {type: back}, t: {type: through, inputs: {view: b.views}}}\noutputs: {depth: t.depth}"
    frame = draw(text, Back, Through, scene=scene)
    assert frame.arrays["depth"].max() > 0.0
    assert frame.culled == {}


class Turned(Node):
    """Depth of one object, seen from the other side."""

    views = Views(doc="From behind.")
    depth = Output(Depth, format="depth32f", clear=0.0, view="views", doc="Depth.")

    def record(self, steps: Steps) -> None:
        steps.geometry(None, out=self.depth, objects=("left",), materials="none", view=self.views)

    def update(self, frame: FrameOfNode) -> None:
        turn = np.diag([-1.0, 1.0, -1.0, 1.0])
        turn[2, 3] = -5.0
        frame.set_views(self.views, [replace(frame.camera, view=turn)])


def test_a_depth_is_tested_that_another_step_samples_and_brings_its_view(draw: Draw) -> None:
    """Seen from behind, `left` is on the right and hides what is before it; where nothing was, all objects show."""
    text = "nodes: {t: {type: turned}, b: {type: behind, inputs: {depth: t.depth}}}\noutputs: {image: b.color}"
    shaders = SHADERS | {
        "shown.frag": "uniform sampler2D depth; out float color; "
        "void main() { color = -texelFetch(depth, ivec2(gl_FragCoord.xy), 0).r; }"
    }
    image = draw(text, Turned, Behind, shaders=shaders, scene=BOXES, size=(16, 16)).arrays["image"][..., 0]
    assert np.all(image[:, :8] == 2)
    assert np.all((image[:, 8:] < 0) & (image[:, 8:] > -1))


def _triangles(folder: Path, **material: Any) -> None:
    """A glTF with one triangle that faces the camera, one that faces away, and one mirrored, which still faces it."""
    points = np.array([[-1, -1, 0], [1, -1, 0], [-1, 1, 0]], np.float32)
    (folder / "t.bin").write_bytes(points.tobytes() + np.array([0, 1, 2, 0, 2, 1], np.uint16).tobytes())
    meshes = [{"primitives": [{"attributes": {"POSITION": 0}, "indices": number, "material": 0}]} for number in (1, 2)]
    gltf = {
        "asset": {"version": "2.0"},
        "buffers": [{"uri": "t.bin", "byteLength": 48}],
        "bufferViews": [{"buffer": 0, "byteLength": 36}, {"buffer": 0, "byteOffset": 36, "byteLength": 12}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3", "min": [-1, -1, 0], "max": [1, 1, 0]},
            {"bufferView": 1, "componentType": 5123, "count": 3, "type": "SCALAR"},
            {"bufferView": 1, "byteOffset": 6, "componentType": 5123, "count": 3, "type": "SCALAR"},
        ],
        "materials": [material],
        "meshes": meshes,
        "cameras": [{"type": "orthographic", "orthographic": {"xmag": 3, "ymag": 1, "znear": 0.1, "zfar": 9}}],
        "nodes": [
            {"mesh": 0, "translation": [-2, 0, 0]},
            {"mesh": 1},
            {"mesh": 0, "translation": [2, 0, 0], "scale": [-1, 1, 1]},
            {"camera": 0, "translation": [0, 0, 5]},
        ],
        "scenes": [{"nodes": [0, 1, 2, 3]}],
    }
    (folder / "t.gltf").write_text(json.dumps(gltf))


def test_back_faces_of_single_sided_materials_are_culled_and_mirrors_turn_the_winding(bench: Any) -> None:
    pipeline = bench.pipeline(TEXT, Ids, shaders=SHADERS, size=(48, 16))
    _triangles(bench.folder)
    image = bench.session.render(pipeline.with_scene(bench.folder / "t.gltf")).arrays["image"][..., 0]
    assert image[12, 3] == 1
    assert image[12, 19] == 0
    assert image[12, 44] == 3
    _triangles(bench.folder, doubleSided=True)
    again = bench.pipeline(TEXT, Ids, shaders=SHADERS, size=(48, 16)).with_scene(bench.folder / "t.gltf")
    assert bench.session.render(again).arrays["image"][12, 19, 0] == 2


class Wound(Node):
    """Triangles that a geometry shader winds counter-clockwise on the screen, whatever it is given."""

    color = Output(Luminance, format="r32f", clear=0.0, doc="1 where a front shows, 2 where a back does.")
    front: Literal["object", "counter_clockwise", "clockwise"] = structural(default="object", doc="What is a front.")

    def record(self, steps: Steps) -> None:
        steps.geometry(
            "sides.frag",
            geometry="wound.geom",
            out=self.color,
            materials="none",
            state=State(cull="none", front=self.front),
        )


WOUND = {
    "sides.frag": "out float color; void main() { color = gl_FrontFacing ? 1.0 : 2.0; }",
    "wound.geom": """layout(triangles) in;
layout(triangle_strip, max_vertices = 3) out;
void main() {
    vec2 a = gl_in[0].gl_Position.xy, b = gl_in[1].gl_Position.xy, c = gl_in[2].gl_Position.xy;
    bool turned = determinant(mat2(b - a, c - a)) < 0.0;
    for (int i = 0; i < 3; ++i) {
        gl_Position = gl_in[turned ? 2 - i : i].gl_Position;
        EmitVertex();
    }
}
""",
}


@pytest.mark.parametrize(
    ("front", "shown"), [("object", [1, 1, 2]), ("counter_clockwise", [1, 1, 1]), ("clockwise", [2, 2, 2])]
)
def test_a_geometry_shader_that_winds_by_itself_says_what_a_front_is(bench: Any, front: str, shown: list[int]) -> None:
    text = f"nodes: {{w: {{type: wound, params: {{front: {front}}}}}}}\noutputs: {{image: w.color}}"
    pipeline = bench.pipeline(text, Wound, shaders=WOUND, size=(48, 16))
    _triangles(bench.folder)
    image = bench.session.render(pipeline.with_scene(bench.folder / "t.gltf")).arrays["image"][..., 0]
    assert [image[12, column] for column in (3, 19, 44)] == shown


def test_a_step_that_says_what_a_front_is_needs_no_batch_for_mirrors(bench: Any) -> None:
    calls = []
    for front in ("object", "counter_clockwise"):
        text = f"nodes: {{w: {{type: wound, params: {{front: {front}}}}}}}\noutputs: {{image: w.color}}"
        pipeline = bench.pipeline(text, Wound, shaders=WOUND, size=(48, 16))
        _triangles(bench.folder)
        bench.session.render(pipeline.with_scene(bench.folder / "t.gltf"))
        calls.append(len(bench.session.cache.active.steps[0][0].draws))
    assert calls == [2, 1]


class Blended(Node):
    """Objects far to near, each blended over what is behind."""

    color = Output(Radiance, format="rgba32f", clear=0.0, doc="Blended.")

    def record(self, steps: Steps) -> None:
        steps.geometry(
            "blend.frag", objects="all", order="back_to_front", materials="none", state=State(blend=ALPHA, cull="back")
        )


BLEND = {
    "blend.frag": "flat in int v_object; out vec4 color; void main() { color = vec4(float(v_object + 1), 0, 0, 0.5); }"
}


@pytest.mark.parametrize(("eye", "expected"), [(5, 0.5 * 3 + 0.25 * 2 + 0.125), (-5, 0.5 * 1 + 0.25 * 2 + 0.125 * 3)])
def test_back_to_front_follows_the_eye(draw: Draw, eye: float, expected: float) -> None:
    scene = f"""objects:
  a: {{shape: box, size: [2, 2, 0.1], at: [0, 0, -1]}}
  b: {{shape: box, size: [2, 2, 0.1], at: [0, 0, 0], scale: [-1, 1, 1]}}
  c: {{shape: box, size: [2, 2, 0.1], at: [0, 0, 1]}}
cameras: {{main: {{eye: [0, 0, {eye}], target: [0, 0, 0], height: 2, near: 0.1, far: 50}}}}
"""
    text = "nodes: {b: {type: blended}}\noutputs: {image: b.color}"
    image = draw(text, Blended, shaders=BLEND, scene=scene, size=(8, 8))["image"]
    np.testing.assert_allclose(image[4, 4, 0], expected)


def test_a_moving_eye_sorts_anew_within_one_run(bench: Any) -> None:
    scene = """objects:
  a: {shape: box, size: [2, 2, 0.1], at: [0, 0, -1]}
  b: {shape: box, size: [2, 2, 0.1], at: [0, 0, 1]}
cameras: {main: {eye: [0, 0, 5], target: [0, 0, 0], height: 2, near: 0.1, far: 50}}
orbit: {camera: main, degrees_per_second: 180}
"""
    text = "nodes: {b: {type: blended}}\noutputs: {image: b.color}"
    frames = bench.frames(
        text,
        Blended,
        shaders=BLEND,
        scene=scene,
        size=(8, 8),
        frames=range(1, 3),
        fps=1.0,
    )
    seen = [float(frame["image"][4, 4, 0]) for frame in frames]
    assert seen == [0.5 * 2 + 0.25 * 1, 0.5 * 1 + 0.25 * 2]


def _grid(count: int) -> str:
    side = int(np.ceil(np.sqrt(count)))
    rows = [
        f"  o{k}: {{shape: box, size: [0.05, 0.05, 0.05], at: [{(k % side + 0.5) * 2 / side - 1}, {(k // side + 0.5) * 2 / side - 1}, 0]}}"
        for k in range(count)
    ]
    return "objects:\n" + "\n".join(rows) + "\n" + CAMERA


def test_ten_objects_and_a_thousand_take_the_same_calls(bench: Any) -> None:
    calls = []
    for count in (10, 1000):
        frame = bench.session.render(bench.pipeline(TEXT, Ids, shaders=SHADERS, scene=_grid(count), size=(64, 64)))
        executable = bench.session.cache.active
        calls.append([len(step.calls) for step in executable.lists[0]])
        assert len(np.unique(frame.arrays["image"])) > 10
    assert calls[0] == calls[1]


def test_objects_that_move_past_each_other_are_sorted_anew(bench: Any) -> None:
    scene = """objects:
  a: {shape: box, size: [2, 2, 0.1], at: [0, 0, -1]}
  b: {shape: box, size: [2, 2, 0.1], at: [0, 0, 0]}
keyframes: {objects.a.at: {0: [0, 0, -1], 1: [0, 0, 1]}}
cameras: {main: {eye: [0, 0, 5], target: [0, 0, 0], height: 2, near: 0.1, far: 50}}
"""
    frames = bench.frames(
        "nodes: {b: {type: blended}}\noutputs: {image: b.color}",
        Blended,
        shaders=BLEND,
        scene=scene,
        size=(8, 8),
        frames=range(1, 3),
        fps=1.0,
    )
    seen = [float(frame["image"][4, 4, 0]) for frame in frames]
    np.testing.assert_allclose(seen, [0.5 * 2 + 0.25 * 1, 0.5 * 1 + 0.25 * 2])


class Folds(Node):
    """Faces by how many of their three neighbours lie in their plane."""

    color = Output(Radiance, format="rg32f", clear=-1.0, doc="Neighbours in the plane, and the object.")
    depth = Output(Depth, format="depth32f", clear=0.0, doc="Depth.")
    objects: str | tuple[str, ...] = structural(default="opaque", doc="Which.")

    def record(self, steps: Steps) -> None:
        out = {"color": self.color, "depth": self.depth}
        steps.geometry(
            "folds.frag", geometry="folds.geom", out=out, objects=self.objects, topology="triangles_adjacency"
        )


FOLDS = {
    "folds.geom": """
        layout(triangles_adjacency) in;
        layout(triangle_strip, max_vertices = 3) out;
        in vec3 v_position[];
        flat in int v_object[];
        flat out vec2 g_color;
        void main() {
            vec3 normal = cross(v_position[2] - v_position[0], v_position[4] - v_position[0]);
            float flat_ones = 0.0;
            for (int i = 1; i < 6; i += 2) {
                flat_ones += float(abs(dot(normal, v_position[i] - v_position[0])) < 1e-5);
            }
            for (int i = 0; i < 6; i += 2) {
                g_color = vec2(flat_ones, float(v_object[0]));
                gl_Position = gl_in[i].gl_Position;
                EmitVertex();
            }
        }""",
    "folds.frag": "flat in vec2 g_color; out vec2 color; void main() { color = g_color; }",
}
FOLDED = (
    "objects:\n"
    "  left: {shape: box, at: [-0.5, 0, 0], rotate_degrees: [20, 30, 0], scale: 0.5}\n"
    "  right: {shape: box, at: [0.5, 0, 0], rotate_degrees: [20, 30, 0], scale: [-0.5, 0.5, 0.5]}\n" + CAMERA
)


def test_triangles_with_adjacency_know_their_neighbours(draw: Draw) -> None:
    """Two triangles make a face of a box: each has one neighbour in its plane, and two round the corner."""
    text = "nodes: {f: {type: folds}}\noutputs: {image: f.color}"
    frame = draw(text, Folds, shaders=FOLDS, scene=FOLDED, size=(32, 32))
    assert {tuple(color) for color in frame["image"].reshape(-1, 2)} == {(-1, -1), (1, 0), (1, 1)}
    again = draw(text, Folds, shaders=FOLDS, scene=FOLDED, size=(32, 32))
    assert np.array_equal(frame["image"], again["image"])


def test_open_meshes_have_no_neighbours_and_check_says_where(bench: Any) -> None:
    scene = FOLDED.replace("  left:", "  floor: {shape: plane, size: [2, 2], casts_shadow: false}\n  left:")
    text = "nodes: {f: {type: folds}}\noutputs: {image: f.color}"
    expected = (
        r"RG209 node 'f' \(folds\): object 'floor' is not closed: in its mesh 'plane' only one triangle has the edge "
        r"from \(-1, 0, -1\) to \(-1, 0, 1\)"
    )
    with pytest.raises(InputError, match=expected):
        bench.pipeline(text, Folds, shaders=FOLDS, scene=scene).check()
    bench.pipeline(
        text.replace("folds}", "folds, params: {objects: casters}}"), Folds, shaders=FOLDS, scene=scene
    ).check()
