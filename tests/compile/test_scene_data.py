"""The scene as data: surfaces fetched from it equal those that geometry passes draw, and it costs what it must."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
from msgspec.structs import replace

import rendergraph as rg
from rendergraph.compile import GpuScene
from rendergraph.errors import InputError
from rendergraph.scene.model import Texture

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
    assert 0.05 < covered.mean() <= 1
    found = {name: np.abs(frame[name] - frame[f"drawn_{name}"])[covered] for name in OF_GBUFFER}
    found["emissive"] /= np.maximum(1.0, frame["drawn_emissive"][covered])
    found["grain"] = found["grain"][frame["drawn_grain"][covered][:, 3] > 0]  # of anisotropic materials
    found["position"] = np.abs(frame["position"] - frame["drawn"])[covered][:, :3]
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
    assert off["position"].max() < 1e-3
    assert off["barycentrics"].max() < 1e-3
    for name in OF_GBUFFER:  # where texels average out, unit normals are anything
        assert (off[name] > 0.012).sum() <= 0.0005 * off[name].size, name
    covered = frame["seen"][..., 0] >= 0
    front, drawn_front = frame["geometric"][covered][:, 3] > 0, frame["drawn"][covered][:, 3] > 0
    np.testing.assert_array_equal(front, drawn_front)


@pytest.mark.parametrize("scene", ["spheres", "shadow_study", "still_life", "lantern"])
def test_a_surface_is_what_a_geometry_pass_draws(gl: rg.Session, plugins: Path, scene: str) -> None:
    frame = surfaces(gl, plugins, scene)
    check(frame)
    assert max(values.max(initial=0.0) for values in differences(frame).values()) < 5e-4  # of factors alone


SMALL = ("BoxTextured.glb", "TextureTransformTest/TextureTransformTest.gltf", "TwoSidedPlane/TwoSidedPlane.gltf")


@pytest.mark.usefixtures("level_0")
@pytest.mark.parametrize("name", SMALL)
def test_textured_surfaces_are_too(gl: rg.Session, plugins: Path, shared: Path, name: str) -> None:
    check(surfaces(gl, plugins, shared / "assets" / "gltf" / name))


@pytest.mark.nightly
@pytest.mark.usefixtures("level_0")
def test_surfaces_of_every_asset_are_too(gl: rg.Session, plugins: Path, shared: Path) -> None:
    folder = shared / "assets" / "gltf"
    drawn = 0
    for file in sorted([*folder.glob("*.gl*"), *folder.glob("*/*.gltf")]):
        try:
            frame = surfaces(gl, plugins, file, (160, 120))
        except InputError as error:  # an extension that nothing here draws
            if {problem.code for problem in error.problems} != {"RG308"}:
                raise
            continue
        check(frame)
        drawn += 1
    assert drawn > 30
