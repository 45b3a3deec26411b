"""Fog whose density falls with height, in closed form."""

from __future__ import annotations

from rendergraph.api import Air, Function, Node, param

from ._lighting import Color


class HeightFog(Node):
    """Fog whose density falls exponentially with height, without shadows.

    The extinction is `density` × exp(-`falloff` × (y - `height`)), so its integral along a ray has a closed form
    (Wenzel, "Real-time Atmospheric Effects in Games", 2006). The transmittance is exp(-integral). Every part of the fog
    scatters the radiance `color` to the viewer, so the in-scattered radiance is `color` × (1 - transmittance).

    Connect `air` to every lighting node that draws surfaces in the fog. The fog begins at the pipeline's camera.
    """

    air = Function(Air, "height_fog.glsl", doc="In-scattered radiance and transmittance from the camera to a position.")

    density: float = param(default=0.05, unit="1/m", min=0, max=100, doc="Extinction coefficient at `height`.")
    height: float = param(
        default=0.0, unit="m", min=-1e4, max=1e4, doc="World-space height (y) at which `density` is measured."
    )
    falloff: float = param(
        default=0.3,
        unit="1/m",
        min=0,
        max=100,
        doc="Relative decrease of density per metre of height; 0 is uniform fog.",
    )
    color: Color = param(default=0.5, min=0, glsl="vec3", doc="Radiance of dense fog, a number or RGB.")
