"""Which lights cast, and the views their shadow maps are drawn with."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
import numpy.typing as npt

from rendergraph.api import ViewMatrices, casting_lights, projection

Matrix = npt.NDArray[np.float64]
Points = npt.NDArray[np.float64]

_WIDEST = math.radians(86)  # half angle of a cone that one perspective view still covers with care
_MARGIN = 8.0  # texels around what is seen, so that filter kernels at its edge read drawn texels


def layer_lights(wanted: str | Sequence[str], lights: Sequence[Any], layers: Callable[[str], int]) -> tuple[int, ...]:
    """The light of each layer, as an index into the scene's lights.

    Args:
        wanted: `auto`, `all`, a light's name, or several; see `casting_lights`.
        lights: the scene's lights, with `name`, `type` and `casts_shadow`, which `auto` asks for.
        layers: how many a light of a kind has.

    Raises:
        SceneError: no light has that name.
    """
    return tuple(index for index in casting_lights(wanted, lights) for _ in range(layers(lights[index].type)))


# --- one kind each ---------------------------------------------------------------------------------------------------


def light_views(light: Any, scene: Any, camera: ViewMatrices, resolution: int) -> Sequence[ViewMatrices]:
    """The views of one light: one, or six around a point light.

    Args:
        light: a light of the scene.
        scene: its `lights`, `bounds`, `corners`, `shown` and `casting` in this frame.
        camera: what the picture is seen with.
        resolution: texels along a side.
    """
    box = np.asarray(scene.bounds, np.float64)
    if light.type == "directional":
        casting = casting_points(scene, light.direction)
        return (directional_view(light.direction, camera, box, casting, resolution),)
    if light.type == "spot":
        return (spot_view(light, scene, camera, resolution),)
    return point_views(light, box, resolution)


def directional_view(
    direction: Sequence[float], camera: ViewMatrices, box: Points, casting: Points, resolution: int
) -> ViewMatrices:
    """An orthographic view along a direction around what may have shadow on it in the picture.

    Across the light it is as narrow as what the camera sees of the box and as what casts; what lies outside is lit.
    Along the light it holds the whole box, for what stands outside the picture may cast into it.
    """
    rotation = projection.view_along(direction, _grain(direction, camera))
    corners = projection.box_corners(box)
    along = corners @ rotation[2, :3]
    low, high = np.full(2, -np.inf), np.full(2, np.inf)
    for points in (projection.visible_part(camera, box), casting, corners):
        if not len(points):
            continue
        across = rotation[:2, :3] @ points.T
        lower, higher = np.maximum(low, across.min(axis=1)), np.minimum(high, across.max(axis=1))
        if np.any(lower > higher):  # nothing that casts is near what is seen
            break
        low, high = lower, higher
    return projection.orthographic_view(
        rotation, np.append(low, along.min()), np.append(high, along.max()), resolution, _MARGIN
    )


def spot_view(light: Any, scene: Any, camera: ViewMatrices, resolution: int) -> ViewMatrices:
    """A perspective view around what may have shadow on it in the picture, within a spot light's cone.

    Across the light's axis it is as narrow as what the camera sees within the cone, and as what casts there; along it,
    it begins at what casts and ends at what is seen.
    """
    box = np.asarray(scene.bounds, np.float64)
    half_angle = min(light.outer, _WIDEST)
    cone = projection.cone_view(light.position, light.direction, half_angle, *reach(light, box), resolution)
    planes = projection.frustum_planes(cone)
    visible = [planes, projection.frustum_planes(camera), projection.box_planes(box)]
    seen = projection.region_corners(np.concatenate(visible))
    boxes = casting_points(scene, light.direction, light.position).reshape(-1, 8, 3)
    casting, begin = _within_cone(cone, boxes)
    widest = np.full(2, 1 / cone.projection[0, 0])
    low, high, near, far = -widest, widest, cone.near, cone.far
    if len(seen) and len(casting):
        there, distances = _slopes(cone, seen)
        lower = np.maximum(np.maximum(there.min(axis=0), casting.min(axis=0)), low)
        higher = np.minimum(np.minimum(there.max(axis=0), casting.max(axis=0)), high)
        if np.all(lower < higher):  # else nothing that casts is near what is seen
            low, high, far = lower, higher, float(distances.max()) * 1.001
            near = max(min(begin * 0.999, far * 0.5), cone.near)
    return projection.narrowed_view(cone, low, high, near, far, _MARGIN)


def _slopes(view: ViewMatrices, points: Points) -> tuple[Points, Points]:
    """Points as a view from their origin has them: x and y over the distance along its axis, and that distance."""
    there = points @ view.view[:3, :3].T + view.view[:3, 3]
    return there[..., :2] / -there[..., 2:], -there[..., 2]


def _within_cone(cone: ViewMatrices, boxes: Points) -> tuple[Points, float]:
    """Slopes whose hull holds what a perspective view sees of boxes, shape (n, 3), and how near that begins.

    Args:
        cone: the view.
        boxes: corners, shape (n, 8, 3).
    """
    distances = -(boxes @ cone.view[2, :3] + cone.view[2, 3])
    before = np.all(distances > cone.near, axis=1)
    slopes = _slopes(cone, boxes[before])[0]
    widest = 1 / cone.projection[0, 0]
    seen = np.all((slopes.max(axis=1) > -widest) & (slopes.min(axis=1) < widest), axis=1)
    near = float(distances[before][seen].min(initial=cone.far))
    found = [slopes[seen].reshape(-1, 2)]
    sides = projection.frustum_planes(cone)[:5]
    for box in boxes[~before & np.any(distances > cone.near, axis=1)]:  # of those beside the light, what is before it
        faces = [projection.clip_polygon(box[list(face)], sides) for face in projection.BOX_FACES]
        if sum(map(len, faces)):
            found.append(_slopes(cone, np.concatenate([face.reshape(-1, 3) for face in faces]))[0])
            near = cone.near
    return np.concatenate(found), near


def point_views(light: Any, box: Points, resolution: int) -> Sequence[ViewMatrices]:
    """Six perspective views around a point light, in the order of a cube map's faces; each a little wider than 90°."""
    return projection.cube_views(light.position, *reach(light, box), resolution, _MARGIN)


def reach(light: Any, box: Points) -> tuple[float, float]:
    """Nearest and farthest distance from a light that anything in the box may have, within the light's range."""
    position = np.asarray(light.position, np.float64)
    outside = np.maximum(np.maximum(box[0] - position, position - box[1]), 0.0)
    farthest = float(np.linalg.norm(np.maximum(np.abs(position - box[0]), np.abs(position - box[1])))) * 1.001
    far = max(min(farthest, light.range or math.inf), 1e-3)
    # A plane at this distance cuts away less than the ball around the light that holds nothing.
    near = max(float(np.linalg.norm(outside)) * 0.5, far * 1e-3)
    return min(near, far * 0.5), far


def _grain(direction: Sequence[float] | Matrix, camera: ViewMatrices) -> Matrix:
    """The side of the map along the camera's view, where the seen part is long and thin; steady where both agree."""
    forward = np.asarray(direction, np.float64) / np.linalg.norm(direction)
    looking = -camera.view[2, :3]
    flat = looking - forward * (looking @ forward)
    return flat if np.linalg.norm(flat) > 0.1 else projection.any_side(direction)


# --- what casts -------------------------------------------------------------------------------------------------------

_found_in: WeakKeyDictionary[Any, tuple[npt.NDArray[np.int64], dict[Any, Points]]] = WeakKeyDictionary()
_MOST_LIGHTS = 8  # whose casters are remembered
_MOST_FLAT = 16  # flat objects that are looked at: floors and walls are few, and large


def casting_points(scene: Any, direction: Sequence[float], place: Sequence[float] | None = None) -> Points:
    """Corners of the boxes of everything that may cast on something, shape (n, 3), eight a box.

    A flat object with nothing on the far side of its plane casts on nothing: without the floor everything stands on, a
    map need not cover all of it.

    Args:
        scene: its `corners`, `shown` and `casting` in this frame.
        direction: that light comes along,
        place: or from where.
    """
    if scene not in _found_in:
        _found_in[scene] = _large_flat(scene), {}
    flat, found = _found_in[scene]
    key = tuple(direction), None if place is None else tuple(place)
    if key not in found:
        if len(found) > _MOST_LIGHTS:
            found.clear()
        found[key] = _casting(scene, flat, direction, place)
    return found[key]


def _casting(
    scene: Any, flat: npt.NDArray[np.int64], direction: Sequence[float], place: Sequence[float] | None
) -> Points:
    corners, casts = scene.corners, scene.casting.copy()
    everything = (corners if scene.shown.all() else corners[scene.shown]).reshape(-1, 3)
    for index in flat:
        a, b, c = corners[index][_spanning(corners[index])]
        normal = np.cross(b - a, c - a)
        along = direction if place is None else a - place
        normal /= np.linalg.norm(normal) * (-1.0 if normal @ along < 0 else 1.0)
        beyond = (everything - a) @ normal
        casts[index] = beyond.max() > 1e-6 * np.abs(everything).max()
    return np.asarray(corners[casts]).reshape(-1, 3)


def _large_flat(scene: Any) -> npt.NDArray[np.int64]:
    """The largest flat objects that cast, largest first."""
    corners = scene.corners
    sides = np.sort(np.linalg.norm(corners[:, [1, 2, 4]] - corners[:, [0]], axis=2), axis=1)
    flat = np.nonzero(scene.casting & (sides[:, 0] < 1e-5 * sides[:, 2]) & (sides[:, 1] > 1e-5 * sides[:, 2]))[0]
    size = np.linalg.norm(np.ptp(corners[flat], axis=1), axis=1)
    return flat[np.argsort(-size, kind="stable")][:_MOST_FLAT]


def _spanning(corners: Points) -> list[int]:
    """Three corners of a flat box that span its plane."""
    edges = [int(np.argmax(np.linalg.norm(corners - corners[0], axis=1)))]
    away = np.cross(corners - corners[0], corners[edges[0]] - corners[0])
    return [0, edges[0], int(np.argmax(np.linalg.norm(away, axis=1)))]
