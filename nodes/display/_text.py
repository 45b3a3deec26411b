"""What shaders can write: characters as numbers."""

from __future__ import annotations

GLYPHS = "0123456789ABCDEFGHIJKLMNOPQRSTUVWXYZ.-+/=_:%? "
"""In the order of the table in `text.glsl`, which has capitals alone."""


def characters(text: str, length: int) -> list[int]:
    """The numbers of a text's characters, cut or filled with blanks to a length; what there is none for is a `?`."""
    padded = text.upper()[:length].ljust(length)
    return [GLYPHS.index(one if one in GLYPHS else "?") for one in padded]
