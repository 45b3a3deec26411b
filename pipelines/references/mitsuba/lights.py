"""Lights for Mitsuba: emissive meshes, those of KHR_lights_punctual, and the environment."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from rendergraph.pipelines.references.mitsuba.surfaces import Tables

_FAR = 1e7


class Emission(mi.Emitter):
    """The light that a mesh of one emissive material sends out. Its coordinates are those of the emissive texture."""

    def __init__(self, tables: Tables, material: int, double_sided: bool) -> None:
        super().__init__(mi.Properties())
        self.tables, self.material, self.double_sided = tables, dr.opaque(mi.UInt32, material), double_sided
        self.m_flags = +mi.EmitterFlags.Surface

    def to_string(self) -> str:
        return "Emission[]"

    def radiance(self, uv: Any, front: Any, active: Any) -> Any:
        uvs = mi.Vector4f(uv.x, uv.y, uv.x, uv.y)
        texel = self.tables.texel("emissive", self.material, uvs, active)
        color = self.tables.row("material.emissive", self.material, active) * texel
        return mi.Color3f(color.xyz) & (active & (front | self.double_sided))

    def eval(self, si: Any, active: Any = True) -> Any:
        return self.radiance(si.uv, si.wi.z > 0, active)

    def sample_direction(self, it: Any, sample: Any, active: Any = True) -> tuple[Any, Any]:
        ds = self.get_shape().sample_direction(it, sample, active)
        ds.emitter = mi.EmitterPtr(self)
        light = self.radiance(ds.uv, dr.dot(ds.d, ds.n) < 0, active & (ds.pdf > 0))
        return ds, light / dr.maximum(ds.pdf, 1e-30)

    def pdf_direction(self, it: Any, ds: Any, active: Any = True) -> Any:
        return self.get_shape().pdf_direction(it, ds, active)


class Punctual(mi.Emitter):
    """A light of KHR_lights_punctual, with its window of range and its cone.

    Args:
        shadows: False lets the light through everything, as renderers without shadows do.
    """

    def __init__(self, values: Mapping[str, Any], shadows: bool) -> None:
        super().__init__(mi.Properties())
        self.values, self.shadows = values, shadows
        is_directional = values["type"] == "directional"
        self.m_flags = +(mi.EmitterFlags.DeltaDirection if is_directional else mi.EmitterFlags.DeltaPosition)

    def to_string(self) -> str:
        return f"Punctual[{self.values['name']}]"

    def sample_direction(self, it: Any, sample: Any, active: Any = True) -> tuple[Any, Any]:
        values, ds = self.values, dr.zeros(mi.DirectionSample3f)
        irradiance = mi.Color3f(*values["color"]) * values["intensity"]
        if values["type"] == "directional":
            ds.d, distance = mi.Vector3f(*(-value for value in values["direction"])), mi.Float(_FAR)
        else:
            offset = mi.Point3f(*values["position"]) - it.p
            distance = dr.maximum(dr.norm(offset), 1e-6)
            ds.d = offset / distance
            irradiance /= dr.square(distance)
            if values["range"]:
                irradiance *= dr.clip(1 - (distance / values["range"]) ** 4, 0, 1)
        if values["type"] == "spot":
            inner, outer = np.cos(values["inner"]), np.cos(values["outer"])
            cosine = -dr.dot(ds.d, mi.Vector3f(*values["direction"]))
            irradiance *= dr.square(dr.clip((cosine - outer) / max(0.001, inner - outer), 0, 1))
        ds.dist = distance if self.shadows else 1e-3 * (1 + dr.max(dr.abs(it.p)))
        ds.p, ds.time, ds.pdf, ds.delta = it.p + ds.d * ds.dist, it.time, 1.0, True
        ds.emitter = mi.EmitterPtr(self)
        return ds, irradiance & active

    def pdf_direction(self, it: Any, ds: Any, active: Any = True) -> Any:
        return mi.Float(0)

    def eval(self, si: Any, active: Any = True) -> Any:
        return mi.Color3f(0)


def environment(picture: Any, rotate: float, intensity: float) -> Any:
    """Return an equirectangular picture around the scene: u = 0.5 + atan2(z, x) / 2π, v = acos(y) / π from the top.

    Mitsuba's first and last row lie at the poles, and ours half a texel before. With rows between ours, and one at each
    pole, both have the same values everywhere. Its u = 0 is -Z, ours is -X.
    """
    rows = np.empty((2 * picture.shape[0] + 1, picture.shape[1], 3), np.float32)
    rows[1::2] = picture[..., :3]
    rows[::2] = (np.concatenate([rows[1:2], rows[1::2]]) + np.concatenate([rows[1::2], rows[-2:-1]])) / 2
    turn = mi.ScalarTransform4f().rotate([0, 1, 0], 90 + np.degrees(rotate))
    return mi.load_dict({"type": "envmap", "bitmap": mi.Bitmap(rows), "to_world": turn, "scale": intensity})
