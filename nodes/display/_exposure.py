"""The size of mip chains that begin at half the picture's."""

from __future__ import annotations

from typing import Any

from rendergraph.api import Facts


def half_of_radiance(_node: Any, facts: Facts) -> tuple[int, int]:
    """Half the size of the input `radiance`, rounded down as levels of a mip chain are; at least one texel."""
    desc = facts.input("radiance").desc
    assert desc is not None
    return desc.mip_size(1)
