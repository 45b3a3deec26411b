"""The lights that cast shadows, and the views of their shadow maps."""

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

_MAX_HALF_ANGLE = math.radians(
    86
)  # largest half angle of a cone that one perspective view covers with useful precision
_MARGIN = 8.0  # texels around the visible part, so that filter kernels at its border read valid texels


def layer_lights(names: str | Sequence[str], lights: Sequence[Any], layers: Callable[[str], int]) -> tuple[int, ...]:
    """Return the light of each layer, as an index into the scene's lights.

    Args:
        names: `auto`, `all`, a light's name, or several; see `casting_lights`.
        lights: the scene's lights, with `name`, `type` and `casts_shadow`.
        layers: function that returns the number of layers of a kind of light.

    Raises:
        SceneError: no light has that name.
    """
    return tuple(index for index in casting_lights(names, lights) for _ in range(layers(lights[index].type)))


# --- views by type of light -------------------------------------------------------------------------------------------


def light_views(light: Any, scene: Any, camera: ViewMatrices, resolution: int) -> Sequence[ViewMatrices]:
    """Return the views of one light: one, or six around a point light.

    Args:
        light: a light of the scene.
        scene: the scene's `lights`, `bounds`, `corners`, `shown` and `casting` in this frame.
        camera: the camera's view.
        resolution: texels along a side.
    """
    box = receiving_box(scene, light)
    if light.type == "directional":
        casting = casting_points(scene, light.direction)
        return (directional_view(light.direction, camera, box, casting, resolution),)
    if light.type == "spot":
        return (spot_view(light, scene, camera, resolution),)
    return point_views(light, box, resolution)


def receiving_box(scene: Any, light: Any) -> Points:
    """Return the box around all surfaces and around their shadows on shadow catchers, which `bounds` does not include.

    The corners of the scene's bounds are moved along the light to the lowest catcher, but not past the catchers' edges.
    """
    box = np.asarray(scene.bounds, np.float64)
    if not len(scene.catchers):
        return box
    catching = scene.corners[scene.catchers].reshape(-1, 3)
    low, high = catching.min(axis=0), catching.max(axis=0)
    corners = projection.box_corners(box)
    along = np.asarray(light.direction) if light.type == "directional" else corners - np.asarray(light.position)
    with np.errstate(divide="ignore", invalid="ignore"):
        steps = (low[1] - corners[:, 1:2]) / np.broadcast_to(along, corners.shape)[:, 1:2]
        shadows = corners + np.where(steps > 0, np.minimum(steps, 1e9), 0.0) * along
    shadows = np.clip(shadows, np.minimum(low, box[0]), np.maximum(high, box[1]))
    everything = np.concatenate([corners, shadows])
    return np.stack([everything.min(axis=0), everything.max(axis=0)])


def directional_view(
    direction: Sequence[float], camera: ViewMatrices, box: Points, casting: Points, resolution: int
) -> ViewMatrices:
    """Return an orthographic view along a direction, around the visible surfaces that may be in shadow.

    Perpendicular to the light it is the intersection of the visible part of the box and the casters; everything outside
    is lit. Along the light it contains the whole box, because objects outside the picture may cast shadows into it.
    """
    rotation = projection.view_along(direction, _map_up_vector(direction, camera))
    corners = projection.box_corners(box)
    axial = corners @ rotation[2, :3]
    low, high = np.full(2, -np.inf), np.full(2, np.inf)
    for points in (projection.visible_part(camera, box), casting, corners):
        if not len(points):
            continue
        lateral = rotation[:2, :3] @ points.T
        lower, higher = np.maximum(low, lateral.min(axis=1)), np.minimum(high, lateral.max(axis=1))
        if np.any(lower > higher):  # no caster can shadow a visible surface
            break
        low, high = lower, higher
    return projection.orthographic_view(
        rotation, np.append(low, axial.min()), np.append(high, axial.max()), resolution, _MARGIN
    )


def spot_view(light: Any, scene: Any, camera: ViewMatrices, resolution: int) -> ViewMatrices:
    """Return a perspective view of a spot light, around the visible surfaces in its cone that may be in shadow.

    Perpendicular to the light's axis it is the intersection of the visible part of the cone and the casters. Along the
    axis it begins at the nearest caster and ends at the farthest visible point.
    """
    box = receiving_box(scene, light)
    half_angle = min(light.outer, _MAX_HALF_ANGLE)
    cone = projection.cone_view(light.position, light.direction, half_angle, *distance_range(light, box), resolution)
    planes = projection.frustum_planes(cone)
    visible = [planes, projection.frustum_planes(camera), projection.box_planes(box)]
    visible_corners = projection.region_corners(np.concatenate(visible))
    boxes = casting_points(scene, light.direction, light.position).reshape(-1, 8, 3)
    casting, begin = _within_cone(cone, boxes)
    widest = np.full(2, 1 / cone.projection[0, 0])
    low, high, near, far = -widest, widest, cone.near, cone.far
    if len(visible_corners) and len(casting):
        slopes, distances = _perspective_coords(cone, visible_corners)
        lower = np.maximum(np.maximum(slopes.min(axis=0), casting.min(axis=0)), low)
        higher = np.minimum(np.minimum(slopes.max(axis=0), casting.max(axis=0)), high)
        if np.all(lower < higher):  # else no caster can shadow a visible surface
            low, high, far = lower, higher, float(distances.max()) * 1.001
            near = max(min(begin * 0.999, far * 0.5), cone.near)
    return projection.narrowed_view(cone, low, high, near, far, _MARGIN)


def _perspective_coords(view: ViewMatrices, points: Points) -> tuple[Points, Points]:
    """Return view-space x and y divided by the distance along the view axis, and that distance."""
    view_points = points @ view.view[:3, :3].T + view.view[:3, 3]
    return view_points[..., :2] / -view_points[..., 2:], -view_points[..., 2]


def _within_cone(cone: ViewMatrices, boxes: Points) -> tuple[Points, float]:
    """Return perspective coordinates whose hull contains the visible part of boxes, and its nearest distance.

    Args:
        cone: the perspective view.
        boxes: corners of the boxes, shape (n, 8, 3).
    """
    distances = -(boxes @ cone.view[2, :3] + cone.view[2, 3])
    in_front = np.all(distances > cone.near, axis=1)
    slopes = _perspective_coords(cone, boxes[in_front])[0]
    widest = 1 / cone.projection[0, 0]
    visible = np.all((slopes.max(axis=1) > -widest) & (slopes.min(axis=1) < widest), axis=1)
    near = float(distances[in_front][visible].min(initial=cone.far))
    hull_points = [slopes[visible].reshape(-1, 2)]
    sides = projection.frustum_planes(cone)[:5]
    for box in boxes[~in_front & np.any(distances > cone.near, axis=1)]:  # boxes that are partly behind the light
        faces = [projection.clip_polygon(box[list(face)], sides) for face in projection.BOX_FACES]
        if sum(map(len, faces)):
            hull_points.append(_perspective_coords(cone, np.concatenate([face.reshape(-1, 3) for face in faces]))[0])
            near = cone.near
    return np.concatenate(hull_points), near


def point_views(light: Any, box: Points, resolution: int) -> Sequence[ViewMatrices]:
    """Return six perspective views around a point light, in cube map order, each slightly wider than 90°."""
    return projection.cube_views(light.position, *distance_range(light, box), resolution, _MARGIN)


def distance_range(light: Any, box: Points) -> tuple[float, float]:
    """Return the range of distances between a light and anything in the box, limited by the light's range."""
    position = np.asarray(light.position, np.float64)
    outside = np.maximum(np.maximum(box[0] - position, position - box[1]), 0.0)
    farthest = float(np.linalg.norm(np.maximum(np.abs(position - box[0]), np.abs(position - box[1])))) * 1.001
    far = max(min(farthest, light.range or math.inf), 1e-3)
    # The near plane at this distance stays within the empty sphere around the light.
    near = max(float(np.linalg.norm(outside)) * 0.5, far * 1e-3)
    return min(near, far * 0.5), far


def _map_up_vector(direction: Sequence[float] | Matrix, camera: ViewMatrices) -> Matrix:
    """Return the map's up vector: the camera's direction, or a fixed one if it is nearly parallel to the light's."""
    forward = np.asarray(direction, np.float64) / np.linalg.norm(direction)
    view_forward = -camera.view[2, :3]
    projected = view_forward - forward * (view_forward @ forward)
    return projected if np.linalg.norm(projected) > 0.1 else projection.any_side(direction)


# --- casters ----------------------------------------------------------------------------------------------------------

_casting_cache: WeakKeyDictionary[Any, tuple[npt.NDArray[np.int64], dict[Any, Points]]] = WeakKeyDictionary()
_MAX_CACHED_LIGHTS = 8
_MAX_FLAT_OBJECTS = 16  # flat objects that are tested: floors and walls are few and large


def casting_points(scene: Any, direction: Sequence[float], position: Sequence[float] | None = None) -> Points:
    """Return the corners of the bounding boxes of all effective casters, eight per box, shape (n, 3).

    A flat object with nothing behind its plane casts no visible shadow. If the floor under all objects is left out, the
    map need not cover all of it.

    Args:
        scene: the scene's `corners`, `shown` and `casting` in this frame.
        direction: direction of a directional light.
        position: position of a local light, used instead of the direction.
    """
    if scene not in _casting_cache:
        _casting_cache[scene] = _large_flat(scene), {}
    flat, cached = _casting_cache[scene]
    key = tuple(direction), None if position is None else tuple(position)
    if key not in cached:
        if len(cached) > _MAX_CACHED_LIGHTS:
            cached.clear()
        cached[key] = _casting_corners(scene, flat, direction, position)
    return cached[key]


def _casting_corners(
    scene: Any, flat: npt.NDArray[np.int64], direction: Sequence[float], position: Sequence[float] | None
) -> Points:
    corners, casts = scene.corners, scene.casting.copy()
    everything = (corners if scene.shown.all() else corners[scene.shown]).reshape(-1, 3)
    for index in flat:
        a, b, c = corners[index][_spanning(corners[index])]
        normal = np.cross(b - a, c - a)
        light_direction = direction if position is None else a - position
        normal /= np.linalg.norm(normal) * (-1.0 if normal @ light_direction < 0 else 1.0)
        behind_plane = (everything - a) @ normal
        casts[index] = behind_plane.max() > 1e-6 * np.abs(everything).max()
    return np.asarray(corners[casts]).reshape(-1, 3)


def _large_flat(scene: Any) -> npt.NDArray[np.int64]:
    """Return the indices of the largest flat casters, largest first."""
    corners = scene.corners
    sides = np.sort(np.linalg.norm(corners[:, [1, 2, 4]] - corners[:, [0]], axis=2), axis=1)
    flat = np.nonzero(scene.casting & (sides[:, 0] < 1e-5 * sides[:, 2]) & (sides[:, 1] > 1e-5 * sides[:, 2]))[0]
    size = np.linalg.norm(np.ptp(corners[flat], axis=1), axis=1)
    return flat[np.argsort(-size, kind="stable")][:_MAX_FLAT_OBJECTS]


def _spanning(corners: Points) -> list[int]:
    """Return the indices of three corners of a flat box that span its plane."""
    edges = [int(np.argmax(np.linalg.norm(corners - corners[0], axis=1)))]
    areas = np.cross(corners - corners[0], corners[edges[0]] - corners[0])
    return [0, edges[0], int(np.argmax(np.linalg.norm(areas, axis=1)))]
