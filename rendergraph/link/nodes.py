"""Nodes while they are being linked, and those taken out: disabled, or in need of an environment that is missing."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path

from msgspec import Struct, field
from msgspec.structs import replace

from rendergraph.catalog import Catalog, NodeType
from rendergraph.declare import Function, InOut, Input, Node, Port, WrittenPort
from rendergraph.document import Value, shown
from rendergraph.errors import InputError, Place, Problem, node_named, suggestion
from rendergraph.link.graph import Endpoint
from rendergraph.read import NAME, flag, word
from rendergraph.resolve import NodeSpec, PipelineSpec
from rendergraph.textures import EnvironmentMap, Signature

_ID = NAME.pattern.removesuffix(r"\Z")
_LINK = re.compile(rf"({_ID}(?:/{_ID})*)(?:\.({_ID}))?(@previous)?\Z")


class SubgraphInput(Struct, frozen=True, eq=False):
    """An input of a sub-pipeline that a link passes through: `glow.radiance`, its semantic, and the outer link."""

    name: str
    semantic: str | None
    given: Value


class Link(Struct, frozen=True, eq=False, gc=False):
    """One link as it was written, the port it leads to, and the sub-pipeline inputs it passes through."""

    source: Endpoint
    value: Value
    declared: tuple[SubgraphInput, ...] = ()


class UnlinkedNode(Struct, eq=False):
    """A node with its type, while it is being linked.

    Attributes:
        node: the instance; defaults stand in for parameters that are wrong.
        failed: inputs whose link is wrong, so that they are not reported as unconnected.
        lost_links: links of inputs that lead to a removed node for which nothing stands in.
        choices: parameters whose value a plugin provides, with its include.
        unlit: it needs an environment, and neither the file nor the scene has one.
    """

    spec: NodeSpec
    type: NodeType
    node: Node
    ports: Mapping[str, Port]
    inputs: Mapping[str, Input | InOut]
    links: dict[str, list[Link]]
    failed: set[str]
    choices: Mapping[str, Path]
    lost_links: dict[str, Link] = field(default_factory=dict)
    unlit: bool = False

    @property
    def is_removed(self) -> bool:
        return self.unlit or self.spec.disabled is not None


class References(Struct, eq=False):
    spec: PipelineSpec
    types: Mapping[str, NodeType]

    def follow(self, scope: str, value: Value, default_port: str) -> Link | None:
        """Return the link to the port that a reference names; None for an optional sub-pipeline input without a link.

        Args:
            scope: the sub-pipeline that contains the reference.
            default_port: the port that a node's id alone stands for.

        Raises:
            InputError: it leads nowhere; without problems where the reason has been reported.
        """
        link = self._reference(scope, value, default_port, 0)
        return replace(link, value=value) if link is not None and link.value is not value else link

    def outputs_of(self, scope: str, name: str) -> list[str]:
        inner = self.spec.scopes.get(f"{scope}{name}/")
        if inner is not None:
            return list(inner.outputs)
        node_type = self.types.get(f"{scope}{name}")
        return list(node_type.cls.outputs()) if node_type is not None else []

    def is_known(self, scope: str, name: str) -> bool:
        return f"{scope}{name}" in self.spec.nodes or f"{scope}{name}/" in self.spec.scopes

    def no_node(self, scope: str, name: str, value: Value) -> Problem:
        hint = suggestion(name, self.nodes_of(scope))
        if not scope and (removed := self.spec.removed.get(name)) is not None:
            hint = f", {line_of(removed.key_place, value.place)} removes it; link to another node here, or to null"
        return value.problem("RG109", f"there is no node '{name}'{hint}")

    def nodes_of(self, scope: str) -> list[str]:
        """Return at most 500 names that can be linked to in a scope, for suggestions."""
        names = [node.id for node in self.spec.nodes.values() if node.scope == scope]
        names += [inside[:-1] for inside, found in self.spec.scopes.items() if found.parent == scope]
        return [name.removeprefix(scope) for name in names[:500]] + (["inputs"] if scope else [])

    def _reference(self, scope: str, value: Value, default_port: str, depth: int) -> Link | None:
        match = _LINK.match(value.data) if isinstance(value.data, str) else None
        if match is None:
            text = f"'{shown(value.data)}' is not a link; write node.port, or a node's id for its port '{default_port}'"
            raise InputError(value.problem("RG113", text))
        if depth > 100:
            text = f"'{shown(value.data)}' leads back to itself; link it to a node's port"
            raise InputError(value.problem("RG117", text))
        link = self._follow(scope, match[1], match[2] or default_port, value, depth)
        if link is None or not match[3]:
            return link
        return replace(link, source=link.source._replace(previous=True))

    def _follow(self, scope: str, name: str, port: str, value: Value, depth: int) -> Link | None:
        if name == "inputs" and scope:
            return self._outside(scope, port, value, depth)
        if name == "inputs" and (declared := self.spec.tree.get("inputs", port)):
            if flag(declared, "optional"):
                return None
            raise InputError(())  # a sub-pipeline run on its own
        inner = self.spec.scopes.get(f"{scope}{name}/")
        if inner is not None:
            return self._inside(f"{scope}{name}/", port, value, depth)
        node = self.spec.nodes.get(f"{scope}{name}")
        if node is None and (("nodes", name) in self.spec.dropped or not self.spec.nodes):
            raise InputError(())
        if node is None:
            raise InputError(self.no_node(scope, name, value))
        node_type = self.types.get(node.id)
        if node_type is None:
            raise InputError(())
        if port not in node_type.cls.outputs():
            raise InputError(value.problem("RG112", self._no_output(node, node_type, port, value)))
        return Link(Endpoint(node.id, port), value)

    def _outside(self, scope: str, port: str, value: Value, depth: int) -> Link | None:
        found = self.spec.scopes[scope]
        if port not in found.inputs:
            text = f"the sub-pipeline has no input '{port}'{suggestion(port, found.inputs)}"
            raise InputError(value.problem("RG111", text))
        given = found.links.get(port)
        if given is None or given.data is None:
            if flag(found.inputs[port], "optional"):
                return None
            raise InputError(())  # reported at the node
        if isinstance(given.data, list):
            text = f"'{scope[:-1]}.{port}': expected one link as in node.port, got a list"
            raise InputError(given.problem("RG113", text))
        link = self._reference(found.parent, given, port, depth + 1)
        if link is None:
            return None
        entered = SubgraphInput(f"{scope[:-1]}.{port}", word(found.inputs[port], "semantic"), given)
        return replace(link, declared=(*link.declared, entered))

    def _inside(self, scope: str, port: str, value: Value, depth: int) -> Link | None:
        outputs = self.spec.scopes[scope].outputs
        if port not in outputs:
            text = f"sub-pipeline '{shown(scope[:-1])}' has no output '{port}'{suggestion(port, outputs)}"
            raise InputError(value.problem("RG112", text))
        return self._reference(scope, outputs[port], port, depth + 1)

    def _no_output(self, node: NodeSpec, node_type: NodeType, port: str, value: Value) -> str:
        outputs = node_type.cls.outputs()
        text = f"node '{node.id}' of {line_of(node.place, value.place)} ({node_type.name}) has no output '{port}'"
        if "." not in str(value.data):
            return f"{text}; name one as in {node.id}.PORT{suggestion('', outputs)}"
        if port in node_type.cls.inputs():
            return f"{text}, only an input of that name{suggestion(port, outputs)}"
        return text + suggestion(port, outputs)


class Connector(Struct, eq=False):
    spec: PipelineSpec
    catalog: Catalog
    references: References
    report: Callable[[Problem], None]

    def connect(self, draft: UnlinkedNode) -> None:
        cls = draft.type.cls
        inputs, groups = draft.inputs, cls.groups()
        for name, value in draft.spec.inputs.items():
            if name in inputs:
                self._input(draft, name, inputs[name], value)
            elif name in groups:
                self._group(draft, name, groups[name], value)
            else:
                known = [*inputs, *groups]
                hint = suggestion(name, known) if known else "; it has none"
                if name in cls.parameters():
                    hint = f"; '{name}' is a param, move it to `params`"
                text = f"node type '{draft.type.name}' has no input '{name}'{hint}"
                self.report(value.problem("RG111", text, key=True))

    def complete(self, draft: UnlinkedNode, written: Mapping[str, UnlinkedNode]) -> None:
        by_link: dict[int, list[str]] = {}
        for name, port in draft.inputs.items():
            if draft.links[name] or port.optional or name in draft.failed or self._dropped(draft, name):
                continue
            if isinstance(port, Input) and port.takes_scene and name not in draft.lost_links:
                continue
            if name in draft.lost_links:
                by_link.setdefault(id(draft.lost_links[name].value), []).append(name)
            else:
                text = f"input '{name}' of {node_named(draft.spec.id, draft.type.name)} is not connected"
                self.report(draft.spec.value.problem("RG114", text + self._source_for(draft, port), key=True))
        for inputs in by_link.values():
            end = draft.lost_links[inputs[0]].source
            needed = f"needs '{end}'" if len(inputs) == 1 else f"need '{end.node}'"
            listed = ", ".join(f"'{draft.spec.id}.{name}'" for name in inputs)
            self.report(missing_source(f"{listed} {needed}", draft.lost_links[inputs[0]], written))

    def _dropped(self, draft: UnlinkedNode, name: str) -> bool:
        path = ("nodes", draft.spec.id.removeprefix(draft.spec.scope), "inputs")
        return path in self.spec.dropped or (*path, name) in self.spec.dropped

    def _input(self, draft: UnlinkedNode, name: str, port: Input | InOut, value: Value) -> None:
        if isinstance(value.data, list):
            if not (isinstance(port, Input) and port.many):
                text = f"'{draft.spec.id}.{name}': expected one link as in node.port, got a list"
                self.report(value.problem("RG115", text))
                draft.failed.add(name)
                return
            for part in value.data:
                self._follow(draft, name, part, name)
        elif value.data is not None:
            self._follow(draft, name, value, name)

    def _follow(self, draft: UnlinkedNode, name: str, value: Value, port: str) -> None:
        try:
            found = self.references.follow(draft.spec.scope, value, port)
        except InputError as error:
            draft.failed.add(name)
            for problem in error.problems:
                self.report(problem)
        else:
            if found is not None:
                draft.links[name].append(found)

    def _group(self, draft: UnlinkedNode, group: str, members: Sequence[str], value: Value) -> None:
        """Connect every member that has no link of its own to the port of the same name."""
        missing = [name for name in members if name not in draft.spec.inputs]
        if value.data is None:
            return
        node, _, previous = str(value.data).partition("@")
        scope = draft.spec.scope
        if isinstance(value.data, list) or "." in node or (previous and previous != "previous"):
            text = f"'{draft.spec.id}.{group}' is a group; link it to a node's id, without a port"
            self.report(value.problem("RG113", text))
        elif not self.references.is_known(scope, node):
            self.report(self.references.no_node(scope, node, value))
        else:
            offered = self.references.outputs_of(scope, node)
            lacking = []
            for name in missing:
                if name in offered:
                    self._follow(draft, name, value, name)
                elif offered:
                    optional = draft.inputs[name].optional
                    lacking += [] if optional else [name]
            if lacking:
                listed = ", ".join(f"'{name}'" for name in lacking)
                text = f"'{draft.spec.id}.{group}' expects a node with {listed}, which '{node}' lacks"
                self.report(value.problem("RG112", f"{text}; link {listed} beside the group"))
            if offered and not lacking:
                return
        draft.failed.update(missing)

    def _source_for(self, draft: UnlinkedNode, port: Input | InOut) -> str:
        wanted, found = port.semantic, list[tuple[str, str]]()
        for other in self.spec.nodes.values():
            if other.scope != draft.spec.scope or other.id == draft.spec.id or other.type not in self.catalog:
                continue
            try:
                outputs = self.catalog.get(other.type).cls.outputs()
            except InputError:
                continue
            for name, candidate in outputs.items():
                meant = getattr(candidate, "signature", None) or getattr(candidate, "semantic", None)
                kind = getattr(candidate, "kind", port.kind)
                if wanted is not None and meant is not None and (meant.name, kind) == (wanted.name, port.kind):
                    found.append((name, f"'{other.id.removeprefix(other.scope)}.{name}'"))
        if found:  # the port with the input's own name is usually meant
            best = [end for name, end in found if name == port.name] or [end for _, end in found]
            return f"; {' or '.join(best[:3])} would fit"
        what = f"{wanted.name}()" if isinstance(wanted, Signature) else wanted.name if wanted else "anything"
        return f"; it expects {what}"


def line_of(place: Place, other: Place) -> str:
    """Name a place in a message about another place: its line, and its file only where that differs."""
    if not place.line:
        return str(place.origin)
    return f"line {place.line}" if place.origin == other.origin else f"{place.origin}:{place.line}"


def mark_without_environment(nodes: Mapping[str, UnlinkedNode]) -> None:
    """Mark nodes that need an environment which neither another node nor the scene provides."""
    while without := [one for one in nodes.values() if not one.is_removed and _lacks_environment(one, nodes)]:
        for draft in without:
            draft.unlit = True


def _lacks_environment(draft: UnlinkedNode, nodes: Mapping[str, UnlinkedNode]) -> bool:
    return any(
        isinstance(port, Input)
        and port.semantic == EnvironmentMap
        and not port.optional
        and name not in draft.failed
        and all(nodes[link.source.node].is_removed for link in draft.links[name])
        for name, port in draft.inputs.items()
    )


def remove_disabled(nodes: Mapping[str, UnlinkedNode], references: References) -> dict[str, UnlinkedNode]:
    """Return the remaining nodes with their links bypassing the removed ones."""
    enabled = {name: draft for name, draft in nodes.items() if not draft.is_removed}
    for draft in enabled.values() if len(enabled) < len(nodes) else ():
        for name, links in draft.links.items():
            led = [bypass(link, nodes, references) for link in links]
            draft.links[name] = [link for link in led if link.source.node in enabled]
            if gone := [link for link in led if link.source.node not in enabled]:
                draft.lost_links[name] = gone[0]
    return enabled


def bypass(link: Link, nodes: Mapping[str, UnlinkedNode], references: References) -> Link:
    """Lead a link past removed nodes; it still ends at one where no input can stand in for the output."""
    seen = set()
    while (draft := nodes[link.source.node]).is_removed and link.source.now not in seen:
        seen.add(link.source.now)
        into = next(_stand_ins(draft, link.source.port, references), None)
        if into is None:
            break
        source = into.source._replace(previous=into.source.previous or link.source.previous)
        link = replace(link, source=source, declared=(*link.declared, *into.declared))
    return link


def missing_source(user: str, link: Link, nodes: Mapping[str, UnlinkedNode]) -> Problem:
    """The problem of a `user` (`'display.radiance' needs 'light.radiance'`) that needs a removed node."""
    value = nodes[link.source.node].spec.disabled
    if value is None:
        text = f"{user}, but '{link.source.node}' is left out: the scene has no environment"
        return link.value.problem("RG132", f"{text}; give it one (--environment), or link another node here")
    where = line_of(value.place, link.value.place)
    text = f"{user}, but '{link.source.node}' is disabled ({where}) and none of its inputs can replace its output"
    return link.value.problem("RG132", f"{text}; enable it, or link another node here")


def _stand_ins(draft: UnlinkedNode, port: str, references: References) -> Iterator[Link]:
    """Links that may stand in for an output: the node's own, then those of disabled sub-pipelines around it."""
    made = _meaning(draft, draft.ports[port])
    meaning = made.signature if isinstance(made, Function) else getattr(made, "semantic", None)
    like = [made.name] if made.name in draft.inputs else []
    kind = getattr(made, "kind", "function")
    same = [name for name, one in draft.inputs.items() if one.kind == kind and meaning and one.semantic == meaning]
    single = [draft.links[name][0] for name in [*like, *same] if len(draft.links[name]) == 1]
    yield from sorted(single, key=lambda link: link.source.previous)  # those to last frame's values last
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


def _meaning(draft: UnlinkedNode, port: Port) -> Port:
    """Follow `like` to the port that defines the semantic."""
    while isinstance(port, WrittenPort) and not isinstance(port, InOut) and port.semantic is None and port.like:
        port = draft.ports[port.like]
    return port
