"""Means of whole pictures, down a mip chain whose levels are exact at any size."""

from __future__ import annotations

from rendergraph.api import Internal, Steps


def halve_down(steps: Steps, chain: Internal) -> int:
    """Fill every level of a chain with the means of the level above, the first of which is there.

    Returns:
        The last level, which is one texel.
    """
    last = steps.desc(chain).mips - 1
    for level in range(last):
        steps.fullscreen("<downsample.frag>", source=chain.mip(level), out=chain.mip(level + 1))
    return last
