"""Pieces of the page: pictures as data, figures as text, SVG documents that keep their styles to themselves."""

from __future__ import annotations

import base64
import math
import re
import tempfile
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path

import numpy as np
import numpy.typing as npt

from rendergraph.compare.timing import Spread
from rendergraph.images import viewable, write
from rendergraph.metrics import Encoding, Pixels

SOFTWARE = "software rasteriser: no measure of a GPU"


def software_note(software: bool) -> str:
    """The warning that stands wherever a time is shown."""
    return f'<p class="software">Times on a {SOFTWARE}.</p>' if software else ""


def png(pixels: npt.NDArray[np.uint8]) -> str:
    """A picture as the address of itself."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "picture.png"
        write(path, pixels)
        return "data:image/png;base64," + base64.b64encode(path.read_bytes()).decode()


def eight_bit(pixels: Pixels, encoding: Encoding) -> npt.NDArray[np.uint8]:
    """A compared output as 8 bits."""
    return viewable(pixels, {"display": "display_color", "linear": "radiance"}.get(encoding, "any"))


def img(identity: str, source: str, alt: str) -> str:
    """A picture; an empty identity gives it none."""
    own = f' id="{identity}"' if identity else ""
    return f'<img{own} src="{source}" alt="{escape(alt)}">'


def drawing(svg: str, label: str) -> str:
    """An SVG document in a shadow tree: its style sheet stays its own.

    A wide one is made as narrow as the page, to 6 tenths of its width: what is smaller cannot be read, and is scrolled.
    """
    width = re.search(r'<svg [^>]*?\bwidth="([\d.]+)"', svg)
    least = f"min-width:{0.6 * float(width[1]):.0f}px;" if width else ""
    style = f"max-width:100%;{least}height:auto"
    svg = svg.replace("<style>", "<style>@media print{svg{min-width:0!important;width:100%}}", 1)
    svg = re.sub(r"<svg ", f'<svg role="img" style="{style}" aria-label="{escape(label)}" ', svg, count=1)
    return f'<div class="drawing"><template shadowrootmode="open">{svg}</template></div>'


def number(value: float | None, digits: int = 4) -> str:
    """A figure with a few digits, `–` where there is none."""
    if value is None or not math.isfinite(value):
        return "–"
    if value == 0:
        return "0"
    return f"{value:.{digits}f}" if abs(value) >= 10 ** (1 - digits) else f"{value:.1e}"


def milliseconds(spread: Spread | None, most: float = 0.0) -> str:
    """A median with its spread beneath, and a bar where `most` is the longest."""
    if spread is None:
        return '<td class="num">–</td>'
    bar = f'<span class="bar" style="width:{100 * spread.median / most:.1f}%"></span>' if most > 0 else ""
    return f'<td class="num">{spread.median:.3f}{bar}<span class="spread">{spread.p10:.3f}–{spread.p90:.3f}</span></td>'


def table(heads: Sequence[str], rows: Iterable[str], caption: str) -> str:
    """A table; heads that begin with `#` are of figures, rows are ready."""
    cells = "".join(
        f'<th scope="col"{" class=num" if head.startswith("#") else ""}>{escape(head.lstrip("#"))}</th>'
        for head in heads
    )
    body = "\n".join(rows)
    return (
        f'<div class="scroll" tabindex="0" role="region" aria-label="{escape(caption)}"><table>'
        f"<thead><tr>{cells}</tr></thead><tbody>\n{body}\n</tbody></table></div>"
    )


def card(entries: Iterable[tuple[str, object]]) -> str:
    """Terms with what they are."""
    rows = "".join(f"<dt>{escape(key)}</dt><dd>{escape(str(value))}</dd>" for key, value in entries)
    return f'<dl class="card">{rows}</dl>'


@dataclass(frozen=True)
class Section:
    """A part of the page under a title of its own; one without a body is left out.

    Attributes:
        identity: what links lead to.
        title: as text.
        body: as HTML.
    """

    identity: str
    title: str
    body: str

    @property
    def link(self) -> str:
        """What leads to it."""
        return f'<a href="#{self.identity}">{escape(self.title)}</a>'

    @property
    def html(self) -> str:
        """All of it."""
        head = f'<h2 id="{self.identity}-title">{escape(self.title)}</h2>'
        return f'<section id="{self.identity}" aria-labelledby="{self.identity}-title">{head}\n{self.body}\n</section>'


def section(identity: str, title: str, *parts: str) -> Section:
    """A section of the parts that there are."""
    return Section(identity, title, "\n".join(part for part in parts if part))
