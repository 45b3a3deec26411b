"""The darkening quad: the unshadowed picture times a factor, exactly where volumes are."""

from __future__ import annotations

import numpy as np

import rendergraph as rg

LIGHTS = "shadows.light=[inner.0, inner.3, outer.0, outer.1, outer.2]"


def test_what_lies_in_volumes_is_darker_by_the_factor_once_a_light(session: rg.Session) -> None:
    size, scene = (120, 80), "many_lights"
    plain = session.render(
        rg.load("deferred", size=size, scene=scene, sets=("light.visibility=null", "light.blended_lookup=null")),
        outputs=["radiance"],
    )["radiance"].astype(float)
    dark = session.render(
        rg.load("shadow-volumes-darkened", size=size, scene=scene, sets=(LIGHTS, "shadows.strength=0.25")),
        outputs=["radiance"],
    )["radiance"].astype(float)
    seen = session.render(
        rg.load("shadow-volumes-auto", size=size, scene=scene, sets=(LIGHTS,)),
        outputs=(),
        taps=["shadows.visibility"],
    ).arrays["shadows.visibility"]
    hidden = (seen[..., 0] < 0.5).sum(axis=0)
    assert hidden.max() > 1
    np.testing.assert_allclose(dark[..., :3], plain[..., :3] * 0.75 ** hidden[..., None], rtol=1e-2, atol=1e-5)
    np.testing.assert_array_equal(dark[..., 3], plain[..., 3])


def test_without_a_light_the_picture_goes_on(session: rg.Session) -> None:
    frame = session.render(rg.load("shadow-volumes-darkened", size=(32, 16), scene="many_lights"), outputs=["radiance"])
    plain = session.render(rg.load("deferred", size=(32, 16), scene="many_lights"), outputs=["radiance"])
    assert np.array_equal(frame["radiance"], plain["radiance"])
