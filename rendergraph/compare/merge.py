"""Several graphs as one, in which nodes that compute the same are one node.

Two nodes compute the same where they have the same type and parameters and read the same ports of nodes that compute
the same. A texture that somebody continues (`InOut`) is the same only where the one who continues it is too: each
version has one writer. Found by refining a partition until it stands still, as for states of automata (Hopcroft 1971,
here in its plain form), so that `@previous` may close cycles.

The merged graph goes through the ordinary stages: it is scheduled, given memory and executed once, and each output is
drawn as in the graph it came from.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from typing import TypeAlias

from msgspec.structs import replace

from rendergraph.declare import InOut, TextureInfo
from rendergraph.link import Endpoint, Graph, GraphNode

Key: TypeAlias = "tuple[int, str]"
"""Number of a graph and id of one of its nodes."""


@dataclasses.dataclass(frozen=True)
class Merged:
    """The one graph, and where each node of each graph is in it.

    Attributes:
        graph: its outputs are called `number/name`.
        names: for each graph, its nodes' ids to ids in `graph`.
    """

    graph: Graph
    names: tuple[Mapping[str, str], ...]

    def output(self, number: int, name: str) -> str:
        """What an output of a graph is called."""
        return f"{number}/{name}"


def merge(graphs: Sequence[Graph]) -> Merged:
    """One graph that draws what all of them draw; they must have one scene and one size."""
    classes = _classes(graphs)
    ids = _ids(graphs, classes)
    names = tuple(
        {node.id: ids[classes[number, node.id]] for node in graph.nodes} for number, graph in enumerate(graphs)
    )
    nodes: dict[str, GraphNode] = {}
    textures: dict[Endpoint, TextureInfo] = {}
    for graph, own in zip(graphs, names, strict=True):
        for node in graph.nodes:
            inputs = {port: tuple(_moved(end, own) for end in ends) for port, ends in node.inputs.items()}
            nodes.setdefault(own[node.id], replace(node, id=own[node.id], inputs=inputs))
        for end, info in graph.textures.items():
            textures.setdefault(_moved(end, own), replace(info, view=_view(info.view, own)))
    outputs = {
        f"{number}/{name}": _moved(end, names[number])
        for number, graph in enumerate(graphs)
        for name, end in graph.outputs.items()
    }
    first = graphs[0]
    merged = Graph(first.name, nodes, outputs, first.size, first.lights, textures)
    merged = replace(merged, objects=first.objects, environment=first.environment)
    return Merged(merged, names)


def kinship(graphs: Sequence[Graph], order: Sequence[str]) -> list[tuple[int, ...]]:
    """For each graph a number for each node: equal ones of two graphs compute the same.

    Args:
        graphs: with one scene and one size.
        order: the nodes' ids; graphs that are sorted by their numbers share as many of the first ones as can be.
    """
    classes = _classes(graphs)
    return [tuple(classes.get((number, node), -1) for node in order) for number in range(len(graphs))]


def _moved(end: Endpoint, names: Mapping[str, str]) -> Endpoint:
    return end._replace(node=names[end.node])


def _view(view: str | None, names: Mapping[str, str]) -> str | None:
    """A view table's id; `camera` is nobody's port."""
    node, dot, port = (view or "").rpartition(".")
    return f"{names[node]}.{port}" if dot else view


def _classes(graphs: Sequence[Graph]) -> dict[Key, int]:
    """Node to the number of its class; nodes of one class compute the same."""
    nodes = {(number, node.id): node for number, graph in enumerate(graphs) for node in graph.nodes}
    followers = _followers(graphs)
    classes: dict[Key, int] = {}
    signatures: Mapping[Key, object] = {
        key: (node.type.name, node.type.file, type(node.node), repr(node.node)) for key, node in nodes.items()
    }
    while True:
        numbers: dict[object, int] = {}
        found = {key: numbers.setdefault(signatures[key], len(numbers)) for key in nodes}
        if classes and len(set(found.values())) == len(set(classes.values())):
            return found
        classes = found
        signatures = {
            key: (
                found[key],
                tuple(
                    (port, tuple((found[key[0], end.node], end.port, end.previous) for end in ends))
                    for port, ends in node.inputs.items()
                ),
                tuple((port, found[other], at) for port, other, at in followers.get(key, ())),
            )
            for key, node in nodes.items()
        }


def _followers(graphs: Sequence[Graph]) -> dict[Key, list[tuple[str, Key, str]]]:
    """Node to those of its ports that somebody continues, who does, and by which port."""
    table: dict[Key, list[tuple[str, Key, str]]] = {}
    for number, graph in enumerate(graphs):
        for node in graph.nodes:
            for port, ends in node.inputs.items():
                if isinstance(node.node.ports()[port], InOut):
                    for end in ends:
                        table.setdefault((number, end.node), []).append((end.port, (number, node.id), port))
    return {key: sorted(found) for key, found in table.items()}


def _ids(graphs: Sequence[Graph], classes: Mapping[Key, int]) -> dict[int, str]:
    """An id for each class: what its first member is called, with a number behind where that is taken."""
    ids: dict[int, str] = {}
    taken = {node.id for graph in graphs for node in graph.nodes}
    used: set[str] = set()
    for (_, name), number in classes.items():
        if number in ids:
            continue
        unique, count = name, 1
        while unique in used or (count > 1 and unique in taken):
            count += 1
            unique = f"{name}-{count}"
        used.add(unique)
        ids[number] = unique
    return ids
