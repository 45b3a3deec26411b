"""What the nodes share that compute occlusion in image space: their inputs, reduced size, and the way back to full."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

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
    """`scale` times the size of `depth`, rounded up."""
    desc = facts.input("depth").desc
    assert desc is not None
    return math.ceil(desc.width * node.scale), math.ceil(desc.height * node.scale)


class ScreenSpaceOcclusion(Node):
    """Base of the techniques that see no more of the scene than depth and normals of the picture.

    `record` calls `gather_surfaces` first, then makes an occlusion at the reduced size, and gives it to `upsample`
    where that is not the picture's.
    """

    depth = Input(Depth, doc="Window depth; positions come from it and its view.")
    normal = Input(Normal, doc="Unit normal, world space.")
    occlusion = Output(Occlusion, format="r16", size="depth", doc="1 open, 0 closed; 1 where nothing is.")
    surfaces = Internal(format="rgba32f", size=reduced_size, view="depth")
    unfiltered = Internal(format="r16", size=reduced_size)

    radius: float = param(default=0.5, unit="m", min=1e-6, max=1e6, doc="Nothing farther away than this occludes.")
    scale: float = structural(
        default=1.0, min=0.125, max=1, doc="Share of the picture's width and height it is computed at."
    )

    def screen(self, steps: Steps) -> tuple[int, int]:
        """The picture's size."""
        desc = steps.facts.input("depth").desc
        assert desc is not None
        return desc.size

    def sizes(self, steps: Steps) -> dict[str, int]:
        """The macro that says whether `surfaces` is smaller than the picture."""
        return {} if steps.desc(self.surfaces).size == self.screen(steps) else {"REDUCED": 1}

    def gather_surfaces(self, steps: Steps) -> None:
        """Bring normals and distances into `surfaces`."""
        steps.fullscreen("surfaces.frag", out=self.surfaces, defines=self.sizes(steps), **self.gathered(steps))

    def gathered(self, steps: Steps) -> dict[str, Any]:
        """What surfaces are gathered from."""
        return {"depth": self.depth, "normal": self.normal, "reduced": steps.desc(self.surfaces).size}

    def target(self, steps: Steps, small: Port) -> Port:
        """Where the last pass at reduced size goes: `occlusion` itself where nothing is reduced, else `small`."""
        return small if self.sizes(steps) else self.occlusion

    def upsample(self, steps: Steps, source: Port, out: Mapping[str, Port], defines: Mapping[str, int]) -> None:
        """Bring what is reduced to full size.

        Args:
            steps: what records it.
            source: a reduced texture.
            out: what is made of it, by the names in `finish.glsl`.
            defines: what of it there is to make: `FOUR` and the like.
        """
        steps.fullscreen(
            "upsample.frag",
            out=dict(out),
            source=source,
            surfaces=self.surfaces,
            depth=self.depth,
            normal=self.normal,
            defines={**defines, **self.sizes(steps), "FINAL": 1},
        )
