"""Light drawn where the stencil counts no volume: the picture that visibility in a texture gives."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

import rendergraph as rg

Floats = npt.NDArray[np.float64]


SOME = "[inner.0, inner.3, outer.0, outer.1, outer.2]"


@pytest.mark.nightly(keep=1)
@pytest.mark.parametrize(("scene", "lights"), [("shadow_study", "sun"), ("many_lights", SOME)])
def test_it_is_the_picture_of_visibility(radiance: Any, steps_off: Any, scene: str, lights: str) -> None:
    """Several lights, each with a stencil of its own that is wiped for the next."""
    masked = radiance("shadow-volumes-masked", scene, f"light.light={lights}")
    looked_up = radiance("shadow-volumes-auto", scene, f"shadows.light={lights}", "gbuffer.precision=full")
    off = steps_off(masked, looked_up)
    assert (off > 8).mean() < 2e-3
    assert (steps_off(masked, radiance("forward-multipass", scene, "light.lookup=null")) > 8).mean() > 0.02


@pytest.mark.nightly
def test_lights_that_cast_none_shine_everywhere(radiance: Any) -> None:
    lit = radiance("forward-multipass", "many_lights", "light.lookup=null")
    one, some = (radiance("shadow-volumes-masked", "many_lights", f"light.light={x}") for x in ("outer.0", SOME))
    assert (one <= lit + 1e-5).all()
    assert (some <= one + 1e-5).all()
    assert 0 < (one < lit - 1e-3).mean() < (some < lit - 1e-3).mean()


def test_samples_are_counted_one_by_one(session: rg.Session) -> None:
    """With four samples edges of shadows on the floor have grey pixels, where one sample has none."""

    def greys(samples: int) -> int:
        sets = ("light.terms=diffuse", "light.shading=phong", f"light.samples={samples}")
        loaded = rg.load("shadow-volumes-masked", size=(160, 90), sets=sets)
        floor = session.render(loaded)["image"][60:, 40:150, 0].astype(int)
        values, counts = np.unique(floor, return_counts=True)
        lit = values[np.argmax(counts)]
        return int(((floor > 0) & (floor < lit - 4)).sum())

    assert greys(4) > greys(1) + 20
