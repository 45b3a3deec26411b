"""Percentage-closer filtering: every kernel against brute force, the pipeline against ray-cast masks."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

import rendergraph as rg

Floats = npt.NDArray[np.float64]
Bilinear = Callable[..., Floats]


def brute_force(
    bilinear: Bilinear, depth: Floats, places: Floats, offsets: Floats, weights: Floats | None = None
) -> Floats:
    """The mean of bilinear tests at offsets in texels, (n, 2) or (…, n, 2)."""
    each = [
        bilinear(
            depth,
            places[..., 0] + o[..., 0] / depth.shape[1],
            places[..., 1] + o[..., 1] / depth.shape[0],
            np.minimum(places[..., 2], 1.0),
        )
        for o in np.moveaxis(offsets, -2, 0)
    ]
    return np.average(each, axis=0, weights=weights)


def grid(taps: int) -> Floats:
    """Offsets of taps × taps tests one texel apart."""
    along = np.arange(taps) - (taps - 1) / 2
    return np.stack(np.meshgrid(along, along), -1).reshape(-1, 2)


@pytest.mark.parametrize(("taps", "name"), [(1, "bilinear_2x2"), (3, "bilinear_3x3")])
def test_brute_force_is_the_reference(shared: Path, bilinear: Bilinear, taps: int, name: str) -> None:
    """What the node is compared with below is itself compared with numbers made by somebody else."""
    folder = shared / "reference" / "b7_post"
    depth = np.load(folder / "shadow_maps.npz")["pcf_depth"].astype(float)
    for case in json.loads((folder / "values.json").read_text())["pcf"]["cases"]:
        place = np.array([case["u"], case["v"], case["receiver"]])
        assert brute_force(bilinear, depth, place, grid(taps)) == pytest.approx(case[name], abs=1e-6)


@pytest.mark.nightly(keep=2)
@pytest.mark.slow
@pytest.mark.parametrize(
    ("kernel", "taps", "edges"),
    [
        ("box", 2, "false"),
        ("box", 3, "true"),
        ("box", 4, "false"),
        ("box", 16, "true"),
        ("tent", 2, "false"),
        ("tent", 5, "true"),
        ("tent", 16, "false"),
        ("poisson", 4, "false"),
        ("poisson", 16, "true"),
        ("rotated", 3, "true"),
        ("rotated", 12, "false"),
    ],
)
def test_each_kernel_is_the_mean_of_its_tests(
    look: Any, bilinear: Bilinear, poisson_disc: Floats, kernel: str, taps: int, edges: str
) -> None:
    sets = [f"shadows.{name}" for name in (f"taps={taps}", f"kernel={kernel}", "samples=24", f"edges_only={edges}")]
    seen = look("shadow-pcf", *sets)
    weights = None
    offsets = grid(taps)
    if kernel == "tent":
        along = np.minimum(np.arange(taps) + 1, taps - np.arange(taps))
        weights = np.outer(along, along).ravel()
    elif kernel == "poisson":
        offsets = poisson_disc[:24] * taps / 2
    elif kernel == "rotated":
        y, x = np.mgrid[0:64, 0:96] + 0.5
        angle = 2 * np.pi * np.mod(52.9829189 * np.mod(0.06711056 * x + 0.00583715 * y, 1), 1)
        turn = np.stack([np.cos(angle), -np.sin(angle), np.sin(angle), np.cos(angle)], -1).reshape(64, 96, 2, 2)
        offsets = np.einsum("yxij,nj->yxni", turn, poisson_disc[:24] * taps / 2)
    expected = brute_force(bilinear, seen.depth, seen.places, offsets, weights)
    ground = seen.seen & (np.abs(seen.position[..., 1]) < 1e-3)  # it is not in the map, so it does not meet itself
    soft = ground & (expected > 0.01) & (expected < 0.99)
    assert soft.sum() > 40
    wrong = np.abs(seen.visibility - expected)[ground]
    assert np.mean(wrong > 1e-3) < 2e-3  # a test may fall otherwise in single precision
    assert np.mean(wrong) < 2e-4


def test_points_on_the_disc_are_spread(poisson_disc: Floats) -> None:
    assert poisson_disc.shape == (64, 2)
    assert np.linalg.norm(poisson_disc, axis=1).max() <= 1
    for n in (4, 8, 16, 24, 32, 48, 64):
        some = poisson_disc[:n]
        apart = np.linalg.norm(some[:, None] - some[None], axis=-1) + 9 * np.eye(n)
        assert apart.min() * np.sqrt(n) > 1.4
        assert np.linalg.norm(some.mean(0)) < 1.5 / n


# --- pictures against ray casting ------------------------------------------------------------------------------------


def wrong_share(session: rg.Session, shared: Path, case: str, *sets: str, pipeline: str = "forward") -> float:
    """Per cent of the pixels away from shadow edges whose lit state is not the ray-cast one."""
    here = shared / "reference" / "b2_shadows" / case
    camera = json.loads((here / "case.json").read_text())["camera"]
    masks = np.load(here / "masks.npz")
    sets = ("light.ambient=0", "light.terms=diffuse", "shadows.taps=1", *sets)
    size = (camera["width"], camera["height"])
    frame = rg.load(pipeline, scene=here / "scene.glb", size=size, sets=sets).render(
        session=session, outputs=["radiance"]
    )
    lit = frame["radiance"][..., :3].sum(-1) > 1e-6
    judged = (masks["cls"] > 0) & ~masks["edge"].astype(bool)
    return float(100 * (lit != (masks["cls"] == 1))[judged].mean())


@pytest.mark.nightly(keep=2)
@pytest.mark.slow
@pytest.mark.parametrize("case", ["dir_basic", "dir_camera_in_shadow", "dir_cascades", "spot_basic"])
def test_hard_shadows_are_the_ray_cast_ones(session: rg.Session, shared: Path, case: str) -> None:
    assert wrong_share(session, shared, case) <= 0.02
    assert wrong_share(session, shared, case, pipeline="forward-prepass") <= 0.02
    assert wrong_share(session, shared, case, "sun.resolution=64") > 0.02


def test_a_point_light_has_six_layers(session: rg.Session, shared: Path) -> None:
    assert wrong_share(session, shared, "point_room", "sun.light=point", "sun.resolution=1024") <= 0.02


@pytest.mark.slow
def test_wider_kernels_make_no_acne(session: rg.Session, shared: Path) -> None:
    """Away from shadows a lit surface is wholly lit, also at a slope and through 16×16 taps."""
    here = shared / "reference" / "b2_shadows" / "dir_basic"
    masks = np.load(here / "masks.npz")
    for taps in (1, 3, 16):
        sets = ("light.ambient=0", "light.terms=diffuse", f"shadows.taps={taps}")
        shadowed = rg.load("forward", scene=here / "scene.glb", size=(384, 384), sets=sets).render(session=session)[
            "radiance"
        ]
        bare = rg.load("forward", scene=here / "scene.glb", size=(384, 384), sets=(*sets, "light.lookup=null"))
        ratio = shadowed[..., 1] / np.maximum(bare.render(session=session)["radiance"][..., 1], 1e-6)
        far = (masks["cls"] == 1) & ~masks["edge"].astype(bool)
        for _ in range(14):  # pixels farther from any edge than the kernel is wide
            grown = np.pad(far, 1, mode="edge")
            far = far & grown[:-2, 1:-1] & grown[2:, 1:-1] & grown[1:-1, :-2] & grown[1:-1, 2:]
        assert far.sum() > 10_000
        assert np.mean(ratio[far] < 0.999) < 1e-3


# --- both forms ------------------------------------------------------------------------------------------------------


@pytest.mark.nightly(keep=1)
@pytest.mark.slow
@pytest.mark.parametrize("scene", ["cornell_box", "shadow_study", "spheres"])
def test_both_forms_give_the_same_picture(session: rg.Session, scene: str) -> None:
    pictures = [
        rg.load(name, scene=scene, size=(640, 360)).render(session=session)["image"].astype(int)
        for name in ("forward", "forward-prepass")
    ]
    assert np.mean(np.abs(pictures[0] - pictures[1]).max(-1) > 1) <= 1e-3


def test_lights_that_are_not_named_cast_no_shadow(gl: Any, shared: Path) -> None:
    scene = shared / "reference" / "b1_direct" / "point_spot_persp" / "scene.glb"
    with_map = rg.load("forward", scene=scene, size=(80, 60)).link().graph
    assert with_map.facts.lights[1].type == "spot"
    (info,) = [info for end, info in with_map.textures.items() if str(end) == "sun.shadow_map"]
    assert info.lights == (1,)


def test_a_light_that_casts_no_shadow_is_not_chosen(tmp_path: Path) -> None:
    scene = tmp_path / "scene.yaml"
    text = """scene: 1
objects: {floor: {shape: plane, size: [4, 4]}}
lights:
  sky: {type: directional, direction: [0, -1, 0.2], casts_shadow: false}
  lamp: {type: spot, at: [0, 3, 0], direction: [0, -1, 0]}
"""
    scene.write_text(text)
    assert [info.lights for info in _maps(scene)] == [(1,)]
    scene.write_text(text.replace("casts_shadow: false", "casts_shadow: true"))
    assert [info.lights for info in _maps(scene)] == [(0,)]


def _maps(scene: Path) -> list[Any]:
    graph = rg.load("forward", scene=scene).link().graph
    return [info for end, info in graph.textures.items() if str(end) == "sun.shadow_map"]


def test_without_a_light_that_casts_visibility_is_one(session: rg.Session) -> None:
    """Lights that cast no shadow: `auto` finds nothing, the pass is culled, and the picture is the unshadowed one."""
    scene = "many_lights"
    frame = rg.load("forward", scene=scene, size=(64, 64)).render(session=session)
    bare = rg.load("forward", scene=scene, size=(64, 64), sets=["light.lookup=null"]).render(session=session)
    assert "sun" in frame.culled
    np.testing.assert_array_equal(frame["radiance"], bare["radiance"])
