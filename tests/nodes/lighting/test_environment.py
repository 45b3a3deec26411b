"""Light from all around, as every lighting node takes it: in place of the constant, scaled by what hides it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

import rendergraph as rg

Floats = npt.NDArray[np.float64]

CONSTANT = '''
from __future__ import annotations

from rendergraph.api import EnvironmentLight, Function, Node, param

class Constant(Node):
    """The same light from everywhere."""

    light = Function(EnvironmentLight, shader="constant.glsl", doc="Light.")

    level: tuple[float, float, float] = param(default=(0.2, 0.4, 0.6), min=0, doc="Radiance.")
'''
HALF_OPEN = '''
from __future__ import annotations

from rendergraph.api import Node, Occlusion, Output

class HalfOpen(Node):
    """An occlusion that grows from left to right."""

    occlusion = Output(Occlusion, format="r32f", doc="0 to 1.")
'''
PIPELINES = ["forward", "forward-multipass", "forward-prepass", "deferred", "deferred-stencil-lights"]
FLAT = """scene: 1
objects:
  wall: {shape: plane, size: [40, 40], rotate_degrees: [90, 0, 0], material: paint}
  pane: {shape: plane, size: [1, 1], at: [0.5, 0, 1], rotate_degrees: [90, 0, 0], material: glass}
materials:
  paint: {base_color: [0.5, 0.25, 0.8], roughness: 0.6}
  glass: {base_color: [0.9, 0.3, 0.2, 0.25], alpha_mode: blend}
lights: {sun: {type: directional, direction: [0, 0, -1], intensity: 0}}
cameras: {main: {eye: [0, 0, 5], target: [0, 0, 0], height: 3}}
"""
BALL = """scene: 1
objects: {ball: {shape: sphere, radius: 1, segments: 96, rings: 48, material: paint}}
materials: {paint: {base_color: [0.7, 0.5, 0.3], roughness: 0.4, metallic: 0.5}}
lights: {sun: {type: directional, direction: [0, 0, -1], intensity: 0}}
environment: {file: studio}
cameras: {main: {eye: [0, 0, 4], target: [0, 0, 0]}}
"""


@pytest.fixture
def plugins(tmp_path: Path) -> list[Path]:
    (tmp_path / "constant.py").write_text(CONSTANT)
    (tmp_path / "constant.glsl").write_text(
        "uniform vec3 level;\nvec3 light_from(vec3 direction, float lobe) { return level; }\n"
    )
    (tmp_path / "half_open.py").write_text(HALF_OPEN)
    (tmp_path / "half_open.frag").write_text(
        "in vec2 v_uv;\nout float occlusion;\nvoid main() { occlusion = v_uv.x; }\n"
    )
    (tmp_path / "flat.yaml").write_text(FLAT)
    (tmp_path / "ball.yaml").write_text(BALL)
    return [tmp_path / "constant.py", tmp_path / "half_open.py"]


def drawn(session: rg.Session, plugins: list[Path], name: str, patch: dict[str, Any], scene: str, *sets: str) -> Floats:
    pipeline = rg.load(
        name, scene=plugins[0].parent / scene, plugins=plugins, patches=[{"nodes": patch}], sets=sets, size=(48, 36)
    )
    return np.asarray(session.render(pipeline, outputs=["radiance"])["radiance"], np.float64)


CONNECTED: dict[str, Any] = {"constant": {"type": "constant"}, "light": {"inputs": {"environment": "constant.light"}}}
HIDDEN: dict[str, Any] = {"hidden": {"type": "half_open"}, "light": {"inputs": {"occlusion": "hidden.occlusion"}}}


@pytest.mark.nightly(keep=1)
@pytest.mark.parametrize("name", PIPELINES)
@pytest.mark.parametrize("shading", ["phong", "blinn_phong"])
def test_the_same_light_from_everywhere_is_the_constant(
    session: rg.Session, plugins: list[Path], name: str, shading: str
) -> None:
    """The empirical models take nothing but its diffuse part, so that nothing but the background differs."""
    ambient, model = "light.ambient=[0.2, 0.4, 0.6]", f"light.shading={shading}"
    expected = drawn(session, plugins, name, {}, "flat.yaml", ambient, model)
    found = drawn(session, plugins, name, CONNECTED, "flat.yaml", "light.ambient=9", model)
    assert expected[..., :3].min() > 0.04
    np.testing.assert_allclose(found, expected, atol=1e-3)


@pytest.mark.nightly(keep=1)
@pytest.mark.parametrize("name", ["forward", "deferred"])
@pytest.mark.parametrize("patch", [{}, CONNECTED], ids=["constant", "environment"])
@pytest.mark.parametrize("shading", ["pbr", "phong"])
def test_occlusion_scales_it_exactly(
    session: rg.Session, plugins: list[Path], name: str, patch: dict[str, Any], shading: str
) -> None:
    """What hides the light on a wall hides so much of it, pixel by pixel."""
    sets = ("light.blended=false", f"light.shading={shading}", "light.specular_occlusion=false", "light.ambient=0.4")
    both = {
        **patch,
        **HIDDEN,
        "light": {"inputs": {**patch.get("light", {}).get("inputs", {}), **HIDDEN["light"]["inputs"]}},
    }
    open_ = drawn(session, plugins, name, patch, "flat.yaml", *sets)[..., :3]
    closed = drawn(session, plugins, name, both, "flat.yaml", *sets)[..., :3]
    share = (np.arange(48) + 0.5) / 48
    np.testing.assert_allclose(closed, open_ * share[None, :, None], rtol=2e-3, atol=1e-5)


def test_a_smooth_surface_is_hidden_less_of_what_it_mirrors(session: rg.Session, plugins: list[Path]) -> None:
    """Lagarde's formula, on a metal seen along its normal, where nothing is diffuse."""
    scene = plugins[0].parent / "flat.yaml"
    scene.write_text(FLAT.replace("roughness: 0.6", "roughness: 0.3, metallic: 1"))
    both = {**CONNECTED, **HIDDEN, "light": {"inputs": {"environment": "constant.light", **HIDDEN["light"]["inputs"]}}}
    open_ = drawn(session, plugins, "forward", CONNECTED, "flat.yaml", "light.blended=false")[..., :3]
    closed = drawn(session, plugins, "forward", both, "flat.yaml", "light.blended=false")[..., :3]
    share = (np.arange(48) + 0.5) / 48
    wanted = np.clip((1 + share) ** 2 ** (-16 * 0.3 - 1) - 1 + share, 0, 1)
    np.testing.assert_allclose(closed, open_ * wanted[None, :, None], rtol=3e-3, atol=1e-4)


def test_a_grain_bends_what_is_mirrored(session: rg.Session, plugins: list[Path]) -> None:
    """Towards the normal of a cylinder along the grain (Revie 2012, as KHR_materials_anisotropy mixes it)."""
    roughness, strength = 0.3, 0.8
    metal = f"{{base_color: [1, 1, 1], metallic: 1, roughness: {roughness}, anisotropy_strength: {strength}}}"
    scene = FLAT.replace("{base_color: [0.5, 0.25, 0.8], roughness: 0.6}", metal).replace(
        "height: 3", "fov_y_degrees: 60"
    )
    (plugins[0].parent / "flat.yaml").write_text(scene.replace("at: [0.5, 0, 1]", "at: [90, 0, 1]"))
    sets = ("light.blended=false", "constant.level=[1, 1, 1]")
    even = drawn(session, plugins, "forward", CONNECTED, "flat.yaml", *sets)[..., :3]
    (plugins[0].parent / "constant.glsl").write_text(
        "uniform vec3 level;\nvec3 light_from(vec3 direction, float lobe) { return level * (0.5 + 0.5 * direction); }\n"
    )
    found = 2 * drawn(session, plugins, "forward", CONNECTED, "flat.yaml", *sets)[..., :3] / even - 1

    x = ((np.arange(48) + 0.5) / 24 - 1) * 5 * np.tan(np.radians(30)) * 4 / 3
    y = (1 - (np.arange(36) + 0.5) / 18) * 5 * np.tan(np.radians(30))
    viewer = np.stack([*np.broadcast_arrays(-x[None], -y[:, None], 5.0)], axis=-1)
    viewer /= np.linalg.norm(viewer, axis=-1, keepdims=True)
    across, normal = np.array([0.0, 1, 0]), np.array([0.0, 0, 1])
    bent = viewer - (viewer @ across)[..., None] * across
    bent /= np.linalg.norm(bent, axis=-1, keepdims=True)
    mixed = bent + (normal - bent) * (1 - strength * (1 - roughness)) ** 4
    mixed /= np.linalg.norm(mixed, axis=-1, keepdims=True)
    expected = 2 * (viewer * mixed).sum(axis=-1, keepdims=True) * mixed - viewer
    np.testing.assert_allclose(found, expected, atol=5e-3)
    assert np.abs(expected - viewer * [-1, -1, 1]).max() > 0.5  # a mirror without a grain


def test_it_goes_under_the_term_ambient(session: rg.Session, plugins: list[Path]) -> None:
    """One by one the terms sum to the whole, the environment behind included."""
    patch = {"around": {"type": "environment_light"}, "light": {"inputs": {"environment": "around.light"}}}
    terms = [
        drawn(session, plugins, "forward", patch, "ball.yaml", f"light.terms={term}")
        for term in ("all", "ambient", "diffuse", "specular", "emissive")
    ]
    assert terms[1][..., :3].min() > 0
    assert terms[2][..., :3].max() == 0
    np.testing.assert_allclose(terms[0][..., :3], sum(term[..., :3] for term in terms[1:]), rtol=1e-3)


@pytest.mark.nightly(keep=1)
@pytest.mark.parametrize("name", PIPELINES[1:])
@pytest.mark.parametrize("model", ["pbr", "anisotropic", "phong", "unlit"])
def test_all_ways_of_drawing_agree(session: rg.Session, plugins: list[Path], name: str, model: str) -> None:
    patch = {"around": {"type": "environment_light"}, "light": {"inputs": {"environment": "around.light"}}}
    sets = (f"light.shading={model}", *(["gbuffer.precision=full"] if "deferred" in name else []))
    forward = drawn(session, plugins, "forward", patch, "ball.yaml", sets[0])
    found = drawn(session, plugins, name, patch, "ball.yaml", *sets)
    np.testing.assert_allclose(found, forward, rtol=3e-3, atol=1e-3)


def test_a_face_has_one_colour(session: rg.Session, plugins: list[Path]) -> None:
    """Flat shading stays flat under an environment, and Gouraud's has its vertices' light."""
    scene = plugins[0].parent / "ball.yaml"
    scene.write_text(BALL.replace("segments: 96, rings: 48", "segments: 8, rings: 4"))
    patch = {"around": {"type": "environment_light"}, "light": {"inputs": {"environment": "around.light"}}}
    sets = ("light.backdrop=false", "light.shading=pbr")
    colours = {
        evaluate: len(
            np.unique(
                drawn(session, plugins, "forward", patch, "ball.yaml", *sets, f"light.evaluate={evaluate}").reshape(
                    -1, 4
                ),
                axis=0,
            )
        )
        for evaluate in ("face", "vertex")
    }
    assert colours["face"] <= 8 * 4 * 2 + 1
    assert colours["vertex"] > 200


def test_the_backdrop_is_the_picture(session: rg.Session, plugins: list[Path]) -> None:
    """Behind everything stands what the environment holds in the direction of each pixel; blurred, where that is asked."""
    scene = plugins[0].parent / "ball.yaml"
    scene.write_text(BALL.replace("ball: {", "ball: {hidden: true, ").replace("intensity: 0", "intensity: 1"))
    patch = {"around": {"type": "environment_light"}, "light": {"inputs": {"environment": "around.light"}}}
    found = drawn(session, plugins, "forward", patch, "ball.yaml")
    from rendergraph.pipelines.environments.studio import studio

    x, y = np.meshgrid((np.arange(48) + 0.5) / 24 - 1, 1 - (np.arange(36) + 0.5) / 18)
    half = np.tan(np.pi / 8)
    d = np.stack([x * half * 48 / 36, y * half, -np.ones_like(x)], axis=-1)
    d /= np.linalg.norm(d, axis=-1, keepdims=True)
    row = np.arccos(d[..., 1]) / np.pi * 256
    column = (0.5 + np.arctan2(d[..., 2], d[..., 0]) / (2 * np.pi)) * 512
    expected = studio()[row.astype(int), column.astype(int) % 512, 0]
    assert np.median(np.abs(found[..., 0] - expected) / expected) < 0.01
    assert found[..., 3].max() == 0  # it covers nothing
    blurred = drawn(session, plugins, "forward", patch, "ball.yaml", "light.backdrop_blur=0.7")
    assert blurred[..., 0].std() < 0.5 * found[..., 0].std()
    without = drawn(session, plugins, "forward", patch, "ball.yaml", "light.backdrop=false", "light.background=0.5")
    np.testing.assert_allclose(without[..., :3], 0.5, rtol=1e-3)


def test_it_shows_through_what_is_blended(session: rg.Session, plugins: list[Path]) -> None:
    scene = plugins[0].parent / "flat.yaml"
    scene.write_text(
        FLAT.replace("  wall:", "  wall: {shape: box, hidden: true}\n  other:").replace(
            "size: [40, 40]", "size: [1, 1], hidden: true"
        )
    )
    for name in ("forward", "deferred"):
        found = drawn(session, plugins, name, CONNECTED, "flat.yaml", "light.shading=phong")
        level = np.array([0.2, 0.4, 0.6])
        np.testing.assert_allclose(found[2, 2, :3], level, rtol=2e-3)
        pane = np.array([0.9, 0.3, 0.2]) * level * 0.25 + 0.75 * level
        np.testing.assert_allclose(found[18, 30, :3], pane, rtol=5e-3)


def test_nothing_is_recorded_where_the_scene_has_none(plugins: list[Path]) -> None:
    """A pipeline that contains the node draws a scene without an environment as one without the node."""
    scene = plugins[0].parent / "flat.yaml"
    patch = {"around": {"type": "environment_light"}, "light": {"inputs": {"environment": "around.light"}}}
    plain = rg.load(
        "forward", scene=scene, patches=[{"nodes": {"environment": None, "light": {"inputs": {"environment": None}}}}]
    )
    lit = rg.load("forward", scene=scene, patches=[{"nodes": patch}])
    assert lit.expand().expansion.steps == plain.expand().expansion.steps
