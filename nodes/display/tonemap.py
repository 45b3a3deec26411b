"""Tone mapping."""

from __future__ import annotations

from typing import Literal

from rendergraph.api import DisplayColor, Input, Node, Output, Radiance, define, param


class Tonemap(Node):
    """Map scene-linear radiance to display values.

    Exposure first, then the shoulder, then the sRGB curve. `neutral` is the Khronos PBR Neutral tone mapper (2024):
    base colours under 0.8 come out as they are; `aces` is Narkowicz's fit (2015); `reinhard` is x/(1+x) per channel
    (2002); `none` clips.
    """

    radiance = Input(Radiance, doc="Scene-linear radiance.")
    color = Output(DisplayColor, format="rgba8", doc="Display-referred colour, sRGB encoded; alpha is 1.")

    exposure: float = param(default=0.0, unit="EV", min=-32, max=32, doc="Stops added before the curve.")
    curve: Literal["neutral", "aces", "reinhard", "none"] = define(default="neutral", doc="Shoulder after exposure.")
