"""The JSON of glTF 2.0 as structs, with the extensions that are read. An index of -1 stands for an absent one."""

from __future__ import annotations

import json
import math
from collections import Counter
from collections.abc import Sequence
from typing import Annotated, Any, Literal, TypeAlias

import msgspec
from msgspec import Meta, Struct, field

from rendergraph.document import shown
from rendergraph.scene.reading import Reading

Index: TypeAlias = Annotated[int, Meta(ge=0, le=2**53)]
Size: TypeAlias = Annotated[int, Meta(ge=1, le=2**53)]
Positive: TypeAlias = Annotated[float, Meta(ge=0)]
Vec2: TypeAlias = tuple[float, float]
Vec3: TypeAlias = tuple[float, float, float]
Vec4: TypeAlias = tuple[float, float, float, float]
ComponentType: TypeAlias = Literal[5120, 5121, 5122, 5123, 5125, 5126]
ElementType: TypeAlias = Literal["SCALAR", "VEC2", "VEC3", "VEC4", "MAT2", "MAT3", "MAT4"]
Attributes: TypeAlias = dict[str, Index]


class _Struct(Struct, frozen=True, rename="camel"):
    """Keys that are not listed are ignored."""


class Asset(_Struct, frozen=True):
    version: str = ""
    min_version: str = ""


class Buffer(_Struct, frozen=True):
    byte_length: Size
    uri: str | None = None


class BufferView(_Struct, frozen=True):
    buffer: Index
    byte_length: Size
    byte_offset: Index = 0
    byte_stride: Annotated[int, Meta(ge=4, le=252, multiple_of=4)] = 0


class SparseValues(_Struct, frozen=True):
    buffer_view: Index
    byte_offset: Index = 0


class SparseIndices(SparseValues, frozen=True, kw_only=True):
    component_type: Literal[5121, 5123, 5125]


class Sparse(_Struct, frozen=True):
    count: Size
    indices: SparseIndices
    values: SparseValues


class Accessor(_Struct, frozen=True):
    component_type: ComponentType
    type: ElementType
    count: Size
    buffer_view: Index = -1
    byte_offset: Index = 0
    normalized: bool = False
    min: list[float] = []
    max: list[float] = []
    sparse: Sparse | None = None


class Image(_Struct, frozen=True):
    uri: str | None = None
    buffer_view: Index = -1


class Sampler(_Struct, frozen=True):
    wrap_s: Literal[10497, 33648, 33071] = 10497
    wrap_t: Literal[10497, 33648, 33071] = 10497
    mag_filter: Literal[9728, 9729] = 9729
    min_filter: Literal[9728, 9729, 9984, 9985, 9986, 9987] = 9987


class Texture(_Struct, frozen=True):
    source: Index = -1
    sampler: Index = -1
    extensions: dict[str, Any] = {}


class TextureTransform(_Struct, frozen=True):
    offset: Vec2 = (0.0, 0.0)
    rotation: float = 0.0
    scale: Vec2 = (1.0, 1.0)
    tex_coord: Index = -1


class TextureInfoExtensions(_Struct, frozen=True):
    transform: TextureTransform | None = field(name="KHR_texture_transform", default=None)


class TextureInfo(_Struct, frozen=True):
    index: Index
    tex_coord: Index = 0
    scale: float = 1.0
    strength: float = 1.0
    extensions: TextureInfoExtensions = TextureInfoExtensions()


class MetallicRoughness(_Struct, frozen=True):
    base_color_factor: Vec4 = (1.0, 1.0, 1.0, 1.0)
    metallic_factor: float = 1.0
    roughness_factor: float = 1.0
    base_color_texture: TextureInfo | None = None
    metallic_roughness_texture: TextureInfo | None = None


class MaterialFactor(_Struct, frozen=True):
    """Either of the extensions that have a single number."""

    emissive_strength: float = 1.0
    ior: float = 1.5


class Specular(_Struct, frozen=True):
    specular_factor: float = 1.0
    specular_color_factor: Vec3 = (1.0, 1.0, 1.0)
    specular_texture: TextureInfo | None = None
    specular_color_texture: TextureInfo | None = None


class Anisotropy(_Struct, frozen=True):
    anisotropy_strength: float = 0.0
    anisotropy_rotation: float = 0.0
    anisotropy_texture: TextureInfo | None = None


class Layer(_Struct, frozen=True):
    """Any of the extensions that add a layer to a material."""

    clearcoat_factor: float = 0.0
    clearcoat_roughness_factor: float = 0.0
    clearcoat_texture: TextureInfo | None = None
    clearcoat_roughness_texture: TextureInfo | None = None
    clearcoat_normal_texture: TextureInfo | None = None
    sheen_color_factor: Vec3 = (0.0, 0.0, 0.0)
    sheen_roughness_factor: float = 0.0
    sheen_color_texture: TextureInfo | None = None
    sheen_roughness_texture: TextureInfo | None = None
    iridescence_factor: float = 0.0
    iridescence_ior: float = 1.3
    iridescence_thickness_minimum: Positive = 100.0
    iridescence_thickness_maximum: Positive = 400.0
    iridescence_texture: TextureInfo | None = None
    iridescence_thickness_texture: TextureInfo | None = None
    transmission_factor: float = 0.0
    transmission_texture: TextureInfo | None = None
    thickness_factor: float = 0.0
    thickness_texture: TextureInfo | None = None
    attenuation_distance: Positive = math.inf
    attenuation_color: Vec3 = (1.0, 1.0, 1.0)
    dispersion: float = 0.0


class MaterialExtensions(_Struct, frozen=True):
    unlit: dict[str, Any] | None = field(name="KHR_materials_unlit", default=None)
    emissive: MaterialFactor = field(name="KHR_materials_emissive_strength", default=MaterialFactor())
    ior: MaterialFactor = field(name="KHR_materials_ior", default=MaterialFactor())
    specular: Specular = field(name="KHR_materials_specular", default=Specular())
    anisotropy: Anisotropy = field(name="KHR_materials_anisotropy", default=Anisotropy())
    clearcoat: Layer = field(name="KHR_materials_clearcoat", default=Layer())
    sheen: Layer = field(name="KHR_materials_sheen", default=Layer())
    iridescence: Layer = field(name="KHR_materials_iridescence", default=Layer())
    transmission: Layer = field(name="KHR_materials_transmission", default=Layer())
    volume: Layer = field(name="KHR_materials_volume", default=Layer())
    dispersion: Layer = field(name="KHR_materials_dispersion", default=Layer())


class Material(_Struct, frozen=True):
    name: str = ""
    pbr_metallic_roughness: MetallicRoughness = MetallicRoughness()
    normal_texture: TextureInfo | None = None
    occlusion_texture: TextureInfo | None = None
    emissive_texture: TextureInfo | None = None
    emissive_factor: Vec3 = (0.0, 0.0, 0.0)
    alpha_mode: Literal["OPAQUE", "MASK", "BLEND"] = "OPAQUE"
    alpha_cutoff: float = 0.5
    double_sided: bool = False
    extensions: MaterialExtensions = MaterialExtensions()


class VariantMapping(_Struct, frozen=True):
    material: Index
    variants: list[Index]


class VariantMappings(_Struct, frozen=True):
    mappings: list[VariantMapping] = []


class PrimitiveExtensions(_Struct, frozen=True):
    variants: VariantMappings = field(name="KHR_materials_variants", default=VariantMappings())


class Primitive(_Struct, frozen=True):
    attributes: Attributes
    indices: Index = -1
    material: Index = -1
    mode: Literal[0, 1, 2, 3, 4, 5, 6] = 4
    targets: list[Attributes] = []
    extensions: PrimitiveExtensions = PrimitiveExtensions()


class Mesh(_Struct, frozen=True):
    primitives: Annotated[list[Primitive], Meta(min_length=1)]
    name: str = ""
    weights: list[float] = []


class Skin(_Struct, frozen=True):
    joints: Annotated[list[Index], Meta(min_length=1)]
    inverse_bind_matrices: Index = -1
    skeleton: Index = -1


class ChannelTarget(_Struct, frozen=True):
    path: str
    node: Index = -1


class Channel(_Struct, frozen=True):
    sampler: Index
    target: ChannelTarget


class AnimationSampler(_Struct, frozen=True):
    input: Index
    output: Index
    interpolation: Literal["LINEAR", "STEP", "CUBICSPLINE"] = "LINEAR"


class Animation(_Struct, frozen=True):
    name: str = ""
    channels: list[Channel] = []
    samplers: list[AnimationSampler] = []


class Perspective(_Struct, frozen=True):
    yfov: float
    znear: float
    zfar: float = math.inf


class Orthographic(_Struct, frozen=True):
    ymag: float
    znear: float
    zfar: float


class Camera(_Struct, frozen=True):
    type: Literal["perspective", "orthographic"]
    name: str = ""
    perspective: Perspective | None = None
    orthographic: Orthographic | None = None


class Spot(_Struct, frozen=True):
    inner_cone_angle: float = 0.0
    outer_cone_angle: float = math.pi / 4


class Light(_Struct, frozen=True):
    type: Literal["directional", "point", "spot"]
    name: str = ""
    color: Vec3 = (1.0, 1.0, 1.0)
    intensity: float = 1.0
    range: float | None = None
    spot: Spot = Spot()


class Lights(_Struct, frozen=True):
    lights: list[Light] = []


class LightReference(_Struct, frozen=True):
    light: Index = -1


class Instancing(_Struct, frozen=True):
    attributes: Attributes = {}


class NodeExtensions(_Struct, frozen=True):
    light: LightReference = field(name="KHR_lights_punctual", default=LightReference())
    instancing: Instancing | None = field(name="EXT_mesh_gpu_instancing", default=None)


class Node(_Struct, frozen=True):
    name: str = ""
    children: list[Index] = []
    mesh: Index = -1
    camera: Index = -1
    skin: Index = -1
    matrix: Annotated[list[float], Meta(min_length=16, max_length=16)] = []
    translation: Vec3 | None = None
    rotation: Vec4 | None = None
    scale: Vec3 | None = None
    weights: list[float] = []
    extensions: NodeExtensions = NodeExtensions()


class Scene(_Struct, frozen=True):
    nodes: list[Index] = []


class Variant(_Struct, frozen=True):
    name: str


class Variants(_Struct, frozen=True):
    variants: list[Variant] = []


class FileExtensions(_Struct, frozen=True):
    punctual: Lights = field(name="KHR_lights_punctual", default=Lights())
    variants: Variants = field(name="KHR_materials_variants", default=Variants())


class Gltf(_Struct, frozen=True):
    asset: Asset
    scene: Index = -1
    extensions_used: list[str] = []
    extensions_required: list[str] = []
    buffers: list[Buffer] = []
    buffer_views: list[BufferView] = []
    accessors: list[Accessor] = []
    images: list[Image] = []
    samplers: list[Sampler] = []
    textures: list[Texture] = []
    materials: list[Material] = []
    meshes: list[Mesh] = []
    cameras: list[Camera] = []
    nodes: list[Node] = []
    scenes: list[Scene] = []
    skins: list[Skin] = []
    animations: list[Animation] = []
    extensions: FileExtensions = FileExtensions()


def decode(text: bytes, reading: Reading) -> Gltf:
    """Decode and check the JSON of a file. It may have no duplicate keys, NaN or numbers beyond double precision."""
    try:
        value = json.loads(
            text.decode("utf-8"), object_pairs_hook=_unique, parse_float=_finite, parse_constant=_constant
        )
        return msgspec.convert(value, Gltf)
    except RecursionError:
        raise reading.error("RG304", "invalid JSON: nested too deeply") from None
    except msgspec.ValidationError as problem:
        raise reading.error("RG304", f"invalid glTF: {problem}") from None
    except (ValueError, OverflowError) as problem:
        raise reading.error("RG304", f"invalid JSON: {problem}") from None


def _unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    result = dict(pairs)
    if len(result) != len(pairs):
        ((key, _),) = Counter(key for key, _ in pairs).most_common(1)
        raise ValueError(f"duplicate key '{shown(key)}'")
    return result


def _finite(digits: str) -> float:
    """A finite number; an integer if it is whole, because some programs write `3.0` for 3."""
    value = float(digits)
    if not math.isfinite(value):
        raise ValueError(f"number {shown(digits, 30)} is out of range")
    return int(value) if value and value.is_integer() else value


def _constant(word: str) -> float:
    raise ValueError(f"{word} is not allowed")


def check_index(reading: Reading, index: int, items: Sequence[object], where: str, what: str) -> None:
    """Check an index into a list; an absent one is valid."""
    if index >= len(items):
        raise reading.error("RG304", f"{where} is {index}, but there are {len(items)} {what}")
