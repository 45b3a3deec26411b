"""Check for cycles, and that the versions of a texture are written and read in a possible order."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from msgspec.structs import replace

from rendergraph.declare import InOut, Node, WrittenPort
from rendergraph.errors import Problem
from rendergraph.link.graph import Endpoint, depth_first
from rendergraph.link.nodes import Link, UnlinkedNode, line_of, missing_source


def cycles(nodes: Mapping[str, UnlinkedNode]) -> list[Problem]:
    """Report the cycles that are certain whichever steps the nodes record; `expand` finds the others (RG117).

    An output certainly waits for every input of a node without `record`, and for the input that it continues or is
    `like`.
    """
    import networkx as nx  # only for an error message

    links: dict[tuple[Endpoint, Endpoint], tuple[str, Link]] = {}
    for draft in nodes.values():
        for port in draft.type.cls.outputs().values():
            like = port.like if isinstance(port, WrittenPort) else None
            waits = draft.links if draft.type.cls.record is Node.record else {port.name, like}
            for name, ends in draft.links.items():
                for link in ends if name in waits else ():
                    if not link.source.previous:
                        links[link.source, Endpoint(draft.spec.id, port.name)] = name, link
    graph: nx.DiGraph[Any] = nx.DiGraph()
    graph.add_edges_from(links)
    rank = {name: number for number, name in enumerate(nodes)}

    def place(end: Endpoint) -> tuple[int, str]:
        return rank[end.node], end.port

    found = []
    for component in nx.strongly_connected_components(graph):
        first = min(component, key=place)
        if len(component) == 1 and not graph.has_edge(first, first):
            continue
        path = [a for a, _ in nx.find_cycle(graph.subgraph(sorted(component, key=place)), first)]
        steps = [(path[number], path[(number + 1) % len(path)]) for number in range(len(path))]
        names = [str(end) for end in path]
        value = links[steps[-1]][1].value
        if len(names) > 8:
            names[3:-3] = [f"{len(names) - 6} more"]
        text = (
            f"the nodes form a cycle, {' → '.join([*names, names[0]])}; append '@previous' to read last frame's value"
        )
        found.append(value.problem("RG117", text))
    return found


def sources(nodes: Mapping[str, UnlinkedNode]) -> dict[str, set[str]]:
    return {
        name: {link.source.node for links in draft.links.values() for link in links if not link.source.previous}
        for name, draft in nodes.items()
    }


def needs(
    nodes: Mapping[str, UnlinkedNode], outputs: Mapping[str, Link], written: Mapping[str, UnlinkedNode]
) -> list[Problem]:
    """Report used ports whose needed input is not connected; `written` includes disabled nodes."""
    problems = []
    users = [link for draft in nodes.values() for links in draft.links.values() for link in links]
    for link in [*users, *outputs.values()]:
        source = nodes[link.source.node]
        wanted: Iterable[str] = getattr(source.ports[link.source.port], "needs", ())
        for name in wanted:
            if not source.links.get(name) and name not in source.failed:
                where = line_of(source.spec.place, link.value.place)
                text = f"'{link.source}' needs input '{name}' of '{source.spec.id}' ({where})"
                if name in source.lost_links:
                    problems.append(missing_source(text, replace(source.lost_links[name], value=link.value), written))
                else:
                    problems.append(link.value.problem("RG116", f"{text}, which is not connected"))
    return problems


def versions(nodes: Mapping[str, UnlinkedNode]) -> tuple[list[Problem], dict[tuple[str, str], Problem]]:
    """Check that each version has one writer (`InOut`), after all its readers; outputs keep their version.

    Returns:
        The problems; and, by reader and writer, those that apply if the reader cannot run between the writer's steps.
    """
    writers: dict[Endpoint, tuple[UnlinkedNode, Link]] = {}
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
    return _readers(nodes, writers) if writers and not problems else (problems, {})


def _port(draft: UnlinkedNode, link: Link) -> str:
    return next(name for name, links in draft.links.items() if link in links)


def _readers(
    nodes: Mapping[str, UnlinkedNode], writers: Mapping[Endpoint, tuple[UnlinkedNode, Link]]
) -> tuple[list[Problem], dict[tuple[str, str], Problem]]:
    problems = []
    suspects: dict[tuple[str, str], Problem] = {}
    before = Ancestors(nodes)
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
                    problem = link.value.problem("RG128", f"{text}, which overwrites it; read {newer}")
                    if writer.type.cls.record is Node.record:
                        problems.append(problem)
                    else:
                        suspects[draft.spec.id, writer.spec.id] = problem
    return problems, suspects


class Ancestors(dict[str, set[str]]):
    """All nodes that a node needs in the same frame, computed on demand."""

    def __init__(self, nodes: Mapping[str, UnlinkedNode]) -> None:
        super().__init__()
        self._sources = sources(nodes)

    def __missing__(self, name: str) -> set[str]:
        self[name] = {*depth_first(self._sources, self._sources[name])}
        return self[name]
