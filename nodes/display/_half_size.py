"""The size of mip chains that start at half the size of the picture."""

from __future__ import annotations

from typing import Any

from rendergraph.api import Facts


def half_radiance_size(_node: Any, facts: Facts) -> tuple[int, int]:
    """Return half the size of the input `radiance`, rounded down like mip levels; at least one texel."""
    desc = facts.input("radiance").desc
    assert desc is not None
    return desc.mip_size(1)
