"""Surfaces for Mitsuba, by the formulas of glTF 2.0; imported in the process with Mitsuba alone.

Methods run once, with arrays of rays (variant `llvm_ad_rgb`). All meshes have the same kind of surface, which gathers
its values from tables: of separate materials Mitsuba would compile each, and rays of one would wait for the others'.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import SimpleNamespace
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

_LEAST_ALPHA = 1e-3
_SAME_DIRECTION = 1e-6
"""Squared difference of unit vectors, above rounding; a thousandth of a radian of light from all sides is nothing."""
_MIRROR, _CLAMP, _OPAQUE, _MASK = 1, 2, 0, 1


class Images:
    """Pictures one after the other, four half floats a texel."""

    def __init__(self, pictures: list[Any]) -> None:
        sizes = [picture.shape[:2] for picture in pictures]
        starts = np.cumsum([0, *(height * width for height, width in sizes)])
        records = [[start, width, height, 0] for start, (height, width) in zip(starts, sizes, strict=False)]
        self.records = mi.UInt32(np.array(records, np.uint32).ravel())
        self.texels = dr.llvm.ad.Float16(np.concatenate([np.zeros(0, np.float16), *map(np.ravel, pictures)]))

    def at(self, image: Any, uv: Any, wrap: tuple[Any, Any], nearest: Any, active: Any) -> Any:
        """Return the four channels, linear between texels, at coordinates from the upper left corner."""
        start, width, height, _ = dr.gather(mi.Vector4u, self.records, image, active)
        ends, weights = [], []
        for at, size, mode in zip((uv.x, uv.y), (width, height), wrap, strict=True):
            place = at * mi.Float(size) - dr.select(nearest, 0.0, 0.5)
            low = dr.floor(place)
            weights.append(dr.select(nearest, 0.0, place - low))
            ends.append([_wrapped(mi.Int32(low) + step, mi.Int32(size), mode) for step in (0, 1)])
        total = mi.Vector4f(0)
        for x, across in zip(ends[0], (1 - weights[0], weights[0]), strict=True):
            for y, down in zip(ends[1], (1 - weights[1], weights[1]), strict=True):
                number = start + mi.UInt32(y) * width + mi.UInt32(x)
                texel = dr.gather(dr.llvm.ad.Array4f16, self.texels, number, active)
                total += mi.Vector4f(texel) * (across * down)
        return total


def _wrapped(texel: Any, size: Any, mode: Any) -> Any:
    """Return the number of the texel that stands for one beyond the picture."""
    period = dr.select(mode == _MIRROR, 2 * size, size)
    repeated = texel - period * mi.Int32(dr.floor(mi.Float(texel) / mi.Float(period)))
    repeated = dr.select(repeated < size, repeated, period - 1 - repeated)
    return dr.clip(dr.select(mode == _CLAMP, texel, repeated), 0, size - 1)


class Tables:
    """The scene's arrays, and what they say of a point of a triangle."""

    def __init__(self, arrays: Mapping[str, Any]) -> None:
        names = [name for name in arrays if name.startswith(("vertex.", "material.", "slot."))]
        self.rows = {name: mi.Float(np.asarray(arrays[name], np.float32).ravel()) for name in names}
        self.corners, self.flags = mi.UInt32(arrays["corners"].ravel()), mi.UInt32(arrays["flags"].ravel())
        self.lets_light_through = not arrays["flags"][:, 3].all()
        self.passes_light = self.lets_light_through or bool(arrays["flags"][:, 1].any())
        grain = bool((arrays["material.extra"][:, 1] > 0).any())
        self.has_tangents = grain or not {"slot.normal", "slot.anisotropy"}.isdisjoint(names)
        count = sum(name.startswith("image.") for name in arrays)
        self.images = Images([arrays[f"image.{number}"] for number in range(count)])

    def row(self, name: str, number: Any, active: Any) -> Any:
        return dr.gather(mi.Vector4f, self.rows[name], number, active)

    def texel(self, slot: str, material: Any, uvs: Any, active: Any, default: Any = (1, 1, 1, 1)) -> Any:
        """Return a texture's four channels; the default for materials without."""
        if f"slot.{slot}" not in self.rows:
            return mi.Vector4f(*default)
        first, second, u, v = (self.row(f"slot.{slot}", 4 * material + part, active) for part in range(4))
        active = active & (first.x > 0)
        uv = dr.select(second.y > 0, uvs.zw, uvs.xy)
        moved = mi.Point2f(dr.dot(u.xy, uv) + u.z, dr.dot(v.xy, uv) + v.z)
        wrap = mi.UInt32(first.z), mi.UInt32(first.w)
        texel = self.images.at(mi.UInt32(first.y), moved, wrap, second.x > 0, active)
        return dr.select(active, texel, mi.Vector4f(*default))

    def face(self, si: Any, first_face: Any, active: Any) -> Any:
        """Return a triangle's material, mode of alpha, and whether it is double-sided and casts a shadow."""
        return dr.gather(mi.Vector4u, self.flags, first_face + si.prim_index, active)

    def point(self, si: Any, first_face: Any, active: Any) -> SimpleNamespace:
        """Return the triangle, the weights of its corners, and the material with its base colour and opacity there."""
        p = SimpleNamespace()
        p.material, mode, p.double_sided, p.casts_shadow = self.face(si, first_face, active)
        p.vertices = dr.gather(mi.Vector3u, self.corners, first_face + si.prim_index, active)
        p.corners = [self.row("vertex.position", vertex, active).xyz for vertex in p.vertices]
        p.edges = p.corners[1] - p.corners[0], p.corners[2] - p.corners[0]
        p.area, offset = dr.cross(*p.edges), si.p - p.corners[0]
        scale = dr.rcp(dr.maximum(dr.squared_norm(p.area), 1e-37))
        second = dr.dot(dr.cross(offset, p.edges[1]), p.area) * scale
        third = dr.dot(dr.cross(p.edges[0], offset), p.area) * scale
        p.weights = 1 - second - third, second, third
        p.uvs = self.mean("uv", p, active)
        p.base = self.row("material.base_color", p.material, active)
        p.base *= self.texel("base_color", p.material, p.uvs, active)
        if "vertex.color" in self.rows:
            p.base *= self.mean("color", p, active)
        masked = dr.select(p.base.w >= self.row("material.emissive", p.material, active).w, 1.0, 0.0)
        p.alpha = dr.select(mode == _OPAQUE, 1.0, dr.select(mode == _MASK, masked, p.base.w))
        return p

    def mean(self, stream: str, p: SimpleNamespace, active: Any) -> Any:
        a, b, c = (self.row(f"vertex.{stream}", vertex, active) for vertex in p.vertices)
        return a * p.weights[0] + b * p.weights[1] + c * p.weights[2]

    def tangents(self, p: SimpleNamespace, normal: Any, active: Any) -> tuple[Any, Any]:
        """Return tangent and bitangent: the mesh's own, or from gradients of texture coordinates (Schueler 2013)."""
        other, tangent = mi.coordinate_system(normal)
        frame = [tangent, other]
        uv_set = self.row("slot.normal", 4 * p.material + 1, active).y if "slot.normal" in self.rows else 0
        corner_uvs = [self.row("vertex.uv", vertex, active) for vertex in p.vertices]
        uv = [dr.select(uv_set > 0, corner.zw, corner.xy) for corner in corner_uvs]
        across = dr.cross(p.edges[1], p.area), dr.cross(p.area, p.edges[0])
        derived = []
        for axis in (0, 1):
            gradient = across[0] * (uv[1][axis] - uv[0][axis]) + across[1] * (uv[2][axis] - uv[0][axis])
            derived.append(gradient * dr.dot(normal, p.area) - p.area * dr.dot(normal, gradient))
        squares = [dr.squared_norm(vector) for vector in derived]
        longest, shortest = dr.maximum(*squares), dr.minimum(*squares)
        usable = shortest > dr.maximum(1e-30, 1e-12 * longest)
        scale = dr.mulsign(dr.rsqrt(dr.maximum(longest, 1e-37)), dr.dot(normal, p.area))
        frame = [dr.select(usable, derived[0] * scale, frame[0]), dr.select(usable, -derived[1] * scale, frame[1])]
        if "vertex.tangent" in self.rows:
            own = self.mean("tangent", p, active)
            direction = dr.normalize(mi.Vector3f(own.xyz))
            frame[0] = dr.select(own.w != 0, direction, frame[0])
            frame[1] = dr.select(own.w != 0, dr.cross(normal, direction) * own.w, frame[1])
        return frame[0], frame[1]


class Surface(mi.BSDF):
    """glTF's metallic-roughness material: Lambert, and GGX with height-correlated Smith and Schlick's Fresnel.

    Args:
        first_face: the number of the mesh's first triangle in the tables.
        request: `shared`, whether the diffuse part is what the dielectric does not reflect (glTF 2.0, appendix B);
            `shadows`, whether a triangle hides from a point on it what is behind it, where normals may lean; `lights`.
    """

    def __init__(self, tables: Tables, first_face: int, request: Mapping[str, Any]) -> None:
        super().__init__(mi.Properties())
        self.tables, self.first_face = tables, dr.opaque(mi.UInt32, first_face)
        self.shared, self.shadows = request["shared"], request["shadows"]
        self.lights = request["lights"] if tables.lets_light_through else []
        self.camera = request["camera"]
        flags = mi.BSDFFlags.DiffuseReflection | mi.BSDFFlags.GlossyReflection
        flags |= mi.BSDFFlags.FrontSide | mi.BSDFFlags.BackSide
        flags |= mi.BSDFFlags.Null if tables.passes_light else flags
        self.m_components, self.m_flags = [flags], flags

    def to_string(self) -> str:
        return "Surface[]"

    def point(self, si: Any, active: Any) -> SimpleNamespace:
        """Return everything that reflection depends on."""
        tables, p = self.tables, self.tables.point(si, self.first_face, active)
        if tables.passes_light:
            p.alpha = dr.select(self.is_culled(p, si), 0, p.alpha)
        rows = (tables.row(f"material.{name}", p.material, active) for name in ("surface", "specular", "extra"))
        surface, specular, extra = rows
        slots = ("metallic_roughness", "specular", "specular_color", "anisotropy")
        rough, level, tint, grain = (tables.texel(slot, p.material, p.uvs, active) for slot in slots)
        metallic, roughness, base = surface.x * rough.z, surface.y * rough.y, mi.Color3f(p.base.xyz)
        p.dielectric_f90 = specular.w * level.w
        p.dielectric_f0 = mi.Color3f(dr.minimum(extra.x * specular.xyz * tint.xyz, 1) * p.dielectric_f90)
        p.f0, p.f90 = dr.lerp(p.dielectric_f0, base, metallic), dr.lerp(p.dielectric_f90, 1, metallic)
        p.diffuse = base * (1 - metallic)
        p.alpha_b = dr.maximum(dr.square(roughness), _LEAST_ALPHA)
        p.alpha_t = dr.lerp(p.alpha_b, 1, dr.square(extra.y * grain.z))
        p.frame = self.frame(p, si, surface.w, extra.z, grain, active)
        p.view = p.frame.to_local(si.to_world(si.wi))
        # A shading normal may lean away from the viewer; visible microfacets are then those seen from its horizon.
        p.upper = dr.normalize(mi.Vector3f(p.view.x, p.view.y, dr.maximum(p.view.z, 1e-4)))
        p.lobe = mi.MicrofacetDistribution(mi.MicrofacetType.GGX, p.alpha_t, p.alpha_b, True)
        glossy, diffuse = mi.luminance(p.f0 + (p.f90 - p.f0) * (1 - p.upper.z) ** 5), mi.luminance(p.diffuse)
        p.share = dr.clip(glossy / dr.maximum(glossy + diffuse, 1e-6), 0.1, 0.9)  # never 1: no direction is lost
        return p

    def is_culled(self, p: SimpleNamespace, si: Any) -> Any:
        """Return whether a ray of the camera meets a back that it does not see, behind something transparent."""
        along = mi.Vector3f(*self.camera["direction"][0])
        if not np.any(self.camera["origin"][1:]):  # all rays come from the eye
            along = si.p - mi.Point3f(*self.camera["origin"][0])
        is_camera = dr.squared_norm(dr.normalize(along) + si.to_world(si.wi)) < _SAME_DIRECTION
        return is_camera & (si.wi.z < 0) & (p.double_sided == 0)

    def frame(self, p: SimpleNamespace, si: Any, scale: Any, angle: Any, grain: Any, active: Any) -> Any:
        """Return the shading frame in world space: x along the grain, z the normal on the viewer's side."""
        tables, normal = self.tables, dr.normalize(mi.Vector3f(self.tables.mean("normal", p, active).xyz))
        if not tables.has_tangents:
            return mi.Frame3f(dr.select(si.wi.z >= 0, normal, -normal))  # si.wi is relative to the triangle
        tangent, bitangent = tables.tangents(p, normal, active)
        texel = 2 * tables.texel("normal", p.material, p.uvs, active, (0.5, 0.5, 1, 1)) - 1
        bent = dr.normalize(tangent * (texel.x * scale) + bitangent * (texel.y * scale) + normal * texel.z)
        x, y = dr.cos(angle), dr.sin(angle)
        if "slot.anisotropy" in tables.rows:
            textured = tables.row("slot.anisotropy", 4 * p.material, active).x > 0
            u, v = dr.select(textured, 2 * grain.x - 1, 1), dr.select(textured, 2 * grain.y - 1, 0)
            x, y = x * u - y * v, y * u + x * v
        along = dr.normalize(tangent) * x + dr.normalize(bitangent) * y
        along = dr.normalize(along - bent * dr.dot(along, bent))
        bent = dr.select(si.wi.z >= 0, bent, -bent)
        return mi.Frame3f(along, dr.cross(bent, along), bent)

    def reflect(self, p: SimpleNamespace, si: Any, wo: Any, active: Any) -> tuple[Any, Any]:
        """Return value × cosine and sampling density for a direction that light comes from."""
        light = p.frame.to_local(si.to_world(wo))
        active = active & (light.z > 0) & ((wo.z * si.wi.z > 0) | (not self.shadows))
        view, half = mi.Vector3f(p.view.x, p.view.y, dr.maximum(p.view.z, 1e-4)), dr.normalize(p.view + light)
        weight = (1 - dr.clip(dr.dot(p.view, half), 0, 1)) ** 5
        slope = mi.Vector3f(half.x / p.alpha_t, half.y / p.alpha_b, dr.maximum(half.z, 0))
        distribution = dr.rcp(dr.pi * p.alpha_t * p.alpha_b * dr.square(dr.squared_norm(slope)))
        stretch = mi.Vector3f(p.alpha_t, p.alpha_b, 1)
        visibility = 0.5 / (light.z * dr.norm(stretch * view) + view.z * dr.norm(stretch * light))
        value = p.diffuse * dr.inv_pi
        if self.shared:
            value *= 1 - dr.max(p.dielectric_f0 + (p.dielectric_f90 - p.dielectric_f0) * weight)
        value += (p.f0 + (p.f90 - p.f0) * weight) * (distribution * visibility)
        density = p.share * p.lobe.pdf(p.upper, half) / (4 * dr.dot(light, half))
        density += (1 - p.share) * mi.warp.square_to_cosine_hemisphere_pdf(light)
        return value * (light.z * p.alpha) & active, dr.select(active, density * p.alpha, 0)

    def sample(self, ctx: Any, si: Any, sample1: Any, sample2: Any, active: Any = True) -> tuple[Any, Any]:
        p = self.point(si, active)
        passes = sample1 >= p.alpha
        half, _ = p.lobe.sample(p.upper, sample2)
        is_glossy = sample1 < p.alpha * p.share
        light = dr.select(is_glossy, mi.reflect(p.view, half), mi.warp.square_to_cosine_hemisphere(sample2))
        wo = si.to_local(p.frame.to_world(light))
        value, density = self.reflect(p, si, wo, active)
        bs = mi.BSDFSample3f()
        bs.wo, bs.pdf = dr.select(passes, -si.wi, wo), dr.select(passes, 1 - p.alpha, density)
        bs.eta, bs.sampled_component = 1.0, 0
        kinds = mi.BSDFFlags.Null, mi.BSDFFlags.GlossyReflection
        bs.sampled_type = dr.select(passes, *(mi.UInt32(+kind) for kind in kinds))
        weight = dr.select(passes, mi.Color3f(1), value / dr.maximum(density, 1e-30))
        return bs, weight & (active & (passes | (density > 0)))

    def eval(self, ctx: Any, si: Any, wo: Any, active: Any = True) -> Any:
        return self.reflect(self.point(si, active), si, wo, active)[0]

    def pdf(self, ctx: Any, si: Any, wo: Any, active: Any = True) -> Any:
        return self.reflect(self.point(si, active), si, wo, active)[1]

    def eval_pdf(self, ctx: Any, si: Any, wo: Any, active: Any = True) -> tuple[Any, Any]:
        return self.reflect(self.point(si, active), si, wo, active)

    def eval_attribute_1(self, name: str, si: Any, active: Any = True) -> Any:
        """1 for triangles of single-sided materials, whatever the name."""
        return dr.select(self.tables.face(si, self.first_face, active).z > 0, 0.0, 1.0)

    def eval_null_transmission(self, si: Any, active: Any = True) -> Any:
        """Return what a shadow ray keeps: all of it where it goes to a punctual light and no shadow is cast.

        Mitsuba does not say which light a ray goes to, but no other light lies in exactly its direction.
        """
        p = self.tables.point(si, self.first_face, active)
        onwards, lets_through = -si.to_world(si.wi), mi.Bool(False)
        for light in self.lights:
            if light["type"] == "directional":
                to_light = mi.Vector3f(*(-value for value in light["direction"]))
            else:
                to_light = dr.normalize(mi.Point3f(*light["position"]) - si.p)
            lets_through |= dr.squared_norm(to_light - onwards) < _SAME_DIRECTION
        return mi.Color3f(dr.select((p.casts_shadow == 0) & lets_through, 1, 1 - p.alpha)) & active
