"""Rays against the scene's data: they find what a brute-force search finds, and what the rasteriser draws."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import OpenImageIO as oiio
import pytest
from msgspec.structs import replace

import rendergraph as rg
from rendergraph.api import Any as Anything
from rendergraph.api import Depth, Input, Internal, Node, Output, SceneData, Steps, structural
from rendergraph.catalog import Catalog
from rendergraph.scene.load import load
from rendergraph.scene.model import Object, Scene
from rendergraph.scene.pack import pack

Doubles = npt.NDArray[np.float64]

SEEN_GEOM = """
layout(triangles) in;
layout(triangle_strip, max_vertices = 3) out;
flat in int v_object[];
flat out ivec2 triangle;
void main() {
    for (int i = 0; i < 3; ++i) {
        triangle = ivec2(v_object[i], gl_PrimitiveIDIn);
        gl_Position = gl_in[i].gl_Position;
        EmitVertex();
    }
}
"""
SEEN = """
flat in ivec2 triangle;
out vec4 seen;
void main() { seen = vec4(triangle, 0.0, 0.0); }
"""
CAMERA_RAYS = """
#include <trace.glsl>
#include <view.glsl>
out vec4 traced;
void main() {
    vec2 uv = gl_FragCoord.xy * camera.viewport.zw;
    vec3 origin = world_position(camera, uv, 1.0);
    vec3 far = world_position(camera, uv, 0.5);
    Hit hit;
    bool found = visible_hit(origin, normalize(far - origin), 0.0, 1e30, hit);
    traced = found ? vec4(hit.instance, hit.triangle, hit.distance, 0.0) : vec4(-1.0);
}
"""
GIVEN_RAYS = """
#include <trace.glsl>
uniform sampler2D origins;
uniform sampler2D directions;
out vec4 traced;
out vec4 more;
void main() {
    vec4 origin = texelFetch(origins, ivec2(gl_FragCoord.xy), 0);
    vec4 direction = texelFetch(directions, ivec2(gl_FragCoord.xy), 0);
    Hit hit;
    bool found = nearest_hit(origin.xyz, direction.xyz, origin.w, direction.w, hit);
    traced = found ? vec4(hit.instance, hit.triangle, hit.distance, 1.0) : vec4(-1.0, -1.0, 0.0, 0.0);
    bool any = any_hit(origin.xyz, direction.xyz, origin.w, direction.w, 0);
    bool shadow = any_hit(origin.xyz, direction.xyz, origin.w, direction.w);
    vec3 at = found ? scene_position(hit.instance, hit.triangle, hit.barycentrics) : vec3(0.0);
    float off = found ? distance(at, origin.xyz + hit.distance * direction.xyz) : 0.0;
    more = vec4(any ? 1.0 : 0.0, shadow ? 1.0 : 0.0, off, 0.0);
}
"""


class CameraRays(Node):
    """What the camera sees, drawn and traced."""

    scene = Input(SceneData, rays=True, doc="Scene.")
    depth = Internal(Depth, format="depth32f", clear=0.0)
    seen = Output(Anything, format="rgba32f", clear=-1.0, doc="Instance and triangle, drawn.")
    traced = Output(Anything, format="rgba32f", doc="Instance and triangle, traced.")

    def record(self, steps: Steps) -> None:
        out = {"seen": self.seen, "depth": self.depth}
        steps.geometry("seen.frag", geometry="seen.geom", out=out, objects="all", in_place=True, scene=self.scene)
        steps.fullscreen("camera.frag", scene=self.scene, out=self.traced)


RAYS: dict[str, npt.NDArray[np.float32]] = {}


class GivenRays(Node):
    """Rays of a test."""

    scene = Input(SceneData, rays=True, doc="Scene.")
    origins = Internal(format="rgba32f", size=lambda node, facts: (node.width, 64), doc="Origins and least distance.")
    directions = Internal(format="rgba32f", size=lambda node, facts: (node.width, 64), doc="Directions and most.")
    traced = Output(
        Anything, format="rgba32f", size=lambda node, facts: (node.width, 64), doc="Instance, triangle and distance."
    )
    more = Output(
        Anything,
        format="rgba32f",
        size=lambda node, facts: (node.width, 64),
        doc="Any hit, and shadows; how far off the position is.",
    )
    width: int = structural(default=64, min=1, max=4096, doc="Rays.")

    def record(self, steps: Steps) -> None:
        for name, port in (("origins", self.origins), ("directions", self.directions)):
            steps.upload(port, RAYS[name].reshape(64, self.width, 4))
        reads: dict[str, Any] = {"origins": self.origins, "directions": self.directions}
        steps.fullscreen("given.frag", scene=self.scene, out={"traced": self.traced, "more": self.more}, **reads)


SHADERS = {"seen.geom": SEEN_GEOM, "seen.frag": SEEN, "camera.frag": CAMERA_RAYS, "given.frag": GIVEN_RAYS}


def world_triangles(scene: Scene, *, hidden: bool = False) -> tuple[Doubles, npt.NDArray[np.int64]]:
    """World-space corners (t, 3, 3) of all triangles in float64, and object and number of each (t, 2)."""
    packed = pack(scene)
    corners, names = [], []
    for number, placed in enumerate(scene.objects):
        if placed.hidden and not hidden:
            continue
        record = packed.meshes[placed.mesh]
        positions = packed.positions[record["base_vertex"] :][: record["vertices"]].astype(np.float64)
        triangles = packed.indices[record["first_index"] :][: record["count"]].reshape(-1, 3)
        world = positions @ placed.transform[:3, :3].T + placed.transform[:3, 3]
        corners.append(world[triangles])
        names.append(np.stack([np.full(len(triangles), number), np.arange(len(triangles))], axis=1))
    return np.concatenate(corners), np.concatenate(names)


def brute_force(corners: Doubles, origin: Doubles, direction: Doubles) -> tuple[npt.NDArray[np.int64], Doubles]:
    """The nearest triangle of each ray (-1 for none) and its distance, by all triangles (Möller and Trumbore 1997)."""
    best, found = np.full(len(origin), np.inf), np.full(len(origin), -1)
    a, e, f = corners[:, 0], corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    for first in range(0, len(corners), 2048):
        part = slice(first, first + 2048)
        p = np.cross(direction[:, None], f[None, part])
        with np.errstate(all="ignore"):
            inverse = 1 / (p * e[part]).sum(axis=-1)
            s = origin[:, None] - a[None, part]
            u = (s * p).sum(axis=-1) * inverse
            q = np.cross(s, e[None, part])
            v = (q * direction[:, None]).sum(axis=-1) * inverse
            t = (q * f[part]).sum(axis=-1) * inverse
            t = np.where((u >= 0) & (v >= 0) & (u + v <= 1) & (t > 0), t, np.inf)
        nearest = np.argmin(t, axis=1)
        distance = t[np.arange(len(origin)), nearest]
        nearer = distance < best
        best[nearer], found[nearer] = distance[nearer], nearest[nearer] + first
    return found, best


def searched(bench: Any, *rays: Doubles) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64], Doubles]:
    """Names of all triangles of the scene that was drawn last, the nearest one along each ray, and its distance."""
    corners, names = world_triangles(load(bench.folder / "scene.yaml"))
    return names, *brute_force(corners, *rounded(*rays))


def rounded(*rays: Doubles) -> Doubles:
    """Origins and directions as shaders get them."""
    return np.stack(rays).astype(np.float32).astype(np.float64)


def random_rays(low: Doubles, high: Doubles, count: int = 4096, seed: int = 1) -> tuple[Doubles, Doubles]:
    random = np.random.default_rng(seed)
    origin = low + (high - low) * random.random((count, 3))
    direction = random.normal(size=(count, 3))
    return origin, direction / np.linalg.norm(direction, axis=1, keepdims=True)


def trace(
    bench: Any, scene: str, origin: Doubles, direction: Doubles, *, nearest: float = 0, **options: Any
) -> dict[str, npt.NDArray[Any]]:
    """Trace rays in frames of a scene given as text."""
    RAYS["origins"] = np.concatenate([origin, np.full((len(origin), 1), nearest)], axis=1).astype(np.float32)
    RAYS["directions"] = np.concatenate([direction, np.full((len(origin), 1), 1e30)], axis=1).astype(np.float32)
    text = f"nodes: {{a: {{type: given_rays, params: {{width: {len(origin) // 64}}}}}}}\n"
    text += "outputs: {traced: a.traced, more: a.more}\n"
    frame = bench.draw(text, GivenRays, shaders=SHADERS, scene=scene, size=(8, 8), **options)
    # Arrays have the top row first.
    return {name: frame[name][::-1].reshape(-1, 4) for name in ("traced", "more")}


MIXED = """
cameras: {main: {eye: [0, 2, 7], target: [0, 0.5, 0]}}
lights: {sun: {type: directional, direction: [-1, -2, -1]}}
materials: {red: {base_color: [1, 0, 0]}}
objects:
  floor: {shape: plane, size: [200, 200], material: red, casts_shadow: false}
  ball: {shape: sphere, radius: 1, at: [0, 1, 0], material: red}
  twin: {shape: sphere, radius: 1, at: [2.5, 1, 0], scale: [0.5, 1.5, -1], rotate_degrees: [0, 30, 70], material: red}
  ring: {shape: torus, radius: 0.7, at: [-2.5, 1, 1], material: red}
  flat: {shape: box, at: [0, 3, -1], scale: [1.5, 0, 2], material: red}
  none: {shape: box, at: [0, 1, 3], scale: 0, material: red}
  unseen: {shape: box, size: [2, 2, 2], at: [0, 1, 2], material: red, hidden: true}
  tiny: {shape: sphere, radius: 0.001, at: [1, 0.5, 3], material: red}
"""


def test_rays_find_what_a_search_over_all_triangles_finds(bench: Any) -> None:
    """With mirrored and stretched objects, one scaled to a plane, one to a point and a hidden one."""
    origin, direction = random_rays(np.array([-4.0, 0.1, -3]), np.array([4.0, 4, 4]), 512)
    found = trace(bench, MIXED, origin, direction)
    names, expected, distance = searched(bench, origin, direction)
    traced, hit = found["traced"], expected >= 0
    assert 0.5 < hit.mean() < 0.999
    assert (hit != (traced[:, 0] >= 0)).sum() <= 2  # a ray may pass the edge of an object on either side
    both = hit & (traced[:, 0] >= 0)
    near = np.abs(traced[both, 2] - distance[both]) < 1e-4 * (1 + distance[both])
    assert (~near).sum() <= 2
    same = traced[both][:, :2] == names[expected[both]]
    assert same[:, 0].mean() > 0.999
    assert same[traced[both][:, 0] != 4, 1].mean() > 0.995  # else a neighbour at an edge
    assert found["more"][both, 2].max() < 1e-4 * 200
    assert set(np.unique(traced[both][:, 0])) >= {0, 1, 2, 3, 4}
    assert 5 not in traced[:, 0]
    np.testing.assert_array_equal(found["more"][:, 0] > 0, traced[:, 0] >= 0)
    scene = load(bench.folder / "scene.yaml")
    casting, _ = world_triangles(replace_objects(scene, lambda placed: placed.casts_shadow))
    blocked = brute_force(casting, *rounded(origin, direction))[0] >= 0
    assert ((found["more"][:, 1] > 0) != blocked).sum() <= 2
    assert (blocked != hit).any()


@pytest.mark.parametrize("kind", ["still", "moving", "masked"])
def test_rays_through_a_heap_of_sticks(bench: Any, kind: str) -> None:
    """More boxes overlap than the stack of a ray holds, in the shared tree or in the tree over moving objects."""
    random = np.random.default_rng(3)
    lines, keys = [], []
    for number, turn in enumerate(random.uniform(-180, 180, (96, 3)).round(1).tolist()):
        lines.append(f"  s{number}: {{shape: box, scale: [0.03, 4, 0.03], rotate_degrees: {turn}, material: all}}")
        keys.append(f"objects.s{number}.at: {{0: [0, 0, 0], 1: [9, 0, 0]}}")
    text = f"materials: {{all: {{alpha_mode: {'mask' if kind == 'masked' else 'opaque'}}}}}\nobjects:\n"
    text += "\n".join(lines) + "\n"
    if kind == "moving":
        text += f"keyframes: {{{', '.join(keys)}}}\n"
    origin, aim = 3 * random.normal(size=(512, 3)), 0.3 * random.normal(size=(512, 3))
    direction = aim - origin
    found = trace(bench, text, origin, direction)
    names, expected, distance = searched(bench, origin, direction)
    traced, hit = found["traced"], expected >= 0
    assert 0.3 < hit.mean() < 0.95
    assert (hit != (traced[:, 0] >= 0)).sum() <= 2
    both = hit & (traced[:, 0] >= 0)
    np.testing.assert_array_equal(found["more"][:, 0] > 0, traced[:, 0] >= 0)
    assert (names[expected[both], 0] == traced[both, 0]).mean() > 0.99
    assert (np.abs(traced[both, 2] - distance[both]) > 1e-4).sum() <= 2


def replace_objects(scene: Scene, keep: Callable[[Object], bool]) -> Scene:
    return replace(scene, objects=tuple(placed for placed in scene.objects if keep(placed)))


@pytest.mark.nightly(keep=2)
@pytest.mark.parametrize("scene", ["shadow_study", "courtyard", "cornell_box", "still_life"])
def test_rays_of_the_camera_find_what_is_drawn(gl: rg.Session, tmp_path: Path, scene: str) -> None:
    """The same object everywhere, and the same triangle at 99.9 % of the pixels away from edges."""
    for name, text in SHADERS.items():
        (tmp_path / name).write_text(text)
    nodes = {"a": {"type": "camera_rays"}}
    outputs = {"seen": "a.seen", "traced": "a.traced"}
    file = {"rendergraph": 1, "size": [160, 90], "scene": scene, "nodes": nodes, "outputs": outputs}
    (tmp_path / "test.yaml").write_text(json.dumps(file))
    loaded = rg.load(tmp_path / "test.yaml")
    frame = gl.render(dataclasses.replace(loaded, catalog=Catalog.of(CameraRays, shaders=tmp_path)))
    seen, traced = frame["seen"][..., :2], frame["traced"][..., :2]
    away = np.ones(seen.shape[:2], bool)
    for y in (-1, 0, 1):
        for x in (-1, 0, 1):
            away &= (np.roll(seen, (y, x), axis=(0, 1)) == seen).all(axis=-1)
    assert away.mean() > 0.05
    assert (seen == traced).all(axis=-1)[away].mean() >= 0.999
    objects = seen[..., 0] == traced[..., 0]
    assert objects.mean() > 0.97


def test_rays_follow_what_moves(bench: Any) -> None:
    scene = """
objects:
  one: {shape: box}
  two: {shape: box, at: [0, 0, 5]}
keyframes: {objects.one.at: {0: [0, 0, 0], 1: [0, 4, 0]}}
"""
    origin = np.array([[0.1, y, 9.0] for y in (0.0, 4.0)] * 32)
    direction = np.tile([0.0, 0, -1], (64, 1))
    origin[::2, 2] = 3
    first = trace(bench, scene, origin, direction, frames=range(1, 2), fps=1)["traced"]
    assert first[0, :1] == 0
    assert first[0, 2] == pytest.approx(2.5)
    assert first[1, 0] == -1
    second = trace(bench, scene, origin, direction, frames=range(1, 3), fps=1)["traced"]
    assert second[0, 0] == -1
    assert second[1, :1] == 0
    assert second[1, 2] == pytest.approx(8.5)


@pytest.mark.parametrize(("nearest", "distance"), [(-10, 3.5), (0, 3.5), (3.4, 3.5), (3.6, 4.5)])
def test_hits_are_beyond_the_least_distance(bench: Any, nearest: float, distance: float) -> None:
    """There is a box behind the origin, too; a distance below 0 counts as 0."""
    scene = "objects: {one: {shape: box}, behind: {shape: box, at: [0, 0, 8]}}\n"
    origin, direction = np.tile([0.1, 0.2, 4.0], (64, 1)), np.tile([0.0, 0, -1], (64, 1))
    found = trace(bench, scene, origin, direction, nearest=nearest)
    np.testing.assert_allclose(found["traced"][:, 2], distance, atol=1e-5)


def test_an_empty_scene_has_no_hit(bench: Any) -> None:
    origin, direction = random_rays(np.zeros(3), np.ones(3), 64)
    found = trace(bench, "objects: {one: {shape: box, hidden: true}}\n", origin, direction)
    assert (found["traced"][:, 0] == -1).all()
    assert (found["more"][:, :2] == 0).all()


def test_no_ray_passes_between_triangles(bench: Any) -> None:
    """From inside a closed mesh, towards its vertices and edges, too."""
    scene = "objects: {ball: {shape: sphere, radius: 1, rotate_degrees: [20, 30, 40], at: [3, 4, 5]}}\n"
    (bench.folder / "scene.yaml").write_text("scene: 1\n" + scene)
    corners, _ = world_triangles(load(bench.folder / "scene.yaml"))
    weights = np.array([[1, 0, 0], [0.5, 0.5, 0], [0, 0.3, 0.7], [0.2, 0.3, 0.5]])
    points = np.einsum("kv,tvi->tki", weights, corners).reshape(-1, 3)[:4096]
    origin = np.tile([3.1, 4.2, 4.9], (4096, 1))
    found = trace(bench, scene, origin, points - origin)
    assert (found["traced"][:, 0] == 0).all()
    np.testing.assert_allclose(found["traced"][:, 2], 1, atol=2e-3)


MASKED = """
cameras: {main: {eye: [0, 0, 5], target: [0, 0, 0]}}
materials:
  mask: {alpha_mode: mask, alpha_cutoff: 0.5, base_color_texture: holes.png, double_sided: true}
  glass: {alpha_mode: blend, base_color: [1, 1, 1, 0.5]}
  wall: {}
objects:
  first: {shape: plane, size: [2, 2], at: [0, 0, 2], rotate_degrees: [90, 0, 0], material: mask}
  second: {shape: plane, size: [2, 2], at: [0, 0, 1], rotate_degrees: [90, 0, 0], material: mask}
  pane: {shape: plane, size: [9, 9], rotate_degrees: [90, 0, 0], material: glass}
  wall: {shape: plane, size: [9, 9], at: [0, 0, -1], rotate_degrees: [90, 0, 0], material: wall}
"""


def test_alpha_masks_let_rays_through(bench: Any) -> None:
    """The left half of two masked planes is cut away; a pane of glass is hit, and casts no shadow."""
    texels = np.full((4, 8, 4), 255, np.uint8)
    texels[:, :4, 3] = 0
    image = oiio.ImageBuf(oiio.ImageSpec(8, 4, 4, "uint8"))
    image.set_pixels(oiio.ROI(), texels)
    image.write(str(bench.folder / "holes.png"))
    x = np.tile([-0.7, 0.7, -3, 3], 16)
    origin = np.stack([x, 0.1 + 0 * x, 5 + 0 * x], axis=1)
    found = trace(bench, MASKED, origin, np.tile([0.0, 0, -1], (64, 1)))
    np.testing.assert_array_equal(found["traced"][:4, 0], [2, 0, 2, 2])
    np.testing.assert_allclose(found["traced"][:4, 2], [5, 3, 5, 5], atol=1e-5)
    assert (found["more"][:, 0] == 1).all()  # the wall, or a mask in front of it
    behind = np.stack([x, 0.1 + 0 * x, 0.5 + 0 * x], axis=1)
    towards = trace(bench, MASKED, behind, np.tile([0.0, 0, 1], (64, 1)))
    np.testing.assert_array_equal(towards["more"][:4, 1], [0, 1, 0, 0])


def test_a_buffer_that_is_too_large_for_the_device_is_refused(bench: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(bench.session.device.limits, "texture_buffer", 1300)
    origin, direction = random_rays(np.zeros(3), np.ones(3), 64)
    with pytest.raises(rg.errors.RenderError, match=r"RG435 the scene's 'scene_tree' takes"):
        trace(bench, "objects: {one: {shape: sphere, segments: 16}}\n", origin, direction)


def test_a_device_without_an_image_for_the_trees_is_refused(bench: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(bench.session.device.limits, "images", 0)
    with pytest.raises(
        rg.errors.RenderError, match=r"RG435 .*it has 0 images, and rays take one more; this device supports 0"
    ):
        trace(bench, MIXED, *random_rays(np.zeros(3), np.ones(3), 64))
