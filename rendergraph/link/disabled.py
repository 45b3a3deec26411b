"""Nodes that `enabled: false` takes out: whoever read an output reads what went into the node instead."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace

from rendergraph.declare import Function, InOut, Port, WrittenPort
from rendergraph.errors import Problem
from rendergraph.link.names import Draft, Link, References, Wrong, line_of
from rendergraph.read import word


def take_out(nodes: Mapping[str, Draft], references: References) -> dict[str, Draft]:
    """The enabled nodes, their links led past the others; what leads nowhere then is in the `lost` of its reader."""
    enabled = {name: draft for name, draft in nodes.items() if draft.spec.disabled is None}
    for draft in enabled.values() if len(enabled) < len(nodes) else ():
        for name, links in draft.links.items():
            led = [past(link, nodes, references) for link in links]
            draft.links[name] = [link for link in led if link.source.node in enabled]
            if gone := [link for link in led if link.source.node not in enabled]:
                draft.lost[name] = gone[0]
    return enabled


def past(link: Link, nodes: Mapping[str, Draft], references: References) -> Link:
    """A link led past disabled nodes; it still ends at one where nothing that goes into it can stand in."""
    seen = set()
    while (draft := nodes[link.source.node]).spec.disabled is not None and link.source.now not in seen:
        seen.add(link.source.now)
        into = next(_into(draft, link.source.port, references), None)
        if into is None:
            break
        source = replace(into.source, previous=into.source.previous or link.source.previous)
        link = replace(link, source=source, declared=(*link.declared, *into.declared))
    return link


def lost(user: str, link: Link, nodes: Mapping[str, Draft]) -> Problem:
    """That a disabled node is needed.

    Args:
        user: for what, `'display.radiance' needs 'light.radiance'`.
        link: the link to it, led past as many disabled nodes as can be.
        nodes: all nodes.
    """
    value = nodes[link.source.node].spec.disabled
    assert value is not None
    where = line_of(value.place, link.value.place)
    text = f"{user}, but '{link.source.node}' is disabled ({where}) and nothing that goes into it can stand in"
    return link.value.problem("RG132", f"{text}; enable it, or link another node here")


def _into(draft: Draft, port: str, references: References) -> Iterator[Link]:
    """What may stand in for an output: the node's own links, then those of the disabled sub-pipelines around it."""
    made = _meant(draft, draft.ports[port])
    meaning = made.signature if isinstance(made, Function) else getattr(made, "semantic", None)
    like = [made.name] if made.name in draft.inputs else []
    kind = getattr(made, "kind", "function")
    same = [name for name, one in draft.inputs.items() if one.kind == kind and meaning and one.semantic == meaning]
    yield from _alone(draft.links[name] for name in [*like, *same])
    scope = draft.spec.scope
    while scope and (found := references.spec.scopes[scope]).disabled is not None:
        for name, declared in found.inputs.items():
            if meaning is not None and word(declared, "semantic") == meaning.name:
                try:
                    link = references.follow(scope, declared.with_data(f"inputs.{name}"), name)
                except Wrong:  # said at the node
                    continue
                yield from [link] if link is not None else []
        scope = found.parent


def _meant(draft: Draft, port: Port) -> Port:
    """The port that says what a port means, which may be made like another."""
    while isinstance(port, WrittenPort) and not isinstance(port, InOut) and port.semantic is None and port.like:
        port = draft.ports[port.like]
    return port


def _alone(inputs: Iterable[list[Link]]) -> Iterator[Link]:
    """Links that are their input's only one, last frame's values after all others."""
    found = [links[0] for links in inputs if len(links) == 1]
    yield from sorted(found, key=lambda link: link.source.previous)
