"""Tone mapping.

A class, though one shader and no decision: a header cannot declare choices that plugins add to, and as every pipeline
ends here, each start would import the reader of headers.
"""

from __future__ import annotations

from typing import Literal

from rendergraph.api import DisplayColor, ExposureGain, Input, Node, Output, Radiance, define, param


class Tonemap(Node):
    """Map scene-linear radiance to display values.

    Exposure first, then the shoulder, then the sRGB curve. Shoulders that keep hues by working on luminance:
    `reinhard_luminance` is x/(1+x) and `reinhard_extended` the same with a white point (Reinhard et al. 2002);
    `neutral` (Khronos PBR Neutral, 2024) leaves base colours under 0.8 as they are. Shoulders per channel, where bright
    colours fade to white: `reinhard` is x/(1+x), `aces` is Narkowicz's fit (2015), `hable` is Hable's filmic curve
    (2010). `none` clips.

    The picture has 8 bits a channel. Where light falls off slowly those show as bands, so a fraction of a step is added
    before rounding, the same at a pixel in all frames and pictures: what is equal stays equal, whole steps stay what
    they are, and the mean is kept (`dither`).

    Of several samples a texel each goes through the curve, and the picture is their mean: edges are then as smooth as
    they look. What comes between light and display wants one sample, which `resolve` makes.
    """

    radiance = Input(Radiance, samples="any", doc="Scene-linear radiance, one sample a texel or several.")
    gain = Input(
        ExposureGain, size="any", optional=True, doc="Factor beside `exposure`, as automatic exposure makes it."
    )
    color = Output(DisplayColor, format="rgba8", doc="Display-referred colour, sRGB encoded; alpha is 1.")

    exposure: float = param(default=0.0, unit="EV", min=-32, max=32, doc="Stops added before the curve.")
    curve: Literal["neutral", "aces", "reinhard", "reinhard_luminance", "reinhard_extended", "hable", "none"] | str = (
        define(default="neutral", doc="Shoulder after exposure.", choices="curve")
    )
    white: float = param(
        default=4.0, min=0.01, doc="Luminance after exposure that `reinhard_extended` maps to white; more clips."
    )
    dither: bool = define(default=True, doc="Break up the bands of 8 bits by a pattern that stands still.")
