"""Shared by techniques that compute occlusion in screen space: inputs, reduced size, upsampling."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, ClassVar

from rendergraph.api import (
    Depth,
    Facts,
    Input,
    Internal,
    Node,
    Normal,
    Occlusion,
    Output,
    Port,
    Steps,
    param,
    structural,
)


def reduced_size(node: Any, facts: Facts) -> tuple[int, int]:
    """Return `scale` times the size of `depth`, rounded up."""
    desc = facts.input("depth").desc
    assert desc is not None
    return math.ceil(desc.width * node.scale), math.ceil(desc.height * node.scale)


class ReducedResolution(Node):
    """Base of the techniques that compute a value for every pixel, or for fewer pixels and interpolate the others."""

    depth = Input(Depth, doc="Window depth; positions come from it and its view.")
    normal = Input(Normal, doc="Unit normal, world space.")
    surfaces = Internal(format="rgba32f", size=reduced_size, view="depth")

    scale: float = structural(
        default=1.0, min=0.125, max=1, doc="Resolution relative to the picture's width and height."
    )

    def screen_size(self, steps: Steps) -> tuple[int, int]:
        """Return the size of the picture."""
        desc = steps.facts.input("depth").desc
        assert desc is not None
        return desc.size

    def size_defines(self, steps: Steps) -> dict[str, int]:
        """Return the macro `REDUCED` if `surfaces` is smaller than the picture."""
        return {} if steps.desc(self.surfaces).size == self.screen_size(steps) else {"REDUCED": 1}

    def gather_surfaces(self, steps: Steps) -> None:
        """Record the pass that writes normals and distances to `surfaces`."""
        defines = self.size_defines(steps)
        steps.fullscreen("surfaces.frag", out=self.surfaces, defines=defines, **self.surface_inputs(steps))

    def surface_inputs(self, steps: Steps) -> dict[str, Any]:
        """Return the inputs of `surfaces.frag`."""
        return {"depth": self.depth, "normal": self.normal, "reduced_size": steps.desc(self.surfaces).size}

    def upsample(
        self, steps: Steps, source: Port, out: Mapping[str, Port], defines: Mapping[str, int], **values: Any
    ) -> None:
        """Record the upsampling of a reduced texture.

        Args:
            steps: the recorder.
            source: a reduced texture.
            out: outputs by their names in `outputs.glsl`.
            defines: macros of the shader, such as `HAS_VECTOR`.
            values: further arguments of the step, such as a `radius` in metres, where the node has none.
        """
        steps.fullscreen(
            "upsample.frag",
            out=dict(out),
            source=source,
            surfaces=self.surfaces,
            depth=self.depth,
            normal=self.normal,
            defines={**defines, **self.size_defines(steps), "FINAL": 1},
            **values,
        )


class ScreenSpaceOcclusion(ReducedResolution):
    """Base of the techniques that know the scene only from the picture's depth and normals.

    `record` calls `gather_surfaces` first, then computes occlusion at the reduced size, and passes it to `upsample` if
    that is not the picture's size.
    """

    twin: ClassVar[str | None] = "traced_occlusion"

    occlusion = Output(
        Occlusion, format="r16", size="depth", doc="Ambient visibility: 1 open, 0 occluded; 1 for background."
    )
    unfiltered = Internal(format="r16", size=reduced_size)

    radius: float = param(
        default=0.5, unit="m", min=1e-6, max=1e6, doc="Surfaces farther away than this do not occlude."
    )

    def reduced_target(self, steps: Steps, reduced: Port) -> Port:
        """Return the target of the last pass at the reduced size: `reduced`, or `occlusion` at full size."""
        return reduced if self.size_defines(steps) else self.occlusion
