"""Samples lit one by one where they differ, against all of them lit one by one."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest

import rendergraph as rg
from tests.scenes import without_images

Floats = npt.NDArray[np.float64]
UNSHADOWED = {
    "nodes": {"sun": None, "shadows": None, "light": {"inputs": {"lookup": None, "blended_lookup": None}}},
    "outputs": {"edges": "light.edges"},
}


def every_sample(pipeline: rg.Pipeline, light: str = "deferred_lighting") -> rg.Pipeline:
    """The same with every sample lit."""
    return pipeline.set("light.type", light).patch({"outputs": {"edges": None, "edge_share": None}})


def steps_apart(a: rg.Frame, b: rg.Frame) -> npt.NDArray[np.int64]:
    """Per pixel, by how many 255ths the pictures differ."""
    return np.asarray(np.abs(a["image"].astype(np.int64) - b["image"].astype(np.int64)).max(axis=-1))


@pytest.mark.nightly(keep=1)
@pytest.mark.parametrize("scene", ["cornell_box", "shadow_study", "many_lights", "glass"])
def test_the_picture_is_that_of_every_sample_lit(session: rg.Session, scene: str) -> None:
    pipeline = without_images(rg.load("deferred-msaa", scene=scene, size=(144, 81), patches=[UNSHADOWED]))
    marked, every = session.render(pipeline), session.render(every_sample(pipeline))
    assert every["image"].mean() > 2
    assert (steps_apart(marked, every) > 1).mean() <= 0.001
    blind = session.render(pipeline.set("light.normal_angle", 180).set("light.depth_angle", 90))
    assert (steps_apart(blind, every) > 1).mean() > 0.003, "edges that are not found would not show"
    edges = marked.arrays["edges"] / 255
    assert set(np.unique(edges)) == {0, 1}
    assert 0.005 < edges.mean() < 0.4
    np.testing.assert_allclose(marked.arrays["edge_share"], edges.mean(), rtol=1e-6)


@pytest.mark.nightly
@pytest.mark.parametrize(
    ("scene", "taps", "size"),
    [
        ("shadow_study", 1, (240, 135)),
        ("stairs", 4, (240, 135)),
        ("stairs", 1, (160, 90)),
        ("avenue", 3, (160, 90)),
        ("courtyard", 3, (160, 90)),
        ("lantern", 3, (160, 90)),
    ],
)
def test_edges_of_shadows_within_a_surface_are_lit_sample_by_sample(
    session: rg.Session, scene: str, taps: int, size: tuple[int, int]
) -> None:
    """Hard ones, of one lookup, and soft ones, of 4 × 4; those of far columns and near bars are thinner than pixels."""
    sets = ["light.environment=null", f"shadows.taps={taps}"]
    pipeline = rg.load("deferred-msaa", scene=scene, size=size, sets=sets)
    every = session.render(every_sample(pipeline))
    assert (steps_apart(session.render(pipeline), every) > 1).mean() <= 0.001
    blind = session.render(pipeline.set("light.shadow_change", 1))
    assert (steps_apart(blind, every) > 1).mean() > 0.005, "edges that are not found would not show"


@pytest.mark.nightly
def test_marked_pixels_are_those_of_every_sample_lit(session: rg.Session) -> None:
    """To the border of a picture whose last tiles are parts, whether surfaces or shadows mark."""
    pipeline = rg.load("deferred-msaa", scene="courtyard", size=(81, 46), sets=["light.environment=null"])
    pipeline = pipeline.patch({"outputs": {"edges": "light.edges"}})
    marked, every = session.render(pipeline), session.render(every_sample(pipeline))
    surfaces = session.render(pipeline.set("light.shadow_change", 1))["edges"] > 0
    edges = marked["edges"] > 0
    assert edges[:, -1].any()
    assert edges[-1].any()
    assert (edges & ~surfaces).sum() > 50
    np.testing.assert_allclose(marked["radiance"][edges], every["radiance"][edges], rtol=2e-3, atol=1e-4)


def test_where_a_surface_bends_a_little_its_mean_is_lit(session: rg.Session) -> None:
    """Balls of coarse triangles, all but their outlines lit once: by one sample's normal 4 % of the pixels were off."""
    pipeline = rg.load("deferred-msaa", scene="facets", size=(96, 54), patches=[UNSHADOWED])
    pipeline = pipeline.set("light.environment", None)
    both = pipeline.set("light.normal_angle", 3), every_sample(pipeline)
    once, every = (session.render(one)["radiance"][..., :3].astype(np.float64) for one in both)
    off = np.abs(once - every).max(axis=-1) > 0.005 * (every.max(axis=-1) + 0.05)
    assert off.mean() < 0.02


INLAID = """scene: 1
objects:
  left: {shape: plane, size: [20, 40], at: [-10, 0, 0], material: first}
  right: {shape: plane, size: [20, 40], at: [10, 0, 0], material: second}
materials:
  first: {base_color: [0.5, 0.5, 0.5], roughness: 0.3}
  second: {CHANGED}
lights: {sun: {type: directional, direction: [0.1, -1, -0.3]}}
cameras: {main: {eye: [-0.4, 4, 1], target: [0.4, 0, 0], near: 0.1, far: 60}}
"""


@pytest.mark.nightly(keep=1)
@pytest.mark.parametrize(
    "changed",
    [
        "base_color: [0.5, 0.45, 0.5], roughness: 0.3",
        "base_color: [0.5, 0.5, 0.5], roughness: 0.6",
        "base_color: [0.5, 0.5, 0.5], roughness: 0.3, emissive: [0.2, 0, 0]",
    ],
)
def test_materials_that_meet_in_a_plane_are_edges(session: rg.Session, tmp_path: Path, changed: str) -> None:
    (tmp_path / "scene.yaml").write_text(INLAID.replace("CHANGED", changed))
    pipeline = rg.load("deferred-msaa", scene=tmp_path / "scene.yaml", size=(48, 32), patches=[UNSHADOWED])
    edges = session.render(pipeline).arrays["edges"][..., 0] > 0
    assert edges.any(axis=1).all()
    assert (edges.sum(axis=1) <= 2).all()


@pytest.mark.parametrize("light", ["deferred_lighting", "deferred_multisampled"])
def test_one_sample_a_pixel_is_plain_deferred_lighting(session: rg.Session, light: str) -> None:
    nodes = {"light": {"type": light}, "resolve": None, "display": {"inputs": {"radiance": "light.radiance"}}}
    patch = {"nodes": nodes, "outputs": {"radiance": None, "edge_share": None}}
    one = rg.load("deferred-msaa", scene="shadow_study", size=(80, 60), sets=["gbuffer.samples=1"], patches=[patch])
    plain = rg.load(
        "deferred",
        scene="shadow_study",
        size=(80, 60),
        patches=[{"nodes": {"light": {"inputs": {"visibility": None, "lookup": "shadows.lookup"}}}}],
    )
    np.testing.assert_array_equal(session.render(one, outputs=["image"])["image"], session.render(plain)["image"])


def test_light_volumes_light_every_sample(session: rg.Session) -> None:
    pipeline = rg.load("deferred-msaa", scene="many_lights", size=(96, 54), patches=[UNSHADOWED])
    images = [
        session.render(every_sample(pipeline, light), outputs=["image"])
        for light in ("deferred_lighting", "deferred_stencil_lights")
    ]
    assert images[0]["image"].mean() > 2
    assert (steps_apart(*images) > 1).mean() <= 0.001


@pytest.mark.nightly
def test_memory_is_shared_poisoned_and_shuffled_without_a_trace(session: rg.Session) -> None:
    pipeline = rg.load("deferred-msaa", scene="glass", size=(48, 32))
    plain = session.render(pipeline, alias=False)
    assert np.isfinite(plain["radiance"]).all()
    for options in ({"poison": True}, {"poison": True, "shuffle": 5}):
        again = session.render(pipeline, **options)
        for name in ("radiance", "edge_share"):
            np.testing.assert_array_equal(again.arrays[name], plain.arrays[name])
