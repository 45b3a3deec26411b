"""Means of pictures by mip chains whose levels are exact area means at any size."""

from __future__ import annotations

from rendergraph.api import Internal, Steps


def fill_mips(steps: Steps, chain: Internal, label: str = "") -> int:
    """Record the downsampling of a chain from its first level, and return the number of its last, one-texel level."""
    last = steps.desc(chain).mips - 1
    for level in range(last):
        steps.fullscreen("<downsample.frag>", source=chain.mip(level), out=chain.mip(level + 1), label=label)
    return last
