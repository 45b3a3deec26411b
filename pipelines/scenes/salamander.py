"""A fire salamander that walks: mesh, skeleton, skin and walk cycle, all computed. Writes `salamander.glb` beside it.

It is a body of elliptical rings along a spine of ten joints and four legs of two joints each. The trunk swings as a
standing wave and the tail as a travelling one, and diagonal legs step together, as salamanders do (K. Karakasiliotis et
al., "Where are we in understanding salamander locomotion", 2013). Metres, +Z forwards, the feet at y = 0.
"""

from __future__ import annotations

import json
import struct
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

Doubles = npt.NDArray[np.float64]

PERIOD, KEYS = 1.2, 24  # seconds of a walk cycle, and its keys
SPINE = np.array([0.34, 0.24, 0.12, 0.0, -0.12, -0.24, -0.36, -0.48, -0.6, -0.72])  # z of its joints, head to tail
ROOT, CHEST, PELVIS = 3, 1, 5
HEIGHT = 0.115
AROUND = 20

# z, half width, half height and middle above the spine of the body's rings
PROFILE = np.array(
    [
        (0.520, 0.002, 0.002, -0.012),
        (0.515, 0.030, 0.018, -0.010),
        (0.490, 0.058, 0.032, -0.006),
        (0.440, 0.080, 0.046, 0.002),
        (0.380, 0.084, 0.052, 0.006),
        (0.320, 0.066, 0.046, 0.002),
        (0.260, 0.068, 0.052, 0.000),
        (0.120, 0.080, 0.062, 0.000),
        (-0.040, 0.082, 0.064, 0.000),
        (-0.180, 0.074, 0.058, 0.000),
        (-0.280, 0.058, 0.052, 0.000),
        (-0.420, 0.044, 0.044, -0.006),
        (-0.600, 0.030, 0.032, -0.016),
        (-0.780, 0.016, 0.018, -0.028),
        (-0.880, 0.002, 0.002, -0.034),
    ]
)
LEGS = ((0.21, 1.0, CHEST, 0.0), (0.21, -1.0, CHEST, 0.5), (-0.23, 1.0, PELVIS, 0.5), (-0.23, -1.0, PELVIS, 0.0))
"""z of the hip, side, joint that it hangs on, and phase of the step."""


def tube(centers: Doubles, across: Doubles, up: Doubles, around: int) -> tuple[Doubles, npt.NDArray[np.int64]]:
    """Vertices and triangles of elliptical rings with the half axes `across` and `up`, (n, 3) each, and two ends."""
    angle = np.arange(around) * 2 * np.pi / around
    rings = centers[:, None] + np.cos(angle)[:, None] * across[:, None] + np.sin(angle)[:, None] * up[:, None]
    points = np.concatenate([rings.reshape(-1, 3), centers[:1], centers[-1:]])
    a = (np.arange(len(centers) - 1)[:, None] * around + np.arange(around)).ravel()
    b = (np.arange(len(centers) - 1)[:, None] * around + (np.arange(around) + 1) % around).ravel()
    one, two = np.arange(around), (np.arange(around) + 1) % around
    last = (len(centers) - 1) * around
    first_end, last_end = np.full(around, len(points) - 2), np.full(around, len(points) - 1)
    faces = [(a, b + around, b), (a, a + around, b + around), (one, two, first_end), (last + two, last + one, last_end)]
    return points, np.concatenate([np.stack(face, axis=1) for face in faces])


def smooth(table: Doubles, count: int) -> Doubles:
    """Rows of a table at `count` places along it, by Catmull-Rom splines."""
    place = np.linspace(0, len(table) - 1, count)
    first = np.minimum(place.astype(int), len(table) - 2)
    t = (place - first)[:, None]
    before, after = table[np.maximum(first - 1, 0)], table[np.minimum(first + 2, len(table) - 1)]
    a, b = table[first], table[first + 1]
    near = a + t * (b - before) / 2 + t**2 * (before - 2.5 * a + 2 * b - after / 2)
    return np.asarray(near + t**3 * (1.5 * (a - b) + (after - before) / 2))


def body() -> tuple[Doubles, npt.NDArray[np.int64], npt.NDArray[np.int64], Doubles]:
    """Vertices, triangles, joints and weights of trunk, head and tail."""
    z, wide, high, lift = smooth(PROFILE, 64).T
    zeros = np.zeros(len(z))
    centers = np.stack([zeros, HEIGHT + lift, z], axis=1)
    points, faces = tube(
        centers, np.stack([wide, zeros, zeros], axis=1), np.stack([zeros, high, zeros], axis=1), AROUND
    )
    place = np.interp(-points[:, 2], -(SPINE - 0.06), np.arange(len(SPINE)))  # bones reach half-way to the next joints
    low = np.minimum(place.astype(int), len(SPINE) - 2)
    share = np.clip((place - low - 0.25) / 0.5, 0, 1)
    return points, faces, np.stack([low, low + 1], axis=1), np.stack([1 - share, share], axis=1)


def leg(number: int) -> tuple[Doubles, npt.NDArray[np.int64], npt.NDArray[np.int64], Doubles]:
    """The same of a leg, from inside the body over the elbow to a flat foot."""
    z, side, hangs_on, _ = LEGS[number]
    path = np.array([(0.03, 0.0, 0.0), (0.08, 0.004, 0.0), (0.135, 0.012, 0.0), (0.165, -0.03, 0.004)])
    path = np.concatenate([path, [(0.175, -0.085, 0.016), (0.18, -0.104, 0.05), (0.182, -0.107, 0.085)]])
    wide = np.array([[0.03], [0.026], [0.021], [0.018], [0.02], [0.032], [0.004]])
    thick = np.array([[0.03], [0.026], [0.021], [0.017], [0.013], [0.008], [0.003]])
    row = smooth(np.hstack([path, wide, thick]), 22)
    along = np.gradient(row[:, :3], axis=0)
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    over = np.cross(along, [0.0, 0.0, 1.0]) + 0.6 * np.cross(along, [1.0, 0.0, 0.0])
    over /= np.linalg.norm(over, axis=1, keepdims=True)
    across = np.cross(over, along)
    points, faces = tube(row[:, :3], across * row[:, 3:4], over * row[:, 4:5], 12)
    reach = points[:, 0] + 0.5 * np.maximum(-points[:, 1], 0)
    points = points * [side, 1, 1] + [0, HEIGHT, z]
    shoulder, elbow = np.clip((reach - 0.03) / 0.05, 0, 1), np.clip((reach - 0.13) / 0.05, 0, 1)
    joints = np.tile([hangs_on, len(SPINE) + 2 * number, len(SPINE) + 2 * number + 1], (len(points), 1))
    weights = np.stack([1 - shoulder, shoulder - elbow, elbow], axis=1)
    return points, faces if side < 0 else faces[:, ::-1], joints, weights


def eye(side: float) -> tuple[Doubles, npt.NDArray[np.int64], npt.NDArray[np.int64], Doubles]:
    angle = np.linspace(0.02, np.pi - 0.02, 8)
    centers = np.array([side * 0.055, HEIGHT + 0.042, 0.43]) + 0.019 * np.cos(angle)[:, None] * [0, 0, 1]
    radius = 0.019 * np.sin(angle)[:, None]
    points, faces = tube(centers, radius * [1, 0, 0], radius * [0, 1, 0], 10)
    return points, faces, np.zeros((len(points), 1), int), np.ones((len(points), 1))


def mesh() -> dict[str, npt.NDArray[Any]]:
    """All parts as one mesh: positions, normals, colours, joints, weights and indices."""
    parts = [body(), *(leg(number) for number in range(len(LEGS))), eye(1.0), eye(-1.0)]
    starts = np.cumsum([0, *(len(points) for points, *_ in parts)])
    points = np.concatenate([part[0] for part in parts])
    faces = np.concatenate([part[1] + start for part, start in zip(parts, starts, strict=False)])
    joints, weights = np.zeros((len(points), 4), "u1"), np.zeros((len(points), 4), "<f4")
    for (_, _, joint, weight), start in zip(parts, starts, strict=False):
        rows = slice(start, start + len(joint))
        joints[rows, : joint.shape[1]], weights[rows, : joint.shape[1]] = np.where(weight > 0, joint, 0), weight
    a, b, c = points[faces].swapaxes(0, 1)
    normals = np.zeros_like(points)
    for corner in faces.T:
        np.add.at(normals, corner, np.cross(b - a, c - a))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    random = np.random.default_rng(5)
    spots = points[random.choice(int(starts[5]), 80, replace=False)]
    spots = spots[spots[:, 1] > HEIGHT - 0.02]
    near = np.linalg.norm(points[:, None] - spots, axis=2) / random.uniform(0.018, 0.04, len(spots))
    yellow = np.clip(3 * (1.15 - near.min(axis=1)), 0, 1)[:, None]
    yellow[starts[5] :] = 0
    colors = np.concatenate([yellow * [0.9, 0.42, 0.02] + (1 - yellow) * 0.014, np.ones((len(points), 1))], axis=1)
    return {
        "POSITION": points.astype("<f4"),
        "NORMAL": normals.astype("<f4"),
        "COLOR_0": np.round(colors * 65535).astype("<u2"),
        "JOINTS_0": joints,
        "WEIGHTS_0": np.round(weights * 65535).astype("<u2"),
        "indices": faces.astype("<u2"),
    }


def nodes() -> tuple[list[dict[str, Any]], Doubles]:
    """The joints as nodes, from number 1 on, and where they are, (j, 3)."""
    places = [np.array([0.0, HEIGHT, z]) for z in SPINE]
    parents = [min(n + 1, ROOT) if n < ROOT else n - 1 for n in range(len(SPINE))]
    parents[ROOT] = -1
    names = ["head", "chest", "shoulder", "middle", "waist", "pelvis", *(f"tail{n}" for n in range(1, 5))]
    for number, (z, side, hangs_on, _) in enumerate(LEGS):
        places += [np.array([side * 0.04, HEIGHT, z]), np.array([side * 0.145, HEIGHT + 0.01, z])]
        parents += [hangs_on, len(SPINE) + 2 * number]
        names += [f"hip{number}", f"knee{number}"]
    found: list[dict[str, Any]] = []
    for name, place, parent in zip(names, places, parents, strict=True):
        local = place - (places[parent] if parent >= 0 else 0)
        found.append({"name": name, "translation": np.round(local, 6).tolist()})
    for number, parent in enumerate(parents):
        if parent >= 0:
            found[parent].setdefault("children", []).append(number + 1)
    return found, np.array(places)


def walk(times: Doubles) -> dict[int, Doubles]:
    """Quaternions of each joint, (k, 4), at some times; the first and last are equal."""
    turn = 2 * np.pi * times / PERIOD
    rotations = {}
    for number, z in enumerate(SPINE):
        from_root = abs(number - ROOT)
        swing = 0.0 if number == ROOT else 0.10 if number < ROOT else 0.12 + 0.035 * from_root
        lag = 0.0 if number <= PELVIS else 0.75 * (number - PELVIS)
        sign = -1.0 if z > SPINE[ROOT] else 1.0
        rotations[number] = about(1, sign * swing * np.cos(turn - lag))
    rotations[0] = about(1, 0.16 * np.cos(turn))  # the head looks ahead
    for number, (_, side, hangs_on, phase) in enumerate(LEGS):
        step = turn + 2 * np.pi * phase
        reach = (0.42 if hangs_on == CHEST else 0.5) * np.sin(step)
        lift = np.maximum(np.cos(step), 0.0) ** 1.5  # while the leg swings forwards
        rotations[len(SPINE) + 2 * number] = product(about(1, -side * reach), about(2, side * 0.2 * lift))
        rotations[len(SPINE) + 2 * number + 1] = product(about(1, side * 0.4 * reach), about(2, side * 0.22 * lift))
    return rotations


def about(axis: int, angle: Doubles) -> Doubles:
    found = np.zeros((len(angle), 4))
    found[:, axis], found[:, 3] = np.sin(angle / 2), np.cos(angle / 2)
    return found


def product(p: Doubles, q: Doubles) -> Doubles:
    vector = p[:, 3:] * q[:, :3] + q[:, 3:] * p[:, :3] + np.cross(p[:, :3], q[:, :3])
    return np.column_stack([vector, p[:, 3] * q[:, 3] - (p[:, :3] * q[:, :3]).sum(axis=1)])


def document() -> tuple[dict[str, Any], bytes]:
    """The JSON and the binary chunk of the file."""
    views: list[dict[str, Any]] = []
    accessors: list[dict[str, Any]] = []
    data = bytearray()

    def store(array: npt.NDArray[Any], kind: str, component: int, **more: Any) -> int:
        data.extend(b"\0" * (-len(data) % 4))
        views.append({"buffer": 0, "byteOffset": len(data), "byteLength": array.nbytes})
        data.extend(array.tobytes())
        count = array.size if kind == "SCALAR" else len(array)
        accessors.append(
            {"bufferView": len(views) - 1, "componentType": component, "type": kind, "count": count, **more}
        )
        return len(accessors) - 1

    made = mesh()
    box = {key: getattr(made["POSITION"], key)(axis=0).tolist() for key in ("min", "max")}
    attributes = {
        "POSITION": store(made["POSITION"], "VEC3", 5126, **box),
        "NORMAL": store(made["NORMAL"], "VEC3", 5126),
        "COLOR_0": store(made["COLOR_0"], "VEC4", 5123, normalized=True),
        "JOINTS_0": store(made["JOINTS_0"], "VEC4", 5121),
        "WEIGHTS_0": store(made["WEIGHTS_0"], "VEC4", 5123, normalized=True),
    }
    primitive = {"attributes": attributes, "indices": store(made["indices"].ravel(), "SCALAR", 5123), "material": 0}
    joints, places = nodes()
    inverses = np.tile(np.eye(4), (len(places), 1, 1))
    inverses[:, :3, 3] = -places
    binds = store(np.ascontiguousarray(inverses.swapaxes(1, 2).reshape(-1, 16), "<f4"), "MAT4", 5126)
    times = np.linspace(0, PERIOD, KEYS + 1)
    key_times = store(times.astype("<f4"), "SCALAR", 5126, min=[0.0], max=[PERIOD])
    rotations = walk(times)
    samplers = [{"input": key_times, "output": store(rotations[n].astype("<f4"), "VEC4", 5126)} for n in rotations]
    targets = [{"node": number + 1, "path": "rotation"} for number in rotations]
    channels = [{"sampler": at, "target": target} for at, target in enumerate(targets)]
    skin = {"joints": list(range(1, len(joints) + 1)), "inverseBindMatrices": binds, "skeleton": ROOT + 1}
    material = {"name": "skin", "pbrMetallicRoughness": {"metallicFactor": 0, "roughnessFactor": 0.32}}
    top = {
        "asset": {"version": "2.0", "generator": "salamander.py"},
        "buffers": [{"byteLength": len(data)}],
        "bufferViews": views,
        "accessors": accessors,
        "materials": [material],
        "meshes": [{"name": "salamander", "primitives": [primitive]}],
        "skins": [skin],
        "nodes": [{"name": "salamander", "mesh": 0, "skin": 0}, *joints],
        "scenes": [{"nodes": [0, ROOT + 1]}],
        "scene": 0,
        "animations": [{"name": "walk", "samplers": samplers, "channels": channels}],
    }
    return top, bytes(data)


def write(path: Path) -> None:
    top, data = document()
    text = json.dumps(top, separators=(",", ":")).encode()
    text, data = text + b" " * (-len(text) % 4), data + b"\0" * (-len(data) % 4)
    chunks = struct.pack("<II", len(text), 0x4E4F534A) + text + struct.pack("<II", len(data), 0x004E4942) + data
    path.write_bytes(struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks)


if __name__ == "__main__":
    write(Path(__file__).with_suffix(".glb"))
