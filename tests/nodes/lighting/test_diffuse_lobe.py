"""How light is shared between the diffuse and the specular lobe, against white furnaces in float64."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest

import rendergraph as rg

Floats = npt.NDArray[np.float64]
COUNT = 200
U, W = ((np.stack(np.meshgrid(*[(np.arange(COUNT) + 0.5) / COUNT] * 2), -1).reshape(-1, 2)) * [1.0, 2 * np.pi]).T
SIDE = 48
BALL = """scene: 1
objects: {ball: {shape: sphere, radius: 1, segments: 128, rings: 64, material: paint}}
materials: {paint: {base_color: [1, 1, 1], roughness: %s}}
lights: {sun: {type: directional, direction: [-0.3, -0.4, -1], intensity: 3}}
cameras: {main: {eye: [0, 0, 4], target: [0, 0, 0], height: 2.2}}
"""


def fresnel(cosine: Floats) -> Floats:
    return np.asarray(0.04 + 0.96 * (1 - cosine) ** 5)


def around(cosine: Floats | float) -> Floats:
    """Directions around +z with these cosines and the angles W."""
    sine = np.sqrt(1 - np.asarray(cosine) ** 2)
    return np.stack([sine * np.cos(W), sine * np.sin(W), np.broadcast_to(cosine, W.shape)], axis=-1)


def specular_albedo(roughness: float, n_v: float) -> float:
    """Light of a white sky that the GGX lobe of a dielectric reflects, over half vectors in proportion to D NoH."""
    a2 = roughness**4
    h = around(np.sqrt((1 - U) / (1 + (a2 - 1) * U)))
    v = np.array([np.sqrt(1 - n_v**2), 0, n_v])
    v_h = h @ v
    n_l = (2 * v_h[:, None] * h - v)[:, 2]
    above = (n_l > 0) & (v_h > 0)
    n_l = np.where(above, n_l, 1.0)
    smith = 0.5 / (n_l * np.sqrt(n_v**2 * (1 - a2) + a2) + n_v * np.sqrt(n_l**2 * (1 - a2) + a2))
    reflected = smith * fresnel(np.clip(v_h, 0, 1)) * n_l * 4 * v_h / h[:, 2]
    return float(np.where(above, reflected, 0.0).mean())


def diffuse_albedo_without_fresnel(n_v: float) -> float:
    """The same of a white diffuse lobe that is scaled by 1 - F of the half vector, as in appendix B of glTF 2.0."""
    light = around(U)
    h = light + [np.sqrt(1 - n_v**2), 0, n_v]
    h /= np.linalg.norm(h, axis=-1, keepdims=True)
    return float(2 * ((1 - fresnel(h @ [np.sqrt(1 - n_v**2), 0, n_v])) * U).mean())


def test_only_a_lobe_that_leaves_the_specular_albedo_conserves_energy() -> None:
    """Lambert's lobe adds up to 1.04 at least and 1.37 towards the rim; with 1 - F of each light it is still 1.32."""
    assert 1 + specular_albedo(0.5, 1.0) == pytest.approx(1.037, abs=0.001)
    assert 1 + specular_albedo(0.2, 0.17) == pytest.approx(1.373, abs=0.002)
    assert diffuse_albedo_without_fresnel(0.17) + specular_albedo(0.2, 0.17) == pytest.approx(1.316, abs=0.002)


def cosines() -> Floats:
    """NoV of the ball's pixels, NaN beside it."""
    place = ((np.arange(SIDE) + 0.5) / SIDE - 0.5) * 2.2
    with np.errstate(invalid="ignore"):
        return np.asarray(np.sqrt(1 - place[:, None] ** 2 - place**2))


@pytest.mark.nightly(keep=1)
@pytest.mark.parametrize(("pipeline", "roughness"), [("forward", 0.5), ("deferred", 0.25)])
def test_white_paint_in_white_light_is_white(
    session: rg.Session, shared: Path, tmp_path: Path, pipeline: str, roughness: float
) -> None:
    (tmp_path / "ball.yaml").write_text(BALL % roughness)
    white = shared / "reference" / "b5_ibl" / "env_white.exr"

    def drawn(lobe: str, *sets: str) -> Floats:
        sets = (f"light.diffuse_lobe={lobe}", "light.terms=ambient", "light.multiple_scattering=false", *sets)
        loaded = rg.load(pipeline, scene=tmp_path / "ball.yaml", environment=white, sets=sets, size=(SIDE, SIDE))
        return np.asarray(session.render(loaded, outputs=["radiance"])["radiance"], np.float64)[..., 0]

    n_v = cosines()
    inside = n_v > 0.2
    expected = 1 + np.vectorize(lambda cosine: specular_albedo(roughness, cosine))(n_v[inside][::29])
    np.testing.assert_allclose(drawn("lambert")[inside][::29], expected, atol=0.02)
    assert expected.max() > 1.1
    np.testing.assert_allclose(drawn("shared")[inside], 1, atol=0.005)


@pytest.mark.nightly(keep=1)
@pytest.mark.parametrize("pipeline", ["forward", "deferred", "deferred-stencil-lights"])
def test_light_of_a_lamp_is_shared_alike(session: rg.Session, tmp_path: Path, pipeline: str) -> None:
    (tmp_path / "ball.yaml").write_text(BALL % 0.3)

    def drawn(lobe: str) -> tuple[Floats, Floats]:
        sets = (f"light.diffuse_lobe={lobe}", "light.environment=null", "light.multiple_scattering=false")
        loaded = rg.load(pipeline, scene=tmp_path / "ball.yaml", sets=sets, size=(SIDE, SIDE))
        frame = session.render(loaded, taps=["light.direct_diffuse", "light.direct_specular"])
        diffuse, specular = frame["light.direct_diffuse"], frame["light.direct_specular"]
        return np.asarray(diffuse, np.float64)[..., 0], np.asarray(specular, np.float64)[..., 0]

    n_v = cosines()
    (whole, gloss), (share, same) = drawn("lambert"), drawn("shared")
    lit = (n_v > 0.2) & (whole > 0.05)
    expected = 1 - np.vectorize(lambda cosine: specular_albedo(0.3, cosine))(n_v[lit][::29])
    np.testing.assert_allclose((share[lit] / whole[lit])[::29], expected, atol=0.02)
    assert expected.min() < 0.85
    np.testing.assert_array_equal(gloss, same)


def test_the_empirical_models_have_one_lobe() -> None:
    loaded = rg.load("deferred", sets=("light.diffuse_lobe=shared", "light.shading=phong"), size=(16, 16))
    steps = loaded.plan(outputs=["radiance"]).schedule.steps
    assert not any(read.name == "brdf_table" for step in steps for read in step.reads)
