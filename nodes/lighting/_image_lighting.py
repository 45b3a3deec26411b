"""What the nodes share that light a G-buffer in image space."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from rendergraph.api import Depth, Facts, Input, Port, Steps, param

from ..geometry._surface_textures import SURFACE_TEXTURES
from ._lighting import Color, SurfaceLighting, shows_environment


def samples_stored(_node: Any, facts: Facts) -> int:
    """The samples of the depth, and so of all that goes with it."""
    depth = facts.input("depth").desc
    assert depth is not None
    return depth.samples


class ImageLighting(SurfaceLighting):
    """Base of the nodes that light a G-buffer: its textures as one group of inputs.

    What the shading model has no use for is not read, and so not drawn. A G-buffer does not hold surfaces with alpha
    blending: they are drawn as `forward_lighting` draws them, over the picture and tested against its depth. Of a
    G-buffer with several samples a pixel each is lit, unless the node says otherwise, and the picture has as many.
    """

    depth = Input(Depth, group="gbuffer", samples="any", doc="Window depth; positions come from it and its view.")
    albedo = SURFACE_TEXTURES["albedo"].read()
    normal = SURFACE_TEXTURES["normal"].read()
    material = SURFACE_TEXTURES["material"].read()
    emissive = SURFACE_TEXTURES["emissive"].read()
    specular = SURFACE_TEXTURES["specular"].read()
    grain = SURFACE_TEXTURES["grain"].read()
    phong_diffuse = SURFACE_TEXTURES["phong_diffuse"].read()
    phong_specular = SURFACE_TEXTURES["phong_specular"].read()
    phong_ambient = SURFACE_TEXTURES["phong_ambient"].read()

    background: Color = param(default=0.0, min=0, glsl="vec3", doc="Radiance where nothing is, a number or RGB.")

    def surface(self, steps: Steps) -> dict[str, Any]:
        """What a shader that includes `gbuffer_surface.glsl` reads for this shading model."""
        needs = set(steps.needs("shading"))
        if "grain_where_any" in needs and any(entry.grain and not entry.blended for entry in steps.facts.objects):
            needs.add("grain")
        objects = steps.facts.objects
        wanted = {name for name, texture in SURFACE_TEXTURES.items() if texture.is_looked_at(needs, objects)}
        ports = [port for name, port in self.inputs().items() if name in wanted]
        return _connected(steps, [self.depth, *ports])

    def per_sample(self, steps: Steps) -> dict[str, int]:
        """The macro of a step that lights each sample by itself, where there are several."""
        return {"PER_SAMPLE": 1} if steps.desc(self.depth).samples > 1 else {}

    def shadows(self, steps: Steps) -> dict[str, Any]:
        """What `shadow()` is made of."""
        return _connected(steps, [self.lookup, self.visibility] if self.wants_lights(steps) else [])

    def ambient_light(self, steps: Steps) -> dict[str, Any]:
        """Light from all around, and what scales it."""
        return self.around(steps) | _connected(steps, [self.occlusion] if self.terms in ("all", "ambient") else [])

    def backdrop_defines(self, steps: Steps) -> dict[str, int]:
        """Whether something is laid under the picture afterwards."""
        return {"BACKDROP": 1} if shows_environment(self, steps.facts) else {}

    def blend_over(self, steps: Steps) -> None:
        """The environment under the lit picture and surfaces with alpha blending over it, both seen as it is."""
        self.lay_under(steps, view=self.depth)
        if self.blended:
            self.blend(
                steps, self.pictures(steps), self.shadows_on_blended(steps), self.depth.tested(), view=self.depth
            )


def _connected(steps: Steps, ports: Iterable[Port]) -> dict[str, Any]:
    return {port.name: port for port in ports if steps.connected(port)}
