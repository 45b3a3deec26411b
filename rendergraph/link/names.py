"""References to ports: `node.port`, `node`, `inputs.x`, a sub-pipeline's output, `@previous`."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path

from msgspec import Struct, field
from msgspec.structs import replace

from rendergraph.catalog import NodeType
from rendergraph.declare import InOut, Input, Node, Port
from rendergraph.document import Value, shown
from rendergraph.errors import InputError, Place, Problem, suggestion
from rendergraph.link.graph import Endpoint
from rendergraph.read import NAME, word
from rendergraph.resolve import NodeSpec, PipelineSpec

_ID = NAME.pattern.removesuffix(r"\Z")
_LINK = re.compile(rf"({_ID}(?:/{_ID})*)(?:\.({_ID}))?(@previous)?\Z")


class Crossing(Struct, frozen=True, eq=False):
    """An input of a sub-pipeline that a link passes through.

    Attributes:
        name: `glow.radiance`.
        semantic: what it is declared to take, None where nothing is said.
        given: the link outside.
    """

    name: str
    semantic: str | None
    given: Value


class Link(Struct, frozen=True, eq=False, gc=False):
    """One link as it was written, with what it leads to.

    Attributes:
        source: the port it reads.
        value: where it is written.
        declared: the sub-pipeline inputs it passes through, whose semantics it has to have.
    """

    source: Endpoint
    value: Value
    declared: tuple[Crossing, ...] = ()


class Draft(Struct, eq=False):
    """A node with its type, while it is being linked.

    Attributes:
        spec: from the file.
        type: its type.
        node: the instance; defaults stand in for parameters that are wrong.
        ports: every port by name.
        inputs: the ports that take links.
        links: by input, what is connected.
        failed: inputs whose link is wrong, so that nobody says they lack one.
        lost: inputs that lack a link because it leads to a node that is out and that nothing stands in for.
        choices: parameters whose value a plugin brings.
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
    lost: dict[str, Link] = field(default_factory=dict)
    unlit: bool = False

    @property
    def out(self) -> bool:
        """Whether it is no node of the graph: disabled, or without the environment that it needs."""
        return self.unlit or self.spec.disabled is not None


class References:
    """Follows references through sub-pipelines to ports."""

    def __init__(self, spec: PipelineSpec, types: Mapping[str, NodeType]) -> None:
        self.spec = spec
        self.types = types

    def follow(self, scope: str, value: Value, wanted: str) -> Link | None:
        """The port a reference leads to.

        Args:
            scope: the sub-pipeline it stands in.
            value: the reference.
            wanted: the port that a node's id alone stands for.

        Returns:
            None where it leads to an optional input of a sub-pipeline that is not connected.

        Raises:
            InputError: it leads nowhere; without problems where the reason has been reported.
        """
        text = str(value.data)
        match = _LINK.match(text)
        if match is None:
            text = f"'{shown(text)}' is no link; write node.port, or a node's id for its port '{wanted}'"
            raise InputError(value.problem("RG113", text))
        found = self._follow(scope, match[1], match[2], wanted, value, 0)
        if found is None:
            return None
        source = _last(found.source) if match[3] else found.source
        return found if source is found.source and value is found.value else replace(found, source=source, value=value)

    def outputs_of(self, scope: str, name: str) -> list[str]:
        """What a node or sub-pipeline of a scope offers, empty where it is unknown."""
        inner = self.spec.scopes.get(f"{scope}{name}/")
        if inner is not None:
            return list(inner.outputs)
        node_type = self.types.get(f"{scope}{name}")
        return list(node_type.cls.outputs()) if node_type is not None else []

    def is_known(self, scope: str, name: str) -> bool:
        """Whether a scope has a node or sub-pipeline of that name."""
        return f"{scope}{name}" in self.spec.nodes or f"{scope}{name}/" in self.spec.scopes

    def no_node(self, scope: str, name: str, value: Value) -> Problem:
        """What is said of a link to nobody: who took the node away, or who else may be meant."""
        hint = suggestion(name, self.nodes_of(scope))
        if not scope and (removed := self.spec.removed.get(name)) is not None:
            hint = f", {line_of(removed.key_place, value.place)} removes it; link to another node here, or to null"
        return value.problem("RG109", f"there is no node '{name}'{hint}")

    def nodes_of(self, scope: str) -> list[str]:
        """Names that can be linked to in a scope, not all of very many: the nearest is searched among them."""
        names = [node.id for node in self.spec.nodes.values() if node.scope == scope]
        names += [inside[:-1] for inside, found in self.spec.scopes.items() if found.parent == scope]
        return [name.removeprefix(scope) for name in names[:500]] + (["inputs"] if scope else [])

    def _follow(self, scope: str, name: str, port: str | None, wanted: str, value: Value, depth: int) -> Link | None:
        if depth > 100:
            text = f"'{shown(value.data)}' leads back to itself; link it to a node's port"
            raise InputError(value.problem("RG117", text))
        if name == "inputs" and scope:
            return self._outside(scope, port or wanted, value, depth)
        if name == "inputs" and (declared := self.spec.tree.get("inputs", port or wanted)):
            optional = declared.get("optional")
            if optional is not None and optional.data:
                return None
            raise InputError(())  # a sub-pipeline run on its own
        inner = self.spec.scopes.get(f"{scope}{name}/")
        if inner is not None:
            return self._inside(f"{scope}{name}/", port, wanted, value, depth)
        node = self.spec.nodes.get(f"{scope}{name}")
        if node is None and (("nodes", name) in self.spec.dropped or not self.spec.nodes):
            raise InputError(())
        if node is None:
            raise InputError(self.no_node(scope, name, value))
        node_type = self.types.get(node.id)
        if node_type is None:
            raise InputError(())
        if (port or wanted) not in node_type.cls.outputs():
            raise InputError(value.problem("RG112", self._no_output(node, node_type, port, wanted, value)))
        return Link(Endpoint(node.id, port or wanted), value)

    def _outside(self, scope: str, port: str, value: Value, depth: int) -> Link | None:
        """The link from outside that `inputs.x` stands for."""
        found = self.spec.scopes[scope]
        if port not in found.inputs:
            text = f"the sub-pipeline has no input '{port}'{suggestion(port, found.inputs)}"
            raise InputError(value.problem("RG111", text))
        given = found.links.get(port)
        if given is None or given.data is None:
            optional = found.inputs[port].get("optional")
            if optional is not None and optional.data:
                return None
            raise InputError(())  # said at the node
        match = _LINK.match(given.data) if isinstance(given.data, str) else None
        if match is None:
            kind = "takes one link" if isinstance(given.data, list) else "takes a link as in node.port"
            raise InputError(given.problem("RG113", f"input '{port}' of sub-pipeline '{scope[:-1]}' {kind}"))
        link = self._follow(found.parent, match[1], match[2], port, given, depth + 1)
        if link is None:
            return None
        source = _last(link.source) if match[3] else link.source
        crossing = Crossing(f"{scope[:-1]}.{port}", word(found.inputs[port], "semantic"), given)
        return replace(link, source=source, declared=(*link.declared, crossing))

    def _inside(self, scope: str, port: str | None, wanted: str, value: Value, depth: int) -> Link | None:
        """The port inside that a sub-pipeline's output stands for."""
        outputs = self.spec.scopes[scope].outputs
        inner = outputs.get(port or wanted)
        if inner is None:
            name = shown(scope[:-1])
            text = f"sub-pipeline '{name}' has no output '{port or wanted}'{suggestion(port or wanted, outputs)}"
            raise InputError(value.problem("RG112", text))
        match = _LINK.match(str(inner.data))
        if match is None:
            text = f"'{shown(inner.data)}' is no link; write node.port, or a node's id for its port '{port or wanted}'"
            raise InputError(inner.problem("RG113", text))
        link = self._follow(scope, match[1], match[2], port or wanted, inner, depth + 1)
        if link is None:
            return None
        source = _last(link.source) if match[3] else link.source
        return replace(link, source=source)

    def _no_output(self, node: NodeSpec, node_type: NodeType, port: str | None, wanted: str, value: Value) -> str:
        outputs = node_type.cls.outputs()
        name = port or wanted
        text = f"node '{node.id}' of {line_of(node.place, value.place)} ({node_type.name}) has no output '{name}'"
        if port is None:
            return f"{text}; name one as in {node.id}.PORT{suggestion('', outputs)}"
        if name in node_type.cls.inputs():
            return f"{text}, only an input of that name{suggestion(name, outputs)}"
        return text + suggestion(name, outputs)


def _last(source: Endpoint) -> Endpoint:
    return source._replace(previous=True)


def line_of(place: Place, here: Place) -> str:
    """A place for a message that already names a file: its line, with the file where that is another one."""
    if not place.line:
        return str(place.origin)
    return f"line {place.line}" if place.origin == here.origin else f"{place.origin}:{place.line}"
