"""All kinds of screen-space occlusion against ray tracing, closed forms, and themselves from elsewhere."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

import rendergraph as rg
from rendergraph.scene.cameras import view_matrices

pytestmark = pytest.mark.slow  # pictures of many samples

Floats = npt.NDArray[np.float64]
Occlusion = Callable[..., Floats]
ALL = pytest.mark.parametrize("technique", ["hemisphere", "disc", "hbao", "gtao"])
CASES = [("cornell", 0.3), ("cornell", 0.8), ("stairs", 0.5), ("stairs", 1.2)]


# --- ray-traced occlusion --------------------------------------------------------------------------------------------


def errors(occlusion: Occlusion, shared: Path, technique: str, case: str, radius: float, **params: Any) -> Any:
    """Correlation with the ray-traced picture, and RMSE, where something is and away from its edges."""
    here = shared / "reference" / "b3_ao" / case
    camera = json.loads((here / "case.json").read_text())["camera"]
    truth = np.load(here / "ao.npz")
    size = (camera["width"], camera["height"])
    found = occlusion(technique, here / "scene.glb", size, radius=radius, **params)
    judged = (truth["depth"] > 0) & ~truth["edge"]
    a, b = found[judged], truth[f"ao_r{radius}"][judged].astype(np.float64)
    return np.corrcoef(a, b)[0, 1], np.sqrt(np.mean((a - b) ** 2))


@pytest.mark.parametrize(("case", "radius"), CASES)
def test_hemispheres_find_the_ray_traced_occlusion(
    occlusion: Occlusion, shared: Path, case: str, radius: float
) -> None:
    correlation, rmse = errors(occlusion, shared, "hemisphere", case, radius, samples=64)
    assert correlation > 0.94
    assert rmse < 0.08


@pytest.mark.nightly(keep=6)
@pytest.mark.parametrize(("technique", "least"), [("disc", 0.88), ("hbao", 0.93), ("gtao", 0.93)])
@pytest.mark.parametrize(("case", "radius"), CASES)
def test_arms_find_the_ray_traced_occlusion(
    occlusion: Occlusion, shared: Path, technique: str, least: float, case: str, radius: float
) -> None:
    correlation, rmse = errors(occlusion, shared, technique, case, radius, samples=64)
    assert correlation > least
    assert rmse < 0.09


@pytest.mark.parametrize(("case", "radius"), CASES)
def test_strips_with_few_samples_are_nearer_than_many_discs(
    occlusion: Occlusion, shared: Path, case: str, radius: float
) -> None:
    correlation, rmse = errors(occlusion, shared, "disc", case, radius, samples=16)
    assert correlation > 0.91
    assert rmse < 0.075
    assert rmse < errors(occlusion, shared, "disc", case, radius, samples=64, form="disc")[1]


@pytest.mark.nightly(keep=1)
@pytest.mark.parametrize(("case", "radius"), CASES)
def test_more_samples_are_nearer(occlusion: Occlusion, shared: Path, case: str, radius: float) -> None:
    def falling(technique: str, **params: Any) -> list[float]:
        return [errors(occlusion, shared, technique, case, radius, samples=n, **params)[1] for n in (8, 32, 128)]

    few, some, many = falling("disc")
    assert few > 1.03 * some > 1.02 * many
    few, some, many = falling("hemisphere", blur=0)
    assert few > 1.1 * some > many


@pytest.mark.nightly(keep=1)
@pytest.mark.parametrize("technique", ["hbao", "gtao"])
def test_horizons_settle_as_samples_rise(occlusion: Occlusion, technique: str) -> None:
    """What is left against ray tracing is what the picture does not show: so against many samples of its own."""
    many = occlusion(technique, "stairs", samples=128, radius=1)
    far = [np.abs(occlusion(technique, "stairs", samples=n, radius=1) - many).mean() for n in (8, 16, 32, 64)]
    assert far[0] > 1.15 * far[1]
    assert far[1] > 1.15 * far[2]
    assert far[2] > 1.15 * far[3]
    assert far[0] < 0.05


@ALL
@pytest.mark.parametrize("scale", [0.5, 0.25])
def test_reduced_size_keeps_most(occlusion: Occlusion, shared: Path, technique: str, scale: float) -> None:
    correlation, rmse = errors(occlusion, shared, technique, "stairs", 1.2, samples=64, scale=scale)
    assert correlation > 0.83
    assert rmse < 0.11


# --- closed forms ----------------------------------------------------------------------------------------------------

PLANE = """objects: {{floor: {{shape: plane, size: [40, 40]}}}}
cameras: {{main: {{eye: [0, {height}, 2], target: [0.3, 0, -1], {lens}, near: 0.1, far: 60}}}}
"""


@pytest.mark.nightly(keep=9)
@ALL
@pytest.mark.parametrize("scale", [1, 0.5, 0.125])
@pytest.mark.parametrize("height", [0.05, 1, 20])
@pytest.mark.parametrize("lens", ["fov_y_degrees: 60", "height: 3"])
def test_a_plane_alone_is_open(occlusion: Occlusion, technique: str, scale: float, height: float, lens: str) -> None:
    found = occlusion(technique, PLANE.format(height=height, lens=lens), samples=16, scale=scale, radius=1)
    assert found.min() == 1


CORNER = """objects:
  floor: {{shape: plane, size: [40, 40], at: [0, 0, 20]}}
  wall: {{shape: plane, size: [40, 40], rotate_degrees: [90, 0, 0], at: [0, 20, 0]}}
cameras: {{main: {{eye: [0, {eye}, {eye}], target: [0, 0, {target}], {lens}, near: 0.1, far: 60}}}}
"""


def in_corner(distance: Floats, radius: float) -> Floats:
    """Openness of a plane at a distance from a wall at right angles to it, for hits nearer than the radius.

    The directions that reach the wall in time are a cap around its normal; seen from above, cosine-weighted, that is
    the segment x >= c of the unit circle.
    """
    c = np.clip(distance / radius, 0, 1)
    return np.asarray(1 - (np.arccos(c) - c * np.sqrt(1 - c**2)) / np.pi)


@pytest.mark.parametrize(("technique", "bound"), [("hemisphere", 0.055), ("disc", 0.035), ("gtao", 0.035)])
@pytest.mark.parametrize("lens", ["fov_y_degrees: 30", "height: 3"])
def test_a_corner_is_the_closed_form(occlusion: Occlusion, technique: str, bound: float, lens: str) -> None:
    """Down the middle column of a picture of the floor beside a wall."""
    side, eye, target = 121, 4.0, 0.8
    away = floor_distance(side, eye, target, lens)
    judged = (away > 0.08) & (away < 1.4)
    assert judged.sum() > 30
    expected = in_corner(away[judged], 1.0)

    def column(**params: float) -> Floats:
        scene = CORNER.format(eye=eye, target=target, lens=lens)
        found = occlusion(technique, scene, (side, side), samples=128, radius=1, **params)
        return np.asarray(found[judged, side // 2])

    two, whole = column(), column(scale=1)
    for found in (two, whole):
        assert np.abs(found - expected).max() < bound
        assert np.corrcoef(found, expected)[0, 1] > 0.97
    # The blur reaches five texels of 0.03, of half size four of twice that; what others share two, and three of those.
    blurred = technique == "hemisphere"
    np.testing.assert_array_equal(two[away[judged] > (1.15 if blurred else 1.25)], 1)
    np.testing.assert_allclose(two[away[judged] > 1.05], 1, atol=2e-3 if blurred else 4e-3)
    np.testing.assert_allclose(whole[away[judged] > 1.05], 1, atol=4e-4 if blurred else 0)
    if blurred:
        np.testing.assert_array_equal(column(blur=0)[away[judged] > 1.05], 1)


def test_the_sky_above_a_corner_comes_from_the_open_side(session: rg.Session, tmp_path: Path) -> None:
    """Bent normals down the middle column: the mean open direction, cosine-weighted.

    Seen from above, blocked directions are the segment x >= c of the unit circle; what is open is the rest of it.
    """
    side, eye, target, lens = 121, 4.0, 0.8, "height: 3"
    (tmp_path / "scene.yaml").write_text("scene: 1\n" + CORNER.format(eye=eye, target=target, lens=lens))
    patch = {"outputs": {"bent": "ao.bent_normal"}}
    sets = ["ao.samples=128", "ao.radius=1"]
    pipeline = rg.load("ssao-gtao", scene=tmp_path / "scene.yaml", size=(side, side), sets=sets, patches=[patch])
    away = floor_distance(side, eye, target, lens)
    judged = (away > 0.08) & (away < 1.4)
    bent = session.render(pipeline, outputs=["bent"])["bent"][judged, side // 2, :3].astype(float)
    c = np.clip(away[judged], 0, 1)
    towards = 2 / 3 * (1 - c**2) ** 1.5  # z, from the wall
    up = 2 * np.pi / 3 - np.pi / 2 * (2 / 3 - c + c**3 / 3)
    expected = np.stack([0 * c, up, towards], -1) / np.hypot(up, towards)[:, None]
    np.testing.assert_allclose(np.linalg.norm(bent, axis=-1), 1, atol=1e-3)
    assert np.degrees(np.arccos(np.clip((bent * expected).sum(-1), -1, 1))).max() < 3
    assert expected[:, 2].max() > 0.35


def test_light_between_surfaces_brightens_by_the_papers_fit(occlusion: Occlusion) -> None:
    plain, lit = (occlusion("gtao", "cornell_box", albedo=albedo) for albedo in (0, 0.7))
    a, b, c = 2.0404 * 0.7 - 0.3324, -4.7951 * 0.7 + 0.6417, 2.7552 * 0.7 + 0.6903
    np.testing.assert_allclose(lit, np.maximum(plain, ((a * plain + b) * plain + c) * plain), atol=1e-4)
    assert (lit - plain).max() > 0.1


@pytest.mark.parametrize("attenuation", [0.0, 0.5, 1.0])
def test_horizons_weigh_the_sky_by_how_far_off_it_goes(occlusion: Occlusion, attenuation: float) -> None:
    """`hbao` in a corner, seen from 45°: the integral of 1 - a (r / R)² over the sine, slice by slice through the eye."""
    side, eye, target, radius = 121, 4.0, 0.8, 0.5
    away = floor_distance(side, eye, target, "height: 3")
    judged = (away > 0.1) & (away < 0.9 * radius)
    to_eye = np.array([0, eye, eye - target]) / np.hypot(eye, eye - target)
    upward = np.cross(to_eye, [1, 0, 0])
    turns = (np.arange(360) + 0.5) * np.pi / 180
    on_screen = np.cos(turns)[:, None] * np.array([1, 0, 0]) + np.sin(turns)[:, None] * upward
    steps = np.linspace(0, 1, 2001)

    def hidden(distance: float, along: Floats) -> float:
        # Outwards by `out` on the screen the slice is on the floor up to the wall z = 0, and then on the wall.
        foot = -distance / (along[2] - to_eye[2] * along[1] / to_eye[1])
        if not 0 < foot < radius:
            return 0.0
        out = foot + steps * (radius - foot)
        near = -(distance + out * along[2]) / to_eye[2]
        far = np.hypot(out, near)
        sine, within = near / far, far[1:] <= radius
        weight = 1 - attenuation * ((far[1:] + far[:-1]) / 2 / radius) ** 2
        return float((weight * np.diff(sine).clip(0))[within].sum())

    expected = [1 - np.mean([hidden(distance, along) for along in on_screen]) for distance in away[judged]]
    scene = CORNER.format(eye=eye, target=target, lens="height: 3")
    found = occlusion("hbao", scene, (side, side), samples=128, radius=radius, scale=1, attenuation=attenuation)
    off = found[judged, side // 2] - expected
    assert np.abs(off[1:] + off[:-1]).max() / 2 < 0.03  # two rows share what they find


def floor_distance(side: int, eye: float, target: float, lens: str) -> Floats:
    """Where the middle of each row of the picture of `CORNER` meets the floor: z."""
    kind, number = lens.split(": ")
    up = 1 - (np.arange(side) + 0.5) / side * 2
    forward = np.array([-eye, target - eye]) / np.hypot(eye, eye - target)  # y, z
    upward = np.array([-forward[1], forward[0]])
    if kind == "height":
        start = np.array([eye, eye]) + up[:, None] * upward * float(number) / 2
        along = np.broadcast_to(forward, start.shape)
    else:
        along = forward + up[:, None] * upward * np.tan(np.radians(float(number) / 2))
        start = np.broadcast_to([eye, eye], along.shape)
    return np.asarray(start[:, 1] - start[:, 0] / along[:, 0] * along[:, 1])


FLOATING = """objects:
  floor: {{shape: plane, size: [20, 20]}}
  plate: {{shape: box, size: [1, 0.1, 1], at: [0, {height}, 0]}}
cameras: {{main: {{eye: [0, 6, 2], target: [0, 0, 0], fov_y_degrees: 40, near: 0.1, far: 60}}}}
"""


@pytest.mark.parametrize(("technique", "trace"), [("hemisphere", 0.015), ("disc", 0.0), ("hbao", 0.0), ("gtao", 0.0)])
def test_nothing_beyond_the_radius_occludes(occlusion: Occlusion, technique: str, trace: float) -> None:
    """A plate above the floor darkens it around; twice the radius up it does not, though it is beside it on screen.

    Hemispheres leave a trace: the plate's front face, extended, cuts some of the floor's directions.
    """
    assert occlusion(technique, FLOATING.format(height=0.35), samples=64, radius=0.6).min() < 0.9
    assert occlusion(technique, FLOATING.format(height=1.25), samples=64, radius=0.6).min() >= 1 - trace


FENCES = """objects:
  floor: {shape: plane, size: [40, 40]}
  fence1: {shape: box, size: [30, 0.5, 0.02], at: [0, 0.25, -1.5]}
  fence2: {shape: box, size: [30, 0.5, 0.02], at: [0, 0.25, -1]}
  fence3: {shape: box, size: [30, 0.5, 0.02], at: [0, 0.25, -0.5]}
  fence4: {shape: box, size: [30, 0.5, 0.02], at: [0, 0.25, 0]}
cameras: {main: {eye: [0, 4, 4], target: [0, 0, 0.6], fov_y_degrees: 40, near: 0.1, far: 60}}
"""


def test_with_a_falloff_occlusion_ends_gradually(occlusion: Occlusion) -> None:
    """On a floor beside a wall: as dark in the corner, never darker, and without the slope at the radius's end."""
    scene = CORNER.format(eye=4.0, target=0.8, lens="height: 3")
    away = floor_distance(121, 4.0, 0.8, "height: 3")
    sharp, soft = (
        occlusion("gtao", scene, (121, 121), radius=1, samples=128, scale=1, falloff=falloff)[:, 60]
        for falloff in (0, 0.6)
    )
    floor = away > 0.05
    assert (soft >= sharp - 2e-3)[floor].all()
    assert soft[floor & (away < 0.08)].max() < 0.65
    outer = floor & (away > 0.5) & (away < 1.1)
    assert sharp[outer].min() < soft[outer].min() - 0.02
    np.testing.assert_allclose(soft[floor & (away > 0.9)], 1, atol=0.02)


def test_discs_behind_discs_hide_nothing_more(occlusion: Occlusion) -> None:
    """Before a row of fences a floor sees the first alone: sin² of the elevation of its upper edge over two.

    Down the middle of the picture; all four together, as if none hid another, would hide twice as much.
    """
    side = 121
    found = occlusion("disc", FENCES, (side, side), samples=64, radius=6)
    away = floor_distance(side, 4.0, 0.6, "fov_y_degrees: 40") - 0.01
    judged = (away > 0.15) & (away < 1.2)
    assert judged.sum() > 20
    expected = 0.5 * (1 + away[judged] / np.hypot(away[judged], 0.5))
    assert np.abs(found[judged, side // 2] - expected).mean() < 0.1  # the formula favours what is low: up to a tenth


POST = """objects:
  wall: {shape: plane, size: [20, 20], rotate_degrees: [90, 0, 0]}
  post: {shape: cylinder, radius: 0.05, height: 8, at: [0, 0, 0.5]}
cameras: {main: {eye: [2, 0, 4], target: [0.2, 0, 0], fov_y_degrees: 40, near: 0.1, far: 60}}
"""


def test_hemispheres_see_that_a_post_is_thin(occlusion: Occlusion) -> None:
    """It hides at most a tenth of the wall behind it, its radius over its distance, wherever the eye sees it."""
    found = occlusion("hemisphere", POST, (121, 121), samples=128, radius=1)
    column = int(np.argmin(found[60]))
    assert found[60, column] < 0.95
    assert found[60, column] > 0.68


# --- the same from elsewhere -----------------------------------------------------------------------------------------

STUDY = """objects:
  floor: {{shape: plane, size: [{s20}, {s20}]}}
  box: {{shape: box, size: [{s1}, {s1}, {s1}], at: [0, {s05}, 0]}}
  ball: {{shape: sphere, radius: {s05}, at: [{s1}, {s05}, {s05}]}}
cameras: {{main: {{eye: [0, {eye}, {eye}], target: [0, {s05}, 0], fov_y_degrees: {fov},
  near: {near}, far: {far}}}}}
"""


def study(by: float, eye: float = 4.0, fov: float = 40.0) -> str:
    sizes = {"s20": 20 * by, "s1": by, "s05": by / 2, "eye": eye * by, "near": 0.1 * by, "far": 60 * by}
    return STUDY.format(**sizes, fov=fov)


@ALL
@pytest.mark.parametrize("by", [0.01, 250])
def test_a_scene_in_other_units_is_the_same_picture(occlusion: Occlusion, technique: str, by: float) -> None:
    """But for samples on a texel's border, which may round to either side; neighbours share them."""
    one = occlusion(technique, study(1), samples=32, radius=0.7)
    other = occlusion(technique, study(by), samples=32, radius=0.7 * by)
    assert one.min() < 0.6
    assert np.abs(one - other).max() < 0.03
    assert np.abs(one - other).mean() < 2e-4


@pytest.mark.nightly(keep=1)
@pytest.mark.parametrize(
    ("technique", "most", "mean"),
    [("hemisphere", 0.1, 0.012), ("disc", 0.12, 0.015), ("hbao", 0.12, 0.015), ("gtao", 0.12, 0.015)],
)
def test_occlusion_stays_where_it_is_when_the_eye_goes_back(
    session: rg.Session, tmp_path: Path, technique: str, most: float, mean: float
) -> None:
    """The same points of floor, box and ball, seen from one and a half times as far: no darker, no lighter."""

    def look(eye: float) -> tuple[Floats, Floats, Any]:
        file = tmp_path / "scene.yaml"
        file.write_text("scene: 1\n" + study(1, eye))
        patch = {"outputs": {"occlusion": "ao.occlusion", "depth": "gbuffer.depth"}}
        sets = ["ao.samples=128", "ao.radius=0.7"]
        pipeline = rg.load(f"ssao-{technique}", scene=file, size=(240, 180), sets=sets, patches=[patch])
        frame = session.render(pipeline)
        view = view_matrices(next(iter(pipeline.link().scene.cameras.values())), (240, 180))
        return (
            frame.arrays["occlusion"][::-1, :, 0].astype(float),
            frame.arrays["depth"][::-1, :, 0].astype(float),
            view,
        )

    (near, depth, close), (far, far_depth, away) = look(4), look(6)
    rows, columns = np.nonzero(depth > 0)
    ndc = np.stack([(columns + 0.5) / 120 - 1, (rows + 0.5) / 90 - 1, 1 - 2 * depth[rows, columns], np.ones(len(rows))])
    world = np.linalg.inv(close.projection @ close.view) @ ndc
    clip = away.projection @ away.view @ (world / world[3])
    x, y, z = (clip[:3] / clip[3] * [[1], [1], [-1]] + 1) / 2
    column, row = (x * 240).astype(int), (y * 180).astype(int)
    same = np.abs(far_depth[row, column] - z) < 1e-4
    difference = (near[rows, columns] - far[row, column])[same]
    assert same.mean() > 0.8
    assert near[rows, columns][same].min() < 0.5
    assert np.quantile(np.abs(difference), 0.98) < most
    assert np.abs(difference).mean() < mean
    assert abs(difference.mean()) < 0.006


# --- parameters, and what becomes of it ------------------------------------------------------------------------------


def test_what_is_near_the_eye_is_left_open(occlusion: Occlusion) -> None:
    """Bound and picture: the lower part of the picture is nearer than 5 m, the upper part is not."""
    everywhere = occlusion("hemisphere", study(1), radius=0.7, blur=0)
    cut = occlusion("hemisphere", study(1), radius=0.7, blur=0, nearest=5.3)
    open_now = (cut == 1) & (everywhere < 1)
    assert open_now.any()
    np.testing.assert_array_equal(cut[~open_now], everywhere[~open_now])
    assert np.nonzero(open_now)[0].mean() > np.nonzero(cut < 1)[0].mean()
    assert occlusion("hemisphere", study(1), radius=0.7, blur=0, nearest=60).min() == 1


@pytest.mark.nightly(keep=1)
@ALL
def test_ambient_light_is_scaled(session: rg.Session, technique: str) -> None:
    def radiance(*sets: str) -> Any:
        sets = (*sets, "light.terms=ambient", "light.ambient=0.5", "gbuffer.precision=full")
        patch = {"outputs": {"radiance": "light.radiance", "occlusion": "ao.occlusion"}}
        return session.render(
            rg.load(f"ssao-{technique}", scene="cornell_box", size=(64, 48), sets=sets, patches=[patch])
        )

    with_it, without = radiance(), radiance("light.occlusion=null")
    expected = without["radiance"][..., :3] * with_it.arrays["occlusion"][..., :1]
    assert with_it.arrays["occlusion"].min() < 0.7
    np.testing.assert_allclose(with_it["radiance"][..., :3], expected, rtol=2e-3, atol=1e-5)


@ALL
def test_the_default_picture_is_the_same_every_time(occlusion: Occlusion, technique: str) -> None:
    a, b = (occlusion(technique, "cornell_box", (65, 47), scale=0.3) for _ in range(2))
    np.testing.assert_array_equal(a, b)
    assert np.isfinite(a).all()
    assert 0.5 < a.mean() < 1
