"""Lays panels out to one picture: labels in them, the same part magnified below each, and errors in false colour."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from msgspec import Struct
from PIL import Image, ImageDraw, ImageFont

Bytes = npt.NDArray[np.uint8]

_FRAME = (255, 196, 0)
_QUALITY = 90
_ANCHORS = np.array(  # of the colour map, dark to bright: errors of 0 are black and the largest ones white
    [
        (0, 0, 4),
        (40, 11, 84),
        (101, 21, 110),
        (159, 42, 99),
        (212, 72, 66),
        (245, 125, 21),
        (250, 193, 39),
        (252, 255, 164),
    ]
)


class Layout(Struct, frozen=True):
    """How panels are put together.

    Attributes:
        columns: panels of a row.
        gap: white pixels between everything.
        labels: texts in the panels' upper left corners, in their order; an empty one is none. The font has ASCII alone.
        label_size: size of the font in pixels; 0 chooses it by the width of a row.
        inset: x, y, width and height of a part of each panel, in pixels, which is shown below it as wide as it is.
        reference: number of the panel that the others are compared with, counted from 0; -1 for none.
        top: the error, as a share of white, that the brightest colour stands for.
    """

    columns: int
    gap: int = 0
    labels: Sequence[str] = ()
    label_size: int = 0
    inset: tuple[int, int, int, int] | None = None
    reference: int = -1
    top: float = 0.25


def laid_out(panels: Sequence[Bytes], layout: Layout, details: Sequence[Bytes] | None = None) -> Bytes:
    """Return one picture of panels, (height, width, 3) each; those of a row have one height.

    Args:
        details: the same pictures with more pixels, from which insets are taken.
    """
    details = panels if details is None else details
    rows: list[list[Bytes]] = []
    widest = max(sum(panel.shape[1] for panel in panels[: layout.columns]), 1)
    size = layout.label_size or max(12, round(widest / 64))
    for start in range(0, len(panels), layout.columns):
        row = list(panels[start : start + layout.columns])
        labels = [*layout.labels, *[""] * len(panels)][start : start + layout.columns]
        rows.append(
            [_labelled(_framed(panel, layout.inset), text, size) for panel, text in zip(row, labels, strict=True)]
        )
        if layout.inset:
            finer = details[start : start + layout.columns]
            rows.append([_magnified(panel, detail, layout.inset) for panel, detail in zip(row, finer, strict=True)])
        if layout.reference >= 0:
            truth = panels[layout.reference]
            numbers = range(start, start + len(row))
            rows.append(
                [
                    _scale(panel, layout.top, size) if n == layout.reference else _error(panel, truth, layout.top, size)
                    for n, panel in zip(numbers, row, strict=True)
                ]
            )
    return _beside([_beside(row, layout.gap, 1) for row in rows], layout.gap, 0)


def save(file: Path, pixels: Bytes) -> None:
    """Write a picture; JPEG where the name says so, with colour as sharp as brightness, for letters."""
    options: dict[str, Any] = {"quality": _QUALITY, "subsampling": 0, "optimize": True} if file.suffix == ".jpg" else {}
    Image.fromarray(pixels).save(file, **options)


def false_color(error: npt.NDArray[np.float64]) -> Bytes:
    """Return the colours of numbers from 0 to 1, (…, 3)."""
    at = np.clip(error, 0, 1) * (len(_ANCHORS) - 1)
    return np.stack([np.interp(at, range(len(_ANCHORS)), _ANCHORS[:, c]) for c in range(3)], axis=-1).astype(np.uint8)


def _error(panel: Bytes, truth: Bytes, top: float, size: int) -> Bytes:
    """The largest difference of a channel, with the mean of all pixels written into it."""
    error = np.abs(panel.astype(np.float64) - truth).max(axis=-1) / 255
    return _labelled(false_color(error / top), f"error, mean {error.mean():.3f}", size)


def _scale(like: Bytes, top: float, size: int) -> Bytes:
    """What the colours of errors mean, in a field as large as a panel."""
    height, width = like.shape[:2]
    field = Image.new("RGB", (width, height), (255, 255, 255))
    left, right = round(0.08 * width), round(0.92 * width)
    bar = false_color(np.broadcast_to(np.linspace(0, 1, right - left), (max(8, height // 14), right - left)))
    high = height // 2
    field.paste(Image.fromarray(bar), (left, high))
    pen, font = ImageDraw.Draw(field), ImageFont.load_default(size)
    below = high + bar.shape[0] + size // 3
    pen.text((left, below), "0", (0, 0, 0), font)
    pen.text((right, below), f"{top:g} of white", (0, 0, 0), font, anchor="ra")
    pen.text((left, high - size // 3), "difference from the panel above", (0, 0, 0), font, anchor="ld")
    return np.asarray(field)


def _labelled(panel: Bytes, text: str, size: int) -> Bytes:
    if not text:
        return panel
    picture = Image.fromarray(panel)
    pen, font = ImageDraw.Draw(picture, "RGBA"), ImageFont.load_default(size)
    edge = size // 2
    left, top, right, bottom = pen.textbbox((2 * edge, 2 * edge), text, font)
    pen.rounded_rectangle((left - edge, top - edge, right + edge, bottom + edge), edge, (16, 16, 20, 178))
    pen.text((2 * edge, 2 * edge), text, (255, 255, 255, 255), font)
    return np.asarray(picture)


def _framed(panel: Bytes, inset: tuple[int, int, int, int] | None) -> Bytes:
    if inset is None:
        return panel
    x, y, width, height = inset
    picture = Image.fromarray(panel)
    ImageDraw.Draw(picture).rectangle((x - 2, y - 2, x + width + 1, y + height + 1), outline=_FRAME, width=2)
    return np.asarray(picture)


def _magnified(panel: Bytes, detail: Bytes, inset: tuple[int, int, int, int]) -> Bytes:
    """The part with every pixel as a square, as wide as the panel, and the frame's colour around it."""
    x, y, width, height = inset
    wide, finer = panel.shape[1], detail.shape[1] // panel.shape[1]
    part = Image.fromarray(detail[finer * y : finer * (y + height), finer * x : finer * (x + width)])
    whole = part.resize((wide, round(wide * height / width)), Image.Resampling.NEAREST)
    ImageDraw.Draw(whole).rectangle((0, 0, whole.width - 1, whole.height - 1), outline=_FRAME, width=2)
    return np.asarray(whole)


def _beside(parts: Sequence[Bytes], gap: int, axis: int) -> Bytes:
    """Pictures beside each other, or below, of one size across."""
    joined = parts[0]
    for part in parts[1:]:
        shape = list(joined.shape)
        shape[axis] = gap
        joined = np.concatenate([joined, np.full(shape, 255, np.uint8), part], axis)
    return joined
