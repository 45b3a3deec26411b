"""Forward lighting."""

from __future__ import annotations

from typing import Any, Literal

from rendergraph.api import SceneError, State, Steps, define

from ._lighting import GeometryLighting


class ForwardLighting(GeometryLighting):
    """Light the scene by all its lights, in one pass over the geometry.

    Opaque surfaces are drawn first, front to back, then transparent ones, back to front. Shadows are functions that
    are evaluated per fragment (`lookup`) or screen-space textures (`visibility`); all that are connected are
    multiplied. Transparent surfaces use functions only, because the textures show the opaque surfaces. With the `depth`
    of a pre-pass, no hidden fragment is shaded.

    `evaluate` sets how often lighting is computed: per fragment (Phong 1975), per vertex with interpolated colours
    (Gouraud 1971), or once per face with its normal (flat shading). Textures, shadows and `reflections` are always per
    fragment. Vertices and faces are lit by all lights, regardless of the `light_list`.
    """

    evaluate: Literal["fragment", "vertex", "face"] = define(default="fragment", doc="How often lighting is computed.")

    def record(self, steps: Steps) -> None:
        """Record a pass over opaque surfaces and one over transparent ones.

        Raises:
            SceneError: an output is used that only lighting per fragment provides.
        """
        for part in (self.environment_reflection, self.specular_albedo):
            if self.evaluate != "fragment" and steps.used(part):
                raise SceneError(f"'{part.name}' is only available per fragment; set `evaluate: fragment`", part.name)
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
        # A geometry shader may change depths by a few steps compared with the pre-pass.
        offset = (0.0, 8.0) if self.evaluate == "face" and steps.connected(self.depth) else None
        self.draw_opaque(
            steps, **shaders, **self.ambient_reads(steps), in_place=True, state=State(polygon_offset=offset)
        )
        self.draw_backdrop_and_transparent(steps, **shaders, in_place=True)

    def light_list_reads(self, steps: Steps) -> dict[str, Any]:
        """Return the shader inputs for lighting a surface by some of the lights; none for vertices and faces."""
        return super().light_list_reads(steps) if self.evaluate == "fragment" else {}
