"""HTML of comparisons: pictures as data, figures as text, isolated SVG documents; and what a notebook shows."""

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

from rendergraph.compare.results import Comparison
from rendergraph.compare.timing import Spread
from rendergraph.images import heat_map, viewable, write
from rendergraph.metrics import Encoding, Pixels

MOST_NOTEBOOK_PICTURES = 6
SOFTWARE = "software rasteriser: no measure of a GPU"


def software_note(software: bool) -> str:
    return f'<p class="software">Times on a {SOFTWARE}.</p>' if software else ""


def png(pixels: npt.NDArray[np.uint8]) -> str:
    """Return a picture as a data URL."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "picture.png"
        write(path, pixels)
        return "data:image/png;base64," + base64.b64encode(path.read_bytes()).decode()


def eight_bit(pixels: Pixels, encoding: Encoding) -> npt.NDArray[np.uint8]:
    return viewable(pixels, {"display": "display_color", "linear": "radiance"}.get(encoding, "any"))


def img(identity: str, source: str, alt: str) -> str:
    own = f' id="{identity}"' if identity else ""
    return f'<img{own} src="{source}" alt="{escape(alt)}">'


def drawing(svg: str, label: str) -> str:
    """Return an SVG document in a shadow tree, which isolates its style sheet.

    A wide one shrinks to the page, down to 0.6 of its width; below that it would be illegible, and scrolls.
    """
    width = re.search(r'<svg [^>]*?\bwidth="([\d.]+)"', svg)
    least = f"min-width:{0.6 * float(width[1]):.0f}px;" if width else ""
    style = f"max-width:100%;{least}height:auto"
    svg = svg.replace("<style>", "<style>@media print{svg{min-width:0!important;width:100%}}", 1)
    svg = re.sub(r"<svg ", f'<svg role="img" style="{style}" aria-label="{escape(label)}" ', svg, count=1)
    return f'<div class="drawing"><template shadowrootmode="open">{svg}</template></div>'


def number(value: float | None, digits: int = 4) -> str:
    """Return a figure with a few digits, `–` for none."""
    if value is None or not math.isfinite(value):
        return "–"
    if value == 0:
        return "0"
    return f"{value:.{digits}f}" if abs(value) >= 10 ** (1 - digits) else f"{value:.1e}"


def milliseconds(spread: Spread | None, most: float = 0.0) -> str:
    """Return a table cell with a median, its spread beneath, and a bar relative to `most`."""
    if spread is None:
        return '<td class="num">–</td>'
    bar = f'<span class="bar" style="width:{100 * spread.median / most:.1f}%"></span>' if most > 0 else ""
    return f'<td class="num">{spread.median:.3f}{bar}<span class="spread">{spread.p10:.3f}–{spread.p90:.3f}</span></td>'


def table(heads: Sequence[str], rows: Iterable[str], caption: str) -> str:
    """Return a table; heads that begin with `#` are above figures, rows are HTML."""
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
    rows = "".join(f"<dt>{escape(key)}</dt><dd>{escape(str(value))}</dd>" for key, value in entries)
    return f'<dl class="card">{rows}</dl>'


@dataclass(frozen=True)
class Section:
    """A part of the page with a title; one without a body is left out."""

    identity: str
    title: str
    body: str

    @property
    def link(self) -> str:
        return f'<a href="#{self.identity}">{escape(self.title)}</a>'

    @property
    def html(self) -> str:
        head = f'<h2 id="{self.identity}-title">{escape(self.title)}</h2>'
        return f'<section id="{self.identity}" aria-labelledby="{self.identity}-title">{head}\n{self.body}\n</section>'


def section(identity: str, title: str, *parts: str) -> Section:
    return Section(identity, title, "\n".join(part for part in parts if part))


def notebook_html(comparison: Comparison) -> str:
    """Return pictures in a row above a table; their styles are inline, because the page around them has its own."""
    reference = comparison.reference
    figures = []
    if reference.kind != "variant":
        picture = eight_bit(reference.pixels, reference.encoding)
        figures.append(_notebook_figure(f"{reference.name}, the reference", picture))
    rendered = [result for result in comparison.results if result.pixels is not None]
    for result in rendered[:MOST_NOTEBOOK_PICTURES]:
        assert result.pixels is not None
        figures.append(_notebook_figure(result.name, eight_bit(result.pixels, result.encoding)))
        if result.flip_map is not None:
            caption = f"FLIP of {result.name}: {number(result.metrics.flip)}"
            figures.append(_notebook_figure(caption, heat_map(result.flip_map)))
    times = "GPU ms" if all(result.times.gpu_ms for result in comparison.results) else "ms"
    rows = [_notebook_row("th", ("", "FLIP", "RMSE", "PSNR dB", "SSIM", times))]
    for result in comparison.results:
        m, ms = result.metrics, number(result.times.headline.median, 2)
        psnr = "∞" if m.psnr is None else number(m.psnr, 2)
        rows.append(_notebook_row("td", (result.name, number(m.flip), number(m.rmse), psnr, number(m.ssim), ms)))
    scene = f"{comparison.scene}, " if comparison.scene else ""
    software = f"; {SOFTWARE}" if comparison.software else ""
    about = f"{scene}{comparison.size[0]}×{comparison.size[1]}, against {reference.name}{software}"
    return (
        f'<div style="display:flex;flex-wrap:wrap;gap:12px">{"".join(figures)}</div>'
        f"<table>{''.join(rows)}</table><div>{escape(about)}</div>"
    )


def _notebook_row(cell: str, texts: Sequence[str]) -> str:
    return f"<tr>{''.join(f'<{cell}>{escape(text)}</{cell}>' for text in texts)}</tr>"


def _notebook_figure(caption: str, pixels: npt.NDArray[np.uint8]) -> str:
    return (
        f'<figure style="margin:0;max-width:320px"><img src="{png(pixels)}" alt="{escape(caption)}" '
        f'style="width:100%;border:1px solid #7d8590"><figcaption>{escape(caption)}</figcaption></figure>'
    )
