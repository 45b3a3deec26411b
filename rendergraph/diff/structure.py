"""The differences between two graphs: nodes, links, parameters, and the effect on the plan. Needs no GL."""

from __future__ import annotations

from collections.abc import Mapping
from importlib import import_module
from typing import TYPE_CHECKING, Any

from msgspec import Struct

from rendergraph.errors import shown_file
from rendergraph.formatting import format_value
from rendergraph.link import Endpoint, Graph, GraphNode

if TYPE_CHECKING:
    from rendergraph.allocate import ResourcePlan


class Retyped(Struct, frozen=True):
    """A node of another type. `files` names both shaders if they have the same name in different folders."""

    node: str
    old: str
    new: str
    files: tuple[str, str] | None = None

    def __str__(self) -> str:
        if self.files is None:
            return f"type {self.old} → {self.new}"
        return f"the shader's text differs ({', '.join(self.files)})"


class ParameterChange(Struct, frozen=True):
    """A parameter whose value differs; None where the node's type has no such parameter."""

    node: str
    name: str
    old: Any
    new: Any


class LinkChange(Struct, frozen=True):
    """The sources of an input in both graphs, `node.port` as in the file; empty if it is not connected."""

    node: str  # named as in the second graph where it exists there
    port: str
    old: tuple[str, ...]
    new: tuple[str, ...]


class OutputChange(Struct, frozen=True):
    """An output of the pipeline that shows another port; None if there is no output of that name."""

    name: str
    old: str | None
    new: str | None


class GraphDiff(Struct, frozen=True):
    """The changes that turn one graph into another.

    Attributes:
        names: of the two pipelines.
        nodes: the first graph's nodes to the second's, where they match.
        added, removed: nodes that only the second, only the first graph has.
        disabled: nodes among these that the other graph disables with `enabled: false`.
        renamed: old id to new id, if only the id differs.
        retyped: nodes of another type under the same id.
        parameters: values that differ; a parameter that only one of two types has counts only if it is set.
        links: inputs that read another port, except those of added and removed nodes.
        outputs: those that show another port.
        sizes: both sizes if they differ.
    """

    names: tuple[str, str]
    nodes: Mapping[str, str]
    added: tuple[str, ...] = ()
    removed: tuple[str, ...] = ()
    disabled: tuple[str, ...] = ()
    renamed: Mapping[str, str] = {}
    retyped: tuple[Retyped, ...] = ()
    parameters: tuple[ParameterChange, ...] = ()
    links: tuple[LinkChange, ...] = ()
    outputs: tuple[OutputChange, ...] = ()
    sizes: tuple[tuple[int, int], tuple[int, int]] | None = None

    def __str__(self) -> str:
        # By its name: texts are made of differences, and nothing else here knows of them.
        return str(import_module("rendergraph.diff.show").diff_text(self)).rstrip("\n")

    def __bool__(self) -> bool:
        changes = (self.added, self.removed, self.renamed, self.retyped, self.links, self.parameters, self.outputs)
        return any(changes) or self.sizes is not None

    def changed(self, *, links: bool = True) -> dict[str, list[str]]:
        """Return the nodes that differ, by their ids in the second graph, each with a summary of its changes."""
        notes: dict[str, list[str]] = {}
        for retyped in self.retyped:
            text = "another text" if retyped.files else f"{retyped.old} → {retyped.new}"
            notes.setdefault(retyped.node, []).append(text)
        for one in self.parameters:
            text = f"{one.name} {format_value(one.old)} → {format_value(one.new)}"
            notes.setdefault(one.node, []).append(text)
        for link in self.links if links else ():
            notes.setdefault(link.node, []).append(f"{link.port} ← {', '.join(link.new) or 'nothing'}")
        return notes


def diff(a: Any, b: Any) -> GraphDiff:
    """Return what turns `a` into `b`: graphs, or pipelines, or their names, files or content.

    Both are resolved and linked, so only their meaning is compared. Its text is what `rendergraph diff` prints.
    """
    a, b = _graph(a), _graph(b)
    nodes = _matched(a, b)
    matched = set(nodes.values())
    added = tuple(node.id for node in b.nodes if node.id not in matched)
    removed = tuple(node.id for node in a.nodes if node.id not in nodes)
    return GraphDiff(
        names=(a.name, b.name),
        nodes=nodes,
        added=added,
        removed=removed,
        disabled=(*(node for node in removed if node in b.disabled), *(node for node in added if node in a.disabled)),
        renamed={old: new for old, new in nodes.items() if old != new},
        retyped=tuple(
            Retyped(new, x.name, y.name, (shown_file(x.file), shown_file(y.file)) if x.name == y.name else None)
            for old, new in nodes.items()
            if not _same_type(a[old], b[new])
            for x, y in ((a[old].type, b[new].type),)
        ),
        links=tuple(_links(a, b, nodes)),
        parameters=tuple(change for old, new in nodes.items() for change in _parameters(a[old], b[new])),
        outputs=tuple(_outputs(a, b, nodes)),
        sizes=(a.size, b.size) if a.size != b.size else None,
    )


# --- which node is which ---------------------------------------------------------------------------------------------


def _matched(a: Graph, b: Graph) -> dict[str, str]:
    """First graph's node to the second's: by id and type, then equal nodes with another id, then by id alone."""
    nodes = {node.id: node.id for node in a.nodes if node.id in b and _same_type(node, b[node.id])}
    _match_renamed(a, b, nodes)
    taken = set(nodes.values())
    nodes |= {n.id: n.id for n in a.nodes if n.id not in nodes and n.id in b and n.id not in taken}
    _match_renamed(a, b, nodes)  # readers of a retyped node can be recognised now
    return {node.id: nodes[node.id] for node in a.nodes if node.id in nodes}


def _match_renamed(a: Graph, b: Graph, nodes: dict[str, str]) -> None:
    """Match nodes that differ only in their ids; each match may allow its readers to be recognised, too."""
    readers_a, readers_b = _readers(a), _readers(b)

    def common_readers(old: str, new: str) -> int:
        return len({(nodes.get(node, node), port) for node, port in readers_a[old]} & readers_b[new])

    matched = -1
    while matched != len(nodes):
        matched = len(nodes)
        for old in [node for node in a.nodes if node.id not in nodes]:
            taken = set(nodes.values())
            equal = [new.id for new in b.nodes if new.id not in taken and _is_renamed(old, new, nodes)]
            if equal:
                nodes[old.id] = max(equal, key=lambda new: common_readers(old.id, new))


def _is_renamed(old: GraphNode, new: GraphNode, nodes: Mapping[str, str]) -> bool:
    if not _same_type(old, new) or old.node != new.node or old.inputs.keys() != new.inputs.keys():
        return False
    if any(len(ends) != len(new.inputs[port]) for port, ends in old.inputs.items()):
        return False
    pairs = [pair for port, ends in old.inputs.items() for pair in zip(ends, new.inputs[port], strict=True)]
    matches = {**nodes, old.id: new.id}  # it may read its own last frame
    # Last frame's value may come from a node downstream, which is recognised only later.
    return all(
        (x.port, x.previous) == (y.port, y.previous)
        and (matches.get(x.node) == y.node or (x.previous and x.node not in matches))
        for x, y in pairs
    )


def _readers(graph: Graph) -> dict[str, set[tuple[str, str]]]:
    """Node id to the inputs that read it, and to the outputs of the pipeline, as node and port."""
    readers: dict[str, set[tuple[str, str]]] = {node.id: set() for node in graph.nodes}
    for node in graph.nodes:
        for port, ends in node.inputs.items():
            for end in ends:
                readers[end.node].add((node.id, port))
    for name, end in graph.outputs.items():
        readers[end.node].add(("", name))
    return readers


def _same_type(a: GraphNode, b: GraphNode) -> bool:
    """Whether two nodes have one type, or shaders with the same text in any file."""
    if a.type.is_shader and b.type.is_shader:
        return a.type.text == b.type.text
    return (a.type.name, a.type.file) == (b.type.name, b.type.file)


# --- what differs ----------------------------------------------------------------------------------------------------


def _links(a: Graph, b: Graph, nodes: Mapping[str, str]) -> list[LinkChange]:
    changes = []
    for old, new in nodes.items():
        before, after = a[old].inputs, b[new].inputs
        for port in dict.fromkeys([*before, *after]):
            was = tuple(_renamed(end, nodes) for end in before.get(port, ()))
            now = tuple(str(end) for end in after.get(port, ()))
            if was != now:
                changes.append(LinkChange(new, port, was, now))
    return changes


def _renamed(end: Endpoint, nodes: Mapping[str, str]) -> str:
    return str(Endpoint(nodes.get(end.node, end.node), end.port, end.previous))


def _parameters(old: GraphNode, new: GraphNode) -> list[ParameterChange]:
    before, after = dict(old.node), dict(new.node)
    defaults = {name: one.default for name, one in {**old.node.parameters(), **new.node.parameters()}.items()}
    return [
        ParameterChange(new.id, name, before.get(name), after.get(name))
        for name in dict.fromkeys([*before, *after])
        if before.get(name) != after.get(name)
        and ((name in before and name in after) or {**before, **after}[name] != defaults[name])
    ]


def _outputs(a: Graph, b: Graph, nodes: Mapping[str, str]) -> list[OutputChange]:
    old = {name: _renamed(end, nodes) for name, end in a.outputs.items()}
    new = {name: str(end) for name, end in b.outputs.items()}
    names = dict.fromkeys([*old, *new])
    return [OutputChange(n, old.get(n), new.get(n)) for n in names if old.get(n) != new.get(n)]


# --- the plan --------------------------------------------------------------------------------------------------------


class PlanFigures(Struct, frozen=True):
    passes: int  # nodes that are drawn
    steps: int
    allocated_bytes: int  # of textures and buffers
    no_reuse_bytes: int  # without sharing
    peak_bytes: int  # the most that is alive at once
    peak_node: str | None


def figures(plan: ResourcePlan) -> PlanFigures:
    schedule, memory = plan.schedule, plan.memory
    return PlanFigures(
        passes=len({step.node for step in schedule.steps}),
        steps=len(schedule.steps),
        allocated_bytes=memory.allocated_bytes,
        no_reuse_bytes=memory.no_reuse_bytes,
        peak_bytes=schedule.peak_bytes,
        peak_node=schedule.peak_node,
    )


def _graph(given: Any) -> Graph:
    if isinstance(given, Graph):
        return given
    # By its name, for callers in Python: pipelines are made of graphs.
    found: Graph = import_module("rendergraph.session.pipeline").as_pipeline(given).link().graph
    return found
