"""The light that a pipeline computes, before bloom and display, and its display chain applied to other light.

All light of a picture passes through a few textures. In `full`, for example, it passes through `gi.radiance`: bloom,
exposure and display read the scene's light there and nowhere else. The first of these textures, from the scene on, is
the pipeline's light. In terms of graphs it is the first radiance that dominates the output transform (Lengauer and
Tarjan 1979): every path from the scene to the transform contains it.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt
from msgspec.structs import replace

from rendergraph.catalog import NodeType
from rendergraph.declare import Internal, Node, Output
from rendergraph.errors import InputError, Problem
from rendergraph.expand import CAMERA
from rendergraph.facts import TextureInfo
from rendergraph.link import Endpoint, Graph, GraphNode
from rendergraph.session import RenderOptions, stages
from rendergraph.textures import FORMATS
from rendergraph.textures import Any as AnyTexel

if TYPE_CHECKING:
    import networkx as nx

    from rendergraph.metrics import Pixels
    from rendergraph.session.gpu import Gpu
    from rendergraph.session.values import Planned
    from rendergraph.steps import Frame, Steps

LIGHT = "light before display"
"""Name of the output that is added for the light; no output of a file can have it."""
_SCENE, _PICTURE = Endpoint("", "scene"), Endpoint("", "picture")


def light_of(graph: Graph) -> Endpoint:
    """Return the port that holds the pipeline's light, of the picture's size; there must be exactly one (RG525)."""
    import networkx as nx  # needed for a truth alone, and slow to import

    ports, shown = _ports(graph), graph.outputs.get("image", graph.outputs.get("radiance"))
    if shown is not None and shown in ports:
        # Output transforms, which turn radiance into colours; nodes after them work on the picture.
        ends = {end for end in {shown, *nx.ancestors(ports, shown)} if _is_transform(graph, end)} or {shown}
        ports.add_edges_from((end, _PICTURE) for end in ends)
        dominators: dict[Endpoint, Endpoint] = nx.immediate_dominators(ports, _SCENE)
        found, end = [], dominators.get(_PICTURE, _SCENE)
        while end != _SCENE:
            found.append(end)
            end = dominators[end]
        for end in reversed(found):
            info = graph.textures.get(end)
            if info is not None and info.semantic.name == "radiance" and _is_picture(info, graph.size):
                return end
    text = f"pipeline '{graph.name}' has no single texture of radiance that its picture is made of"
    raise InputError(Problem("RG525", f"{text}; compare pipelines with one output transform, or name a port: --metric"))


def with_light(planned: Planned, light: Endpoint | None) -> Planned:
    """Return a pipeline that has its light among its outputs; the same one where that is not needed."""
    if light is None:
        return planned
    graph = planned.linked.graph
    linked = replace(planned.linked, graph=replace(graph, outputs={**graph.outputs, LIGHT: light}))
    return stages.plan(stages.expand(linked, planned.options))


def displayed(gpu: Gpu, planned: Planned, light: Endpoint, pixels: Pixels, output: str, frame: int) -> Pixels:
    """Apply a pipeline's display chain to other light, with the exposure frozen, and return the output.

    Textures of one texel that the chain derives from the whole picture keep the values of the pipeline's own light.

    Args:
        light: the port that the chain begins with.
        pixels: what it holds instead, (height, width, channels), the top row first.
        frame: the frame that is drawn; the chain remembers the frames before.
    """
    import networkx as nx  # as above

    graph, frames = planned.linked.graph, range(1, frame + 1)
    if graph.outputs[output] == light:
        return pixels
    behind = nx.descendants(_ports(graph), light)
    read = {end.now for node in graph.nodes for ends in node.inputs.values() for end in ends}
    figures = [end for end in graph.textures if end in behind & read and _is_figure(graph.textures[end])]
    given = {light: pixels}
    if figures:
        options = RenderOptions(frames=frames, outputs=(), taps=tuple(map(str, figures)))
        tapped = stages.draw_last(stages.expand(planned.linked, options), gpu)
        given |= {end: tapped.arrays[str(end)] for end in figures}
    linked = replace(planned.linked, graph=_with_given(graph, given))
    return stages.draw_last(stages.expand(linked, RenderOptions(frames=frames, outputs=(output,))), gpu).arrays[output]


def _ports(graph: Graph) -> nx.DiGraph[Endpoint]:
    """Return all ports, each with an edge to the outputs of the nodes that read it; nodes without links read the scene.

    That a node draws the scene besides, as one does that adds transparent surfaces, shows in the depth that it reads.
    """
    import networkx as nx  # as above

    ports: nx.DiGraph[Endpoint] = nx.DiGraph()
    ports.add_node(_SCENE)
    for node in graph.nodes:
        sources = {end.now for ends in node.inputs.values() for end in ends} or {_SCENE}
        for name in node.node.outputs():
            ports.add_edges_from((source, Endpoint(node.id, name)) for source in sources)
    return ports


def _is_transform(graph: Graph, end: Endpoint) -> bool:
    if end not in graph.textures or graph.textures[end].semantic.name != "display_color":
        return False
    sources = {source.now for ends in graph[end.node].inputs.values() for source in ends}
    return any(graph.textures[source].semantic.name == "radiance" for source in sources if source in graph.textures)


def _is_picture(info: TextureInfo, size: tuple[int, int]) -> bool:
    desc = info.desc
    return desc is not None and (desc.kind, desc.size, desc.samples) == ("texture2d", size, 1)


def _is_figure(info: TextureInfo) -> bool:
    return _is_picture(info, (1, 1)) and info.desc is not None and FORMATS[info.desc.format].family == "float"


# --- textures with given contents ------------------------------------------------------------------------------------


def _with_given(graph: Graph, contents: Mapping[Endpoint, Pixels]) -> Graph:
    """Return a graph in which everything that reads these ports reads the given contents instead."""
    members, textures, renamed = dict(graph.members), dict(graph.textures), {}
    for number, (end, pixels) in enumerate(contents.items()):
        node, info = f"given-{number}", graph.textures[end]
        texels, texture = Endpoint(node, "texels"), Endpoint(node, "color")
        values = _four_channels(pixels)
        cls = _given_class(values)
        kind = NodeType("given", "", cls, Path(__file__), Path(__file__).parent, "compare")
        members[node] = GraphNode(node, kind, cls(), {}, clears={"texels": None, "color": None})
        textures[texels] = TextureInfo(None, AnyTexel, bytes=values.nbytes)
        textures[texture] = replace(info, view=CAMERA if info.view else None, lights=())
        renamed[end] = texture
    for name, one in graph.members.items():
        inputs = {
            port: tuple(renamed[end.now]._replace(previous=end.previous) if end.now in renamed else end for end in ends)
            for port, ends in one.inputs.items()
        }
        members[name] = replace(one, inputs=inputs)
    return replace(graph, members=members, textures=textures)


def _given_class(values: npt.NDArray[np.float32]) -> type[Node]:
    """Return the class of a node whose texture holds these texels, (height, width, 4)."""
    size = {"SIZE_X": values.shape[1], "SIZE_Y": values.shape[0]}

    class Given(Node):
        """A texture with given contents."""

        texels = Internal(AnyTexel, kind="buffer", bytes=values.nbytes)
        color = Output(AnyTexel, doc="The texture.")

        def record(self, steps: Steps) -> None:
            steps.fullscreen("given.frag", texels=self.texels, out=self.color, defines=size)

        def update(self, frame: Frame) -> None:
            frame.write(self.texels, values)

    return Given


def _four_channels(pixels: Pixels) -> npt.NDArray[np.float32]:
    values = pixels.astype(np.float32) / np.float32(255 if pixels.dtype == np.uint8 else 1)
    alpha = np.ones((*values.shape[:2], 4 - values.shape[-1]), np.float32)
    return np.ascontiguousarray(np.concatenate([values, alpha], axis=-1))
