"""Pictures in a row over a table, as a notebook shows them: with styles of their own, for its page has others."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape

import numpy as np
import numpy.typing as npt

from rendergraph.compare.report.parts import png


def notebook_html(
    pictures: Sequence[tuple[str, npt.NDArray[np.uint8]]],
    heads: Sequence[str],
    rows: Sequence[Sequence[str]],
    about: str,
) -> str:
    """The whole as HTML.

    Args:
        pictures: captions and 8-bit pictures.
        heads: above the columns.
        rows: cells as text.
        about: a line beneath.
    """
    figures = "".join(_figure(caption, png(pixels)) for caption, pixels in pictures)
    lines = [_row("th", heads), *(_row("td", row) for row in rows)]
    return (
        f'<div style="display:flex;flex-wrap:wrap;gap:12px">{figures}</div>'
        f"<table>{''.join(lines)}</table><div>{escape(about)}</div>"
    )


def _row(cell: str, texts: Sequence[str]) -> str:
    return f"<tr>{''.join(f'<{cell}>{escape(text)}</{cell}>' for text in texts)}</tr>"


def _figure(caption: str, source: str) -> str:
    return (
        f'<figure style="margin:0;max-width:320px"><img src="{source}" alt="{escape(caption)}" '
        f'style="width:100%;border:1px solid #7d8590"><figcaption>{escape(caption)}</figcaption></figure>'
    )
