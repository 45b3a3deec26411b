"""Tone mapping.

This node is a class, although a shader with a header would suffice: a header cannot declare choices that plugins
extend, and every pipeline uses this node, so each start would import the reader of headers.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal
from typing import Any as PlainAny

from rendergraph.api import (
    Any,
    DisplayColor,
    ExposureGain,
    Facts,
    Input,
    InputFile,
    Internal,
    Node,
    Output,
    Radiance,
    Steps,
    define,
    param,
    structural,
)

if TYPE_CHECKING:
    from ._look import Look

ACES2_SIDE = 65
"""Entries of the table of `aces2` along each channel; with this many, 99 % of the values are within an 8-bit step."""


def _look_side(node: PlainAny, facts: Facts) -> int:
    """Return the number of entries of the look along a side, 1 without one."""
    look = node.loaded_look()
    return 1 if look is None else len(look.table)


class Tonemap(Node):
    """Map scene-linear radiance to display values.

    Exposure and white balance are applied first, then contrast and saturation, the tone curve, and the sRGB transfer
    function. Some curves preserve hues, because they work on luminance: `reinhard_luminance` is x/(1+x), and
    `reinhard_extended` the same with a white point (Reinhard et al. 2002); `neutral` (Khronos PBR Neutral, 2024) leaves
    base colours below 0.8 unchanged. Others work on each channel, so that bright colours fade to white: `reinhard` is
    x/(1+x), `aces` is Narkowicz's fit (2015), `hable` is Hable's filmic curve (2010). `agx` (Sobotka 2022, in Blender's
    form) and `aces2` (the output transform of ACES 2.0, 2024, which OpenColorIO computes into a table) do the same
    without shifting hues. `none` clips.

    White balance is a von Kries adaptation in the cone space of Bradford (Lam 1985). Both whites are blackbodies (fit
    by Kim et al. 2002), so 6500 K changes nothing.

    A `look` is a table of colours. Tables in files (`.cube`, and other formats that OpenColorIO reads: `.3dl`, `.csp`,
    `.clf`, `.cdl` and so on) take and give display colours, as photo editors apply them: after the tone curve and the
    transfer function. A configuration of OpenColorIO (`.ocio`) has looks with names. They apply to scene-linear light
    with the primaries of Rec. 709, after exposure and before the tone curve. Tables of colours are interpolated
    tetrahedrally.

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
    color = Output(
        DisplayColor, format="rgba8", doc="Display-referred colour, sRGB encoded; alpha is 1, unless `transparent`."
    )
    curve_table = Internal(
        Any, kind="texture3d", format="rgba16", size=(ACES2_SIDE, ACES2_SIDE), layers=ACES2_SIDE, kept=True
    )

    look_table = Internal(
        Any,
        kind="texture3d",
        format="rgba32f",
        size=lambda node, facts: (_look_side(node, facts), _look_side(node, facts)),
        layers=_look_side,
        kept=True,
        doc="Colours of a look.",
    )
    look_curve = Internal(
        Any,
        format="rgba32f",
        size=lambda node, facts: (_look_side(node, facts), 1),
        kept=True,
        doc="A look that maps each channel separately.",
    )

    exposure: float = param(default=0.0, unit="EV", min=-32, max=32, doc="Stops added before the curve.")
    white_balance: float = param(
        default=6500.0,
        unit="K",
        min=1667,
        max=25000,
        doc="Colour temperature of the light that is to look white, as on a camera; below 6500 the picture gets bluer.",
    )
    contrast: float = param(
        default=1.0, min=0, max=4, doc="Slope in stops around middle grey (0.18), which is unchanged."
    )
    saturation: float = param(default=1.0, min=0, max=4, doc="0 is grey, 1 leaves colours as they are.")
    curve: (
        Literal[
            "neutral", "agx", "aces", "aces2", "reinhard", "reinhard_luminance", "reinhard_extended", "hable", "none"
        ]
        | str
    ) = define(default="neutral", doc="Tone curve after exposure.", choices="curve", needs=("curve_table",))
    look: InputFile | None = structural(
        default=None, doc="A colour table (`.cube` and others) or a configuration of OpenColorIO (`.ocio`)."
    )
    look_name: str = structural(default="", doc="The look of a configuration; by default its first.")
    transparent: bool = define(
        default=False, doc="Keep alpha; colours are multiplied by it, so that filters of the picture do not mix them."
    )
    white: float = param(
        default=4.0,
        min=0.01,
        doc="Luminance after exposure that `reinhard_extended` maps to white; brighter light clips.",
    )
    dither: bool = define(default=True, doc="Break up 8-bit banding by a pattern that is the same in all frames.")

    def loaded_look(self) -> Look | None:
        """Return the look, None without one.

        Raises:
            ValueError: its file is malformed, or has no look of that name.
        """
        if self.look is None:
            if self.look_name:
                raise ValueError("'look_name' needs a 'look': a configuration (.ocio, .ocioz)")
            return None
        from ._look import load_look  # only for looks

        return load_look(self.look, self.look_name)

    def validate(self) -> None:
        """Refuse a malformed look."""
        self.loaded_look()

    def record(self, steps: Steps) -> None:
        """Record the mapping, and before it the tables of a look and of a curve that needs one."""
        reads: dict[str, PlainAny] = {}
        defines: dict[str, int] = {}
        if "curve_table" in steps.needs("curve"):
            from ._aces2 import table  # OpenColorIO, only for this curve

            steps.upload(self.curve_table, table(ACES2_SIDE), label="table")
            reads["curve_table"] = self.curve_table.sampled("linear")
        if (look := self.loaded_look()) is not None:
            port = self.look_curve if look.is_curve else self.look_table
            steps.upload(port, look.texels, label="look")
            reads |= {port.name: port, "look_low": look.low, "look_high": look.high}
            defines = {"LOOK_LINEAR" if look.is_linear else "LOOK_DISPLAY": 1}
            defines |= {"LOOK_CURVE": 1} if look.is_curve else {}
        if not reads:
            steps.fullscreen("tonemap.frag")
            return
        steps.fullscreen("tonemap.frag", radiance=self.radiance, gain=self.gain, defines=defines, **reads)
