"""A material that has a grain is drawn with it under `pbr`, by every lighting node; others are drawn as ever."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import rendergraph as rg

SCENE = """scene: 1
objects:
  brushed: {shape: sphere, radius: 0.6, at: [-0.7, 0, 0], material: brushed}
  plain: {shape: torus, radius: 0.5, tube: 0.2, at: [0.8, 0, 0], rotate_degrees: [70, 0, 0], material: plain}
materials:
  brushed: {base_color: [0.9, 0.8, 0.7], metallic: 1, roughness: 0.35, anisotropy_strength: 0.8, anisotropy_rotation: 0.6}
  plain: {base_color: [0.3, 0.5, 0.7], roughness: 0.3}
lights: {key: {type: directional, direction: [-0.5, -0.8, -1], intensity: 3}}
environment: {file: studio}
cameras: {main: {eye: [0, 0.3, 4], target: [0, 0, 0], fov_y_degrees: 32}}
"""


@pytest.fixture
def scenes(tmp_path: Path) -> tuple[Path, Path]:
    """The scene, and the same without a grain."""
    (tmp_path / "grain.yaml").write_text(SCENE)
    (tmp_path / "even.yaml").write_text(SCENE.replace("anisotropy_strength: 0.8", "anisotropy_strength: 0"))
    return tmp_path / "grain.yaml", tmp_path / "even.yaml"


def radiance(session: rg.Session, name: str, scene: Path, *sets: str) -> Any:
    pipeline = rg.load(name, scene=scene, size=(96, 54), sets=sets)
    return session.render(pipeline, outputs=["radiance"])["radiance"].astype(np.float64)


@pytest.mark.parametrize("terms", ["specular", "ambient"])
def test_pbr_draws_the_grain_and_nothing_else_changes(
    session: rg.Session, scenes: tuple[Path, Path], terms: str
) -> None:
    """As the anisotropic model does, which has formulas of its own; what has no grain is as it was, to the bit."""
    sets = (f"light.terms={terms}", "light.backdrop=false")
    with_grain, even = (radiance(session, "forward", scene, *sets) for scene in scenes)
    other = radiance(session, "forward", scenes[0], "light.shading=anisotropic", *sets)
    np.testing.assert_allclose(with_grain, other, rtol=5e-3, atol=2e-3)
    left, right = slice(None, 46), slice(52, None)
    assert np.abs(with_grain - even)[:, left].max() > 0.2
    np.testing.assert_array_equal(with_grain[:, right], even[:, right])


def test_without_a_grain_the_anisotropic_model_is_pbr_with_exact_visibility(
    session: rg.Session, scenes: tuple[Path, Path]
) -> None:
    one, other = (
        radiance(session, "forward", scenes[1], *sets)
        for sets in (("light.smith=exact",), ("light.shading=anisotropic",))
    )
    np.testing.assert_allclose(one, other, rtol=2e-3, atol=1e-3)


def test_a_grain_that_comes_with_time(session: rg.Session, tmp_path: Path) -> None:
    """A material without one at first has it where keyframes say so."""
    dark = SCENE.replace("environment: {file: studio}\n", "")
    moving = dark.replace("anisotropy_strength: 0.8", "anisotropy_strength: 0")
    (tmp_path / "still.yaml").write_text(dark)
    (tmp_path / "moving.yaml").write_text(
        moving + "keyframes: {materials.brushed.anisotropy_strength: {0: 0, 1: 0.8}}\n"
    )
    for name in ("forward", "deferred"):
        still, changed = (rg.load(name, scene=tmp_path / f"{one}.yaml", size=(48, 27)) for one in ("still", "moving"))
        expected = session.render(still, outputs=["radiance"])["radiance"]
        found = session.render(changed, frames=range(2, 3), fps=1, outputs=["radiance"])["radiance"]
        np.testing.assert_array_equal(found, expected)


@pytest.mark.nightly
def test_all_ways_of_drawing_agree(session: rg.Session, scenes: tuple[Path, Path]) -> None:
    forward = radiance(session, "forward", scenes[0])
    for name in ("deferred", "deferred-stencil-lights", "forward-multipass"):
        off = np.abs(radiance(session, name, scenes[0]) - forward).max(axis=-1) / np.maximum(forward.max(axis=-1), 0.1)
        assert np.quantile(off, 0.99) < 0.012, name  # what half-float normals of the compact G-buffer cost
    found = radiance(session, "deferred", scenes[0], "gbuffer.precision=full")
    assert np.quantile(np.abs(found - forward), 0.99) < 1e-3


def test_only_scenes_with_a_grain_have_it_in_the_g_buffer(scenes: tuple[Path, Path]) -> None:
    for scene, wanted in zip(scenes, (True, False), strict=True):
        steps = rg.load("deferred", scene=scene, size=(16, 9)).expand().expansion.steps
        written = {write.name for step in steps if step.node == "gbuffer" for write in step.writes}
        assert ("grain" in written) is wanted
