"""Lighting of a multisampled G-buffer, every sample only where they differ."""

from __future__ import annotations

from typing import Any

from rendergraph.api import Any as AnyTexel
from rendergraph.api import Blend, Depth, Facts, Internal, Output, State, Stencil, StencilFace, Steps, param

from ..display._means import halve_down
from ._image_lighting import ImageLighting, samples_stored
from .deferred_lighting import DeferredLighting

_EDGE = 1
_TILE = 4


def half_of_depth(_node: DeferredMultisampled, facts: Facts) -> tuple[int, int]:
    """Half the picture's size, rounded down as levels of a mip chain are."""
    depth = facts.input("depth").desc
    assert depth is not None
    return depth.mip_size(1)


def tiles_of_depth(_node: DeferredMultisampled, facts: Facts) -> tuple[int, int]:
    """How many tiles cover the picture."""
    depth = facts.input("depth").desc
    assert depth is not None
    return -(-depth.width // _TILE), -(-depth.height // _TILE)


class DeferredMultisampled(DeferredLighting):
    """Radiance of a multisampled G-buffer, each sample lit by itself at edges, one light for all of them elsewhere.

    A G-buffer cannot be averaged and then lit: the mean of two surfaces is none. To light every sample is right, and
    costs as many times as there are samples, though in most pixels all of them lie on one triangle. So pixels whose
    samples differ are marked in the stencil (Lauritzen 2010), by depth, normal and base colour: every pixel is lit
    once, in the middle, and those that are marked sample by sample. Edges of shadows within a surface do not show in a
    G-buffer; they are found in that light of the middles, where the share of it that shadows leave does not run on
    straight from pixel to pixel. The picture is that of `deferred_lighting`, which lights every sample. With one sample
    a pixel it is that node.
    """

    edges = Output(AnyTexel, format="r8", doc="1 where the samples of a pixel are lit one by one, 0 elsewhere.")
    edge_share = Output(AnyTexel, format="r32f", size=(1, 1), doc="The share of pixels with samples lit one by one.")
    marks = Internal(Depth, format="depth24_stencil8", samples=samples_stored, clear=0.0)
    lit_share = Internal(format="r8", samples=samples_stored)
    tiles = Internal(format="r8", size=tiles_of_depth)
    means = Internal(format="r32f", size=half_of_depth, mips=0)

    normal_angle: float = param(
        default=1.0, unit="°", min=0, max=180, doc="Between normals of samples; what differs more is an edge."
    )
    depth_angle: float = param(
        default=15.0, unit="°", min=0, max=90, doc="Between the way from sample to sample and the surface."
    )

    shadow_change: float = param(
        default=0.02,
        min=0,
        max=2,
        doc="Bend of the lit share from pixel to pixel, above which it is an edge of a shadow.",
    )

    def record(self, steps: Steps) -> None:
        """Edges and their marks in the stencil, light for pixels and for marked samples; then what is blended."""
        if steps.desc(self.depth).samples == 1:
            steps.clear(self.edges)
            steps.clear(self.edge_share)
            super().record(steps)
            return
        ImageLighting.record(self, steps)
        reads = {**self.surface(steps), **self.shadows(steps), **self.ambient_light(steps)}
        looked_at = {name: reads[name] for name in ("depth", "albedo", "normal") if name in reads}
        steps.fullscreen("deferred_edges.frag", out={"edges": self.edges}, **looked_at, label="edges")
        lit: dict[str, Any] = {}
        if steps.connected(self.lookup) and self.wants_lights(steps):
            lit = {"lit_share": self.lit_share}
        # All pixels once, marked ones too: to leave those out costs more than the few are worth.
        steps.fullscreen("deferred_lighting.frag", out=self.pictures(steps) | lit, label="pixels", **reads)
        if lit:
            steps.fullscreen(
                "shadow_edges.frag",
                out={"edges": self.edges},
                state=State(blend=Blend("one", "one", op="max")),
                label="shadow edges",
                depth=self.depth,
                **lit,
            )
        here = StencilFace(reference=_EDGE, depth_pass="replace")
        marking = State(depth_test=False, depth_write=False, stencil=Stencil(here))
        steps.fullscreen("mark_edges.frag", out=self.marks, edges=self.edges, state=marking, label="marks")
        marked = Stencil(StencilFace(func="equal", reference=_EDGE))
        steps.fullscreen(
            "marked_tiles.frag", out=self.tiles, edges=self.edges, defines={"TILE": _TILE}, label="marked tiles"
        )
        columns, rows = steps.desc(self.tiles).size
        steps.draw(
            "deferred_lighting.frag",
            vertex="marked_tiles.vert",
            vertices=6 * columns * rows,
            out={**self.pictures(steps), "marks": self.marks},
            defines={**self.per_sample(steps), "TILE": _TILE},
            state=State(depth_test=False, depth_write=False, cull="none", stencil=marked),
            label="samples",
            tiles=self.tiles,
            screen=steps.desc(self.edges).size,
            **reads,
        )
        self.blend_over(steps)
        if steps.used(self.edge_share):
            steps.fullscreen("<halve.frag>", source=self.edges, out=self.means.mip(0))
            last = halve_down(steps, self.means)
            steps.fullscreen("<halve.frag>", source=self.means.mip(last), out=self.edge_share)
