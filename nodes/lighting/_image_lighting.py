"""Inputs and steps of the nodes that light a G-buffer in image space."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from rendergraph.api import Depth, Facts, Input, Port, State, Steps, param

from ..geometry._surface_textures import SURFACE_TEXTURES
from ._lighting import Color, SurfaceLighting, draws_backdrop, mirror_view


def gbuffer_samples(_node: Any, facts: Facts) -> int:
    """Return the sample count of the depth, which the whole G-buffer shares."""
    depth = facts.input("depth").desc
    assert depth is not None
    return depth.samples


class ImageLighting(SurfaceLighting):
    """Base of the deferred lighting nodes. The textures of the G-buffer are one group of inputs.

    Textures that the shading model does not need are not read, and therefore not rendered either. A G-buffer contains
    no transparent surfaces: they are drawn over the picture as by `forward_lighting`, tested against the G-buffer's
    depth. With a multisampled G-buffer each sample is lit, unless the node does otherwise, and the picture has as many
    samples.
    """

    depth = Input(
        Depth, group="gbuffer", samples="any", doc="Window depth, from which positions are reconstructed with its view."
    )
    albedo = SURFACE_TEXTURES["albedo"].input()
    normal = SURFACE_TEXTURES["normal"].input()
    material = SURFACE_TEXTURES["material"].input()
    emissive = SURFACE_TEXTURES["emissive"].input()
    specular = SURFACE_TEXTURES["specular"].input()
    grain = SURFACE_TEXTURES["grain"].input()
    phong_diffuse = SURFACE_TEXTURES["phong_diffuse"].input()
    phong_specular = SURFACE_TEXTURES["phong_specular"].input()
    phong_ambient = SURFACE_TEXTURES["phong_ambient"].input()

    mirror_view = mirror_view(lambda frame: frame.views(ImageLighting.depth)[0])

    background: Color = param(default=0.0, min=0, glsl="vec3", doc="Radiance of the background, a number or RGB.")

    def gbuffer_reads(self, steps: Steps) -> dict[str, Any]:
        """Return the inputs of `gbuffer_surface.glsl` for the node's shading model."""
        needs = set(steps.needs("shading"))
        if "grain_where_any" in needs and any(entry.grain and not entry.blended for entry in steps.facts.objects):
            needs.add("grain")
        objects = steps.facts.objects
        wanted = {name for name, texture in SURFACE_TEXTURES.items() if texture.is_needed(needs, objects)}
        ports = [port for name, port in self.inputs().items() if name in wanted]
        return _connected(steps, [self.depth, *ports]) | self.energy_reads(steps)

    def per_sample(self, steps: Steps) -> dict[str, int]:
        """Return the macro of a step that lights each sample of a multisampled G-buffer."""
        return {"PER_SAMPLE": 1} if steps.desc(self.depth).samples > 1 else {}

    def shadow_reads(self, steps: Steps) -> dict[str, Any]:
        """Return the inputs of `shadow()`."""
        return _connected(steps, [self.lookup, self.visibility] if self.wants_lights(steps) else [])

    def direct_reads(self, steps: Steps) -> dict[str, Any]:
        """Return the inputs of direct lighting by several lights: shadows and lists of lights."""
        return self.shadow_reads(steps) | self.light_list_reads(steps)

    def ambient_reads(self, steps: Steps) -> dict[str, Any]:
        """Return the inputs of ambient lighting: the environment, reflections that replace it, and the occlusion."""
        return super().ambient_reads(steps) | _connected(
            steps, [self.occlusion] if self.terms in ("all", "ambient") else []
        )

    def backdrop_defines(self, steps: Steps) -> dict[str, int]:
        """Return the macro of a step that leaves the background to a backdrop."""
        return {"BACKDROP": 1} if draws_backdrop(self, steps.facts) else {}

    def draw_layered(self, steps: Steps) -> None:
        """Light opaque surfaces with layers, such as a coat, once more: a G-buffer stores no layers."""
        is_physical = {"phong", "nothing"}.isdisjoint(steps.needs("shading"))
        layered = [one for one in steps.facts.objects if one.layers and not one.blended and not one.hidden]
        objects = [one.name for one in layered if is_physical or "shadow_catcher" in one.layers]
        if not objects:
            return
        reads = self.direct_reads(steps) | self.ambient_reads(steps) | self.air_reads(steps) | self.energy_reads(steps)
        steps.geometry(
            "forward_lighting.frag",
            out=self.color_targets(steps),
            objects=objects,
            view=self.depth,
            state=State(depth_write=False),
            label="layered",
            depth=self.depth.tested(),
            defines=self.catcher_defines(steps),
            **reads | self.layer_reads(steps) | self.catcher_reads(steps),
        )

    def draw_backdrop_and_transparent(self, steps: Steps) -> None:
        """Draw layers, the environment behind the lit surfaces, then transparent surfaces, with the depth's view."""
        self.draw_layered(steps)
        self.draw_backdrop(steps, view=self.depth)
        if self.blended:
            self.draw_transparent(
                steps, self.color_targets(steps), self.transparent_shadows(steps), self.depth.tested(), view=self.depth
            )


def _connected(steps: Steps, ports: Iterable[Port]) -> dict[str, Any]:
    return {port.name: port for port in ports if steps.connected(port)}
