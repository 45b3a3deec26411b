"""Lighting of a multisampled G-buffer, every sample only where they differ."""

from __future__ import annotations

from typing import Any

from rendergraph.api import Any as AnyTexel
from rendergraph.api import Blend, Depth, Facts, Internal, Output, State, Stencil, StencilFace, Steps, param

from ..display._mip_means import fill_mips
from ._image_lighting import ImageLighting, samples_stored
from .deferred_lighting import DeferredLighting

_EDGE = 1
_TILE = 4  # texels along a side; what some rasterisers shade at once
_LOOKED_AT = ("depth", "albedo", "normal", "material", "emissive", "specular")


def half_of_depth(_node: DeferredMultisampled, facts: Facts) -> tuple[int, int]:
    """Half the picture's size, rounded down as levels of a mip chain are."""
    depth = facts.input("depth").desc
    assert depth is not None
    return depth.mip_size(1)


def bytes_of_tiles(_node: DeferredMultisampled, facts: Facts) -> int:
    """Two draw commands of five words, and for each a word a tile."""
    depth = facts.input("depth").desc
    assert depth is not None
    return 4 * 2 * (5 + -(-depth.width // _TILE) * -(-depth.height // _TILE))


class DeferredMultisampled(DeferredLighting):
    """Radiance of a multisampled G-buffer, each sample lit by itself at edges, one light for all of them elsewhere.

    A G-buffer cannot be averaged and then lit: the mean of two surfaces is none. To light every sample is right, and
    costs as many times as there are samples, though in most pixels all of them lie on one triangle. So pixels whose
    samples differ are marked in the stencil (Lauritzen 2010), by depth, normal and material: every pixel is lit once,
    in the middle of what is alike, and those that are marked sample by sample. Edges of shadows within a surface do not
    show in a G-buffer. For them shadows are looked up at two samples on either side of each pixel's middle, which take
    turns from pixel to pixel: pixels between which and beside which they differ are marked, too, and the mean of both
    lights the others. The picture is that of `deferred_lighting`, which lights every sample. With one sample a pixel it
    is that node.
    """

    edges = Output(AnyTexel, format="r8", doc="1 where the samples of a pixel are lit one by one, 0 elsewhere.")
    edge_share = Output(AnyTexel, format="r32f", size=(1, 1), doc="The share of pixels with samples lit one by one.")
    marks = Internal(Depth, format="depth24_stencil8", samples=samples_stored, clear=0.0)
    shadow_difference = Internal(format="r8", samples=samples_stored)
    tiles = Internal(kind="buffer", bytes=bytes_of_tiles)
    means = Internal(format="r32f", size=half_of_depth, mips=0)

    normal_angle: float = param(
        default=1.0, unit="°", min=0, max=180, doc="Between normals of samples; what differs more is an edge."
    )
    depth_angle: float = param(
        default=15.0, unit="°", min=0, max=90, doc="Between the way from sample to sample and the surface."
    )
    shadow_change: float = param(
        default=0.05,
        min=0,
        max=1,
        doc="Share of the light that shadows take at one sample and not at another; more is an edge. 1 finds none.",
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
        looked_at = {name: reads[name] for name in _LOOKED_AT if name in reads}
        steps.fullscreen("deferred_edges.frag", out={"edges": self.edges}, **looked_at, label="edges")
        lit: dict[str, Any] = {}
        if steps.connected(self.lookup) and self.wants_lights(steps):
            lit = {"shadow_difference": self.shadow_difference}
        steps.fullscreen(
            "deferred_lighting.frag",
            out=self.pictures(steps) | lit,
            defines={"SHADE_ONCE": 1},
            label="pixels",
            edges=self.edges,
            **reads,
        )
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
        steps.fullscreen("edge_stencil.frag", out=self.marks, edges=self.edges, state=marking, label="marks")
        steps.clear(self.tiles)
        steps.compute(
            "edge_tiles.comp",
            over=tuple(-(-side // _TILE) for side in steps.desc(self.edges).size),
            out={"tiles": self.tiles},
            defines={"TILE": _TILE, **({"HAS_SHADOW_DIFFERENCE": 1} if lit else {})},
            label="marked tiles",
            edges=self.edges,
            **lit,
        )
        self.light_marked(steps, reads, first=0 if lit else 1)
        self.blend_over(steps)
        if steps.used(self.edge_share):
            steps.fullscreen("<downsample.frag>", source=self.edges, out=self.means.mip(0))
            last = fill_mips(steps, self.means)
            steps.fullscreen("<downsample.frag>", source=self.means.mip(last), out=self.edge_share)

    def light_marked(self, steps: Steps, reads: dict[str, Any], first: int) -> None:
        """Light samples of marked pixels, in tiles: some rasterisers ask the stencil after the shader has run.

        The first sample of what surfaces mark has been lit with all pixels. So it is drawn in tiles alone where a
        shadow marks something, and nowhere where there are none. A tile is a point, as the two triangles of a square
        would both shade the texels along its diagonal, if not all of them.

        Args:
            steps: what records it.
            reads: what lighting reads.
            first: the first sample that may have to be lit.
        """
        marked = Stencil(StencilFace(func="equal", reference=_EDGE))
        for number in range(first, steps.desc(self.depth).samples):
            steps.draw(
                "deferred_lighting.frag",
                vertex="edge_tiles.vert",
                vertices=self.tiles,
                topology="points",
                command=0 if number else 1,
                out={**self.pictures(steps), "marks": self.marks},
                defines={"ONE_SAMPLE": 1, "TILE": _TILE},
                state=State(depth_test=False, depth_write=False, cull="none", stencil=marked),
                label=f"sample {number}",
                tiles=self.tiles,
                screen=steps.desc(self.edges).size,
                sample_number=number,
                **reads,
            )
