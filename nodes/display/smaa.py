"""Subpixel morphological antialiasing."""

from __future__ import annotations

from rendergraph.api import Any, DisplayColor, Input, Internal, Node, Output, Steps, define, param

MAX_REACH = 32
"""The largest number of texels to search along an edge on each side."""


class SMAA(Node):
    """Smooth the edges of a finished picture according to their patterns.

    The orthogonal part of subpixel morphological antialiasing (Jimenez, Echevarria, Sousa and Gutierrez 2012), in three
    steps: detection of edges in the luma; search for both ends and the crossing edges there, which determine the line
    that replaces the staircase, and the area of the pixel beyond it; and blending with the neighbour, in linear light.
    Areas come from a table over both distances and the nine patterns, computed once from their definition.
    """

    source = Input(DisplayColor, doc="The finished picture, display-referred.")
    color = Output(like="source", doc="The picture with smooth edges.")
    area_table = Internal(Any, format="rg16", size=(9 * (MAX_REACH + 1), MAX_REACH + 1), kept=True)
    edges = Internal(format="rg8", size="source")
    weights = Internal(format="rgba8", size="source")

    threshold: float = param(default=0.1, min=0, max=1, doc="Least difference of luma at an edge.")
    dominance: float = param(
        default=2.0, min=1, max=100, doc="Edges next to one that is stronger by this factor are dropped."
    )
    reach: int = param(
        default=16, min=1, max=MAX_REACH, unit="texels", doc="How far to search along an edge on each side."
    )

    transparent: bool = define(default=False, doc="Smooth alpha, too; colours are premultiplied by it.")

    def record(self, steps: Steps) -> None:
        """Record the table, edge detection, weights and blending."""
        steps.fullscreen("smaa_area_table.frag", out=self.area_table, side=MAX_REACH + 1)
        steps.fullscreen("smaa_edges.frag", out=self.edges, source=self.source)
        steps.fullscreen(
            "smaa_weights.frag", out=self.weights, edges=self.edges, area_table=self.area_table, side=MAX_REACH + 1
        )
        steps.fullscreen("smaa_blend.frag", out=self.color, source=self.source, weights=self.weights)
