"""Deferred lighting of a multisampled G-buffer, per sample only where samples differ."""

from __future__ import annotations

from typing import Any

from rendergraph.api import Any as AnyTexel
from rendergraph.api import Blend, Depth, Facts, Internal, Output, State, Stencil, StencilFace, Steps, param

from ..display._mip_means import fill_mips
from ._image_lighting import ImageLighting, gbuffer_samples
from .deferred_lighting import DeferredLighting

_EDGE = 1
_TILE = 4  # texels along a side; the block size in which some rasterisers shade
_COMPARED = ("depth", "albedo", "normal", "material", "emissive", "specular")


def half_size(_node: DeferredMultisampled, facts: Facts) -> tuple[int, int]:
    """Return half the size of the depth, rounded down as in a mip chain."""
    depth = facts.input("depth").desc
    assert depth is not None
    return depth.mip_size(1)


def tile_bytes(_node: DeferredMultisampled, facts: Facts) -> int:
    """Return the size of two draw commands of five words, and of a list of all tiles for each of them."""
    depth = facts.input("depth").desc
    assert depth is not None
    return 4 * 2 * (5 + -(-depth.width // _TILE) * -(-depth.height // _TILE))


class DeferredMultisampled(DeferredLighting):
    """Light a multisampled G-buffer per sample at edges, and once per pixel elsewhere.

    A G-buffer cannot be averaged before lighting, because the mean of two surfaces is not a surface. Lighting every
    sample is correct, but multiplies the cost by the sample count, although in most pixels all samples lie on one
    triangle. Therefore pixels whose samples differ in depth, normal or material are marked in the stencil (Lauritzen
    2010). Every pixel is lit once, and marked pixels are lit per sample. Shadow edges within a surface do not show in a
    G-buffer. To find them, visibility is looked up at two samples on opposite sides of each pixel's centre, which
    alternate from pixel to pixel. Where the two differ, or those of a neighbour, the pixel is marked, too; elsewhere
    their mean is used. The picture matches that of `deferred_lighting`, which lights every sample. With one sample per
    pixel, both nodes are identical.
    """

    edges = Output(AnyTexel, format="r8", doc="1 in pixels that are lit per sample, else 0.")
    edge_share = Output(AnyTexel, format="r32f", size=(1, 1), doc="Fraction of the pixels that are lit per sample.")
    marks = Internal(Depth, format="depth24_stencil8", samples=gbuffer_samples, clear=0.0)
    shadow_difference = Internal(format="r8", samples=gbuffer_samples)
    tiles = Internal(kind="buffer", bytes=tile_bytes)
    edge_mips = Internal(format="r32f", size=half_size, mips=0)

    normal_angle: float = param(
        default=1.0, unit="°", min=0, max=180, doc="Largest angle between the normals of samples on one surface."
    )
    depth_angle: float = param(
        default=15.0,
        unit="°",
        min=0,
        max=90,
        doc="Largest angle between the surface and the line from sample to sample.",
    )
    shadow_change: float = param(
        default=0.05,
        min=0,
        max=1,
        doc="Largest difference of visibility, weighted by light, that is not an edge; 1 finds no shadow edges.",
    )

    def record(self, steps: Steps) -> None:
        """Record edge detection, stencil marks, lighting per pixel and per marked sample, then transparent surfaces."""
        if steps.desc(self.depth).samples == 1:
            steps.clear(self.edges)
            steps.clear(self.edge_share)
            super().record(steps)
            return
        ImageLighting.record(self, steps)
        reads = self.gbuffer_reads(steps) | self.direct_reads(steps) | self.ambient_reads(steps) | self.air_reads(steps)
        compared = {name: reads[name] for name in _COMPARED if name in reads}
        steps.fullscreen("deferred_edges.frag", out={"edges": self.edges}, **compared, label="edges")
        difference: dict[str, Any] = {}
        if steps.connected(self.lookup) and self.wants_lights(steps):
            difference = {"shadow_difference": self.shadow_difference}
        steps.fullscreen(
            "deferred_lighting.frag",
            out=self.color_targets(steps) | difference,
            defines={"SHADE_ONCE": 1, **self.backdrop_defines(steps)},
            label="pixels",
            edges=self.edges,
            **reads,
        )
        if difference:
            steps.fullscreen(
                "shadow_edges.frag",
                out={"edges": self.edges},
                state=State(blend=Blend("one", "one", op="max")),
                label="shadow edges",
                depth=self.depth,
                **difference,
            )
        face = StencilFace(reference=_EDGE, depth_pass="replace")
        marking = State(depth_test=False, depth_write=False, stencil=Stencil(face))
        steps.fullscreen("edge_stencil.frag", out=self.marks, edges=self.edges, state=marking, label="edge stencil")
        steps.clear(self.tiles)
        steps.compute(
            "edge_tiles.comp",
            over=tuple(-(-side // _TILE) for side in steps.desc(self.edges).size),
            out={"tiles": self.tiles},
            defines={"TILE": _TILE, **({"HAS_SHADOW_DIFFERENCE": 1} if difference else {})},
            label="edge tiles",
            edges=self.edges,
            **difference,
        )
        self._light_marked_samples(steps, reads, first=0 if difference else 1)
        self.draw_backdrop_and_transparent(steps)
        if steps.used(self.edge_share):
            steps.fullscreen("<downsample.frag>", source=self.edges, out=self.edge_mips.mip(0))
            last = fill_mips(steps, self.edge_mips)
            steps.fullscreen("<downsample.frag>", source=self.edge_mips.mip(last), out=self.edge_share)

    def _light_marked_samples(self, steps: Steps, reads: dict[str, Any], first: int) -> None:
        """Light the samples of marked pixels, drawing only tiles that contain any.

        Some rasterisers test the stencil after shading, so a full-screen pass would shade every pixel. At surface
        edges, sample 0 has been lit together with all pixels, so it is drawn only in tiles with shadow edges. Tiles
        are points, because both triangles of a quad would shade the texels along its diagonal.

        Args:
            steps: records the steps.
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
                out={**self.color_targets(steps), "marks": self.marks},
                defines={"ONE_SAMPLE": 1, "TILE": _TILE, **self.backdrop_defines(steps)},
                state=State(depth_test=False, depth_write=False, cull="none", stencil=marked),
                label=f"sample {number}",
                tiles=self.tiles,
                screen=steps.desc(self.edges).size,
                sample_number=number,
                **reads,
            )
