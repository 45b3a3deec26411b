"""Values over time: keyframes of scene files, and skeletons, morph targets and the clips that move them.

The latter are those of glTF 2.0 (§3.11 and §3.7.2-§3.7.3), evaluated in float64.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import cached_property
from typing import Any, Literal

import numpy as np
import numpy.typing as npt
from msgspec import Struct

from rendergraph.errors import Place
from rendergraph.projection import unit

Floats = npt.NDArray[np.float32]
Doubles = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int32]

_BOX_SLACK = 1e-5
"""Rounding margin of a posed vertex, relative to the sizes of its summed terms."""


class Deform(Struct, frozen=True, eq=False, dict=True):
    """How the n vertices of a mesh follow joints and morph targets.

    Attributes:
        rest: `positions`, `normals` and perhaps `tangents` of the mesh in its bind pose, float32 (n, 3 or 4).
        targets: by stream, the displacements of t targets, float32 (t, n, 3); always for positions.
        joints: int32 (n, k), the joints of each vertex, k = 0 without a skin.
        weights: float32 (n, k), not negative, with a sum of 1.
    """

    rest: Mapping[str, Floats]
    targets: Mapping[str, Floats]
    joints: Ints
    weights: Floats

    def at(self, vertices: npt.NDArray[np.integer]) -> Deform:
        """Return the same for a subset or reordering of the vertices."""
        rest = {name: stream[vertices] for name, stream in self.rest.items()}
        targets = {name: deltas[:, vertices] for name, deltas in self.targets.items()}
        return Deform(rest, targets, self.joints[vertices], self.weights[vertices])

    @cached_property
    def _boxes(self) -> tuple[Ints, Doubles, Doubles, Doubles, Doubles]:
        """Joints that move any vertex, (u,), the boxes of their vertices, and the extents of targets, (u or t, 3)."""
        positions, joints, weights = self.rest["positions"].astype(np.float64), self.joints, self.weights
        if not joints.shape[1]:
            joints, weights = np.zeros((len(positions), 1), np.int32), np.ones((len(positions), 1), np.float32)
        low = np.full((int(joints.max()) + 1, 3), np.inf)
        high = -low
        for joint, weight in zip(joints.T, weights.T, strict=True):
            np.minimum.at(low, joint[weight > 0], positions[weight > 0])
            np.maximum.at(high, joint[weight > 0], positions[weight > 0])
        used, deltas = np.flatnonzero(low[:, 0] <= high[:, 0]).astype(np.int32), self.targets["positions"]
        return used, low[used], high[used], deltas.min(axis=1).astype(float), deltas.max(axis=1).astype(float)

    def pose(self, joints: Doubles, weights: Doubles) -> Pose:
        """Return a pose with its box: a vertex is a mean of its positions under all joints, so within their hull."""
        used, low, high, least, most = self._boxes
        center = (low + high) / 2 + weights @ ((least + most) / 2)
        extent = (high - low) / 2 + np.abs(weights) @ ((most - least) / 2)
        size = np.abs(center) + extent
        if len(joints):
            linear, offset = joints[used, :, :3], joints[used, :, 3]
            center = np.einsum("jik,jk->ji", linear, center) + offset
            extent, size = (np.einsum("jik,jk->ji", np.abs(linear), each) for each in (extent, size))
            size += np.abs(offset)
        extent = extent + _BOX_SLACK * size
        return Pose(self, joints, weights, ((center - extent).min(axis=0), (center + extent).max(axis=0)))


class Pose(Struct, frozen=True, eq=False, dict=True):
    """The pose of one mesh at a moment, shared by all objects of the mesh.

    Attributes:
        joints: float64 (j, 3, 4), mesh to object: a joint's transform times the inverse of its bind pose; j = 0
            without a skin.
        weights: float64 (t,), weights of the morph targets.
        box: minimum and maximum corner around all posed vertices.
    """

    deform: Deform
    joints: Doubles
    weights: Doubles
    box: tuple[Doubles, Doubles]

    @cached_property
    def values(self) -> bytes:
        """Joints and weights in the GPU's layout; equal values render the same."""
        return np.concatenate([self.joints.reshape(-1), self.weights]).astype(np.float32).tobytes()

    def vertices(self) -> dict[str, Floats]:
        """Return the posed streams of `Deform.rest`, computed in float64."""
        found = {name: stream.astype(np.float64) for name, stream in self.deform.rest.items()}
        for name, deltas in self.deform.targets.items():
            found[name][:, :3] += np.tensordot(self.weights, deltas.astype(np.float64), 1)
        if len(self.joints):
            weights = self.deform.weights.astype(np.float64)
            blended = np.einsum("nk,nkij->nij", weights, self.joints[self.deform.joints])
            linear = blended[:, :, :3]
            rows = [np.cross(linear[:, i - 2], linear[:, i - 1]) for i in range(3)]  # rows of the cofactor matrix
            sign = np.sign((linear[:, 0] * rows[0]).sum(axis=1))
            found["normals"] = np.stack([(row * found["normals"]).sum(axis=1) * sign for row in rows], axis=1)
            for name in ("positions", "tangents") & found.keys():
                found[name][:, :3] = np.einsum("nij,nj->ni", linear, found[name][:, :3])
            found["positions"] += blended[:, :, 3]
        for name in ("normals", "tangents") & found.keys():
            found[name][:, :3] = unit(found[name][:, :3])
        return {name: stream.astype(np.float32) for name, stream in found.items()}


# Clips ----------------------------------------------------------------------------------------------------------------


class Track(Struct, frozen=True, eq=False):
    """Keys of one property of c nodes that share their times.

    Attributes:
        nodes: (c,).
        times: float64 (k,), seconds, increasing.
        values: float64 (k, c, w); rotations are unit quaternions x, y, z, w.
        slopes: in- and out-tangents of cubic splines, float64 (2, k, c, w).
    """

    path: Literal["translation", "rotation", "scale", "weights"]
    nodes: Ints
    times: Doubles
    values: Doubles
    interpolation: Literal["LINEAR", "STEP", "CUBICSPLINE"] = "LINEAR"
    slopes: Doubles | None = None

    def at(self, time: float) -> Doubles:
        """Return the values at a time, (c, w), held before the first and after the last key."""
        first = int(np.searchsorted(self.times, time, side="right")) - 1
        if first < 0 or first + 1 >= len(self.times) or self.interpolation == "STEP":
            held: Doubles = self.values[max(0, first)]
            return held
        a, b = self.values[first], self.values[first + 1]
        span = self.times[first + 1] - self.times[first]
        t = float((time - self.times[first]) / span)
        if self.slopes is not None:
            leaving, arriving = span * self.slopes[1, first], span * self.slopes[0, first + 1]
            value = (2 * t**3 - 3 * t**2 + 1) * a + (t**3 - 2 * t**2 + t) * leaving
            value = value + (3 * t**2 - 2 * t**3) * b + (t**3 - t**2) * arriving
            return unit(value) if self.path == "rotation" else value
        return slerp(a, b, t) if self.path == "rotation" else a + t * (b - a)


def slerp(a: Doubles, b: Doubles, t: float) -> Doubles:
    """Interpolate unit quaternions (c, 4) along the shorter arc (Shoemake 1985)."""
    cosine = (a * b).sum(axis=1, keepdims=True)
    b, cosine = np.where(cosine < 0, -b, b), np.minimum(np.abs(cosine), 1.0)
    angle = np.arccos(cosine)
    sine = np.sin(angle)
    close = sine < 1e-6
    sine = np.where(close, 1.0, sine)
    first = np.where(close, 1 - t, np.sin((1 - t) * angle) / sine)
    return unit(first * a + np.where(close, t, np.sin(t * angle) / sine) * b)


class Clip(Struct, frozen=True):
    """An animation of a file; `length` is the time of its last key in seconds."""

    name: str
    length: float
    tracks: tuple[Track, ...]


class Part(Struct, frozen=True, eq=False):
    """An object of a file: its node, its transform in the node, (4, 4), and the skin that moves it instead, or -1."""

    node: int
    local: Doubles
    skin: int


class Skin(Struct, frozen=True, eq=False):
    """The nodes that are joints, (j,), and the inverses of their transforms in the bind pose, (j, 4, 4)."""

    joints: Ints
    inverse_binds: Doubles


class Rig(Struct, frozen=True, eq=False, dict=True):
    """The n nodes of a file, their objects, lights and cameras, and their animation.

    Attributes:
        parents: (n,), -1 for roots.
        rest: `translation`, `rotation` and `scale` of the nodes at rest, (n, 3), (n, 4) and (n, 3).
        matrices: by node, its transform if it is given as a matrix, which cannot be animated.
        weights: by node, the weights of its morph targets at rest.
        objects, lights, cameras: the contents of the file's placements, in their order: parts, nodes and nodes.
        placements: entries of `Scene.placements` with their transforms, (4, 4); several if a file is repeated.
        clip: the clip that is looped, from its second `start` on; None for the rest pose.
    """

    parents: Ints
    rest: Mapping[str, Doubles]
    matrices: Mapping[int, Doubles]
    weights: Mapping[int, Doubles]
    skins: tuple[Skin, ...]
    clips: Mapping[str, Clip]
    objects: tuple[Part, ...] = ()
    lights: tuple[int, ...] = ()
    cameras: tuple[int, ...] = ()
    placements: tuple[tuple[str, Doubles], ...] = (("", np.eye(4)),)
    clip: Clip | None = None
    speed: float = 1.0
    start: float = 0.0

    @property
    def length(self) -> float:
        """Seconds until the animation repeats; 0 if nothing moves."""
        return self.clip.length / abs(self.speed) if self.clip is not None and self.speed else 0.0

    def at(self, time: float) -> tuple[Doubles, list[tuple[Doubles, Doubles, Doubles]]]:
        """Return the transforms of all nodes to the file's space, (n, 4, 4), and the state of each object.

        The state is its transform in the file, those of its joints, (j, 3, 4), and the weights of its targets, (t,).
        """
        streams, weights = {name: values.copy() for name, values in self.rest.items()}, dict(self.weights)
        moment = self.start + self.speed * time
        if self.clip is not None and self.clip.length:
            moment %= self.clip.length
        for track in self.clip.tracks if self.clip is not None else ():
            if track.path == "weights":
                weights |= dict(zip(track.nodes.tolist(), track.at(moment), strict=True))
            else:
                streams[track.path][track.nodes] = track.at(moment)
        worlds = placements(*streams.values())
        for node, matrix in self.matrices.items():
            worlds[node] = matrix
        with np.errstate(over="ignore", invalid="ignore"):
            for level in self._levels:
                worlds[level] = worlds[self.parents[level]] @ worlds[level]
        # For an object without a skin, -1 selects the last entry: no joints.
        skins = [*((worlds[skin.joints] @ skin.inverse_binds)[:, :3] for skin in self.skins), np.zeros((0, 3, 4))]
        at = [one.local if one.skin >= 0 else worlds[one.node] @ one.local for one in self.objects]
        nodes = ((skins[one.skin], weights.get(one.node, np.zeros(0))) for one in self.objects)
        return worlds, [(local, *state) for local, state in zip(at, nodes, strict=True)]

    @cached_property
    def _levels(self) -> list[npt.NDArray[np.int64]]:
        """The nodes by depth in the hierarchy, starting with the children of roots."""
        found, nodes = [], np.flatnonzero(self.parents < 0)
        while len(nodes := np.flatnonzero(np.isin(self.parents, nodes) & (self.parents >= 0))):
            found.append(nodes)
        return found


def placements(translations: Doubles, rotations: Doubles, scales: Doubles) -> Doubles:
    """Return `T·R·S` as (n, 4, 4) from translations (n, 3), quaternions x, y, z, w (n, 4) and scales (n, 3)."""
    x, y, z, w = rotations.T / np.array([math.hypot(*rotation) or 1.0 for rotation in rotations.tolist()])
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    found = np.tile(np.eye(4), (len(translations), 1, 1))
    found[:, :3, :3] = np.moveaxis(np.array(rows), 2, 0) * scales[:, None]
    found[:, :3, 3] = translations
    return found


# Keyframes ------------------------------------------------------------------------------------------------------------


class Curve(Struct, frozen=True, eq=False):
    """The keyframes of one value, which is held before the first and after the last.

    Attributes:
        times: float64 (k,), seconds, increasing.
        values: float64, numbers (k,), vectors (k, n), or unit quaternions x, y, z, w if `turns`.
        ease: between two keys, `linear`; `smooth` starts and ends at rest (3t² - 2t³); `step` holds the first.
        turns: rotations, interpolated along the shorter arc (Shoemake 1985).
        place: their place in the file.
    """

    times: Doubles
    values: Doubles
    ease: Literal["linear", "smooth", "step"] = "linear"
    turns: bool = False
    place: Place | None = None

    def at(self, time: float) -> Any:
        """Return the number, the vector as a tuple, or the rotation as a matrix (3, 3), at a time in seconds."""
        if self.ease == "linear" and not self.turns:
            if self.values.ndim == 1:
                return float(np.interp(time, self.times, self.values))
            return tuple(float(np.interp(time, self.times, column)) for column in self.values.T)
        first = min(max(int(np.searchsorted(self.times, time, side="right")) - 1, 0), len(self.times) - 1)
        last = min(first + 1, len(self.times) - 1)
        span = self.times[last] - self.times[first]
        t = min(max(float((time - self.times[first]) / span), 0.0), 1.0) if span else 0.0
        t = {"linear": t, "smooth": t * t * (3 - 2 * t), "step": 0.0}[self.ease]
        a, b = self.values[first], self.values[last]
        if self.turns:
            rotation = slerp(a[None], b[None], t)
            return placements(np.zeros((1, 3)), rotation, np.ones((1, 3)))[0, :3, :3]
        value = a + t * (b - a)
        return float(value) if self.values.ndim == 1 else tuple(value.tolist())


def quaternion(degrees: Doubles) -> Doubles:
    """Return the unit quaternion x, y, z, w of rotations about X, then Y, then Z, as in `euler_matrix`."""
    (x, y, z), (u, v, w) = np.sin(np.radians(degrees) / 2), np.cos(np.radians(degrees) / 2)
    return np.array([x * v * w - u * y * z, u * y * w + x * v * z, u * v * z - x * y * w, u * v * w + x * y * z])
