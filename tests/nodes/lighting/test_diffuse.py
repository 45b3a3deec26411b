"""The output `diffuse` of the lighting nodes: radiance without its specular part, where somebody reads it."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

import rendergraph as rg

Floats = npt.NDArray[np.float64]
VARIANTS = (
    ("forward", ()),
    ("forward", ("light.evaluate=vertex",)),
    ("forward", ("light.evaluate=face",)),
    ("forward", ("light.shading=phong",)),
    ("forward-prepass", ()),
    ("forward-multipass", ()),
    ("deferred", ("light.smith=fast",)),
    ("deferred-stencil-lights", ()),
)


def within_a_step(a: Floats, b: Floats) -> bool:
    """Equal but for the last bits of half floats, of which each layer of glass rounds once more."""
    return bool((np.abs(a - b) <= 2.0**-9 * np.maximum(np.abs(a), np.abs(b)) + 2.0**-20).all())


@pytest.mark.nightly(keep=2)
@pytest.mark.slow
@pytest.mark.parametrize(
    ("scene", "pipeline", "sets"), [("spheres", "deferred", ()), *(("glass", *variant) for variant in VARIANTS)]
)
def test_diffuse_and_specular_make_the_whole(
    session: rg.Session, scene: str, pipeline: str, sets: tuple[str, ...]
) -> None:
    """And what is left out is the specular term alone: the others drawn one by one sum to `diffuse`.

    Without an environment, whose mirror image goes under the term `ambient`.
    """

    def drawn(*more: str) -> tuple[Floats, Floats]:
        loaded = rg.load(pipeline, scene=scene, size=(64, 48), sets=("light.environment=null", *sets, *more))
        frame = session.render(loaded, outputs=["radiance"], taps=["light.diffuse"])
        return np.asarray(frame["radiance"], np.float64), np.asarray(frame["light.diffuse"], np.float64)

    whole, diffuse = drawn()
    specular, nothing = drawn("light.terms=specular")
    assert specular[..., :3].max() > 0.01
    assert not nothing[..., :3].any()
    assert within_a_step(whole[..., :3], (diffuse + specular)[..., :3])
    np.testing.assert_array_equal(whole[..., 3], diffuse[..., 3])
    parts: Any = [drawn(f"light.terms={term}") for term in ("ambient", "diffuse", "emissive")]
    np.testing.assert_allclose(diffuse[..., :3], sum(part[0] for part in parts)[..., :3], rtol=2e-3, atol=1e-6)
    for radiance, same in parts:
        np.testing.assert_array_equal(radiance, same)


@pytest.mark.parametrize("pipeline", ["forward", "forward-multipass", "deferred", "deferred-stencil-lights"])
def test_nobody_pays_who_does_not_read_it(pipeline: str) -> None:
    def defines(*taps: str) -> set[str]:
        plan = rg.load(pipeline, scene="glass", size=(16, 16)).plan(outputs=["radiance"], taps=taps)
        assert ("light.diffuse" in plan.resources) == bool(taps)
        return {name for step in plan.schedule.steps if step.node == "light" for name, _ in step.defines}

    assert "WRITES_DIFFUSE" not in defines()
    assert {"WRITES_DIFFUSE", "WRITES_RADIANCE"} <= defines("light.diffuse")
