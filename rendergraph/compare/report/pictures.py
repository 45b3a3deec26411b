"""The page's pictures: two under a slider, all on a sheet, and the first passes that differ."""

from __future__ import annotations

from html import escape

from rendergraph.compare.report.html import eight_bit, number, png, template
from rendergraph.compare.results import Comparison
from rendergraph.images import heat_map, signed_map, viewable


def _pictures(comparison: Comparison) -> list[tuple[str, str]]:
    """Return identity and label of every picture, starting with the reference if it is not a variant."""
    own = [(f"pic-{n}", result.name) for n, result in enumerate(comparison.results) if result.pixels is not None]
    return own if comparison.reference.kind == "variant" else [("pic-ref", comparison.reference.name), *own]


def viewer(comparison: Comparison) -> str:
    pictures = _pictures(comparison)

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
            caption = f"{result.name}: {100 * dark:.0f} % of the pixels are too dark by more than a tenth, "
            caption += f"{100 * bright:.0f} % too bright"
            figures.append(_figure("", png(signed_map(values)), caption))
    if not figures:
        return ""
    note = f"Blue is darker than {escape(comparison.reference.name)} and orange brighter, both at full strength "
    note += "from a half; black is equal."
    return f'<div class="sheet">{"".join(figures)}</div><p class="quiet">{note}</p>'


def first_differences(comparison: Comparison) -> str:
    parts = []
    base = comparison.base[0] if comparison.base else ""
    for result in comparison.results:
        if result.difference is None or result.name == base:
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
