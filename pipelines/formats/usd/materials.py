"""UsdPreviewSurface as materials; other surfaces have the default one, in the mesh's display colour.

Names and meanings are those of the UsdPreviewSurface specification (Pixar). Its textures are glTF's but for their
coordinates, whose origin is at the lower left.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, Literal

import numpy as np
from msgspec import Struct
from pxr import Ar, UsdShade

from rendergraph.document import shown
from rendergraph.errors import InputError
from rendergraph.scene.model import Material, Texture, Vec3
from rendergraph.scene.reading import Reading
from rendergraph.scene.scene_values import dielectric_f0

Wrap = Literal["repeat", "mirror", "clamp"]
_WRAPS: dict[str, Wrap] = {"mirror": "mirror", "clamp": "clamp", "black": "clamp"}
_DEFAULT_COORDINATES = "st"
_TEXTURED = {
    **{"diffuseColor": "base_color", "emissiveColor": "emissive", "normal": "normal", "occlusion": "occlusion"},
    **dict.fromkeys(("opacity", "metallic", "roughness"), ""),
}
"""Inputs that may be textures, and the slots of those that are textures of their own."""
_FLIP = np.array([[1.0, 0, 0], [0, -1, 1], [0, 0, 1]])


class _Image(Struct, frozen=True):
    """A texture that an input is connected to: the channel it takes, and the primvar of its coordinates."""

    texture: Texture
    channel: str
    scale: tuple[float, float, float, float]
    coordinates: str


class Materials:
    """The materials of a stage, each made once."""

    def __init__(self, reading: Reading, time: Any) -> None:
        self.reading, self.time = reading, time
        self.made: list[Material] = []
        self._numbers: dict[tuple[str, bool], int] = {}

    def of(self, prim: Any) -> Any:
        """Return the surface shader that a prim has; None if it is no UsdPreviewSurface."""
        material = self._bound(prim)
        if not material:
            return None
        shader, *_ = material.ComputeSurfaceSource()
        if not shader or shader.GetIdAttr().Get() != "UsdPreviewSurface":
            text = f"material '{shown(material.GetPrim().GetName())}' is no UsdPreviewSurface; it is the default one"
            self.reading.warn("RG330", "surface", text)
            return None
        return shader

    def coordinates(self, prim: Any) -> str:
        """Return the primvar that a prim's textures take their coordinates from."""
        shader = self.of(prim)
        inputs = shader.GetInputs() if shader else ()
        images = (self._connected(shader, one.GetBaseName()) for one in inputs)
        return next((self._primvar(image) for image in images if image is not None), _DEFAULT_COORDINATES)

    def number(self, prim: Any, *, is_double_sided: bool, is_tinted: bool) -> int:
        """Return the number of a prim's material."""
        shader, material = self.of(prim), self._bound(prim)
        key = (str(material.GetPath()) if shader else f"default {is_tinted}"), is_double_sided
        if key not in self._numbers:
            self._numbers[key] = len(self.made)
            gray = (1.0, 1.0, 1.0, 1.0) if is_tinted else (0.8, 0.8, 0.8, 1.0)
            plain = Material("default", gray, roughness=0.5, double_sided=is_double_sided)
            name = material.GetPrim().GetName() if shader else ""
            self.made.append(self._surface(shader, name, is_double_sided) if shader else plain)
        return self._numbers[key]

    def _bound(self, prim: Any) -> Any:
        return UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial()[0]

    def _surface(self, shader: Any, name: str, is_double_sided: bool) -> Material:
        def number(key: str, default: float) -> float:
            return float(self._value(shader, key, default))

        def color(key: str, default: float) -> Vec3:
            r, g, b = (max(0.0, float(value)) for value in self._value(shader, key, (default,) * 3))
            return r, g, b

        keys = (
            "diffuseColor",
            "emissiveColor",
            "normal",
            "occlusion",
            "opacity",
            "metallic",
            "roughness",
            "specularColor",
        )
        images = {key: image for key in keys if (image := self._image(shader, key)) is not None}
        textures = {slot: images[key].texture for key, slot in _TEXTURED.items() if slot and key in images}
        has_image = self._metallic_roughness(images, textures)
        base, light = (
            images[key].scale[:3] if key in images else color(key, default)
            for key, default in (("diffuseColor", 0.18), ("emissiveColor", 0.0))
        )
        opacity, cutoff = 1.0 if "opacity" in images else number("opacity", 1.0), number("opacityThreshold", 0.0)
        mode: Literal["opaque", "mask", "blend"] = "opaque"
        if "opacity" in images or opacity < 1:
            mode = "mask" if cutoff > 0 else "blend"
        if "opacity" in images and images["opacity"].texture.image != getattr(
            textures.get("base_color"), "image", None
        ):
            self.reading.warn(
                "RG333", "opacity", "the texture of 'opacity' is left out; only the base colour's alpha is read"
            )
        is_specular = int(self._value(shader, "useSpecularWorkflow", 0)) == 1
        f0 = dielectric_f0(1.5)
        tint = color("specularColor", 0.0) if is_specular else (f0, f0, f0)
        return Material(
            name,
            (*base, opacity),
            metallic=0.0 if is_specular else 1.0 if "metallic" in has_image else _clamped(number("metallic", 0.0)),
            roughness=1.0 if "roughness" in has_image else _clamped(number("roughness", 0.5)),
            emissive=light,
            alpha_mode=mode,
            alpha_cutoff=_clamped(cutoff) or 0.5,
            double_sided=is_double_sided,
            ior=max(1.0, number("ior", 1.5)),
            specular_color=(tint[0] / f0, tint[1] / f0, tint[2] / f0),
            clearcoat=_clamped(number("clearcoat", 0.0)),
            clearcoat_roughness=_clamped(number("clearcoatRoughness", 0.01)),
            textures=textures,
        )

    def _metallic_roughness(self, images: dict[str, _Image], textures: dict[str, Texture]) -> set[str]:
        """Set the slot of metallic in blue and roughness in green, and return which of them it has."""
        metallic, rough = images.get("metallic"), images.get("roughness")
        if rough is not None and metallic is not None and rough.texture == metallic.texture:
            textures["metallic_roughness"] = rough.texture
            return {"metallic", "roughness"}
        if rough is not None and metallic is None:
            textures["metallic_roughness"] = rough.texture  # whatever is in blue is scaled by a metallic of 0
            return {"roughness"}
        if metallic is not None:
            text = "the textures of 'metallic' and 'roughness' are left out unless both are green and blue of one image"
            self.reading.warn("RG333", "metallic", text)
        return set()

    # --- inputs of shaders --------------------------------------------------------------------------------------------

    def _value(self, shader: Any, key: str, default: Any) -> Any:
        """Return an input's value, through the interfaces that it is connected to."""
        found = shader.GetInput(key)
        for attribute in found.GetValueProducingAttributes() if found else ():
            if UsdShade.Utils.GetType(attribute.GetName()) == UsdShade.AttributeType.Input:
                value = attribute.Get(self.time)
                return default if value is None else value
        return default

    def _connected(self, shader: Any, key: str) -> tuple[Any, str] | None:
        """Return the shader that an input is connected to, and the name of its output."""
        found = shader.GetInput(key)
        for attribute in found.GetValueProducingAttributes() if found else ():
            if UsdShade.Utils.GetType(attribute.GetName()) == UsdShade.AttributeType.Output:
                return UsdShade.Shader(attribute.GetPrim()), attribute.GetName().rpartition(":")[2]
        return None

    def _image(self, shader: Any, key: str) -> _Image | None:
        """Return the texture that an input is connected to; one that cannot be read is left out."""
        connected = self._connected(shader, key)
        if connected is None:
            return None
        node, channel = connected
        asset = self._value(node, "file", None) if node.GetIdAttr().Get() == "UsdUVTexture" else None
        if asset is None:
            self.reading.warn("RG333", f"input {key}", f"what '{key}' is connected to is no texture; it is left out")
            return None
        try:
            image = self._source(asset, key)
        except InputError as error:
            if error.problems[0].code in ("RG302", "RG353"):
                raise
            self.reading.warn("RG330", f"texture {asset.path}", f"{error.problems[0].text}; it is left out")
            return None
        wrap_s, wrap_t = (_WRAPS.get(str(self._value(node, wrap, "")), "repeat") for wrap in ("wrapS", "wrapT"))
        space = str(self._value(node, "sourceColorSpace", "auto"))
        is_srgb = key in ("diffuseColor", "emissiveColor", "specularColor") if space == "auto" else space == "sRGB"
        scale = tuple(float(value) for value in self._value(node, "scale", (1.0,) * 4))
        texture = Texture(image, is_srgb, wrap_s, wrap_t, transform=self._transform(node))
        return _Image(texture, channel, scale, self._primvar((node, channel)))  # type: ignore[arg-type]  # four numbers

    def _source(self, asset: Any, key: str) -> Any:
        """Return the image of a file, or of a file within a package."""
        resolved = asset.resolvedPath or asset.path
        if not Ar.IsPackageRelativePath(resolved):
            return self.reading.image(self.reading.resolve(resolved), f"texture of '{key}'")
        package, _ = Ar.SplitPackageRelativePathOuter(resolved)
        self.reading.check_file(self.reading.resolve(package), "package")
        opened = Ar.GetResolver().OpenAsset(Ar.ResolvedPath(resolved))
        if not opened:
            raise self.reading.error("RG350", f"the package has no image '{shown(asset.path)}'")
        return self.reading.embedded_image(bytes(opened.GetBuffer()), f"image '{shown(Path(asset.path).name)}'")

    def _primvar(self, connected: tuple[Any, str]) -> str:
        """Return the primvar that a texture's coordinates come from, behind any transforms."""
        node = connected[0]
        for key in ("st", "in"):
            behind = self._connected(node, key)
            if behind is not None:
                return self._primvar(behind)
        name = self._value(node, "varname", None)
        return str(name) if name else _DEFAULT_COORDINATES

    def _transform(self, node: Any) -> tuple[float, float, float, float, float, float] | None:
        """Return the transform of a texture's coordinates, between origins at the upper left."""
        behind = self._connected(node, "st")
        if behind is None or behind[0].GetIdAttr().Get() != "UsdTransform2d":
            return None
        place = behind[0]
        angle = np.radians(float(self._value(place, "rotation", 0.0)))
        (su, sv), (tu, tv) = self._value(place, "scale", (1.0, 1.0)), self._value(place, "translation", (0.0, 0.0))
        c, s = np.cos(angle), np.sin(angle)
        matrix = _FLIP @ np.array([[c * su, -s * sv, tu], [s * su, c * sv, tv], [0, 0, 1]]) @ _FLIP
        a, b, x, d, e, y = matrix[:2].reshape(-1).tolist()
        return a, b, x, d, e, y


def _clamped(value: float) -> float:
    return min(max(value, 0.0), 1.0)
