"""A scene as immutable values, which readers create and `pack` lays out for the GPU.

Conventions are glTF 2.0's: right-handed, +Y up, metres, column vectors, scene-linear colours, texture coordinates with
the origin at the image's top left.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from functools import cached_property, partial
from itertools import compress, count
from operator import is_not
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, TypeAlias

import numpy as np
import numpy.typing as npt
from msgspec import Struct, field
from msgspec.structs import replace

from rendergraph.declare import Added
from rendergraph.declare.extensions import ImageLoader
from rendergraph.document import YamlLimits, shown
from rendergraph.facts import NO_EXTRA, Extra
from rendergraph.scene.triangles import Edges, extremes, find_edges, is_solid
from rendergraph.stamps import Stamps

if TYPE_CHECKING:
    from rendergraph.scene.rig import Curve, Deform, Pose, Rig

Floats: TypeAlias = npt.NDArray[np.float32]
Matrix: TypeAlias = npt.NDArray[np.float64]
Vec3: TypeAlias = tuple[float, float, float]

FARTHEST = 1e12
"""Limit of numbers in a mesh: products of a few larger ones would exceed single precision."""

_LAYERED = ("clearcoat", "sheen_color", "iridescence", "transmission", "shadow_catcher")
_NONE = 0.0, (0.0, 0.0, 0.0)  # values of these without a layer
_REFLECTANCE = ("ior", "specular", "specular_color")
_MOST_CONVEX = 10_000_000
"""Limit of pairs of vertex and triangle in the test for convexity: about a tenth of a second."""


class Mesh(Struct, frozen=True, eq=False, dict=True, weakref=True):
    """Triangles of one material with their vertex attributes.

    Attributes:
        positions: float32 (n, 3), finite.
        indices: uint32 (m, 3), each below n; counter-clockwise seen from outside.
        normals: float32 (n, 3), unit length.
        tangents: float32 (n, 4), w the handedness, or None: the shader derives them.
        uv0, uv1: float32 (n, 2), or None.
        colors: float32 (n, 4) linear, or None for white.
        deform: how the vertices of an animated mesh move; the other attributes are then those of the bind pose.
    """

    name: str
    positions: Floats
    indices: npt.NDArray[np.uint32]
    normals: Floats
    tangents: Floats | None = None
    uv0: Floats | None = None
    uv1: Floats | None = None
    colors: Floats | None = None
    deform: Deform | None = None

    @cached_property
    def box(self) -> tuple[Floats, Floats]:
        """Minimum and maximum corner, float32 (3,) each."""
        return extremes(self.positions)

    @cached_property
    def plane(self) -> tuple[float, float, float, float] | None:
        """The plane (a, b, c, d), a x + b y + c z + d = 0, that contains all triangles, or None.

        Its unit normal is on the front side of the triangles.
        """
        a, b, c = np.moveaxis(self.positions.astype(np.float64)[self.indices], 1, 0)
        normal = np.cross(b - a, c - a).sum(axis=0)
        length = float(np.linalg.norm(normal))
        if not length:
            return None
        normal /= length
        away = np.stack([a, b, c]) @ normal
        low, high = self.box
        if self.deform is not None or float(np.ptp(away)) > 1e-5 * float(np.linalg.norm(high - low)):
            return None
        x, y, z = (float(value) for value in normal)
        return x, y, z, -float(away.mean())

    @cached_property
    def solid(self) -> bool:
        """Whether it is closed and encloses a volume, so that its front faces hide its back faces from outside."""
        return is_solid(self.positions, self.indices)

    @cached_property
    def convex(self) -> bool:
        """Whether it is closed with every vertex behind every triangle; also False if it is too large to test."""
        triangles = self.edges.triangles
        if self.deform is not None or self.edges.gap or len(triangles) * len(self.positions) > _MOST_CONVEX:
            return False
        positions = self.positions.astype(np.float64)
        a, b, c = np.moveaxis(positions[triangles], 1, 0)
        normals = np.cross(b - a, c - a)
        normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)
        out = (positions @ normals.T).max(axis=0) - (a * normals).sum(axis=1)
        low, high = self.box
        return bool(out.max() <= 1e-5 * float(np.linalg.norm(high - low)))

    @cached_property
    def edges(self) -> Edges:
        return find_edges(self.positions, self.indices)


class SceneLimits(Struct, frozen=True):
    """Limits of scenes, which are untrusted.

    Attributes:
        file_bytes: bytes of one mesh or buffer file.
        vertices: vertices of one scene, before and after corners are split.
        objects: placed objects of one scene.
        lights: lights of one scene file.
        memory_bytes: memory for data that a file declares without containing it, such as accessors without a view.
        image_side: texels along one side of an image.
        image_bytes: decoded bytes of one image.
        image_ratio: decoded bytes for each byte of the file, if an image is above 64 MiB.
        yaml: limits of the text of a scene file.
    """

    file_bytes: int = 2 << 30
    vertices: int = 100_000_000
    objects: int = 500_000
    lights: int = 100_000
    memory_bytes: int = 256 << 20
    image_side: int = 16384
    image_bytes: int = 2 << 30
    image_ratio: int = 1000
    yaml: YamlLimits = YamlLimits()

    def exceeded(self, what: str, limit: str) -> str:
        """Return the text of a mistake for an exceeded limit, with the option that raises it."""
        return f"{what}, the limit is {getattr(self, limit):,}; --limit scene-{limit.replace('_', '-')}=N allows more"


class GeneratedTexture(Struct, frozen=True):
    """A map of a generated texture: the shader of its kind and the values of its uniforms and of `resolution`."""

    shader: Path
    values: tuple[tuple[str, Any], ...]
    map: Literal["color", "normal", "surface"]


class ImageSource(Struct, frozen=True):
    """An image that has not been decoded: a file, bytes inside another file, or a generated image.

    Attributes:
        path: the file that it comes from, even if `data` has its bytes.
        data: the encoded bytes of an embedded image.
        size: width and height of the decoded image; None if unknown before decoding.
        channels: number of channels in the file; 0 if unknown.
    """

    path: Path
    data: bytes | None = None
    label: str = ""
    loader: Added[ImageLoader] | None = None
    size: tuple[int, int] | None = None
    channels: int = 0
    generated: GeneratedTexture | None = None

    def __repr__(self) -> str:
        embedded = f", {len(self.data)} bytes" if self.data is not None else ""
        return f"<ImageSource {self.label or self.path}{embedded}>"


class MadeImage(Struct, frozen=True):
    """A generated image: `make` returns float16 (height, width, 4), top row first; `size` is its width and height."""

    label: str
    size: tuple[int, int]
    make: Callable[[], npt.NDArray[Any]]


class Texture(Struct, frozen=True):
    """An image with its sampling and coordinates.

    Attributes:
        srgb: decoded with the sRGB curve (base colour, emissive).
        min_filter: `nearest`, `linear` (no mips), `nearest_mipmap_nearest`, … as in glTF.
        uv: which UV set, 0 or 1.
        transform: KHR_texture_transform as a 2×3 matrix on (u, v, 1), row-major; None for identity.
    """

    image: ImageSource
    srgb: bool
    wrap_s: Literal["repeat", "mirror", "clamp"] = "repeat"
    wrap_t: Literal["repeat", "mirror", "clamp"] = "repeat"
    mag_filter: Literal["nearest", "linear"] = "linear"
    min_filter: str = "linear_mipmap_linear"
    uv: int = 0
    transform: tuple[float, float, float, float, float, float] | None = None


class Material(Struct, frozen=True):
    """A surface material; names and meanings are those of glTF, in snake case.

    Attributes:
        base_color: linear RGBA factor.
        emissive: linear RGB factor, including `emissive_strength`.
        ior: index of refraction; dielectric f0 is ((ior-1)/(ior+1))².
        specular, specular_color: as in KHR_materials_specular, linear RGB.
        anisotropy_strength, anisotropy_rotation: as in KHR_materials_anisotropy, radians.
        clearcoat, sheen_color, iridescence, transmission: factors of the layers, with their other parameters, as in
            the KHR_materials_ extensions; distances in metres, `iridescence_thickness` in nanometres for texture
            values 0 and 1 (without a texture the second applies).
        shadow_catcher: shows the background, darkened by shadows and occlusion.
        textures: by slot: `base_color`, `metallic_roughness`, `normal`, `occlusion`, `emissive`, `anisotropy`,
            `specular`, `specular_color`, and those of the layers.
        ambient, diffuse, specular_phong, shininess: an OBJ's Ka, Kd, Ks, Ns if the MTL gives no Pr/Pm; None if the
            material is metallic-roughness (design.md §8 derives one from the other).
        extra: values of plugins' keys, as in objects, lights and cameras.
    """

    name: str
    base_color: tuple[float, float, float, float] = (1.0, 1.0, 1.0, 1.0)
    metallic: float = 0.0
    roughness: float = 1.0
    emissive: Vec3 = (0.0, 0.0, 0.0)
    occlusion_strength: float = 1.0
    normal_scale: float = 1.0
    alpha_mode: Literal["opaque", "mask", "blend"] = "opaque"
    alpha_cutoff: float = 0.5
    double_sided: bool = False
    unlit: bool = False
    ior: float = 1.5
    specular: float = 1.0
    specular_color: Vec3 = (1.0, 1.0, 1.0)
    anisotropy_strength: float = 0.0
    anisotropy_rotation: float = 0.0
    clearcoat: float = 0.0
    clearcoat_roughness: float = 0.0
    clearcoat_normal_scale: float = 1.0
    sheen_color: Vec3 = (0.0, 0.0, 0.0)
    sheen_roughness: float = 0.0
    iridescence: float = 0.0
    iridescence_ior: float = 1.3
    iridescence_thickness: tuple[float, float] = (100.0, 400.0)
    transmission: float = 0.0
    thickness: float = 0.0
    attenuation_distance: float = float("inf")
    attenuation_color: Vec3 = (1.0, 1.0, 1.0)
    dispersion: float = 0.0
    shadow_catcher: bool = False
    textures: Mapping[str, Texture] = field(default_factory=dict)
    ambient: Vec3 | None = None
    diffuse: Vec3 | None = None
    specular_phong: Vec3 | None = None
    shininess: float | None = None
    extra: Extra = NO_EXTRA


class Object(Struct, frozen=True, eq=False):
    """One placed mesh.

    Attributes:
        name: node or `o` name, unique within its file.
        mesh, material: indices into `Scene.meshes` and `Scene.materials`.
        transform: object to world, float64 (4, 4), affine.
        node: the name of its node, shared by all parts of the node (one per material or instance); a scene file's
            `overrides` name it.
        pose: the pose of an animated mesh; objects with another pose do not share the mesh.
    """

    name: str
    mesh: int
    material: int
    transform: Matrix
    casts_shadow: bool = True
    hidden: bool = False
    node: str = ""
    extra: Extra = NO_EXTRA
    pose: Pose | None = None


class Light(Struct, frozen=True):
    """A punctual light (KHR_lights_punctual).

    Attributes:
        position: world space, metres; unused for directional.
        direction: unit vector the light travels along; unused for point.
        color: linear RGB.
        intensity: lux for directional, candela for point and spot.
        range: metres at which the inverse-square falloff is windowed to zero, None for no window.
        inner, outer: half angles of the spot's cone in radians.
        casts_shadow: whether `shadow_map.light: auto` may choose it.
    """

    name: str
    type: Literal["directional", "point", "spot"]
    position: Vec3 = (0.0, 0.0, 0.0)
    direction: Vec3 = (0.0, -1.0, 0.0)
    color: Vec3 = (1.0, 1.0, 1.0)
    intensity: float = 1.0
    range: float | None = None
    inner: float = 0.0
    outer: float = 0.7853981633974483
    casts_shadow: bool = True
    extra: Extra = NO_EXTRA


class Camera(Struct, frozen=True, eq=False):
    """A camera.

    Attributes:
        transform: camera to world, float64 (4, 4), looking down -Z.
        type: `perspective`, `orthographic` or `frustum` (off-centre perspective).
        fov_y: vertical angle in radians (perspective).
        height: full height in metres (orthographic); the width follows the picture's aspect.
        frustum: left, right, bottom, top at the near plane in metres.
        near, far: metres; far may be infinite for perspective.
        target: the point that it looks at, for orbits; None if unknown.
        shutter: the fraction of a frame's time for which it is open, centred on the frame's time.
        aspect: width over height of pictures whose size is not given.
    """

    name: str
    transform: Matrix
    type: Literal["perspective", "orthographic", "frustum"] = "perspective"
    fov_y: float = 0.7853981633974483
    height: float = 2.0
    frustum: tuple[float, float, float, float] | None = None
    near: float = 0.05
    far: float = 100.0
    target: Vec3 | None = None
    extra: Extra = NO_EXTRA
    shutter: float = 0.0
    aspect: float | None = None


class Environment(Struct, frozen=True):
    """An equirectangular image around the scene.

    Attributes:
        size: width and height of the decoded image; None if unknown before decoding.
        intensity: factor on its radiance.
        rotate: radians about +Y.
        sun: the sun of a sky, in the image's coordinates, for a scene without a directional light; else None.
        projection: the point from which the image is projected on shadow catchers, x, y and z in metres, and the
            distance from there at which they match the background; all 0 if they match everywhere.
    """

    image: ImageSource | MadeImage
    size: tuple[int, int] | None
    intensity: float = 1.0
    rotate: float = 0.0
    sun: Light | None = None
    projection: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)

    @property
    def sunlight(self) -> Light | None:
        """The sun as a light of the scene, turned and scaled like the image."""
        if self.sun is None:
            return None
        c, s = math.cos(self.rotate), math.sin(self.rotate)
        x, y, z = self.sun.direction
        turned = (c * x + s * z, y, c * z - s * x)
        return replace(self.sun, direction=turned, intensity=self.sun.intensity * self.intensity)


class Orbit(Struct, frozen=True):
    """A camera that orbits its target, counter-clockwise seen from above; the default camera if unnamed.

    At the time `begin`, in seconds, it is at its own position.
    """

    camera: str
    degrees_per_second: float
    begin: float = 0.0


class Placement(Struct, frozen=True, eq=False):
    """The parts of a scene file's object: index or name in the scene, and transform within the object, (4, 4)."""

    objects: tuple[tuple[int, Matrix], ...] = ()
    lights: tuple[tuple[int, Matrix], ...] = ()
    cameras: tuple[tuple[str, Matrix], ...] = ()


class Scene(Struct, frozen=True, eq=False, dict=True, weakref=True):
    """Objects with their meshes and materials, lights and cameras.

    Attributes:
        cameras: by name, the first is the default.
        keyframes: dotted path to values over time.
        follows: by camera, the indices of the objects that it looks at.
        warnings: what a reader left out, replaced or clamped, once per kind and file.
        recipe: section and name (`("cameras", "main")`) to the values in the scene file, which keyframes change.
        placements: name of a scene file's object, or of one copy of it, to its parts; "" for all of an animated file.
        rigs: the rigs of animated files.
        copies: section and name of a scene file's entry to its `repeat.Copies`.
        plugin_keys: section to the names of the plugins' keys that its file may use.
        files: stamps of all files that were read.
        ground: whether to add a ground, and the height in metres from which the environment is projected on it; 0
            chooses a height for the objects.
        variants: by name, the materials of objects that differ in the variant (KHR_materials_variants).
    """

    name: str
    source: Path | None = None
    objects: tuple[Object, ...] = ()
    meshes: tuple[Mesh, ...] = ()
    materials: tuple[Material, ...] = ()
    lights: tuple[Light, ...] = ()
    cameras: Mapping[str, Camera] = field(default_factory=dict)
    environment: Environment | None = None
    keyframes: Mapping[str, Curve] = field(default_factory=dict)
    orbit: Orbit | None = None
    warnings: tuple[Any, ...] = ()
    recipe: Mapping[tuple[str, str], Mapping[str, Any]] = field(default_factory=dict)
    placements: Mapping[str, Placement] = field(default_factory=dict)
    copies: Mapping[tuple[str, str], Any] = field(default_factory=dict)
    plugin_keys: Mapping[str, frozenset[str]] = field(default_factory=dict)
    rigs: tuple[Rig, ...] = ()
    follows: Mapping[str, tuple[int, ...]] = field(default_factory=dict)
    files: Stamps = field(default_factory=dict)
    ground: float | None = None
    variants: Mapping[str, Mapping[int, int]] = field(default_factory=dict)

    def with_variant(self, name: str) -> Scene:
        """Return the scene with the materials of one of its variants."""
        objects = list(self.objects)
        for number, material in self.variants[name].items():
            objects[number] = replace(objects[number], material=material)
        return replace(self, objects=tuple(objects))

    def variant_mistake(self, name: str) -> str | None:
        """Return why a variant's name is wrong; None if the variant exists."""
        known = f"it has {', '.join(map(repr, self.variants))}" if self.variants else "it has none"
        return None if name in self.variants else f"has no variant '{shown(name)}'; {known}"

    def parts_of(self, name: str) -> list[int]:
        """Return the indices of the parts of a scene file's object, or of those of all its copies."""
        copies = self.copies.get(("objects", name))
        names = [name] if copies is None else [f"{name}.{number}" for number in range(len(copies.offsets))]
        return [index for each in names for index, _ in self.placements.get(each, Placement()).objects]

    @cached_property
    def catchers(self) -> list[int]:
        """Indices of the objects that are shadow catchers."""
        catching = {number for number, material in enumerate(self.materials) if material.shadow_catcher}
        return [number for number, entry in enumerate(self.objects) if catching and entry.material in catching]

    @cached_property
    def bounds(self) -> tuple[Vec3, Vec3]:
        """Minimum and maximum corner of the transformed boxes of everything drawn; a unit cube if nothing is drawn.

        Shadow catchers do not count, because a ground is as large as the surroundings.
        """
        catchers = set(self.catchers)
        shown = [entry for number, entry in enumerate(self.objects) if not entry.hidden and number not in catchers]
        return bounds_of(corners_of(self.meshes, shown))

    @cached_property
    def tracks(self) -> tuple[tuple[str, str, tuple[tuple[str, Curve], ...]], ...]:
        """The keyframes by section and entry, each with its key."""
        found: dict[tuple[str, str], list[tuple[str, Curve]]] = {}
        for path, curve in self.keyframes.items():
            section, _, rest = path.partition(".")
            name, key = ("", rest) if section == "environment" else rest.rpartition(".")[::2]
            found.setdefault((section, name), []).append(("rotation" if curve.turns else key, curve))
        return tuple((section, name, tuple(curves)) for (section, name), curves in found.items() if section != "nodes")

    @cached_property
    def node_curves(self) -> tuple[tuple[str, str, Curve], ...]:
        """The keyframes of nodes' parameters: node, parameter and values."""
        driven = ((path[6:].rpartition("."), curve) for path, curve in self.keyframes.items() if path[:6] == "nodes.")
        return tuple((node, name, curve) for (node, _, name), curve in driven)

    @property
    def camera(self) -> Camera | None:
        """The first camera, which renders; a completed scene has one."""
        return next(iter(self.cameras.values()), None)

    def has_grain(self, material: Material) -> bool:
        """Whether a material is anisotropic at any time."""
        return material.anisotropy_strength > 0 or self._changes(material, "anisotropy_strength")

    def layers(self, material: Material) -> tuple[str, ...]:
        """Return which of clearcoat, sheen, iridescence and transmission a material has at any time."""
        has = (key for key in _LAYERED if getattr(material, key) not in _NONE or self._changes(material, key))
        return () if material.unlit else tuple(key.removesuffix("_color") for key in has)

    def is_blended(self, material: Material) -> bool:
        """Return whether a material lets surfaces behind it show, by alpha or transmission."""
        return material.alpha_mode == "blend" or "transmission" in self.layers(material)

    def emits(self, material: Material) -> bool:
        """Whether a material emits light at any time."""
        return any(material.emissive) or self._changes(material, "emissive")

    def reflects(self, material: Material) -> bool:
        """Whether the dielectric part of a material has a reflectance other than 4 % at any time."""
        usual = material.ior == 1.5 and material.specular == 1.0 and material.specular_color == (1.0, 1.0, 1.0)
        textured = not material.textures.keys().isdisjoint(("specular", "specular_color"))
        return textured or not usual or any(map(partial(self._changes, material), _REFLECTANCE))

    def _changes(self, material: Material, key: str) -> bool:
        return f"materials.{material.name}.{key}" in self.keyframes

    def __repr__(self) -> str:
        counts = f"{len(self.objects)} objects, {len(self.lights)} lights, {len(self.cameras)} cameras"
        return f"<Scene {self.name}: {counts}>"


def corners_of(meshes: Sequence[Mesh], objects: Sequence[Object]) -> Matrix:
    """Return the world-space corners of the boxes of objects, (n, 8, 3), z fastest."""
    used = {key: place for place, key in enumerate(dict.fromkeys((entry.mesh, entry.pose) for entry in objects))}
    boxes = np.array([meshes[mesh].box if pose is None else pose.box for mesh, pose in used], np.float64)
    low, high = boxes.reshape(-1, 2, 3)[[used[entry.mesh, entry.pose] for entry in objects]].swapaxes(0, 1)
    far = np.array([(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)], bool)
    transforms = np.array([entry.transform for entry in objects]).reshape(-1, 4, 4)
    local = np.where(far, high[:, None], low[:, None])
    placed: Matrix = local @ transforms[:, :3, :3].swapaxes(1, 2) + transforms[:, None, :3, 3]
    return placed


def bounds_of(corners: Matrix) -> tuple[Vec3, Vec3]:
    """Return the minimum and maximum corner of boxes (n, 8, 3); a unit cube around the origin if there are none."""
    if not len(corners):
        return (-0.5, -0.5, -0.5), (0.5, 0.5, 0.5)
    (x, y, z), (u, v, w) = (corner.tolist() for corner in extremes(corners.reshape(-1, 3)))
    return (x, y, z), (u, v, w)


def changed_objects(before: Scene, scene: Scene) -> list[int]:
    """Return the objects that are not identical in two scenes that share their meshes."""
    return list(compress(count(), map(is_not, before.objects, scene.objects)))
