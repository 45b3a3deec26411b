"""What differs between two graphs: nodes, links, parameters, and what that does to the plan. Needs no GL."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from rendergraph.catalog import NodeType
from rendergraph.errors import shown_file
from rendergraph.link import Endpoint, Graph, GraphNode

if TYPE_CHECKING:
    from rendergraph.allocate import ResourcePlan


@dataclass(frozen=True)
class Retyped:
    """A node whose type is another one.

    Attributes:
        node: the node.
        old, new: the types' names.
        files: where both are called alike, their files: two shaders at the same place beside two pipelines.
    """

    node: str
    old: str
    new: str
    files: tuple[str, str] | None = None

    def __str__(self) -> str:
        """What differs, in a line."""
        if self.files is None:
            return f"type {self.old} → {self.new}"
        return f"the shader's text differs ({', '.join(self.files)})"


@dataclass(frozen=True)
class ParameterChange:
    """A parameter whose value differs; None where the node's type has no such parameter."""

    node: str
    name: str
    old: Any
    new: Any


@dataclass(frozen=True)
class LinkChange:
    """Links of one input, `node.port` as in the file; empty where it is not connected.

    Attributes:
        node: the node that reads, by its name in the second graph where it is there.
        port: the input.
        old, new: what it reads in the first and in the second graph.
    """

    node: str
    port: str
    old: tuple[str, ...]
    new: tuple[str, ...]


@dataclass(frozen=True)
class OutputChange:
    """An output of the pipeline that shows another port; None where there is none of that name."""

    name: str
    old: str | None
    new: str | None


@dataclass(frozen=True)
class GraphDiff:
    """What turns one graph into another.

    Attributes:
        names: the two pipelines.
        nodes: first graph's node to the second's, for all that were recognised.
        added, removed: nodes that only the second, only the first graph has.
        disabled: those of them that the other graph takes out with `enabled: false`.
        renamed: old id to new id, where nothing but the id differs.
        retyped: nodes of another type under the same id.
        links: inputs that read something else; those of added and removed nodes are not listed.
        parameters: values that differ; of retyped nodes those that one of the types lacks only where they are set.
        outputs: what the pipelines show.
        sizes: both sizes where they differ.
    """

    names: tuple[str, str]
    nodes: Mapping[str, str] = field(repr=False)
    added: tuple[str, ...] = ()
    removed: tuple[str, ...] = ()
    disabled: tuple[str, ...] = ()
    renamed: Mapping[str, str] = field(default_factory=dict)
    retyped: tuple[Retyped, ...] = ()
    links: tuple[LinkChange, ...] = ()
    parameters: tuple[ParameterChange, ...] = ()
    outputs: tuple[OutputChange, ...] = ()
    sizes: tuple[tuple[int, int], tuple[int, int]] | None = None

    def __bool__(self) -> bool:
        """Whether anything differs."""
        own = (self.added, self.removed, self.renamed, self.retyped, self.links, self.parameters, self.outputs)
        return any(own) or self.sizes is not None

    def changed(self, *, links: bool = True) -> dict[str, list[str]]:
        """The second graph's nodes that are in the first one and differ, each with what differs in short."""
        table: dict[str, list[str]] = {}
        for retyped in self.retyped:
            table.setdefault(retyped.node, []).append(
                "another text" if retyped.files else f"{retyped.old} → {retyped.new}"
            )
        for change in self.parameters:
            table.setdefault(change.node, []).append(
                f"{change.name} {value_text(change.old)} → {value_text(change.new)}"
            )
        for link in self.links if links else ():
            table.setdefault(link.node, []).append(f"{link.port} ← {', '.join(link.new) or 'nothing'}")
        return table


def diff(a: Graph, b: Graph) -> GraphDiff:
    """What turns `a` into `b`; both are resolved and linked, so that only what they mean is compared."""
    nodes = _matched(a, b)
    kept = {new: old for old, new in nodes.items()}
    added = tuple(node.id for node in b.nodes if node.id not in kept)
    removed = tuple(node.id for node in a.nodes if node.id not in nodes)
    return GraphDiff(
        names=(a.name, b.name),
        nodes=nodes,
        added=added,
        removed=removed,
        disabled=(*(node for node in removed if node in b.disabled), *(node for node in added if node in a.disabled)),
        renamed={old: new for old, new in nodes.items() if old != new},
        retyped=tuple(
            _retyped(new, a[old].type, b[new].type) for old, new in nodes.items() if not _same_type(a[old], b[new])
        ),
        links=tuple(_links(a, b, nodes)),
        parameters=tuple(change for old, new in nodes.items() for change in _parameters(a[old], b[new])),
        outputs=tuple(_outputs(a, b, nodes)),
        sizes=(a.size, b.size) if a.size != b.size else None,
    )


# --- which node is which ---------------------------------------------------------------------------------------------


def _matched(a: Graph, b: Graph) -> dict[str, str]:
    """First graph's node to the second's: by id and type, then equal ones under another id, then by id alone."""
    nodes = {node.id: node.id for node in a.nodes if node.id in b and _same_type(node, b[node.id])}
    _match_renamed(a, b, nodes)
    taken = set(nodes.values())
    nodes |= {n.id: n.id for n in a.nodes if n.id not in nodes and n.id in b and n.id not in taken}
    _match_renamed(a, b, nodes)  # what reads a retyped node can be recognised now
    return {node.id: nodes[node.id] for node in a.nodes if node.id in nodes}


def _match_renamed(a: Graph, b: Graph, nodes: dict[str, str]) -> None:
    """Match nodes that differ in nothing but their ids; a match lets those that read the node be recognised too."""
    readers_a, readers_b = _readers(a), _readers(b)
    found = True
    while found:
        found = False
        taken = set(nodes.values())
        for old in [node for node in a.nodes if node.id not in nodes]:
            equal = [new for new in b.nodes if new.id not in taken and _is_renamed(old, new, nodes)]
            if equal:
                best = max(equal, key=lambda new: _common(readers_a[old.id], readers_b[new.id], nodes))
                nodes[old.id] = best.id
                taken.add(best.id)
                found = True


def _is_renamed(old: GraphNode, new: GraphNode, nodes: Mapping[str, str]) -> bool:
    if not _same_type(old, new) or old.node != new.node or old.inputs.keys() != new.inputs.keys():
        return False
    if any(len(ends) != len(new.inputs[port]) for port, ends in old.inputs.items()):
        return False
    pairs = [pair for port, ends in old.inputs.items() for pair in zip(ends, new.inputs[port], strict=True)]
    own = {**nodes, old.id: new.id}  # it may read its own last frame
    return all(x.port == y.port and x.previous == y.previous and _same_source(x, y, own) for x, y in pairs)


def _same_source(x: Endpoint, y: Endpoint, nodes: Mapping[str, str]) -> bool:
    # Last frame's value may come from a node further down that is recognised only later.
    return nodes.get(x.node) == y.node or (x.previous and x.node not in nodes)


def _readers(graph: Graph) -> dict[str, list[tuple[str, str]]]:
    table: dict[str, list[tuple[str, str]]] = {node.id: [] for node in graph.nodes}
    for node in graph.nodes:
        for port, ends in node.inputs.items():
            for end in ends:
                table[end.node].append((node.id, port))
    for name, end in graph.outputs.items():
        table[end.node].append(("", name))
    return table


def _common(old: Sequence[tuple[str, str]], new: Sequence[tuple[str, str]], nodes: Mapping[str, str]) -> int:
    return len({(nodes.get(node, node), port) for node, port in old} & set(new))


def _same_type(a: GraphNode, b: GraphNode) -> bool:
    """Whether two nodes draw the same: with one type, or with shaders of one text, wherever those lie."""
    if a.type.is_shader and b.type.is_shader:
        return a.type.text == b.type.text
    return (a.type.name, a.type.file) == (b.type.name, b.type.file)


def _retyped(node: str, old: NodeType, new: NodeType) -> Retyped:
    files = (shown_file(old.file), shown_file(new.file)) if old.name == new.name else None
    return Retyped(node, old.name, new.name, files)


# --- what differs ----------------------------------------------------------------------------------------------------


def _links(a: Graph, b: Graph, nodes: Mapping[str, str]) -> list[LinkChange]:
    changes = []
    for old, new in nodes.items():
        before, after = a[old].inputs, b[new].inputs
        for port in dict.fromkeys([*before, *after]):
            ends = tuple(str(_now_called(end, nodes)) for end in before.get(port, ()))
            now = tuple(str(end) for end in after.get(port, ()))
            if ends != now:
                changes.append(LinkChange(new, port, ends, now))
    return changes


def _now_called(end: Endpoint, nodes: Mapping[str, str]) -> Endpoint:
    return Endpoint(nodes.get(end.node, end.node), end.port, end.previous)


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
    changes = []
    for name in dict.fromkeys([*a.outputs, *b.outputs]):
        old, new = a.outputs.get(name), b.outputs.get(name)
        was = str(_now_called(old, nodes)) if old else None
        if was != (str(new) if new else None):
            changes.append(OutputChange(name, was, str(new) if new else None))
    return changes


# --- the plan --------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class PlanFigures:
    """What one plan costs.

    Attributes:
        passes: nodes that are drawn.
        steps: what they draw.
        allocated_bytes: of textures and buffers.
        no_reuse_bytes: without sharing.
        peak_bytes: the most that is alive at once in this order.
        peak_node: where that is.
    """

    passes: int
    steps: int
    allocated_bytes: int
    no_reuse_bytes: int
    peak_bytes: int
    peak_node: str | None


def figures(plan: ResourcePlan) -> PlanFigures:
    """What a plan costs, in numbers that can be compared."""
    schedule, memory = plan.schedule, plan.memory
    return PlanFigures(
        passes=len({step.node for step in schedule.steps}),
        steps=len(schedule.steps),
        allocated_bytes=memory.allocated_bytes,
        no_reuse_bytes=memory.no_reuse_bytes,
        peak_bytes=schedule.peak_bytes,
        peak_node=schedule.peak_node,
    )


def value_text(value: Any) -> str:
    """A parameter's value as a person reads it; `–` for none."""
    if value is None:
        return "–"
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, list | tuple):
        return f"[{', '.join(value_text(part) for part in value)}]"
    return str(value)
