"""Bloom: a glow around very bright surfaces."""

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

from ._half_size import half_radiance_size


class Bloom(Node):
    """Add a soft glow around everything brighter than a threshold, as lenses and eyes scatter it.

    A bright pass at half size and a separable Gaussian blur (James and O'Rorke 2004), repeated at half the size
    `levels` times, so that small kernels reach far. The mean of all levels is added to the radiance before tone
    mapping, so that the glow keeps its hue. Away from the picture's border, the added light is `intensity` times that
    of the bright pass.
    """

    radiance = InOut(Radiance, doc="Scene-linear radiance, to which the glow is added; alpha is unchanged.")
    gain = Input(ExposureGain, size="any", optional=True, doc="Exposure applied before the threshold.")
    glow = Internal(like="radiance", size=half_radiance_size, mips=lambda node, facts: node.mips(facts))
    blurred_x = Internal(like="radiance", size=half_radiance_size, mips=lambda node, facts: node.mips(facts))

    threshold: float = param(
        default=1.0, min=0, doc="Luminance, after `gain`, above which light glows; 1 is the display's white."
    )
    intensity: float = param(
        default=0.05, min=0, max=16, doc="Fraction of the light above the threshold that is added."
    )
    radius: int = param(
        default=6, unit="texels", min=0, max=32, doc="Radius of the blur of each level, three standard deviations."
    )
    levels: int = structural(
        default=3, min=1, max=8, doc="Number of levels; each has half the size, and doubles the width of the glow."
    )

    def mips(self, facts: Facts) -> int:
        """Return the number of levels, limited by the size of the picture."""
        return min(self.levels, full_mip_count(*half_radiance_size(self, facts)))

    def record(self, steps: Steps) -> None:
        """Record downsampling and blur of each level, then their mean on top of the picture."""
        levels = steps.desc(self.glow).mips
        for level in range(levels):
            target, blurred_x = self.glow.mip(level), self.blurred_x.mip(level)
            if level == 0:
                defines = {"DOWNSAMPLE": True}
                steps.fullscreen(
                    "bright_pass.frag", radiance=self.radiance, gain=self.gain, out=target, defines=defines
                )
            else:
                steps.fullscreen("<downsample.frag>", source=self.glow.mip(level - 1), out=target)
            steps.fullscreen("gaussian_blur.frag", source=target, out=blurred_x, axis=(1, 0))
            steps.fullscreen("gaussian_blur.frag", source=blurred_x, out=target, axis=(0, 1))
        additive = State(blend=ADD, color_mask=(True, True, True, False))
        glow = self.glow.sampled("trilinear")
        steps.fullscreen("bloom.frag", glow=glow, out=self.radiance, state=additive, defines={"LEVELS": levels})
