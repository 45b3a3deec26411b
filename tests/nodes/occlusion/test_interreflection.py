"""Light between surfaces of the picture: closed forms, a path-traced reference, and itself under other light."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

import rendergraph as rg
from rendergraph.resources import shipped_scenes

pytestmark = pytest.mark.slow  # pictures of many samples

Floats = npt.NDArray[np.float64]
Draw = Callable[..., dict[str, Floats]]
ALL = pytest.mark.parametrize("technique", ["ssgi", "ssao-ssgi", "ssil"])


def radius_for(technique: str, metres: float) -> str:
    """The parameter that has light come from so far."""
    return f"gi.radius={metres if technique == 'ssgi' else metres / 5}"


@pytest.fixture
def draw(tmp_path: Path, session: rg.Session) -> Draw:
    """`draw(technique, scene, ports, *sets)`: values by port, shape (height, width, 3), top row first."""

    def run(
        technique: str,
        scene: Path | str,
        ports: dict[str, str],
        *sets: str,
        size: tuple[int, int] = (121, 121),
        patch: dict[str, Any] | None = None,
    ) -> dict[str, Floats]:
        if isinstance(scene, str) and "\n" in scene:
            file = tmp_path / "scene.yaml"
            file.write_text("scene: 1\n" + scene)
            scene = file
        without = ["light.ambient=0"] + ([] if technique.startswith("ssgi") else ["gi.ambient=0"])
        outputs = {"outputs": {"image": None, "radiance": None, **ports}}
        patches = [patch, outputs] if patch else [outputs]
        pipeline = rg.load(
            technique, scene=scene, size=size, sets=[*without, "gbuffer.precision=full", *sets], patches=patches
        )
        frame = session.render(pipeline, outputs=list(ports))
        return {name: np.asarray(frame.arrays[name], np.float64)[..., :3] for name in ports}

    return run


# --- closed forms ----------------------------------------------------------------------------------------------------

GROOVE = """objects:
  floor: {{shape: plane, size: [1.6, 1], at: [0, 0, 0.5], material: a}}
  wall: {{shape: plane, size: [1.6, 1], rotate_degrees: [90, 0, 0], at: [0, 0.5, 0], material: a}}
materials: {{a: {{base_color: [0.8, 0.8, 0.8], roughness: 1, emissive: [{light}, {light}, {light}]}}}}
lights: {{none: {{type: directional, direction: [0, -1, 0], intensity: 0}}}}
cameras: {{main: {{eye: [0, 4, 4], target: [0, 0.4, 0.4], height: 1.7, near: 0.1, far: 60}}}}
"""
SIDE = 121


def along_the_groove() -> Floats:
    """Metres from the crease of what the middle column sees, and whether that is the floor, row by row."""
    # The view looks down at 45°: floor and wall are seen alike, by the sine of it.
    up = (0.5 - (np.arange(SIDE) + 0.5) / SIDE) * 1.7
    return np.asarray(np.abs(up) * np.sqrt(2))


def exchange(across: int, along: int) -> Floats:
    """Form factors between patches of the groove's two sides, from its row to its column: 1.6 m long, 1 m deep.

    By symmetry both sides send alike. Rows are ordered by the distance to the crease, then along it.
    """
    deep, x = (np.arange(across) + 0.5) / across, ((np.arange(along) + 0.5) / along - 0.5) * 1.6
    near, far = np.repeat(deep, along), np.tile(x, across)
    squared = near[:, None] ** 2 + near[None] ** 2 + (far[:, None] - far[None]) ** 2
    return np.asarray(near[:, None] * near[None] / (np.pi * squared**2) * (1.6 / along / across))


@pytest.mark.nightly(keep=1)
@ALL
def test_a_groove_that_glows_is_the_closed_form(draw: Draw, technique: str) -> None:
    """Three bounces of two sides that see each other whole, by radiosity; their energies are a geometric series."""
    chain: dict[str, Any] = {
        "nodes": {
            name: {
                "type": technique.replace("-", "_"),
                "inputs": {"gbuffer": "gbuffer", "diffuse": f"{before}.reflected", "radiance": f"{before}.radiance"},
                "params": {"samples": 64, "denoise": 0, "radius": 1.5 if technique == "ssgi" else 0.3},
            }
            for before, name in (("gi", "gi2"), ("gi2", "gi3"))
        }
    }
    if technique != "ssgi":
        for node in chain["nodes"].values():
            node["params"]["ambient"] = 0
    ports = {"one": "gi.indirect", "two": "gi2.indirect", "three": "gi3.indirect"}
    sets = ("gi.samples=64", "gi.denoise=0", radius_for(technique, 1.5))
    found = draw(technique, GROOVE.format(light=1), ports, *sets, patch=chain)
    away = along_the_groove()
    judged = (away > 0.1) & (away < 0.9)
    factors, light = exchange(40, 41), np.ones(40 * 41)
    means = []
    for name in ports:
        light = factors @ light
        middle = light.reshape(40, 41)[:, 20]
        expected = np.interp(away[judged], (np.arange(40) + 0.5) / 40, middle)
        column = found[name][judged, SIDE // 2, 0]
        assert np.corrcoef(column, expected)[0, 1] > 0.97
        assert column.mean() == pytest.approx(expected.mean(), rel=0.15)
        means.append(column.mean())
        light = 0.8 * light
    assert means[2] / means[1] == pytest.approx(means[1] / means[0], rel=0.1)


BOX = """objects:
  back: {shape: plane, size: [1, 1], rotate_degrees: [90, 0, 0], at: [0, 0, -1], material: a}
  floor: {shape: plane, size: [1, 1], at: [0, -0.5, -0.5], material: a}
  ceiling: {shape: plane, size: [1, 1], rotate_degrees: [180, 0, 0], at: [0, 0.5, -0.5], material: a}
  left: {shape: plane, size: [1, 1], rotate_degrees: [0, 0, -90], at: [-0.5, 0, -0.5], material: a}
  right: {shape: plane, size: [1, 1], rotate_degrees: [0, 0, 90], at: [0.5, 0, -0.5], material: a}
materials: {a: {base_color: [0.8, 0.8, 0.8], roughness: 1, emissive: [1, 1, 1]}}
lights: {none: {type: directional, direction: [0, -1, 0], intensity: 0}}
cameras: {main: {eye: [0, 0, 0.8], target: [0, 0, 0], fov_y_degrees: 64.02, near: 0.1, far: 60}}
"""


def box_factors(across: int) -> Floats:
    """Form factors between the patches of the box's five sides, of which the back's come first.

    With the side that is open they add up to 1, which mends what points that stand for patches get wrong in corners.
    """
    side = (np.arange(across) + 0.5) / across - 0.5
    a, b = (grid.ravel() for grid in np.meshgrid(side, side))
    half = np.full(across**2, 0.5)
    places = [
        (a, b, -2 * half),
        (a, -half, b - 0.5),
        (a, half, b - 0.5),
        (-half, a, b - 0.5),
        (half, a, b - 0.5),
        (a, b, 0 * a),
    ]
    normals = [(0, 0, 1), (0, 1, 0), (0, -1, 0), (1, 0, 0), (-1, 0, 0), (0, 0, -1)]
    where = np.concatenate([np.stack(place, -1) for place in places])
    facing = np.repeat(np.array(normals, float), across**2, 0)
    apart = where[None] - where[:, None]
    squared = (apart**2).sum(-1) + np.eye(len(where))
    out, back = (apart * facing[:, None]).sum(-1), -(apart * facing[None]).sum(-1)
    shares = np.maximum(out, 0) * np.maximum(back, 0) / squared**2
    return np.asarray((shares / shares.sum(1, keepdims=True))[: -(across**2), : -(across**2)])


@pytest.mark.parametrize("technique", ["ssgi", "ssil"])
def test_bounces_in_a_closed_box_are_a_geometric_series(draw: Draw, technique: str) -> None:
    """All sides glow and see one another, and the eye closes the last: each bounce is a share of the one before.

    On the back, which is seen evenly. By radiosity the share is that of the matrix of form factors, times the albedo.
    """
    radius = {"radius": 2} if technique == "ssgi" else {"radius": 0.4, "ambient": 0}
    chain = {
        f"gi{n}": {
            "type": technique,
            "inputs": {"gbuffer": "gbuffer", "diffuse": f"{last}.reflected", "radiance": f"{last}.radiance"},
            "params": {"samples": 64, "denoise": 0, **radius},
        }
        for n, last in ((2, "gi"), (3, "gi2"), (4, "gi3"))
    }
    ports = {"one": "gi.reflected", "two": "gi2.reflected", "three": "gi3.reflected", "four": "gi4.reflected"}
    sets = ("gi.samples=64", "gi.denoise=0", radius_for(technique, 2))
    found = draw(technique, BOX, ports, *sets, size=(96, 96), patch={"nodes": chain})
    means = [found[name][30:66, 30:66].mean() for name in ports]  # the back: 4/9 of the picture's side
    factors, light, expected = box_factors(12), np.ones(5 * 144), []
    for _ in ports:
        light = 0.8 * factors @ light
        expected.append(light[:144].mean())
    shares, right = ([after / before for before, after in pairwise(series)] for series in (means, expected))
    assert means[0] == pytest.approx(expected[0], rel=0.06)
    assert shares[2] == pytest.approx(shares[1], rel=0.02)
    assert shares[2] == pytest.approx(right[2], rel=0.1)


@pytest.mark.nightly(keep=1)
@ALL
def test_light_is_linear_and_comes_from_nowhere_else(draw: Draw, technique: str) -> None:
    one, three, none = (draw(technique, GROOVE.format(light=light), {"x": "gi.indirect"})["x"] for light in (1, 3, 0))
    assert one.max() > 0.3
    np.testing.assert_allclose(three, 3 * one, rtol=5e-3, atol=1e-4)
    assert none.max() == 0


@ALL
def test_a_plane_sends_itself_nothing(draw: Draw, technique: str) -> None:
    scene = GROOVE.format(light=1).replace("  wall: {", "  away: {hidden: true, ")
    assert draw(technique, scene, {"x": "gi.indirect"})["x"].max() == 0


@pytest.mark.nightly(keep=1)
@pytest.mark.parametrize("technique", ["ssao-ssgi", "ssil"])
@pytest.mark.parametrize("height", [0.05, 1, 20])
@pytest.mark.parametrize("lens", ["fov_y_degrees: 60", "height: 3"])
def test_a_plane_hides_nothing_of_its_own_sky(draw: Draw, technique: str, height: float, lens: str) -> None:
    """At any slope: from 2° to 84°."""
    scene = f"""objects: {{floor: {{shape: plane, size: [40, 40]}}}}
cameras: {{main: {{eye: [0, {height}, 2], target: [0.3, 0, -1], {lens}, near: 0.1, far: 60}}}}
"""
    sets = ("gi.samples=16", "gi.radius=1", "gi.wider=1")
    assert draw(technique, scene, {"x": "gi.occlusion"}, *sets, size=(64, 48))["x"][..., 0].min() > 1 - 1e-3


@pytest.mark.nightly(keep=1)
@ALL
@pytest.mark.parametrize("by", [0.01, 250])
def test_light_in_other_units_is_the_same(draw: Draw, technique: str, by: float) -> None:
    """But for samples on a texel's border, which may round to either side."""

    def look(scale: float) -> Floats:
        sizes: dict[str, list[float]] = {
            "[1.6, 1]": [1.6, 1],
            "[0, 0, 0.5]": [0, 0, 0.5],
            "[0, 0.5, 0]": [0, 0.5, 0],
            "[0, 4, 4]": [0, 4, 4],
        }
        sizes["[0, 0.4, 0.4]"] = [0, 0.4, 0.4]
        scene = GROOVE.format(light=1)
        for text, numbers in sizes.items():
            scene = scene.replace(text, str([number * scale for number in numbers]))
        scene = scene.replace(
            "height: 1.7, near: 0.1, far: 60", f"height: {1.7 * scale}, near: {0.1 * scale}, far: {60 * scale}"
        )
        sets = [radius_for(technique, 1.5 * scale), "gi.samples=32"]
        sets += [f"gi.thickness={0.5 * scale}"] if technique == "ssil" else []
        return draw(technique, scene, {"x": "gi.indirect"}, *sets, size=(64, 64))["x"]

    one, other = look(1), look(by)
    assert one.max() > 0.3
    assert np.abs(other - one).max() < 0.03
    assert np.abs(other - one).mean() < 1e-3


@ALL
def test_light_stays_where_it_is_when_the_eye_goes_back(draw: Draw, technique: str) -> None:
    """Down the middle of the groove, by the distance to the crease, from 3 m and from 9 m."""

    def look(away: float) -> Floats:
        side, tangent = 120, 1.2 / away  # all of both sides
        lens = f"fov_y_degrees: {2 * np.degrees(np.arctan(tangent))}"
        eye = away / np.sqrt(2)
        scene = GROOVE.format(light=1).replace("eye: [0, 4, 4], target: [0, 0.4, 0.4], height: 1.7", "{}")
        scene = scene.replace("{}", f"eye: [0, {eye}, {eye}], target: [0, 0, 0], {lens}")
        sets = (radius_for(technique, 1.5), "gi.samples=64", "gi.denoise=0")
        column = draw(technique, scene, {"x": "gi.indirect"}, *sets, size=(side, side))["x"][:, side // 2, 0]
        slope = (1 - (np.arange(side) + 0.5) / side * 2) * tangent
        crease = np.sqrt(2) * np.abs(slope) * away / (1 + np.abs(slope))
        order = np.argsort(crease)
        return np.asarray(np.interp(np.linspace(0.15, 0.7, 40), crease[order], column[order]))

    near, far = look(3), look(9)
    assert near.min() > 0.05
    assert np.abs(far - near).mean() < 0.04 * near.mean()
    assert far.mean() == pytest.approx(near.mean(), rel=0.03)


# --- what is made of it ----------------------------------------------------------------------------------------------


@pytest.mark.nightly(keep=1)
@ALL
def test_the_picture_has_what_is_sent_on(draw: Draw, technique: str) -> None:
    """`radiance` is the lighting's and `reflected`, which is `indirect` times what is not metal of the base colour."""
    ports = {"lit": "light.radiance", "all": "gi.radiance", "sent": "gi.reflected", "came": "gi.indirect"}
    apart = draw(technique, "cornell_box", {"lit": "light.radiance"}, size=(64, 48))
    patch = {"outputs": {"albedo": "gbuffer.albedo"}}
    found = draw(technique, "cornell_box", {k: v for k, v in ports.items() if k != "lit"}, size=(64, 48), patch=patch)
    albedo = draw(technique, "cornell_box", {"albedo": "gbuffer.albedo"}, size=(64, 48))["albedo"] ** 2
    assert found["sent"].max() > 0.05
    np.testing.assert_allclose(found["sent"], found["came"] * albedo, rtol=3e-3, atol=1e-4)
    np.testing.assert_allclose(found["all"], apart["lit"] + found["sent"], rtol=3e-3, atol=2e-3)


@pytest.mark.parametrize("technique", ["ssao-ssgi", "ssil"])
def test_ambient_light_is_added_by_the_node_that_knows_the_occlusion(
    draw: Draw, tmp_path: Path, technique: str
) -> None:
    """Of stairs without textures, whose occlusion would count as well."""
    stairs = tmp_path / "stairs.yaml"
    stairs.write_text(re.sub(r"texture: \{[^}]*\}", "base_color: 0.5", shipped_scenes()["stairs"].read_text()))
    sets = ("gi.ambient=0.5", "light.terms=emissive")
    ports = {"all": "gi.radiance", "open": "gi.occlusion", "sent": "gi.reflected"}
    found = draw(technique, stairs, ports, *sets, size=(64, 48))
    albedo = draw(technique, stairs, {"albedo": "gbuffer.albedo"}, size=(64, 48))["albedo"] ** 2
    assert found["sent"].max() == 0
    assert found["open"][..., 0].min() < 0.7
    np.testing.assert_allclose(found["all"], 0.5 * albedo * found["open"][..., :1], rtol=3e-3, atol=1e-3)


def test_one_pass_finds_what_two_find(draw: Draw, session: rg.Session) -> None:
    sets = ("gi.samples=64", "gi.denoise=0")
    both = draw("ssao-ssgi", "cornell_box", {"open": "gi.occlusion", "came": "gi.indirect"}, *sets)
    alone = draw("ssgi", "cornell_box", {"came": "gi.indirect"}, *sets)
    assert alone["came"].max() > 0.1
    assert np.sqrt(np.mean((both["came"] - alone["came"]) ** 2)) < 0.02 * alone["came"].mean()
    patch = {"outputs": {"open": "ao.occlusion"}}
    disc = session.render(
        rg.load(
            "ssao-disc", scene="cornell_box", size=(121, 121), sets=["ao.samples=64", "ao.form=disc"], patches=[patch]
        )
    ).arrays["open"]
    difference = both["open"][..., 0] - np.asarray(disc, np.float64)[..., 0]
    assert disc.min() < 0.5
    assert np.sqrt(np.mean(difference**2)) < 0.05


# --- references ------------------------------------------------------------------------------------------------------


def test_one_bounce_is_the_path_traced_one(draw: Draw, shared: Path) -> None:
    """Correlation and energy of the first bounce, and more bounces nearer to all light there is."""
    here = shared / "reference" / "b4_gi" / "point"
    one, full = (picture(here / f"{name}.exr") for name in ("one_bounce", "full"))
    surfaces = np.load(here / "gbuffer.npz")
    judged = (surfaces["object"] > 0) & ~surfaces["edge"]
    chain = {
        "nodes": {
            "gi2": {
                "type": "ssgi",
                "inputs": {"gbuffer": "gbuffer", "diffuse": "gi.reflected", "radiance": "gi.radiance"},
                "params": {"samples": 64},
            }
        }
    }
    ports = {"sent": "gi.reflected", "once": "gi.radiance"}
    found = draw(
        "ssgi",
        here / "scene.glb",
        ports,
        "gi.samples=64",
        "sun.light=all",
        "light.environment=null",
        size=(192, 192),
        patch=chain,
    )
    twice = draw(
        "ssgi",
        here / "scene.glb",
        {"x": "gi2.radiance"},
        "gi.samples=64",
        "sun.light=all",
        "light.environment=null",
        size=(192, 192),
        patch=chain,
    )["x"]
    assert np.corrcoef(found["sent"][judged].ravel(), one[judged].ravel())[0, 1] > 0.93
    assert found["sent"][judged].sum() == pytest.approx(one[judged].sum(), rel=0.2)
    away = [np.sqrt(np.mean((seen[judged] - full[judged]) ** 2)) for seen in (found["once"], twice)]
    assert away[1] < 0.8 * away[0]


def picture(file: Path) -> Floats:
    from OpenImageIO import FLOAT, ImageBuf

    return np.asarray(ImageBuf(str(file)).get_pixels(FLOAT), np.float64)[..., :3]


@pytest.mark.nightly(keep=1)
@pytest.mark.parametrize(("case", "radius"), [("cornell", 0.3), ("cornell", 0.8), ("stairs", 0.5), ("stairs", 1.2)])
def test_bitmasks_find_the_ray_traced_occlusion(draw: Draw, shared: Path, case: str, radius: float) -> None:
    here = shared / "reference" / "b3_ao" / case
    truth = np.load(here / "ao.npz")
    sets = ("gi.samples=64", f"gi.radius={radius}", "gi.wider=1")
    found = draw("ssil", here / "scene.glb", {"open": "gi.occlusion"}, *sets, size=(192, 192))["open"][..., 0]
    judged = (truth["depth"] > 0) & ~truth["edge"]
    a, b = found[judged], truth[f"ao_r{radius}"][judged].astype(np.float64)
    assert np.corrcoef(a, b)[0, 1] > 0.92
    assert np.sqrt(np.mean((a - b) ** 2)) < 0.09


POST = """objects:
  wall: {shape: plane, size: [20, 20], rotate_degrees: [90, 0, 0]}
  post: {shape: cylinder, radius: 0.05, height: 8, at: [0, 0, 0.5]}
cameras: {main: {eye: [2, 0, 4], target: [0.2, 0, 0], fov_y_degrees: 40, near: 0.1, far: 60}}
"""


def test_bitmasks_know_that_a_post_is_thin(draw: Draw, session: rg.Session) -> None:
    """It hides at most a tenth of the wall behind it, its radius over its distance; horizons take it for a wall."""

    def darkest(thickness: float) -> float:
        sets = ("gi.samples=128", "gi.radius=1", "gi.wider=1", f"gi.thickness={thickness}")
        return float(draw("ssil", POST, {"open": "gi.occlusion"}, *sets)["open"][60, :, 0].min())

    assert 0.8 < darkest(0.1) < 0.97
    assert darkest(100) < 0.6


@pytest.mark.nightly(keep=1)
@ALL
def test_a_filter_takes_noise_and_leaves_the_light(draw: Draw, technique: str) -> None:
    """Few samples are nearer to many, and so is their total."""
    sets = ("gi.samples=8",)
    many = draw(technique, "cornell_box", {"x": "gi.indirect"}, "gi.samples=128", "gi.denoise=0")["x"]
    raw, smooth = (draw(technique, "cornell_box", {"x": "gi.indirect"}, *sets, f"gi.denoise={n}")["x"] for n in (0, 3))
    assert np.abs(smooth - many).mean() < 0.8 * np.abs(raw - many).mean()
    assert abs(smooth.mean() - many.mean()) < abs(raw.mean() - many.mean()) + 0.03 * many.mean()


def roughness(values: Floats) -> float:
    """The standard deviation that a cubic polynomial in x and y leaves, relative to the mean: noise, not gradients."""
    y, x = (axis.ravel() for axis in np.mgrid[-1 : 1 : values.shape[0] * 1j, -1 : 1 : values.shape[1] * 1j])
    basis = np.stack([x**i * y**j for i in range(4) for j in range(4 - i)], axis=1)
    flat = values.reshape(-1, values.shape[-1])
    return float((flat - basis @ np.linalg.lstsq(basis, flat, rcond=None)[0]).std(axis=0).mean() / flat.mean())


@pytest.mark.nightly
def test_indirect_light_in_the_courtyard_is_smooth(session: rg.Session) -> None:
    """Lanterns of a few pixels leave no blotches on the pink wall, and the filter no grid on the plinth's dark side."""
    frame = session.render(rg.load("full", size=(640, 360)), outputs=(), taps=("gi.indirect",), warm_up=False)
    indirect = np.asarray(frame["gi.indirect"], np.float64)[..., :3]
    assert roughness(indirect[65:200, 10:80]) < 0.07  # the wall; 0.098 if all blocks of 4×4 pixels sample alike
    assert roughness(indirect[240:285, 449:471]) < 0.015  # the plinth; 0.020 if the mean is off its pixel's centre


@pytest.mark.parametrize(("case", "radius"), [("cornell", 0.8), ("stairs", 1.2)])
def test_far_light_leaves_occlusion_as_it_is(session: rg.Session, shared: Path, case: str, radius: float) -> None:
    """By default light comes from five radii; with too few steps within one, occlusion is 0.05 to 0.09 too open."""
    here = shared / "reference" / "b3_ao" / case
    camera = json.loads((here / "case.json").read_text())["camera"]
    truth = np.load(here / "ao.npz")
    size = (camera["width"], camera["height"])
    pipeline = rg.load("ssil", scene=here / "scene.glb", size=size, sets=(f"gi.radius={radius}",))
    frame = session.render(pipeline, outputs=(), taps=("gi.occlusion",), warm_up=False)
    judged = (truth["depth"] > 0) & ~truth["edge"]
    off = frame.arrays["gi.occlusion"][..., 0][judged] - truth[f"ao_r{radius}"][judged].astype(np.float64)
    assert np.sqrt(np.mean(off**2)) < 0.09
    assert abs(off.mean()) < 0.045


@pytest.mark.nightly(keep=1)
@ALL
def test_half_size_is_near_full_size(draw: Draw, technique: str) -> None:
    full, half = (
        draw(technique, "cornell_box", {"x": "gi.indirect"}, "gi.samples=64", f"gi.scale={scale}", size=(182, 182))["x"]
        for scale in (1, 0.5)  # in smaller pictures, several of an arm's 16 steps fall on one texel
    )
    assert np.abs(half - full).mean() < 0.15 * full.mean()
    assert half.mean() == pytest.approx(full.mean(), rel=0.05)


# --- back faces ------------------------------------------------------------------------------------------------------

LAMP = """objects:
  wall: {shape: plane, size: [6, 6], rotate_degrees: [90, 0, 0], material: wall}
  lamp: {shape: box, size: [1, 1, 0.05], at: [0, 0, 0.625], material: lamp}
materials: {wall: {base_color: [1, 1, 1]}, lamp: {base_color: [1, 1, 1], emissive: [1, 1, 1]}}
lights: {none: {type: directional, direction: [0, -1, 0], intensity: 0}}
cameras: {main: {eye: [0, 0, 8], target: [0, 0, 0], height: 3, near: 0.1, far: 60}}
"""


def test_a_lamp_lights_the_wall_behind_it(draw: Draw) -> None:
    """A glowing plate 0.6 m before a wall shows the eye its front alone; what its back sends is a form factor."""
    sets = ("gi.samples=128", "gi.denoise=0")
    found = draw("ssgi-back-faces", LAMP, {"x": "gi.indirect"}, *sets)["x"][60, :, 0]
    alone = draw("ssgi", LAMP, {"x": "gi.indirect"}, *sets)["x"][60, :, 0]
    x = ((np.arange(121) + 0.5) / 121 - 0.5) * 3
    judged = (np.abs(x) > 0.6) & (np.abs(x) < 1.2)
    lamp = (np.arange(100) + 0.5) / 100 - 0.5
    across, up = np.meshgrid(lamp, lamp)
    squared = (across[..., None] - x[judged]) ** 2 + up[..., None] ** 2 + 0.6**2
    expected = (0.6**2 / (np.pi * squared**2)).sum((0, 1)) / 100**2
    assert alone[judged].max() < 0.01
    assert expected.max() > 0.1
    assert np.corrcoef(found[judged], expected)[0, 1] > 0.95
    assert found[judged].mean() == pytest.approx(expected.mean(), rel=0.2)


def test_back_faces_look_away(draw: Draw, session: rg.Session) -> None:
    """Normals of a box's far sides are its own, and lie behind what is seen."""
    patch = {"outputs": {"back": "back.depth", "front": "gbuffer.depth", "normal": "back.normal"}}
    frame = session.render(rg.load("ssgi-back-faces", scene="shadow_study", size=(96, 72), patches=[patch]))
    there = frame.arrays["back"][..., 0] > 0
    assert there.mean() > 0.05
    assert (frame.arrays["back"][..., 0][there] < frame.arrays["front"][..., 0][there]).mean() > 0.95
