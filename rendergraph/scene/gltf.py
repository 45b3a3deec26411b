"""glTF 2.0 files (.gltf and .glb) as scenes.

Everything in a file is checked, whether its scene uses it or not. Extensions: KHR_lights_punctual, KHR_materials_unlit,
_emissive_strength, _ior, _specular and _anisotropy, KHR_texture_transform, KHR_mesh_quantization and
EXT_mesh_gpu_instancing are read; another one that the file requires is an error, others are left out with a warning.
Skins, morph targets and animations are left out with a warning: the mesh is drawn in its rest pose.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from rendergraph.document import shown
from rendergraph.projection import unit
from rendergraph.scene.files import Reading, UniqueNames
from rendergraph.scene.geometry import placement, quaternion_matrix, rigid, vec3
from rendergraph.scene.gltf_buffers import Buffers, split_glb
from rendergraph.scene.gltf_json import JsonObject, parse
from rendergraph.scene.gltf_materials import Materials
from rendergraph.scene.gltf_meshes import Primitives
from rendergraph.scene.model import FARTHEST, Camera, Light, Material, Matrix, Mesh, Object, Scene, Vec3

_READ = frozenset(
    {
        "KHR_lights_punctual",
        "KHR_materials_unlit",
        "KHR_materials_emissive_strength",
        "KHR_materials_ior",
        "KHR_materials_specular",
        "KHR_materials_anisotropy",
        "KHR_texture_transform",
        "KHR_mesh_quantization",
        "EXT_mesh_gpu_instancing",
    }
)


def read_gltf(path: Path, reading: Reading) -> Scene:
    """The default scene of a .gltf or .glb file.

    Raises:
        InputError: the file, or one it names, is missing, malformed, out of range or beyond a limit.
    """
    data = reading.read(path, "scene file")
    binary: bytes | None = None
    if data[:4] == b"glTF" or path.suffix.lower() == ".glb":
        data, binary = split_glb(data, reading)
    top = parse(data, lambda text: reading.error("RG304", text))
    return _Reader(top, binary, path, reading).scene()


_IDENTITY: Matrix = np.eye(4)


@dataclass(frozen=True)
class _Node:
    part: JsonObject
    name: str
    local: Matrix
    children: list[int]
    mesh: int | None
    camera: int | None
    light: int | None
    instances: list[Matrix] | None


class _Reader:
    """Reads one file's parts in the order they depend on each other."""

    def __init__(self, top: JsonObject, binary: bytes | None, path: Path, reading: Reading) -> None:
        self._top, self._path, self._reading = top, path, reading
        asset = top.part("asset")
        if asset is None:
            raise top.wrong("'asset' is missing; is this glTF 2.0?")
        version = asset.text("minVersion") or asset.text("version")
        if not version.startswith("2."):
            raise reading.error("RG303", f"is glTF version '{shown(version)}'; only 2.0 is read")
        used = self._extensions()
        self._buffers = Buffers(top, binary, reading)
        self._materials = Materials(top, self._buffers, reading)
        self._primitives = Primitives(self._buffers, reading, "KHR_mesh_quantization" in used)
        self._meshes = [self._mesh(part, index) for index, part in enumerate(top.parts("meshes"))]
        self._cameras = [self._camera(part) for part in top.parts("cameras")]
        holder = top.extension("KHR_lights_punctual")
        self._lights = [self._light(part) for part in holder.parts("lights")] if holder else []
        names, nodes = UniqueNames(), top.parts("nodes")
        if len(nodes) > reading.limits.objects:
            raise reading.over(f"has {len(nodes):,} nodes", "objects")
        self._node_count, self._skin_count = len(nodes), len(top.parts("skins"))
        self._nodes = [self._node(part, index, names) for index, part in enumerate(nodes)]

    def _extensions(self) -> set[str]:
        required = self._words("extensionsRequired")
        for name in required:
            if name not in _READ:
                raise self._reading.error("RG308", f"requires the extension '{shown(name)}', which is not read")
        used = self._words("extensionsUsed")
        for name in used:
            if name not in _READ:
                self._reading.warn("RG333", f"extension {name}", f"the extension '{shown(name)}' is left out")
        for key, what in (("animations", "animations"), ("skins", "skins")):
            if self._top.parts(key):
                self._reading.warn("RG333", what, f"{what} are left out; the rest pose is drawn")
        return {*required, *used}

    def _words(self, key: str) -> list[str]:
        found = self._top.value.get(key, [])
        if not isinstance(found, list) or not all(isinstance(word, str) for word in found):
            raise self._top.wrong(f"'{key}' must be a list of names")
        return found

    # Parts ------------------------------------------------------------------------------------------------------------

    def _mesh(self, part: JsonObject, number: int) -> list[tuple[int, int]]:
        """Mesh and material index of each triangle primitive; material -1 is the default one."""
        name = part.text("name") or f"mesh_{number}"
        result = []
        primitives = part.parts("primitives")
        if not primitives:
            raise part.wrong("'primitives' is missing or empty")
        for primitive in primitives:
            material = primitive.index("material", len(self._materials.materials), "materials")
            for target in primitive.parts("targets"):
                for key in target.value:
                    target.index(key, len(self._buffers.accessors), "accessors")
                self._reading.warn("RG333", "morph targets", "morph targets are left out; the rest pose is drawn")
            mesh = self._primitives.mesh(primitive, name)
            if mesh is not None:
                result.append((mesh, -1 if material is None else material))
        return result

    def _camera(self, part: JsonObject) -> Camera:
        kind = part.choice("type", "", ("perspective", "orthographic"))
        facts = part.part(kind)
        if facts is None:
            raise part.wrong(f"'{kind}' is missing")
        near = facts.number("znear")
        name = part.text("name")
        if kind == "perspective":
            far, fov = facts.number("zfar", math.inf) if facts.has("zfar") else math.inf, facts.number("yfov")
            if not 0 < near < far or not 0 < fov < math.pi:
                raise facts.wrong("needs 0 < znear < zfar and 0 < yfov < pi")
            return Camera(name, np.eye(4), "perspective", fov_y=fov, near=near, far=far)
        far, height = facts.number("zfar"), 2 * facts.number("ymag")
        if not 0 <= near < far or height == 0:
            raise facts.wrong("needs 0 <= znear < zfar and ymag other than 0")
        return Camera(name, np.eye(4), "orthographic", height=abs(height), near=near, far=far)

    def _light(self, part: JsonObject) -> Light:
        kind = part.choice("type", "", ("directional", "point", "spot"))
        intensity, reach = part.number("intensity", 1.0), part.number("range") if part.has("range") else None
        if intensity < 0 or (reach is not None and reach <= 0):
            raise part.wrong("needs intensity >= 0 and range > 0")
        inner, outer = 0.0, math.pi / 4
        if kind == "spot":
            cone = part.part("spot") or JsonObject({}, part.path, part.fail)
            inner, outer = cone.number("innerConeAngle", 0.0), cone.number("outerConeAngle", math.pi / 4)
            if not 0 <= inner < outer <= math.pi / 2 + 1e-6:
                raise cone.wrong("needs 0 <= innerConeAngle < outerConeAngle <= pi/2")
        r, g, b = part.numbers("color", 3, (1.0, 1.0, 1.0))
        return Light(
            part.text("name"),
            "spot" if kind == "spot" else "point" if kind == "point" else "directional",
            color=(max(0.0, r), max(0.0, g), max(0.0, b)),
            intensity=intensity,
            range=reach,
            inner=inner,
            outer=outer,
        )

    def _node(self, part: JsonObject, number: int, names: UniqueNames) -> _Node:
        camera = part.index("camera", len(self._cameras), "cameras")
        mesh = part.index("mesh", len(self._meshes), "meshes")
        if part.has("skin"):
            part.index("skin", self._skin_count, "skins")
        light = None
        if (holder := part.extension("KHR_lights_punctual")) is not None:
            light = holder.index("light", len(self._lights), "lights")
        given = part.text("name")
        if not given and light is not None:
            given = self._lights[light].name
        if not given and camera is not None:
            given = self._cameras[camera].name
        children = part.indices("children", self._node_count, "nodes")
        return _Node(
            part,
            names.unique(given, f"node_{number}"),
            self._local(part),
            children,
            mesh,
            camera,
            light,
            self._instances(part),
        )

    def _local(self, part: JsonObject) -> Matrix:
        if part.has("matrix"):
            if part.has("translation") or part.has("rotation") or part.has("scale"):
                raise part.wrong("has both 'matrix' and translation, rotation or scale")
            matrix = np.array(part.numbers("matrix", 16)).reshape(4, 4).T.copy()
            if not np.allclose(matrix[3], (0, 0, 0, 1), atol=1e-5):
                raise part.wrong("'matrix' is not affine: its last row is not 0 0 0 1")
            matrix[3] = (0, 0, 0, 1)
            return matrix
        if not (part.has("translation") or part.has("rotation") or part.has("scale")):
            return _IDENTITY
        x, y, z, w = part.numbers("rotation", 4, (0.0, 0.0, 0.0, 1.0))
        try:
            rotation = quaternion_matrix(x, y, z, w)
        except ValueError:
            raise part.wrong("'rotation' is a quaternion of length zero") from None
        return placement(part.numbers("translation", 3, (0, 0, 0)), rotation, part.numbers("scale", 3, (1, 1, 1)))

    def _instances(self, part: JsonObject) -> list[Matrix] | None:
        holder = part.extension("EXT_mesh_gpu_instancing")
        attributes = holder.part("attributes") if holder is not None else None
        if attributes is None:
            return None
        arrays = {}
        for key in attributes.value:
            index = attributes.index(key, len(self._buffers.accessors), "accessors")
            assert index is not None  # the key stands there
            if key in ("TRANSLATION", "ROTATION", "SCALE"):
                types = ("VEC4",) if key == "ROTATION" else ("VEC3",)
                self._buffers.accessors[index].need(attributes, key, types, (5126, 5120, 5122), normalized=True)
                arrays[key] = index
        counts = {self._buffers.accessors[index].count for index in arrays.values()}
        if len(counts) > 1:
            raise attributes.wrong("its attributes have different counts")
        count = counts.pop() if counts else 0
        if count > self._reading.limits.objects:
            raise self._reading.over(f"{part.path} has {count:,} instances", "objects")
        values = {key: self._buffers.floats(index).astype(np.float64) for key, index in arrays.items()}
        result = []
        for row in range(count):
            at = values["TRANSLATION"][row] if "TRANSLATION" in values else (0.0, 0.0, 0.0)
            x, y, z, w = values["ROTATION"][row] if "ROTATION" in values else (0.0, 0.0, 0.0, 1.0)
            scale = values["SCALE"][row] if "SCALE" in values else (1.0, 1.0, 1.0)
            try:
                result.append(placement(at, quaternion_matrix(x, y, z, w), scale))
            except ValueError:
                raise attributes.wrong(f"ROTATION {row} is a quaternion of length zero") from None
        return result

    # The scene --------------------------------------------------------------------------------------------------------

    def scene(self) -> Scene:
        """The default scene with world transforms."""
        roots = self._roots()
        count = sum(self._parts_of(node) for node in self._nodes)
        if count > self._reading.limits.objects:
            raise self._reading.over(f"its nodes place {count:,} objects", "objects")
        objects: list[Object] = []
        lights: list[Light] = []
        cameras: dict[str, Camera] = {}
        default = -1
        names = UniqueNames()
        materials: list[Material] = list(self._materials.materials)
        stack = [(index, np.eye(4)) for index in reversed(roots)]
        while stack:
            index, above = stack.pop()
            node = self._nodes[index]
            world = above
            if node.local is not _IDENTITY:
                with np.errstate(over="ignore", invalid="ignore"):
                    world = above @ node.local
                    near = (np.abs(world) <= FARTHEST).all()
                if not near:
                    text = f"{node.part.path}: its place in the world is not finite, or beyond {FARTHEST:g} m"
                    raise self._reading.error("RG306", text)
            stack += [(child, world) for child in reversed(node.children)]
            if node.mesh is not None:
                default = self._place(node, world, objects, names, materials, default)
            if node.light is not None:
                lights.append(_placed_light(self._lights[node.light], node.name, world))
            if node.camera is not None:
                cameras[node.name] = _placed_camera(self._cameras[node.camera], node.name, world)
        meshes: tuple[Mesh, ...] = tuple(self._primitives.meshes)
        return Scene(
            self._path.stem,
            self._path,
            tuple(objects),
            meshes,
            tuple(materials),
            tuple(lights),
            cameras,
            warnings=self._reading.warnings,
        )

    def _parts_of(self, node: _Node) -> int:
        """How many objects a node becomes."""
        if node.mesh is None:
            return 0
        return len(self._meshes[node.mesh]) * (1 if node.instances is None else len(node.instances))

    def _place(
        self,
        node: _Node,
        world: Matrix,
        objects: list[Object],
        names: UniqueNames,
        materials: list[Material],
        default: int,
    ) -> int:
        assert node.mesh is not None  # the caller asked
        primitives = self._meshes[node.mesh]
        places = [world] if node.instances is None else [world @ instance for instance in node.instances]
        for number, place in enumerate(places):
            instance = node.name if node.instances is None else f"{node.name}[{number}]"
            for k, (mesh, material) in enumerate(primitives):
                if material < 0:
                    if default < 0:
                        default = len(materials)
                        materials.append(self._materials.default)
                    material = default
                name = names.unique(instance if k == 0 else f"{instance}#{k}", "object")
                self._reading.say_unmapped(name, materials[material], self._primitives.meshes[mesh])
                objects.append(Object(name, mesh, material, place, not node.name.endswith("NS"), node=node.name))
        return default

    def _roots(self) -> list[int]:
        parent: dict[int, int] = {}
        for index, node in enumerate(self._nodes):
            for child in node.children:
                if child in parent:
                    raise self._reading.error(
                        "RG309", f"nodes[{child}] has two parents, nodes[{parent[child]}] and nodes[{index}]"
                    )
                parent[child] = index
        self._no_cycles(parent)
        scenes = [part.indices("nodes", len(self._nodes), "nodes") for part in self._top.parts("scenes")]
        for index, scene in enumerate(scenes):
            for root in scene:
                if root in parent:
                    raise self._reading.error("RG309", f"scenes[{index}] names nodes[{root}], which has a parent")
            if len(set(scene)) != len(scene):
                raise self._reading.error("RG309", f"scenes[{index}] names a node twice")
        chosen = self._top.index("scene", len(scenes), "scenes")
        if scenes:
            return scenes[chosen or 0]
        return [index for index in range(len(self._nodes)) if index not in parent]

    def _no_cycles(self, parent: dict[int, int]) -> None:
        """Every node must lead up to a node without a parent."""
        safe: set[int] = set()
        for start in range(len(self._nodes)):
            trail: list[int] = []
            seen: set[int] = set()
            at = start
            while at not in safe:
                if at in seen:
                    raise self._reading.error("RG309", f"nodes[{at}] is its own ancestor")
                seen.add(at)
                trail.append(at)
                if at not in parent:
                    break
                at = parent[at]
            safe.update(trail)


def _placed_light(light: Light, name: str, world: Matrix) -> Light:
    direction = unit(-world[:3, 2])
    if not direction.any():
        direction = np.array([0.0, 0.0, -1.0])
    position: Vec3 = vec3(world[:3, 3])
    return Light(
        name, light.type, position, vec3(direction), light.color, light.intensity, light.range, light.inner, light.outer
    )


def _placed_camera(camera: Camera, name: str, world: Matrix) -> Camera:
    return Camera(name, rigid(world), camera.type, camera.fov_y, camera.height, camera.frustum, camera.near, camera.far)
