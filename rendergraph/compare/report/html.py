"""HTML of comparisons: pictures as data, figures as text, isolated SVG documents; and what a notebook shows."""

from __future__ import annotations

import base64
import math
import re
from collections.abc import Iterable, Sequence
from html import escape
from pathlib import Path

import numpy as np
import numpy.typing as npt

from rendergraph.compare.timing import Spread
from rendergraph.images import picture_bytes, viewable
from rendergraph.metrics import Encoding, Pixels

SOFTWARE = "software rasteriser: not comparable to a GPU"


def template(name: str, **words: str) -> str:
    """Return a file beside this module with `@words@` filled in."""
    text = Path(__file__).with_name(name).read_text(encoding="utf-8")
    return re.sub(r"@(\w+)@", lambda found: words[found[1]], text)


def software_note(software: bool) -> str:
    return f'<p class="software">Times on a {SOFTWARE}.</p>' if software else ""


def png(pixels: npt.NDArray[np.uint8]) -> str:
    data = picture_bytes((Path("picture.png"), pixels, None, "data", False), {})
    return "data:image/png;base64," + base64.b64encode(data).decode()


def eight_bit(pixels: Pixels, encoding: Encoding) -> npt.NDArray[np.uint8]:
    return viewable(pixels, {"display": "display_color", "linear": "radiance"}.get(encoding, "any"))


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


def section(identity: str, title: str, *parts: str) -> tuple[str, str]:
    """Return a link to a section, and the section; both are empty without content."""
    body = "\n".join(filter(None, parts))
    if not body:
        return "", ""
    head = f'<h2 id="{identity}-title">{escape(title)}</h2>'
    html = f'<section id="{identity}" aria-labelledby="{identity}-title">{head}\n{body}\n</section>'
    return f'<a href="#{identity}">{escape(title)}</a>', html
