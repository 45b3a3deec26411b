"""Which lights cast, and the views their shadow maps are drawn with."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from difflib import get_close_matches
from itertools import groupby
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
import numpy.typing as npt

from rendergraph.api import SceneError, ViewMatrices

Matrix = npt.NDArray[np.float64]
Points = npt.NDArray[np.float64]

CUBE_FACES = 6
_WIDEST = math.radians(80)  # half angle of a cone that one perspective view still covers with care
_FACES = ((0, 1, 3, 2), (4, 5, 7, 6), (0, 1, 5, 4), (2, 3, 7, 6), (0, 2, 6, 4), (1, 3, 7, 5))  # of `box_corners`
_MARGIN = 8.0  # texels around what is seen, so that filter kernels at its edge read drawn texels


def layer_lights(wanted: str | Sequence[str], lights: Sequence[Any]) -> tuple[int, ...]:
    """The light of each layer, as an index into the scene's lights.

    Args:
        wanted: `auto`, a light's name, or several.
        lights: the scene's lights, with `name`, `type` and `casts_shadow`, which `auto` asks for.

    Raises:
        SceneError: no light has that name.
    """
    kinds = [light.type for light in lights]
    if wanted == "auto":
        casting = [light.type if light.casts_shadow else None for light in lights]
        found = [casting.index(kind) for kind in ("directional", "spot") if kind in casting][:1]
    else:
        names = [light.name for light in lights]
        found = sorted({_index(name, names) for name in ([wanted] if isinstance(wanted, str) else wanted)})
    return tuple(index for index in found for _ in range(CUBE_FACES if kinds[index] == "point" else 1))


def _index(name: str, names: list[str]) -> int:
    if name in names:
        return names.index(name)
    near = get_close_matches(name, names, n=1)
    way_out = f"did you mean '{near[0]}'?" if near else f"there is {', '.join(names) or 'no light'}"
    raise SceneError(f"the scene has no light '{name}'; {way_out}", name)


def light_views(table: Sequence[int], scene: Any, camera: ViewMatrices, resolution: int) -> list[ViewMatrices]:
    """A view for each layer of a table of lights.

    Args:
        table: the light of each layer; a point light stands six times.
        scene: its `lights`, `bounds`, `objects` and `meshes` in this frame.
        camera: what the picture is seen with.
        resolution: texels along a side.
    """
    lights = scene.lights
    box = np.asarray(scene.bounds, np.float64)
    views: list[ViewMatrices] = []
    for index, group in groupby(table):
        light = lights[index]
        if light.type == "directional":
            made: Iterable[ViewMatrices] = [
                directional_view(light.direction, camera, box, casting_points(scene, light.direction), resolution)
            ]
        elif light.type == "spot":
            made = [spot_view(light, box, resolution)]
        else:
            made = point_views(light, box, resolution)
        views += [
            ViewMatrices(view.view, view.projection, view.size, view.near, view.far, index)
            for view, _ in zip(made, group, strict=True)
        ]
    return views


# --- one kind each ---------------------------------------------------------------------------------------------------


def directional_view(
    direction: Sequence[float], camera: ViewMatrices, box: Points, casting: Points, resolution: int
) -> ViewMatrices:
    """An orthographic view along a direction around what may have shadow on it in the picture.

    Across the light it is as narrow as what the camera sees of the box and as what casts; what lies outside is lit.
    Along the light it holds the whole box, for what stands outside the picture may cast into it.
    """
    rotation = facing(direction, _grain(direction, camera))
    along = box_corners(box) @ rotation[2, :3]
    low, high = np.full(2, -np.inf), np.full(2, np.inf)
    for points in (visible_part(camera, box), casting, box_corners(box)):
        if not len(points):
            continue
        across = points @ rotation[:2, :3].T
        lower, higher = np.maximum(low, across.min(axis=0)), np.minimum(high, across.max(axis=0))
        if np.any(lower > higher):  # nothing that casts is near what is seen
            break
        low, high = lower, higher
    size = np.maximum(high - low, 1e-6 * max(1.0, float(np.abs(along).max())))
    size = size * resolution / max(resolution - 2 * _MARGIN, 0.5 * resolution)
    slack = 1e-3 * max(float(np.ptp(along)), float(size.max()), 1e-6)
    near, far = -along.max() - slack, -along.min() + slack
    view = rotation.copy()
    view[:2, 3] = -(low + high) / 2
    view[2, 3] = near  # the box begins at the near plane
    projection = orthographic(size[0] / 2, size[1] / 2, 0.0, far - near)
    return ViewMatrices(view, projection, (resolution, resolution), 0.0, far - near)


def spot_view(light: Any, box: Points, resolution: int) -> ViewMatrices:
    """A perspective view that holds a spot light's cone."""
    half = min(light.outer, _WIDEST)
    wider = math.atan(math.tan(half) * resolution / max(resolution - 2 * _MARGIN, 0.5 * resolution))
    near, far = reach(light, box)
    position = np.asarray(light.position, np.float64)
    view = facing(light.direction, _any_side(light.direction))
    view[:3, 3] = -view[:3, :3] @ position
    return ViewMatrices(view, perspective(wider, near, far), (resolution, resolution), near, far)


def point_views(light: Any, box: Points, resolution: int) -> list[ViewMatrices]:
    """Six perspective views around a point light, in the order of a cube map's faces; each a little wider than 90°."""
    near, far = reach(light, box)
    wider = math.atan(resolution / max(resolution - 2.0, 0.5 * resolution))
    views = []
    for axis in (0, 1, 2):
        for sign in (1.0, -1.0):
            direction = np.zeros(3)
            direction[axis] = sign
            view = facing(direction, _any_side(direction))
            view[:3, 3] = -view[:3, :3] @ np.asarray(light.position, np.float64)
            views.append(ViewMatrices(view, perspective(wider, near, far), (resolution, resolution), near, far))
    return views


def reach(light: Any, box: Points) -> tuple[float, float]:
    """Nearest and farthest distance from a light that anything in the box may have, within the light's range."""
    position = np.asarray(light.position, np.float64)
    outside = np.maximum(np.maximum(box[0] - position, position - box[1]), 0.0)
    farthest = float(np.linalg.norm(np.maximum(np.abs(position - box[0]), np.abs(position - box[1])))) * 1.001
    far = max(min(farthest, light.range or math.inf), 1e-3)
    # A plane at this distance cuts away less than the ball around the light that holds nothing.
    near = max(float(np.linalg.norm(outside)) * 0.5, far * 1e-3)
    return min(near, far * 0.5), far


# --- matrices --------------------------------------------------------------------------------------------------------


def facing(direction: Sequence[float] | Matrix, side: Matrix) -> Matrix:
    """A rotation to a view space that looks along `direction` with `side` towards +x."""
    forward = np.asarray(direction, np.float64)
    forward = forward / np.linalg.norm(forward)
    x = side - forward * (side @ forward)
    x /= np.linalg.norm(x)
    view = np.eye(4)
    view[:3, :3] = np.stack([x, np.cross(-forward, x), -forward])
    return view


def _any_side(direction: Sequence[float] | Matrix) -> Matrix:
    side = np.zeros(3)
    side[int(np.argmin(np.abs(np.asarray(direction))))] = 1.0
    return side


def _grain(direction: Sequence[float] | Matrix, camera: ViewMatrices) -> Matrix:
    """The side of the map along the camera's view, where the seen part is long and thin; steady where both agree."""
    forward = np.asarray(direction, np.float64) / np.linalg.norm(direction)
    looking = -camera.view[2, :3]
    flat = looking - forward * (looking @ forward)
    return flat if np.linalg.norm(flat) > 0.1 else _any_side(direction)


def orthographic(half_width: float, half_height: float, near: float, far: float) -> Matrix:
    """A centred orthographic projection, z to -1…1."""
    matrix = np.diag([1 / half_width, 1 / half_height, -2 / (far - near), 1.0])
    matrix[2, 3] = -(far + near) / (far - near)
    return matrix


def perspective(half_angle: float, near: float, far: float) -> Matrix:
    """A square perspective projection, z to -1…1."""
    scale = 1 / math.tan(half_angle)
    matrix = np.diag([scale, scale, (far + near) / (near - far), 0.0])
    matrix[2, 3] = 2 * far * near / (near - far)
    matrix[3, 2] = -1.0
    return matrix


# --- what casts -------------------------------------------------------------------------------------------------------

_corners_of: WeakKeyDictionary[Any, tuple[Points, npt.NDArray[np.int64]]] = WeakKeyDictionary()
_MOST_FLAT = 16  # flat objects that are looked at: floors and walls are few, and large


def casting_points(scene: Any, direction: Sequence[float]) -> Points:
    """Corners of the boxes of everything that may cast on something, shape (n, 3).

    A flat object with nothing on the far side of its plane casts on nothing: without the floor everything stands on, a
    map need not cover all of it.
    """
    if scene not in _corners_of:
        _corners_of[scene] = _caster_corners(scene)
    corners, flat = _corners_of[scene]
    casts = np.ones(len(corners), bool)
    everything = corners.reshape(-1, 3)
    for index in flat:
        a, b, c = corners[index][_spanning(corners[index])]
        normal = np.cross(b - a, c - a)
        normal /= np.linalg.norm(normal) * (-1.0 if normal @ direction < 0 else 1.0)  # along the light
        beyond = (everything - a) @ normal
        casts[index] = beyond.max() > 1e-6 * np.abs(everything).max()
    return corners[casts].reshape(-1, 3)


def _caster_corners(scene: Any) -> tuple[Points, npt.NDArray[np.int64]]:
    """World-space corners of each caster's box, shape (n, 8, 3), and the largest flat ones' indices."""
    placed = [entry for entry in scene.objects if entry.casts_shadow and not entry.hidden]
    if not placed:
        return np.empty((0, 8, 3)), np.empty(0, np.int64)
    boxes = np.array([box_corners(np.asarray(mesh.box, np.float64)) for mesh in scene.meshes])
    local = boxes[[entry.mesh for entry in placed]]
    transforms = np.array([entry.transform for entry in placed])
    corners = np.einsum("nij,nkj->nki", transforms[:, :3, :3], local) + transforms[:, None, :3, 3]
    extent = np.sort(np.ptp(local, axis=1), axis=1)
    flat = np.nonzero((extent[:, 0] < 1e-5 * extent[:, 2]) & (extent[:, 1] > 1e-5 * extent[:, 2]))[0]
    size = np.linalg.norm(np.ptp(corners[flat], axis=1), axis=1)
    return corners, flat[np.argsort(-size, kind="stable")][:_MOST_FLAT]


def _spanning(corners: Points) -> list[int]:
    """Three corners of a flat box that span its plane."""
    edges = [int(np.argmax(np.linalg.norm(corners - corners[0], axis=1)))]
    away = np.cross(corners - corners[0], corners[edges[0]] - corners[0])
    return [0, edges[0], int(np.argmax(np.linalg.norm(away, axis=1)))]


# --- what is seen of a box -------------------------------------------------------------------------------------------


def box_corners(box: Points) -> Points:
    """The eight corners of a box given by its smallest and largest, shape (8, 3)."""
    return np.array([[box[x, 0], box[y, 1], box[z, 2]] for x in (0, 1) for y in (0, 1) for z in (0, 1)])


def visible_part(camera: ViewMatrices, box: Points) -> Points:
    """Points of the part of a box that a camera sees, shape (n, 3); none where it sees nothing of it.

    The box's faces cut by the frustum, and the frustum's edges cut by the box: together every corner of the
    intersection, also for an infinite far plane.
    """
    planes = frustum_planes(camera)
    corners = box_corners(box)
    found = [polygon for face in _FACES if len(polygon := clip_polygon(corners[list(face)], planes))]
    points = [*found, *_frustum_corners_inside(planes, box)]
    return np.concatenate(points) if points else np.empty((0, 3))


def frustum_planes(camera: ViewMatrices) -> Points:
    """Planes (a, b, c, d) with a x + b y + c z + d >= 0 inside, shape (n, 4); the far one is left out if infinite."""
    rows = camera.projection @ camera.view
    planes = [rows[3] + sign * rows[axis] for axis in (0, 1, 2) for sign in (1.0, -1.0)]
    lengths = [float(np.linalg.norm(plane[:3])) for plane in planes]
    longest = max(lengths)
    return np.array([plane / length for plane, length in zip(planes, lengths, strict=True) if length > 1e-9 * longest])


def clip_polygon(polygon: Points, planes: Points) -> Points:
    """The part of a convex polygon inside all planes (Sutherland and Hodgman 1974), shape (n, 3)."""
    for plane in planes:
        if not len(polygon):
            break
        distance = polygon @ plane[:3] + plane[3]
        kept: list[Matrix] = []
        for a, b, da, db in zip(polygon, np.roll(polygon, -1, axis=0), distance, np.roll(distance, -1), strict=True):
            if da >= 0:
                kept.append(a)
            if (da >= 0) != (db >= 0):
                kept.append(a + (b - a) * (da / (da - db)))
        polygon = np.array(kept).reshape(-1, 3)
    return polygon


def _frustum_corners_inside(planes: Points, box: Points) -> list[Points]:
    """Where the frustum's edges lie inside the box: their ends, cut to it."""
    points: list[Points] = []
    axes = np.eye(3)
    sides = [np.append(axis, -axis @ box[0]) for axis in axes] + [np.append(-axis, axis @ box[1]) for axis in axes]
    middle, span = (box[0] + box[1]) / 2, float(np.linalg.norm(box[1] - box[0])) + 1e-9
    for i in range(len(planes)):
        for j in range(i):
            along = np.cross(planes[i, :3], planes[j, :3])
            length = np.linalg.norm(along)
            if length < 1e-9:
                continue
            along /= length
            system = np.stack([planes[i, :3], planes[j, :3], along])
            origin = np.linalg.solve(system, [-planes[i, 3], -planes[j, 3], along @ middle])
            low, high = -span, span
            others = [plane for k, plane in enumerate(planes) if k not in (i, j)]
            for plane in (*others, *sides):
                rate, start = float(plane[:3] @ along), float(plane[:3] @ origin + plane[3])
                if abs(rate) < 1e-12:
                    if start < -1e-9:
                        low, high = 1.0, 0.0
                elif rate > 0:
                    low = max(low, -start / rate)
                else:
                    high = min(high, -start / rate)
            if low <= high:
                points.append(np.stack([origin + along * low, origin + along * high]))
    return points
