"""Motion blur from motion vectors."""

from __future__ import annotations

from typing import Any, Literal

from rendergraph.api import Any as AnyTexel
from rendergraph.api import Depth, Facts, Frame, InOut, Input, Internal, Node, Radiance, Steps, Velocity, define, param


def _columns(node: MotionBlur, facts: Facts) -> tuple[int, int]:
    width, height = facts.viewport
    return -(-width // node.reach(height)), height


def _tiles(node: MotionBlur, facts: Facts) -> tuple[int, int]:
    width, height = facts.viewport
    return -(-width // node.reach(height)), -(-height // node.reach(height))


class MotionBlur(Node):
    """Blur surfaces that move while the camera's shutter is open.

    Each pixel gathers samples along the fastest motion in its neighbourhood, which three small passes find in tiles
    (McGuire, Hennessy, Bukowski and Osman 2012), and along its own motion (Guertin, McGuire and Nowrouzezahrai 2014).
    Depth separates samples of nearer surfaces that pass over the pixel from samples of the background that its own
    surface uncovers.

    With `weights: exposure` a sample counts by the share of the exposure in which its surface covers the pixel. A
    uniform motion of one surface is then exactly the box filter of the shutter, and the blurred edge of a nearer
    surface the exact linear ramp. `weights: cones` are those of the paper of 2012, which fall off with the distance.

    Motion is assumed to be linear, at the speed since the previous frame; the first frame has none. Without a shutter
    (`shutter` of the scene's camera) the node does nothing and costs nothing.
    """

    radiance = InOut(Radiance, doc="Scene-linear radiance, which is blurred.")
    depth = Input(Depth, doc="Window depth.")
    velocity = Input(Velocity, optional=True, doc="Motion vectors. Unconnected: only the camera moves.")
    sharp = Internal(like="radiance")
    motion = Internal(AnyTexel, format="rgba16f", doc="Half the motion during the exposure, in pixels; distance.")
    fastest_x = Internal(AnyTexel, format="rg16f", size=_columns)
    fastest = Internal(AnyTexel, format="rg16f", size=_tiles)
    neighborhood = Internal(AnyTexel, format="rg16f", size=_tiles)

    camera_motion: bool = define(default=True, doc="Blur by the motion of the camera.")
    object_motion: bool = define(default=True, doc="Blur by the motion of objects.")
    weights: Literal["exposure", "cones"] = define(
        default="exposure", doc="Count samples by their share of the exposure, or as in the paper of 2012."
    )
    samples: int = param(default=16, min=2, max=128, doc="Samples along each of the two directions.")
    radius: float = define(
        default=0.05,
        min=0.002,
        max=0.25,
        doc="Largest blur of a point to each side, in heights of the picture.",
    )
    jitter: float = param(
        default=1.0,
        min=0,
        max=1,
        doc="Random shift of a pixel's samples, in steps between them; turns banding into noise.",
    )
    depth_tolerance: float = param(
        default=0.01,
        min=1e-5,
        max=1,
        doc="Relative difference in distance at which a surface fully counts as nearer.",
    )

    def reach(self, height: int) -> int:
        """Return the greatest blur to each side, which is the size of the tiles, in pixels."""
        return max(1, round(self.radius * height))

    def record(self, steps: Steps) -> None:
        """Record motion, its maxima over tiles and their neighbours, and the gathering; nothing without a shutter."""
        if not steps.facts.camera.shutter:
            return
        reach = self.reach(steps.facts.viewport[1])
        defines = {"REACH": reach}
        reads: dict[str, Any] = {"velocity": self.velocity} if steps.connected(self.velocity) else {}
        steps.fullscreen(
            "motion.frag",
            out={"sharp": self.sharp, "motion": self.motion},
            radiance=self.radiance,
            depth=self.depth,
            shutter=steps.facts.camera.shutter,
            defines=defines,
            label="motion",
            **reads,
        )
        for source, out, axis in ((self.motion, self.fastest_x, (1, 0)), (self.fastest_x, self.fastest, (0, 1))):
            steps.fullscreen("motion_maximum.frag", source=source, out=out, axis=axis, count=reach, stride=reach)
        steps.fullscreen("motion_neighborhood.frag", source=self.fastest, out=self.neighborhood)
        steps.fullscreen(
            "motion_blur.frag",
            sharp=self.sharp,
            motion=self.motion,
            neighborhood=self.neighborhood,
            out=self.radiance,
            defines=defines,
            label="gather",
        )

    def update(self, frame: Frame) -> None:
        """Update the shutter, which keyframes may animate."""
        frame.set_uniform("shutter", float(frame.scene.camera.shutter))
