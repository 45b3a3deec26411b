"""A contact sheet: many small pictures on one, each with its name beneath."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from rendergraph.images.view import Bytes

_WIDTH, _HEIGHT = 320, 180
_GAP, _LINE = 12, 18
_FONT = 14
_BACKGROUND, _NAME, _NOTE = 32, 0.95, 0.6


def contact_sheet(pictures: Sequence[tuple[Bytes, str, str]]) -> Bytes:
    """Pictures in rows, as many columns as make the sheet about as wide as high, each as large as 320×180 takes it.

    Args:
        pictures: (height, width, 1 or 3) each, with a name and a note that are written beneath. Where OpenImageIO has
            no font they stand there without words.

    Returns:
        (height, width, 3).
    """
    import OpenImageIO as oiio  # loaded with the first picture written

    columns = max(1, math.ceil(math.sqrt(len(pictures) * _HEIGHT / _WIDTH)))
    rows = math.ceil(len(pictures) / columns)
    across, down = _WIDTH + _GAP, _HEIGHT + 2 * _LINE + _GAP
    sheet = np.full((rows * down + _GAP, columns * across + _GAP, 3), _BACKGROUND, np.uint8)
    places = [(_GAP + number // columns * down, _GAP + number % columns * across) for number in range(len(pictures))]
    for (top, left), (picture, _, _) in zip(places, pictures, strict=True):
        small = _fitted(picture)
        y, x = top + (_HEIGHT - small.shape[0]) // 2, left + (_WIDTH - small.shape[1]) // 2
        sheet[y : y + small.shape[0], x : x + small.shape[1]] = small
    written = oiio.ImageBuf(sheet)
    for (top, left), (_, name, note) in zip(places, pictures, strict=True):
        for line, (text, grey) in enumerate(((name, _NAME), (note, _NOTE)), start=1):
            oiio.ImageBufAlgo.render_text(written, left, top + _HEIGHT + line * _LINE - 4, text, _FONT, "", (grey,) * 3)
    written.geterror()  # without a font; an error that nobody fetches is printed at the end
    return np.asarray(written.get_pixels(oiio.UINT8), np.uint8)


def _fitted(picture: Bytes) -> Bytes:
    """As large as a tile takes it: averaged where it shrinks, texels as squares where it grows."""
    import OpenImageIO as oiio  # loaded with the first picture written

    height, width = picture.shape[:2]
    scale = min(_WIDTH / width, _HEIGHT / height)
    size = max(1, round(width * scale)), max(1, round(height * scale))
    if scale >= 1:
        rows, columns = (np.arange(new) * old // new for new, old in ((size[1], height), (size[0], width)))
        return np.ascontiguousarray(picture[rows][:, columns])
    region = oiio.ROI(0, size[0], 0, size[1], 0, 1, 0, picture.shape[2])
    shrunk = oiio.ImageBufAlgo.resize(oiio.ImageBuf(np.ascontiguousarray(picture)), roi=region)
    return np.asarray(shrunk.get_pixels(oiio.UINT8), np.uint8)
