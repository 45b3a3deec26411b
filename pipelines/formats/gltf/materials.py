"""Images, samplers, textures and materials of a glTF file."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal, TypeAlias

from msgspec.structs import asdict, replace
from rendergraph.pipelines.formats.gltf import schema
from rendergraph.pipelines.formats.gltf.buffers import Buffers, uri_bytes
from rendergraph.pipelines.formats.gltf.schema import Gltf, TextureInfo, check_index

from rendergraph.scene.model import ImageSource, Material, Texture, Vec3
from rendergraph.scene.reading import Reading, UniqueNames

Wrap: TypeAlias = Literal["repeat", "mirror", "clamp"]
_WRAPS: Mapping[int, Wrap] = {10497: "repeat", 33648: "mirror", 33071: "clamp"}
_MAG_FILTERS: Mapping[int, Literal["nearest", "linear"]] = {9728: "nearest", 9729: "linear"}
_MIN_FILTERS = {
    9728: "nearest",
    9729: "linear",
    9984: "nearest_mipmap_nearest",
    9985: "linear_mipmap_nearest",
    9986: "nearest_mipmap_linear",
    9987: "linear_mipmap_linear",
}
_OTHER_IMAGES = ("KHR_texture_basisu", "EXT_texture_webp", "EXT_texture_avif", "MSFT_texture_dds")
_IDENTITY = (1, 0, 0, 0, 1, 0)
_NONE = asdict(schema.Layer())
_UNITS = [key for key in _NONE if key.endswith("_factor") and key not in ("sheen_color_factor", "thickness_factor")]


class Materials:
    """Every material of a file, with its images checked; `default` is glTF's for primitives without one."""

    def __init__(self, gltf: Gltf, buffers: Buffers, reading: Reading) -> None:
        self._gltf, self._reading, self._buffers = gltf, reading, buffers
        self._embedded: dict[int, ImageSource] = {}
        self._images = [self._image(image, f"images[{number}]") for number, image in enumerate(gltf.images)]
        for number, texture in enumerate(gltf.textures):
            self._check_texture(texture, f"textures[{number}]")
        names = UniqueNames()
        self.materials = [
            self._material(material, f"materials[{number}]", names) for number, material in enumerate(gltf.materials)
        ]
        self.default = Material(names.unique("default", "default"), metallic=1.0)

    def _image(self, image: schema.Image, where: str) -> ImageSource:
        view = image.buffer_view
        if (image.uri is None) == (view < 0):
            raise self._reading.error("RG304", f"{where} needs either 'uri' or 'bufferView'")
        if image.uri is None:
            if view not in self._embedded:
                data = self._buffers.view_bytes(view, where)
                self._embedded[view] = self._reading.embedded_image(data, where)
            return self._embedded[view]
        content = uri_bytes(image.uri, where, self._reading)
        if isinstance(content, Path):
            return self._reading.image(content, "image")
        return self._reading.embedded_image(content, where)

    def _check_texture(self, texture: schema.Texture, where: str) -> None:
        check_index(self._reading, texture.sampler, self._gltf.samplers, f"{where}.sampler", "samplers")
        check_index(self._reading, texture.source, self._images, f"{where}.source", "images")
        for name in _OTHER_IMAGES:
            if texture.source < 0 and name in texture.extensions:
                self._reading.warn("RG333", name, f"textures of {name} are left out; that format is not read")

    def _texture(self, info: TextureInfo, where: str, srgb: bool) -> Texture | None:
        check_index(self._reading, info.index, self._gltf.textures, f"{where}.index", "textures")
        uv, transform = info.tex_coord, None
        if (moved := info.extensions.transform) is not None:
            uv = moved.tex_coord if moved.tex_coord >= 0 else uv
            (sx, sy), (ox, oy) = moved.scale, moved.offset
            c, s = math.cos(moved.rotation), math.sin(moved.rotation)
            transform = (c * sx, s * sy, ox, -s * sx, c * sy, oy)
        if uv > 1:
            self._reading.warn("RG333", "uv-set", f"{where} uses UV set {uv}; set 0 is used, only two are read")
            uv = 0
        texture = self._gltf.textures[info.index]
        if texture.source < 0:
            return None
        sampler = self._gltf.samplers[texture.sampler] if texture.sampler >= 0 else schema.Sampler()
        return Texture(
            self._images[texture.source],
            srgb,
            _WRAPS[sampler.wrap_s],
            _WRAPS[sampler.wrap_t],
            _MAG_FILTERS[sampler.mag_filter],
            _MIN_FILTERS[sampler.min_filter],
            uv,
            None if transform == _IDENTITY else transform,
        )

    def _material(self, material: schema.Material, where: str, names: UniqueNames) -> Material:
        def clamped(key: str, value: float, high: float = 1.0) -> float:
            if not 0 <= value <= high:
                text = f"{where}: '{key}' is {value:g}, outside 0 to {high:g}; it is clamped"
                self._reading.warn("RG332", "range", text)
            return min(max(value, 0.0), high)

        def clamped_color(key: str, color: Vec3, high: float = 1.0) -> Vec3:
            red, green, blue = (clamped(key, value, high) for value in color)
            return red, green, blue

        pbr, extensions = material.pbr_metallic_roughness, material.extensions
        specular, anisotropy = extensions.specular, extensions.anisotropy
        layers = schema.Layer()
        for name in ("clearcoat", "sheen", "iridescence", "transmission", "volume", "dispersion"):
            given = asdict(getattr(extensions, name)).items()
            layers = replace(layers, **{key: value for key, value in given if value != _NONE[key]})
        textures: dict[str, Texture] = {}
        for slot, key, info in (
            ("base_color", "baseColorTexture", pbr.base_color_texture),
            ("metallic_roughness", "metallicRoughnessTexture", pbr.metallic_roughness_texture),
            ("normal", "normalTexture", material.normal_texture),
            ("occlusion", "occlusionTexture", material.occlusion_texture),
            ("emissive", "emissiveTexture", material.emissive_texture),
            ("specular", "specularTexture", specular.specular_texture),
            ("specular_color", "specularColorTexture", specular.specular_color_texture),
            ("anisotropy", "anisotropyTexture", anisotropy.anisotropy_texture),
            *((k[:-8], k, getattr(layers, k)) for k in _NONE if k.endswith("_texture")),
        ):
            srgb = slot in ("base_color", "emissive", "specular_color", "sheen_color")
            if info is not None and (texture := self._texture(info, f"{where}.{key}", srgb)) is not None:
                textures[slot] = texture
        red, green, blue, alpha = pbr.base_color_factor
        strength, ior = max(0.0, extensions.emissive.emissive_strength), extensions.ior.ior
        r, g, b = clamped_color("emissiveFactor", material.emissive_factor)
        mode = material.alpha_mode
        units: dict[str, Any] = {key[:-7]: clamped(key, getattr(layers, key)) for key in _UNITS}
        return Material(
            name=names.unique(material.name, "material"),
            base_color=(
                *clamped_color("baseColorFactor", (red, green, blue)),
                clamped("baseColorFactor", alpha),
            ),
            metallic=clamped("metallicFactor", pbr.metallic_factor),
            roughness=clamped("roughnessFactor", pbr.roughness_factor),
            emissive=(r * strength, g * strength, b * strength),
            occlusion_strength=clamped(
                "strength", material.occlusion_texture.strength if material.occlusion_texture else 1.0
            ),
            normal_scale=material.normal_texture.scale if material.normal_texture else 1.0,
            alpha_mode="mask" if mode == "MASK" else "blend" if mode == "BLEND" else "opaque",
            alpha_cutoff=max(0.0, material.alpha_cutoff),
            double_sided=material.double_sided,
            unlit=extensions.unlit is not None,
            ior=1.0 if 0 < ior < 1 else max(0.0, ior),
            specular=clamped("specularFactor", specular.specular_factor),
            specular_color=clamped_color("specularColorFactor", specular.specular_color_factor, math.inf),
            anisotropy_strength=clamped("anisotropyStrength", anisotropy.anisotropy_strength),
            anisotropy_rotation=anisotropy.anisotropy_rotation,
            clearcoat_normal_scale=layers.clearcoat_normal_texture.scale if layers.clearcoat_normal_texture else 1.0,
            iridescence_ior=max(1.0, layers.iridescence_ior),
            iridescence_thickness=(layers.iridescence_thickness_minimum, layers.iridescence_thickness_maximum),
            attenuation_distance=layers.attenuation_distance or math.inf,
            attenuation_color=clamped_color("attenuationColor", layers.attenuation_color),
            sheen_color=clamped_color("sheenColorFactor", layers.sheen_color_factor),
            thickness=max(0.0, layers.thickness_factor),
            dispersion=max(0.0, layers.dispersion),
            **units,
            textures=textures,
        )
