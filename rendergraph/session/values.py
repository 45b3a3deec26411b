"""The values of the stages before the first use of GL, each with the value it was made from."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Self

from msgspec import Struct
from msgspec.structs import replace

from rendergraph.textures import FORMATS, TextureDesc

if TYPE_CHECKING:
    from rendergraph.allocate import ResourcePlan
    from rendergraph.catalog import Catalog, NodeType
    from rendergraph.errors import Problem
    from rendergraph.expand import Expansion
    from rendergraph.link import Endpoint, Graph
    from rendergraph.resolve import PipelineSpec
    from rendergraph.scene.model import Scene
    from rendergraph.session.selection import RenderOptions, Selection


class OutputRequest(Struct, frozen=True):
    """A port whose texture must exist at the end of a frame, and the part of it that is read."""

    end: Endpoint
    layer: int | None = None  # None for all
    mip: int | None = None  # None for 0
    stencil: bool = False  # instead of the depth

    def lacks(self, desc: TextureDesc | None) -> str | None:
        """Return why a texture lacks the requested part, as the end of a sentence that starts with the port."""
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
    """The file with everything applied; by default `frames` is the first frame, or as a picture was made."""

    selection: Selection
    catalog: Catalog
    spec: PipelineSpec
    frames: range = range(1, 2)
    fps: float = 30.0
    subframes: int = 1

    def __repr__(self) -> str:
        return f"<{type(self).__name__} {self.selection.label}>"


class Linked(Resolved, frozen=True, eq=False, kw_only=True):
    """The checked graph with its scene, which has at least a camera and a light; `missing` is what a sketch lacks."""

    scene: Scene
    graph: Graph
    missing: tuple[Problem, ...] = ()

    @property
    def node_types(self) -> dict[str, NodeType]:
        """The types of all nodes by id."""
        return {node.id: node.type for node in self.graph.nodes}

    @property
    def warnings(self) -> tuple[Problem, ...]:
        """All warnings about the pipeline and the scene."""
        return (*self.spec.notes, *self.graph.warnings, *self.scene.warnings, *self.missing)


class Expanded(Struct, frozen=True, eq=False):
    """The steps of all requested outputs and taps, which `requests` has by name."""

    linked: Linked
    options: RenderOptions
    requests: Mapping[str, OutputRequest]
    expansion: Expansion

    def __repr__(self) -> str:
        return f"<{type(self).__name__} {self.linked.selection.label}>"

    def for_frames(self, frames: range, *, warm_up: bool = True, timed: bool = False) -> Self:
        """Return the same for other frames, which changes neither steps nor plan."""
        return replace(self, options=replace(self.options, frames=frames, warm_up=warm_up, timed=timed))


class Planned(Expanded, frozen=True, eq=False):
    """Steps with their order and their memory, and the warnings of `check` about their shaders."""

    plan: ResourcePlan
    warnings: tuple[Problem, ...] = ()
