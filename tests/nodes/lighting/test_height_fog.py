"""The function port `air`: which lighting nodes call it, and fog of analytic density against a numerical integral."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest

import rendergraph as rg

Floats = npt.NDArray[np.float64]
SIZE = (64, 36)
HAZE = '''"""Air that is everywhere the same."""

from rendergraph.api import Air, Function, Node, param


class Haze(Node):
    """Air that dims and brightens everything by the same amount."""

    air = Function(Air, "haze.glsl", doc="A constant.")
    transmittance: float = param(default=0.5, doc="Transmittance.")
    glow: float = param(default=0.25, doc="In-scattered radiance.")
'''
NODES = "{haze: {type: haze}, light: {inputs: {air: haze.air}}}"
PIPELINES = (
    ("forward", NODES),
    ("forward-multipass", NODES),
    ("forward-msaa", NODES),
    ("deferred-stencil-lights", NODES),
    ("deferred", NODES),
    ("deferred-msaa", NODES),
    ("weighted-blended", NODES.replace("}}}", "}}, transparent: {inputs: {air: haze.air}}}")),
    ("depth-peeling", NODES.replace("}}}", "}}, transparent: {inputs: {air: haze.air}}}")),
)


@pytest.fixture(scope="module")
def haze(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("haze")
    (folder / "haze.py").write_text(HAZE)
    (folder / "haze.glsl").write_text(
        "uniform float transmittance, glow;\nvec4 air_at(vec3 position) { return vec4(vec3(glow), transmittance); }\n"
    )
    for name, nodes in PIPELINES:
        (folder / f"{name}.yaml").write_text(f"extends: {name}\nnodes: {nodes}\n")
    return folder


def radiance(session: rg.Session, pipeline: str | Path, *sets: str, scene: str | None = None) -> Floats:
    plugins = [pipeline.parent] if isinstance(pipeline, Path) else []
    loaded = rg.load(pipeline, scene=scene, size=SIZE, sets=sets, plugins=plugins)
    # Samples are resolved by a weighted mean, which is not linear in radiance; a tap is plain.
    port = "light.radiance" if "msaa" in str(pipeline) else "radiance"
    return np.asarray(session.render(loaded, outputs=["radiance"], taps=["light.radiance"])[port], np.float64)


@pytest.mark.nightly(keep=1)
@pytest.mark.parametrize("pipeline", [name for name, _ in PIPELINES])
def test_every_surface_and_the_background_are_seen_through_air(session: rg.Session, haze: Path, pipeline: str) -> None:
    """Where air is everywhere the same, the whole picture is: transmittance × picture + glow, glass included."""
    scene = "many_lights" if pipeline == "deferred-stencil-lights" else "glass"
    clear = radiance(session, pipeline, scene=scene)
    hazy = radiance(session, haze / f"{pipeline}.yaml", scene=scene)
    np.testing.assert_allclose(hazy[..., :3], 0.5 * clear[..., :3] + 0.25, rtol=4e-3, atol=2e-3)
    np.testing.assert_allclose(hazy[..., 3], clear[..., 3], atol=2e-3)
    assert clear[..., :3].std() > 0.05


@pytest.mark.nightly(keep=1)
@pytest.mark.parametrize("pipeline", ["forward", "deferred", "deferred-msaa"])
def test_a_plain_background_is_seen_through_air(session: rg.Session, haze: Path, pipeline: str) -> None:
    sets = ("light.environment=null", "light.background=[0.2, 0.4, 0.8]")
    clear = radiance(session, pipeline, *sets, scene="shadow_study")
    hazy = radiance(session, haze / f"{pipeline}.yaml", *sets, scene="shadow_study")
    assert (clear[..., 3] == 0).any(), "no background"
    np.testing.assert_allclose(hazy[..., :3], 0.5 * clear[..., :3] + 0.25, rtol=4e-3, atol=1e-3)


@pytest.mark.nightly(keep=1)
@pytest.mark.parametrize("pipeline", ["forward", "deferred"])
def test_terms_add_up_in_air(session: rg.Session, haze: Path, pipeline: str) -> None:
    whole, *terms = [
        radiance(session, haze / f"{pipeline}.yaml", f"light.terms={term}", scene="glass")[..., :3]
        for term in ("all", "ambient", "diffuse", "specular", "emissive")
    ]
    np.testing.assert_allclose(np.sum(terms, axis=0), whole, rtol=4e-3, atol=2e-3)


def test_clear_air_changes_no_bit(session: rg.Session) -> None:
    clear = radiance(session, "fog", "fog.density=0")
    np.testing.assert_array_equal(clear, radiance(session, "fog", "fog.enabled=false"))


def distances(session: rg.Session) -> tuple[Floats, Floats]:
    """Return unit rays of the picture of `avenue` and the distance of what they meet; 100 km where that is the sky."""
    frame = session.render(rg.load("fog", size=SIZE), taps=["gbuffer.depth"])
    depth = np.asarray(frame.arrays["gbuffer.depth"], np.float64)[..., 0]
    eye, target = np.array([0.8, 1.8, 3.5]), np.array([-0.2, 1.5, -8.0])
    forward = (target - eye) / np.linalg.norm(target - eye)
    right = np.cross(forward, [0, 1, 0])
    right /= np.linalg.norm(right)
    up, slope = np.cross(right, forward), np.tan(np.radians(25.0))
    width, height = SIZE
    x = ((np.arange(width) + 0.5) / width * 2 - 1) * slope * width / height
    y = (1 - (np.arange(height) + 0.5) / height * 2) * slope
    rays = forward + x[None, :, None] * right + y[:, None, None] * up
    near, far = 0.1, 300.0
    along = near * far / (depth * (far - near) + near)  # depth is reversed
    lengths = np.linalg.norm(rays, axis=-1)
    return rays / lengths[..., None], np.where(depth > 0, along * lengths, 1e5)


@pytest.mark.nightly(keep=2)
@pytest.mark.parametrize(
    ("density", "falloff", "height"), [(0.08, 0.35, 0.0), (0.02, 0.0, 0.0), (0.02, 0.05, 0.0), (0.3, 2.0, 1.0)]
)
def test_fog_is_the_integral_of_its_density(session: rg.Session, density: float, falloff: float, height: float) -> None:
    """The difference between fog of radiance 1 and of radiance 0 is 1 - transmittance."""
    sets = (f"fog.density={density}", f"fog.falloff={falloff}", f"fog.height={height}", "fog.color=1")
    with_glow = radiance(session, "fog", *sets)[..., 0]
    without = radiance(session, "fog", *sets[:3], "fog.color=0")[..., 0]
    rays, length = distances(session)
    t = np.concatenate([[0.0], np.geomspace(1e-7, 1.0, 1000)])  # fine near the eye, as the sky is far away
    middle = (t[1:] + t[:-1]) / 2
    heights = 1.8 + rays[..., 1:2] * length[..., None] * middle
    with np.errstate(over="ignore"):
        depths = (density * np.exp(-falloff * (heights - height)) * np.diff(t)).sum(axis=-1) * length
    np.testing.assert_allclose(with_glow - without, 1 - np.exp(-depths), atol=3e-3)
    assert (1 - np.exp(-depths)).std() > 0.1
