"""Cycles, and who may read and write the versions of a texture."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from msgspec.structs import replace

from rendergraph.declare import InOut
from rendergraph.errors import Problem
from rendergraph.link.disabled import lost
from rendergraph.link.graph import Endpoint
from rendergraph.link.names import Draft, Link, line_of


def cycles(nodes: Mapping[str, Draft]) -> list[Problem]:
    """One problem for each knot of nodes that need each other in the same frame."""
    import networkx as nx  # for the message of a mistake alone

    links = {
        (link.source.node, draft.spec.id): (name, link)
        for draft in nodes.values()
        for name, ends in draft.links.items()
        for link in ends
        if not link.source.previous
    }
    graph: nx.DiGraph[str] = nx.DiGraph()
    graph.add_nodes_from(nodes)
    graph.add_edges_from(links)
    rank = {name: number for number, name in enumerate(nodes)}
    found = []
    for knot in nx.strongly_connected_components(graph):
        first = min(knot, key=rank.__getitem__)
        if len(knot) == 1 and not graph.has_edge(first, first):
            continue
        path = [a for a, _ in nx.find_cycle(graph.subgraph(sorted(knot, key=rank.__getitem__)), first)]
        steps = [(path[number], path[(number + 1) % len(path)]) for number in range(len(path))]
        ends = [str(links[step][1].source) for step in steps]
        value = links[steps[-1]][1].value
        if len(ends) > 8:
            ends[3:-3] = [f"{len(ends) - 6} more"]
        text = (
            f"the nodes form a cycle, {' → '.join([*ends, ends[0]])}; '@previous' behind one reads last frame's value"
        )
        found.append(value.problem("RG117", text))
    return found


def sources(nodes: Mapping[str, Draft]) -> dict[str, set[str]]:
    """The nodes that each one reads in the same frame."""
    return {
        name: {link.source.node for links in draft.links.values() for link in links if not link.source.previous}
        for name, draft in nodes.items()
    }


def needs(nodes: Mapping[str, Draft], outputs: Mapping[str, Link], written: Mapping[str, Draft]) -> list[Problem]:
    """Ports that are used although an input they need is not connected; `written` has the disabled nodes, too."""
    problems = []
    users = [link for draft in nodes.values() for links in draft.links.values() for link in links]
    for link in [*users, *outputs.values()]:
        source = nodes[link.source.node]
        wanted: Iterable[str] = getattr(source.ports[link.source.port], "needs", ())
        for name in wanted:
            if not source.links.get(name) and name not in source.failed:
                where = line_of(source.spec.place, link.value.place)
                text = f"'{link.source}' needs input '{name}' of '{source.spec.id}' ({where})"
                if name in source.lost:
                    problems.append(lost(text, replace(source.lost[name], value=link.value), written))
                else:
                    problems.append(link.value.problem("RG116", f"{text}, which is not connected"))
    return problems


def versions(nodes: Mapping[str, Draft]) -> list[Problem]:
    """Mistakes about `InOut`s: each version has one writer, and its readers come before that.

    An output may show a version that somebody continues: it is kept as it was.
    """
    writers: dict[Endpoint, tuple[Draft, Link]] = {}
    problems: list[Problem] = []
    for draft in nodes.values():
        for name, port in draft.inputs.items():
            for link in draft.links[name] if isinstance(port, InOut) else ():
                if link.source.previous:
                    continue
                if link.source in writers:
                    other = writers[link.source]
                    where = line_of(other[1].value.place, link.value.place)
                    text = (
                        f"'{draft.spec.id}.{name}' and '{other[0].spec.id}.{_port(*other)}' ({where}) both continue "
                        f"'{link.source}'; link one to the other"
                    )
                    problems.append(link.value.problem("RG126", text))
                else:
                    writers[link.source] = draft, link
    if writers and not problems:
        problems += _readers(nodes, writers)
    return problems


def _port(draft: Draft, link: Link) -> str:
    return next(name for name, links in draft.links.items() if link in links)


def _readers(nodes: Mapping[str, Draft], writers: Mapping[Endpoint, tuple[Draft, Link]]) -> list[Problem]:
    problems = []
    before = _Ancestors(nodes)
    for draft in nodes.values():
        for name, links in draft.links.items():
            for link in links:
                now = link.source.now
                if now not in writers:
                    continue
                writer, written = writers[now]
                if link is written or (writer is draft and not link.source.previous):
                    continue
                newer = f"'{writer.spec.id}.{_port(writer, written)}'"
                where = line_of(written.value.place, link.value.place)
                if link.source.previous:
                    text = f"{newer} ({where}) overwrites '{now}', last frame's value too; read {newer[:-1]}@previous'"
                    problems.append(link.value.problem("RG127", text))
                elif writer.spec.id in before[draft.spec.id]:
                    text = f"'{draft.spec.id}.{name}' reads '{now}', but '{draft.spec.id}' also needs {newer} ({where})"
                    problems.append(link.value.problem("RG128", f"{text}, which overwrites it; read {newer}"))
    return problems


class _Ancestors(dict[str, set[str]]):
    """Every node that a node needs in the same frame, found out when asked."""

    def __init__(self, nodes: Mapping[str, Draft]) -> None:
        super().__init__()
        self._sources = sources(nodes)

    def __missing__(self, name: str) -> set[str]:
        found: set[str] = set()
        stack = [*self._sources[name]]
        while stack:
            node = stack.pop()
            if node not in found:
                found.add(node)
                stack += self._sources[node]
        self[name] = found
        return found
