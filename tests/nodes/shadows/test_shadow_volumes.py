"""Shadow volumes against rays: every kind of light, camera and object, counted both ways, found on both sides."""

from __future__ import annotations

import ctypes
import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from rendergraph.nodes.shadows._silhouettes import silhouette
from rendergraph.nodes.shadows._volumes import bounding_spheres, touches_near_pyramid
from rendergraph.pipelines import shapes

import rendergraph as rg
from rendergraph.api import projection
from rendergraph.errors import InputError
from rendergraph.scene.cameras import view_matrices
from rendergraph.scene.model import Camera
from rendergraph.scene.pack import reversed_projection

Floats = npt.NDArray[np.float64]
Mask = npt.NDArray[np.bool_]
PIPELINE = "shadow-volumes-auto"
SIZE = (96, 64)
SCENE = """scene: 1
objects:
  ground: {shape: plane, size: [9, 9], material: grey, casts_shadow: false}
  box: {shape: box, size: [1, 0.6, 0.5], at: [-1, 0.9, 0.4], rotate_degrees: [20, 30, 10], material: grey}
  mirrored: {shape: cone, radius: 0.5, height: 1, at: [1, 0.8, 0.3], rotate_degrees: [40, 0, 20], scale: [-1, 1.4, 0.6], material: grey}
  over: {shape: sphere, radius: 0.4, segments: 16, rings: 12, at: [-1.1, 1.6, 0.5], scale: [-1, 1, 1], material: grey}
  ring: {shape: torus, radius: 0.6, tube: 0.15, segments: 24, sides: 8, at: [0.1, 1.6, -0.6], rotate_degrees: [60, 10, 0], material: grey}
  pane: {shape: plane, size: [1, 1], at: [0, 3, 0], material: glass}
materials:
  grey: {base_color: [0.7, 0.7, 0.7]}
  glass: {alpha_mode: blend}
lights:
  sun: {type: directional, direction: [0.4, -1, -0.3], intensity: 2}
  lamp: {type: point, at: [0.6, 2.6, 1.2], intensity: 6, range: RANGE}
  beam: {type: spot, at: [-2, 3, 1.5], direction: [0.6, -1, -0.5], intensity: 20, outer_degrees: 40}
cameras: {main: {CAMERA}}
"""
EYE = "eye: [0.5, 2.4, 4.6], target: [0, 0.6, 0], "
PERSPECTIVE = EYE + "fov_y_degrees: 45, near: 0.1, far: 50"


def rays_reach(scene: Any, positions: Floats, light: Any) -> Mask:
    """Whether nothing that casts lies between points (n, 3) and a light, by float64 rays (Möller and Trumbore 1997)."""
    corners = [
        (scene.meshes[o.mesh].positions.astype(np.float64) @ o.transform[:3, :3].T + o.transform[:3, 3])[
            scene.meshes[o.mesh].indices
        ]
        for o in scene.objects
        if o.casts_shadow and scene.materials[o.material].alpha_mode != "blend"
    ]
    free = np.ones(len(positions), bool)
    directional = light.type == "directional"
    to_light = (
        np.broadcast_to(-np.array(light.direction), positions.shape) if directional else light.position - positions
    )
    start, end = 1e-4, math.inf if directional else 1.0
    for a, b, c in np.concatenate(corners):
        e1, e2 = b - a, c - a
        p = np.cross(to_light, e2)
        det = p @ e1
        with np.errstate(divide="ignore", invalid="ignore"):
            s = positions - a
            u = np.einsum("ij,ij->i", s, p) / det
            q = np.cross(s, e1)
            v = np.einsum("ij,ij->i", to_light, q) / det
            t = q @ e2 / det
        free &= ~((u >= 0) & (v >= 0) & (u + v <= 1) & (t > start) & (t < end))
    return free


def seen_positions(scene: Any, depth: Floats) -> tuple[Floats, Mask]:
    """World positions (h, w, 3) of a depth texture, top row first, and where a surface is."""
    height, width = depth.shape
    camera = view_matrices(next(iter(scene.cameras.values())), (width, height))
    y, x = np.mgrid[0:height, 0:width]
    ndc = np.stack([(x + 0.5) / width * 2 - 1, 1 - (y + 0.5) / height * 2, depth, np.ones_like(depth)], -1)
    world = ndc @ np.linalg.inv(reversed_projection(camera) @ camera.view).T
    seen = depth > 0
    return world[..., :3] / np.where(seen, world[..., 3], 1.0)[..., None], seen


def away_from_edges(mask: Mask, seen: Mask, positions: Floats) -> Mask:
    """Pixels around which mask and surface are the same."""
    calm = seen.copy()
    for axis in (0, 1):
        for by in (-1, 1):
            calm &= (np.roll(mask, by, axis) == mask) & (np.roll(seen, by, axis) == seen)
            calm &= np.linalg.norm(np.roll(positions, by, axis) - positions, axis=-1) < 0.4
    return calm


@pytest.fixture(scope="module")
def lit() -> dict[tuple[bytes, str], Mask]:
    """Where rays reach each light, by the depth that is seen: they take longer than the pictures."""
    return {}


@pytest.fixture
def wrong(session: rg.Session, tmp_path: Path, lit: dict[tuple[bytes, str], Mask]) -> Callable[..., list[float]]:
    """The share of pixels away from edges that are wrong, for each light, against rays."""

    def measure(*sets: str, camera: str = PERSPECTIVE, range: float = 20, dark: float = 0.02) -> list[float]:
        (tmp_path / "s.yaml").write_text(SCENE.replace("CAMERA", camera).replace("RANGE", str(range)))
        loaded = rg.load(PIPELINE, scene=tmp_path / "s.yaml", size=SIZE, sets=("shadows.light=all", *sets))
        frame = session.render(loaded, outputs=(), taps=["shadows.visibility", "gbuffer.depth"], warm_up=False)
        scene = loaded.link().scene
        depth = np.asarray(frame.arrays["gbuffer.depth"], np.float64)[..., 0]
        positions, seen = seen_positions(scene, depth)
        shares = []
        for layer, light in enumerate(scene.lights):
            key = (camera.encode() + depth.tobytes(), light.name)
            if key not in lit:
                lit[key] = rays_reach(scene, positions.reshape(-1, 3), light).reshape(seen.shape)
            judged = away_from_edges(lit[key], seen, positions)
            if light.range is not None:
                judged &= np.linalg.norm(positions - light.position, axis=-1) < light.range
            assert judged.mean() > 0.03
            assert dark <= 1 - lit[key][judged].mean() < 0.9, "something is in shadow, and not everything"
            shares.append(float(((frame.arrays["shadows.visibility"][layer, ..., 0] > 0.5) != lit[key])[judged].mean()))
        return shares

    return measure


@pytest.mark.nightly(keep=1)
@pytest.mark.parametrize("silhouettes", ["gpu", "cpu"])
@pytest.mark.parametrize("method", ["zpass", "zfail", "auto"])
def test_volumes_are_where_rays_are_stopped(wrong: Any, method: str, silhouettes: str) -> None:
    """A directional, a point and a spot light at once; mirrored objects' volumes lie within others and count alike."""
    assert wrong(f"shadows.method={method}", f"shadows.silhouettes={silhouettes}") == [0, 0, 0]


@pytest.mark.nightly(keep=1)
@pytest.mark.slow
@pytest.mark.parametrize("silhouettes", ["gpu", "cpu"])
@pytest.mark.parametrize("eye", [EYE, "eye: [-1.6, 4, 1.2], target: [0, 0, 0], "], ids=["askew", "along the sun"])
def test_parallel_views(session: rg.Session, wrong: Any, silhouettes: str, eye: str) -> None:
    """Along the sun no shadow of it is seen, and no ray of the picture leaves its volumes but by their far ends."""
    camera = eye + "height: 4, near: 0.1, far: 30"
    sets = (f"shadows.silhouettes={silhouettes}", "shadows.method=zfail")
    shares = wrong(*sets, camera=camera, dark=0.02 if eye == EYE else 0)
    assert shares == [0, 0, 0] or (not session.device.software and max(shares) < 5e-4)  # a single pixel


@pytest.mark.nightly(keep=1)
@pytest.mark.slow
@pytest.mark.parametrize("silhouettes", ["gpu", "cpu"])
def test_ends_at_infinity_pass_the_far_plane(wrong: Any, silhouettes: str) -> None:
    """Clamped or not cut at all; where the far plane cuts them, z-fail misses what leaves a volume there."""
    sets = ("shadows.method=zfail", f"shadows.silhouettes={silhouettes}")
    near = PERSPECTIVE.replace("far: 50", "far: 6.5")
    assert wrong(*sets, camera=near) == [0, 0, 0]
    assert max(wrong(*sets, "shadows.depth_clamp=false", camera=near)) > 0.01
    assert wrong(*sets, "shadows.depth_clamp=false", camera=PERSPECTIVE.replace("50", ".inf")) == [0, 0, 0]


@pytest.mark.slow
@pytest.mark.parametrize("silhouettes", ["gpu", "cpu"])
@pytest.mark.parametrize("method", ["zpass", "zfail"])
def test_volumes_of_limited_length(wrong: Any, session: rg.Session, method: str, silhouettes: str) -> None:
    """Long ones are right, short ones miss the ground."""
    sets = (f"shadows.method={method}", f"shadows.silhouettes={silhouettes}")
    assert wrong(*sets, "shadows.length_of_sides=40") == [0, 0, 0]
    assert min(wrong(*sets, "shadows.length_of_sides=0.2")) > 0.01


def test_a_light_of_limited_range_is_right_where_it_reaches(wrong: Any) -> None:
    assert wrong(range=2.4) == [0, 0, 0]


def test_rectangles_of_lights_save_most_fragments_and_change_no_pixel(
    session: rg.Session, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Samples that pass, by the driver's own count: eight lights of range 4 over a floor of 16 m."""
    lights = ", ".join(f"{ring}.{k}" for ring in ("inner", "outer") for k in range(1, 5))
    sets = (f"shadows.light=[{lights}]", "shadows.method=zpass")
    loaded = rg.load(PIPELINE, scene="many_lights", size=SIZE, sets=sets)

    def counted() -> tuple[int, Any]:
        raw, found = session.device.raw, ctypes.c_uint64()
        with session.current():
            query = raw.make("glCreateQueries", 0x8914)  # SAMPLES_PASSED
            raw.glBeginQuery(0x8914, query)
        image = session.render(loaded, warm_up=False)["image"]
        with session.current():
            raw.glEndQuery(0x8914)
            raw.glGetQueryObjectui64v(query, 0x8866, ctypes.byref(found))
            raw.delete("glDeleteQueries", query)
        return found.value, image

    within, image = counted()
    monkeypatch.setattr(projection, "sphere_bounds", lambda *_: (None, None))
    everywhere, same = counted()
    assert np.array_equal(image, same)
    assert within < 0.6 * everywhere


@pytest.mark.slow
def test_modes_change_no_bit(session: rg.Session, tmp_path: Path) -> None:
    (tmp_path / "s.yaml").write_text(SCENE.replace("CAMERA", PERSPECTIVE).replace("RANGE", "4"))
    for silhouettes in ("gpu", "cpu"):
        sets = ("shadows.light=all", f"shadows.silhouettes={silhouettes}")
        loaded = rg.load(PIPELINE, scene=tmp_path / "s.yaml", size=SIZE, sets=sets)
        plain = session.render(loaded)["image"]
        for mode in ({"poison": True}, {"shuffle": 3}, {"poison": True, "shuffle": 8}, {"alias": False}):
            assert np.array_equal(session.render(loaded, **mode)["image"], plain)


@pytest.mark.nightly(keep=1)
@pytest.mark.slow
@pytest.mark.parametrize("pipeline", ["deferred", "forward-prepass", "deferred-stencil-lights"])
def test_a_variant_of_every_pipeline_that_has_depth_first(session: rg.Session, pipeline: str) -> None:
    """And lit as with a fine map: the two differ at the shadows' edges alone."""

    def drawn(*sets: str) -> Floats:
        loaded = rg.load(pipeline, scene="shadow_study", size=(160, 90), sets=sets)
        return np.asarray(session.render(loaded, outputs=["radiance"])["radiance"], np.float64)

    volumes = drawn("shadows.type=shadow_volumes")
    mapped = drawn("shadows.taps=1", "sun.resolution=4096")
    assert (np.abs(volumes - mapped).max(axis=-1) > 0.02).mean() < 0.01
    assert (np.abs(volumes - drawn("light.visibility=null", "light.blended_lookup=null")) > 0.02).mean() > 0.02


def test_an_open_caster_is_refused_or_left_out(session: rg.Session, tmp_path: Path) -> None:
    text = SCENE.replace("CAMERA", PERSPECTIVE).replace("RANGE", "9")
    (tmp_path / "s.yaml").write_text(text.replace(", casts_shadow: false", ""))
    loaded = rg.load(PIPELINE, scene=tmp_path / "s.yaml", size=(16, 16))
    expected = (
        r"RG209 node 'shadows' \(shadow_volumes\): object 'ground' is not closed: in its mesh 'plane' only one triangle "
        r"has the edge from .*; set `casts_shadow: false` or `unclosed: skip` to leave it out"
    )
    with pytest.raises(InputError, match=expected):
        loaded.check()
    (tmp_path / "t.yaml").write_text(text)
    skipped = session.render(loaded.set("shadows.unclosed", "skip"))["image"]
    assert np.array_equal(skipped, session.render(rg.load(PIPELINE, scene=tmp_path / "t.yaml", size=(16, 16)))["image"])


def test_without_casters_or_lights_all_is_lit(session: rg.Session, tmp_path: Path) -> None:
    (tmp_path / "s.yaml").write_text("scene: 1\nobjects: {g: {shape: plane, casts_shadow: false}}\n")
    frame = session.render(rg.load(PIPELINE, scene=tmp_path / "s.yaml", size=(8, 8)), taps=["shadows.visibility"])
    assert (frame.arrays["shadows.visibility"] == 1).all()
    (tmp_path / "t.yaml").write_text("scene: 1\nobjects: {g: {shape: box}}\nlights: {l: {type: point}}\n")
    frame = session.render(rg.load(PIPELINE, scene=tmp_path / "t.yaml", size=(8, 8), sets=("shadows.light=auto",)))
    assert frame["image"].any()


CASES = ("dir_basic", "dir_camera_in_shadow", "dir_cascades", "point_room", "spot_basic")


@pytest.mark.nightly(keep=10)
@pytest.mark.slow
@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize(
    ("method", "silhouettes"), [("zfail", "gpu"), ("zpass", "cpu"), ("auto", "gpu"), ("auto", "cpu")]
)
def test_the_reference_is_met_at_every_pixel(
    session: rg.Session, shared: Path, case: str, method: str, silhouettes: str
) -> None:
    """Faces turned away included. With the eye in shadow z-pass must fail, and the automatic choice not."""
    here = shared / "reference" / "b2_shadows" / case
    camera, masks = json.loads((here / "case.json").read_text())["camera"], np.load(here / "masks.npz")
    sets = tuple(
        f"shadows.{x}" for x in ("light=all", "unclosed=skip", f"method={method}", f"silhouettes={silhouettes}")
    )
    loaded = rg.load(PIPELINE, scene=here / "scene.glb", size=(camera["width"], camera["height"]), sets=sets)
    frame = session.render(loaded, outputs=(), taps=["shadows.visibility"], warm_up=False)
    judged = np.isin(masks["cls"], (1, 2, 3)) & ~masks["edge"].astype(bool)
    share = ((frame.arrays["shadows.visibility"][0, ..., 0] > 0.5) != (masks["cls"] == 1))[judged].mean()
    if method == "zpass" and case == "dir_camera_in_shadow":
        assert share > 0.5
    else:
        assert share <= 5e-4


# --- the pieces -------------------------------------------------------------------------------------------------------


@pytest.mark.nightly(keep=2)
@pytest.mark.parametrize("shape", ["box", "sphere", "torus_knot"])
@pytest.mark.parametrize("mirrored", [False, True])
def test_silhouettes_close_what_the_light_meets(shape: str, mirrored: bool) -> None:
    """Sides run along the border of the lit faces, each once and against it."""
    mesh, transform = shapes.mesh(shape), np.diag([-1.5 if mirrored else 1.5, 1, 0.5, 1])
    transform[:3, 3] = 1, 2, 3
    for light in (np.array([3.0, 9, 4, 1]), np.array([0.3, 0.8, -0.1, 0])):
        found = silhouette(mesh, transform, light)
        normals = np.cross(found.lit[:, 1] - found.lit[:, 0], found.lit[:, 2] - found.lit[:, 0])
        towards = light[:3] - light[3] * found.lit[:, 0]
        assert (np.einsum("ij,ij->i", normals, towards) > -1e-9).all()

        def run(a: Floats, b: Floats) -> tuple[tuple[float, ...], tuple[float, ...]]:
            return tuple(a.round(6) + 0.0), tuple(b.round(6) + 0.0)

        runs = {run(t[k], t[(k + 1) % 3]) for t in found.lit for k in range(3)}
        border = {(b, a) for a, b in runs if (b, a) not in runs}
        assert {run(a, b) for a, b in found.sides} == border
        assert len(found.sides) == len(border)


def test_balls_that_reach_the_near_pyramid_are_found() -> None:
    """Against points drawn at random in the pyramid: one in the ball proves that it is touched."""
    random = np.random.default_rng(5)
    camera = view_matrices(_camera([0.3, 1, 4], [0, 0.5, 0]), (160, 90))
    corners = projection.frustum_corners(camera)[:4]
    for light in (np.array([1.0, 3, 2, 1]), np.array([-2.0, 0.5, 9, 1]), np.array([0.2, 0.9, -0.3, 0])):
        weights = random.dirichlet(np.ones(4), 20000)
        along = random.random((20000, 1))
        start = weights @ corners
        inside = start + along * (light[:3] - start) if light[3] else start + 8 * along * light[:3]
        centers, radii = random.uniform(-4, 6, (400, 3)), random.uniform(0.05, 1.0, 400)
        squared = (inside**2).sum(axis=1) - 2 * centers @ inside.T + (centers**2).sum(axis=1)[:, None]
        proved = (squared < radii[:, None] ** 2).any(axis=1)
        found = touches_near_pyramid(camera, light, centers, radii)
        assert proved.any()
        assert found[proved].all()
        assert found.mean() < proved.mean() + 0.15, "few others"
    in_plane = np.array([*(corners.mean(axis=0) + corners[1] - corners[0]), 1.0])
    assert touches_near_pyramid(camera, in_plane, np.full((1, 3), 99.0), np.ones(1)).all()


def _camera(eye: list[float], target: list[float]) -> Any:
    return Camera("c", projection.look_at(eye, target), "perspective", fov_y=0.8, near=0.5, far=40.0)


def test_balls_around_objects_hold_their_vertices(tmp_path: Path) -> None:
    (tmp_path / "s.yaml").write_text(SCENE.replace("CAMERA", PERSPECTIVE).replace("RANGE", "9"))
    scene = rg.load(PIPELINE, scene=tmp_path / "s.yaml").link().scene
    centers, radii = bounding_spheres(scene)
    for entry, center, radius in zip(scene.objects, centers, radii, strict=True):
        points = scene.meshes[entry.mesh].positions @ entry.transform[:3, :3].T + entry.transform[:3, 3]
        assert np.linalg.norm(points - center, axis=1).max() <= radius * (1 + 1e-6)
