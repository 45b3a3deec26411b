"""The layers of materials: white furnaces, exact spectra, reciprocity, and light that passes through, in float64."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest

import rendergraph as rg

Floats = npt.NDArray[np.float64]
Evaluate = Callable[..., Floats]
SIDE = 40
BALL = """scene: 1
objects: {ball: {shape: sphere, radius: 1, segments: 128, rings: 64, material: paint}}
materials: {paint: {%s}}
lights: {sun: {type: directional, direction: [-0.3, -0.4, -1], intensity: 3}}
cameras: {main: {eye: [0, 0, 4], target: [0, 0, 0], height: 2.2}}
"""
SHEEN = "base_color: 0, specular: 0, sheen_color: 1, sheen_roughness: %s"
COAT = "base_color: 0, specular: 0, clearcoat: %s, clearcoat_roughness: %s"


def charlie_masking(cosine: Floats, alpha: float) -> Floats:
    """The masking Λ of Estevez and Kulla (2017), from their table 1."""
    t = (1 - alpha) ** 2
    first = (25.3245, 3.32435, 0.16801, -1.27393, -4.85967)
    last = (21.5473, 3.82987, 0.19823, -1.97760, -4.32054)
    a, b, c, d, e = (t * one + (1 - t) * other for one, other in zip(first, last, strict=True))

    def fit(x: Floats) -> Floats:
        return np.asarray(a / (1 + b * x**c) + d * x + e)

    low, high = np.minimum(cosine, 0.5), np.maximum(cosine, 0.5)
    return np.where(cosine < 0.5, np.exp(fit(low)), np.exp(2 * fit(np.array(0.5)) - fit(1 - high)))


def charlie(n_l: Floats, n_v: Floats, n_h: Floats, roughness: float) -> Floats:
    alpha = roughness**2
    lobe = (2 + 1 / alpha) * np.sqrt(1 - n_h**2) ** (1 / alpha) / (2 * np.pi)
    return np.asarray(lobe / ((1 + charlie_masking(n_l, alpha) + charlie_masking(n_v, alpha)) * 4 * n_l * n_v))


def sheen_albedo(roughness: float, n_v: float, count: int = 200) -> float:
    """White light all around that sheen reflects: midpoints in the root of NoL, for most of the lobe is grazing."""
    u = ((np.arange(count) + 0.5) / count)[:, None]
    angle, n_l = (np.arange(count) + 0.5) / count * np.pi, u**2
    dot = np.sqrt((1 - n_l**2) * (1 - n_v**2)) * np.cos(angle) + n_l * n_v
    n_h = np.minimum((n_l + n_v) / np.sqrt(2 + 2 * dot), 1)
    return float((charlie(n_l, np.array(n_v), n_h, roughness) * n_l * 2 * u).mean() * 2 * np.pi)


def ball() -> Floats:
    """Normals of the ball's pixels, NaN beside it: (SIDE, SIDE, 3)."""
    place = ((np.arange(SIDE) + 0.5) / SIDE - 0.5) * 2.2
    x, y = np.meshgrid(place, -place)
    with np.errstate(invalid="ignore"):
        return np.stack([x, y, np.sqrt(1 - x**2 - y**2)], axis=-1)


@pytest.fixture
def drawn(session: rg.Session, shared: Path, tmp_path: Path) -> Callable[..., Floats]:
    """`drawn(pipeline, material, *sets, white=…)`: radiance of the ball, in white light or that of its lamp."""

    def draw(pipeline: str, material: str, *sets: str, white: bool = False) -> Floats:
        (tmp_path / "ball.yaml").write_text(BALL % material)
        around = shared / "reference" / "b5_ibl" / "env_white.exr" if white else None
        sets = (*sets, "light.terms=ambient") if white else (*sets, "light.environment=null", "light.ambient=0")
        sets = (*sets, "light.lookup=null") if pipeline == "forward" else sets
        loaded = rg.load(pipeline, scene=tmp_path / "ball.yaml", sets=sets, size=(SIDE, SIDE), environment=around)
        return np.asarray(session.render(loaded, outputs=["radiance"])["radiance"], np.float64)[..., :3]

    return draw


@pytest.mark.parametrize("roughness", [0.3, 0.8])
def test_sheen_reflects_its_albedo_in_white_light(drawn: Callable[..., Floats], roughness: float) -> None:
    n_v = ball()[..., 2]
    inside = n_v > 0.2
    expected = [min(sheen_albedo(roughness, cosine), 1) for cosine in n_v[inside][::29]]
    np.testing.assert_allclose(drawn("forward", SHEEN % roughness, white=True)[inside][::29, 0], expected, atol=0.01)
    assert max(expected) > 0.25


@pytest.mark.nightly(keep=1)
@pytest.mark.parametrize("pipeline", ["forward", "deferred"])
def test_layers_over_white_are_white_in_white_light(drawn: Callable[..., Floats], pipeline: str) -> None:
    """Each layer takes from what lies below just what it reflects, also where fibres alone would reflect too much."""
    layers = "base_color: 1, specular: 0, sheen_color: 1, sheen_roughness: 0.1, clearcoat: 1, clearcoat_roughness: 0.3"
    picture = drawn(pipeline, layers, white=True)
    np.testing.assert_allclose(picture[ball()[..., 2] > 0.1], 1, atol=0.004)
    film = drawn("forward", "base_color: 0.7, metallic: 1, roughness: 0.2, iridescence: 1", white=True)
    assert film.max() <= 1.004
    assert np.ptp(film[ball()[..., 2] > 0.1], axis=-1).max() > 0.15, "the film is coloured"


@pytest.mark.nightly(keep=1)
@pytest.mark.parametrize("pipeline", ["forward", "deferred"])
def test_light_of_a_lamp_on_coat_and_sheen(drawn: Callable[..., Floats], pipeline: str) -> None:
    normal, light, view = ball(), np.array([0.3, 0.4, 1]) / np.linalg.norm([0.3, 0.4, 1]), np.array([0, 0, 1.0])
    half = (light + view) / np.linalg.norm(light + view)
    n_l, n_v, n_h = normal @ light, normal @ view, normal @ half
    lit = (n_l > 0.15) & (n_v > 0.15)
    n_l, n_v, n_h = n_l[lit], n_v[lit], n_h[lit]

    a2 = 0.4**4
    smith = 0.5 / (n_l * np.sqrt(n_v**2 * (1 - a2) + a2) + n_v * np.sqrt(n_l**2 * (1 - a2) + a2))
    lobe = a2 / (np.pi * (n_h**2 * (a2 - 1) + 1) ** 2) * smith * (0.04 + 0.96 * (1 - half @ view) ** 5)
    coat = drawn(pipeline, COAT % (0.7, 0.4))[lit][:, 0]
    np.testing.assert_allclose(coat, 3 * 0.7 * lobe * n_l, atol=0.006 * coat.max())

    sheen = drawn(pipeline, SHEEN % 0.6)[lit][:, 0]
    np.testing.assert_allclose(sheen, 3 * charlie(n_l, n_v, n_h, 0.6) * n_l, atol=0.006 * sheen.max())

    def reflected(cosine: Floats) -> Floats:
        return np.asarray(0.04 + 0.96 * (1 - cosine) ** 5)

    both = drawn(pipeline, "base_color: 1, specular: 0, clearcoat: 1, clearcoat_roughness: 0.4")[lit][:, 0]
    below = 3 * n_l / np.pi * (1 - np.maximum(reflected(n_l), reflected(n_v)))
    np.testing.assert_allclose(both, below + 3 * lobe * n_l, atol=0.006 * both.max())


def test_light_of_a_lamp_below_sheen(drawn: Callable[..., Floats]) -> None:
    """The base is left what sheen does not reflect towards lamp or viewer, whichever is less."""
    normal, light, view = ball(), np.array([0.3, 0.4, 1]) / np.linalg.norm([0.3, 0.4, 1]), np.array([0, 0, 1.0])
    lit = (normal @ light > 0.2) & (normal @ view > 0.2)
    n_l, n_v = (normal[lit] @ light)[::23], (normal[lit] @ view)[::23]
    n_h = (normal[lit] @ ((light + view) / np.linalg.norm(light + view)))[::23]
    albedo = [max(sheen_albedo(0.8, one), sheen_albedo(0.8, other)) for one, other in zip(n_l, n_v, strict=True)]
    expected = 3 * n_l * ((1 - 0.9 * np.array(albedo)) / np.pi + 0.5 * charlie(n_l, n_v, n_h, 0.8))
    paint = "base_color: 1, specular: 0, sheen_color: [0.5, 0.9, 0.2], sheen_roughness: 0.8"
    found = drawn("forward", paint)[lit][::23, 0]
    np.testing.assert_allclose(found, expected, atol=0.006 * expected.max())


def test_sheen_is_the_published_lobe_and_reciprocal(evaluate: Evaluate) -> None:
    random = np.random.default_rng(5)
    n_l, n_v = random.uniform(0.02, 1, (2, 500))
    n_h = random.uniform(0.3, 0.99, 500)
    given = {"n_l": n_l, "n_v": n_v, "n_h": n_h}
    made = evaluate(
        "sheen.glsl",
        given,
        "result = vec4(charlie_brdf(n_l, n_v, n_h, 0.4), charlie_brdf(n_v, n_l, n_h, 0.4), 0.0, 0.0);",
    )
    np.testing.assert_allclose(made[:, 0], charlie(n_l, n_v, n_h, 0.4), rtol=2e-3)
    np.testing.assert_allclose(made[:, 0], made[:, 1], rtol=1e-5)


def film(ior: float, thickness: float, f0: float, cosine: float) -> Floats:
    """Linear sRGB of a film in white light, from Airy's sum at each wavelength and the observer's sensitivity.

    The observer is the fit of C. Wyman, P. Sloan and P. Shirley, "Simple Analytic Approximations to the CIE XYZ Color
    Matching Functions", 2013; white is that of equal energy, divided out in each of X, Y and Z.
    """
    wave = np.arange(380.0, 781.0, 1.0)
    inner = np.sqrt(1 - (1 - cosine**2) / ior**2)
    outer0 = ((ior - 1) / (ior + 1)) ** 2
    base = (1 + np.sqrt(f0)) / (1 - np.sqrt(f0))
    inner0 = ((base - ior) / (base + ior)) ** 2
    r1 = -np.sqrt(outer0 + (1 - outer0) * (1 - cosine) ** 5)
    r2 = np.sqrt(inner0 + (1 - inner0) * (1 - inner) ** 5) * (-1 if base > ior else 1)
    turn = np.exp(2j * np.pi * 2 * ior * thickness * inner / wave)
    reflected = np.abs((r1 + r2 * turn) / (1 + r1 * r2 * turn)) ** 2

    def bump(center: float, low: float, high: float) -> Floats:
        return np.asarray(np.exp(-0.5 * ((wave - center) * np.where(wave < center, low, high)) ** 2))

    x = 1.056 * bump(599.8, 0.0264, 0.0323) + 0.362 * bump(442.0, 0.0624, 0.0374) - 0.065 * bump(501.1, 0.0490, 0.0382)
    y = 0.821 * bump(568.8, 0.0213, 0.0247) + 0.286 * bump(530.9, 0.0613, 0.0322)
    z = 1.217 * bump(437.0, 0.0845, 0.0278) + 0.681 * bump(459.0, 0.0385, 0.0725)
    xyz = np.array([(reflected * curve).sum() / curve.sum() for curve in (x, y, z)])
    to_rgb = np.array(
        [[3.2404542, -1.5371385, -0.4985314], [-0.969266, 1.8760108, 0.041556], [0.0556434, -0.2040259, 1.0572252]]
    )
    return np.asarray((to_rgb @ xyz) / (to_rgb @ np.ones(3)))


def test_films_have_the_colours_of_airys_sum(evaluate: Evaluate) -> None:
    rows = [
        (i, t, f, c) for i in (1.3, 1.8) for t in (150, 280, 400, 550) for f in (0.04, 0.3, 0.8) for c in (0.5, 1.0)
    ]
    ior, thickness, f0, cosine = np.array(rows).T
    given = {"ior": ior, "thickness": thickness, "f0": f0, "cosine": cosine}
    made = evaluate(
        "iridescence.glsl", given, "result = vec4(film_reflectance(ior, thickness, vec3(f0), cosine), 1.0);"
    )
    expected = np.clip([film(*row) for row in rows], 0, 1)
    assert np.abs(made[:, :3] - expected).mean() < 0.02
    assert np.abs(made[:, :3] - expected).max() < 0.1


WINDOW = """scene: 1
objects:
  left: {shape: box, size: [4, 8, 0.1], at: [-2, 0, -2.05], material: bright}
  right: {shape: box, size: [4, 8, 0.1], at: [2, 0, -2.05], material: dim}
  pane: {shape: plane, size: [1, 1], at: [0, 0, 0], rotate_degrees: [90, 0, 0], scale: 2, material: pane}
  turned: {shape: plane, size: [2, 2], at: [0, 0, 0], rotate_degrees: [90, %s, 0], material: pane, hidden: %s}
materials:
  bright: {base_color: 0, specular: 0, emissive: [0.8, 0.8, 0.8]}
  dim: {base_color: 0, specular: 0, emissive: [0.2, 0.2, 0.2]}
  pane: {roughness: %s, transmission: 1, double_sided: true, %s}
lights: {lamp: {type: point, at: [0, 50, 0], intensity: 0}}
cameras: {main: {eye: [0, 0, 4], target: [0, 0, 0], height: 2}}
"""


@pytest.mark.nightly(keep=1)
@pytest.mark.parametrize("pipeline", ["forward", "deferred"])
def test_a_volume_tints_by_its_depth(session: rg.Session, tmp_path: Path, pipeline: str) -> None:
    """Of an index of refraction of 1 nothing is reflected: base colour times what is left of 2 × 0.3 m, at scale 2."""
    values = (
        "base_color: [0.9, 0.5, 1], ior: 1, thickness: 0.3, attenuation_color: [0.5, 0.25, 1], attenuation_distance: 1"
    )
    (tmp_path / "window.yaml").write_text(WINDOW % (0, "true", 0, values))
    sets = ("light.environment=null", "light.ambient=0")
    loaded = rg.load(pipeline, scene=tmp_path / "window.yaml", sets=sets, size=(40, 40))
    picture = np.asarray(session.render(loaded, outputs=["radiance"])["radiance"], np.float64)[..., :3]
    tint = np.array([0.9, 0.5, 1]) * np.array([0.5, 0.25, 1]) ** 0.6
    np.testing.assert_allclose(picture[:, :18], np.broadcast_to(0.8 * tint, (40, 18, 3)), rtol=6e-3)
    np.testing.assert_allclose(picture[:, 22:], np.broadcast_to(0.2 * tint, (40, 18, 3)), rtol=6e-3)


def test_a_turned_pane_moves_what_is_behind_it_by_snells_law(session: rg.Session, tmp_path: Path) -> None:
    """And roughness blurs it; in the middle of the picture, where the two walls meet."""
    angle, ior, thickness = np.radians(35), 1.5, 0.5
    sets = ("light.environment=null", "light.ambient=0", "light.terms=all")

    def row(roughness: float, dispersion: float = 0) -> Floats:
        values = f"base_color: 1, ior: {ior}, thickness: {thickness}, dispersion: {dispersion}"
        text = WINDOW % (35, "false", roughness, values)
        (tmp_path / "window.yaml").write_text(text.replace("  pane: {shape", "  other: {hidden: true, shape"))
        loaded = rg.load("forward", scene=tmp_path / "window.yaml", sets=sets, size=(200, 200))
        drawn = np.asarray(session.render(loaded, outputs=["radiance"])["radiance"], np.float64)
        return np.asarray(drawn[100])

    def edge_of(channel: Floats) -> float:
        """Metres from the middle of the picture."""
        return abs(int(np.argmax(np.abs(np.diff(channel[30:170])))) - 69) / 100

    sharp = row(0)[:, 0]
    # A ray along -z is bent towards the pane's normal, so it leaves the volume to the side by this much.
    shifts = [thickness * np.sin(angle - np.arcsin(np.sin(angle) / n)) for n in (ior, ior - 0.25, ior + 0.25)]
    inside = sharp[30:170]
    assert edge_of(sharp) == pytest.approx(shifts[0], abs=0.011)
    dispersed = row(0, 20)
    edges = [edge_of(dispersed[:, channel]) for channel in (1, 0, 2)]
    assert edges == pytest.approx(shifts, abs=0.011)
    assert edges[1] < edges[0] < edges[2], "blue is refracted most"
    assert 0.7 < inside.max() < 0.8, "less what the pane reflects"
    blurred = row(0.3)[30:170, 0]
    assert np.abs(np.diff(blurred)).max() < 0.2 * np.abs(np.diff(inside)).max()


def test_emission_shines_through_the_coat(drawn: Callable[..., Floats]) -> None:
    n_v = ball()[..., 2]
    picture = drawn("forward", "emissive: [0.5, 0.5, 0.5], clearcoat: 0.8", "light.terms=emissive")[n_v > 0.1][:, 0]
    reflected = 0.8 * (0.04 + 0.96 * (1 - n_v[n_v > 0.1]) ** 5)
    np.testing.assert_allclose(picture, 0.5 * (1 - reflected), atol=5e-3)


def test_a_lamp_on_a_film_is_seen_in_the_films_colour(drawn: Callable[..., Floats]) -> None:
    """Viewer and light are the same all over the ball, and so is the angle to the half vector."""
    paint = "base_color: 0.5, metallic: 1, roughness: 0.6, iridescence_ior: 1.4, iridescence_thickness: [100, 300]"
    plain, coloured = (drawn("forward", f"{paint}, iridescence: {factor}") for factor in (0, 1))
    light = np.array([0.3, 0.4, 1]) / np.linalg.norm([0.3, 0.4, 1])
    cosine = float(np.sqrt((1 + light[2]) / 2))
    lit = plain[..., 0] > 0.1
    ratio = coloured[lit] / plain[lit]
    expected = film(1.4, 300, 0.5, cosine) / (0.5 + 0.5 * (1 - cosine) ** 5)
    np.testing.assert_allclose(ratio, np.broadcast_to(expected, ratio.shape), atol=0.08)
    assert np.ptp(expected) > 0.2
