"""Morphological antialiasing with areas from a table."""

from __future__ import annotations

from rendergraph.api import Any, DisplayColor, Input, Internal, Node, Output, Steps, param

LONGEST = 32
"""Texels that an edge is followed each way at the most."""


class SMAA(Node):
    """Smooth the edges of a finished picture by the shapes they have.

    Subpixel morphological antialiasing (Jimenez, Echevarria, Sousa and Gutierrez 2012), its orthogonal part, in three
    steps: edges where brightness changes; from each pixel at an edge the way to both ends, what crosses there, and how
    much of the pixel lies beyond the straight line that this makes of the stair; and the mix with the neighbour, in
    display light. The areas lie in a table over both ways and the nine shapes, computed once from their definition.
    """

    source = Input(DisplayColor, doc="The finished picture, as it is seen.")
    color = Output(like="source", doc="The same with smooth edges; alpha as it was.")
    areas = Internal(Any, format="rg16", size=(9 * (LONGEST + 1), LONGEST + 1), kept=True)
    edges = Internal(format="rg8", size="source")
    weights = Internal(format="rgba8", size="source")

    threshold: float = param(default=0.1, min=0, max=1, doc="Difference of brightness that is an edge.")
    dominance: float = param(
        default=2.0, min=1, max=100, doc="An edge beside another that is so many times as strong is none."
    )
    reach: int = param(default=16, min=1, max=LONGEST, unit="texels", doc="How far an edge is followed each way.")

    def record(self, steps: Steps) -> None:
        """The table, edges, weights, and the mix."""
        steps.fullscreen("smaa_areas.frag", out=self.areas, side=LONGEST + 1)
        steps.fullscreen("smaa_edges.frag", out=self.edges, source=self.source)
        steps.fullscreen("smaa_weights.frag", out=self.weights, edges=self.edges, areas=self.areas, side=LONGEST + 1)
        steps.fullscreen("smaa_blend.frag", out=self.color, source=self.source, weights=self.weights)
