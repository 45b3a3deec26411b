"""Connect a node's inputs: single links, several at one input, or a group to the ports of one node."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from msgspec import Struct

from rendergraph.catalog import Catalog
from rendergraph.declare import InOut, Input
from rendergraph.document import Value
from rendergraph.errors import InputError, Problem, node_named, suggestion
from rendergraph.link.nodes import References, UnlinkedNode, missing_source
from rendergraph.resolve import PipelineSpec
from rendergraph.textures import Signature


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
