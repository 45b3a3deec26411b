"""The result of linking: a graph of typed nodes and edges."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from functools import cached_property
from heapq import heappop, heappush
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple, TypeVar

from msgspec import Struct, field

from rendergraph.catalog import NodeType
from rendergraph.declare import Facts, Node, TextureInfo
from rendergraph.document import Value
from rendergraph.errors import Place, Problem, node_named
from rendergraph.facts import SELECTIONS
from rendergraph.ports import Texel
from rendergraph.textures import Sampler

if TYPE_CHECKING:
    import networkx as nx

T = TypeVar("T")


class Endpoint(NamedTuple):
    """One port of one node; `previous` reads last frame's value."""

    node: str
    port: str
    previous: bool = False

    def __str__(self) -> str:
        return f"{self.node}.{self.port}" + ("@previous" if self.previous else "")

    @property
    def now(self) -> Endpoint:
        return self._replace(previous=False) if self.previous else self


class GraphNode(Struct, frozen=True):
    """A node with its validated parameters and its links.

    Attributes:
        id: key in the file; inside a sub-pipeline `glow/blur`.
        inputs: connected inputs only, in the order of declaration; a `many` input has several endpoints.
        choices: parameters whose value a plugin provides, with the include.
        clears: initial contents of each texture and buffer; None leaves them undefined.
    """

    id: str
    type: NodeType
    node: Node
    inputs: Mapping[str, tuple[Endpoint, ...]]
    place: Place | None = None
    choices: Mapping[str, Path] = field(default_factory=dict)
    samplers: Mapping[str, Sampler] = field(default_factory=dict)
    clears: Mapping[str, Texel | None] = field(default_factory=dict)

    @property
    def title(self) -> str:
        """How messages name it."""
        return node_named(self.id, self.type.name)


class Graph(Struct, frozen=True, dict=True):
    """A checked pipeline.

    Attributes:
        facts: what all nodes know of the scene.
        textures: the properties of every port, internals and functions included; an `InOut` shares its source's.
        aliases: outputs of sub-pipelines and of disabled nodes, `glow.radiance`, and the ports they stand for.
        disabled: nodes that `enabled: false` removes; they are not members.
        knows_objects: False without a scene, where any may exist.
        unlit: nodes that need an environment where the scene has none; they are not members either.
        overwritten: by reader and writer, the problem if the reader cannot run between the writer's steps.
        cyclic: where nodes form a cycle, though their steps need not: each link by its reader, input and source.
    """

    name: str
    members: Mapping[str, GraphNode]
    outputs: Mapping[str, Endpoint]
    facts: Facts
    textures: Mapping[Endpoint, TextureInfo] = field(default_factory=dict)
    warnings: tuple[Problem, ...] = ()
    aliases: Mapping[str, Endpoint] = field(default_factory=dict)
    disabled: tuple[str, ...] = ()
    knows_objects: bool = True
    unlit: tuple[str, ...] = ()
    overwritten: Mapping[tuple[str, str], Problem] = field(default_factory=dict)
    cyclic: Mapping[tuple[str, str, Endpoint], Value] = field(default_factory=dict)

    def __repr__(self) -> str:
        width, height = self.size
        return f"<Graph {self.name}, {width}×{height}: {', '.join(self.members)} → {', '.join(self.outputs)}>"

    @property
    def summary(self) -> str:
        """The line that `check` prints about it."""
        links = sum(len(ends) for node in self.nodes for ends in node.inputs.values())
        width, height = self.size
        counts = f"{len(self.nodes)} nodes, {links} links"
        return f"{self.name}: {counts}, {width}×{height}, outputs {', '.join(self.outputs)}"

    def __getitem__(self, node: str) -> GraphNode:
        return self.members[node]

    def __contains__(self, node: object) -> bool:
        return node in self.members

    @property
    def size(self) -> tuple[int, int]:
        return self.facts.viewport

    @cached_property
    def unfilled(self) -> frozenset[str]:
        """Selections of objects (`transparent`, `casters`, …) that are empty in this scene."""
        if not self.knows_objects:
            return frozenset()
        kinds = {(one.casts_shadow, one.blended) for one in self.facts.objects if not one.hidden}
        return frozenset(name for name, takes in SELECTIONS.items() if not any(takes(*kind) for kind in kinds))

    @cached_property
    def empty(self) -> frozenset[Endpoint]:
        descs = ((end, info.desc) for end, info in self.textures.items())
        return frozenset(end for end, desc in descs if desc is not None and desc.layers == 0)

    @property
    def nodes(self) -> list[GraphNode]:
        return list(self.members.values())

    @cached_property
    def dag(self) -> nx.MultiDiGraph[str]:
        """The graph in networkx, frozen: nodes have `node`, edges `source_port`, `target_port` and `previous`."""
        import networkx as nx  # importing it takes longer than checking a pipeline

        dag: nx.MultiDiGraph[str] = nx.MultiDiGraph()
        for name, node in self.members.items():
            dag.add_node(name, node=node)
        for name, node in self.members.items():
            for port, ends in node.inputs.items():
                for end in ends:
                    dag.add_edge(end.node, name, source_port=end.port, target_port=port, previous=end.previous)
        nx.freeze(dag)
        return dag

    def reading_order(self) -> list[str]:
        """Return node ids in topological order of this frame's links, as far as they form no cycle."""
        sources = {
            name: {end.node: None for ends in node.inputs.values() for end in ends if not end.previous}
            for name, node in self.members.items()
        }
        order = upstream_first(sources)
        return order if len(order) == len(self.members) else depth_first(sources)


def depth_first(sources: Mapping[T, Iterable[T]], roots: Iterable[T] | None = None) -> list[T]:
    """Return names, or `roots` and all names upstream, each after its sources; links that close a cycle are ignored."""
    order: list[T] = []
    begun: set[T] = set()
    for name in sources if roots is None else roots:
        stack = [(name, iter(sources[name]))] if name not in begun else []
        begun.add(name)
        while stack:
            at, left = stack[-1]
            source = next((one for one in left if one not in begun), None)
            if source is None:
                order.append(at)
                stack.pop()
            else:
                begun.add(source)
                stack.append((source, iter(sources[source])))
    return order


def upstream_first(sources: Mapping[T, Collection[T]]) -> list[T]:
    """Sort names topologically, otherwise in the given order; omit cycles and everything downstream of them."""
    place = {name: number for number, name in enumerate(sources)}
    readers: dict[T, list[T]] = {name: [] for name in sources}
    for name, found in sources.items():
        for source in found:
            readers[source].append(name)
    waiting = {name: len(found) for name, found in sources.items()}
    ready = [(place[name], name) for name, count in waiting.items() if not count]
    order: list[T] = []
    while ready:
        _, name = heappop(ready)
        order.append(name)
        for reader in readers[name]:
            waiting[reader] -= 1
            if not waiting[reader]:
                heappush(ready, (place[reader], reader))
    return order
