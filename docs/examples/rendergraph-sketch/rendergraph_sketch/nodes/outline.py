"""Ink along edges."""

from __future__ import annotations

from rendergraph.api import Depth, Input, Node, Normal, Output, Radiance, param


class Outline(Node):
    """Radiance with ink where the surface ends, jumps or bends.

    A texel is inked where a neighbour lies off the plane of its own surface by more than `gap`, or faces another way by
    more than `crease` (after Saito and Takahashi 1990). Lines lie on both sides of an edge.
    """

    radiance = Input(Radiance, doc="What is drawn over.")
    depth = Input(Depth, doc="Where surfaces are.")
    normal = Input(Normal, doc="Which way they face; 0 where nothing is.")
    inked = Output(like="radiance", doc="The same with lines.")

    width: float = param(default=2.0, unit="texels", min=1, max=32, doc="Width of a line.")
    gap: float = param(default=0.02, min=0.001, max=1, doc="Smallest jump that is drawn, as a part of the distance.")
    crease: float = param(default=30.0, unit="degrees", min=1, max=180, doc="Smallest bend that is drawn.")
    ink: tuple[float, float, float] = param(default=(0.01, 0.01, 0.02), min=0, doc="Colour of the lines, linear RGB.")
