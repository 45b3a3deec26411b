"""Nodes, cameras and lights of a glTF file as a scene.

Extensions that are not read are left out with a warning; one that the file requires is an error.
"""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from msgspec import Struct
from msgspec.structs import replace
from rendergraph.pipelines.formats.gltf import schema
from rendergraph.pipelines.formats.gltf.buffers import Buffers, split_glb
from rendergraph.pipelines.formats.gltf.materials import Materials
from rendergraph.pipelines.formats.gltf.motion import read_clips, read_skins
from rendergraph.pipelines.formats.gltf.primitives import Primitives
from rendergraph.pipelines.formats.gltf.schema import Gltf, check_index

from rendergraph.document import shown
from rendergraph.errors import InputError
from rendergraph.projection import unit
from rendergraph.scene.geometry import rigid, vec3
from rendergraph.scene.model import FARTHEST, Camera, Light, Matrix, Object, Placement, Scene
from rendergraph.scene.reading import Reading, UniqueNames
from rendergraph.scene.rig import Part, Rig, placements

_READ = frozenset(
    {
        "KHR_lights_punctual",
        *("KHR_materials_unlit", "KHR_materials_emissive_strength", "KHR_materials_ior", "KHR_materials_specular"),
        *("KHR_materials_anisotropy", "KHR_materials_clearcoat", "KHR_materials_sheen", "KHR_materials_iridescence"),
        *("KHR_materials_transmission", "KHR_materials_volume", "KHR_materials_dispersion"),
        *("KHR_texture_transform", "KHR_materials_variants"),
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


def used_extensions(path: Path) -> list[str]:
    """Return the names of the extensions that a valid file uses."""
    data = path.read_bytes()
    text = data[20 : 20 + int.from_bytes(data[12:16], "little")] if data[:4] == b"glTF" else data
    return [str(name) for name in json.loads(text).get("extensionsUsed", ())]


class _Node(Struct):
    """A node with a unique name; `instances` are transforms inside it, (n, 4, 4)."""

    json: schema.Node
    name: str
    instances: Matrix


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
        self._posed = [mesh if mesh.deform is None else replace(mesh, deform=None) for mesh in self._primitives.meshes]
        self._slots: dict[int, dict[tuple[int, int] | None, int]] = {}
        self._placed_materials = list(self._materials.materials)
        self._variants: dict[str, dict[int, int]] = {one.name: {} for one in gltf.extensions.variants.variants}

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

    def _mesh(self, mesh: schema.Mesh, number: int) -> list[tuple[int, int, dict[str, int]]]:
        """Mesh, material and materials by variant of each triangle primitive; material -1 is the default one."""
        result = []
        for k, primitive in enumerate(mesh.primitives):
            where = f"meshes[{number}].primitives[{k}]"
            check_index(self._reading, primitive.material, self._gltf.materials, f"{where}.material", "materials")
            if len(primitive.targets) != len(mesh.primitives[0].targets):
                raise self._error(f"{where}.targets: the primitives of a mesh must have the same number of them")
            index_of_mesh = self._primitives.mesh(primitive, mesh.name or f"mesh_{number}", where)
            if index_of_mesh is not None:
                result.append((index_of_mesh, primitive.material, self._materials_by_variant(primitive, where)))
        return result

    def _materials_by_variant(self, primitive: schema.Primitive, where: str) -> dict[str, int]:
        variants, found = self._gltf.extensions.variants.variants, dict[str, int]()
        for mapping in primitive.extensions.variants.mappings:
            check_index(self._reading, mapping.material, self._gltf.materials, f"{where}: material", "materials")
            if mapping.material < 0 or min(mapping.variants, default=0) < 0:
                raise self._error(f"{where}: a mapping of variants has no material, or no variant")
            for index in mapping.variants:
                check_index(self._reading, index, variants, f"{where}: a variant", "variants")
                found[variants[index].name] = mapping.material
        return found

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
        self._check_transform(node, where)
        return _Node(node, names.unique(name, f"node_{number}"), self._instances(node, where))

    def _check_nodes(self, indices: Sequence[int], where: str) -> None:
        check_index(self._reading, max(indices, default=-1), self._gltf.nodes, where, "nodes")

    def _check_transform(self, node: schema.Node, where: str) -> None:
        if node.matrix and any(part is not None for part in (node.translation, node.rotation, node.scale)):
            raise self._error(f"{where} has both 'matrix' and translation, rotation or scale")
        if node.matrix and not np.allclose(node.matrix[3::4], (0, 0, 0, 1), atol=1e-5):
            raise self._error(f"{where}: 'matrix' is not affine: its last row is not 0 0 0 1")
        if node.rotation is not None and not any(node.rotation):
            raise self._error(f"{where}: 'rotation' is a quaternion of length zero")

    def _instances(self, node: schema.Node, where: str) -> Matrix:
        if node.extensions.instancing is None:
            return _IDENTITY[None]
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
        return placements(translations, rotations, scales)

    def scene(self) -> Scene:
        roots, parents = self._roots()
        nodes = self._nodes
        count = sum(len(self._meshes[node.json.mesh]) * len(node.instances) for node in nodes if node.json.mesh >= 0)
        if count > self._reading.limits.objects:
            raise self._reading.over(f"its nodes place {count:,} objects", "objects")
        rig = self._rig(parents)
        worlds, _ = rig.at(0.0)
        is_near = np.abs(worlds).max(axis=(1, 2), initial=0) <= FARTHEST
        names, objects, parts = UniqueNames(), list[Object](), list[Part]()
        lights: list[tuple[Light, int]] = []
        cameras: list[tuple[Camera, int]] = []
        stack = roots[::-1]
        while stack:
            index = stack.pop()
            node, world = nodes[index], worlds[index]
            if not is_near[index]:
                text = f"nodes[{index}]: its world transform is not finite, or beyond {FARTHEST:g} m"
                raise self._reading.error("RG306", text)
            stack += node.json.children[::-1]
            if node.json.mesh >= 0:
                self._place(index, world, rig, names, objects, parts)
            if (light := node.json.extensions.light.light) >= 0:
                axis, position = unit(-world[:3, 2]), vec3(world[:3, 3])
                direction = vec3(axis) if axis.any() else (0.0, 0.0, -1.0)
                moved = replace(self._lights[light], name=node.name, position=position, direction=direction)
                lights.append((moved, index))
            if node.json.camera >= 0:
                camera = self._cameras[node.json.camera]
                cameras.append((replace(camera, name=node.name, transform=rigid(world)), index))
        scene = Scene(
            self._path.stem,
            self._path,
            tuple(objects),
            tuple(self._posed),
            tuple(self._placed_materials),
            tuple(light for light, _ in lights),
            {camera.name: camera for camera, _ in cameras},
            variants=self._variants,
        )
        if not rig.clips and all(mesh.deform is None for mesh in scene.meshes):
            return scene
        placement = Placement(
            tuple((number, placed.transform) for number, placed in enumerate(objects)),
            tuple((number, worlds[node]) for number, (_, node) in enumerate(lights)),
            tuple((camera.name, worlds[node]) for camera, node in cameras),
        )
        hung = (tuple(node for _, node in each) for each in (lights, cameras))
        rig = replace(rig, objects=tuple(parts), **dict(zip(("lights", "cameras"), hung, strict=True)))
        return replace(scene, rigs=(rig,), placements={"": placement})

    def _rig(self, parents: Sequence[int]) -> Rig:
        """All nodes at rest, with what can move them."""
        nodes = self._gltf.nodes
        counts, weights = [0] * len(nodes), {}
        for number, node in enumerate(nodes):
            if node.mesh < 0:
                continue
            mesh = self._gltf.meshes[node.mesh]
            counts[number] = len(mesh.primitives[0].targets)
            given = node.weights or mesh.weights or [0.0] * counts[number]
            if len(given) != counts[number]:
                where = f"nodes[{number}]" if node.weights else f"meshes[{node.mesh}]"
                raise self._error(f"{where}.weights are {len(given)}, but the mesh has {counts[number]} morph targets")
            if given:
                weights[number] = np.array(given, np.float64)
        return Rig(
            np.array(parents, np.int32),
            {
                key: np.array([getattr(node, key) or rest for node in nodes], np.float64).reshape(-1, len(rest))
                for key, rest in (("translation", (0, 0, 0)), ("rotation", (0, 0, 0, 1)), ("scale", (1, 1, 1)))
            },
            {n: np.reshape(node.matrix, (4, 4)).T for n, node in enumerate(nodes) if node.matrix},
            weights,
            read_skins(self._gltf, self._buffers, self._reading),
            read_clips(self._gltf, self._buffers, self._reading, counts),
        )

    def _place(
        self, index: int, world: Matrix, rig: Rig, names: UniqueNames, objects: list[Object], parts: list[Part]
    ) -> None:
        """Add the objects of a node, and the default material if one of them is the first to use it."""
        node, default = self._nodes[index], len(self._materials.materials)
        is_instanced = node.json.extensions.instancing is not None
        for number, local in enumerate(node.instances):
            instance = f"{node.name}[{number}]" if is_instanced else node.name
            for k, (mesh, material, by_variant) in enumerate(self._meshes[node.json.mesh]):
                for variant, other in by_variant.items():
                    self._variants[variant][len(objects)] = other
                if material < 0:
                    material = default
                    self._placed_materials[default:] = [self._materials.default]
                name = names.unique(instance if k == 0 else f"{instance}#{k}", "object")
                mesh = self._own_mesh(mesh, index, rig)
                deform = self._posed[mesh].deform
                skin = node.json.skin if deform is not None and deform.joints.shape[1] else -1
                self._reading.warn_unmapped(name, self._placed_materials[material], self._posed[mesh])
                transform, shadow = (world @ local if skin < 0 else local), not node.name.endswith("NS")
                objects.append(Object(name, mesh, material, transform, shadow, node=node.name))
                parts.append(Part(index, local, skin))

    def _own_mesh(self, mesh: int, index: int, rig: Rig) -> int:
        """The mesh of a node: what its skin or its weights move needs vertices of its own."""
        deform, skin = self._primitives.meshes[mesh].deform, self._nodes[index].json.skin
        key: tuple[int, int] | None = None
        if skin >= 0:
            where, joints = self._primitives.places[mesh], len(rig.skins[skin].joints)
            if deform is None or not deform.joints.shape[1]:
                raise self._error(f"nodes[{index}] has a skin, but {where} has no JOINTS_0 and WEIGHTS_0")
            if (highest := int(deform.joints.max())) >= joints:
                raise self._error(f"{where}: joint {highest} is out of range; skins[{skin}] has {joints} joints")
        elif deform is not None:
            deform = replace(deform, joints=deform.joints[:, :0], weights=deform.weights[:, :0])
        has_targets = deform is not None and len(deform.targets["positions"]) > 0
        if skin >= 0 or has_targets:
            key = skin, index if has_targets else -1
        slots = self._slots.setdefault(mesh, {})
        if key not in slots:
            made = replace(self._primitives.meshes[mesh], deform=deform if key else None)
            slots[key] = len(self._posed) if slots else mesh
            self._posed[slots[key] : slots[key] + 1] = [made]
        return slots[key]

    def _roots(self) -> tuple[list[int], list[int]]:
        """The nodes that the scene begins with, and the parent of each node, -1 without."""
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
        parents = [parent.get(index, -1) for index in range(len(self._nodes))]
        roots = [index for index, above in enumerate(parents) if above < 0]
        return scenes[max(self._gltf.scene, 0)] if scenes else roots, parents

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
