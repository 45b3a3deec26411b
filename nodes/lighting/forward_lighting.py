"""Lighting while the geometry is drawn."""

from __future__ import annotations

from typing import Any, Literal

from rendergraph.api import State, Steps, define

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

    evaluate: Literal["fragment", "vertex", "face"] = define(default="fragment", doc="How often light is computed.")

    def record(self, steps: Steps) -> None:
        """One pass over what is opaque, one over what is blended."""
        super().record(steps)
        shaders: dict[str, Any] = {
            "fragment": {"fragment": "forward_lighting.frag"},
            "vertex": {"fragment": "forward_interpolated.frag", "vertex": "forward_lighting.vert"},
            "face": {
                "fragment": "forward_interpolated.frag",
                "vertex": "forward_face.vert",
                "geometry": "forward_lighting.geom",
            },
        }[self.evaluate]
        # Triangles that pass a geometry shader may come out a few steps of depth beside the pre-pass's.
        nearer = (0.0, 8.0) if self.evaluate == "face" and steps.connected(self.depth) else None
        self.light_opaque(steps, **shaders, **self.around(steps), in_place=True, state=State(polygon_offset=nearer))
        self.blend_after(steps, **shaders, in_place=True)
