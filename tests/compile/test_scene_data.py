"""The scene as data: surfaces fetched from it equal those that geometry passes draw, and it costs what it must."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import rendergraph as rg

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
in vec3 weights;
in vec3 drawn_position;
flat in ivec2 triangle;
out vec4 seen;
out vec4 drawn;
void main() {
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
        steps.geometry("seen.frag", geometry="seen.geom", out=out, objects="opaque", in_place=True)
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


def differences(frame: rg.Frame) -> dict[str, float]:
    """The largest difference of each texture from what is drawn, where a triangle covers the pixel."""
    covered = frame["seen"][..., 0] >= 0
    assert 0.1 < covered.mean() <= 1
    found = {name: np.abs(frame[name] - frame[f"drawn_{name}"])[covered] for name in OF_GBUFFER}
    found["emissive"] /= np.maximum(1.0, frame["drawn_emissive"][covered])
    anisotropic = frame["drawn_grain"][covered][:, 3] > 0
    found["grain"] = found["grain"][anisotropic]
    found["position"] = np.abs(frame["position"] - frame["drawn"])[covered][:, :3]
    found["barycentrics"] = frame["position"][covered][:, 3]
    return {name: float(values.max(initial=0.0)) for name, values in found.items()}


@pytest.mark.parametrize("scene", ["spheres", "shadow_study", "still_life", "lantern"])
def test_a_surface_is_what_a_geometry_pass_draws(gl: rg.Session, plugins: Path, scene: str) -> None:
    frame = surfaces(gl, plugins, scene)
    off = differences(frame)
    assert max(off.values()) < 5e-4
    covered = frame["seen"][..., 0] >= 0
    front, drawn_front = frame["geometric"][covered][:, 3] > 0, frame["drawn"][covered][:, 3] > 0
    np.testing.assert_array_equal(front, drawn_front)
