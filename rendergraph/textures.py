"""Formats, semantics of texels, and descriptions of textures.

Nothing here uses GL: a format has its GL enum as a number, so that `gl` needs no second table.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any as AnyType
from typing import Literal, cast

from msgspec import Struct

Kind = Literal["texture2d", "texture2d_array", "texture3d", "texture_cube", "buffer", "view", "function", "scene"]
MOST_SIDE = 16_384
"""Largest width or height of a picture or texture."""
GLSL_SHAPES = {"texture2d": "2D", "texture2d_array": "2DArray", "texture3d": "3D", "texture_cube": "Cube"}
"""Texture kind to the suffix of GLSL's `sampler` and `image`."""
TEXTURE_KINDS: frozenset[str] = frozenset(GLSL_SHAPES)

Family = Literal["float", "unorm", "snorm", "uint", "int", "depth", "depth_stencil"]
Filter = Literal["nearest", "linear", "trilinear"]
Wrap = Literal["clamp", "repeat", "mirror", "border"]


class Format(Struct, frozen=True):
    """One texel format.

    Attributes:
        gl: the sized internal format's GL enum.
        components: channels per texel, 1 to 4.
        bytes: bytes per texel.
        family: the type of channels in shaders; formats of one family are interchangeable at a port.
        view_class: formats of one class can share storage through texture views (OpenGL 4.6, table 8.22); each depth
            format is its own class, because depth never shares storage with colour.
        srgb: whether the sRGB curve is decoded on read and encoded on write.
    """

    name: str
    gl: int
    components: int
    bytes: int
    family: Family
    view_class: str
    srgb: bool = False

    @property
    def is_depth(self) -> bool:
        """Whether a texture of this format is a depth attachment."""
        return self.family in ("depth", "depth_stencil")

    @property
    def is_bytes(self) -> bool:
        """Whether each channel is a byte from 0 to 1."""
        return self.family == "unorm" and self.bytes == self.components and self.name != "rgb10_a2"


def _formats() -> Iterator[Format]:
    """Yield the formats of `formats.txt`: name, GL's enum, components, bytes and family."""
    for line in Path(__file__).with_name("formats.txt").read_text(encoding="ascii").splitlines():
        name, enum, components, size, word = line.split()
        family = cast("Family", word)
        view_class = name if family.startswith("depth") else f"{8 * int(size)}-bit"
        yield Format(name, int(enum, 16), int(components), int(size), family, view_class, name.startswith("srgb"))


FORMATS: dict[str, Format] = {found.name: found for found in _formats()}


class Semantic(Struct, frozen=True):
    """The meaning of a port's texels: a name, a description with units and range, the space of directions or positions,
    and the encoding of colours.
    """

    name: str
    doc: str
    space: Literal["view", "world"] | None = None
    encoding: Literal["linear", "display"] | None = None


Radiance = Semantic("radiance", "Scene-linear radiance, Rec. 709 primaries, 0 to infinity.", encoding="linear")
DisplayColor = Semantic("display_color", "Display-referred colour, sRGB encoded, 0 to 1.", encoding="display")
Albedo = Semantic("albedo", "Linear base colour, 0 to 1.", encoding="linear")
AlbedoRoot = Semantic(
    "albedo_root", "Square root of the linear base colour, 0 to 1, whose steps are about perceptually uniform."
)
Emissive = Semantic("emissive", "Emitted radiance, scene-linear.", encoding="linear")
Normal = Semantic("normal", "Unit normal in world space.", space="world")
Material = Semantic("material", "Metallic, roughness, occlusion and model data, 0 to 1.")
Depth = Semantic("depth", "Window depth, 1 at the near plane to 0 at the far one or where nothing is.")
LinearDepth = Semantic("linear_depth", "Distance along the view axis, -z in view space, metres.")
ShadowMap = Semantic("shadow_map", "Window depth seen from lights, one layer per view.")
Visibility = Semantic("visibility", "1 lit, 0 shadowed, one layer per shadowed light.")
Occlusion = Semantic("occlusion", "Ambient visibility: 1 open, 0 closed.")
Reflections = Semantic(
    "reflections", "Radiance reflected to the viewer, scene-linear; alpha is confidence, 0 to 1.", encoding="linear"
)
Irradiance = Semantic("irradiance", "Irradiance of surfaces, scene-linear.", encoding="linear")
Reflectance = Semantic("reflectance", "Fraction of light that is reflected, linear, 0 to 1.", encoding="linear")
Luminance = Semantic("luminance", "Scene luminance, relative to white at 1.")
ExposureGain = Semantic("exposure_gain", "Factor that scales scene radiance to the display's range; one texel.")
IrradianceSH = Semantic("irradiance_sh", "L2 spherical harmonics of the environment's radiance.")
EnvironmentMap = Semantic(
    "environment_map",
    "Equirectangular environment radiance: +X in the middle, +Z at 3/4 of the width, +Y at v = 0.",
    encoding="linear",
)
Any = Semantic("any", "Whatever is connected.")
View = Semantic("view", "Matrices and size that geometry is drawn with.")
Velocity = Semantic(
    "velocity", "Screen-space motion since the previous frame, in widths and heights of the picture, without jitter."
)
SceneData = Semantic("scene_data", "The scene as buffers and texture arrays, for `#include <scene.glsl>`.")

SEMANTICS: tuple[Semantic, ...] = tuple(value for value in list(globals().values()) if isinstance(value, Semantic))


class Signature(Struct, frozen=True):
    """A function that one node provides and another calls inside its shader.

    Attributes:
        declaration: the GLSL declaration without a semicolon.
        arguments: the argument names in order, to forward them.
        combine: the operator that combines several providers. With "" there is at most one provider, and without a
            provider no function: shaders must check `HAS_<PORT>` before the call.
        neutral: the GLSL value without a provider; with `combine=""`, the value that shaders assume then.
        doc: what it returns.
        texture: the semantic of textures that provide the same in screen space, one layer per light, or None.
        also: further functions that the same file defines; only with `combine=""`.
    """

    name: str
    declaration: str
    arguments: tuple[str, ...]
    combine: str
    neutral: str
    doc: str
    texture: str | None = None
    also: tuple[Signature, ...] = ()

    @property
    def functions(self) -> tuple[Signature, ...]:
        """This signature and those of the further functions."""
        return self, *self.also


ShadowLookup = Signature(
    name="shadow",
    declaration="float shadow(int light, vec3 position, vec3 normal)",
    arguments=("light", "position", "normal"),
    combine="*",
    neutral="1.0",
    doc="Visibility of the scene's light from a world-space position with a geometric normal; 1 for other lights.",
    texture="visibility",
)

EnvironmentLight = Signature(
    name="light_from",
    declaration="vec3 light_from(vec3 direction, float lobe)",
    arguments=("direction", "lobe"),
    combine="+",
    neutral="vec3(0.0)",
    doc="Radiance around a world-space direction, averaged over a lobe: 0 to 1 is GGX with this perceptual "
    "roughness, seen along the normal; 2 the cosine lobe of a diffuse surface; below 0 a cone of this many radians.",
)

Air = Signature(
    name="air_at",
    declaration="vec4 air_at(vec3 position)",
    arguments=("position",),
    combine="",
    neutral="vec4(0.0, 0.0, 0.0, 1.0)",
    doc="Air between the camera and a world-space position: rgb in-scattered radiance, alpha transmittance.",
)

LightList = Signature(
    name="light_count",
    declaration="int light_count(vec3 position)",
    arguments=("position",),
    combine="",
    neutral="LIGHT_COUNT",
    doc="Number of lights that may reach a world-space position; called before `light_at`, so it may store the "
    "beginning of their list in a global variable.",
    also=(
        Signature(
            name="light_at",
            declaration="int light_at(int index)",
            arguments=("index",),
            combine="",
            neutral="index",
            doc="Index in the scene of a light of that list, counted from 0; indices ascend.",
        ),
    ),
)

SIGNATURES: tuple[Signature, ...] = (ShadowLookup, EnvironmentLight, Air, LightList)


class Sampler(Struct, frozen=True):
    """How a reader samples a texture; readers may differ, so this becomes a GL sampler object."""

    filter: Filter = "nearest"
    wrap: Wrap = "clamp"
    compare: bool = False
    anisotropy: int = 1
    border: float | tuple[float, ...] | None = None


class TextureDesc(Struct, frozen=True, gc=False):
    """The description of a texture; textures with equal descriptions can share memory.

    Attributes:
        kind: one of `TEXTURE_KINDS`; multisampled if `samples` is above 1.
        format: a name in `FORMATS`.
        width, height: texels of mip 0, each at least 1.
        layers: array layers; 6 for a cube, the depth of mip 0 for a 3D texture.
        mips: levels of the mip chain, 1 for none.
        samples: samples per texel.
    """

    kind: Kind
    format: str
    width: int
    height: int
    layers: int = 1
    mips: int = 1
    samples: int = 1

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of mip 0."""
        return self.width, self.height

    @property
    def bytes(self) -> int:
        """Bytes of all mips, layers and samples by formula; a driver may pad."""
        texels = sum(math.prod(self.mip_size(mip)) * self.mip_layers(mip) for mip in range(self.mips))
        return texels * self.samples * FORMATS[self.format].bytes

    def mip_size(self, mip: int) -> tuple[int, int]:
        """Return width and height of one level."""
        return max(1, self.width >> mip), max(1, self.height >> mip)

    def mip_layers(self, mip: int) -> int:
        """Return the layers of one level, or its depth."""
        return max(1, self.layers >> mip) if self.kind == "texture3d" else self.layers

    def lacks(self, mip: int | None, layer: int | None) -> str | None:
        """Return the mip or layer that does not exist, as the end of a sentence that names the texture, or None."""
        for name, number, count in (("mip", mip, self.mips), ("layer", layer, self.mip_layers(mip or 0))):
            if number is not None and number >= count:
                return f"has no {name} {number}; it has {f'0 to {count - 1}' if count > 1 else 'only 0'}"
        return None

    @property
    def storage_class(self) -> tuple[object, ...]:
        """A key that is equal for textures that can share storage through views: texel class, size, mips and so on."""
        shape = self.kind, self.width, self.height, self.layers, self.mips, self.samples
        return FORMATS[self.format].view_class, *shape


_STD430 = {  # GLSL type: NumPy type of a component, shape, alignment in components (OpenGL 4.5, section 7.6.2.2)
    f"{prefix}{shape or scalar}": (kind, size, align)
    for prefix, scalar, kind in (("", "float", "<f4"), ("i", "nt", "<i4"), ("u", "int", "<u4"))
    for shape, size, align in (("", (), 1), ("vec2", (2,), 2), ("vec3", (3,), 4), ("vec4", (4,), 4))
} | {"mat4": ("<f4", (4, 4), 4)}


class Layout(Struct, frozen=True, eq=False):
    """The elements of a buffer, the same in GLSL and in NumPy: `Layout("Spark", {"position": "vec3", "age": "float"})`.

    Shaders that use the buffer may use the struct of that name. Matrices are arrays of columns.

    Attributes:
        name: the name of the struct.
        fields: field to GLSL type: `float`, `int` or `uint`, their vectors, or `mat4`.
    """

    name: str
    fields: Mapping[str, str]

    def __post_init__(self) -> None:
        names = [self.name, *self.fields] if isinstance(self.fields, Mapping) else []
        if len(names) < 2 or not all(isinstance(name, str) and name.isidentifier() for name in names):
            raise TypeError(f"Layout({self.name!r}, {self.fields!r}) is not like Layout('Spark', {{'age': 'float'}})")
        if wrong := [f"{kind} {name}" for name, kind in self.fields.items() if kind not in _STD430]:
            raise TypeError(f"Layout '{self.name}' cannot hold {wrong}; available: {', '.join(_STD430)}")

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Layout) and self.glsl == other.glsl  # the order of fields matters

    def __hash__(self) -> int:
        return hash(self.name)

    @property
    def dtype(self) -> AnyType:
        """The structured `numpy.dtype` of an array of elements, with the padding of std430."""
        import numpy as np  # not needed to list nodes

        names, formats, offsets, at, most = list(self.fields), [], [], 0, 4
        for kind, shape, align in (_STD430[kind] for kind in self.fields.values()):
            at, most = -(-at // (4 * align)) * 4 * align, max(most, 4 * align)
            formats.append((kind, shape))
            offsets.append(at)
            at += 4 * math.prod(shape)
        total = -(-at // most) * most
        return np.dtype({"names": names, "formats": formats, "offsets": offsets, "itemsize": total})

    @property
    def glsl(self) -> str:
        """The definition of the struct."""
        return f"struct {self.name} {{ {' '.join(f'{kind} {name};' for name, kind in self.fields.items())} }};"


class BufferDesc(Struct, frozen=True):
    """A buffer of `bytes` bytes, with elements if its port declares them."""

    bytes: int
    element: Layout | None = None


def full_mip_count(width: int, height: int, depth: int = 1) -> int:
    """Return the number of mip levels down to a single texel."""
    return max(width, height, depth).bit_length()
