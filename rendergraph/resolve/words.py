"""Which words of a file are names, and which are paths."""

from __future__ import annotations

import re

_BARE = re.compile(r"[A-Za-z0-9_-]+\Z")


def is_bare(text: str) -> bool:
    """Whether a word names something shipped or installed, rather than a path."""
    return bool(_BARE.match(text))
