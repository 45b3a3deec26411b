"""Lighting while the geometry is drawn."""

from __future__ import annotations

from typing import Literal

from rendergraph.api import Depth, Output, Port, Radiance, State, Steps, define

from ._lighting import GeometryLighting


class ForwardLighting(GeometryLighting):
    """Radiance of the scene under all its lights, in one pass over the geometry.

    Opaque surfaces first, front to back, then those with alpha blending, back to front. Shadows come as functions
    looked up in place (`lookup`) or as pictures (`visibility`); all that are connected are multiplied. Pictures show
    the opaque surfaces alone: those with alpha blending take functions only. With `depth` of a pre-pass no hidden
    fragment is shaded.

    `evaluate` says how often light is computed: at every fragment (Phong 1975), at every vertex with colours
    interpolated (Gouraud 1971), or once a face with the face's normal (flat). Textures and shadows stay per fragment.
    """

    radiance = Output(
        Radiance,
        format="rgba16f",
        clear=lambda node, facts: (*node.background_rgb, 0.0),
        doc="Scene-linear radiance; alpha is coverage, 1 where an opaque surface is and 0 where nothing is.",
    )
    surface_depth = Output(
        Depth, format="depth32f", clear=1.0, doc="Depth of the nearest opaque surface, where no pre-pass is connected."
    )

    evaluate: Literal["fragment", "vertex", "face"] = define(default="fragment", doc="How often light is computed.")

    def record(self, steps: Steps) -> None:
        """One pass over what is opaque, one over what is blended."""
        vertex, geometry, fragment = {
            "fragment": ("<geometry.vert>", None, "forward_lighting.frag"),
            "vertex": ("forward_lighting.vert", None, "forward_interpolated.frag"),
            "face": ("forward_face.vert", "forward_lighting.geom", "forward_interpolated.frag"),
        }[self.evaluate]
        out: dict[str, Port] = {"radiance": self.radiance}
        nearer = None
        if not steps.connected(self.depth):
            out["surface_depth"] = self.surface_depth
        elif geometry is not None:
            # Triangles that pass a geometry shader may come out a few steps of depth beside the pre-pass's.
            nearer = (0.0, -8.0)
        steps.geometry(
            fragment,
            vertex=vertex,
            geometry=geometry,
            out=out,
            objects="opaque",
            state=State(polygon_offset=nearer),
            **self.opaque_reads(steps),
        )
        self.blend_after(steps, out, fragment=fragment, vertex=vertex, geometry=geometry)
