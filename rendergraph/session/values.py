"""What the stages before the first use of GL hand on, each with what it was made from."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Self

from msgspec import Struct
from msgspec.structs import replace

from rendergraph.textures import FORMATS, TextureDesc

if TYPE_CHECKING:
    from rendergraph.allocate import ResourcePlan
    from rendergraph.catalog import Catalog
    from rendergraph.errors import Problem
    from rendergraph.expand import Expansion
    from rendergraph.link import Endpoint, Graph
    from rendergraph.resolve import PipelineSpec
    from rendergraph.scene.model import Scene
    from rendergraph.session.selection import RenderOptions, Selection


class Wanted(Struct, frozen=True):
    """A port whose texture must exist at the end of a frame, and what of it is read.

    Attributes:
        end: the port.
        layer, mip: the part, None for all layers and for mip 0.
        stencil: read the stencil instead of the depth.
    """

    end: Endpoint
    layer: int | None = None
    mip: int | None = None
    stencil: bool = False

    def lacks(self, desc: TextureDesc | None) -> str | None:
        """What its port has not of the part that is asked for, as the end of a sentence that names the port."""
        if (self.layer, self.mip, self.stencil) == (None, None, False):
            return None
        if desc is None:
            return "is a buffer, which has no layers, no mips and no stencil"
        if desc.layers and (missing := desc.lacks(self.mip, self.layer)):
            return missing
        if self.stencil and FORMATS[desc.format].family != "depth_stencil":
            return f"has no stencil: its format is {desc.format}"
        return None


class Resolved(Struct, frozen=True, eq=False, kw_only=True):
    """The file with everything applied.

    Attributes:
        selection: what was asked for.
        catalog: the node types that can be used.
        spec: the resolved file.
        frames, fps: what is drawn where nobody says: the first frame, or the one that a picture shows.
    """

    selection: Selection
    catalog: Catalog
    spec: PipelineSpec
    frames: range = range(1, 2)
    fps: float = 30.0

    def __repr__(self) -> str:
        return f"<{type(self).__name__} {self.selection.source}>"

    def linked(self, scene: Scene, graph: Graph, missing: tuple[Problem, ...] = ()) -> Linked:
        """The same with its scene and its graph."""
        return Linked(
            selection=self.selection,
            catalog=self.catalog,
            spec=self.spec,
            frames=self.frames,
            fps=self.fps,
            scene=scene,
            graph=graph,
            missing=missing,
        )


class Linked(Resolved, frozen=True, eq=False, kw_only=True):
    """The checked graph with its scene.

    Attributes:
        scene: completed by a camera and a light where it has none.
        graph: typed nodes and links.
        missing: what a sketch lacks, such as node types that nobody has; nothing in what can be drawn.
    """

    scene: Scene
    graph: Graph
    missing: tuple[Problem, ...] = ()

    @property
    def warnings(self) -> tuple[Problem, ...]:
        """What was noticed in the pipeline and the scene and is no error."""
        return (*self.spec.notes, *self.graph.warnings, *self.scene.warnings, *self.missing)


class Expanded(Struct, frozen=True, eq=False):
    """The steps of what is wanted.

    Attributes:
        linked: where they come from.
        options: what was wanted of it.
        wanted: the ports that must exist at the end of a frame with the part that is read, by output name or tap.
        expansion: all steps with what they read and write.
    """

    linked: Linked
    options: RenderOptions
    wanted: Mapping[str, Wanted]
    expansion: Expansion

    def __repr__(self) -> str:
        return f"<{type(self).__name__} {self.linked.selection.source}>"

    def for_frames(self, frames: range, *, warm_up: bool = True, timed: bool = False) -> Self:
        """The same to be drawn for other frames, which changes neither steps nor plan."""
        return replace(self, options=replace(self.options, frames=frames, warm_up=warm_up, timed=timed))


class Planned(Expanded, frozen=True, eq=False):
    """Steps with their order and their memory."""

    plan: ResourcePlan
