"""Mitsuba's light against closed forms, independent references and the rasteriser. Skipped where it is not installed.

Mitsuba and the software rasteriser each bring their LLVM, so everything that imports Mitsuba runs in other processes.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from msgspec.structs import replace
from rendergraph.pipelines.references.mitsuba.installation import find_llvm
from rendergraph.pipelines.references.mitsuba.process import Tracer

import rendergraph as rg
from rendergraph.compare import compare
from rendergraph.images import read, write
from rendergraph.resources import shipped_pipelines
from rendergraph.scene.cameras import view_matrices
from rendergraph.scene.load import load
from rendergraph.scene.model import Scene

pytestmark = [
    pytest.mark.nightly,
    pytest.mark.slow,
    pytest.mark.skipif(find_spec("mitsuba") is None or not find_llvm()[1], reason="no Mitsuba, or no LLVM for it"),
]
Floats = npt.NDArray[np.float64]
BARE = ("light.lookup=null", "light.ambient=0", "light.environment=null")


def scene_of(folder: Path, text: str) -> Scene:
    (folder / "scene.yaml").write_text(f"scene: 1\n{text}")
    return load(folder / "scene.yaml")


def trace(scene: Scene, size: tuple[int, int], samples: int, **options: Any) -> tuple[Floats, Floats]:
    """Radiance and its standard error."""
    tracer = Tracer(scene, view_matrices(next(iter(scene.cameras.values())), size), **options)
    traced = tracer.trace(samples)
    tracer.close()
    return traced.radiance.astype(np.float64), np.sqrt(traced.variance.astype(np.float64))


def in_mitsuba(scene: Scene, size: tuple[int, int], script: str, **options: Any) -> dict[str, Any]:
    """What a script stores in `found`; it has the scene as `picture.scene`."""
    tracer = Tracer(scene, view_matrices(next(iter(scene.cameras.values())), size), **options)
    head = """
import json, sys
from pathlib import Path
from rendergraph.pipelines.references.mitsuba.render import *
folder, found = Path(sys.argv[1]), {}
picture = Picture(json.loads((folder / "request.json").read_text()), dict(np.load(folder / "arrays.npz")))
scene, camera = picture.scene, picture.request["camera"]
"""
    variables = os.environ | {"DRJIT_LIBLLVM_PATH": find_llvm()[1]}
    command = [sys.executable, "-c", f"{head}{script}\nnp.savez(folder / 'found.npz', **found)", str(tracer._folder)]
    subprocess.run(command, check=True, env=variables)
    found = dict(np.load(tracer._folder / "found.npz"))
    tracer.close()
    return found


def decoder(session: rg.Session, pipeline: rg.Pipeline) -> Any:
    """Texels of a pipeline's scene; only a session has those of generated textures."""
    with session.current():
        drawing = session.compile(pipeline)

    def decode(image: Any, srgb: bool) -> npt.NDArray[Any]:
        with session.current():
            return drawing.executable.scene.decode(image, srgb)

    return decode


# --- the surface -----------------------------------------------------------------------------------------------------

MATERIALS: dict[str, dict[str, Any]] = {
    "plastic": {"base_color": [0.8, 0.3, 0.1], "roughness": 0.35, "metallic": 0.3},
    "rough": {"base_color": [0.2, 0.6, 0.9], "roughness": 1.0},
    "gold": {"base_color": [1.0, 0.7, 0.3], "roughness": 0.2, "metallic": 1.0},
    "glass": {
        "base_color": [0.9, 0.9, 0.9],
        "roughness": 0.5,
        "ior": 2.0,
        "specular": 0.7,
        "specular_color": [1, 0.5, 0.2],
    },
    "brushed": {
        "base_color": [0.7, 0.7, 0.7],
        "roughness": 0.4,
        "metallic": 1.0,
        "anisotropy_strength": 0.8,
        "anisotropy_rotation": 0.5,
    },
}


def reflectance(values: dict[str, Any], view: Floats, light: Floats, shared: bool) -> Floats:
    """glTF's BRDF times the cosine in float64, for directions (n, 3) with x along the grain and z the normal."""
    half = view + light
    half /= np.linalg.norm(half, axis=1, keepdims=True)
    base, metallic = np.array(values["base_color"]), values.get("metallic", 0.0)
    specular, ior = values.get("specular", 1.0), values.get("ior", 1.5)
    dielectric = (
        np.minimum(((ior - 1) / (ior + 1)) ** 2 * np.array(values.get("specular_color", [1, 1, 1])), 1) * specular
    )
    f0, f90 = dielectric + (base - dielectric) * metallic, specular + (1 - specular) * metallic
    weight = (1 - (view * half).sum(axis=1, keepdims=True)) ** 5
    alpha = values["roughness"] ** 2
    along = alpha + (1 - alpha) * values.get("anisotropy_strength", 0.0) ** 2
    stretch, nv, nl = np.array([along, alpha, 1]), view[:, 2:], light[:, 2:]
    slope = half / stretch
    distribution = 1 / (np.pi * along * alpha * (slope * slope).sum(axis=1, keepdims=True) ** 2)
    lengths = [np.linalg.norm(stretch * each, axis=1, keepdims=True) for each in (view, light)]
    visibility = 0.5 / (nl * lengths[0] + nv * lengths[1])
    diffuse = base * (1 - metallic) / np.pi
    if shared:
        diffuse = diffuse * (1 - (dielectric + (specular - dielectric) * weight).max(axis=1, keepdims=True))
    return np.asarray((diffuse + (f0 + (f90 - f0) * weight) * distribution * visibility) * nl)


def samples_of_materials(folder: Path) -> Scene:
    rows = "\n".join(f"  {name}: {json.dumps(values)}" for name, values in MATERIALS.items())
    planes = "\n".join(
        f"  {name}: {{shape: plane, size: [1, 1], at: [{2 * number}, 0, 0], material: {name}}}"
        for number, name in enumerate(MATERIALS)
    )
    camera = "cameras: {main: {eye: [0, 5, 0], target: [0, 0, 0], up: [0, 0, -1]}}"
    return scene_of(folder, f"objects:\n{planes}\nmaterials:\n{rows}\n{camera}\n")


@pytest.mark.parametrize("shared", [False, True], ids=["lambert", "shared"])
def test_surfaces_reflect_by_the_formulas(tmp_path: Path, shared: bool) -> None:
    """Values of random directions, and that samples have the mean of the values and the density they claim."""
    script = """
rng = np.random.default_rng(1)
for number in range(5):
    n = 1 << 15
    d = rng.normal(size=(3, n)); d[1] = -abs(d[1]) - 0.05; d /= np.linalg.norm(d, axis=0)
    o = np.array([2.0 * number, 0, 0])[:, None] - 3 * d
    si = scene.ray_intersect(mi.Ray3f(mi.Point3f(*o), mi.Vector3f(*d)))
    wo = rng.normal(size=(3, n)); wo[1] = abs(wo[1]) + 0.02; wo /= np.linalg.norm(wo, axis=0)
    context, bsdf = mi.BSDFContext(), si.bsdf()
    value = bsdf.eval(context, si, si.to_local(mi.Vector3f(*wo)))
    found[f"view{number}"], found[f"light{number}"], found[f"value{number}"] = -d.T, wo.T, np.array(value).T
    n = 1 << 20
    for angle in (0.3, 1.2):
        d = np.array([np.sin(angle), -np.cos(angle), 0.0])
        si = scene.ray_intersect(mi.Ray3f(mi.Point3f(*map(float, [2 * number - 3 * d[0], -3 * d[1], 0])), mi.Vector3f(*map(float, d))))
        u = mi.Float(rng.random(n).astype("f4")), mi.Point2f(rng.random((2, n)).astype("f4"))
        bs, weight = si.bsdf().sample(context, si, *u)
        uniform = mi.warp.square_to_uniform_hemisphere(mi.Point2f(rng.random((2, n)).astype("f4")))
        density = np.mean(np.array(si.bsdf().pdf(context, si, uniform))) * 2 * np.pi
        found[f"mean{number} {angle}"] = np.array(weight).mean(axis=1)
        found[f"density{number} {angle}"] = density, np.mean(np.array(bs.pdf) > 0)
"""
    found = in_mitsuba(samples_of_materials(tmp_path), (8, 8), script, shared=shared)
    rng = np.random.default_rng(2)
    for number, values in enumerate(MATERIALS.values()):
        # The plane's normal is +y, its tangent +x, and v grows towards +z.
        turn = values.get("anisotropy_rotation", 0.0)
        rows = np.array([[np.cos(turn), 0, -np.sin(turn)], [-np.sin(turn), 0, -np.cos(turn)], [0, 1, 0]])
        view, light = found[f"view{number}"] @ rows.T, found[f"light{number}"] @ rows.T
        wanted = reflectance(values, view, light, shared)
        np.testing.assert_allclose(found[f"value{number}"], wanted, rtol=3e-4, atol=1e-7)
        for angle in (0.3, 1.2):
            directions = rng.normal(size=(1 << 20, 3))
            directions[:, 1] = abs(directions[:, 1])
            directions /= np.linalg.norm(directions, axis=1, keepdims=True)
            view = np.broadcast_to(np.array([-np.sin(angle), np.cos(angle), 0]) @ rows.T, directions.shape)
            albedo = reflectance(values, view, directions @ rows.T, shared) * 2 * np.pi
            error = albedo.std(axis=0) / 1024
            assert (abs(found[f"mean{number} {angle}"] - albedo.mean(axis=0)) < 5 * error + 2e-3).all(), (number, angle)
            density, kept = found[f"density{number} {angle}"]
            assert density == pytest.approx(kept, abs=0.03), (number, angle)


def test_the_white_furnace(tmp_path: Path, shared: Path) -> None:
    """A white diffuse ball vanishes before constant light, and a perfect mirror of a metal has its directional albedo."""
    write(tmp_path / "white.exr", np.ones((8, 16, 3), np.float32))
    facts = json.loads((shared / "reference/b5_ibl/white_furnace.json").read_text())
    for number, roughness in list(enumerate(facts["roughness"]))[1::2]:
        for column in (1, 5):
            cosine = facts["nov"][column]
            eye = [float(10 * np.sqrt(1 - cosine**2)), 10 * cosine, 0]
            scene = scene_of(
                tmp_path,
                f"objects: {{p: {{shape: plane, size: [9, 9], material: m}}}}\nenvironment: {{file: white.exr}}\n"
                f"materials: {{m: {{base_color: 1, metallic: 1, roughness: {roughness}}}}}\n"
                f"cameras: {{main: {{eye: {eye}, target: [0, 0, 0], fov_y_degrees: 0.01, near: 1, far: 100}}}}\n",
            )
            light, error = trace(scene, (4, 4), 8192, bounces=1)
            wanted = facts["albedo_f0_1_exact"][number][column]
            assert light.mean() == pytest.approx(wanted, abs=0.001 + 4 * error.mean() / 4), (roughness, cosine)
    ball = scene_of(
        tmp_path,
        "objects: {b: {shape: sphere, material: m}}\nenvironment: {file: white.exr}\n"
        "materials: {m: {base_color: 1, specular: 0}}\ncameras: {main: {eye: [0, 1, 3], target: [0, 0, 0]}}\n",
    )
    light, error = trace(ball, (32, 32), 256, bounces=3)
    assert (abs(light - 1) < 6 * error + 0.01).all()
    assert light.mean() == pytest.approx(1, abs=1e-3)


# --- lights ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("case", ["dir_persp", "point_spot_persp"])
def test_punctual_lights_are_the_analytic_ones(shared: Path, case: str) -> None:
    here = shared / "reference/b1_direct" / case
    facts = json.loads((here / "case.json").read_text())
    size = facts["camera"]["width"], facts["camera"]["height"]
    light, error = trace(load(here / "scene.glb"), size, 256, bounces=0, shadows=False, jitter=False)
    expected = read(here / "rgb_exact.exr").astype(np.float64)
    masks = np.load(here / "masks.npz")
    rough = np.array([False, *(ball["roughness"] >= 0.25 for ball in facts["spheres"])])
    judged = rough[masks["sphere"]] & (masks["coverage"] == 1)
    relative = abs(light - expected)[judged] / np.maximum(expected[judged], 0.01 * expected.mean())
    noise = error[judged] / np.maximum(expected[judged], 0.01 * expected.mean())
    assert np.median(relative) < 0.001 + np.median(noise)
    assert light[judged].mean() == pytest.approx(expected[judged].mean(), rel=0.001)


@pytest.mark.parametrize("case", ["dir_basic", "point_room", "spot_basic"])
def test_shadows_are_the_exact_ones(shared: Path, case: str) -> None:
    here = shared / "reference/b2_shadows" / case
    camera = json.loads((here / "case.json").read_text())["camera"]
    scene = load(here / "scene.glb")
    scene = replace(scene, materials=tuple(replace(each, specular=0.0) for each in scene.materials))
    masks = np.load(here / "masks.npz")
    judged, lit = (masks["cls"] > 0) & ~masks["edge"].astype(bool), np.asarray(masks["cls"] == 1)
    expected = read(here / "shaded.exr")[..., :3].astype(np.float64)
    light, _ = trace(scene, (camera["width"], camera["height"]), 2, bounces=0, jitter=False)
    shines = np.asarray((light > 0).any(axis=-1))
    assert np.mean(shines[judged] != lit[judged]) < 1e-3
    np.testing.assert_allclose(light[judged & lit], expected[judged & lit], rtol=1e-3, atol=1e-5)


@pytest.mark.parametrize(("name", "bounces"), [("direct", 0), ("full", 16)])
def test_interreflection_is_that_of_another_path_tracer(shared: Path, name: str, bounces: int) -> None:
    here = shared / "reference/b4_gi/point"
    scene = load(here / "scene.glb")
    scene = replace(scene, materials=tuple(replace(each, specular=0.0) for each in scene.materials))
    known = np.load(here / "gbuffer.npz")
    judged = (known["object"] > 0) & ~known["edge"].astype(bool)
    expected = read(here / f"{name}.exr")[..., :3].astype(np.float64)[judged]
    light, error = (part[judged] for part in trace(scene, (192, 192), 128, bounces=bounces, jitter=False))
    assert light.mean() == pytest.approx(
        expected.mean(), rel=1e-6 + 4 * error.mean() / expected.mean() / len(light) ** 0.5
    )
    assert np.mean(abs(light - expected) < 3 * np.hypot(error, 0.004 * expected) + 1e-6) > 0.98


def test_environments_shine_as_their_oracle(tmp_path: Path, shared: Path) -> None:
    """A white diffuse ball shows the irradiance of every direction."""
    here = shared / "reference/b5_ibl"
    scene = scene_of(
        tmp_path,
        "objects: {b: {shape: sphere, segments: 128, material: m}}\nmaterials: {m: {base_color: 1, specular: 0}}\n"
        "cameras: {main: {eye: [0, 1, 6], target: [0, 0, 0], fov_y_degrees: 25}}\n",
    )
    write(tmp_path / "map.exr", read(here / "env_synthetic.exr"))
    (tmp_path / "scene.yaml").write_text(
        (tmp_path / "scene.yaml").read_text() + "environment: {file: map.exr, rotate_degrees: 40, intensity: 2}\n"
    )
    scene = load(tmp_path / "scene.yaml")
    size = (48, 48)
    normals = in_mitsuba(scene, size, FIRST_HITS)["position"]
    light, error = trace(scene, size, 256, bounces=0, jitter=False)
    picture = read(here / "env_synthetic.exr")[..., :3].astype(np.float64)
    height, width = picture.shape[:2]
    around = ((np.arange(width) + 0.5) / width - 0.5) * 2 * np.pi - np.radians(40)
    down = (np.arange(height) + 0.5) / height * np.pi
    directions = np.stack(
        [
            np.sin(down)[:, None] * np.cos(around),
            np.cos(down)[:, None] * np.ones(width),
            np.sin(down)[:, None] * np.sin(around),
        ],
        axis=-1,
    )
    edges = np.cos(np.arange(height + 1) / height * np.pi)
    solid_angles = (edges[:-1] - edges[1:]) * 2 * np.pi / width
    seen = np.linalg.norm(normals, axis=-1) > 0.2
    units = normals[seen] / np.linalg.norm(normals[seen], axis=1, keepdims=True)
    cosines = np.maximum(units @ directions.reshape(-1, 3).T, 0)
    expected = 2 / np.pi * cosines @ (picture * solid_angles[:, None, None]).reshape(-1, 3)
    assert seen.sum() > 200
    assert light[seen].mean() == pytest.approx(expected.mean(), rel=0.005)
    assert np.mean(abs(light[seen] - expected) < 4 * error[seen] + 0.02 * expected) > 0.99


FIRST_HITS = """
width, height = camera["size"]
index = dr.arange(mi.UInt32, width * height)
ray = camera_rays(camera, (mi.Float(index % width) + 0.5) / width, (mi.Float(index // width) + 0.5) / height)
start = mi.Point3f(ray.o)
si = scene.ray_intersect(mi.Ray3f(cull_back_faces(scene, ray)))
found["position"] = np.array(dr.select(si.is_valid(), si.p, 0)).T.reshape(height, width, 3)
found["distance"] = np.array(dr.select(si.is_valid(), dr.norm(si.p - start), 0)).reshape(height, width)
"""


# --- against the rasteriser ------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def session() -> Any:
    with rg.Session() as made:
        yield made


def test_the_camera_sees_the_surfaces_of_the_g_buffer(session: rg.Session) -> None:
    pipeline = rg.load("deferred", scene="shapes", size=(96, 54))
    window = pipeline.render(session=session, taps=["gbuffer.depth"])["gbuffer.depth"].astype(np.float64)
    scene = pipeline.link().scene
    view = view_matrices(next(iter(scene.cameras.values())), (96, 54))
    points = in_mitsuba(scene, (96, 54), FIRST_HITS, decode=decoder(session, pipeline))["position"]
    depth = -(np.concatenate([points, np.ones((54, 96, 1))], axis=-1) @ view.view.T)[..., 2]
    seen = np.linalg.norm(points, axis=-1) > 0
    expected = view.projection[2, 3] / (1 - 2 * window + view.projection[2, 2])
    assert np.mean(seen != (window > 0)) < 1e-3
    both = seen & (window > 0)
    assert np.median(abs(depth / expected - 1)[both]) < 1e-5
    assert np.mean(abs(depth / expected - 1)[both] > 1e-4) < 2e-3


@pytest.mark.parametrize(
    ("asset", "most"),
    [
        ("BoxVertexColors.glb", 1e-3),
        ("MetalRoughSpheresNoTextures.glb", 1e-3),
        ("AnisotropyStrengthTest.glb", 1e-3),
        ("SimpleInstancing.glb", 1e-3),
        ("UnlitTest.glb", 1e-3),
        ("TextureTransformTest/TextureTransformTest.gltf", 4e-3),  # llvmpipe decodes sRGB to 0.2 %
        ("NormalTangentTest.glb", 4e-3),
        ("TextureSettingsTest.glb", 4e-3),
        ("TextureCoordinateTest.glb", 4e-3),
    ],
    ids=lambda value: Path(value).stem if isinstance(value, str) else "",
)
def test_direct_light_without_shadows_is_the_rasterisers(
    session: rg.Session, shared: Path, asset: str, most: float
) -> None:
    """Most pixels; where textures are seen small, the rasteriser's mipmaps make the difference."""
    size = (240, 180)
    pipeline = rg.load("forward", scene=shared / "assets/gltf" / asset, size=size, sets=BARE)
    drawn = pipeline.render(session=session, outputs=["radiance"])["radiance"][..., :3].astype(np.float64)
    scene = replace(pipeline.link().scene, environment=None)
    light, _ = trace(scene, size, 8, bounces=0, shadows=False, jitter=False)
    seen = drawn.max(axis=-1) > 0.01 * drawn.mean()
    assert np.mean(seen != (light.max(axis=-1) > 0.01 * drawn.mean())) < 0.01
    relative = (abs(drawn - light).max(axis=-1) / drawn.max(axis=-1).clip(1e-6))[seen]
    assert np.median(relative) < most
    assert light[seen].mean() == pytest.approx(drawn[seen].mean(), rel=0.01)


def test_what_casts_no_shadow_lets_only_punctual_lights_through(tmp_path: Path) -> None:
    """The environment stays behind it, as do emissive surfaces, whatever the way in which their light is found."""
    write(tmp_path / "white.exr", np.ones((8, 16, 3), np.float32))
    text = (
        "objects:\n  floor: {{shape: plane, size: [90, 90], material: m}}\n"
        "  sheet: {{shape: plane, size: [900, 900], at: [0, 1, 0], casts_shadow: {}, material: m}}\n"
        "materials: {{m: {{base_color: 0.5, double_sided: true, specular: 0}}}}\n{}\n"
        "cameras: {{main: {{eye: [0, 0.5, 0], target: [0, 0, 0], up: [0, 0, -1]}}}}\n"
    )
    sun = "lights: {sun: {type: directional, direction: [0.2, -1, 0.1], intensity: 3}}"
    lamp = "lights: {lamp: {type: point, at: [1, 5, 0], intensity: 30}}"
    for light in (sun, lamp):
        scenes = (scene_of(tmp_path, text.format(casts, light)) for casts in ("false", "true"))
        lit, dark = (trace(scene, (8, 8), 4, bounces=0)[0] for scene in scenes)
        assert lit.min() > 0.1
        assert dark.max() == 0
    sky = "environment: {file: white.exr}"
    assert trace(scene_of(tmp_path, text.format("false", sky)), (8, 8), 16, bounces=0)[0].mean() < 0.02


def test_ambient_light_comes_from_all_sides_and_is_not_seen(tmp_path: Path) -> None:
    scene = scene_of(
        tmp_path,
        "objects: {b: {shape: sphere, material: m}}\nmaterials: {m: {base_color: 0.5, specular: 0}}\n"
        "cameras: {main: {eye: [0, 1, 6], target: [0, 0, 0]}}\n",
    )
    scene = replace(scene, lights=())
    light, _ = trace(scene, (33, 33), 64, bounces=0, ambient=(0.2, 0.4, 0.6), jitter=False)
    np.testing.assert_allclose(light[16, 16], [0.1, 0.2, 0.3], rtol=0.1)
    assert not light[0, 0].any()


def test_masks_let_light_through_where_they_are_transparent(tmp_path: Path) -> None:
    holes = np.zeros((2, 2, 4), np.uint8)
    holes[..., :3], holes[:, 1, 3] = 255, 255
    write(tmp_path / "holes.png", holes)
    scene = scene_of(
        tmp_path,
        "objects:\n  floor: {shape: plane, size: [4, 4], material: m}\n"
        "  sheet: {shape: plane, size: [4, 4], at: [0, 1, 0], material: sheet}\n"
        "materials:\n  m: {base_color: 0.5}\n"
        "  sheet: {double_sided: true, alpha_mode: mask, base_color_texture: holes.png}\n"
        "lights: {sun: {type: directional, direction: [0, -1, 0], intensity: 3}}\n"
        "cameras: {main: {eye: [0, 0.5, 0], target: [0, 0, 0], up: [0, 0, -1], fov_y_degrees: 90}}\n",
    )
    light, _ = trace(scene, (8, 8), 4, bounces=0)
    assert light[:, :4].min() > 0.4
    assert light[:, 4:].max() == 0


def test_the_camera_sees_no_back_behind_transparent_fronts(tmp_path: Path) -> None:
    """A black box of opacity one half covers a shining wall once."""
    scene = scene_of(
        tmp_path,
        "objects:\n  wall: {shape: plane, size: [9, 9], material: wall}\n"
        "  box: {shape: box, size: [4, 1, 4], at: [0, 1, 0], material: box}\n"
        "materials:\n  wall: {base_color: 0, specular: 0, emissive: [1, 1, 1]}\n"
        "  box: {base_color: [0, 0, 0, 0.5], specular: 0, alpha_mode: blend}\n"
        "cameras: {main: {eye: [0, 3, 0], target: [0, 0, 0], up: [0, 0, -1], fov_y_degrees: 20}}\n",
    )
    light, _ = trace(scene, (16, 16), 256, bounces=0)
    assert light.mean() == pytest.approx(0.5, abs=0.01)


# --- against our own path tracer -------------------------------------------------------------------------------------


@pytest.mark.skipif("path-traced" not in shipped_pipelines(), reason="no path tracer")
@pytest.mark.parametrize(
    ("scene", "environment"),
    [
        ("cornell_box", None),
        ("shapes", None),
        ("lantern", None),
        ("glass", None),
        ("assets/gltf/WaterBottle/WaterBottle.gltf", "studio"),
        ("assets/gltf/AlphaBlendModeTest.glb", None),
    ],
    ids=lambda value: Path(value).stem if value else "",
)
def test_the_path_tracer_agrees(session: rg.Session, shared: Path, scene: str, environment: str | None) -> None:
    """Means over blocks of 8×8 pixels within their noise, and the mean of the picture."""
    size, samples, bounces = (120, 88), 64, 3
    source = shared / scene if "/" in scene else scene
    sets = (f"light.max_bounces={bounces}", f"light.samples={samples}", "light.ambient=0")
    pipeline = rg.load("path-traced", scene=source, environment=environment, size=size, sets=sets)
    frame = pipeline.render(session=session, outputs=["radiance", "variance"])
    ours, our_variance = (frame[name][..., :3].astype(np.float64) for name in ("radiance", "variance"))
    decode = decoder(session, pipeline)
    light, error = trace(pipeline.link().scene, size, samples, bounces=bounces, decode=decode)
    variance = our_variance + error**2
    ceiling = np.percentile(variance, 99.5)  # single paths that found a lamp by chance say nothing
    calm = (variance <= ceiling).all(axis=-1, keepdims=True)

    def blocks(values: Floats) -> Floats:
        return np.asarray((values * calm).reshape(size[1] // 8, 8, size[0] // 8, 8, 3).sum(axis=(1, 3)) / 64)

    difference, noise = blocks(ours - light), np.sqrt(blocks(variance) / 64)
    allowed = noise + 0.003 * blocks(light) + 1e-6  # llvmpipe decodes sRGB to 0.2 %
    assert np.mean(abs(difference) < 3 * allowed) > 0.97
    assert abs(difference.mean()) < 0.003 * light.mean() + 4 * np.sqrt((noise**2).sum()) / noise.size


def test_comparisons_take_it_as_a_truth() -> None:
    pipeline = rg.load("forward", scene="cornell_box", size=(64, 36))
    comparison = compare(pipeline, reference="mitsuba:max_bounces=1,samples=32", reference_samples=64)
    assert comparison.reference.name == "mitsuba"
    assert comparison.reference.samples == 64
    (result,) = comparison.results
    assert result.relative_mse is not None
    assert 0.001 < result.relative_mse < 1
