"""HTML of comparisons: pictures as data, figures as text, tables and isolated SVG documents."""

from __future__ import annotations

import base64
import math
import re
from collections.abc import Iterable, Sequence
from html import escape
from pathlib import Path

import numpy as np
import numpy.typing as npt

from rendergraph.compare.results import Comparison
from rendergraph.compare.timing import Spread
from rendergraph.images import heat_map, picture_bytes, signed_map, viewable
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


# --- pictures --------------------------------------------------------------------------------------------------------


def viewer(comparison: Comparison) -> str:
    """Return two pictures under a slider; the reference is the first one if it is not a variant."""
    pictures = [] if comparison.reference.kind == "variant" else [("pic-ref", comparison.reference.name)]
    pictures += [(f"pic-{n}", result.name) for n, result in enumerate(comparison.results) if result.pixels is not None]

    def options(chosen: int) -> str:
        return "".join(
            f'<option value="{identity}"{" selected" if place == chosen else ""}>{escape(label)}</option>'
            for place, (identity, label) in enumerate(pictures)
        )

    return template("viewer.html", options_a=options(0), options_b=options(min(1, len(pictures) - 1))).rstrip("\n")


def sheet(comparison: Comparison, most: int) -> str:
    """Return every picture with its FLIP map beneath; without maps for more than `most` variants."""
    figures = []
    reference = comparison.reference
    if reference.kind != "variant":
        source = png(eight_bit(reference.pixels, reference.encoding))
        figures.append(_figure("pic-ref", source, f"{reference.name}, the reference"))
    few, maps = len(comparison.results) <= most, 0
    for place, result in enumerate(comparison.results):
        if result.pixels is None:
            continue
        figure = _figure(f"pic-{place}", png(eight_bit(result.pixels, result.encoding)), result.name)
        if few and result.flip_map is not None:
            maps += 1
            figure += _figure("", png(heat_map(result.flip_map)), f"FLIP {number(result.metrics.flip)}")
        figures.append(f"<div>{figure}</div>")
    # Pictures that were read from a sweep's folder have no map.
    note = f"Beneath each is FLIP against {escape(reference.name)}, dark where equal." if maps else ""
    return f'<div class="sheet">{"".join(figures)}</div><p class="quiet">{note}</p>'


def _figure(identity: str, source: str, caption: str) -> str:
    own, alt = f' id="{identity}"' if identity else "", escape(caption)
    return f'<figure><img{own} src="{source}" alt="{alt}"><figcaption>{alt}</figcaption></figure>'


def signed_sheet(comparison: Comparison, most: int) -> str:
    """Return the signed difference of each variant's light to a truth; empty without a truth."""
    figures = []
    for result in comparison.results[:most]:
        if result.signed_map is not None:
            values = result.signed_map.astype("f4")
            dark, bright = float((values < -0.1).mean()), float((values > 0.1).mean())
            shares = f"{100 * dark:.0f} % of the pixels are too dark by more than a tenth, "
            shares += f"{100 * bright:.0f} % too bright"
            figures.append(_figure("", png(signed_map(values)), f"{result.name}: {shares}"))
    if not figures:
        return ""
    note = f"Blue is darker than {escape(comparison.reference.name)} and orange brighter, both at full strength "
    note += "from a half; black is equal."
    return f'<div class="sheet">{"".join(figures)}</div><p class="quiet">{note}</p>'


def first_differences(comparison: Comparison) -> str:
    parts = []
    base = comparison.base[0] if comparison.base else ""
    for result in comparison.results:
        if result.difference is None or result.plan is None or result.name == base:
            continue
        first = result.first
        if first is None:
            same = f"every pass renders the same as in <code>{escape(base)}</code>, bit by bit"
            parts.append(f"<p>{escape(result.name)}: {same}.</p>")
            continue
        name = f"<code>{escape(first.node)}.{escape(first.port)}</code>"
        was = f" (there <code>{escape(first.base_node)}</code>)" if first.base_node != first.node else ""
        causes = ", ".join(f"<code>{escape(cause)}</code>" for cause in first.causes)
        why = f" Structural differences up to there: {causes}." if causes else ""
        pair = "".join(
            _figure("", png(viewable(pixels, first.semantic)), f"{first.node}.{first.port} of {whose}")
            for pixels, whose in zip(first.pixels, (base, result.name), strict=True)
        )
        head = f"{escape(result.name)}: {name}{was}{escape(first.after)}, {first.amount}"
        parts.append(
            f"<details><summary>{head}</summary><p>Differs first from <code>{escape(base)}</code>.{why}</p>"
            f'<div class="pair">{pair}</div></details>'
        )
    return "\n".join(parts)
