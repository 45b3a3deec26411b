"""What a texel shows has moved: what draws geometry says how far."""

from __future__ import annotations

from rendergraph.api import Output, Semantic

from ._samples import own_samples

Velocity = Semantic(
    "velocity",
    "How far what is there has moved since the last frame, in widths and heights of the picture, unjittered.",
)


def drawn_velocity() -> Output:
    """The port of a node that draws it; readers know from the depth where nothing is."""
    doc = "Movement since the last frame, of surfaces and camera, in widths and heights of the picture; 0 in the first."
    return Output(Velocity, format="rg16f", clear=0.0, samples=own_samples, doc=doc)
