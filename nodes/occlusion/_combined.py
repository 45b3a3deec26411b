"""What the techniques share that find occlusion and light between surfaces in one pass."""

from __future__ import annotations

from collections.abc import Mapping

from rendergraph.api import Occlusion, Output, Port, Steps, param

from ._interreflection import Interreflection


class Combined(Interreflection):
    """Base of the techniques with one set of samples for both.

    Occlusion comes after the lighting here, for light is looked for where it is: these nodes add ambient light
    themselves, and the lighting's own is to be 0.
    """

    occlusion = Output(Occlusion, format="r16", size="depth", doc="1 open, 0 closed; 1 where nothing is.")

    wider: float = param(default=5.0, min=1, max=100, doc="Light comes from this many times the radius.")
    ambient: float | tuple[float, float, float] = param(
        default=0.03, min=0, glsl="vec3", doc="Radiance from all sides, a number or RGB, scaled by the occlusion."
    )

    def look_at_both(self, steps: Steps, fragment: str, defines: Mapping[str, int]) -> None:
        """Light and occlusion by a shader, then what is made of it."""
        out: dict[str, Port] = {"indirect": self.indirect, "occlusion": self.occlusion}
        self.look(steps, fragment, out, four=True, smooth=self.denoise, defines=defines, diffuse=self.diffuse)
        self.send_on(steps, occlusion=self.occlusion, defines={"AMBIENT": 1})
