"""Animated meshes: every vertex that the GPU poses, against float64 and an evaluation of the file's JSON of its own."""

from __future__ import annotations

import base64
import json
import runpy
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

import rendergraph as rg
from rendergraph.api import Any as Anything
from rendergraph.api import Input, Node, Output, SceneData, Steps
from rendergraph.compile.gpu_scene import GpuScene
from rendergraph.errors import InputError
from rendergraph.resources import folder
from rendergraph.scene import animate, pack
from rendergraph.scene.cameras import view_matrices
from rendergraph.scene.load import load

Doubles = npt.NDArray[np.float64]
TYPES = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}


class Reference:
    """A glTF file evaluated node by node and vertex by vertex, as §3.7 and §3.11 are written."""

    def __init__(self, path: Path) -> None:
        data = path.read_bytes()
        binary = b""
        if data[:4] == b"glTF":
            length = struct.unpack_from("<I", data, 12)[0]
            binary, data = data[20 + length + 8 :], data[20 : 20 + length]
        self.json: dict[str, Any] = json.loads(data)
        self.buffers = []
        for buffer in self.json["buffers"]:
            uri = buffer.get("uri")
            if uri is None:
                self.buffers.append(binary)
            elif uri.startswith("data:"):
                self.buffers.append(base64.b64decode(uri.partition(",")[2]))
            else:
                self.buffers.append((path.parent / uri).read_bytes())
        self.parents = {c: n for n, node in enumerate(self.json["nodes"]) for c in node.get("children", ())}

    def _elements(self, view: int, offset: int, dtype: str, count: int, width: int) -> npt.NDArray[Any]:
        described = self.json["bufferViews"][view]
        start = described.get("byteOffset", 0) + offset
        stride = described.get("byteStride", np.dtype(dtype).itemsize * width)
        rows = [
            np.frombuffer(self.buffers[described["buffer"]], dtype, width, start + row * stride) for row in range(count)
        ]
        return np.array(rows)

    def array(self, number: int) -> Doubles:
        accessor = self.json["accessors"][number]
        dtype, count, width = TYPES[accessor["componentType"]], accessor["count"], WIDTHS[accessor["type"]]
        values = np.zeros((count, width), dtype)
        if "bufferView" in accessor:
            values = self._elements(accessor["bufferView"], accessor.get("byteOffset", 0), dtype, count, width)
        if "sparse" in accessor:
            sparse = accessor["sparse"]
            at, new = sparse["indices"], sparse["values"]
            places = self._elements(
                at["bufferView"], at.get("byteOffset", 0), TYPES[at["componentType"]], sparse["count"], 1
            )
            values = values.copy()
            values[places[:, 0]] = self._elements(
                new["bufferView"], new.get("byteOffset", 0), dtype, sparse["count"], width
            )
        found = values.astype(np.float64)
        return np.maximum(found / np.iinfo(dtype).max, -1) if accessor.get("normalized") else found

    def sampled(self, animation: dict[str, Any], channel: dict[str, Any], time: float) -> Doubles:
        sampler = animation["samplers"][channel["sampler"]]
        times, values = self.array(sampler["input"])[:, 0], self.array(sampler["output"])
        kind, path = sampler.get("interpolation", "LINEAR"), channel["target"]["path"]
        parts = 3 if kind == "CUBICSPLINE" else 1
        values = values.reshape(len(times), parts, -1)
        keys = values[:, parts // 2]
        if time <= times[0] or time >= times[-1]:
            found = keys[0] if time <= times[0] else keys[-1]
        else:
            k = max(n for n, key in enumerate(times) if key <= time)
            span, t = times[k + 1] - times[k], (time - times[k]) / (times[k + 1] - times[k])
            if kind == "STEP":
                found = keys[k]
            elif kind == "CUBICSPLINE":
                hermite = np.array([2 * t**3 - 3 * t**2 + 1, t**3 - 2 * t**2 + t, -2 * t**3 + 3 * t**2, t**3 - t**2])
                found = hermite @ np.array([keys[k], span * values[k, 2], keys[k + 1], span * values[k + 1, 0]])
            elif path == "rotation":
                found = power_between(keys[k], keys[k + 1], t)
            else:
                found = (1 - t) * keys[k] + t * keys[k + 1]
        return np.asarray(found / np.linalg.norm(found) if path == "rotation" else found)

    def pose(self, clip: int, time: float) -> tuple[list[Doubles], list[Doubles]]:
        """World matrices and weights of all nodes."""
        nodes = [dict(node) for node in self.json["nodes"]]
        if self.json.get("animations"):
            animation = self.json["animations"][clip]
            length = max(self.array(sampler["input"]).max() for sampler in animation["samplers"])
            for channel in animation["channels"]:
                nodes[channel["target"]["node"]][channel["target"]["path"]] = self.sampled(
                    animation, channel, time % length
                )
        worlds: list[Doubles] = []
        for number in range(len(nodes)):
            world: Doubles = np.eye(4)
            at: int | None = number
            while at is not None:
                world, at = self.local(nodes[at]) @ world, self.parents.get(at)
            worlds.append(world)
        weights = []
        for node in nodes:
            mesh = self.json["meshes"][node["mesh"]] if "mesh" in node else {"primitives": [{}]}
            count = len(mesh["primitives"][0].get("targets", ()))
            weights.append(np.array(node.get("weights", mesh.get("weights", np.zeros(count))), float))
        return worlds, weights

    @staticmethod
    def local(node: dict[str, Any]) -> Doubles:
        if "matrix" in node:
            return np.array(node["matrix"], float).reshape(4, 4).T
        found = np.eye(4)
        axis = np.array(node.get("rotation", (0, 0, 0, 1)), float)
        u, w = axis[:3] / np.linalg.norm(axis), axis[3] / np.linalg.norm(axis)
        cross = np.array([[0, -u[2], u[1]], [u[2], 0, -u[0]], [-u[1], u[0], 0]])
        rotation = np.eye(3) + 2 * w * cross + 2 * cross @ cross
        found[:3, :3] = rotation @ np.diag(np.array(node.get("scale", (1, 1, 1)), float))
        found[:3, 3] = node.get("translation", (0, 0, 0))
        return found

    def posed(self, node: int, primitive: int, clip: int, time: float) -> tuple[Doubles, Doubles, Doubles | None]:
        """World-space positions, normals and tangents of a primitive, those without normals by corners."""
        worlds, weights = self.pose(clip, time)
        described = self.json["meshes"][self.json["nodes"][node]["mesh"]]["primitives"][primitive]
        attributes, targets = described["attributes"], described.get("targets", [])
        rest = self.array(attributes["POSITION"])
        position = rest.copy()
        for target, weight in zip(targets, weights[node], strict=True):
            position += weight * self.array(target["POSITION"]) if "POSITION" in target else 0
        corners = self.array(described["indices"])[:, 0].astype(int) if "indices" in described else np.arange(len(rest))
        each, tangent = np.arange(len(rest)), None
        if "NORMAL" in attributes:
            normal = self.array(attributes["NORMAL"])
            for target, weight in zip(targets, weights[node], strict=True):
                normal = normal + weight * self.array(target["NORMAL"]) if "NORMAL" in target else normal
            if "TANGENT" in attributes:
                tangent = self.array(attributes["TANGENT"])
                for target, weight in zip(targets, weights[node], strict=True):
                    if "TANGENT" in target:
                        tangent[:, :3] += weight * self.array(target["TANGENT"])
        else:
            each = corners
            normal = flat_normals(rest[corners])
            for target, weight in zip(targets, weights[node], strict=True):
                moved = (rest + self.array(target["POSITION"]))[corners]
                normal = normal + weight * (flat_normals(moved) - flat_normals(rest[corners]))
        matrices = np.tile(worlds[node], (len(rest), 1, 1))
        if "skin" in self.json["nodes"][node]:
            skin = self.json["skins"][self.json["nodes"][node]["skin"]]
            inverses = np.tile(np.eye(4), (len(skin["joints"]), 1, 1))
            if "inverseBindMatrices" in skin:
                stored = self.array(skin["inverseBindMatrices"])[: len(inverses)]
                inverses = stored.reshape(-1, 4, 4).swapaxes(1, 2)
            moves = np.array([worlds[joint] @ inverses[k] for k, joint in enumerate(skin["joints"])])
            matrices, total, number = np.zeros((len(rest), 4, 4)), np.zeros(len(rest)), 0
            while f"JOINTS_{number}" in attributes:
                joints = self.array(attributes[f"JOINTS_{number}"]).astype(int)
                shares = self.array(attributes[f"WEIGHTS_{number}"])
                for vertex in range(len(rest)):
                    for joint, share in zip(joints[vertex], shares[vertex], strict=True):
                        matrices[vertex] += share * moves[joint]
                total += shares.sum(axis=1)
                number += 1
            matrices /= total[:, None, None]
        matrices, position = matrices[each], position[each]
        position = np.einsum("nij,nj->ni", matrices, np.column_stack([position, np.ones(len(position))]))[:, :3]
        normal = np.einsum("nji,nj->ni", np.linalg.inv(matrices[:, :3, :3]), normal)
        if tangent is not None:
            direction = np.einsum("nij,nj->ni", matrices[:, :3, :3], tangent[:, :3])
            tangent[:, :3] = direction / np.linalg.norm(direction, axis=1, keepdims=True)
        return position, normal / np.linalg.norm(normal, axis=1, keepdims=True), tangent


def power_between(a: Doubles, b: Doubles, t: float) -> Doubles:
    """a (a⁻¹ b)^t, which goes round the axis between two rotations with constant speed."""
    a, b = a / np.linalg.norm(a), b / np.linalg.norm(b)
    b = -b if a @ b < 0 else b
    between = times(np.array([*-a[:3], a[3]]), b)
    angle, axis = 2 * np.arctan2(np.linalg.norm(between[:3]), between[3]), between[:3]
    if np.linalg.norm(axis) < 1e-12:
        return a
    part = np.sin(t * angle / 2) * axis / np.linalg.norm(axis)
    return times(a, np.array([*part, np.cos(t * angle / 2)]))


def times(p: Doubles, q: Doubles) -> Doubles:
    return np.array([*(p[3] * q[:3] + q[3] * p[:3] + np.cross(p[:3], q[:3])), p[3] * q[3] - p[:3] @ q[:3]])


def flat_normals(corners: Doubles) -> Doubles:
    a, b, c = corners.reshape(-1, 3, 3).swapaxes(0, 1)
    normal = np.cross(b - a, c - a)
    return np.repeat(normal / np.linalg.norm(normal, axis=1, keepdims=True), 3, axis=0)


def check(gl: Any, path: Path, moments: npt.ArrayLike, clip: int = 0) -> None:
    """Compare what the GPU holds with the reference, at some times: all streams, the scene's data, boxes, the past."""
    reference, scene = Reference(path), load(path)
    if clip:
        from rendergraph.pipelines.formats.gltf import read_gltf

        from rendergraph.scene.reading import Reading, inside

        read = read_gltf(path, Reading(path, inside(path.parent)))
        scene = animate.play(read, list(read.rigs[0].clips)[clip])
    owners = [
        (number, k) for number, node in enumerate(reference.json["nodes"]) if "mesh" in node
        for k in range(len(reference.json["meshes"][node["mesh"]]["primitives"]))
    ]  # fmt: skip
    packed = pack.pack(scene)
    with gl.device.current():
        white = np.full((1, 1, 4), 255, np.uint8)
        made = GpuScene(gl.device, scene, packed, lambda *_: white, lambda _: white)
        before, width = made.previous_positions(), made.data.buffers["scene_vertex_texels"].size // 4
        width //= len(packed.positions)
        made.tree()
        was = made._streams["in_position"][0].read()
        for time in np.asarray(moments, float):
            made.advance()
            assert before.read() == was
            now = animate.at(scene, float(time))
            made.update(now)
            was = made._streams["in_position"][0].read()
            streams = {
                name: np.frombuffer(buffer.read(), np.float32).reshape(len(packed.positions), -1)
                for name, (buffer, _) in made._streams.items()
            }
            again = GpuScene(gl.device, now, pack.pack(now), lambda *_: white, lambda _: white)
            assert made.tree().read() == again.tree().read()
            again.release(gl.cache.programs)
            data = np.frombuffer(made.data.buffers["scene_vertex_texels"].read(), np.float32).reshape(-1, width)
            assert (data[:, :3] == streams["in_position"]).all()
            assert (data[:, 3:6] == streams["in_normal"]).all()
            for placed in now.objects:
                named = (n for n, _ in owners if reference.json["nodes"][n].get("name", f"node_{n}") == placed.node)
                (node,) = set(named)
                parts = [k for n, k in owners if n == node]
                part = int(placed.name.rpartition("#")[2]) if "#" in placed.name else parts[0]
                position, normal, tangent = reference.posed(node, part, clip, time)
                record = packed.meshes[placed.mesh]
                rows = slice(record["base_vertex"], record["base_vertex"] + record["vertices"])
                order = packed.vertex_orders.get(placed.mesh)
                if order is None:
                    continue
                linear = placed.transform[:3, :3]
                found = streams["in_position"][rows].astype(float)
                low, high = placed.pose.box  # type: ignore[union-attr]
                assert (found >= low).all()
                assert (found <= high).all()
                size = np.ptp(position, axis=0).max()
                assert np.abs(found @ linear.T + placed.transform[:3, 3] - position[order]).max() <= 1e-5 * size
                found = streams["in_normal"][rows] @ np.linalg.inv(linear)
                found /= np.linalg.norm(found, axis=1, keepdims=True)
                assert np.abs(found - normal[order]).max() <= 1e-5
                if tangent is not None:
                    assert (data[rows, 6:10] == streams["in_tangent"][rows]).all()
                    found = streams["in_tangent"][rows].astype(float)
                    found[:, :3] = found[:, :3] @ linear.T
                    found[:, :3] /= np.linalg.norm(found[:, :3], axis=1, keepdims=True)
                    assert np.abs(found - tangent[order]).max() <= 1e-5
        made.release(gl.cache.programs)


@pytest.mark.parametrize(
    ("name", "clip"),
    [
        ("Fox.glb", 0), ("Fox.glb", 2), ("RiggedFigure.glb", 0), ("RiggedSimple.glb", 0), ("SimpleSkin/SimpleSkin.gltf", 0),
        ("SimpleMorph/SimpleMorph.gltf", 0), ("AnimatedMorphCube.glb", 0), ("MorphStressTest.glb", 1),
    ],
)  # fmt: skip
def test_the_khronos_assets_are_posed_as_their_files_say(gl: Any, shared: Path, name: str, clip: int) -> None:
    moments = np.random.default_rng(len(name)).uniform(0, 9, 2)
    check(gl, shared / "assets/gltf" / name, moments, clip)


def uri(data: bytes) -> str:
    return "data:application/octet-stream;base64," + base64.b64encode(data).decode()


class File:
    """A glTF file in the making."""

    def __init__(self) -> None:
        self.data = b""
        self.json: dict[str, Any] = {"asset": {"version": "2.0"}, "bufferViews": [], "accessors": []}

    def view(self, array: npt.NDArray[Any]) -> int:
        self.data += b"\0" * (-len(self.data) % 4)
        self.json["bufferViews"].append({"buffer": 0, "byteOffset": len(self.data), "byteLength": array.nbytes})
        self.data += array.tobytes()
        return len(self.json["bufferViews"]) - 1

    def array(self, values: npt.ArrayLike, kind: str, dtype: str = "<f4", **more: Any) -> int:
        array = np.ascontiguousarray(values, dtype)
        component = next(code for code, name in TYPES.items() if name == dtype)
        count = array.size // WIDTHS[kind]
        self.json["accessors"].append(
            {"bufferView": self.view(array), "componentType": component, "type": kind, "count": count, **more}
        )
        return len(self.json["accessors"]) - 1

    def sparse(self, count: int, places: npt.ArrayLike, values: npt.ArrayLike) -> int:
        at = np.asarray(places, "<u2")
        sparse = {
            "count": len(at),
            "indices": {"bufferView": self.view(at), "componentType": 5123},
            "values": {"bufferView": self.view(np.asarray(values, "<f4"))},
        }
        self.json["accessors"].append({"componentType": 5126, "type": "VEC3", "count": count, "sparse": sparse})
        return len(self.json["accessors"]) - 1

    def write(self, path: Path) -> Path:
        self.json["buffers"] = [{"byteLength": len(self.data), "uri": uri(self.data)}]
        path.write_text(json.dumps(self.json))
        return path


def creature(
    random: np.random.Generator,
    *,
    sets: int = 1,
    weights: str = "<f4",
    interpolation: str = "LINEAR",
    binds: bool = True,
    targets: int = 0,
    normals: bool = True,
    skin: bool = True,
) -> File:
    """A random mesh on a random skeleton: joints under two roots, one of them also the parent of the mesh."""
    file, count, joints = File(), 12, 5
    positions = random.normal(size=(count, 3))
    attributes = {"POSITION": file.array(positions, "VEC3")}
    primitive: dict[str, Any] = {"attributes": attributes}
    if normals:
        attributes["NORMAL"] = file.array(unit_rows(random.normal(size=(count, 3))), "VEC3")
        hand = random.choice([-1.0, 1.0], (count, 1))
        attributes["TANGENT"] = file.array(np.hstack([unit_rows(random.normal(size=(count, 3))), hand]), "VEC4")
    for number in range(sets if skin else 0):
        dtype = "<u1" if number == 0 else "<u2"
        attributes[f"JOINTS_{number}"] = file.array(random.integers(0, joints, (count, 4)), "VEC4", dtype)
        share = random.uniform(0, 1, (count, 4)) / sets
        if weights != "<f4":
            share = np.round(share * np.iinfo(weights).max / 4)
        more = {} if weights == "<f4" else {"normalized": True}
        attributes[f"WEIGHTS_{number}"] = file.array(share, "VEC4", weights, **more)
    primitive["targets"] = []
    for number in range(targets):
        target = {"POSITION": file.sparse(count, [1, 4, 5], random.normal(size=(3, 3)))}
        if normals and number:
            target["NORMAL"] = file.array(random.normal(0, 0.3, (count, 3)), "VEC3")
            target["TANGENT"] = file.array(random.normal(0, 0.3, (count, 3)), "VEC3")
        primitive["targets"].append(target)
    nodes: list[dict[str, Any]] = [{"name": "body", "mesh": 0, "translation": [0.3, 0.1, 0.0]}]
    for number, parent in enumerate((None, None, 1, 1, 3)):
        nodes.append({"name": f"joint{number}", "translation": random.normal(size=3).tolist()})
        if parent is not None:
            nodes[parent].setdefault("children", []).append(number + 1)
    nodes[2].setdefault("children", []).append(0)
    file.json["scenes"], file.json["nodes"] = [{"nodes": [1, 2]}], nodes
    file.json["meshes"] = [{"primitives": [primitive]}]
    if skin:
        nodes[0]["skin"] = 0
        found: dict[str, Any] = {"joints": [4, 1, 3, 2, 5]}
        if binds:
            inverses = np.tile(np.eye(4), (joints, 1, 1))
            inverses[:, :3] += random.normal(0, 0.2, (joints, 3, 4))
            found["inverseBindMatrices"] = file.array(inverses.swapaxes(1, 2).reshape(joints, 16), "MAT4")
        file.json["skins"] = [found]
    samplers, channels = [], []
    parts = 3 if interpolation == "CUBICSPLINE" else 1
    times = np.cumsum(random.uniform(0.1, 0.6, 4))
    shared_times = file.array(times, "SCALAR")
    properties = [(node, path) for node in (1, 2, 3, 4, 5) for path in ("translation", "rotation", "scale")]
    for node, path in [*properties, *([(0, "weights")] if targets else [])]:
        width = {"rotation": 4, "weights": targets}.get(path, 3)
        values = random.normal(size=(4, parts, width)) + (1.5 if path == "scale" else 0)
        if path == "rotation":
            values[:, parts // 2] = unit_rows(values[:, parts // 2])
        own = file.array(times * random.uniform(0.5, 1), "SCALAR") if node == 4 else shared_times
        kind = {"rotation": "VEC4", "weights": "SCALAR"}.get(path, "VEC3")
        samplers.append({"input": own, "output": file.array(values, kind), "interpolation": interpolation})
        channels.append({"sampler": len(samplers) - 1, "target": {"node": node, "path": path}})
    file.json["animations"] = [{"name": "wiggle", "samplers": samplers, "channels": channels}]
    return file


def unit_rows(rows: Doubles) -> Doubles:
    return np.asarray(rows / np.linalg.norm(rows, axis=1, keepdims=True))


@pytest.mark.parametrize(
    "options",
    [
        {},
        {"sets": 2, "interpolation": "CUBICSPLINE"},
        {"weights": "<u1", "interpolation": "STEP", "binds": False},
        {"weights": "<u2", "sets": 2, "targets": 3},
        {"targets": 2, "normals": False},
        {"targets": 3, "skin": False, "interpolation": "CUBICSPLINE"},
    ],
    ids=str,
)
def test_skins_and_morph_targets_of_every_kind(gl: Any, tmp_path: Path, options: dict[str, Any]) -> None:
    random = np.random.default_rng(7)
    check(gl, creature(random, **options).write(tmp_path / "a.gltf"), random.uniform(0, 4, 3))


def test_files_at_rest_are_baked_as_their_nodes_stand(gl: Any, tmp_path: Path) -> None:
    """A file without clips, or in a scene file without `animation`, has meshes that nothing moves any more."""
    file = creature(np.random.default_rng(3), targets=2)
    file.json["meshes"][0]["weights"] = [0.5, -0.25]
    del file.json["animations"]
    path = file.write(tmp_path / "a.gltf")
    scene = load(path)
    (placed,) = scene.objects
    mesh = scene.meshes[placed.mesh]
    assert not scene.rigs
    assert placed.pose is None
    assert mesh.deform is None
    position, normal, _ = Reference(path).posed(0, 0, 0, 0.0)
    assert np.abs(mesh.positions - position).max() < 1e-5
    assert np.abs(mesh.normals - normal).max() < 1e-5
    assert animate.at(scene, 1.0) is scene


# Frames ----------------------------------------------------------------------------------------------------------------


def worm(folder: Path, rings: int = 9, sides: int = 8) -> Path:
    """A closed tube along y on three joints, which bends to and fro and has a bulge as a morph target."""
    file, y = File(), np.linspace(0, 2, rings)
    angle = np.arange(sides) * 2 * np.pi / sides
    ring = np.stack([np.cos(angle), np.zeros(sides), -np.sin(angle)], axis=1)
    points = (0.25 * ring + np.array([0, 1, 0]) * y[:, None, None]).reshape(-1, 3)
    points = np.vstack([points, [[0, 0, 0], [0, 2, 0]]])
    normals = np.vstack([np.tile(ring, (rings, 1)), [[0, -1, 0], [0, 1, 0]]])
    a = (np.arange(rings - 1)[:, None] * sides + np.arange(sides)).ravel()
    b = (np.arange(rings - 1)[:, None] * sides + (np.arange(sides) + 1) % sides).ravel()
    last, one, next_one = (rings - 1) * sides, np.arange(sides), (np.arange(sides) + 1) % sides
    faces = [
        np.stack([a, b, b + sides], axis=1),
        np.stack([a, b + sides, a + sides], axis=1),
        np.stack([next_one, one, np.full(sides, len(points) - 2)], axis=1),
        np.stack([last + one, last + next_one, np.full(sides, len(points) - 1)], axis=1),
    ]
    height = points[:, 1]
    low = np.minimum(height.astype(int), 1)
    share = height - low
    zeros = np.zeros(len(points))
    bulge = normals * np.exp(-8 * (height - 1) ** 2)[:, None] * [0.4, 0, 0.4]
    attributes = {
        "POSITION": file.array(points, "VEC3"),
        "NORMAL": file.array(normals, "VEC3"),
        "JOINTS_0": file.array(np.stack([low, low + 1, zeros, zeros], axis=1), "VEC4", "<u1"),
        "WEIGHTS_0": file.array(np.stack([1 - share, share, zeros, zeros], axis=1), "VEC4"),
    }
    indices = file.array(np.concatenate(faces).ravel(), "SCALAR", "<u2")
    targets = [{"POSITION": file.array(bulge, "VEC3")}]
    file.json["meshes"] = [{"primitives": [{"attributes": attributes, "indices": indices, "targets": targets}]}]
    inverses = np.tile(np.eye(4), (3, 1, 1))
    inverses[:, 1, 3] = [0, -1, -2]
    binds = file.array(inverses.swapaxes(1, 2).reshape(3, 16), "MAT4")
    file.json["skins"] = [{"joints": [1, 2, 3], "inverseBindMatrices": binds}]
    up = {"translation": [0, 1, 0]}
    file.json["nodes"] = [{"name": "worm", "mesh": 0, "skin": 0}, {"children": [2]}, {**up, "children": [3]}, up]
    file.json["scenes"], file.json["scene"] = [{"nodes": [0, 1]}], 0
    times = file.array([0, 0.3, 0.6], "SCALAR")
    turns = [[0, 0, np.sin(half), np.cos(half)] for half in (0.6, -0.6, 0.6)]
    samplers = [
        {"input": times, "output": file.array(turns, "VEC4")},
        {"input": times, "output": file.array([0, 1, 0], "SCALAR")},
    ]
    targets_of = [{"node": 1, "path": "rotation"}, {"node": 2, "path": "rotation"}, {"node": 0, "path": "weights"}]
    channels = [{"sampler": at, "target": target} for at, target in zip((0, 0, 1), targets_of, strict=True)]
    file.json["animations"] = [{"name": "wag", "samplers": samplers, "channels": channels}]
    return file.write(folder / "worm.gltf")


SIZE = (96, 64)
STAGE = """scene: 1
objects:
  wall: {shape: box, size: [40, 40, 1], at: [0, 0, -3], material: grey}
  worm: {file: worm.gltf, animation: {}, at: [0, -1, 0], material: white}
materials:
  grey: {base_color: [0.1, 0.12, 0.1]}
  white: {base_color: [1, 0.9, 0.8]}
lights: {sun: {type: directional, direction: [-1, -2, -1]}}
cameras: {main: {eye: [0, 0, 5], target: [0, 0, 0], fov_y_degrees: 40, near: 0.1, far: 60}}
"""


@pytest.fixture
def stage(tmp_path: Path) -> Path:
    worm(tmp_path)
    path = tmp_path / "stage.yaml"
    path.write_text(STAGE)
    return path


def test_velocity_is_the_difference_of_projected_positions(gl: rg.Session, stage: Path) -> None:
    """The point of the surface that each pixel shows, found among the posed triangles, and where it was a frame ago."""
    text = """rendergraph: 1
nodes: {gbuffer: {type: gbuffer, params: {precision: full}}}
outputs: {velocity: gbuffer.velocity, depth: gbuffer.depth}
"""
    (stage.parent / "p.yaml").write_text(text)
    pipeline = rg.load(stage.parent / "p.yaml", scene=stage, size=SIZE)
    *_, frame = gl.frames(pipeline, frames=range(1, 6))
    reference, scene = Reference(stage.parent / "worm.gltf"), pipeline.link().scene
    now, then = (reference.posed(0, 0, 0, number / 30)[0] + [0, -1, 0] for number in (4, 3))
    triangles = reference.array(1 + 3)[:, 0].astype(int).reshape(-1, 3)
    view = view_matrices(scene.cameras["main"], SIZE)
    width, height = SIZE
    depth = frame.arrays["depth"][..., 0].astype(float)
    y, x = np.nonzero(depth)
    place = np.stack([(x + 0.5) / width, (height - y - 0.5) / height], axis=1) * 2 - 1
    ndc = np.column_stack([place, 1 - 2 * depth[y, x], np.ones(len(x))])
    world = ndc @ np.linalg.inv(view.projection @ view.view).T
    world = world[:, :3] / world[:, 3:]
    body = world[:, 2] > -2
    assert body.sum() > 300
    assert np.abs(frame["velocity"][y, x][~body]).max() == 0
    a, b, c = now[triangles].swapaxes(0, 1)
    basis = np.stack([b - a, c - a, np.cross(b - a, c - a)], axis=2)
    local = np.einsum("tij,ptj->pti", np.linalg.inv(basis), world[body][:, None] - a)
    inside = np.maximum(np.maximum(-local[..., 0], -local[..., 1]), local[..., 0] + local[..., 1] - 1)
    off = np.maximum(inside, 0) + np.abs(local[..., 2])
    best = off.argmin(axis=1)
    weights = np.take_along_axis(local, best[:, None, None], axis=1)[:, 0, :2]
    before = then[triangles[best]]
    points = before[:, 0] + weights[:, :1] * (before[:, 1] - before[:, 0])
    points += weights[:, 1:] * (before[:, 2] - before[:, 0])
    clip = np.column_stack([points, np.ones(len(points))]) @ (view.projection @ view.view).T
    expected = (place[body] - clip[:, :2] / clip[:, 3:]) / 2
    found = frame["velocity"][y, x][body][:, :2]
    assert np.abs(expected * SIZE).max() > 2  # pixels
    assert np.abs((found - expected) * SIZE).max() < 0.02


@pytest.mark.nightly(keep=1)
@pytest.mark.parametrize("name", ["shadow-cascaded", "traced-shadows", "taa", "shadow-volumes-zfail"])
def test_reused_steps_and_culling_see_the_pose(gl: rg.Session, stage: Path, name: str) -> None:
    """Frames are those in which every step runs and every object is drawn, in whatever order they come."""
    pipeline = rg.load(name, scene=stage, size=(64, 40))
    frames = [frame["image"] for frame in gl.frames(pipeline, frames=range(1, 6))]
    whole = [frame["image"] for frame in gl.frames(pipeline, frames=range(1, 6), reuse=False, cull=False)]
    np.testing.assert_array_equal(frames, whole)
    assert (frames[0] != frames[4]).mean() > 0.02
    np.testing.assert_array_equal(gl.render(pipeline, frames=range(3, 4))["image"], frames[2])


@pytest.mark.parametrize(
    ("name", "sets"),
    [
        ("shadow-volumes-zfail", ["shadows.silhouettes=cpu"]),
        ("shadow-volumes-zfail", ["shadows.silhouettes=gpu"]),
        ("traced-shadows", []),
    ],
)
def test_a_pose_draws_what_its_baked_mesh_draws(gl: rg.Session, stage: Path, name: str, sets: list[str]) -> None:
    """A file that stands still in the pose of a moment has the same picture as the clip at that moment."""
    pipeline = rg.load(name, scene=stage, size=(64, 40), sets=sets)
    found = gl.render(pipeline, frames=range(5, 6))["image"].astype(int)
    scene = pipeline.link().scene
    file = json.loads((stage.parent / "worm.gltf").read_text())
    mesh = animate.baked(animate.at(scene, 4 / 30)).meshes[scene.objects[-1].mesh]
    made = File()
    attributes = {"POSITION": made.array(mesh.positions, "VEC3"), "NORMAL": made.array(mesh.normals, "VEC3")}
    indices = made.array(mesh.indices, "SCALAR", "<u4")
    made.json["meshes"] = [{"primitives": [{"attributes": attributes, "indices": indices}]}]
    made.json["nodes"], made.json["scenes"] = [{"name": file["nodes"][0]["name"], "mesh": 0}], [{"nodes": [0]}]
    made.write(stage.parent / "worm.gltf")
    stage.write_text(STAGE.replace("animation: {}, ", ""))
    expected = gl.render(rg.load(name, scene=stage, size=(64, 40), sets=sets))["image"].astype(int)
    assert (np.abs(found - expected).max(axis=-1) > 2).mean() < 0.002


CORNER = """
#include <previous_scene.glsl>
out vec4 color;
out vec4 before;
void main() {
    color = vec4(scene_position(1, 0, vec2(0.0)), 1.0);
    before = vec4(scene_previous_position(1, 0, vec2(0.0)), 1.0);
}
"""
KEPT_CORNER = CORNER.replace("#include <previous_scene.glsl>", "#include <scene.glsl>").replace("out vec4 before;", "")


class Corner(Node):
    """A corner of the worm's first triangle, now and a frame ago."""

    scene = Input(SceneData, doc="Scene.")
    color = Output(Anything, format="rgba32f", size=(1, 1), doc="World-space position.")
    before = Output(Anything, format="rgba32f", size=(1, 1), doc="The same in the frame before.")
    kept = Output(Anything, format="rgba32f", size=(1, 1), kept=True, doc="The position, kept while nothing moves.")

    def record(self, steps: Steps) -> None:
        steps.fullscreen("corner.frag", scene=self.scene, out={"color": self.color, "before": self.before})
        if steps.used(self.kept):
            steps.fullscreen("kept.frag", scene=self.scene, out={"color": self.kept})


@pytest.mark.parametrize("speed", [1, 0])
def test_steps_and_kept_values_run_again_where_the_pose_has_changed(bench: Any, stage: Path, speed: int) -> None:
    text = "nodes: {a: {type: corner}}\noutputs: {image: a.color, before: a.before, kept: a.kept}\n"
    kept = KEPT_CORNER[: KEPT_CORNER.index("    before")] + "}\n"
    scene = STAGE.removeprefix("scene: 1\n").replace("animation: {}", f"animation: {{speed: {speed}, start: 0.1}}")
    pipeline = bench.pipeline(text, Corner, shaders={"corner.frag": CORNER, "kept.frag": kept}, scene=scene)
    options = {"frames": range(1, 5), "reuse": True, "timed": True, "warm_up": False}
    frames = list(bench.session.frames(pipeline, outputs=["image", "before", "kept"], **options))
    assert [frame.times[-1].ran for frame in frames] == ([2, 2, 2, 2] if speed else [2, 0, 0, 0])
    now, before, kept_now = (np.array([f[name][0, 0, :3] for f in frames]) for name in ("image", "before", "kept"))
    np.testing.assert_array_equal(kept_now, now)
    np.testing.assert_array_equal(before, [now[0], *now[:-1]])
    reference = Reference(stage.parent / "worm.gltf")
    packed = pack.pack(pipeline.link().scene)
    first = packed.vertex_orders[1][packed.indices[packed.meshes[1]["first_index"]]]
    for number, found in enumerate(now):
        position = reference.posed(0, 0, 0, 0.1 + speed * number / 30)[0][first] + [0, -1, 0]
        assert np.abs(found - position).max() < 2e-5


def light(picture: Any) -> Any:
    c = picture[..., :3] / 255
    return np.where(c > 0.04045, ((c + 0.055) / 1.055) ** 2.4, c / 12.92)


def test_temporal_antialiasing_leaves_no_trail_behind_a_skin(gl: rg.Session, stage: Path) -> None:
    """Against 64 samples a pixel of the same moment: no trail where the worm was, and smoother edges than one sample."""

    def drawn(name: str, times: int) -> Any:
        pipeline = rg.load(name, scene=stage, size=(SIZE[0] * times, SIZE[1] * times)).set("light.shading", "unlit")
        return light(gl.render(pipeline, outputs=["image"], frames=range(7, 8))["image"])

    exact = drawn("deferred", 8).reshape(SIZE[1], 8, SIZE[0], 8, 3).mean(axis=(1, 3))
    hard, found = drawn("deferred", 1), drawn("taa", 1)
    body = exact[..., 0] > 0.15
    near = np.zeros_like(body)
    for y in range(-2, 3):
        for x in range(-2, 3):
            near |= np.roll(body, (y, x), axis=(0, 1))
    assert np.abs(found - exact)[~near].max() < 0.015
    edges = near & (np.abs(exact - hard).max(axis=-1) > 0.02)
    errors = [float(np.sqrt(((picture - exact)[edges] ** 2).mean())) for picture in (found, hard)]
    print(errors)
    assert errors[0] < 0.9 * errors[1]


# The scene file and the clips ------------------------------------------------------------------------------------------

CLIPS = """scene: 1
objects:
  first: {file: a.gltf, animation: {}}
  same: {file: a.gltf, animation: {clip: wiggle}, at: [4, 0, 0], repeat: {line: 2}}
  late: {file: a.gltf, animation: {clip: wiggle, start: 0.25, speed: -2}, at: [0, 4, 0]}
  still: {file: a.gltf, at: [0, 0, 4]}
keyframes: {objects.late.at: {0: [0, 4, 0], 1: [0, 5, 0]}}
"""


def test_objects_play_clips_of_their_own(tmp_path: Path) -> None:
    file = creature(np.random.default_rng(3))
    file.write(tmp_path / "a.gltf")
    (tmp_path / "s.yaml").write_text(CLIPS)
    scene = load(tmp_path / "s.yaml")
    now = {placed.name: placed for placed in animate.at(scene, 0.4).objects}
    assert len({placed.mesh for placed in now.values()}) == 3
    assert now["first/body"].mesh == now["same.0/body"].mesh  # the first clip is the default
    assert now["same.0/body"].mesh == now["same.1/body"].mesh
    assert now["same.0/body"].pose is now["same.1/body"].pose
    assert now["still/body"] in scene.objects
    assert now["late/body"].transform[1, 3] == pytest.approx(4.4)
    alone = load(tmp_path / "a.gltf")
    for name, time in (("first/body", 0.4), ("same.1/body", 0.4), ("late/body", 0.25 - 2 * 0.4)):
        length = alone.rigs[0].length
        expected = animate.at(alone, time % length).objects[0].pose
        np.testing.assert_allclose(now[name].pose.joints, expected.joints, atol=1e-9)  # type: ignore[union-attr]


def test_an_unknown_clip_names_those_that_there_are(tmp_path: Path) -> None:
    creature(np.random.default_rng(3)).write(tmp_path / "a.gltf")
    (tmp_path / "s.yaml").write_text("scene: 1\nobjects:\n  one: {file: a.gltf, animation: {clip: wigle}}\n")
    with pytest.raises(InputError, match="RG322 object 'one': its file has no clip 'wigle'; did you mean 'wiggle'"):
        load(tmp_path / "s.yaml")


def test_lights_and_cameras_go_with_their_nodes(tmp_path: Path) -> None:
    file = creature(np.random.default_rng(3))
    file.json["extensionsUsed"] = ["KHR_lights_punctual"]
    file.json["extensions"] = {"KHR_lights_punctual": {"lights": [{"type": "point"}]}}
    file.json["nodes"][4]["extensions"] = {"KHR_lights_punctual": {"light": 0}}
    file.json["cameras"] = [{"type": "perspective", "perspective": {"yfov": 1, "znear": 0.1}}]
    file.json["nodes"][5]["camera"] = 0
    path = file.write(tmp_path / "a.gltf")
    (tmp_path / "s.yaml").write_text("scene: 1\nobjects: {it: {file: a.gltf, animation: {}, at: [1, 2, 3]}}\n")
    worlds, _ = Reference(path).pose(0, 0.7)
    for scene, offset in ((load(path), 0), (load(tmp_path / "s.yaml"), np.array([1, 2, 3]))):
        now = animate.at(scene, 0.7)
        np.testing.assert_allclose(now.lights[0].position, worlds[4][:3, 3] + offset, atol=1e-6)
        (camera,) = now.cameras.values()
        np.testing.assert_allclose(camera.transform[:3, 3], worlds[5][:3, 3] + offset, atol=1e-6)


def test_what_stands_still_stays_the_same_object(tmp_path: Path) -> None:
    """Frames that follow each other then know that it has not moved."""
    file = creature(np.random.default_rng(3))
    file.json["nodes"].append({"mesh": 0, "name": "rock"})
    file.json["scenes"][0]["nodes"].append(len(file.json["nodes"]) - 1)
    scene = load(file.write(tmp_path / "a.gltf"))
    rock = next(placed for placed in scene.objects if placed.name == "rock")
    assert rock.pose is None
    assert any(placed is rock for placed in animate.at(scene, 0.4).objects)
    assert scene.meshes[rock.mesh].deform is None


# Broken files ----------------------------------------------------------------------------------------------------------


def _without_view(file: File, number: int, **changes: Any) -> Any:
    """Make an accessor one of zeros."""
    file.json["accessors"][number].pop("bufferView")
    file.json["accessors"][number] |= changes


def _attribute(file: File, name: str) -> int:
    return int(file.json["meshes"][0]["primitives"][0]["attributes"][name])


def _nan(file: File) -> None:
    number = file.json["animations"][0]["samplers"][0]["input"]
    at = file.json["bufferViews"][file.json["accessors"][number]["bufferView"]]["byteOffset"]
    file.data = file.data[:at] + np.float32(np.nan).tobytes() + file.data[at + 4 :]


BROKEN: dict[str, Callable[[File], Any]] = {
    r"RG304 meshes\[0\].primitives\[0\]: joint 4 is out of range; skins\[0\] has 3 joints": lambda f: f.json["skins"][
        0
    ]["joints"].__delitem__(slice(3, None)),
    r"RG304 meshes\[0\].primitives\[0\].WEIGHTS_0: the weights of vertex 0 sum to 0": lambda f: _without_view(
        f, _attribute(f, "WEIGHTS_0")
    ),
    r"RG304 meshes\[0\].primitives\[0\] has no WEIGHTS_0, which belongs to": lambda f: f.json["meshes"][0][
        "primitives"
    ][0]["attributes"].pop("WEIGHTS_0"),
    r"RG309 nodes\[3\] has two parents": lambda f: f.json["nodes"][5].setdefault("children", []).append(3),
    r"RG309 nodes\[\d\] is its own ancestor": lambda f: f.json["nodes"][0].setdefault("children", []).append(2),
    r"RG304 skins\[0\].inverseBindMatrices are 3, but the skin has 5 joints": lambda f: f.json["accessors"][
        f.json["skins"][0]["inverseBindMatrices"]
    ].update(count=3),
    r"RG304 skins\[0\].joints is 99, but there are 6 nodes": lambda f: f.json["skins"][0]["joints"].append(99),
    r"RG304 nodes\[0\].skin is 7, but there are 1 skins": lambda f: f.json["nodes"][0].update(skin=7),
    r"RG304 animations\[0\].samplers\[0\].input: key times do not increase": lambda f: _without_view(
        f, f.json["animations"][0]["samplers"][0]["input"]
    ),
    r"RG306 accessors\[\d+\] contains NaN": _nan,
    r"RG304 animations\[0\].channels\[1\]: nodes\[1\].translation is animated twice": lambda f: f.json["animations"][0][
        "channels"
    ][1]["target"].update(path="translation"),
    r"RG304 animations\[0\].channels\[0\].target.node is 77, but there are 6 nodes": lambda f: f.json["animations"][0][
        "channels"
    ][0]["target"].update(node=77),
    r"RG304 animations\[0\].channels\[0\].sampler is 88, but there are 16 samplers": lambda f: f.json["animations"][0][
        "channels"
    ][0].update(sampler=88),
    r"RG304 animations\[0\].samplers\[0\].output has 3 values, but animations\[0\].channels\[0\] needs 4": lambda f: (
        f.json["accessors"][f.json["animations"][0]["samplers"][0]["output"]].update(count=3)
    ),
    r"RG304 animations\[0\].samplers\[1\].output has a quaternion of length zero": lambda f: _without_view(
        f, f.json["animations"][0]["samplers"][1]["output"]
    ),
    r"RG304 animations\[0\].channels\[0\]: nodes\[1\] has a 'matrix', so its translation cannot": lambda f: (
        f.json["nodes"][1].pop("translation"),
        f.json["nodes"][1].update(matrix=np.eye(4).ravel().tolist()),
    ),
    r"RG304 meshes\[0\].weights are 3, but the mesh has 2 morph targets": lambda f: f.json["meshes"][0].update(
        weights=[0, 0, 0]
    ),
    r"RG304 meshes\[0\].primitives\[0\].targets\[0\].POSITION has 5 values, but the primitive 12": lambda f: (
        _without_view(f, f.json["meshes"][0]["primitives"][0]["targets"][1]["NORMAL"], count=5),
        f.json["meshes"][0]["primitives"][0]["targets"][0].update(
            POSITION=f.json["meshes"][0]["primitives"][0]["targets"][1].pop("NORMAL")
        ),
    ),
}


@pytest.mark.parametrize("message", BROKEN)
def test_what_is_broken_is_named_with_its_place(tmp_path: Path, message: str) -> None:
    file = creature(np.random.default_rng(1), targets=2)
    BROKEN[message](file)
    with pytest.raises(InputError, match=message):
        load(file.write(tmp_path / "a.gltf"))


def test_a_clip_without_length_warns_and_holds_still(tmp_path: Path) -> None:
    file = creature(np.random.default_rng(1))
    (times,) = {sampler["input"] for sampler in file.json["animations"][0]["samplers"][:3]}
    file.json["animations"][0]["channels"] = file.json["animations"][0]["channels"][:1]
    _without_view(file, times, count=1)
    file.json["accessors"][file.json["animations"][0]["samplers"][0]["output"]]["count"] = 1
    scene = load(file.write(tmp_path / "a.gltf"))
    assert "animations[0] has no length: its clip 'wiggle' holds still" in str(scene.warnings[0])
    now, later = (animate.at(scene, time).objects[0].pose for time in (0.0, 5.0))
    assert now is not None
    assert later is not None
    assert now.values == later.values
    assert not animate.moves(scene)


def test_the_shipped_salamander_is_what_its_program_computes(tmp_path: Path) -> None:
    """Every number of the file, up to rounding on other machines; its feet stand on the ground all the time."""
    scenes = folder("rendergraph.pipelines") / "scenes"
    made = runpy.run_path(str(scenes / "salamander.py"))
    made["write"](tmp_path / "salamander.glb")
    (shipped, again) = (load(path / "salamander.glb") for path in (scenes, tmp_path))
    for name in ("positions", "normals", "colors", "indices"):
        found, expected = (getattr(scene.meshes[0], name) for scene in (again, shipped))
        np.testing.assert_allclose(found, expected, atol=1e-5)
    for time in np.linspace(0, 1.2, 13):
        poses = [animate.at(scene, float(time)).objects[0].pose for scene in (again, shipped)]
        vertices = poses[0].vertices()["positions"]  # type: ignore[union-attr]
        np.testing.assert_allclose(vertices, poses[1].vertices()["positions"], atol=1e-5)  # type: ignore[union-attr]
        feet = [vertices[(vertices[:, 0] * side > 0.1)][:, 1].min() for side in (-1, 1)]
        assert -0.012 < min(feet) < 0.012
    mesh = shipped.meshes[0]
    a, b, c = mesh.positions.astype(float)[mesh.indices].swapaxes(0, 1)
    assert np.einsum("ni,ni->", a, np.cross(b, c)) > 0  # its faces look outwards


def test_the_shipped_orrery_is_what_its_program_computes(tmp_path: Path) -> None:
    """Up to rounding; and its clip is closed: after it every planet is where it was."""
    scenes = folder("rendergraph.pipelines") / "scenes"
    runpy.run_path(str(scenes / "orrery.py"))["write"](tmp_path / "orrery.glb")
    shipped, again = (animate.play(load(path / "orrery.glb")) for path in (scenes, tmp_path))
    for mesh, other in zip(shipped.meshes, again.meshes, strict=True):
        for name in ("positions", "normals", "indices"):
            np.testing.assert_allclose(getattr(mesh, name), getattr(other, name), atol=1e-6)
        a, b, c = mesh.positions.astype(float)[mesh.indices].swapaxes(0, 1)
        assert np.einsum("ni,ni->", a - mesh.positions.mean(axis=0), np.cross(b - a, c - a)) > 0  # faces look outwards
    assert shipped.rigs[0].length == 8
    moments = [animate.at(scene, time).objects for scene, time in ((shipped, 0), (shipped, 8 - 1e-9), (again, 0))]
    for one, last, computed in zip(*moments, strict=True):
        np.testing.assert_allclose(last.transform, one.transform, atol=1e-6)
        np.testing.assert_allclose(computed.transform, one.transform, atol=1e-6)
