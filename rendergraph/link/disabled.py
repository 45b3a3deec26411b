"""Nodes that are taken out, by `enabled: false` or for want of an environment that they need.

Whoever read an output reads what went into the node instead.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping

from msgspec.structs import replace

from rendergraph.declare import Function, InOut, Input, Port, WrittenPort
from rendergraph.errors import InputError, Problem
from rendergraph.link.names import Draft, Link, References, line_of
from rendergraph.read import word


def mark_unlit(nodes: Mapping[str, Draft]) -> None:
    """Note the nodes that need an environment, in a scene without: neither another node nor the scene gives it."""
    waiting = list(nodes.values())
    while waiting:
        dark = [draft for draft in waiting if not draft.out and _is_dark(draft, nodes)]
        for draft in dark:
            draft.unlit = True
        waiting = waiting if dark else []


def _is_dark(draft: Draft, nodes: Mapping[str, Draft]) -> bool:
    return any(
        isinstance(port, Input)
        and port.takes_scene
        and not port.optional
        and name not in draft.failed
        and all(nodes[link.source.node].out for link in draft.links[name])
        for name, port in draft.inputs.items()
    )


def take_out(nodes: Mapping[str, Draft], references: References) -> dict[str, Draft]:
    """The nodes that stay, their links led past the others; what leads nowhere then is in the `lost` of its reader."""
    enabled = {name: draft for name, draft in nodes.items() if not draft.out}
    for draft in enabled.values() if len(enabled) < len(nodes) else ():
        for name, links in draft.links.items():
            led = [past(link, nodes, references) for link in links]
            draft.links[name] = [link for link in led if link.source.node in enabled]
            if gone := [link for link in led if link.source.node not in enabled]:
                draft.lost[name] = gone[0]
    return enabled


def past(link: Link, nodes: Mapping[str, Draft], references: References) -> Link:
    """A link led past nodes that are out; it still ends at one where nothing that goes into it can stand in."""
    seen = set()
    while (draft := nodes[link.source.node]).out and link.source.now not in seen:
        seen.add(link.source.now)
        into = next(_into(draft, link.source.port, references), None)
        if into is None:
            break
        source = into.source._replace(previous=into.source.previous or link.source.previous)
        link = replace(link, source=source, declared=(*link.declared, *into.declared))
    return link


def lost(user: str, link: Link, nodes: Mapping[str, Draft]) -> Problem:
    """That a node is needed which is out.

    Args:
        user: for what, `'display.radiance' needs 'light.radiance'`.
        link: the link to it, led past as many of those as can be.
        nodes: all nodes.
    """
    value = nodes[link.source.node].spec.disabled
    if value is None:
        text = f"{user}, but '{link.source.node}' is left out: the scene has no environment"
        return link.value.problem("RG132", f"{text}; give it one (--environment), or link another node here")
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
                except InputError:  # reported at the node
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
