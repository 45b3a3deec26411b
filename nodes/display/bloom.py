"""Light that spills over around what is very bright."""

from __future__ import annotations

from rendergraph.api import (
    ADD,
    ExposureGain,
    Facts,
    InOut,
    Input,
    Internal,
    Node,
    Radiance,
    State,
    Steps,
    full_mip_count,
    param,
    structural,
)

from ._exposure import half_of_radiance


class Bloom(Node):
    """Add a soft glow around everything brighter than a threshold, as lenses and eyes scatter it.

    Bright-pass, half size, separable Gaussian (James and O'Rorke 2004); then half of that again and blurred again,
    `levels` times, so that small kernels reach far. The mean of the levels is added to the radiance before tone
    mapping: a glow keeps its hue and goes through the curve. Away from the border the added light is `intensity` times
    what the bright-pass left.
    """

    radiance = InOut(Radiance, doc="Scene-linear radiance; the glow is added to it, alpha stays.")
    gain = Input(ExposureGain, size="any", optional=True, doc="Exposure that the threshold is measured after.")
    glow = Internal(like="radiance", size=half_of_radiance, mips=lambda node, facts: node.mips(facts))
    across = Internal(like="radiance", size=half_of_radiance, mips=lambda node, facts: node.mips(facts))

    threshold: float = param(
        default=1.0, min=0, doc="Luminance, after `gain`, above which light spills; 1 is the display's white."
    )
    intensity: float = param(default=0.25, min=0, max=16, doc="Share of the bright light that is added.")
    radius: int = param(
        default=6, unit="texels", min=0, max=32, doc="Of each blur at its own level: three standard deviations."
    )
    levels: int = structural(default=3, min=1, max=8, doc="How often the size is halved; each doubles the reach.")

    def mips(self, facts: Facts) -> int:
        """The levels, as far as the picture can be halved."""
        return min(self.levels, full_mip_count(*half_of_radiance(self, facts)))

    def record(self, steps: Steps) -> None:
        """Down level by level, each blurred; then their mean on top of the picture."""
        levels = steps.desc(self.glow).mips
        for level in range(levels):
            here, scratch = self.glow.mip(level), self.across.mip(level)
            if level == 0:
                halve = {"HALVE": True}
                steps.fullscreen("bright_pass.frag", radiance=self.radiance, gain=self.gain, out=here, defines=halve)
            else:
                steps.fullscreen("<downsample.frag>", source=self.glow.mip(level - 1), out=here)
            steps.fullscreen("gaussian_blur.frag", source=here, out=scratch, axis=(1, 0))
            steps.fullscreen("gaussian_blur.frag", source=scratch, out=here, axis=(0, 1))
        added = State(blend=ADD, color_mask=(True, True, True, False))
        glow = self.glow.sampled("trilinear")
        steps.fullscreen("bloom.frag", glow=glow, out=self.radiance, state=added, defines={"LEVELS": levels})
