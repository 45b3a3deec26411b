"""Tone mapping.

This node is a class, although one shader would do: a header cannot declare choices that plugins add to, and every
pipeline uses this node, so that each start would import the reader of headers.
"""

from __future__ import annotations

from typing import Literal

from rendergraph.api import DisplayColor, ExposureGain, Input, Node, Output, Radiance, define, param


class Tonemap(Node):
    """Map scene-linear radiance to display values.

    Exposure is applied first, then the tone curve, then the sRGB transfer function. Some curves preserve hues, because
    they work on luminance: `reinhard_luminance` is x/(1+x), and `reinhard_extended` the same with a white point
    (Reinhard et al. 2002); `neutral` (Khronos PBR Neutral, 2024) leaves base colours below 0.8 unchanged. Others work
    on each channel, so that bright colours fade to white: `reinhard` is x/(1+x), `aces` is Narkowicz's fit (2015),
    `hable` is Hable's filmic curve (2010). `none` clips.

    The picture has 8 bits per channel, which show as bands in slow gradients. `dither` adds a fraction of a step before
    rounding, the same at a pixel in all frames and pictures: equal values stay equal, exact 8-bit values are unchanged,
    and the mean is preserved.

    With multisampled input the curve is applied to each sample before averaging, so that edges stay smooth after tone
    mapping. Nodes between lighting and display that need one sample can use `resolve`.
    """

    radiance = Input(Radiance, samples="any", doc="Scene-linear radiance, with one or several samples per texel.")
    gain = Input(
        ExposureGain,
        size="any",
        optional=True,
        doc="Factor in addition to `exposure`, such as that of automatic exposure.",
    )
    color = Output(DisplayColor, format="rgba8", doc="Display-referred colour, sRGB encoded; alpha is 1.")

    exposure: float = param(default=0.0, unit="EV", min=-32, max=32, doc="Stops added before the curve.")
    curve: Literal["neutral", "aces", "reinhard", "reinhard_luminance", "reinhard_extended", "hable", "none"] | str = (
        define(default="neutral", doc="Tone curve after exposure.", choices="curve")
    )
    white: float = param(
        default=4.0,
        min=0.01,
        doc="Luminance after exposure that `reinhard_extended` maps to white; brighter light clips.",
    )
    dither: bool = define(default=True, doc="Break up the bands of 8 bits by a pattern that is the same in all frames.")
