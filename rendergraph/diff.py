"""The differences between two graphs: as a value, as text, as JSON and as a picture. Needs no GL."""

from __future__ import annotations

import re
import sys
from collections import defaultdict
from collections.abc import Mapping, Sequence
from html import escape
from importlib import import_module
from typing import TYPE_CHECKING, Any

from msgspec import Struct, to_builtins
from msgspec.structs import asdict, replace

from rendergraph.diagrams import Link, Mark, Sheet, draw, sheet
from rendergraph.errors import shown_file
from rendergraph.formatting import format_bytes, format_value, jsonable, table
from rendergraph.lazy import CallableModule
from rendergraph.link import Endpoint, Graph, GraphNode
from rendergraph.link.graph import depth_first

if TYPE_CHECKING:
    from rendergraph.allocate import ResourcePlan

sys.modules[__name__].__class__ = CallableModule

# Each at least 3:1 against white and against near-black; the signs carry it for people who cannot tell them apart.
ADDED, REMOVED, CHANGED, RENAMED = "#2c9163", "#d0453e", "#b7791f", "#3b7dd8"
_LEGEND = 34.0
_STYLE = """
.word{fill:#57606a}
@media (prefers-color-scheme:dark){.word{fill:#9aa4af}}
"""


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
    """The changes that turn one graph into another."""

    names: tuple[str, str]  # of the two pipelines
    nodes: Mapping[str, str]  # the first graph's nodes to the second's, where they match
    added: tuple[str, ...] = ()  # nodes that only the second graph has
    removed: tuple[str, ...] = ()  # nodes that only the first graph has
    disabled: tuple[str, ...] = ()  # nodes among these that the other graph disables with `enabled: false`
    renamed: Mapping[str, str] = {}  # old id to new id, if only the id differs
    retyped: tuple[Retyped, ...] = ()  # nodes of another type under the same id
    parameters: tuple[ParameterChange, ...] = ()  # one that only one of two types has counts only if it is set
    links: tuple[LinkChange, ...] = ()  # inputs that read another port, except those of added and removed nodes
    outputs: tuple[OutputChange, ...] = ()  # those that show another port
    sizes: tuple[tuple[int, int], tuple[int, int]] | None = None  # both if they differ

    def __str__(self) -> str:
        return diff_text(self).rstrip("\n")

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


def _graph(given: Any) -> Graph:
    if isinstance(given, Graph):
        return given
    # By its name, for callers in Python: pipelines are made of graphs.
    found: Graph = import_module("rendergraph.session.pipeline").as_pipeline(given).link().graph
    return found


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


# --- text and JSON ----------------------------------------------------------------------------------------------------


def diff_text(difference: GraphDiff, plans: tuple[PlanFigures, PlanFigures] | None = None) -> str:
    """Return the difference in lines that begin with `+`, `-` or `~`, then the effect on the plan."""
    old, new = difference.names
    disabled = {id: f" (disabled in {new if id in difference.removed else old})" for id in difference.disabled}
    lines = [f"{old} → {new}"]
    lines += [f"  - {node}{disabled.get(node, '')}" for node in difference.removed]
    lines += [f"  + {node}{disabled.get(node, '')}" for node in difference.added]
    lines += [f"  ~ {was} is called {now}" for was, now in difference.renamed.items()]
    lines += [f"  ~ {change.node}: {change}" for change in difference.retyped]
    changes: list[tuple[str, str, str]] = [
        *((f"{one.node}.{one.name}", format_value(one.old), format_value(one.new)) for one in difference.parameters),
        *((f"{one.node}.{one.port}", _ends(one.old), _ends(one.new)) for one in difference.links),
        *((f"output {one.name}", one.old or "none", one.new or "none") for one in difference.outputs),
    ]
    lines += [f"  ~ {name}: {was} → {now}" for name, was, now in changes]
    if difference.sizes is not None:
        lines.append("  ~ size " + " → ".join(f"{width}×{height}" for width, height in difference.sizes))
    if not difference:
        lines.append("  no difference")
    if plans is not None:
        lines += ["", "plan", _plan_text(*plans)]
    return "\n".join(lines) + "\n"


def _ends(ends: Sequence[str]) -> str:
    return ", ".join(ends) or "nothing"


def _plan_text(a: PlanFigures, b: PlanFigures) -> str:
    rows = []
    for name in ("passes", "steps", "allocated_bytes", "no_reuse_bytes", "peak_bytes"):
        was, now = getattr(a, name), getattr(b, name)
        change = now - was
        if name.endswith("_bytes"):
            texts = format_bytes(was), format_bytes(now), f"{'+' if change > 0 else '−'}{format_bytes(abs(change))}"
        else:
            texts = str(was), str(now), f"{change:+d}"
        rows.append((name.removesuffix("_bytes").replace("_", " "), *texts[:2], texts[2] if change else "="))
    rows.append(("peak at", a.peak_node or "–", b.peak_node or "–", ""))
    left, right = (max(len(row[column]) for row in rows) for column in (1, 2))
    return table([(f"  {name}", f"{was:>{left}} → {now:>{right}}", change) for name, was, now, change in rows])


def diff_json(difference: GraphDiff, plans: tuple[PlanFigures, PlanFigures] | None = None) -> dict[str, Any]:
    fields = asdict(difference)
    a, b = fields.pop("names")
    del fields["nodes"]
    found = {"a": a, "b": b, "equal": not difference, **fields}
    if plans is not None:
        found["plan"] = {"a": plans[0], "b": plans[1]}
    result: dict[str, Any] = jsonable(to_builtins(found))  # with lists for tuples
    return result


# --- the picture -----------------------------------------------------------------------------------------------------


def diff_svg(a: Graph, b: Graph, difference: GraphDiff) -> str:
    """Return the second graph with the removed parts of the first, differences in colour, as an SVG document."""
    picture = draw(*_both(a, b, difference))
    size = re.search(r'viewBox="0 0 (\d+) (\d+)"', picture)
    assert size
    tall = float(size[2])
    width, height = max(float(size[1]), 620.0), tall + _LEGEND
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width:.0f} {height:.0f}" width="{width:.0f}" '
        f'height="{height:.0f}" font-family="system-ui,\'DejaVu Sans\',sans-serif" font-size="12">',
        f"<title>{escape(a.name)} and {escape(b.name)}</title>",
        f"<style>{_STYLE}</style>",
        picture.rstrip(),
        *_legend(tall),
    ]
    return "\n".join([*parts, "</svg>"]) + "\n"


def _both(a: Graph, b: Graph, difference: GraphDiff) -> tuple[Sheet, dict[str, Mark], dict[Link, str]]:
    """Return both graphs as one, with marks on nodes and links that only one of them has."""
    old, new = sheet(a), sheet(b)
    names = {node.id: difference.nodes.get(node.id, node.id) for node in a.nodes}
    for node in difference.removed:
        while names[node] in b:
            names[node] += "′"
    cards = {card.id: card for card in new.cards}
    cards |= {names[card.id]: replace(card, id=names[card.id]) for card in old.cards if card.id in difference.removed}
    old_links = [replace(link, source=names[link.source], target=names[link.target]) for link in old.links]
    old_cards = {names[card.id]: card for card in old.cards}
    removed = [_backwards(link, new.links) for link in old_links if link not in new.links]
    for link in removed:  # a node of another type may lack the port that was linked
        for id, ports, name in ((link.source, "outputs", link.source_port), (link.target, "inputs", link.target_port)):
            sockets = getattr(cards[id], ports)
            if all(socket.name != name for socket in sockets):
                own = next(socket for socket in getattr(old_cards[id], ports) if socket.name == name)
                cards[id] = replace(cards[id], **{ports: (*sockets, own)})
    highlights = {link: ADDED for link in new.links if link not in old_links} | dict.fromkeys(removed, f"-{REMOVED}")
    marks = {new: Mark(RENAMED, (f"was {old}",)) for old, new in difference.renamed.items()}
    marks |= {change.node: Mark(CHANGED) for change in difference.links if change.node in cards}
    marks |= {node: Mark(CHANGED, tuple(notes)) for node, notes in difference.changed(links=False).items()}
    marks |= {node: Mark(ADDED, ("+ added",)) for node in difference.added}
    for node in difference.removed:
        marks[names[node]] = Mark(REMOVED, ("− disabled" if node in difference.disabled else "− removed",))
    return Sheet(new.title, list(cards.values()), [*new.links, *removed], new.outputs), marks, highlights


def _backwards(link: Link, present: Sequence[Link]) -> Link:
    """Return a link of the first graph, which leads back if its ends have the opposite order in the second graph."""
    following = defaultdict[str, list[str]](list)
    for other in present:
        if not other.previous:
            following[other.source].append(other.target)
    return replace(link, previous=link.previous or link.source in depth_first(following, [link.target]))


def _legend(y: float) -> list[str]:
    entries = ((ADDED, "+ added"), (REMOVED, "− removed"), (CHANGED, "~ changed"), (RENAMED, "→ renamed"))
    parts = []
    for number, (color, word) in enumerate(entries):
        x = 24 + 120 * number
        parts.append(f'<rect x="{x}" y="{y + 6:.0f}" width="14" height="14" rx="3" fill="{color}"/>')
        parts.append(f'<text class="word" x="{x + 20}" y="{y + 17:.0f}">{word}</text>')
    return parts
