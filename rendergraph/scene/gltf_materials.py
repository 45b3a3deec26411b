"""Images, samplers, textures and materials of a glTF file."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Literal, TypeAlias

from rendergraph.scene.files import Reading, UniqueNames
from rendergraph.scene.gltf_buffers import Buffers, uri_bytes
from rendergraph.scene.gltf_json import JsonObject
from rendergraph.scene.model import ImageSource, Material, Texture, Vec3

Wrap: TypeAlias = Literal["repeat", "mirror", "clamp"]
_WRAPS: Mapping[int, Wrap] = {10497: "repeat", 33648: "mirror", 33071: "clamp"}
_MAG: Mapping[int, Literal["nearest", "linear"]] = {9728: "nearest", 9729: "linear"}
_MIN = {
    9728: "nearest",
    9729: "linear",
    9984: "nearest_mipmap_nearest",
    9985: "linear_mipmap_nearest",
    9986: "nearest_mipmap_linear",
    9987: "linear_mipmap_linear",
}
_OTHER_IMAGES = ("KHR_texture_basisu", "EXT_texture_webp", "EXT_texture_avif", "MSFT_texture_dds")


class Materials:
    """Every material of a file, with its images checked; `default` is glTF's for primitives without one."""

    def __init__(self, top: JsonObject, buffers: Buffers, reading: Reading) -> None:
        self._reading, self._buffers = reading, buffers
        self._embedded: dict[int, ImageSource] = {}
        self._images = [self._image(part) for part in top.parts("images")]
        self._samplers = [self._sampler(part) for part in top.parts("samplers")]
        self._textures = [self._texture(part) for part in top.parts("textures")]
        names = UniqueNames()
        self.materials = [self._material(part, names) for part in top.parts("materials")]
        self.default = Material(names.unique("default", "default"), metallic=1.0)

    def _image(self, part: JsonObject) -> ImageSource:
        view = part.index("bufferView", len(self._buffers.views), "buffer views")
        if part.has("uri") == (view is not None):
            raise part.wrong("needs either 'uri' or 'bufferView'")
        if view is not None:
            if view not in self._embedded:
                self._embedded[view] = self._reading.embedded_image(self._buffers.view_bytes(view), part.path)
            return self._embedded[view]
        found = uri_bytes(part.text("uri"), part, self._reading, "image")
        if isinstance(found, Path):
            return self._reading.image(found, "image")
        return self._reading.embedded_image(found, part.path)

    def _sampler(self, part: JsonObject) -> tuple[Wrap, Wrap, Literal["nearest", "linear"], str]:
        values = []
        for key, table, default in (
            ("wrapS", _WRAPS, 10497),
            ("wrapT", _WRAPS, 10497),
            ("magFilter", _MAG, 9729),
            ("minFilter", _MIN, 9987),
        ):
            number = part.integer(key, default)
            if number not in table:
                raise part.wrong(f"'{key}' is {number}, not one of {', '.join(map(str, table))}")
            values.append(number)
        return _WRAPS[values[0]], _WRAPS[values[1]], _MAG[values[2]], _MIN[values[3]]

    def _texture(self, part: JsonObject) -> tuple[ImageSource | None, int | None]:
        sampler = part.index("sampler", len(self._samplers), "samplers")
        source = part.index("source", len(self._images), "images")
        for name in _OTHER_IMAGES:
            if source is None and (other := part.extension(name)) is not None:
                other.index("source", len(self._images), "images")
                self._reading.warn("RG333", name, f"textures of {name} are left out; that format is not read")
        return None if source is None else self._images[source], sampler

    def _use(self, material: JsonObject, key: str, srgb: bool = False) -> tuple[JsonObject, Texture | None] | None:
        part = material.part(key)
        if part is None:
            return None
        index = part.index("index", len(self._textures), "textures")
        if index is None:
            raise part.wrong("'index' is missing")
        image, sampler = self._textures[index]
        uv, transform = part.integer("texCoord", 0), None
        moved = part.extension("KHR_texture_transform")
        if moved is not None:
            uv = moved.integer("texCoord", uv)
            angle, (sx, sy) = moved.number("rotation", 0.0), moved.numbers("scale", 2, (1, 1))
            ox, oy = moved.numbers("offset", 2, (0, 0))
            c, s = math.cos(angle), math.sin(angle)
            transform = (c * sx, s * sy, ox, -s * sx, c * sy, oy)
            if transform == (1, 0, 0, 0, 1, 0):
                transform = None
        if uv > 1:
            self._reading.warn("RG333", "uv-set", f"{part.path} uses UV set {uv}; set 0 is used, only two are kept")
            uv = 0
        if image is None:
            return part, None
        if sampler is None:
            return part, Texture(image, srgb, uv=uv, transform=transform)
        return part, Texture(image, srgb, *self._samplers[sampler], uv, transform)

    def _clamped(self, part: JsonObject, key: str, value: float, high: float = 1.0) -> float:
        if not 0 <= value <= high:
            self._reading.warn(
                "RG332", "range", f"{part.path}: '{key}' is {value:g}, outside 0 to {high:g}; it is clamped"
            )
        return min(max(value, 0.0), high)

    def _colors(
        self, part: JsonObject, key: str, count: int, default: tuple[float, ...], high: float = 1.0
    ) -> tuple[float, ...]:
        return tuple(self._clamped(part, key, value, high) for value in part.numbers(key, count, default))

    def _factor(self, part: JsonObject, key: str, default: float) -> float:
        return self._clamped(part, key, part.number(key, default), 1.0)

    def _material(self, part: JsonObject, names: UniqueNames) -> Material:
        textures: dict[str, Texture] = {}

        def use(holder: JsonObject, key: str, slot: str, srgb: bool = False) -> JsonObject | None:
            found = self._use(holder, key, srgb)
            if found is None:
                return None
            if found[1] is not None:
                textures[slot] = found[1]
            return found[0]

        nothing = JsonObject({}, part.path, part.fail)
        pbr = part.part("pbrMetallicRoughness") or nothing
        use(pbr, "baseColorTexture", "base_color", srgb=True)
        use(pbr, "metallicRoughnessTexture", "metallic_roughness")
        normal = use(part, "normalTexture", "normal") or nothing
        occlusion = use(part, "occlusionTexture", "occlusion") or nothing
        use(part, "emissiveTexture", "emissive", srgb=True)
        specular = part.extension("KHR_materials_specular") or nothing
        use(specular, "specularTexture", "specular")
        use(specular, "specularColorTexture", "specular_color", srgb=True)
        anisotropy = part.extension("KHR_materials_anisotropy") or nothing
        use(anisotropy, "anisotropyTexture", "anisotropy")
        strength = (part.extension("KHR_materials_emissive_strength") or nothing).number("emissiveStrength", 1.0)
        ior = (part.extension("KHR_materials_ior") or nothing).number("ior", 1.5)
        r, g, b, a = self._colors(pbr, "baseColorFactor", 4, (1, 1, 1, 1))
        emissive = tuple(v * max(0.0, strength) for v in self._colors(part, "emissiveFactor", 3, (0, 0, 0)))
        mode = part.choice("alphaMode", "OPAQUE", ("OPAQUE", "MASK", "BLEND"))
        return Material(
            name=names.unique(part.text("name"), "material"),
            base_color=(r, g, b, a),
            metallic=self._factor(pbr, "metallicFactor", 1.0),
            roughness=self._factor(pbr, "roughnessFactor", 1.0),
            emissive=_three(emissive),
            occlusion_strength=self._factor(occlusion, "strength", 1.0),
            normal_scale=normal.number("scale", 1.0),
            alpha_mode="mask" if mode == "MASK" else "blend" if mode == "BLEND" else "opaque",
            alpha_cutoff=max(0.0, part.number("alphaCutoff", 0.5)),
            double_sided=part.flag("doubleSided"),
            unlit=part.extension("KHR_materials_unlit") is not None,
            ior=1.0 if 0 < ior < 1 else max(0.0, ior),
            specular=self._factor(specular, "specularFactor", 1.0),
            specular_color=_three(self._colors(specular, "specularColorFactor", 3, (1, 1, 1), math.inf)),
            anisotropy_strength=self._factor(anisotropy, "anisotropyStrength", 0.0),
            anisotropy_rotation=anisotropy.number("anisotropyRotation", 0.0),
            textures=textures,
        )


def _three(values: tuple[float, ...]) -> Vec3:
    return values[0], values[1], values[2]
