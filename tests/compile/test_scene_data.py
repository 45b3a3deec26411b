"""The scene as data: surfaces fetched from it equal those that geometry passes draw, and it costs what it must."""

from __future__ import annotations

import inspect
import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from msgspec.structs import replace

import rendergraph as rg
from rendergraph.api import Any as Anything
from rendergraph.api import DisplayColor, Function, Input, Node, Output, SceneData, ShadowLookup, Steps
from rendergraph.compile import GpuScene
from rendergraph.declare import declaration_mistakes
from rendergraph.errors import InputError, RenderError
from rendergraph.images import write
from rendergraph.resources import shipped_scenes
from rendergraph.scene import scene_data
from rendergraph.scene.model import ImageSource, Texture
from rendergraph.textures import TextureDesc

SHADERS = {
    # The corners' weights come from a geometry shader, so that nothing of the scene's data decides where a pixel lies.
    "seen.geom": """
layout(triangles) in;
layout(triangle_strip, max_vertices = 3) out;
in vec3 v_position[];
flat in int v_object[];
out vec3 weights;
out vec3 drawn_position;
flat out ivec2 triangle;
void main() {
    for (int i = 0; i < 3; ++i) {
        weights = vec3(i == 0, i == 1, i == 2);
        drawn_position = v_position[i];
        triangle = ivec2(v_object[i], gl_PrimitiveIDIn);
        gl_Position = gl_in[i].gl_Position;
        EmitVertex();
    }
}
""",
    "seen.frag": """
#include <scene.glsl>
in vec3 weights;
in vec3 drawn_position;
flat in ivec2 triangle;
out vec4 seen;
out vec4 drawn;
void main() {
    float cutoff = materials[MATERIAL_INDEX(scene_instances[triangle.x].material)].emissive.a;
    bool masked = scene_has(triangle.x, SCENE_MASKED);
    if (masked && scene_alpha(triangle.x, triangle.y, weights.yz) < cutoff) discard;
    seen = vec4(triangle, weights.yz);
    drawn = vec4(drawn_position, gl_FrontFacing ? 1.0 : 0.0);
}
""",
    "fetch.frag": """
#include <scene.glsl>
uniform sampler2D seen;
#define ALL(name) out vec4 name;
TARGETS
#undef ALL
void main() {
#define ALL(name) name = vec4(0.0);
    TARGETS
    vec4 hit = texelFetch(seen, ivec2(gl_FragCoord.xy), 0);
    int instance = int(hit.x), triangle = int(hit.y);
    if (instance < 0) return;
    vec3 at = scene_position(instance, triangle, hit.zw);
    Surface s = scene_surface(instance, triangle, hit.zw, view_dir(seen_views[0], at));
#ifdef WRITES_POSITION
    position = vec4(s.position, distance(scene_barycentrics(instance, triangle, at), hit.zw));
    geometric = vec4(s.geometric_normal, dot(scene_geometric_normal(instance, triangle), s.geometric_normal));
    flags = vec4(s.alpha, scene_alpha(instance, triangle, hit.zw), scene_instances[instance].flags, 0.0);
#endif
#ifdef WRITES_ALBEDO
    albedo = vec4(sqrt(s.base_color), 1.0);
    normal = vec4(s.normal, 0.0);
    material = vec4(s.metallic, s.roughness, s.occlusion, s.lit);
    emissive = vec4(s.emissive, 1.0);
    specular = vec4(sqrt(s.dielectric.rgb), s.dielectric.a);
    grain = vec4(s.tangent, s.anisotropy);
    phong_diffuse = vec4(sqrt(s.diffuse), 1.0);
    phong_specular = vec4(sqrt(s.f0), 1.0);
#endif
}
""",
}
OF_GBUFFER = ("albedo", "normal", "material", "emissive", "specular", "grain", "phong_diffuse", "phong_specular")


SURFACES = '''
"""Surfaces by way of the scene's data."""

from __future__ import annotations

from rendergraph.api import Any, Depth, Input, Internal, Node, Output, SceneData

GBUFFER = ("albedo", "normal", "material", "emissive", "specular", "grain", "phong_diffuse", "phong_specular")


class Surfaces(Node):
    """A visibility buffer of what is opaque, and the surfaces that it finds."""

    scene = Input(SceneData, doc="Scene.")
    depth = Internal(Depth, format="depth32f", clear=0.0)
    seen = Output(Any, format="rgba32f", clear=-1.0, doc="Instance, triangle and barycentrics.")
    drawn = Output(Any, format="rgba32f", clear=0.0, doc="Position as drawn, and whether from the front.")
    position = Output(Any, format="rgba32f", doc="Position, and how far the barycentrics that it gives are off.")
    geometric = Output(Any, format="rgba32f", doc="Geometric normal, and whether it is that of the front.")
    flags = Output(Any, format="rgba32f", doc="Alpha of the surface, its opacity, flags.")
    albedo = Output(Any, format="rgba32f", doc="Square root of the base colour.")
    normal = Output(Any, format="rgba32f", doc="Shading normal.")
    material = Output(Any, format="rgba32f", doc="Metallic, roughness, occlusion and lit.")
    emissive = Output(Any, format="rgba32f", doc="Emission.")
    specular = Output(Any, format="rgba32f", doc="Of the dielectric part.")
    grain = Output(Any, format="rgba32f", doc="Tangent and anisotropy.")
    phong_diffuse = Output(Any, format="rgba32f", doc="kd.")
    phong_specular = Output(Any, format="rgba32f", doc="ks.")

    def record(self, steps):
        out = {"seen": self.seen, "drawn": self.drawn, "depth": self.depth}
        steps.geometry("seen.frag", geometry="seen.geom", out=out, objects="opaque", in_place=True, scene=self.scene)
        for names in (("position", "geometric", "flags"), GBUFFER):
            defines = {"TARGETS": " ".join(f"ALL({name})" for name in names), "NEEDS_PHONG": 1, "NEEDS_GRAIN": 1}
            targets = {name: getattr(self, name) for name in names}
            steps.fullscreen("fetch.frag", seen=self.seen, scene=self.scene, out=targets, defines=defines)
'''
OWN = ("seen", "drawn", "position", "geometric", "flags")


@pytest.fixture(scope="module")
def plugins(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the node type `surfaces`."""
    folder = tmp_path_factory.mktemp("plugins")
    for name, text in {"surfaces.py": SURFACES, **SHADERS}.items():
        (folder / name).write_text(text)
    return folder


def surfaces(gl: rg.Session, plugins: Path, scene: str | Path, size: tuple[int, int] = (96, 72)) -> rg.Frame:
    """A frame with the outputs of `Surfaces`, and with those of a G-buffer in float32 as `drawn_NAME`."""
    nodes = {"gbuffer": {"type": "gbuffer", "params": {"precision": "full"}}, "surfaces": {"type": "surfaces"}}
    outputs = {name: f"surfaces.{name}" for name in (*OWN, *OF_GBUFFER)}
    outputs |= {f"drawn_{name}": f"gbuffer.{name}" for name in OF_GBUFFER}
    file = plugins.parent / "surfaces.yaml"
    file.write_text(json.dumps({"rendergraph": 1, "size": size, "nodes": nodes, "outputs": outputs}))
    return gl.render(rg.load(file, scene=scene, plugins=[plugins]))


def differences(frame: rg.Frame) -> dict[str, npt.NDArray[np.float32]]:
    """How far each texture is from what is drawn, at every pixel that a triangle covers; relative where it is bright."""
    covered = frame["seen"][..., 0] >= 0
    assert 0.01 < covered.mean() <= 1  # a camera that frames a whole clip sees little of a character
    found = {name: np.abs(frame[name] - frame[f"drawn_{name}"])[covered] for name in OF_GBUFFER}
    found["emissive"] /= np.maximum(1.0, frame["drawn_emissive"][covered])
    found["grain"] = found["grain"][frame["drawn_grain"][covered][:, 3] > 0]  # of anisotropic materials
    size = np.abs(frame["drawn"][covered]).max()
    found["position"] = np.abs(frame["position"] - frame["drawn"])[covered][:, :3] / max(1.0, size)
    found["barycentrics"] = frame["position"][covered][:, 3:]
    return {name: values.max(axis=-1, initial=0.0) for name, values in found.items()}


@pytest.fixture
def level_0(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let geometry passes read textures as the scene's data does: level 0, with the filter of magnification."""
    texture = GpuScene.texture

    def without_mips(self: GpuScene, found: Texture) -> tuple[int, int]:
        return texture(self, replace(found, min_filter=found.mag_filter))

    monkeypatch.setattr(GpuScene, "texture", without_mips)


def check(frame: rg.Frame) -> None:
    """Every surface is what is drawn; the steps are those of 8-bit texels where hardware filters in such steps."""
    off = differences(frame)
    assert off["position"].max() < 1e-4
    assert off["barycentrics"].max() < 1e-3
    for name in OF_GBUFFER:  # where texels average out, unit normals are anything
        assert (off[name] > 0.012).sum() <= 0.0005 * off[name].size, name
    covered = frame["seen"][..., 0] >= 0
    front, drawn_front = frame["geometric"][covered][:, 3] > 0, frame["drawn"][covered][:, 3] > 0
    np.testing.assert_array_equal(front, drawn_front)


@pytest.mark.nightly(keep=1)
@pytest.mark.parametrize("scene", ["spheres", "shadow_study", "still_life", "lantern"])
def test_a_surface_is_what_a_geometry_pass_draws(gl: rg.Session, plugins: Path, tmp_path: Path, scene: str) -> None:
    """Without textures, whose level the pass chooses by the pixel's size."""
    bare = re.sub(r"texture: \{[^}]*\}", "base_color: 0.5", shipped_scenes()[scene].read_text())
    (tmp_path / "bare.yaml").write_text(bare)
    frame = surfaces(gl, plugins, tmp_path / "bare.yaml")
    check(frame)
    assert max(values.max(initial=0.0) for values in differences(frame).values()) < 5e-4  # of factors alone


PATCH = """
v -1 0 -1
v 1 0.2 -1
v 1 0 1
v -1 0.3 1
vt -0.6 -0.4
vt 1.7 0.1
vt 1.4 2.3
vt -0.2 1.6
vn 0 1 0.1
vn 0.1 1 0
vn 0 1 -0.1
vn -0.1 1 0
f 1/1/1 4/4/4 3/3/3
f 1/1/1 3/3/3 2/2/2
"""
TEXTURED = """
scene: 1
cameras: {main: {eye: [0.2, 3.2, 4.2], target: [0, 0, -0.2], fov_y_degrees: 55}}
lights: {sun: {type: directional}}
materials:
  all:
    base_color_texture: color.png
    metallic_roughness_texture: other.png
    occlusion_texture: other.png
    normal_texture: bumps.png
    emissive_texture: color.png
    emissive: [1, 2, 3]
    metallic: 0.8
    normal_scale: 1.5
    occlusion_strength: 0.7
    double_sided: true
  masked: {base_color_texture: color.png, alpha_mode: mask, alpha_cutoff: 0.48, double_sided: true, normal_texture: bumps.png}
  grain: {anisotropy_strength: 0.5, anisotropy_rotation: 0.4, base_color: [0.2, 0.4, 0.6], normal_texture: bumps.png}
objects:
  plain: {file: patch.obj, material: all, at: [-2.2, 0, 0]}
  mirrored: {file: patch.obj, material: all, at: [0, 0.5, 0], scale: [-1, 1.5, 0.7], rotate_degrees: [20, 30, 0]}
  below: {file: patch.obj, material: all, at: [2.2, 0.5, 0], rotate_degrees: [195, 20, 0]}
  both: {file: patch.obj, material: masked, at: [-1.5, 1.6, -1.5], scale: [1.5, 1, -1.5], rotate_degrees: [70, 10, 0]}
  knot: {shape: torus_knot, material: grain, at: [1.5, 1.2, -1], scale: [1.1, -1.2, 1.4]}
  stretched: {shape: sphere, material: all, at: [0, 0, 2], scale: [0.8, 0.3, 0.5], rotate_degrees: [0, 0, 30]}
"""


@pytest.mark.usefixtures("level_0")
def test_every_use_of_textures_and_transforms_is_the_same(gl: rg.Session, plugins: Path, tmp_path: Path) -> None:
    """Both sides, mirrored and stretched; tangents of the mesh and derived ones; masks, grain, wrapped coordinates."""
    pytest.importorskip("OpenImageIO")
    random = np.random.default_rng(3)
    images = {"color": (5, 7), "other": (8, 4), "bumps": (16, 16)}
    for name, size in images.items():
        texels = random.integers(90, 166, (*size, 4 if name == "color" else 3))
        if name == "bumps":
            texels[..., 2] = 255
        write(tmp_path / f"{name}.png", texels.astype(np.uint8))
    (tmp_path / "patch.obj").write_text(PATCH)
    (tmp_path / "scene.yaml").write_text(TEXTURED)
    frame = surfaces(gl, plugins, tmp_path / "scene.yaml")
    check(frame)
    flags = {int(value) for value in frame["flags"][..., 2].ravel()}
    for name in ("double_sided", "masked", "mirrored", "has_tangents", "has_uv0"):
        bit = scene_data.FLAGS[name]
        assert {bool(value & bit) for value in flags if value} == {True, False} or name == "has_uv0"
    seen, drawn = frame["geometric"][..., 3], frame["drawn"][..., 3]
    assert ((seen < 0) & (drawn == 0)).mean() > 0.03  # back faces


SMALL = ("BoxTextured.glb", "TextureTransformTest/TextureTransformTest.gltf", "TwoSidedPlane/TwoSidedPlane.gltf")


@pytest.mark.nightly(keep=1)
@pytest.mark.usefixtures("level_0")
@pytest.mark.parametrize("name", SMALL)
def test_textured_surfaces_are_too(gl: rg.Session, plugins: Path, shared: Path, name: str) -> None:
    check(surfaces(gl, plugins, shared / "assets" / "gltf" / name))


@pytest.mark.usefixtures("level_0")
def test_images_of_many_sizes_share_an_array(
    gl: rg.Session, plugins: Path, shared: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Here two sizes in one array, with all wrap modes and filters: a smaller image fills the corner of its layer."""
    monkeypatch.setattr(scene_data, "MOST_ARRAYS", 1)
    check(surfaces(gl, plugins, shared / "assets" / "gltf" / "TextureSettingsTest.glb"))


@pytest.mark.nightly
@pytest.mark.usefixtures("level_0")
def test_surfaces_of_every_asset_are_too(gl: rg.Session, plugins: Path, shared: Path) -> None:
    folder = shared / "assets" / "gltf"
    drawn = 0
    others = [*(shared / "assets" / "obj").glob("*.obj"), *(shared / "assets" / "sponza").glob("*.gltf")]
    for file in sorted([*folder.glob("*.gl*"), *folder.glob("*/*.gltf"), *others]):
        try:
            frame = surfaces(gl, plugins, file, (160, 120))
        except InputError as error:  # an extension that nothing here draws
            if {problem.code for problem in error.problems} != {"RG308"}:
                raise
            continue
        check(frame)
        drawn += 1
    assert drawn > 40


# Changes of the scene ------------------------------------------------------------------------------------------------

BOXES = """
cameras: {main: {eye: [0, 1, 6], target: [0, 0, 0]}}
lights: {sun: {type: directional, direction: [-1, -2, -1]}}
materials: {red: {base_color: [1, 0, 0]}, green: {base_color: [0, 1, 0], emissive: [1, 1, 1]}}
objects:
  one: {shape: box, material: red}
  two: {shape: box, material: green, at: [2, 0, 0], scale: [-1, 1, 1], casts_shadow: false}
  three: {shape: plane, material: red, at: [0, -1, 0]}
"""
PLACE = """
#include <scene.glsl>
out vec4 color;
void main() { color = vec4(scene_position(0, 0, vec2(0.0)), scene_instances[1].rows[0].w); }
"""
COLOR = """
#include <scene.glsl>
out vec4 color;
void main() { color = materials[1].base_color; }
"""
LIGHT = """
#include <scene.glsl>
#include <lights.glsl>
out vec4 color;
void main() { color = lights[0].color; }
"""
BEFORE = """
#include <previous_scene.glsl>
out vec4 color;
void main() { color = vec4(scene_previous_position(0, 0, vec2(0.0)), 1.0); }
"""


class Of(Node):
    """One texel of the scene's data."""

    scene = Input(SceneData, doc="Scene.")
    color = Output(Anything, format="rgba32f", size=(1, 1), doc="Texel.")
    kept = Output(Anything, format="rgba32f", size=(1, 1), kept=True, doc="The same.")

    def record(self, steps: Steps) -> None:
        for out in (self.color, self.kept):
            if steps.used(out):
                steps.fullscreen("of.frag", scene=self.scene, out={"color": out})


ONE, KEPT = "nodes: {a: {type: of}}\noutputs: {image: a.color}\n", "nodes: {a: {type: of}}\noutputs: {image: a.kept}\n"


def ran(bench: Any, text: str, shader: str, moving: str, frames: int = 5) -> tuple[list[int], list[Any]]:
    """How many steps each frame runs, and its texel; what moves does so from frame 2 to 3 and stays there."""
    scene = BOXES + f"keyframes: {{{moving}}}\n"
    pipeline = bench.pipeline(text, Of, shaders={"of.frag": shader}, scene=scene)
    shown = list(
        bench.session.frames(pipeline, frames=range(1, frames + 1), fps=1, reuse=True, timed=True, warm_up=False)
    )
    return [frame.times[-1].ran for frame in shown], [frame["image"][0, 0].tolist() for frame in shown]


MOVES = "objects.one.at: {1: [0, 0, 0], 2: [0, 3, 0]}"
PALES = "materials.green.base_color: {1: [0, 1, 0], 2: [1, 1, 1]}"


DIMS = "lights.sun.intensity: {1: 1, 2: 3}"


@pytest.mark.parametrize("text", [ONE, KEPT], ids=["each frame", "kept"])
@pytest.mark.parametrize(("shader", "moving"), [(PLACE, MOVES), (COLOR, PALES), (LIGHT, DIMS)])
def test_a_step_runs_again_where_what_it_looks_at_has_changed(bench: Any, text: str, shader: str, moving: str) -> None:
    """In the first frame, and in that in which the part of the scene changes that it looks at."""
    counts, texels = ran(bench, text, shader, moving)
    assert counts == [1, 0, 1, 0, 0]
    assert texels[0] == texels[1] != texels[2] == texels[3] == texels[4]
    for other in {MOVES, PALES, DIMS} - {moving}:
        assert ran(bench, text, shader, other)[0] == [1, 0, 0, 0, 0]


def test_the_frame_before_is_that_of_the_scene(bench: Any) -> None:
    counts, texels = ran(bench, ONE, BEFORE, MOVES)
    assert counts == [1, 0, 1, 1, 0]  # it looks at the records of instances, too
    assert [texel[1] - texels[0][1] for texel in texels] == [0, 0, 0, 3, 3]
    with pytest.raises(InputError, match=r"RG439 .* the transforms of objects in the previous frame"):
        ran(bench, KEPT, BEFORE, MOVES)


def test_a_kept_value_of_the_scene_is_not_that_of_another(bench: Any) -> None:
    first, second = (ran(bench, KEPT, COLOR, PALES, frames=1) for _ in range(2))
    other = bench.draw(
        KEPT, Of, shaders={"of.frag": COLOR}, scene=BOXES.replace("[0, 1, 0], emissive", "[0, 0, 1], emissive")
    )
    assert first[1] == second[1] == [[0, 1, 0, 1]]
    assert other["image"][0, 0].tolist() == [0, 0, 1, 1]


# Cost and limits -----------------------------------------------------------------------------------------------------


def test_facts_know_the_bytes_and_only_readers_pay(bench: Any) -> None:
    noted: list[Any] = []

    class Asks(Of):
        """One texel, and what is known before."""

        def record(self, steps: Steps) -> None:
            noted.append((steps.facts.scene_data, steps.facts.input("scene").bytes, steps.connected(self.scene)))
            super().record(steps)

    pipeline = bench.pipeline(ONE.replace("of}", "asks}"), Asks, shaders={"of.frag": PLACE}, scene=BOXES)
    plain = rg.load("deferred", scene=bench.folder / "scene.yaml")
    assert plain.link().graph.facts.scene_data is None
    with bench.session.current():
        assert bench.session.compile(plain).scene._data is None
    with bench.session.current():
        data = bench.session.compile(pipeline).scene.data
        held = sum(buffer.size for name, buffer in data.buffers.items() if name != "scene_index_block")
    facts, size, connected = noted[0]
    assert connected
    assert facts.bytes == size == held
    assert (facts.triangles, facts.emitters, facts.textures) == (12 + 12 + 2, 12, ())


def test_a_plan_says_what_the_data_consists_of(bench: Any) -> None:
    planned = bench.pipeline(ONE, Of, shaders={"of.frag": PLACE}, scene=BOXES).plan()
    assert planned.reasons["the scene's data"].startswith("1.7 KiB of buffers; it is uploaded with the scene")
    assert planned.memory.no_reuse_bytes == 16  # nothing of it is the pipeline's


def test_a_scene_beyond_the_devices_texture_buffers_is_refused(bench: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(bench.session.device.limits, "texture_buffer", 60)
    with pytest.raises(RenderError, match=r"RG435 the scene's 'scene_vertex_texels' takes \d+ bytes, .* holds 960"):
        bench.draw(ONE, Of, shaders={"of.frag": PLACE}, scene=BOXES)


def _image(number: int) -> scene_data.Stored:
    return ImageSource(Path(f"{number}.png")), True, "repeat", "repeat"


@pytest.mark.parametrize(
    ("sides", "joined"),
    [  # little ones with each other, and with large ones where that adds less than 4 MiB
        ([(1024, 1024), (1000, 1024), (512, 512), (256, 256), (8, 8)], [(512, 512, 3), (1024, 1024, 2)]),
        ([(4096, 4096), (4096, 4096), (1024, 1024)], [(1024, 1024, 1), (4096, 4096, 2)]),
        (  # no more than five arrays, whatever that adds
            [(8192, 8192), (8000, 8192), (6000, 6000), (4096, 4096), (4000, 4096), (2048, 2048)],
            [(2048, 2048, 1), (4096, 4096, 2), (6000, 6000, 1), (8000, 8192, 1), (8192, 8192, 1)],
        ),
        ([(16, 16)] * 1500 + [(15, 15)] * 1500, [(15, 15, 1500), (16, 16, 1500)]),  # devices have 2048 layers
    ],
)
def test_arrays_are_joined_where_that_costs_least(
    sides: list[tuple[int, int]], joined: list[tuple[int, int, int]]
) -> None:
    descs = {_image(n): TextureDesc("texture2d", "srgb8_a8", *size) for n, size in enumerate(sides)}
    found = scene_data.texture_arrays(descs)
    assert sorted((desc.width - 2, desc.height - 2, desc.layers) for desc in found.arrays) == joined
    assert len(set(found.places.values())) == len(sides)
    assert found.smaller == sum(side not in {shape[:2] for shape in joined} for side in sides)
    other = {_image(9): TextureDesc("texture2d", "rgba8", 8, 8)}
    assert {desc.format for desc in scene_data.texture_arrays(descs | other).arrays} == {"srgb8_a8", "rgba8"}


PULLED = """
#include <scene.glsl>
#include <pass_view.glsl>
void main() {
    int instance = gl_VertexID / 36 == 0 ? 0 : 1;
    vec3 corner = vec3(gl_VertexID % 3 == 0, gl_VertexID % 3 == 1, gl_VertexID % 3 == 2);
    vec3 position = scene_position(instance, gl_VertexID % 36 / 3, corner.yz);
    gl_Position = PASS_VIEW.view_projection * vec4(position, 1.0);
}
"""
WHITE = "out vec4 color;\nvoid main() { color = vec4(1.0); }\n"


class Pulled(Node):
    """Boxes whose vertex shader fetches its vertices, and the same by a geometry step."""

    scene = Input(SceneData, doc="Scene.")
    pulled = Output(DisplayColor, format="rgba8", clear=0.0, doc="Fetched.")
    drawn = Output(DisplayColor, format="rgba8", clear=0.0, doc="Drawn.")

    def record(self, steps: Steps) -> None:
        steps.draw("white.frag", vertex="pulled.vert", vertices=72, scene=self.scene, out={"color": self.pulled})
        steps.geometry("white.frag", objects=["one", "two"], out={"color": self.drawn})


def test_vertex_shaders_read_the_scene_where_the_device_has_storage_blocks(
    bench: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    text = "nodes: {a: {type: pulled}}\noutputs: {pulled: a.pulled, drawn: a.drawn}\n"
    shaders = {"white.frag": WHITE, "pulled.vert": PULLED}
    frame = bench.draw(text, Pulled, shaders=shaders, scene=BOXES, size=(64, 48))
    np.testing.assert_array_equal(frame["pulled"], frame["drawn"])
    assert 0.02 < (frame["pulled"][..., 0] > 0).mean() < 0.9
    monkeypatch.setitem(bench.session.device.limits, "vertex_storage", 0)
    with pytest.raises(RenderError, match=r"RG435 .* its vertex shader has 3 storage blocks .* supports 0 there"):
        bench.draw(text, Pulled, shaders=shaders, scene=BOXES, size=(32, 24))


class Dim(Node):
    """A shadow of the colour of the second object's material: functions read the scene as well."""

    scene = Input(SceneData, doc="Scene.")
    lookup = Function(ShadowLookup, "dim.glsl", reads=("scene",), doc="Visibility.")


DIM = """
#include <scene.glsl>
float shadow(int light, vec3 position, vec3 normal) {
    return 0.5 * scene_surface(1, 0, vec2(0.2), vec3(0.0, 0.0, 1.0)).base_color.g;
}
"""


def test_functions_in_geometry_steps_read_the_scene(gl: rg.Session, tmp_path: Path) -> None:
    (tmp_path / "dim.py").write_text(
        "from rendergraph.api import Function, Input, Node, SceneData, ShadowLookup\n" + inspect.getsource(Dim)
    )
    (tmp_path / "dim.glsl").write_text(DIM)
    (tmp_path / "scene.yaml").write_text("scene: 1\n" + BOXES.replace("emissive: [1, 1, 1]", "roughness: 1"))
    for name, lookup in (("lit", ""), ("dim", "lookup: dim.lookup")):
        (tmp_path / f"{name}.yaml").write_text(
            f"rendergraph: 1\nsize: [32, 24]\nscene: scene.yaml\nnodes:\n  dim: {{type: dim}}\n"
            f"  light: {{type: forward_lighting, params: {{ambient: 0}}, inputs: {{{lookup}}}}}\n"
            "outputs: {image: light.radiance}\n"
        )
    lit, dim = (gl.render(rg.load(tmp_path / f"{name}.yaml", plugins=[tmp_path]))["image"] for name in ("lit", "dim"))
    np.testing.assert_allclose(dim[..., :3], 0.5 * lit[..., :3], atol=1e-3)
    assert lit[..., :3].max() > 0.1


# Mistakes ------------------------------------------------------------------------------------------------------------

NO_SCENE = "nodes: {a: {type: plain}}\noutputs: {image: a.color}\n"


class Plain(Node):
    """A texel without the scene."""

    color = Output(DisplayColor, format="rgba8", size=(1, 1), doc="Texel.")

    def record(self, steps: Steps) -> None:
        steps.fullscreen("plain.frag")


def test_an_include_about_the_scene_needs_the_scene(bench: Any) -> None:
    pipeline = bench.pipeline(NO_SCENE, Plain, shaders={"plain.frag": PLACE}, scene=BOXES)
    text = r"plain.frag:2:1: RG430 .* declare `scene = Input\(SceneData\)` and give the step scene=self.scene"
    with pytest.raises(InputError, match=text):
        pipeline.check()
    with pytest.raises(InputError, match=text):
        bench.session.render(pipeline)


def test_nothing_is_linked_to_the_scene(bench: Any) -> None:
    text = "nodes: {p: {type: plain}, a: {type: of, inputs: {scene: p.color}}}\noutputs: {image: a.color}\n"
    shaders = {"plain.frag": WHITE, "of.frag": PLACE}
    with pytest.raises(InputError, match=r"'a.scene' expects a scene, but 'p.color' .* leave the link out"):
        bench.pipeline(text, Of, Plain, shaders=shaders).check()


def test_a_shader_file_takes_the_scene_by_its_header(gl: rg.Session, tmp_path: Path) -> None:
    header = "/*---\ndoc: Place.\ninputs: {scene: {semantic: scene_data, doc: Scene.}}\n"
    header += "outputs: {color: {format: rgba32f, size: [1, 1], doc: Texel.}}\n---*/\n"
    (tmp_path / "place.frag").write_text(header + PLACE.replace("vec2(0.0)", "vec2(0.0, 1.0)"))
    (tmp_path / "scene.yaml").write_text("scene: 1\n" + BOXES)
    text = "rendergraph: 1\nscene: scene.yaml\nnodes: {a: {type: ./place.frag}}\noutputs: {image: a.color}\n"
    (tmp_path / "test.yaml").write_text(text)
    texel = gl.render(rg.load(tmp_path / "test.yaml"))["image"][0, 0]
    np.testing.assert_array_equal(np.abs(texel), [0.5, 0.5, 0.5, 2.0])  # a corner of the box, and where the other is


def test_tracing_needs_rays_and_only_the_scene_has_them(bench: Any) -> None:
    traced = "#include <trace.glsl>\nout vec4 color;\nvoid main() { color = vec4(any_hit(vec3(0.0), vec3(1.0), 0.0, 1.0)); }\n"
    pipeline = bench.pipeline(ONE, Of, shaders={"of.frag": traced}, scene=BOXES)
    with pytest.raises(InputError, match=r"of.frag:1:1: RG430 .* does not read rays; declare .*rays=True\)"):
        pipeline.check()
    with pytest.raises(InputError, match=r"of.frag:1:1: RG430 .* does not read rays"):
        bench.session.render(pipeline)

    class Wrong(Node):
        """Rays of a picture."""

        picture = Input(Anything, rays=True, doc="Picture.")

    assert "port 'picture' has rays, but is not the scene's data" in str(declaration_mistakes(Wrong)[0])

    class Traced(Of):
        """The same with rays."""

        scene = Input(SceneData, rays=True, doc="Scene.")

    traced_too = bench.pipeline(ONE.replace("of}", "traced}"), Traced, shaders={"of.frag": traced}, scene=BOXES)
    facts = traced_too.link().graph.facts.scene_data
    assert "of trees for rays; it is" in traced_too.plan().reasons["the scene's data"]
    with bench.session.current():
        assert bench.session.compile(traced_too).scene.tree().size <= facts.trees < facts.bytes


def test_images_that_only_arrays_were_made_of_are_freed(bench: Any, shared: Path) -> None:
    asset = shared / "assets" / "gltf" / "BoxTextured.glb"
    (bench.folder / "plain.yaml").write_text(
        "rendergraph: 1\nsize: [16, 8]\nnodes: {gbuffer: {type: gbuffer}}\noutputs: {image: gbuffer.albedo}\n"
    )
    plain = rg.load(bench.folder / "plain.yaml", scene=asset)
    before = bench.session.render(plain)["image"]
    text = PLACE.replace("scene_instances[1].rows[0].w", "scene_alpha(0, 0, vec2(0.3))")
    pipeline = bench.pipeline(ONE, Of, shaders={"of.frag": text}).with_scene(asset)
    with rg.Session() as session, session.current():
        gpu_scene = session.compile(pipeline).scene
        assert len(gpu_scene.data.textures) == 1
        assert not gpu_scene._images
        assert session.compile(plain).scene is gpu_scene
        assert len(gpu_scene._images) == 1
        np.testing.assert_array_equal(session.render(plain)["image"], before)
