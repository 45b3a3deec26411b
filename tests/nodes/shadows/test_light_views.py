"""Views of lights: what they hold, and how tightly."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import pytest
from rendergraph.nodes.shadows import _light_views as views

from rendergraph.api import SceneError
from rendergraph.api.viewing import box_corners, look_at, visible_part
from rendergraph.scene.cameras import projection
from rendergraph.scene.model import Camera, Light, Mesh, Object
from rendergraph.steps import ViewMatrices


def camera(
    eye: Any = (0, 2, 6), target: Any = (0, 0, 0), far: float = 100.0, kind: Any = "perspective"
) -> ViewMatrices:
    made = Camera("c", look_at(eye, target), type=kind, near=0.1, far=far, height=3.0)
    return ViewMatrices(
        np.asarray(np.linalg.inv(made.transform), np.float64), projection(made, 1.5), (300, 200), 0.1, far
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


def test_a_spot_view_is_its_cone() -> None:
    light = Light("s", "spot", (0, 5, 0), (0, -1, 0.2), outer=0.5)
    view = views.spot_view(light, np.array([[-5.0, -1, -5], [5, 2, 5]]), 512)
    axis = np.array(light.direction) / np.linalg.norm(light.direction)
    side = np.cross(axis, [1.0, 0, 0])
    side /= np.linalg.norm(side)
    rim = [np.array(light.position) + 3 * (axis * math.cos(0.5) + s * side * math.sin(0.5)) for s in (1, -1)]
    found = clip(view, np.array(rim))
    assert np.abs(found).max() <= 1.0
    assert np.abs(found[:, :2]).max() > 0.8


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
    lights = [Light("lamp", "spot"), Light("bulb", "point"), Light("sun", "directional")]
    assert views.layer_lights("auto", lights) == (2,)
    assert views.layer_lights("auto", lights[:2]) == (0,)
    assert views.layer_lights("auto", lights[1:2]) == ()
    silent = replace(lights[2], casts_shadow=False)
    assert views.layer_lights("auto", [*lights[:2], silent]) == (0,)
    assert views.layer_lights("auto", [silent]) == ()
    assert views.layer_lights("sun", [silent]) == (0,)  # what is asked for by name is what is meant
    assert views.layer_lights(("sun", "lamp"), lights) == (0, 2)
    assert views.layer_lights("bulb", lights) == (1,) * 6
    with pytest.raises(SceneError, match="the scene has no light 'lmap'; did you mean 'lamp'"):
        views.layer_lights("lmap", lights)


def test_views_carry_their_light() -> None:
    stage = Stage(
        lights=(Light("a", "spot", (0, 5, 0)), Light("b", "directional"), Light("c", "point", (0, 2, 0))),
        objects=(placed(0, 20.0), placed(1, 1.0, (0, 1, 0))),
    )
    made = views.light_views((0, 1, 2, 2, 2, 2, 2, 2), stage, camera(), 128)
    assert [view.light for view in made] == [0, 1, 2, 2, 2, 2, 2, 2]
    assert {view.size for view in made} == {(128, 128)}
    assert all(np.isfinite(view.projection).all() for view in made)


def test_nothing_seen_gives_a_view_all_the_same() -> None:
    stage = Stage(lights=(Light("b", "directional"),), objects=(placed(1, 1.0),), bounds=((-1, -1, -1), (1, 1, 1)))
    (view,) = views.light_views((0,), stage, camera((0, 0, 5), (0, 0, 10)), 64)
    assert np.isfinite(np.linalg.inv(view.projection)).all()
