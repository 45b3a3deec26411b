"""Characters that shaders can draw, as numbers."""

from __future__ import annotations

GLYPHS = "0123456789ABCDEFGHIJKLMNOPQRSTUVWXYZ.-+/=_:%? "
"""In the order of the table in `text.glsl`, which has capital letters only."""


def characters(text: str, length: int) -> list[int]:
    """Return the numbers of a text's characters, cut or padded with blanks to a length; unknown ones become `?`."""
    padded = text.upper()[:length].ljust(length)
    return [GLYPHS.index(one if one in GLYPHS else "?") for one in padded]
