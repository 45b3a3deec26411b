"""Forward lighting against analytic pictures, and its variants against each other."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest

import rendergraph as rg
from rendergraph.images import write
from rendergraph.scene.load import load

Floats = npt.NDArray[np.float64]
BARE = ("light.lookup=null", "light.environment=null", "light.ambient=0")


def render(session: rg.Session, pipeline: str, scene: Path | str, size: tuple[int, int], *sets: str) -> Floats:
    frame = rg.load(pipeline, scene=scene, size=size, sets=sets).render(session=session, outputs=["radiance"])
    return np.asarray(frame["radiance"], np.float64)


def exr(file: Path) -> Floats:
    oiio = pytest.importorskip("OpenImageIO")
    return np.asarray(oiio.ImageBuf(str(file)).get_pixels(oiio.FLOAT), np.float64)[..., :3]


# --- textures ---------------------------------------------------------------------------------------------------------

HORIZON = """scene: 1
objects: {ground: {shape: plane, size: [20000, 20000], uv: metres, material: chart}}
materials: {chart: {unlit: true, base_color_texture: chart.png}}
cameras: {main: {eye: [0, 1, 0], target: [0.3, 1, -1], fov_y_degrees: 40, far: 30000}}
"""


@pytest.mark.parametrize("pipeline", ["forward", "forward-msaa"])
def test_a_texture_has_its_mean_colour_up_to_the_horizon(session: rg.Session, tmp_path: Path, pipeline: str) -> None:
    """A pixel sees thousands of repetitions there, each of which a software rasteriser would visit, for minutes."""
    texels = np.random.default_rng(1).integers(0, 256, (16, 8, 3))
    texels[..., 0] = 255
    write(tmp_path / "chart.png", texels.astype(np.uint8))
    (tmp_path / "chart.yaml").write_text(HORIZON)
    found = render(session, pipeline, tmp_path / "chart.yaml", (33, 24), *BARE)
    linear = np.where(texels <= 10, texels / 255 / 12.92, ((texels / 255 + 0.055) / 1.055) ** 2.4)
    np.testing.assert_allclose(found[12:14, :, :3], np.broadcast_to(linear.mean((0, 1)), (2, 33, 3)), atol=0.01)
    assert found[22:, :, 1].std() > 0.05  # near the viewer single texels are seen


# --- direct light against the analytic spheres -----------------------------------------------------------------------


@pytest.mark.parametrize("case", ["dir_persp", "point_spot_persp"])
@pytest.mark.parametrize("smith", ["exact", "fast"])
def test_direct_light_is_the_analytic_one(session: rg.Session, shared: Path, case: str, smith: str) -> None:
    here = shared / "reference" / "b1_direct" / case
    facts = json.loads((here / "case.json").read_text())
    size = (facts["camera"]["width"], facts["camera"]["height"])
    found = render(session, "forward", here / "scene.glb", size, *BARE, f"light.smith={smith}")[..., :3]
    expected = exr(here / f"rgb_{smith}.exr")
    masks = np.load(here / "masks.npz")
    rough = np.array([False, *(sphere["roughness"] >= 0.25 for sphere in facts["spheres"])])
    judged = rough[masks["sphere"]] & (masks["coverage"] == 1)
    assert judged.sum() > 5000
    relative = np.abs(found - expected)[judged] / np.maximum(expected[judged], 0.01 * expected.mean())
    assert np.median(relative) <= 0.001
    assert np.percentile(relative, 99) <= 0.02


@pytest.mark.parametrize("case", ["dir_persp", "point_spot_persp"])
def test_the_diffuse_term_alone(session: rg.Session, shared: Path, case: str) -> None:
    here = shared / "reference" / "b1_direct" / case
    camera = json.loads((here / "case.json").read_text())["camera"]
    found = render(
        session, "forward", here / "scene.glb", (camera["width"], camera["height"]), *BARE, "light.terms=diffuse"
    )
    expected = exr(here / "diffuse.exr")
    inside = np.load(here / "masks.npz")["coverage"] == 1
    relative = np.abs(found[..., :3] - expected)[inside] / np.maximum(expected[inside], 0.01 * expected.mean())
    assert np.median(relative) <= 0.001


@pytest.mark.parametrize(("shading", "name"), [("phong", "specular_phong"), ("blinn_phong", "specular_blinn")])
def test_empirical_models_draw_the_analytic_sphere(
    session: rg.Session, shared: Path, tmp_path: Path, shading: str, name: str
) -> None:
    """A metallic-roughness material with the reference's kd and, by 4n = 2/α² − 2, its n; ks is 0.04 and not 0.4."""
    here = shared / "reference" / "b1_direct" / "phong_sphere"
    facts = json.loads((here / "case.json").read_text())
    terms = np.load(here / "terms.npz")
    shutil.copy(here / "scene.glb", tmp_path / "ball.glb")
    (ball,) = load(here / "scene.glb").objects
    roughness = (2 / (4 * facts["n_phong"] + 2)) ** 0.25
    (tmp_path / "scene.yaml").write_text(
        f"scene: 1\nobjects: {{ball: {{file: ball.glb, overrides: {{{ball.name}: {{material: paint}}}}}}}}\n"
        f"materials: {{paint: {{base_color: {facts['kd']}, metallic: 0, roughness: {roughness}}}}}\n"
    )
    sets = ("light.lookup=null", "light.ambient=0.1", f"light.shading={shading}")
    inside = terms["coverage"] == 1
    scene = tmp_path / "scene.yaml"
    diffuse = render(session, "forward", scene, (192, 192), *sets, "light.terms=diffuse")[..., :3]
    specular = render(session, "forward", scene, (192, 192), *sets, "light.terms=specular")[..., :3]
    np.testing.assert_allclose(diffuse[inside], terms["diffuse"][inside], atol=2e-3)
    np.testing.assert_allclose(specular[inside] * facts["ks"][0] / 0.04, terms[name][inside], atol=8e-3)


# --- terms and variants ----------------------------------------------------------------------------------------------


@pytest.mark.nightly(keep=2)
@pytest.mark.slow
@pytest.mark.parametrize("shading", ["unlit", "phong", "blinn_phong", "anisotropic", "pbr"])
def test_the_terms_sum_to_the_whole(session: rg.Session, shading: str) -> None:
    size = (96, 72)
    sets = (f"light.shading={shading}", "light.ambient=0.2")
    whole = render(session, "forward", "cornell_box", size, *sets)
    parts = [
        render(session, "forward", "cornell_box", size, *sets, f"light.terms={term}")
        for term in ("ambient", "diffuse", "specular", "emissive")
    ]
    np.testing.assert_allclose(sum(part[..., :3] for part in parts), whole[..., :3], rtol=4e-3, atol=1e-4)
    for part in parts:
        np.testing.assert_array_equal(part[..., 3], whole[..., 3])


def test_ambient_is_radiance_from_all_sides(session: rg.Session) -> None:
    """It adds ambient × albedo, whatever the surface's direction."""
    sets = ("light.terms=ambient", "light.environment=null")
    one = render(session, "forward", "spheres", (96, 72), "light.ambient=[0.5, 0.25, 1]", *sets)
    albedo = render(session, "shading-unlit", "spheres", (96, 72), "light.environment=null")
    np.testing.assert_allclose(one[..., :3], albedo[..., :3] * [0.5, 0.25, 1], rtol=2e-3, atol=1e-4)


def test_background_and_coverage(session: rg.Session) -> None:
    picture = render(session, "forward", "spheres", (96, 72), "light.background=[0.25, 0.5, 2]")
    nothing = picture[..., 3] == 0
    assert 0.3 < nothing.mean() < 0.9
    assert np.all(picture[nothing][:, :3] == [0.25, 0.5, 2])
    assert np.all(picture[~nothing][:, 3] == 1)


def test_prepass_draws_the_same_picture(session: rg.Session) -> None:
    """With no shadows in the way: the pre-pass changes what is shaded, not one bit of it."""
    sets = ("light.visibility=null", "light.lookup=null")
    for scene in ("cornell_box", "spheres"):
        plain = render(session, "forward", scene, (160, 120), "light.lookup=null")
        behind = render(session, "forward-prepass", scene, (160, 120), *sets)
        np.testing.assert_array_equal(plain, behind)


def test_gouraud_is_phong_on_a_flat_white_wall_and_near_it_elsewhere(session: rg.Session) -> None:
    """Colours of vertices interpolated: the mean of the picture stays, its highlights do not."""
    sets = ("light.lookup=null", "light.terms=diffuse")
    fragment = render(session, "forward", "spheres", (160, 120), *sets)[..., :3]
    vertex = render(session, "shading-gouraud", "spheres", (160, 120), *sets)[..., :3]
    assert abs(fragment.mean() / vertex.mean() - 1) < 0.01
    assert not np.array_equal(fragment, vertex)


@pytest.mark.nightly
@pytest.mark.slow
def test_gouraud_and_flat_keep_shadows(session: rg.Session) -> None:
    """Shadows are looked up at fragments whatever light is evaluated at, in both forms."""
    for evaluate in ("vertex", "face"):
        lookup = render(session, "forward", "shadow_study", (320, 180), f"light.evaluate={evaluate}")
        screen = render(session, "forward-prepass", "shadow_study", (320, 180), f"light.evaluate={evaluate}")
        bare = render(session, "forward", "shadow_study", (320, 180), f"light.evaluate={evaluate}", "light.lookup=null")
        assert np.mean(np.abs(lookup - screen).max(-1) > 0.02) < 0.01
        assert lookup[..., :3].mean() < 0.98 * bare[..., :3].mean()


def test_all_pixels_of_a_face_are_equal(session: rg.Session, shared: Path) -> None:
    """A box seen flat-shaded has one colour a triangle, I max(N.L, 0) of the face's middle; few colours in all."""
    here = shared / "reference" / "b2_shadows" / "dir_basic"
    picture = render(session, "shading-flat", here / "scene.glb", (384, 384), *BARE, "light.terms=diffuse")
    masks = np.load(here / "masks.npz")
    facts = json.loads((here / "case.json").read_text())
    boxes = [entry["id"] for entry in facts["objects"] if entry["triangles"] == 12]
    for box in boxes:
        inside = (masks["object"] == box) & ~masks["edge"].astype(bool)
        if inside.sum() > 200:
            assert len(np.unique(picture[inside][:, :3], axis=0)) <= 12


def test_unlit_shows_the_base_colour(session: rg.Session) -> None:
    picture = render(session, "shading-unlit", "cornell_box", (96, 72))
    assert {tuple(np.round(color, 2)) for color in picture[36:38, 10:86, :3].reshape(-1, 3)} <= {
        tuple(np.round(color, 2)) for color in np.unique(picture[..., :3].reshape(-1, 3), axis=0)
    }
    frame = rg.load("shading-unlit", scene="cornell_box", size=(64, 48)).render(session=session)
    assert set(frame.culled) == {"sun", "shadows", "environment"}


@pytest.mark.slow
@pytest.mark.parametrize(
    "name", ["forward", "forward-prepass", "shading-phong", "shading-blinn-phong", "shading-anisotropic", "shading-pbr"]
)
def test_shipped_pipelines_draw(session: rg.Session, name: str) -> None:
    frame = rg.load(name, size=(64, 36)).render(session=session)
    assert np.isfinite(frame["radiance"]).all()
    assert 0 < frame["image"][..., :3].mean() < 255
