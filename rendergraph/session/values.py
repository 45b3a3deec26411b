"""The values of the stages before the first use of GL, each with the value it was made from, and requested textures."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import TYPE_CHECKING, Self

from msgspec import Struct
from msgspec.structs import replace

from rendergraph.errors import InputError, Problem, suggestion
from rendergraph.expand import OF_SCENE, Expansion
from rendergraph.link import Endpoint, Graph, endpoint
from rendergraph.session.selection import TEXTURE_PART, RenderOptions, Selection
from rendergraph.textures import FORMATS, TextureDesc

if TYPE_CHECKING:
    from rendergraph.allocate import ResourcePlan
    from rendergraph.catalog import Catalog, NodeType
    from rendergraph.resolve import PipelineSpec
    from rendergraph.scene.model import Scene


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


# Requested textures ---------------------------------------------------------------------------------------------------


def requested_outputs(graph: Graph, options: RenderOptions) -> dict[str, OutputRequest]:
    """Return what must exist at the end of a frame, by the name of the output or tap."""
    requests: dict[str, OutputRequest] = {}
    problems = []
    for name in graph.outputs if options.outputs is None else options.outputs:
        if name in graph.outputs:
            requests[name] = OutputRequest(graph.outputs[name])
        else:
            hint = suggestion(name, graph.outputs)
            problems.append(Problem("RG205", f"pipeline '{graph.name}' has no output '{name}'{hint}"))
    for tap in options.taps:
        try:
            requests[tap] = _parse_tap(graph, tap)
        except InputError as error:
            problems += [p.relocate(None, code="RG206", context=f"--tap {tap}") for p in error.problems]
            continue
        end = requests[tap].end
        node = graph[end.node]
        problems += [
            Problem("RG116", f"--tap {tap}: it needs input '{name}' of '{end.node}', which is not connected")
            for name in getattr(node.node.ports()[end.port], "needs", ())
            if not node.inputs.get(name)
        ]
    if problems:
        raise InputError(problems)
    return requests


def figures(graph: Graph) -> tuple[str, ...]:
    """Return the outputs of the file that have a single texel: they are figures of a run."""
    infos = {name: graph.textures.get(end.now) for name, end in graph.outputs.items()}
    return tuple(
        name
        for name, info in infos.items()
        if info is not None and info.desc is not None and (*info.desc.size, info.desc.layers) == (1, 1, 1)
    )


def every_port(planned: Planned) -> tuple[str, ...]:
    """Return all ports whose textures the steps of a plan write, internals included, as taps, in order of execution."""
    graph, expansion = planned.linked.graph, planned.expansion
    held: dict[tuple[str, str], list[str]] = {}
    for end, resource in expansion.ports.items():
        if end not in OF_SCENE.values() and graph.textures[end].desc is not None:
            held.setdefault((end.node, resource), []).append(str(end))
    written = [
        tap
        for step in planned.plan.schedule.steps
        for write in step.writes
        for tap in held.get((step.node, write.resource), ())
    ]
    return tuple(reversed(dict.fromkeys(reversed(written))))


def _parse_tap(graph: Graph, tap: str) -> OutputRequest:
    """Parse a tap: `node.port`, `node.port[2]`, `node.port[2,mip=3]` or `node.port:stencil`."""
    found = re.fullmatch(r"([^\[:]*)" + TEXTURE_PART, tap)
    if found is None:
        text = "the part of a texture is [LAYER], [mip=N], [LAYER,mip=N] or :stencil after NODE.PORT"
        raise InputError(Problem("RG206", text))
    end = endpoint(graph, found[1])
    layer, mip = (None if found[name] is None else int(found[name]) for name in ("layer", "mip"))
    request = OutputRequest(end, layer, mip, stencil=found["stencil"] is not None)
    desc = graph.textures[end].desc
    if missing := request.lacks(desc):
        raise InputError(Problem("RG206", f"'{found[1]}' {missing}"))
    return request
