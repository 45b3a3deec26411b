"""Cascaded shadow maps: splits, what each part holds, texels that stand still, pictures against ray casting."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from rendergraph.nodes.shadows._cascades import overlapping_spans, split_distances
from rendergraph.nodes.shadows.shadow_cascaded import ShadowCascaded

import rendergraph as rg
from rendergraph.api import ViewMatrices, projection
from rendergraph.scene.facts import FrameScene
from rendergraph.scene.model import Scene

Floats = npt.NDArray[np.float64]
SUN = (-0.6, -0.65, 0.3)


def test_splits_are_the_reference(shared: Path) -> None:
    cases = json.loads((shared / "reference/b6_math/vectors.json").read_text())["cascade_splits"]
    assert {case["lam"] for case in cases} != {0.5}
    for case in cases:
        found = split_distances(case["near"], case["far"], case["count"], case["lam"])
        np.testing.assert_allclose(found, case["distances"], rtol=1e-12)


def test_spans_meet_or_overlap() -> None:
    assert overlapping_spans([1, 3, 7, 15], 0) == [(0, 3), (3, 7), (7, math.inf)]
    assert overlapping_spans([1, 3, 7, 15], 0.25) == [(0, 3), (2.5, 7), (6, math.inf)]
    assert overlapping_spans([1, 9], 0.25) == [(0, math.inf)]


# --- views -----------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Sun:
    type: str = "directional"
    direction: Any = SUN


@dataclass(eq=False)
class Box:
    """The corners of a mesh."""

    box: Any = ((-0.5, 0, -0.5), (0.5, 4, 0.5))


@dataclass(frozen=True)
class Post:
    """A caster."""

    transform: Any
    mesh: int = 0
    casts_shadow: bool = True
    hidden: bool = False
    pose: None = None


@dataclass(eq=False)
class Field:
    """Posts far and wide, as a node's `update` sees them."""

    lights: tuple[Sun, ...] = (Sun(),)
    meshes: tuple[Box, ...] = (Box(),)
    bounds: Any = ((-100.0, 0.0, -150.0), (100.0, 4.0, 150.0))
    objects: Any = ()

    def __post_init__(self) -> None:
        def post(x: float, z: float) -> Post:
            transform = np.eye(4)
            transform[:3, 3] = x, 0, z
            return Post(transform)

        self.objects = [post(x, z) for x in range(-99, 100, 11) for z in range(-149, 150, 11)]
        scene = FrameScene(Scene("field", objects=tuple(self.objects), meshes=self.meshes))  # type: ignore[arg-type]
        self.corners, self.shown, self.casting = scene.corners, scene.shown, scene.casting
        self.catchers = scene.catchers


@dataclass(frozen=True)
class Seen:
    """A frame: its scene and camera; no texture is linked that carries another."""

    scene: Any
    camera: ViewMatrices

    def views(self, port: Any) -> tuple[ViewMatrices, ...]:
        return ()


def camera(eye: Any, target: Any, far: float = 300.0) -> ViewMatrices:
    view = projection.inverse_rigid(projection.look_at(eye, target))
    return ViewMatrices(view, projection.perspective(0.8, 1.6, 0.1, far), (320, 200), 0.1, far)


FIELD = Field()


def cascades(eye: Any = (0, 2, 100), target: Any = (0, 1, 0), far: float = 300.0, **params: Any) -> list[ViewMatrices]:
    node = ShadowCascaded(**{"resolution": 1024, **params})
    return list(node.light_views(Sun(), Seen(FIELD, camera(eye, target, far))))  # type: ignore[arg-type]


def texel(view: ViewMatrices) -> Floats:
    """Metres a texel across and up."""
    return np.asarray(2 / (view.projection[[0, 1], [0, 1]] * view.size[0]))


def clip(view: ViewMatrices, points: Floats) -> Floats:
    homogeneous = np.concatenate([points, np.ones((len(points), 1))], 1) @ (view.projection @ view.view).T
    return np.asarray(homogeneous[:, :3] / homogeneous[:, 3:])


@pytest.mark.parametrize("count", [1, 2, 4, 8])
@pytest.mark.parametrize("far", [300.0, math.inf])
@pytest.mark.parametrize("eye", [(0, 2, 100), (90, 30, -20), (0, 1, -140)])
def test_every_point_that_is_seen_is_in_its_part(count: int, far: float, eye: Any) -> None:
    views = cascades(eye, (3, 0, 0), far, cascades=count)
    seen = camera(eye, (3, 0, 0), far)
    rng = np.random.default_rng(5)
    points = rng.uniform(FIELD.bounds[0], FIELD.bounds[1], (20_000, 3))
    points = points[np.all(np.abs(clip(seen, points)) <= 1, axis=1)]
    assert len(points) > 200
    distance = -(points @ seen.view[2, :3] + seen.view[2, 3])
    casts = points @ projection.view_along(SUN)[:2, :3].T  # in the light's plane, within what casts
    posts = np.concatenate([projection.box_corners(Box().box) + one.transform[:3, 3] for one in FIELD.objects])
    across = posts @ projection.view_along(SUN)[:2, :3].T
    within = np.all((casts >= across.min(axis=0)) & (casts <= across.max(axis=0)), axis=1)
    assert views[0].span[0] == 0
    assert views[-1].span[1] == math.inf
    for view in views:
        inside = within & (distance >= view.span[0]) & (distance <= view.span[1])
        assert np.abs(clip(view, points[inside])).max(initial=0) <= 1 - 8 / 1024 * 0.99  # and a kernel around it
    sizes = [texel(view).max() for view in views]
    assert sizes == sorted(sizes)
    if count >= 4:
        assert sizes[0] < sizes[-1] / 5


def test_texels_stand_still_under_a_moving_camera() -> None:
    """200 frames of walking, turning and nodding: each part keeps its size, and the world its place in the texels."""
    points = np.random.default_rng(1).uniform(FIELD.bounds[0], FIELD.bounds[1], (50, 3))
    before: list[tuple[Floats, Floats]] | None = None
    resized = 0
    for frame in range(200):
        eye = (0.13 * frame, 2 + 0.3 * math.sin(0.2 * frame), 100 - 0.21 * frame)
        views = cascades(eye, (eye[0] + 9 * math.sin(0.03 * frame), 1, eye[2] - 20), cascades=4)
        now = [(texel(view), clip(view, points)[:, :2] * view.size[0] / 2) for view in views]
        if before is not None:
            for (size, place), (size_before, place_before) in zip(now, before, strict=True):
                if not np.allclose(size, size_before, rtol=1e-12):
                    resized += 1
                    continue
                moved = place - place_before
                np.testing.assert_allclose(moved, np.round(moved), atol=1e-5)
        before = now
    assert resized <= 4 * 3  # when the scene's far end comes nearer, three times in 42 metres


# --- pictures --------------------------------------------------------------------------------------------------------


def wrong_share(session: rg.Session, shared: Path, *sets: str) -> float:
    """Per cent of the pixels away from edges whose lit state is not the ray-cast one."""
    here = shared / "reference/b2_shadows/dir_cascades"
    given, masks = json.loads((here / "case.json").read_text())["camera"], np.load(here / "masks.npz")
    size = (given["width"], given["height"])
    loaded = rg.load("forward-prepass", scene=here / "scene.glb", size=size, sets=sets)
    lit = session.render(loaded, outputs=(), taps=("shadows.visibility",), warm_up=False).arrays["shadows.visibility"]
    judged = np.isin(masks["cls"], (1, 2)) & ~masks["edge"].astype(bool)
    return float(100 * ((lit[0, ..., 0] > 0.5) != (masks["cls"] == 1))[judged].mean())


@pytest.mark.nightly(keep=1)
@pytest.mark.slow
@pytest.mark.parametrize(("kind", "most"), [("shadow_pcf", 0.1), ("shadow_vsm", 0.3), ("shadow_esm", 0.3)])
def test_a_long_field(session: rg.Session, shared: Path, kind: str, most: float) -> None:
    """Boxes from 4 to 160 metres, by four maps of 1024 texels: better than one of 2048, whatever filters them."""
    filtered = (f"shadows.type={kind}", *(() if kind == "shadow_pcf" else ("shadows.radius=1",)))
    found = wrong_share(session, shared, *filtered, "sun.type=shadow_cascaded", "sun.resolution=1024")
    assert found <= most
    assert found < wrong_share(session, shared, *filtered, "sun.resolution=1024")


@pytest.mark.nightly(keep=1)
@pytest.mark.parametrize("pipeline", ["shadow-cascaded", "shadow-trapezoidal"])
@pytest.mark.parametrize("scene", ["avenue", "courtyard"])
def test_defaults_suit_long_and_short_scenes(session: rg.Session, pipeline: str, scene: str) -> None:
    """Against eight fine cascades, away from edges and on faces that the sun reaches."""

    def lit(name: str, *sets: str) -> npt.NDArray[np.bool_]:
        loaded = rg.load(name, scene=scene, size=(160, 90), sets=sets)
        frame = session.render(loaded, outputs=(), taps=("shadows.visibility", "gbuffer.normal"), warm_up=False)
        sun = next(light for light in loaded.link().scene.lights if light.type == "directional")
        facing = frame["gbuffer.normal"][..., :3] @ -np.asarray(sun.direction) > 0.2
        return np.where(facing, frame.arrays["shadows.visibility"][0, ..., 0] > 0.5, True)

    fine = ("sun.cascades=8", "sun.resolution=2048", "sun.weight=0.95", "shadows.taps=1", "shadows.normal_offset=0.5")
    truth, found = lit("shadow-cascaded", *fine), lit(pipeline)
    windows = np.lib.stride_tricks.sliding_window_view(np.pad(truth, 1, mode="edge"), (3, 3))
    inside = windows.all((-1, -2)) | ~windows.any((-1, -2))
    assert (~truth).mean() > 0.01
    assert (found != truth)[inside].mean() < (0.003 if pipeline == "shadow-cascaded" else 0.01)


MOVING = """scene: 1
objects:
  floor: {shape: plane, size: [200, 200]}
POSTS
lights: {sun: {type: directional, direction: [-0.6, -0.65, 0.3], intensity: 3}}
cameras: {main: {eye: [0, 2, 60], target: [1, 1, 0], fov_y_degrees: 45, near: 0.1, far: 300}}
keyframes:
  cameras.main.eye: {0: [0, 2, 60], 1: [5, 2.5, 51]}
"""


def test_maps_hold_the_same_when_the_eye_moves(session: rg.Session, tmp_path: Path) -> None:
    """What is drawn, not the views alone: where two frames' maps overlap, their texels are the same."""
    posts = [
        f"  p{x}_{z}: {{shape: box, size: [1, 4, 1], at: [{x}, 2, {z}]}}" for x in (-9, 4) for z in range(-40, 61, 9)
    ]
    (tmp_path / "moving.yaml").write_text(MOVING.replace("POSTS", "\n".join(posts)))
    sets = ("sun.type=shadow_cascaded", "sun.resolution=256")
    loaded = rg.load("forward-prepass", scene=tmp_path / "moving.yaml", size=(64, 36), sets=sets)
    first, second = (
        np.array(frame.arrays["sun.shadow_map"][..., 0])
        for frame in session.frames(loaded, frames=range(1, 9, 7), outputs=(), taps=("sun.shadow_map",))
    )
    moves = []
    for before, now in zip(first[:3], second[:3], strict=True):
        assert np.ptp(before) > 0.01
        found = {}
        for y, x in np.ndindex(121, 121):
            y, x = y - 60, x - 60
            a = before[max(y, 0) : 256 + min(y, 0), max(x, 0) : 256 + min(x, 0)]
            b = now[max(-y, 0) : 256 + min(-y, 0), max(-x, 0) : 256 + min(-x, 0)]
            found[y, x] = a, b
        # A few rows decide which move it is, all texels whether the maps are the same.
        move = min(found, key=lambda key: int((np.abs(found[key][0][::16] - found[key][1][::16]) > 1e-5).sum()))
        assert (np.abs(found[move][0] - found[move][1]) > 1e-5).mean() <= 1e-3
        moves.append(move)
    assert moves[0] != (0, 0)
