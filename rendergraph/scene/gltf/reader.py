"""Nodes, cameras and lights of a glTF file as a scene.

Skins, morph targets and animations are left out with a warning: the mesh is drawn in its rest pose. So are extensions
that are not read; one that the file requires is an error.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from msgspec import Struct
from msgspec.structs import replace

from rendergraph.document import shown
from rendergraph.errors import InputError
from rendergraph.projection import unit
from rendergraph.scene.geometry import placement, quaternion_matrix, rigid, vec3
from rendergraph.scene.gltf import schema
from rendergraph.scene.gltf.buffers import Buffers, split_glb
from rendergraph.scene.gltf.materials import Materials
from rendergraph.scene.gltf.primitives import Primitives
from rendergraph.scene.gltf.schema import Gltf, check_index
from rendergraph.scene.model import FARTHEST, Camera, Light, Material, Matrix, Object, Scene
from rendergraph.scene.reading import Reading, UniqueNames

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
_IDENTITY: Matrix = np.eye(4)


def read_gltf(path: Path, reading: Reading) -> Scene:
    data = reading.read(path, "scene file")
    binary: bytes | None = None
    if data[:4] == b"glTF" or path.suffix.lower() == ".glb":
        data, binary = split_glb(data, reading)
    return _Reader(schema.decode(data, reading), binary, path, reading).scene()


class _Node(Struct):
    """A node with a unique name; `instances` are transforms inside it."""

    json: schema.Node
    name: str
    local: Matrix
    instances: list[Matrix] | None


class _Reader:
    """Reads the parts of a file in the order of their dependencies."""

    def __init__(self, gltf: Gltf, binary: bytes | None, path: Path, reading: Reading) -> None:
        self._gltf, self._path, self._reading = gltf, path, reading
        version = gltf.asset.min_version or gltf.asset.version
        if not version.startswith("2."):
            raise reading.error("RG303", f"is glTF version '{shown(version)}'; only 2.0 is read")
        self._check_extensions()
        self._buffers = Buffers(gltf, binary, reading)
        self._materials = Materials(gltf, self._buffers, reading)
        quantized = "KHR_mesh_quantization" in (*gltf.extensions_required, *gltf.extensions_used)
        self._primitives = Primitives(self._buffers, reading, quantized)
        self._meshes = [self._mesh(mesh, number) for number, mesh in enumerate(gltf.meshes)]
        self._cameras = [self._camera(camera, f"cameras[{number}]") for number, camera in enumerate(gltf.cameras)]
        lights = gltf.extensions.punctual.lights
        self._lights = [self._light(light, f"lights[{number}]") for number, light in enumerate(lights)]
        if len(gltf.nodes) > reading.limits.objects:
            raise reading.over(f"has {len(gltf.nodes):,} nodes", "objects")
        names = UniqueNames()
        self._nodes = [self._node(node, number, names) for number, node in enumerate(gltf.nodes)]

    def _error(self, text: str) -> InputError:
        return self._reading.error("RG304", text)

    def _check_extensions(self) -> None:
        gltf = self._gltf
        for name in gltf.extensions_required:
            if name not in _READ:
                raise self._reading.error("RG308", f"requires the extension '{shown(name)}', which is not supported")
        for name in gltf.extensions_used:
            if name not in _READ:
                self._reading.warn("RG333", f"extension {name}", f"the extension '{shown(name)}' is left out")
        for what, entries in (("animations", gltf.animations), ("skins", gltf.skins)):
            if entries:
                self._reading.warn("RG333", what, f"{what} are left out; the rest pose is drawn")

    def _mesh(self, mesh: schema.Mesh, number: int) -> list[tuple[int, int]]:
        """Mesh and material index of each triangle primitive; material -1 is the default one."""
        result = []
        for k, primitive in enumerate(mesh.primitives):
            where = f"meshes[{number}].primitives[{k}]"
            check_index(self._reading, primitive.material, self._gltf.materials, f"{where}.material", "materials")
            for target in primitive.targets:
                for key, index in target.items():
                    self._buffers.accessor(index, f"{where}.targets.{key}")
                self._reading.warn("RG333", "morph targets", "morph targets are left out; the rest pose is drawn")
            index_of_mesh = self._primitives.mesh(primitive, mesh.name or f"mesh_{number}", where)
            if index_of_mesh is not None:
                result.append((index_of_mesh, primitive.material))
        return result

    def _camera(self, camera: schema.Camera, where: str) -> Camera:
        lens = camera.perspective if camera.type == "perspective" else camera.orthographic
        if isinstance(lens, schema.Perspective):
            if not 0 < lens.znear < lens.zfar or not 0 < lens.yfov < math.pi:
                raise self._error(f"{where} needs 0 < znear < zfar and 0 < yfov < pi")
            return Camera(camera.name, _IDENTITY, "perspective", fov_y=lens.yfov, near=lens.znear, far=lens.zfar)
        if lens is None:
            raise self._error(f"{where}: '{camera.type}' is missing")
        if not 0 <= lens.znear < lens.zfar or lens.ymag == 0:
            raise self._error(f"{where} needs 0 <= znear < zfar and ymag other than 0")
        height = abs(2 * lens.ymag)
        return Camera(camera.name, _IDENTITY, "orthographic", height=height, near=lens.znear, far=lens.zfar)

    def _light(self, light: schema.Light, where: str) -> Light:
        if light.intensity < 0 or (light.range is not None and light.range <= 0):
            raise self._error(f"{where} needs intensity >= 0 and range > 0")
        inner, outer = light.spot.inner_cone_angle, light.spot.outer_cone_angle
        if light.type == "spot" and not 0 <= inner < outer <= math.pi / 2 + 1e-6:
            raise self._error(f"{where} needs 0 <= innerConeAngle < outerConeAngle <= pi/2")
        r, g, b = (max(0.0, value) for value in light.color)
        result = Light(light.name, light.type, color=(r, g, b), intensity=light.intensity, range=light.range)
        return replace(result, inner=inner, outer=outer)

    def _node(self, node: schema.Node, number: int, names: UniqueNames) -> _Node:
        where, light = f"nodes[{number}]", node.extensions.light.light
        for key, index, items in (
            ("camera", node.camera, self._cameras),
            ("mesh", node.mesh, self._meshes),
            ("light", light, self._lights),
            ("skin", node.skin, self._gltf.skins),
        ):
            check_index(self._reading, index, items, f"{where}.{key}", "meshes" if key == "mesh" else f"{key}s")
        self._check_nodes(node.children, f"{where}.children")
        name = node.name
        if not name and light >= 0:
            name = self._lights[light].name
        if not name and node.camera >= 0:
            name = self._cameras[node.camera].name
        return _Node(node, names.unique(name, f"node_{number}"), self._local(node, where), self._instances(node, where))

    def _check_nodes(self, indices: Sequence[int], where: str) -> None:
        check_index(self._reading, max(indices, default=-1), self._gltf.nodes, where, "nodes")

    def _local(self, node: schema.Node, where: str) -> Matrix:
        is_placed = any(part is not None for part in (node.translation, node.rotation, node.scale))
        if node.matrix:
            if is_placed:
                raise self._error(f"{where} has both 'matrix' and translation, rotation or scale")
            matrix = np.array(node.matrix).reshape(4, 4).T.copy()
            if not np.allclose(matrix[3], (0, 0, 0, 1), atol=1e-5):
                raise self._error(f"{where}: 'matrix' is not affine: its last row is not 0 0 0 1")
            matrix[3] = (0, 0, 0, 1)
            return matrix
        if not is_placed:
            return _IDENTITY
        try:
            rotation = quaternion_matrix(*(node.rotation or (0.0, 0.0, 0.0, 1.0)))
        except ValueError:
            raise self._error(f"{where}: 'rotation' is a quaternion of length zero") from None
        return placement(node.translation or (0.0, 0.0, 0.0), rotation, node.scale or (1.0, 1.0, 1.0))

    def _instances(self, node: schema.Node, where: str) -> list[Matrix] | None:
        if node.extensions.instancing is None:
            return None
        attributes, arrays = node.extensions.instancing.attributes, {}
        for key, index in attributes.items():
            use = f"{where}.{key}"
            if key in ("TRANSLATION", "ROTATION", "SCALE"):
                types = ("VEC4",) if key == "ROTATION" else ("VEC3",)
                arrays[key] = self._buffers.check_use(index, use, types, (5126, 5120, 5122), normalized=True).count
            else:
                self._buffers.accessor(index, use)
        if len(set(arrays.values())) > 1:
            raise self._error(f"{where}: the attributes of its instances have different counts")
        count = next(iter(arrays.values()), 0)
        if count > self._reading.limits.objects:
            raise self._reading.over(f"{where} has {count:,} instances", "objects")
        values = {key: self._buffers.floats(attributes[key]).astype(np.float64) for key in arrays}
        translations = values.get("TRANSLATION", np.zeros((count, 3)))
        rotations = values.get("ROTATION", np.tile((0.0, 0.0, 0.0, 1.0), (count, 1)))
        scales = values.get("SCALE", np.ones((count, 3)))
        if (~rotations.any(axis=1)).any():
            raise self._error(f"{where}: ROTATION has a quaternion of length zero")
        rows = zip(translations, rotations, scales, strict=True)
        return [placement(at, quaternion_matrix(*turn), scale) for at, turn, scale in rows]

    def scene(self) -> Scene:
        roots = self._roots()
        count = sum(
            len(self._meshes[node.json.mesh]) * (1 if node.instances is None else len(node.instances))
            for node in self._nodes
            if node.json.mesh >= 0
        )
        if count > self._reading.limits.objects:
            raise self._reading.over(f"its nodes place {count:,} objects", "objects")
        objects: list[Object] = []
        lights: list[Light] = []
        cameras: dict[str, Camera] = {}
        materials = list(self._materials.materials)
        names = UniqueNames()
        stack = [(index, _IDENTITY) for index in reversed(roots)]
        while stack:
            index, parent = stack.pop()
            node = self._nodes[index]
            world = parent
            if node.local is not _IDENTITY:
                with np.errstate(over="ignore", invalid="ignore"):
                    world = parent @ node.local
                    is_near = (np.abs(world) <= FARTHEST).all()
                if not is_near:
                    text = f"nodes[{index}]: its world transform is not finite, or beyond {FARTHEST:g} m"
                    raise self._reading.error("RG306", text)
            stack += [(child, world) for child in reversed(node.json.children)]
            if node.json.mesh >= 0:
                self._place(node, world, objects, names, materials)
            if (light := node.json.extensions.light.light) >= 0:
                axis, position = unit(-world[:3, 2]), vec3(world[:3, 3])
                direction = vec3(axis) if axis.any() else (0.0, 0.0, -1.0)
                lights.append(replace(self._lights[light], name=node.name, position=position, direction=direction))
            if node.json.camera >= 0:
                camera = self._cameras[node.json.camera]
                cameras[node.name] = replace(camera, name=node.name, transform=rigid(world))
        return Scene(
            self._path.stem,
            self._path,
            tuple(objects),
            tuple(self._primitives.meshes),
            tuple(materials),
            tuple(lights),
            cameras,
        )

    def _place(
        self, node: _Node, world: Matrix, objects: list[Object], names: UniqueNames, materials: list[Material]
    ) -> None:
        """Add the objects of a node, and the default material if one of them is the first to use it."""
        default = len(self._materials.materials)
        transforms = [world] if node.instances is None else [world @ instance for instance in node.instances]
        for number, transform in enumerate(transforms):
            instance = node.name if node.instances is None else f"{node.name}[{number}]"
            for k, (mesh, material) in enumerate(self._meshes[node.json.mesh]):
                if material < 0:
                    material = default
                    materials[default:] = [self._materials.default]
                name = names.unique(instance if k == 0 else f"{instance}#{k}", "object")
                self._reading.warn_unmapped(name, materials[material], self._primitives.meshes[mesh])
                objects.append(Object(name, mesh, material, transform, not node.name.endswith("NS"), node=node.name))

    def _roots(self) -> list[int]:
        parent: dict[int, int] = {}
        for index, node in enumerate(self._nodes):
            for child in node.json.children:
                if child in parent:
                    text = f"nodes[{child}] has two parents, nodes[{parent[child]}] and nodes[{index}]"
                    raise self._reading.error("RG309", text)
                parent[child] = index
        self._check_cycles(parent)
        scenes = [scene.nodes for scene in self._gltf.scenes]
        for index, scene in enumerate(scenes):
            self._check_nodes(scene, f"scenes[{index}].nodes")
            for root in scene:
                if root in parent:
                    raise self._reading.error("RG309", f"scenes[{index}] names nodes[{root}], which has a parent")
            if len(set(scene)) != len(scene):
                raise self._reading.error("RG309", f"scenes[{index}] names a node twice")
        check_index(self._reading, self._gltf.scene, scenes, "'scene'", "scenes")
        if scenes:
            return scenes[max(self._gltf.scene, 0)]
        return [index for index in range(len(self._nodes)) if index not in parent]

    def _check_cycles(self, parent: dict[int, int]) -> None:
        """Check that every node has an ancestor without a parent."""
        rooted: set[int] = set()
        for start in range(len(self._nodes)):
            trail: dict[int, None] = {}
            at = start
            while at not in rooted:
                if at in trail:
                    raise self._reading.error("RG309", f"nodes[{at}] is its own ancestor")
                trail[at] = None
                if at not in parent:
                    break
                at = parent[at]
            rooted.update(trail)
