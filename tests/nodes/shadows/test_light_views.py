"""Views of lights: what they hold, and how tightly."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest
from msgspec.structs import replace
from rendergraph.nodes.shadows import _light_views as views
from rendergraph.nodes.shadows.shadow_map import ShadowMapNode

from rendergraph.api import SceneError
from rendergraph.api.projection import box_corners, look_at, visible_part
from rendergraph.scene.cameras import projection_matrix
from rendergraph.scene.facts import FrameScene
from rendergraph.scene.model import Camera, Light, Mesh, Object, Scene
from rendergraph.steps import ViewMatrices


def camera(
    eye: Any = (0, 2, 6), target: Any = (0, 0, 0), far: float = 100.0, kind: Any = "perspective"
) -> ViewMatrices:
    made = Camera("c", look_at(eye, target), type=kind, near=0.1, far=far, height=3.0)
    return ViewMatrices(
        np.asarray(np.linalg.inv(made.transform), np.float64), projection_matrix(made, 1.5), (300, 200), 0.1, far
    )


def quad() -> Mesh:
    positions = np.array([[-1, 0, -1], [1, 0, -1], [1, 0, 1], [-1, 0, 1]], np.float32)
    return Mesh(
        "quad", positions, np.array([[0, 2, 1], [0, 3, 2]], np.uint32), np.tile(np.array([0, 1, 0], np.float32), (4, 1))
    )


def cube() -> Mesh:
    positions = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], np.float32)
    return Mesh("cube", positions, np.zeros((1, 3), np.uint32), positions)


@dataclass(eq=False)
class Stage:
    """A floor with boxes on it, as a node's `update` sees it."""

    lights: tuple[Light, ...] = ()
    objects: tuple[Object, ...] = ()
    meshes: tuple[Mesh, ...] = field(default_factory=lambda: (quad(), cube()))
    bounds: Any = ((-20.0, -1.0, -20.0), (20.0, 3.0, 20.0))

    def __post_init__(self) -> None:
        scene = FrameScene(Scene("stage", objects=self.objects, meshes=self.meshes))
        self.corners, self.shown, self.casting = scene.corners, scene.shown, scene.casting
        self.catchers = scene.catchers


def placed(mesh: int, scale: float, at: Any = (0, 0, 0), **more: Any) -> Object:
    transform = np.diag([scale, scale, scale, 1.0])
    transform[:3, 3] = at
    return Object("o", mesh, 0, transform, **more)


def clip(view: ViewMatrices, points: Any) -> Any:
    homogeneous = np.concatenate([points, np.ones((len(points), 1))], 1) @ (view.projection @ view.view).T
    return homogeneous[:, :3] / homogeneous[:, 3:]


@pytest.mark.parametrize("direction", [(0, -1, 0), (-1, -2, -1), (0.3, -0.2, 0.9), (1, 0, 0)])
@pytest.mark.parametrize("far", [30.0, math.inf])
def test_a_directional_view_holds_what_is_seen(direction: Any, far: float) -> None:
    box = np.array([[-5.0, -1, -5], [5, 2, 5]])
    made = camera(far=far)
    seen = visible_part(made, box)
    assert len(seen) >= 4
    view = views.directional_view(direction, made, box, np.empty((0, 3)), 1024)
    inside = clip(view, seen)
    assert np.abs(inside).max() <= 1.0
    assert np.abs(inside[:, :2]).max() > 0.97  # and no more than a few texels around it
    along = clip(view, box_corners(box))[:, 2]
    assert along.min() >= -1.0
    assert along.max() <= 1.0


def test_a_floor_with_nothing_beneath_casts_on_nothing() -> None:
    stage = Stage(objects=(placed(0, 20.0), placed(1, 1.0, (0, 1, 0)), placed(1, 1.0, (9, 1, 0), casts_shadow=False)))
    casting = views.casting_points(stage, (0.3, -1, 0))
    assert casting.shape == (8, 3)
    assert np.abs(casting).max() <= 2.0
    from_below = views.casting_points(stage, (0.3, 1, 0))
    assert len(from_below) == 16


def test_a_floor_with_something_beneath_casts() -> None:
    stage = Stage(objects=(placed(0, 20.0), placed(1, 1.0, (0, -3, 0))))
    assert len(views.casting_points(stage, (0.3, -1, 0))) == 16


def test_a_leaf_over_a_floor_that_casts_nothing_casts() -> None:
    leaf, floor = placed(0, 1.0, (5, 2, 0)), placed(0, 20.0, casts_shadow=False)
    assert len(views.casting_points(Stage(objects=(floor, leaf, placed(1, 1.0))), (0, -1, 0))) == 16
    assert len(views.casting_points(Stage(objects=(floor, leaf)), (0, -1, 0), (0, 1, 0))) == 0  # the light is below it
    assert len(views.casting_points(Stage(objects=(floor, leaf)), (0, -1, 0), (0, 3, 0))) == 8


def test_a_spot_view_without_casters_is_its_cone() -> None:
    light = Light("s", "spot", (0, 5, 0), (0, -1, 0.2), outer=0.5)
    view = views.spot_view(light, Stage(bounds=((-5.0, -1, -5), (5, 2, 5))), camera(), 512)
    axis = np.array(light.direction) / np.linalg.norm(light.direction)
    side = np.cross(axis, [1.0, 0, 0])
    side /= np.linalg.norm(side)
    rim = [np.array(light.position) + 3 * (axis * math.cos(0.5) + s * side * math.sin(0.5)) for s in (1, -1)]
    found = clip(view, np.array(rim))
    assert np.abs(found).max() <= 1.0
    assert np.abs(found[:, :2]).max() > 0.8


def hit(start: Any, ends: Any, low: Any, high: Any) -> Any:
    """Which segments from a point meet a box (slabs)."""
    with np.errstate(divide="ignore", invalid="ignore"):
        a, b = (low - start) / (ends - start), (high - start) / (ends - start)
    enter, leave = np.minimum(a, b).max(axis=1), np.maximum(a, b).min(axis=1)
    return (enter < leave) & (enter < 1) & (leave > 0)


@pytest.mark.parametrize("outer", [0.4, 1.0, 1.49])
@pytest.mark.parametrize("beside", [False, True])
def test_a_spot_view_holds_what_is_seen_in_shadow(outer: float, beside: bool) -> None:
    """Seen points behind a caster lie in the map, and the caster before them; hardly anything else does."""
    light = Light("s", "spot", (0.5, 5, 0), (0.1, -1, 0.2), outer=outer)
    boxes = [(1.0, (0, 1, 0)), (0.5, (1, 0.5, 2))] + ([(1.0, (3, 5, 0))] if beside else [])
    stage = Stage(objects=(placed(0, 20.0), *(placed(1, scale, at) for scale, at in boxes)))
    seen = camera((0, 2, 4), (0, 0, 0))
    view = views.spot_view(light, stage, seen, 512)
    rng = np.random.default_rng(2)
    points = rng.uniform(stage.bounds[0], stage.bounds[1], (200_000, 3))
    start, axis = np.array(light.position), np.array(light.direction) / np.linalg.norm(light.direction)
    rays = points - start
    inside = rays @ axis > math.cos(outer) * np.linalg.norm(rays, axis=1)
    inside &= (np.abs(clip(seen, points)) < 1).all(axis=1) & ((points - (0, 2, 4)) @ (0, -1, -2) > 0)
    dark = np.zeros(len(points), bool)
    for scale, at in boxes:
        dark |= hit(start, points, np.array(at) - scale, np.array(at) + scale)
    found = clip(view, points[inside & dark])
    assert len(found) > 100
    assert np.abs(found[:, :2]).max() <= 1.0
    assert found[:, 2].max() <= 1.0
    if not beside:
        corners = clip(view, views.casting_points(stage, light.direction, light.position))
        assert corners[:, 2].min() >= -1.0
        assert view.near > 1  # begins at the box, three metres below
    if outer > 1 and not beside:
        assert 1 / view.projection[0, 0] < 0.3 * math.tan(outer)


def test_the_faces_of_a_point_light_cover_all_directions() -> None:
    light = Light("p", "point", (0, 1, 0))
    faces = views.point_views(light, np.array([[-5.0, -1, -5], [5, 3, 5]]), 256)
    rng = np.random.default_rng(1)
    points = rng.normal(size=(500, 3))
    points = np.array(light.position) + 2 * points / np.linalg.norm(points, axis=1, keepdims=True)
    covered = np.zeros(len(points), bool)
    for face in faces:
        behind = (points @ face.view[:3, :3].T + face.view[:3, 3])[:, 2] >= 0
        covered |= ~behind & np.all(np.abs(clip(face, points)) <= 1.0, axis=1)
    assert covered.all()


def test_layers_follow_the_scenes_order() -> None:
    def layers(wanted: Any, lights: Any) -> tuple[int, ...]:
        return views.layer_lights(wanted, lights, ShadowMapNode().layers)

    lights = [Light("lamp", "spot"), Light("bulb", "point"), Light("sun", "directional")]
    assert layers("auto", lights) == (2,)
    assert layers("auto", lights[:2]) == (0,)
    assert layers("auto", lights[1:2]) == (0,) * 6
    silent = replace(lights[2], casts_shadow=False)
    assert layers("auto", [*lights[:2], silent]) == (0,)
    assert layers("auto", [silent]) == ()
    assert layers("sun", [silent]) == (0,)  # what is asked for by name is what is meant
    assert layers(("sun", "lamp"), lights) == (0, 2)
    assert layers("bulb", lights) == (1,) * 6
    with pytest.raises(SceneError, match="the scene has no light 'lmap'; did you mean 'lamp'"):
        layers("lmap", lights)


def test_each_kind_of_light_has_its_views() -> None:
    lights = (Light("a", "spot", (0, 5, 0)), Light("b", "directional"), Light("c", "point", (0, 2, 0)))
    stage = Stage(lights=lights, objects=(placed(0, 20.0), placed(1, 1.0, (0, 1, 0))))
    for light, count in zip(lights, (1, 1, 6), strict=True):
        made = views.light_views(light, stage, camera(), 128)
        assert len(made) == count == ShadowMapNode().layers(light.type)
        assert {view.size for view in made} == {(128, 128)}
        assert all(np.isfinite(view.projection).all() for view in made)


def test_nothing_seen_gives_a_view_all_the_same() -> None:
    stage = Stage(lights=(Light("b", "directional"),), objects=(placed(1, 1.0),), bounds=((-1, -1, -1), (1, 1, 1)))
    (view,) = views.light_views(stage.lights[0], stage, camera((0, 0, 5), (0, 0, 10)), 64)
    assert np.isfinite(np.linalg.inv(view.projection)).all()
