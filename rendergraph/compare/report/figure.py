"""A comparison as a figure and as a table for a paper. Matplotlib is imported here alone."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, TypeAlias

from rendergraph.compare.report.html import eight_bit
from rendergraph.compare.results import Comparison, Result
from rendergraph.errors import InputError, Problem
from rendergraph.images import heat_map
from rendergraph.installed import require

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Crop: TypeAlias = "tuple[int, int, int, int]"
"""Left, top, width and height in pixels of the picture, whose top left is 0, 0."""

COLORS = ("#e6550d", "#3182bd", "#31a354", "#756bb1")
"""Frames of crops, in order; they can be told apart in print, too."""
_TEXT_WIDTH = 7.0
"""Inches: two columns of a conference's paper."""
_ESCAPED = {"\\": r"\textbackslash{}", "~": r"\textasciitilde{}", "^": r"\textasciicircum{}", "∞": r"$\infty$"}
_ESCAPED |= {letter: f"\\{letter}" for letter in "&%$#_{}"}


def figure(
    comparison: Comparison,
    crops: Mapping[str, Crop] | Sequence[Crop] = (),
    *,
    caption: str = "",
    errors: bool = False,
    width: float = _TEXT_WIDTH,
) -> Figure:
    """Return a figure with a picture of each variant, magnified crops beneath, and the errors as titles.

    A reference that is none of the variants comes first. `Results.figure` describes the arguments.

    Raises:
        UsageError: Matplotlib is not installed.
        InputError: a crop is not a part of the picture.
    """
    require("a figure", "figures", "matplotlib")
    from matplotlib.figure import Figure  # slow to import, and an extra
    from matplotlib.patches import Rectangle  # likewise

    named = list(crops.items()) if isinstance(crops, Mapping) else [("", each) for each in crops]
    across, down = comparison.size
    for name, (x, y, w, h) in named:
        if min(x, y) < 0 or min(w, h) < 1 or x + w > across or y + h > down:
            text = f"crop {name or (x, y, w, h)}: expected left, top, width and height within {across}×{down} pixels"
            raise InputError(Problem("RG500", text))
    reference = comparison.reference
    shown: list[tuple[str, Any, Result | None]] = [
        (one.name, eight_bit(one.pixels, one.encoding), one) for one in comparison.results if one.pixels is not None
    ]
    if reference.kind != "variant":
        shown.insert(0, (reference.name, eight_bit(reference.pixels, reference.encoding), None))
    heights = [down / across, *([down / across] if errors else []), *(h / w for _, (_, _, w, h) in named)]
    each = width / max(len(shown), 1)
    made = Figure(figsize=(width, each * sum(heights) + 0.35 + (0.3 if caption else 0)), layout="constrained")
    axes = made.subplots(len(heights), len(shown), squeeze=False, height_ratios=heights)
    for column, (name, pixels, result) in enumerate(shown):
        rows: list[Any] = [pixels]
        if errors:
            rows.append(heat_map(result.flip_map) if result is not None and result.flip_map is not None else None)
        rows += [pixels[y : y + h, x : x + w] for _, (x, y, w, h) in named]
        measured = result is not None and not (reference.kind == "variant" and name == reference.name)
        about = f"FLIP {result.metrics.flip:.4f}" if measured and result is not None else "reference"
        axes[0, column].set_title(f"{name}\n{about}", fontsize=7)
        for row, picture in enumerate(rows):
            axis = axes[row, column]
            axis.set(xticks=[], yticks=[])
            axis.spines[:].set_visible(False)
            if picture is not None:
                axis.imshow(picture.squeeze(), cmap="gray", vmin=0, vmax=255, interpolation="nearest")
        for number, (label, (x, y, w, h)) in enumerate(named):
            color = COLORS[number % len(COLORS)]
            axes[0, column].add_patch(Rectangle((x - 0.5, y - 0.5), w, h, fill=False, edgecolor=color, linewidth=0.8))
            axis = axes[len(heights) - len(named) + number, column]
            axis.spines[:].set(visible=True, color=color, linewidth=1.2)
            if column == 0 and label:
                axis.set_ylabel(label, fontsize=7)
    if caption:
        made.supxlabel(caption, fontsize=8)
    return made


def latex_table(heads: Sequence[str], rows: Sequence[Sequence[object]]) -> str:
    """Return a table for LaTeX with the package booktabs; the first column is text, all others are numbers."""
    head, *body = [" & ".join(_latex(str(cell)) for cell in row) + r" \\" for row in (heads, *rows)]
    begin = rf"\begin{{tabular}}{{l{'r' * (len(heads) - 1)}}}"
    return "\n".join([begin, r"\toprule", head, r"\midrule", *body, r"\bottomrule", "\\end{tabular}\n"])


def _latex(text: str) -> str:
    text = re.sub(r"[\\~^∞&%$#_{}]", lambda letter: _ESCAPED[letter[0]], text)
    return text.replace("–", "--")
