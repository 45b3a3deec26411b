"""The parts of the light that lighting nodes give, and what replaces one of them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest

import rendergraph as rg
from rendergraph.errors import RendergraphError

Floats = npt.NDArray[np.float64]
SIZE = (64, 48)
PLAIN = {"light.shading=phong", "light.environment=null", "light.shading=unlit"}
PARTS = ("direct_diffuse", "direct_specular", "environment_reflection", "specular_albedo", "irradiance")
VARIANTS = (
    ("ssao-hemisphere", ()),
    ("forward", ()),
    ("deferred", ()),
    ("forward", ("light.shading=phong",)),
    ("deferred", ("light.shading=anisotropic",)),
    ("deferred", ("light.environment=null",)),
    ("deferred", ("light.terms=ambient",)),
    ("deferred", ("light.shading=unlit",)),
    ("forward-multipass", ()),
    ("deferred-stencil-lights", ()),
    ("deferred-msaa", ()),
)


def parts(
    session: rg.Session, pipeline: str | Path, names: tuple[str, ...], *sets: str, scene: str = "glass"
) -> tuple[Floats, dict[str, Floats]]:
    """Return RGB of the radiance and of some parts."""
    plugins = [pipeline.parent] if isinstance(pipeline, Path) else []
    loaded = rg.load(pipeline, scene=scene, size=SIZE, sets=sets, plugins=plugins)
    frame = session.render(loaded, outputs=["radiance"], taps=[f"light.{name}" for name in ("radiance", *names)])
    found = {name: np.asarray(frame[f"light.{name}"], np.float64)[..., :3] for name in names}
    return np.asarray(frame["light.radiance"], np.float64)[..., :3], found


def half_steps(a: Floats, b: Floats, count: float) -> npt.NDArray[np.bool_]:
    """Where two pictures differ by at most so many roundings to half floats."""
    return np.asarray(np.abs(a - b) <= count * 2.0**-10 * np.maximum(np.abs(a), np.abs(b)) + 2.0**-16)


def drawn(session: rg.Session, pipeline: str, *taps: str) -> list[Floats]:
    frame = session.render(rg.load(pipeline, scene="spheres", size=SIZE), taps=taps)
    return [np.asarray(frame.arrays[tap], np.float64)[..., :3] for tap in taps]


@pytest.mark.nightly(keep=1)
@pytest.mark.parametrize(("pipeline", "sets"), VARIANTS)
def test_the_sum_of_the_parts_is_the_radiance(session: rg.Session, pipeline: str, sets: tuple[str, ...]) -> None:
    """Of opaque surfaces: the reflections of the environment in glass have no output."""
    sets = ("light.blended=false", *sets)
    radiance, found = parts(session, pipeline, ("diffuse", *PARTS), *sets)
    reflected = found["environment_reflection"] * found["specular_albedo"]
    edges = 0.1 if pipeline == "deferred-msaa" else 0.0  # where a mean of products over samples is no product
    assert half_steps(radiance, found["diffuse"] + found["direct_specular"] + reflected, 4).mean() >= 1 - edges
    assert (found["direct_diffuse"] <= found["diffuse"] * (1 + 2**-9)).all()
    unlit, ambient = "light.shading=unlit" in sets, "light.terms=ambient" in sets
    assert (found["direct_diffuse"].max() > 0.05) != (unlit or ambient)
    assert (found["direct_specular"].max() > 0.05) != (unlit or ambient)
    assert (found["irradiance"].max() > 0.05) != unlit
    assert (reflected.max() > 0.01) != bool({*sets} & PLAIN)
    plain, _ = parts(session, pipeline, (), *sets)
    np.testing.assert_allclose(radiance, plain, rtol=0 if session.device.software else 1e-6)  # GPUs fuse other terms


@pytest.mark.nightly(keep=1)
@pytest.mark.parametrize("pipeline", ["forward", "deferred"])
def test_diffuse_light_is_irradiance_times_albedo(session: rg.Session, pipeline: str) -> None:
    _, found = parts(session, pipeline, ("diffuse", "irradiance"), scene="spheres")
    root, material, depth = drawn(session, "deferred", "gbuffer.albedo", "gbuffer.material", "gbuffer.depth")
    reflectance = root**2 * (1 - material[..., :1])
    expected = reflectance * found["irradiance"] / np.pi
    inside = np.abs(found["diffuse"] - expected) <= 0.01 * expected + 1e-3  # but for edges, and albedo of 8 bits
    assert inside[depth[..., 0] > 0].mean() > 0.97
    assert expected.mean() > 0.05


def test_glass_dims_what_the_surface_behind_it_reflects(session: rg.Session) -> None:
    """So a node that replaces the reflection later is right behind glass, too."""
    names = ("diffuse", "direct_specular", "environment_reflection", "specular_albedo", "irradiance")
    glassy, found = parts(session, "deferred", names)
    bare, opaque = parts(session, "deferred", names, "light.blended=false")
    for name in ("environment_reflection", "irradiance"):
        np.testing.assert_array_equal(found[name], opaque[name])
    assert (found["specular_albedo"] <= opaque["specular_albedo"]).all()
    covered = (glassy != bare).any(axis=-1)
    assert (found["specular_albedo"] < 0.9 * opaque["specular_albedo"])[covered].mean() > 0.5
    np.testing.assert_array_equal(found["specular_albedo"][~covered], opaque["specular_albedo"][~covered])


def test_irradiance_is_that_of_a_directional_light(session: rg.Session, tmp_path: Path) -> None:
    """Lambert's cosine law on a floor: 3 lux at 60° are 1.5, whatever the albedo."""
    (tmp_path / "floor.yaml").write_text(
        "scene: 1\n"
        "objects: {floor: {shape: plane, size: [50, 50], material: odd}}\n"
        "materials: {odd: {base_color: [0.5, 0.1, 0.9], metallic: 0.5}}\n"
        "lights: {sun: {type: directional, direction: [0.8660254, -0.5, 0], intensity: 3}}\n"
        "cameras: {main: {eye: [0, 5, 0.1], target: [0, 0, 0]}}\n"
    )
    for pipeline, extra in (("forward", 0.0), ("deferred", 0.25)):
        loaded = rg.load(pipeline, scene=tmp_path / "floor.yaml", size=(16, 12), sets=(f"light.ambient={extra}",))
        seen = np.asarray(session.render(loaded, taps=["light.irradiance"])["light.irradiance"], np.float64)
        np.testing.assert_allclose(seen[..., :3], 1.5 + np.pi * extra, rtol=1e-3)


def test_what_light_per_vertex_cannot_give_is_refused() -> None:
    loaded = rg.load("forward", size=SIZE, sets=("light.evaluate=vertex",))
    message = r"RG209 .*'specular_albedo' is only available per fragment; set `evaluate: fragment`"
    with pytest.raises(RendergraphError, match=message):
        loaded.plan(taps=["light.specular_albedo"])
    loaded.plan(taps=["light.irradiance", "light.direct_specular"])


def test_parts_cost_nothing_unless_they_are_used() -> None:
    for pipeline in ("forward", "deferred"):
        plan = rg.load(pipeline, scene="glass", size=(16, 16)).plan(outputs=["radiance"])
        steps = [step for step in plan.schedule.steps if step.node == "light"]
        assert not any(f"light.{name}" in plan.resources for name in PARTS)
        written = {name for step in steps for name, _ in step.defines if name.startswith("WRITES_")}
        assert written <= {"WRITES_RADIANCE", "WRITES_SURFACE_DEPTH", "WRITES_BRDF_TABLE"}


# --- reflections -----------------------------------------------------------------------------------------------------

MIRROR = """/*---
doc: Red from the left with a confidence that rises to 1 and falls again.
params:
  confidence: {default: 1.0, doc: Greatest confidence.}
outputs:
  reflections: {semantic: reflections, format: rgba32f, doc: Reflections.}
---*/
in vec2 v_uv;
uniform float confidence;
out vec4 reflections;

void main() {
    reflections = vec4(2.0, 0.5, 0.25, confidence * (1.0 - abs(2.0 * v_uv.x - 1.0)));
}
"""


@pytest.fixture(scope="module")
def mirror(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with forward.yaml and deferred.yaml, whose light takes reflections."""
    made = tmp_path_factory.mktemp("mirror")
    (made / "mirror.frag").write_text(MIRROR)
    for name in ("forward", "deferred"):
        nodes = "{mirror: {type: mirror}, light: {inputs: {reflections: mirror.reflections}}}"
        (made / f"{name}.yaml").write_text(f"extends: {name}\nnodes: {nodes}\n")
    return made


REFLECTED = np.array([2.0, 0.5, 0.25])
CONFIDENCE = 1 - np.abs(2 * (np.arange(SIZE[0]) + 0.5) / SIZE[0] - 1)[None, :, None]


@pytest.mark.nightly(keep=1)
@pytest.mark.parametrize("pipeline", ["forward", "deferred"])
def test_reflections_replace_the_environment(session: rg.Session, mirror: Path, pipeline: str) -> None:
    names = ("environment_reflection", "specular_albedo")
    before, old = parts(session, pipeline, names, scene="spheres")
    after, new = parts(session, mirror / f"{pipeline}.yaml", names, scene="spheres")
    covered = old["specular_albedo"].any(axis=-1, keepdims=True)
    reflection = np.where(covered, (1 - CONFIDENCE) * old["environment_reflection"] + CONFIDENCE * REFLECTED, 0)
    assert half_steps(new["environment_reflection"], reflection, 3).all()
    change = (reflection - old["environment_reflection"]) * old["specular_albedo"]
    assert np.abs(change).max() > 0.5
    np.testing.assert_allclose(after, before + change, rtol=4e-3, atol=1e-3)
    np.testing.assert_array_equal(new["specular_albedo"], old["specular_albedo"])
    unsure, _ = parts(session, mirror / f"{pipeline}.yaml", (), "mirror.confidence=0", scene="spheres")
    np.testing.assert_array_equal(unsure, before)


@pytest.mark.nightly(keep=1)
@pytest.mark.parametrize("pipeline", ["forward", "deferred"])
def test_reflections_need_no_environment(session: rg.Session, mirror: Path, pipeline: str) -> None:
    """Without one they replace what metals reflect of the constant ambient light, 0.03."""
    alone = "light.environment=null"
    before, old = parts(session, pipeline, ("diffuse", "specular_albedo"), alone, scene="spheres")
    after, new = parts(session, mirror / f"{pipeline}.yaml", ("diffuse",), alone, scene="spheres")
    root, material = drawn(session, "deferred", "gbuffer.albedo", "gbuffer.material")
    metal = 0.03 * root**2 * material[..., :1] * material[..., 2:3]
    specular = CONFIDENCE * REFLECTED * old["specular_albedo"]
    np.testing.assert_allclose(new["diffuse"], old["diffuse"] - CONFIDENCE * metal, rtol=4e-3, atol=2e-3)
    np.testing.assert_allclose(after, before - CONFIDENCE * metal + specular, rtol=4e-3, atol=2e-3)
    assert specular.max() > 0.5


def test_the_empirical_models_reflect_nothing(session: rg.Session, mirror: Path) -> None:
    plan = rg.load(mirror / "deferred.yaml", plugins=[mirror], sets=("light.shading=phong",)).plan()
    assert not any(step.node == "mirror" for step in plan.schedule.steps)


def test_reflections_are_per_fragment_where_light_is_per_vertex(session: rg.Session, mirror: Path) -> None:
    sets = ("light.evaluate=vertex", "light.terms=ambient")
    file = mirror / "forward.yaml"
    before, _ = parts(session, file, (), *sets, "mirror.confidence=0", scene="spheres")
    after, _ = parts(session, file, (), *sets, scene="spheres")
    _, fragment = parts(session, file, ("specular_albedo",), scene="spheres")
    middle = slice(SIZE[0] // 2 - 1, SIZE[0] // 2 + 1)  # where confidence is highest
    _, diffuse = parts(session, file, ("diffuse",), *sets, scene="spheres")
    expected = diffuse["diffuse"] + REFLECTED * fragment["specular_albedo"]
    np.testing.assert_allclose(after[:, middle], expected[:, middle], rtol=0.05, atol=5e-3)
    assert (after != before).mean() > 0.2
