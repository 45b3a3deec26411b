"""An orrery: planets on brass arms that turn about a lamp, at different speeds. Writes `orrery.glb` beside it.

Every part is a surface of revolution or a gear. The arms are nodes that turn; a moon's arm is a child of a planet's.
After one clip all are back where they began. Metres, +Y up, the foot at y = 0.
"""

from __future__ import annotations

import json
import struct
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

Doubles = npt.NDArray[np.float64]
Mesh = tuple[Doubles, Doubles, npt.NDArray[np.int64]]
"""Positions and normals, (n, 3), and triangles, (m, 3)."""

LENGTH = 8.0
"""Seconds of the clip."""
AROUND = 40
MATERIALS = {
    "brass": ((0.89, 0.66, 0.28), 1.0, 0.28),
    "dark": ((0.10, 0.07, 0.05), 0.0, 0.35),
    "mercury": ((0.34, 0.31, 0.29), 0.0, 0.6),
    "venus": ((0.82, 0.55, 0.22), 0.0, 0.5),
    "earth": ((0.03, 0.16, 0.45), 0.0, 0.25),
    "moon": ((0.75, 0.74, 0.70), 0.0, 0.6),
    "jupiter": ((0.62, 0.36, 0.20), 0.0, 0.4),
    "saturn": ((0.78, 0.64, 0.38), 0.0, 0.4),
    "rings": ((0.60, 0.52, 0.40), 0.0, 0.5),
    "sun": ((1.0, 1.0, 1.0), 0.0, 1.0),
}
PLANETS = (
    # name, distance, radius, height, turns in a clip
    ("mercury", 0.22, 0.028, 0.50, 7),
    ("venus", 0.34, 0.045, 0.46, 5),
    ("earth", 0.48, 0.050, 0.42, 3),
    ("jupiter", 0.68, 0.090, 0.38, 2),
    ("saturn", 0.90, 0.075, 0.34, 1),
)
STARTS = (2.6, 4.4, 0.5, 2.45, 5.3)
"""Where the planets are at first, in radians."""


def at(x: float, y: float) -> Doubles:
    return np.array([x, y, 0.0])


def around_y(count: int) -> Doubles:
    """Return points of a circle of radius 1 about Y; the last is the first, to the bit."""
    angle = np.linspace(0, 2 * np.pi, count + 1)
    circle = np.stack([np.cos(angle), np.zeros_like(angle), -np.sin(angle)], axis=1)
    circle[-1] = circle[0]
    return circle


def lathe(profile: Doubles, around: int = AROUND) -> Mesh:
    """Return the surface of revolution of (radius, height) pairs about Y, from the top down, with hard edges."""
    circle = around_y(around)
    positions: list[Doubles] = []
    normals: list[Doubles] = []
    faces: list[npt.NDArray[np.int64]] = []
    for (r0, y0), (r1, y1) in pairwise(profile):
        out = np.array([y0 - y1, r1 - r0]) / np.hypot(y0 - y1, r1 - r0)
        start = (around + 1) * len(positions)
        positions += [r0 * circle + at(0, y0), r1 * circle + at(0, y1)]
        normals += [out[0] * circle + at(0, out[1])] * 2
        a = np.arange(around) + start
        b, c, d = a + 1, a + around + 1, a + around + 2
        faces += [np.stack([a, c, b], axis=1), np.stack([b, c, d], axis=1)]
    return np.concatenate(positions), np.concatenate(normals), np.concatenate(faces)


def sphere(radius: float, y: float = 0.0, rows: int = 16) -> Mesh:
    angle = np.linspace(0, np.pi, rows + 1)
    positions, _, faces = lathe(np.round(radius * np.stack([np.sin(angle), np.cos(angle)], axis=1), 9), 2 * rows)
    return positions + at(0, y), positions / radius, faces


def cylinder(radius: float, low: float, high: float, around: int = AROUND) -> Mesh:
    return lathe(np.array([(0, high), (radius, high), (radius, low), (0, low)]), around)


def ring(inner: float, outer: float, low: float, high: float) -> Mesh:
    return lathe(np.array([(inner, high), (outer, high), (outer, low), (inner, low), (inner, high)]), 2 * AROUND)


def gear(teeth: int, radius: float, low: float, high: float) -> Mesh:
    """Return a disc whose rim rises and falls by 6 mm, as many times as it has teeth."""
    rim = radius + np.where(np.arange(4 * teeth + 1) % 4 < 2, 0.006, -0.006)
    circle = rim[:, None] * around_y(4 * teeth)
    top, bottom = circle + at(0, high), circle + at(0, low)
    positions: list[Any] = []
    normals: list[Any] = []
    faces: list[Any] = []
    for k in range(4 * teeth):
        edge = circle[k + 1] - circle[k]
        out = np.array([-edge[2], 0, edge[0]])
        out *= np.sign(out @ circle[k]) / np.linalg.norm(out)
        start = len(positions)
        positions += [top[k], top[k + 1], bottom[k], bottom[k + 1], top[k], top[k + 1], [0, high, 0]]
        positions += [bottom[k], bottom[k + 1], [0, low, 0]]
        normals += [out] * 4 + [[0, 1, 0]] * 3 + [[0, -1, 0]] * 3
        faces += [(start, start + 2, start + 1), (start + 1, start + 2, start + 3), (start + 4, start + 5, start + 6)]
        faces += [(start + 7, start + 9, start + 8)]
    return np.array(positions), np.array(normals), np.array(faces)


def turned_to_x(mesh: Mesh) -> Mesh:
    """Return a mesh with its +Y along +X."""
    positions, normals, faces = mesh
    swap = [1, 0, 2]
    return positions[:, swap], normals[:, swap], faces[:, ::-1]


def moved(mesh: Mesh, x: float, y: float = 0.0, tilt: float = 0.0) -> Mesh:
    """Return a mesh turned by `tilt` about X and moved."""
    positions, normals, faces = mesh
    c, s = np.cos(tilt), np.sin(tilt)
    turn = np.array([[1, 0, 0], [0, c, s], [0, -s, c]])
    return positions @ turn + at(x, y), normals @ turn, faces


def joined(parts: list[Mesh]) -> Mesh:
    starts = np.cumsum([0, *(len(part[0]) for part in parts)])
    faces = [part[2] + start for part, start in zip(parts, starts, strict=False)]
    return np.concatenate([p[0] for p in parts]), np.concatenate([p[1] for p in parts]), np.concatenate(faces)


def nodes() -> list[dict[str, Any]]:
    """The parts: name, meshes by material, turns in a clip, parent and place."""
    tiers = np.array([(0.0, 0.06), (0.26, 0.06), (0.28, 0.045), (0.28, 0.02), (0.31, 0.02), (0.31, 0.0), (0, 0)])
    foot = [lathe(tiers)]
    column = [cylinder(0.03, 0.06, 0.3), cylinder(0.012, 0.3, 0.56), ring(0.0, 0.06, 0.06, 0.08)]
    found: list[dict[str, Any]] = [
        {"name": "stand", "meshes": {"dark": foot, "brass": column, "sun": [sphere(0.085, 0.62)]}},
    ]
    for number, (name, distance, radius, height, turns) in enumerate(PLANETS):
        low = 0.30 - 0.035 * number
        arm = turned_to_x(cylinder(0.008, 0.0, distance, 12))
        brass = [gear(20 + 6 * number, 0.06 + 0.022 * number, low - 0.006, low + 0.006), moved(arm, 0.0, low)]
        brass += [moved(cylinder(0.006, low, height - radius, 12), distance), moved(sphere(0.014, 0, 8), distance, low)]
        meshes = {"brass": brass, name: [moved(sphere(radius), distance, height)]}
        if name == "saturn":
            meshes["rings"] = [moved(ring(1.35 * radius, 2.2 * radius, -0.002, 0.002), distance, height, 0.4)]
        parent = len(found)
        found.append({"name": name, "meshes": meshes, "turns": turns, "start": STARTS[number]})
        if name == "earth":
            arm = turned_to_x(cylinder(0.004, 0.0, 0.095, 12))
            post = moved(cylinder(0.003, -0.06, -0.012, 12), 0.095)
            meshes = {"brass": [moved(arm, 0.0, -0.06), post], "moon": [moved(sphere(0.014, 0, 12), 0.095)]}
            found.append({"name": "moon", "meshes": meshes, "turns": 13, "parent": parent, "at": [distance, height, 0]})
    return found


def turning(turns: int, start: float) -> tuple[Doubles, Doubles]:
    """Return times, (k,), and quaternions, (k, 4), of a steady turn about Y; the last is where the first is."""
    count = 4 * turns
    half = (start + 2 * np.pi * turns * np.arange(count + 1) / count) / 2
    zero = np.zeros(count + 1)
    return LENGTH * np.arange(count + 1) / count, np.stack([zero, np.sin(half), zero, np.cos(half)], axis=1)


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
            {"bufferView": len(views) - 1, "componentType": component, "type": kind, "count": count} | more
        )
        return len(accessors) - 1

    top: dict[str, Any] = {"asset": {"version": "2.0", "generator": "orrery.py"}, "meshes": [], "nodes": []}
    samplers: list[Any] = []
    channels: list[Any] = []
    names = list(MATERIALS)
    for number, node in enumerate(nodes()):
        primitives = []
        for material, parts in node["meshes"].items():
            positions, normals, faces = joined(parts)
            points = positions.astype("<f4")
            box = {key: getattr(points, key)(axis=0).tolist() for key in ("min", "max")}
            attributes = {
                "POSITION": store(points, "VEC3", 5126, **box),
                "NORMAL": store(normals.astype("<f4"), "VEC3", 5126),
            }
            indices = store(faces.astype("<u2").ravel(), "SCALAR", 5123)
            primitives.append({"attributes": attributes, "indices": indices, "material": names.index(material)})
        top["meshes"].append({"name": node["name"], "primitives": primitives})
        top["nodes"].append({"name": node["name"], "mesh": number})
        if "at" in node:
            top["nodes"][number]["translation"] = node["at"]
        if "parent" in node:
            top["nodes"][node["parent"]].setdefault("children", []).append(number)
        if "turns" in node:
            times, rotations = turning(node["turns"], node.get("start", 0.0))
            at = store(times.astype("<f4"), "SCALAR", 5126, min=[0.0], max=[LENGTH])
            channels.append({"sampler": len(samplers), "target": {"node": number, "path": "rotation"}})
            samplers.append({"input": at, "output": store(rotations.astype("<f4"), "VEC4", 5126)})
    children = {child for node in top["nodes"] for child in node.get("children", ())}
    top["materials"] = [
        {"name": name, "pbrMetallicRoughness": {"baseColorFactor": [*c, 1], "metallicFactor": m, "roughnessFactor": r}}
        for name, (c, m, r) in MATERIALS.items()
    ]
    top["materials"][names.index("sun")] |= {
        "emissiveFactor": [1.0, 0.75, 0.42],
        "extensions": {"KHR_materials_emissive_strength": {"emissiveStrength": 8.0}},
    }
    top["extensionsUsed"] = ["KHR_materials_emissive_strength"]
    top["scenes"], top["scene"] = [{"nodes": [n for n in range(len(top["nodes"])) if n not in children]}], 0
    top["animations"] = [{"name": "orbits", "samplers": samplers, "channels": channels}]
    top |= {"accessors": accessors, "bufferViews": views, "buffers": [{"byteLength": len(data)}]}
    return top, bytes(data)


def write(path: Path) -> None:
    top, data = document()
    text = json.dumps(top, separators=(",", ":")).encode()
    text, data = text + b" " * (-len(text) % 4), data + b"\0" * (-len(data) % 4)
    chunks = struct.pack("<II", len(text), 0x4E4F534A) + text + struct.pack("<II", len(data), 0x004E4942) + data
    path.write_bytes(struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks)


if __name__ == "__main__":
    write(Path(__file__).with_suffix(".glb"))
