"""One additive pass a light against all lights in one pass."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

import rendergraph as rg


@pytest.mark.nightly(keep=1)
@pytest.mark.slow
@pytest.mark.parametrize("scene", ["cornell_box", "spheres", "many_lights"])
def test_it_draws_the_forward_picture(radiance: Any, steps_off: Any, scene: str) -> None:
    """Where two surfaces lie at exactly the same depth, both are added: some pixels of the columns' rims may be off.

    How many depends on how the processor rounds; a light that is missing would show in thousands.
    """
    off = steps_off(radiance("forward-multipass", scene), radiance("forward", scene))
    assert (off > 1.001).sum() <= 10


def test_blended_surfaces_come_last(radiance: Any, steps_off: Any) -> None:
    """Forward rounds to half floats after each of the panes, multipass does not: a step a layer."""
    off = steps_off(radiance("forward-multipass", "glass"), radiance("forward", "glass"))
    assert off.max() <= 6


@pytest.mark.nightly
@pytest.mark.slow
@pytest.mark.parametrize("scene", ["gltf/AlphaBlendModeTest.glb", "gltf/DamagedHelmet.glb", "gltf/UnlitTest.glb"])
def test_it_draws_the_forward_picture_of_assets(radiance: Any, steps_off: Any, shared: Path, scene: str) -> None:
    file = shared / "assets" / scene
    assert steps_off(radiance("forward-multipass", file), radiance("forward", file)).max() <= 3


def test_behind_a_prepass(radiance: Any, steps_off: Any) -> None:
    here = radiance("forward-prepass", "shadow_study", "light.type=forward_multipass")
    assert steps_off(here, radiance("forward-prepass", "shadow_study")).max() <= 1.001


def test_a_light_is_a_pass() -> None:
    def geometry(*sets: str) -> int:
        plan = rg.load("forward-multipass", scene="many_lights", size=(64, 48), sets=sets).plan()
        return sum(step.node == "light" for step in plan.schedule.steps)

    assert geometry() == 1 + 18
    assert geometry("light.shading=unlit") == geometry("light.terms=ambient") == 1
