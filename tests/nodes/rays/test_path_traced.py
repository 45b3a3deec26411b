"""Path tracing: what it shows where the answer is known, how its noise falls, and whether it knows its noise."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import OpenImageIO as oiio
import pytest
from msgspec.structs import replace

import rendergraph as rg

Image = npt.NDArray[np.float64]
OUTPUTS = ("radiance", "variance", "samples_taken")


def traced(
    session: rg.Session,
    scene: str | Path,
    settings: dict[str, Any],
    size: tuple[int, int] = (32, 18),
    frames: int = 1,
    environment: str | Path | None = None,
) -> list[dict[str, Image]]:
    """The outputs after each frame of a scene, which is a shipped one, a file or text, traced with these settings."""
    given: dict[str, Any] = {} if environment is None else {"environment": environment}
    pipeline = rg.load("path-traced", scene=scene, size=size, **given)
    for name, value in settings.items():
        pipeline = pipeline.set(name if "." in name else f"light.{name}", value)
    shown = session.frames(pipeline, frames=range(1, frames + 1), warm_up=False, still=True)
    return [{name: frame.arrays[name].astype(np.float64) for name in OUTPUTS} for frame in shown]


def light(session: rg.Session, scene: str | Path, settings: dict[str, Any], **options: Any) -> Image:
    image = traced(session, scene, settings, **options)[-1]["radiance"][..., :3]
    assert np.isfinite(image).all()
    return image


def scene_file(folder: Path, text: str) -> Path:
    file = folder / "scene.yaml"
    file.write_text(f"scene: 1\n{text}")
    return file


def white_environment(folder: Path) -> Path:
    """A picture of radiance 1 from all sides."""
    file = folder / "white.exr"
    image = oiio.ImageBuf(oiio.ImageSpec(32, 16, 3, "half"))
    image.set_pixels(oiio.ROI(), np.ones((16, 32, 3), np.float32))
    image.write(str(file))
    return file


# The furnace ---------------------------------------------------------------------------------------------------------


def microfacets(roughness: float, angle: float, f0: float, grain: float = 0.0, along: float = 0.0) -> float:
    """Directional albedo of the specular lobe in float64, from normals spread as GGX has them (Walter et al. 2007).

    Args:
        roughness: perceptual.
        angle: between normal and viewer, radians.
        f0: reflectance at normal incidence; 1 at grazing incidence.
        grain: strength of the anisotropy.
        along: angle between the tangent and the plane of incidence, radians.
    """
    b = max(roughness**2, 0.001)
    t = b + (1 - b) * grain**2
    u, w = np.meshgrid((np.arange(1500) + 0.5) / 1500, (np.arange(500) + 0.5) / 500)
    phi = np.arctan2(b * np.sin(2 * np.pi * w), t * np.cos(2 * np.pi * w))
    tan2 = u / (1 - u) / ((np.cos(phi) / t) ** 2 + (np.sin(phi) / b) ** 2)
    cos_h = 1 / np.sqrt(1 + tan2)
    sin_h = np.sqrt(1 - cos_h**2)
    h = np.stack([sin_h * np.cos(phi), sin_h * np.sin(phi), cos_h])
    v = np.array([np.sin(angle) * np.cos(along), np.sin(angle) * np.sin(along), np.cos(angle)])
    VoH = np.einsum("i...,i", h, v)
    x, y, NoL = 2 * VoH * h - v[:, None, None]
    NoV = v[2]
    masked = 0.5 / (
        NoL * np.linalg.norm([t * v[0], b * v[1], NoV]) + NoV * np.sqrt((t * x) ** 2 + (b * y) ** 2 + NoL**2)
    )
    fresnel = f0 + (1 - f0) * (1 - np.clip(VoH, 0, 1)) ** 5
    return float(np.where((NoL > 0) & (VoH > 0), fresnel * masked * 4 * NoL * VoH / cos_h, 0).mean())


def phong_highlight(n: float) -> float:
    """Of light from all sides over π, seen along the normal."""
    return 2 / (n + 1)


def blinn_highlight(n: float) -> float:
    """Likewise, with the exponent 4 n."""
    return 8 / (4 * n + 2) * (1 - 2 ** -(2 * n + 1))


MATERIALS = {
    "matte": "base_color: [0.6, 0.6, 0.6], roughness: 1, specular: 0",
    "plastic": "base_color: [0.5, 0.5, 0.5], roughness: 0.3",
    "metal": "base_color: [0.9, 0.9, 0.9], metallic: 1, roughness: 0.5",
    "mirror": "base_color: [0.9, 0.9, 0.9], metallic: 1, roughness: 0",
    "rough": "base_color: [0.9, 0.9, 0.9], metallic: 1, roughness: 1",
    "brushed": "base_color: [0.9, 0.9, 0.9], metallic: 1, roughness: 0.4, anisotropy_strength: 0.7",
}


LAYERS = {
    "coat": "base_color: [0, 0, 0], specular: 0, clearcoat: 1, clearcoat_roughness: 0.4",
    "cloth": "base_color: [0, 0, 0], specular: 0, sheen_color: [1, 1, 1], sheen_roughness: 0.6",
    "pane": "base_color: [1, 1, 1], roughness: 0.3, transmission: 1",
    "grating": "base_color: [1, 1, 1], roughness: 0.5, metallic: 1, iridescence: 1, iridescence_ior: 1.8",
}


def sheen_albedo(roughness: float, angle: float) -> float:
    """Directional albedo of white sheen in float64 (Estevez and Kulla 2017), from midpoints in the root of NoL."""
    alpha, n_v = roughness**2, np.cos(angle)
    t = (1 - alpha) ** 2
    a, b, c = (low + (high - low) * t for low, high in ((21.5473, 25.3245), (3.82987, 3.32435), (0.19823, 0.16801)))
    d, e = (low + (high - low) * t for low, high in ((-1.97760, -1.27393), (-4.32054, -4.85967)))

    def masking(x: Any) -> Any:
        def fit(x: Any) -> Any:
            return a / (1 + b * x**c) + d * x + e

        return np.exp(np.where(x < 0.5, fit(x), 2 * fit(0.5) - fit(np.maximum(1 - x, 1e-5))))

    u, azimuth = np.meshgrid((np.arange(400) + 0.5) / 400, (np.arange(400) + 0.5) / 400 * np.pi)
    n_l = u**2
    dot = np.sqrt((1 - n_l**2) * (1 - n_v**2)) * np.cos(azimuth) + n_l * n_v
    n_h = np.minimum((n_l + n_v) / np.sqrt(2 + 2 * dot), 1)
    lobe = (2 + 1 / alpha) * np.sqrt(1 - n_h**2) ** (1 / alpha) / (2 * np.pi)
    return float((lobe / ((1 + masking(n_l) + masking(n_v)) * 4 * n_v) * 2 * u).mean() * 2 * np.pi)


def furnace(
    session: rg.Session,
    folder: Path,
    settings: dict[str, Any],
    degrees: float,
    samples: int,
    materials: dict[str, str] = MATERIALS,
    **options: Any,
) -> dict[str, float]:
    """The mean radiance of a tile of each material, seen under an angle, with light of 1 from all sides."""
    slope = np.radians(degrees)
    eye = f"[0, {5 * np.cos(slope)}, {5 * np.sin(slope)}]"
    text = f"cameras: {{main: {{height: 0.5, eye: {eye}, target: [0, 0, 0], up: [0, 0, -1]}}}}\n"
    text += "lights: {none: {type: point, intensity: 0, at: [0, 9, 0]}}\nmaterials:\n"
    text += "".join(f"  {name}: {{{values}}}\n" for name, values in materials.items())
    text += "objects:\n"
    for number, name in enumerate(materials):
        text += f"  {name}: {{shape: plane, size: [0.98, 9], at: [{number - len(materials) / 2 + 0.5}, 0, 0], material: {name}}}\n"
    given = {"max_bounces": 0, "samples": samples, "ambient": 1, "antialiasing": False, **settings}
    image = light(session, scene_file(folder, text), given, size=(12 * len(materials), 6), **options)
    if materials is MATERIALS:
        assert abs(image - image[..., :1]).max() < 1e-5
    # A tile is 12 pixels wide, of which the outer ones show its edge.
    return {name: float(image[:, 12 * i + 1 : 12 * i + 11].mean()) for i, name in enumerate(materials)}


def albedos(degrees: float) -> dict[str, float]:
    angle = np.radians(degrees)
    return {
        "matte": 0.6,
        "plastic": 0.5 + microfacets(0.3, angle, 0.04),
        "metal": microfacets(0.5, angle, 0.9),
        "mirror": microfacets(0.0, angle, 0.9),
        "rough": microfacets(1.0, angle, 0.9),
        "brushed": microfacets(0.4, angle, 0.9, 0.7, np.pi / 2),
    }


@pytest.mark.nightly(keep=1)
@pytest.mark.parametrize("degrees", [60, 0])
def test_every_lobe_reflects_its_directional_albedo(session: rg.Session, tmp_path: Path, degrees: float) -> None:
    found = furnace(session, tmp_path, {}, degrees, 256)
    assert found == pytest.approx(albedos(degrees), rel=0.01)


def layer_albedos(degrees: float) -> dict[str, float]:
    angle = np.radians(degrees)
    return {
        "coat": microfacets(0.4, angle, 0.04),
        "cloth": min(sheen_albedo(0.6, angle), 1.0),
        "pane": microfacets(0.3, angle, 1.0),
        "grating": microfacets(0.5, angle, 1.0),
    }


@pytest.mark.parametrize(("samples", "error"), [(64, 0.02), pytest.param(16384, 0.003, marks=pytest.mark.nightly)])
def test_every_layer_reflects_and_transmits_its_albedo(
    session: rg.Session, tmp_path: Path, samples: int, error: float
) -> None:
    """A thin pane lets through what it does not reflect, and a film on a perfect mirror reflects everything."""
    assert furnace(session, tmp_path, {"background": 1}, 50, samples, LAYERS) == pytest.approx(
        layer_albedos(50), rel=error
    )


VIEW = """
lights: {none: {type: point, intensity: 0, at: [0, 9, 0]}}
cameras: {main: {height: %s, eye: [0, 0, 5], target: [0, 0, 0]}}
"""


@pytest.mark.nightly
def test_a_glass_ball_neither_takes_nor_adds_light(session: rg.Session, tmp_path: Path) -> None:
    """Where total reflection, refraction and dispersion are all right, the ball is invisible in white light."""
    text = VIEW % 1.5 + "materials: {glass: {base_color: 1, roughness: 0, ior: 1.7, %s}}\n"
    text += "objects: {ball: {shape: sphere, radius: 1, segments: 64, material: glass}}\n"
    values = "transmission: 1, thickness: 1, dispersion: 4"
    given = {"max_bounces": 2, "samples": 64, "ambient": 1, "background": 1}
    image = light(session, scene_file(tmp_path, text % values), given, size=(16, 9))
    assert image.mean() == pytest.approx(1, abs=0.01)
    np.testing.assert_allclose(image.mean(axis=(0, 1)), 1, atol=0.03)


def test_a_volume_absorbs_along_its_depth(session: rg.Session, tmp_path: Path) -> None:
    """Light between two boundaries of reflectance F: F + (1 - F)² a / (1 - F a), with a passing through the depth."""
    text = VIEW % 0.5 + "materials: {ink: {base_color: 1, roughness: 0, transmission: 1, thickness: 9,"
    text += " attenuation_distance: 2, attenuation_color: [0.2, 0.5, 0.8]}}\n"
    text += "objects: {slab: {shape: box, size: [3, 3, 1.5], material: ink}}\n"
    given = {"max_bounces": 0, "samples": 256, "ambient": 1, "background": 1}
    image = light(session, scene_file(tmp_path, text), given, size=(16, 9))
    passed, fresnel = np.array([0.2, 0.5, 0.8]) ** (1.5 / 2), 0.04
    expected = fresnel + (1 - fresnel) ** 2 * passed / (1 - fresnel * passed)
    np.testing.assert_allclose(image.mean(axis=(0, 1)), expected, rtol=0.01)


@pytest.mark.nightly
def test_a_turned_pane_moves_what_is_behind_it_by_snells_law(session: rg.Session, tmp_path: Path) -> None:
    angle, ior, depth = np.radians(35), 1.5, 0.5
    text = (
        VIEW % 2 + f"materials:\n  glass: {{base_color: 1, roughness: 0, ior: {ior}, transmission: 1, thickness: 1}}\n"
    )
    text += "  glow: {base_color: 0, emissive: [1, 1, 1]}\nobjects:\n"
    text += f"  pane: {{shape: box, size: [3, 9, {depth}], rotate_degrees: [0, 35, 0], material: glass}}\n"
    text += "  glow: {shape: box, size: [9, 9, 0.1], at: [4.5, 0, -4], material: glow}\n"
    given = {"max_bounces": 0, "samples": 64, "ambient": 0, "sources": "emissive", "antialiasing": False}
    row = light(session, scene_file(tmp_path, text), given, size=(128, 64))[32, 38:90, 0]
    edge = (int(np.argmax(np.abs(np.diff(row)))) + 39 - 64) / 32
    shift = depth * np.sin(angle - np.arcsin(np.sin(angle) / ior)) / np.cos(np.arcsin(np.sin(angle) / ior))
    assert abs(edge) == pytest.approx(shift, abs=1 / 32)


BALLS = {
    "coat": "base_color: [0.2, 0.3, 0.6], clearcoat: 0.8, clearcoat_roughness: 0.3",
    "cloth": "base_color: [0.5, 0.2, 0.2], sheen_color: [0.6, 0.7, 0.9], sheen_roughness: 0.5",
    "film": "base_color: [0.5, 0.5, 0.5], metallic: 1, roughness: 0.4, iridescence: 1, iridescence_ior: 1.4",
    "grain": "base_color: [0.9, 0.6, 0.3], metallic: 1, roughness: 0.3, anisotropy_strength: 0.7",
    "gem": "base_color: [0.1, 0.1, 0.1], ior: 2, specular: 0.7, specular_color: [1, 0.5, 0.2], roughness: 0.4",
}


def test_light_of_a_lamp_on_layers_is_that_of_forward_lighting(session: rg.Session, tmp_path: Path) -> None:
    """Both have no noise there. Facets of the balls are lit by their normals, so they differ near the terminator."""
    text = "cameras: {main: {height: 2, eye: [0, 0, 9], target: [0, 0, 0]}}\n"
    text += "lights: {sun: {type: directional, direction: [-0.3, -0.4, -1], intensity: 3}}\nmaterials:\n"
    text += "".join(f"  {name}: {{{values}}}\n" for name, values in BALLS.items()) + "objects:\n"
    for number, name in enumerate(BALLS):
        text += (
            f"  {name}: {{shape: sphere, segments: 64, radius: 1, at: [{2 * number - 4}, 0, 0], material: {name}}}\n"
        )
    file = scene_file(tmp_path, text)
    given = {"max_bounces": 0, "samples": 1, "sources": "lights", "antialiasing": False, "backdrop": False}
    traced_light = light(session, file, given, size=(120, 24), environment="none")
    sets = ("light.lookup=null", "light.environment=null", "light.ambient=0")
    forward = rg.load("forward", scene=file, size=(120, 24), sets=sets, environment="none")
    drawn = session.render(forward, outputs=["radiance"])["radiance"][..., :3].astype(np.float64)
    x, y = np.meshgrid((np.arange(120) % 24 - 11.5) / 12, (np.arange(24) - 11.5) / 12)
    bright = x**2 + y**2 < 0.5
    np.testing.assert_allclose(traced_light[bright], drawn[bright], rtol=2e-3, atol=1e-3)
    assert drawn[bright].mean() > 0.1


def test_the_environment_lights_like_constant_light_of_its_radiance(session: rg.Session, tmp_path: Path) -> None:
    found = furnace(session, tmp_path, {}, 60, 256, environment=white_environment(tmp_path))
    assert found == pytest.approx(albedos(60), rel=0.01)


@pytest.mark.nightly
@pytest.mark.parametrize("degrees", [0, 45, 75])
@pytest.mark.parametrize("lit_by", ["ambient", "environment"])
def test_every_lobe_reflects_its_albedo_within_three_per_mille(
    session: rg.Session, tmp_path: Path, degrees: float, lit_by: str
) -> None:
    white = white_environment(tmp_path) if lit_by == "environment" else None
    found = furnace(session, tmp_path, {}, degrees, 8192, environment=white)
    assert found == pytest.approx(albedos(degrees), rel=0.003)


@pytest.mark.nightly(keep=1)
@pytest.mark.parametrize("degrees", [60, 0])
def test_a_shared_diffuse_lobe_reflects_what_the_specular_lobe_leaves(
    session: rg.Session, tmp_path: Path, degrees: float
) -> None:
    found = furnace(session, tmp_path, {"diffuse_lobe": "shared"}, degrees, 256)
    specular = microfacets(0.3, np.radians(degrees), 0.04)
    assert found["plastic"] == pytest.approx(0.5 * (1 - specular) + specular, rel=0.01)
    assert found["metal"] == pytest.approx(albedos(degrees)["metal"], rel=0.01)


@pytest.mark.nightly(keep=1)
@pytest.mark.parametrize(("model", "highlight"), [("phong", phong_highlight), ("blinn_phong", blinn_highlight)])
def test_empirical_models_reflect_no_more_than_they_say(
    session: rg.Session, tmp_path: Path, model: str, highlight: Any
) -> None:
    """Of the same material: kd is the base colour, ks 0.04, and n follows from the roughness."""
    found = furnace(session, tmp_path, {"shading": model}, 0, 256)
    alpha = 0.3**2
    n = 0.5 / alpha**2 - 0.5
    assert found["plastic"] == pytest.approx(0.5 + 0.04 * highlight(n), rel=0.01)


# Emissive surfaces ---------------------------------------------------------------------------------------------------


def corner_form_factor(a: float, b: float, height: float) -> float:
    """Of a rectangle a by b that lies parallel over a point, one corner straight above it (Howell, B-3)."""
    x, y = a / height, b / height
    p, q = np.sqrt(1 + x * x), np.sqrt(1 + y * y)
    return float((x / p * np.arctan(y / p) + y / q * np.arctan(x / q)) / (2 * np.pi))


FLOOR = """
cameras: {{main: {{eye: [0, 0.5, 0.02], target: [0, 0, 0], fov_y_degrees: 0.2, near: 0.01}}}}
lights: {{none: {{type: point, intensity: 0, at: [0, 9, 0]}}}}
materials:
  grey: {{base_color: [0.5, 0.5, 0.5], specular: 0, roughness: 1}}
  lamp: {{base_color: [0, 0, 0], specular: 0, emissive: [2, 4, 6]}}
objects:
  floor: {{shape: plane, size: [9, 9], material: grey}}
  lamp: {lamp}
"""


@pytest.mark.parametrize(
    ("lamp", "factor", "allowed"),
    [
        (
            "{shape: plane, size: [0.6, 1], at: [0, 0.8, 0], rotate_degrees: [180, 0, 0], material: lamp}",
            4 * corner_form_factor(0.3, 0.5, 0.8),
            0.01,
        ),
        ("{shape: sphere, radius: 0.4, at: [0, 1.5, 0], material: lamp}", (0.4 / 1.5) ** 2, 0.015),
    ],
    ids=["rectangle", "sphere"],
)
def test_an_emissive_surface_lights_by_its_form_factor(
    session: rg.Session, tmp_path: Path, lamp: str, factor: float, allowed: float
) -> None:
    settings = {"max_bounces": 0, "samples": 64, "ambient": 0, "sources": "emissive"}
    image = light(session, scene_file(tmp_path, FLOOR.format(lamp=lamp)), settings, size=(16, 16))
    assert image.mean(axis=(0, 1)) == pytest.approx(0.5 * factor * np.array([2, 4, 6]), rel=allowed)


@pytest.mark.nightly(keep=1)
@pytest.mark.parametrize(("mode", "part"), [("blend", 0.25), ("mask", 0)])
def test_a_lamp_emits_as_much_light_as_it_is_opaque(
    session: rg.Session, tmp_path: Path, mode: str, part: float
) -> None:
    lamp = "{shape: plane, size: [1, 1], at: [0, 0.8, 0], rotate_degrees: [180, 0, 0], material: lamp}"
    settings = {"max_bounces": 0, "samples": 64, "ambient": 0, "sources": "emissive"}
    text = FLOOR.format(lamp=lamp).replace("[0, 0, 0], specular", f"[0, 0, 0, 0.25], alpha_mode: {mode}, specular")
    expected = 0.5 * 4 * corner_form_factor(0.5, 0.5, 0.8) * part * np.array([2, 4, 6])
    image = light(session, scene_file(tmp_path, text), settings, size=(16, 16))
    assert image.mean(axis=(0, 1)) == pytest.approx(expected, rel=0.02)


# Awkward surfaces ----------------------------------------------------------------------------------------------------


def test_surfaces_that_turn_away_from_the_viewer_are_sampled_with_their_density(
    session: rg.Session, tmp_path: Path
) -> None:
    """A tile whose vertex normals point 70 degrees aside: as much light as a sum over all directions finds."""
    n = np.array([np.sin(np.radians(70)), np.cos(np.radians(70)), 0])
    mesh = "v -1 0 -1\nv -1 0 1\nv 1 0 1\nv 1 0 -1\nvn {} {} {}\nf 1//1 2//1 3//1 4//1\n".format(*n)
    (tmp_path / "tile.obj").write_text(mesh)
    text = """
cameras: {main: {eye: [-4, 2, 0], target: [0, 0, 0], fov_y_degrees: 0.2}}
lights: {none: {type: point, intensity: 0, at: [0, 9, 0]}}
materials: {metal: {base_color: [0.9, 0.9, 0.9], metallic: 1, roughness: 0.4}}
objects: {tile: {file: tile.obj, material: metal}}
"""
    settings = {"ambient": 1, "max_bounces": 0, "samples": 1024}
    image = light(session, scene_file(tmp_path, text), settings, size=(8, 8))
    y, phi = np.meshgrid((np.arange(800) + 0.5) / 800, 2 * np.pi * (np.arange(800) + 0.5) / 800)
    r = np.sqrt(1 - y * y)
    to_light = np.stack([r * np.cos(phi), y, r * np.sin(phi)], axis=-1)
    v = np.array([-4, 2, 0]) / np.sqrt(20)
    h = (to_light + v) / np.linalg.norm(to_light + v, axis=-1, keepdims=True)
    NoL, NoV, NoH, VoH, a = np.maximum(to_light @ n, 0), 1e-4, np.maximum(h @ n, 0), h @ v, 0.4**2
    spread = a * a / np.pi / ((np.cross(h, n) ** 2).sum(axis=-1) + (NoH * a) ** 2) ** 2
    masked = 0.5 / (NoL * np.sqrt(NoV**2 * (1 - a * a) + a * a) + NoV * np.sqrt(NoL**2 * (1 - a * a) + a * a))
    expected = 2 * np.pi * ((0.9 + 0.1 * (1 - VoH) ** 5) * spread * masked * NoL).mean()
    assert image.mean() == pytest.approx(expected, rel=0.02)


def test_light_is_the_same_at_any_scale(session: rg.Session, tmp_path: Path) -> None:
    text = """
cameras: {{main: {{eye: [0, {0}, {3}], target: [0, {0}, 0], near: {1}, far: {4}}}}}
lights: {{sun: {{type: directional, direction: [0.8, -0.5, -0.6], intensity: 3}}}}
materials: {{white: {{base_color: [0.8, 0.8, 0.8], specular: 0, roughness: 1}}}}
objects:
  floor: {{shape: plane, size: [{2}, {2}], material: white}}
  wall: {{shape: plane, size: [{2}, {2}], at: [0, {0}, -{0}], rotate_degrees: [90, 0, 0], material: white}}
"""
    images = []
    for scale in (1, 1e4, 1e-4):
        scaled = text.format(*(scale * length for length in (1, 0.05, 2, 3.2, 50)))
        settings = {"ambient": 0.2, "max_bounces": 1, "samples": 16}
        images.append(light(session, scene_file(tmp_path, scaled), settings, size=(32, 18)))
    for image in images[1:]:
        assert np.isclose(image, images[0], atol=1e-4).mean() > 0.99  # but for edges
        assert image.mean() == pytest.approx(images[0].mean(), rel=1e-3)


def test_objects_that_are_scaled_to_a_plane_have_normals(session: rg.Session, tmp_path: Path) -> None:
    text = "objects: {flat: {shape: box, scale: [1, 0, 1]}}\n"
    assert light(session, scene_file(tmp_path, text), {"samples": 4}, size=(16, 9)).max() > 0.05


# Noise ---------------------------------------------------------------------------------------------------------------


def noise(session: rg.Session, frames: int, seeds: Sequence[int] = (0, 1)) -> list[list[dict[str, Image]]]:
    settings = {"samples": 4}
    return [traced(session, "cornell_box", {**settings, "seed": seed}, size=(48, 27), frames=frames) for seed in seeds]


@pytest.fixture(scope="module")
def two_seeds(session: rg.Session) -> list[list[dict[str, Image]]]:
    """48 frames of the Cornell box, twice."""
    return noise(session, 48)


def differences(two: list[list[dict[str, Image]]]) -> list[tuple[float, float]]:
    """After each frame the mean squared difference of two pictures, and the sum of their variances."""
    found = []
    for one, other in zip(*two, strict=True):
        square = (one["radiance"] - other["radiance"])[..., :3] ** 2
        # The brightest pixels' noise would decide alone.
        typical = np.argsort(square.sum(axis=-1).ravel())[: int(0.98 * square[..., 0].size)]
        both = (one["variance"] + other["variance"])[..., :3]
        found.append((float(square.reshape(-1, 3)[typical].mean()), float(both.mean())))
    return found


def test_noise_falls_with_the_square_root_of_the_samples(two_seeds: list[list[dict[str, Image]]]) -> None:
    squares = [square for square, _ in differences(two_seeds)]
    numbers = np.arange(1, len(squares) + 1)
    slope = np.polyfit(np.log(numbers), 0.5 * np.log(squares), 1)[0]
    assert slope == pytest.approx(-0.5, abs=0.05)


def test_the_variance_is_that_of_the_mean(two_seeds: list[list[dict[str, Image]]]) -> None:
    """The squared difference of two independent pictures is expected to be the sum of their variances."""
    one, other = (frames[-1] for frames in two_seeds)
    square = ((one["radiance"] - other["radiance"])[..., :3] ** 2).mean()
    expected = (one["variance"] + other["variance"])[..., :3].mean()
    assert square == pytest.approx(expected, rel=0.1)


def test_pictures_of_two_seeds_agree(two_seeds: list[list[dict[str, Image]]]) -> None:
    one, other = (frames[-1] for frames in two_seeds)
    assert (one["radiance"] != other["radiance"]).any()
    off = (one["radiance"] - other["radiance"])[..., :3]
    error = np.sqrt((one["variance"] + other["variance"])[..., :3])
    assert abs(off.mean()) < 3 * np.sqrt((error**2).sum()) / off.size
    assert (abs(off) < 3 * error + 1e-9).mean() > 0.98


def test_frames_add_samples_until_something_changes(session: rg.Session, tmp_path: Path) -> None:
    still = traced(session, "cornell_box", {"samples": 20}, (8, 8), 3)
    assert [frame["samples_taken"].mean() for frame in still] == [20, 40, 60]
    moving = "objects: {one: {shape: box}}\nkeyframes: {objects.one.at: {0: [0, 0, 0], 1: [0, 1, 0]}}\n"
    pipeline = rg.load("path-traced", scene=scene_file(tmp_path, moving), size=(8, 8))
    frames = session.frames(pipeline, frames=range(1, 4), warm_up=False)
    assert [frame.arrays["samples_taken"].mean() for frame in frames] == [16, 16, 16]


# Parts ---------------------------------------------------------------------------------------------------------------


@pytest.mark.nightly
@pytest.mark.parametrize(
    ("parameter", "values"),
    [("light_part", ("direct", "indirect")), ("sources", ("lights", "environment", "emissive"))],
)
def test_parts_and_sources_add_up(session: rg.Session, parameter: str, values: tuple[str, ...]) -> None:
    """In the courtyard with its sun, sky and lanterns, by means of the whole picture."""
    shared = {"samples": 16, "seed": 3}
    whole = light(session, "courtyard", shared).mean(axis=(0, 1))
    parts = [light(session, "courtyard", {**shared, parameter: value}).mean(axis=(0, 1)) for value in values]
    assert sum(parts) == pytest.approx(whole, rel=0.02)
    assert min(part.min() for part in parts) > 0.005


def test_direct_light_of_a_lamp_is_that_of_a_shadow_volume(session: rg.Session) -> None:
    """Another technique with exact shadows of a point light has the same light, and the same edges."""
    own = light(session, "cornell_box", {"max_bounces": 0, "sources": "lights", "antialiasing": False}, size=(96, 54))
    drawn = rg.load("shadow-volumes-auto", scene="cornell_box", size=(96, 54))
    drawn = drawn.set("light.ambient", 0).set("light.terms", "diffuse")
    diffuse = light(
        session,
        "cornell_box",
        {"max_bounces": 0, "sources": "lights", "antialiasing": False, "terms": "diffuse"},
        size=(96, 54),
    )
    other = session.render(drawn)["radiance"][..., :3]
    assert (own >= diffuse - 1e-6).all()
    close = np.abs(diffuse - other).max(axis=-1) < 0.01 * (0.05 + other.max(axis=-1))
    assert close.mean() > 0.98


def test_transparent_surfaces_mix_with_what_lies_behind(session: rg.Session, tmp_path: Path) -> None:
    text = """
cameras: {main: {eye: [0, 5, 0], target: [0, 0, 0], up: [0, 0, -1], fov_y_degrees: 10}}
lights: {sun: {type: directional, direction: [0, -1, 0], intensity: 3.14159265}}
materials:
  white: {base_color: [0.8, 0.8, 0.8], specular: 0, roughness: 1}
  glass: {base_color: [0, 1, 0, 0.25], specular: 0, roughness: 1, alpha_mode: blend}
objects:
  floor: {shape: plane, size: [9, 9], material: white}
  pane: {shape: plane, size: [9, 9], at: [0, 1, 0], material: glass}
"""
    image = light(session, scene_file(tmp_path, text), {"max_bounces": 0, "samples": 1024, "ambient": 0}, size=(8, 8))
    # A quarter of the pane, and three quarters of a floor on which three quarters of the light fall.
    expected = 0.25 * np.array([0, 1, 0]) + 0.75 * 0.75 * 0.8
    assert image.mean(axis=(0, 1)) == pytest.approx(expected, rel=0.01)


# Reference -----------------------------------------------------------------------------------------------------------


def reference(
    session: rg.Session, shared: Path, part: str, name: str, bounces: int, frames: int
) -> tuple[Image, Image, Image]:
    """Light away from edges, its variance, and the reference data (tests of `ssgi` take the same)."""
    here = shared / "reference" / "b4_gi" / "point"
    surfaces = np.load(here / "gbuffer.npz")
    judged = (surfaces["object"] > 0) & ~surfaces["edge"]
    settings = {
        "ambient": 0,
        "light_part": part,
        "max_bounces": bounces,
        "antialiasing": False,
        "terms": "diffuse",
        "samples": 16 if frames > 1 else 8,
    }
    found = traced(session, here / "scene.glb", settings, (192, 192), frames, environment="none")[-1]
    expected = np.asarray(oiio.ImageBuf(str(here / f"{name}.exr")).get_pixels(), np.float64)[..., :3]
    return found["radiance"][..., :3][judged], found["variance"][..., :3][judged], expected[judged]


def test_direct_light_is_that_of_the_reference(session: rg.Session, shared: Path) -> None:
    found, variance, expected = reference(session, shared, "direct", "direct", 0, 1)
    np.testing.assert_allclose(found, expected, rtol=0.01, atol=1e-4)
    assert variance.max() < 1e-8


@pytest.mark.nightly
@pytest.mark.parametrize(("part", "name", "bounces"), [("one_bounce", "one_bounce", 1), ("all", "full", 16)])
def test_interreflection_is_that_of_the_reference(
    session: rg.Session, shared: Path, part: str, name: str, bounces: int
) -> None:
    """The picture's mean and 99 % of its pixels lie within three standard errors; the reference has noise, too."""
    found, variance, expected = reference(session, shared, part, name, bounces, 24)
    own = np.sqrt(variance + (0.004 * expected) ** 2)
    assert (np.abs(found - expected) < 3 * own).mean() > 0.99
    assert abs((found - expected).mean()) < 3 * np.sqrt(variance.sum()) / variance.size + 2e-4 * expected.mean()


def test_shadow_rays_meet_all_panes_and_what_is_behind_them(session: rg.Session, tmp_path: Path) -> None:
    """Under one half-transparent pane, under two, and under one with a plate below: 1/2, 1/4 and 0 of the light."""
    (tmp_path / "panes.yaml").write_text(
        "scene: 1\n"
        "objects:\n"
        "  floor: {shape: plane, size: [9, 3], material: white}\n"
        "  upper: {shape: plane, size: [9, 3], at: [0, 2, 0], material: pane}\n"
        "  lower: {shape: plane, size: [3, 3], at: [0, 1.5, 0], material: pane}\n"
        "  plate: {shape: plane, size: [3, 3], at: [3, 1, 0], material: white}\n"
        "materials:\n"
        "  white: {base_color: 1, specular: 0, roughness: 1, double_sided: true}\n"
        "  pane: {base_color: [0, 0, 0, 0.5], specular: 0, alpha_mode: blend, double_sided: true}\n"
        "lights: {sun: {type: directional, direction: [0, -1, 0], intensity: 3}}\n"
    )
    settings = ["light.samples=4", "light.max_bounces=0", "light.ambient=0"]
    found = []
    for x in (-3, 0, 3):
        camera = f"eye={x},0.5,0 target={x},0,0 up=0,0,-1 height=1 near=0.01 far=9"
        pipeline = rg.load("path-traced", scene=tmp_path / "panes.yaml", camera=camera, size=(4, 4), sets=settings)
        found.append(float(np.asarray(session.render(pipeline, outputs=["radiance"])["radiance"])[..., 0].mean()))
    np.testing.assert_allclose(found, np.array([0.5, 0.25, 0]) * 3 / np.pi, rtol=1e-4, atol=1e-6)


def test_the_near_plane_of_an_orthographic_camera_may_be_behind_it(session: rg.Session) -> None:
    pipeline = rg.load("path-traced", scene="shapes", size=(32, 24), sets=("light.samples=4", "light.max_bounces=0"))
    with session.current():
        drawing = session.compile(pipeline, outputs=["radiance"])
        camera = replace(drawing.expanded.linked.scene.cameras["main"], type="orthographic", height=5.0)

        def seen(forward: float) -> Image:
            transform = camera.transform.copy()
            transform[:3, 3] -= forward * transform[:3, 2]
            drawing.begin()
            drawing.draw(1, replace(camera, transform=transform, near=0.05 - forward, far=50 - forward))
            return np.asarray(drawing.read()["radiance"][..., :3], np.float64)

        before_it, behind_it = seen(0.0), seen(6.0)
    assert before_it.std() > 0.05
    assert (np.abs(before_it - behind_it).max(axis=-1) > 1e-4).mean() < 0.01
