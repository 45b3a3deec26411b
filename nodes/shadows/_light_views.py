"""Which lights cast, and the views their shadow maps are drawn with."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace
from itertools import groupby
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
import numpy.typing as npt

from rendergraph.api import ViewMatrices, casting_lights, viewing

Matrix = npt.NDArray[np.float64]
Points = npt.NDArray[np.float64]

CUBE_FACES = 6
_WIDEST = math.radians(80)  # half angle of a cone that one perspective view still covers with care
_MARGIN = 8.0  # texels around what is seen, so that filter kernels at its edge read drawn texels


def layer_lights(wanted: str | Sequence[str], lights: Sequence[Any]) -> tuple[int, ...]:
    """The light of each layer, as an index into the scene's lights.

    Args:
        wanted: `auto`, `all`, a light's name, or several; see `casting_lights`.
        lights: the scene's lights, with `name`, `type` and `casts_shadow`, which `auto` asks for.

    Raises:
        SceneError: no light has that name.
    """
    return tuple(
        index
        for index in casting_lights(wanted, lights)
        for _ in range(CUBE_FACES if lights[index].type == "point" else 1)
    )


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
        views += [replace(view, light=index) for view, _ in zip(made, group, strict=True)]
    return views


# --- one kind each ---------------------------------------------------------------------------------------------------


def directional_view(
    direction: Sequence[float], camera: ViewMatrices, box: Points, casting: Points, resolution: int
) -> ViewMatrices:
    """An orthographic view along a direction around what may have shadow on it in the picture.

    Across the light it is as narrow as what the camera sees of the box and as what casts; what lies outside is lit.
    Along the light it holds the whole box, for what stands outside the picture may cast into it.
    """
    rotation = viewing.view_along(direction, _grain(direction, camera))
    corners = viewing.box_corners(box)
    along = corners @ rotation[2, :3]
    low, high = np.full(2, -np.inf), np.full(2, np.inf)
    for points in (viewing.visible_part(camera, box), casting, corners):
        if not len(points):
            continue
        across = points @ rotation[:2, :3].T
        lower, higher = np.maximum(low, across.min(axis=0)), np.minimum(high, across.max(axis=0))
        if np.any(lower > higher):  # nothing that casts is near what is seen
            break
        low, high = lower, higher
    return viewing.orthographic_view(
        rotation, np.append(low, along.min()), np.append(high, along.max()), resolution, _MARGIN
    )


def spot_view(light: Any, box: Points, resolution: int) -> ViewMatrices:
    """A perspective view that holds a spot light's cone."""
    half_angle = min(light.outer, _WIDEST)
    return viewing.cone_view(light.position, light.direction, half_angle, *reach(light, box), resolution, _MARGIN)


def point_views(light: Any, box: Points, resolution: int) -> Sequence[ViewMatrices]:
    """Six perspective views around a point light, in the order of a cube map's faces; each a little wider than 90°."""
    return viewing.cube_views(light.position, *reach(light, box), resolution, margin=1.0)


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
    return flat if np.linalg.norm(flat) > 0.1 else viewing.any_side(direction)


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
    boxes = np.array([viewing.box_corners(mesh.box) for mesh in scene.meshes])
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
