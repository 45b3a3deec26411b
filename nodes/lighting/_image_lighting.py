"""What the nodes share that light a G-buffer in image space."""

from __future__ import annotations

from typing import Any

from rendergraph.api import Albedo, Depth, Emissive, Input, Material, Normal, Port, Steps, param
from rendergraph.api import Any as AnyTexel

from ._lighting import Color, SurfaceLighting


class ImageLighting(SurfaceLighting):
    """Base of the nodes that light a G-buffer: its textures as one group of inputs.

    What the shading model has no use for is not read, and so not drawn. A G-buffer does not hold surfaces with alpha
    blending: they are drawn as `forward_lighting` draws them, over the picture and tested against its depth.
    """

    depth = Input(Depth, group="gbuffer", doc="Window depth; positions come from it and its view.")
    albedo = Input(Albedo, group="gbuffer", doc="Base colour.")
    normal = Input(Normal, group="gbuffer", doc="Unit normal for shading.")
    material = Input(Material, group="gbuffer", doc="Metallic, roughness, occlusion, and 0 for unlit surfaces.")
    emissive = Input(Emissive, group="gbuffer", doc="Emitted radiance.")
    specular = Input(AnyTexel, group="gbuffer", optional=True, doc="Reflectance of what is not metal; else 4 %.")
    grain = Input(AnyTexel, group="gbuffer", optional=True, doc="Direction and strength of the grain; else none.")
    phong_diffuse = Input(AnyTexel, group="gbuffer", optional=True, doc="kd of the empirical models; else derived.")
    phong_specular = Input(AnyTexel, group="gbuffer", optional=True, doc="ks of the empirical models; else derived.")
    phong_ambient = Input(AnyTexel, group="gbuffer", optional=True, doc="ka of the empirical models; else derived.")

    background: Color = param(default=0.0, min=0, glsl="vec3", doc="Radiance where nothing is, a number or RGB.")

    def surface(self, steps: Steps) -> dict[str, Any]:
        """What a shader that includes `gbuffer_surface.glsl` reads for this shading model."""
        ports: list[Port] = [self.depth, self.albedo]
        if self.shading != "unlit":
            ports += [self.normal, self.material, self.emissive, self.specular]
        if self.shading == "anisotropic" or "grain" in steps.needs("shading"):
            ports.append(self.grain)
        if self.shading in ("phong", "blinn_phong") or "phong" in steps.needs("shading"):
            ports += [self.phong_diffuse, self.phong_specular, self.phong_ambient]
            ports.remove(self.specular)
        return _connected(steps, ports)

    def shadows(self, steps: Steps) -> dict[str, Any]:
        """What `shadow()` is made of."""
        return _connected(steps, [self.lookup, self.visibility] if self.wants_lights else [])

    def ambient_light(self, steps: Steps) -> dict[str, Any]:
        """What scales ambient light."""
        return _connected(steps, [self.occlusion] if self.terms in ("all", "ambient") else [])

    def blend_over(self, steps: Steps, radiance: Port) -> None:
        """Surfaces with alpha blending, over the lit picture and seen as it is."""
        if self.blended:
            self.blend(
                steps, {"radiance": radiance}, self.shadows_on_blended(steps), self.depth.tested(), view=self.depth
            )


def _connected(steps: Steps, ports: list[Port]) -> dict[str, Any]:
    return {port.name: port for port in ports if steps.connected(port)}
