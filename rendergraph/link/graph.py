"""What linking makes: a networkx DAG of typed nodes and edges."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from rendergraph.catalog import NodeType
from rendergraph.declare import Choice, LightFacts, Node, TextureInfo
from rendergraph.errors import Place, Problem

if TYPE_CHECKING:
    import networkx as nx


@dataclass(frozen=True, order=True)
class Endpoint:
    """One port of one node; `previous` reads last frame's value."""

    node: str
    port: str
    previous: bool = False

    def __str__(self) -> str:
        return f"{self.node}.{self.port}" + ("@previous" if self.previous else "")


@dataclass(frozen=True)
class GraphNode:
    """A node with its validated parameters and its links.

    Attributes:
        id: key in the file; inside a sub-pipeline `glow/blur`.
        type: the type it is an instance of.
        node: the instance, holding parameter values.
        inputs: connected inputs only, in the order of declaration; a `many` input has several endpoints.
        place: where it stands.
        choices: parameters whose value a plugin brings, with the include it comes by.
    """

    id: str
    type: NodeType
    node: Node
    inputs: Mapping[str, tuple[Endpoint, ...]]
    place: Place | None = None
    choices: Mapping[str, Choice] = field(default_factory=dict)


@dataclass(frozen=True)
class Graph:
    """A checked pipeline.

    Attributes:
        name: the file's stem.
        dag: networkx.MultiDiGraph, frozen: node ids with attribute `node` (a GraphNode), in the file's order; one edge
            a link with `source_port`, `target_port`, `previous`. Links to `@previous` are edges with `previous=True`
            and left out of cycle checks.
        outputs: output name to the port it shows.
        size: width and height of the picture.
        lights: the scene's lights.
        textures: what every made port (outputs, internals, history, functions, views) has turned out to be, by
            `Endpoint(node, port)`; an `InOut` shares its source's.
        warnings: what was noticed and is no error.
        aliases: the outputs of sub-pipelines, `glow.radiance`, and the ports inside that they stand for.
        unfilled: what geometry steps may ask to draw and the scene has nothing of: `transparent`, `casters`, ….
    """

    name: str
    dag: nx.MultiDiGraph[str]
    outputs: Mapping[str, Endpoint]
    size: tuple[int, int]
    lights: tuple[LightFacts, ...] = ()
    textures: Mapping[Endpoint, TextureInfo] = field(default_factory=dict)
    warnings: tuple[Problem, ...] = ()
    aliases: Mapping[str, Endpoint] = field(default_factory=dict)
    unfilled: frozenset[str] = frozenset()

    def __getitem__(self, node: str) -> GraphNode:
        found: GraphNode = self.dag.nodes[node]["node"]
        return found

    @property
    def nodes(self) -> list[GraphNode]:
        """All nodes in the file's order."""
        return [data["node"] for _, data in self.dag.nodes(data=True)]
