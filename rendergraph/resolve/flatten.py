"""Sub-pipelines unfolded and `$parameters` replaced: from a merged tree to plain nodes."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated

from msgspec import Struct
from msgspec.structs import replace

from rendergraph.document import Value, shown
from rendergraph.errors import InputError, Problem, suggestion
from rendergraph.read import NAME, entries, flag, word
from rendergraph.resolve.files import Files, display
from rendergraph.resolve.patches import Setting, patch_of
from rendergraph.resolve.spec import NodeSpec, PipelineParameter, Scope
from rendergraph.typecheck import Range, fits, words_for

MOST_NODES = 10_000
MOST_NESTED = 32
_REFERENCE = rf"\$({NAME.pattern})"


class Flattener(Struct, eq=False):
    files: Files
    nodes: dict[str, NodeSpec] = {}
    scopes: dict[str, Scope] = {}
    _open: list[Path] = []

    def flatten(self, tree: Value, scope: str, given: Mapping[str, Value], sets: Sequence[Setting]) -> Value:
        """Add the nodes of one level; return the tree with sub-pipelines in place of their names.

        Args:
            scope: empty, or the id of the node whose type it is, with a slash.
            given: parameter values from outside.
            sets: assignments into sub-pipelines below.
        """
        declared = entries(tree, "parameters")
        values = {name: self._parameter(name, value, given.get(name)) for name, value in declared.items()}
        used: set[str] = set()
        nodes: dict[str, Value] = {}
        inner: dict[str, list[Setting]] = {}
        for setting in sets:
            inner.setdefault(setting.scope[0], []).append(setting)
        for name, node in entries(tree, "nodes").items():
            nodes[name] = self._node(name, node, scope, values, used, inner.pop(name, []))
        for name, lost in inner.items():
            for setting in lost:
                text = f"there is no sub-pipeline '{scope}{name}'{suggestion(name, nodes)}"
                self.files.say(setting.problem("RG109", text))
        for name, value in declared.items():
            if name not in used:
                self._warn(value.problem("RG151", f"the parameter '{name}' is used nowhere", key=True))
        top = dict(tree.mapping)
        if scope:
            top.pop("plugins", None)  # the resolved file names those of all files at its top
        if "nodes" in top:
            top["nodes"] = top["nodes"].with_data(nodes)
        return tree.with_data(top)

    def _warn(self, problem: Problem) -> None:
        self.files.notes.append(problem.as_warning())

    def _node(
        self,
        name: str,
        node: Value,
        scope: str,
        values: Mapping[str, Value | None],
        used: set[str],
        sets: Sequence[Setting],
    ) -> Value:
        node_id = f"{scope}{name}"
        parts = entries(node)
        params: dict[str, Value] = {}
        for key, value in entries(parts.get("params")).items():
            replaced = self._replaced(value, values, used)
            if replaced is not None and replaced.data is not None:
                params[key] = replaced
        inputs: dict[str, Value] = dict(parts["inputs"].items()) if "inputs" in parts else {}
        disabled = self._disabled(parts, scope)
        node_type = parts.get("type")
        sub = self.files.sub_pipeline(node_type) if node_type is not None else None
        if sub is None or node_type is None:
            if sets:
                text = f"node '{node_id}' is not a sub-pipeline, so it has no inner nodes to set"
                for setting in sets:
                    self.files.say(setting.problem("RG109", text))
            problem = self.files.missing(node_type) if node_type is not None else None
            if problem:
                self.files.say(problem)
            name_of = self.files.type_name(node_type) if node_type is not None else ""
            self._add(NodeSpec(node_id, "" if problem else name_of, scope, inputs, params, node, disabled))
            if node_type is None and ("nodes", name, "type") not in self.files.dropped:
                self._without_type(name, node)
            return _typed(node, node_type, name_of)
        return self._composite(name, node, node_type, sub, scope, params, inputs, disabled, sets)

    def _composite(
        self,
        name: str,
        node: Value,
        node_type: Value,
        sub: Value,
        scope: str,
        params: Mapping[str, Value],
        inputs: dict[str, Value],
        disabled: Value | None,
        sets: Sequence[Setting],
    ) -> Value:
        inside = f"{scope}{name}/"
        path = self.files.path_of(node_type)
        if path in self._open or len(self._open) >= MOST_NESTED:
            text = f"the sub-pipeline '{display(node_type.data)}' contains itself"
            self.files.say(node_type.problem("RG123", text))
            self.files.dropped.add(("nodes", name))
            return node
        sub = self._set_inside(sub, sets)
        declared_inputs, parameters = entries(sub, "inputs"), entries(sub, "parameters")
        for key, value in params.items():
            if key not in parameters:
                text = f"sub-pipeline '{display(node_type.data)}' has no param '{key}'{suggestion(key, parameters)}"
                self.files.say(value.problem("RG103", text, key=True))
        for key, link in inputs.items():
            if key not in declared_inputs:
                text = (
                    f"sub-pipeline '{display(node_type.data)}' has no input '{key}'{suggestion(key, declared_inputs)}"
                )
                self.files.say(link.problem("RG111", text, key=True))
        for key, declared in declared_inputs.items() if disabled is None else ():
            if (key not in inputs or inputs[key].data is None) and not flag(declared, "optional"):
                text = f"input '{key}' of node '{scope}{name}' is not connected; link it to a node's port"
                self.files.say(node.problem("RG114", text, key=True))
        self.scopes[inside] = Scope(scope, declared_inputs, inputs, entries(sub, "outputs"), node, disabled)
        self._open.append(path or Path())
        if path is None:
            self._open[-1] = Path(f"/{len(self._open)}")  # written in place: it has no file to contain
        deeper = [replace(setting, scope=setting.scope[1:]) for setting in sets if len(setting.scope) > 1]
        whole = self.flatten(sub, inside, params, deeper)
        self._open.pop()
        return node.updated({"type": node_type.with_data(whole.data)})

    def _disabled(self, parts: Mapping[str, Value], scope: str) -> Value | None:
        own = parts.get("enabled")
        if own is not None and own.data is False:
            return own
        return self.scopes[scope].disabled if scope else None

    def _set_inside(self, sub: Value, sets: Sequence[Setting]) -> Value:
        here = [setting for setting in sets if len(setting.scope) == 1]
        patch, problems = patch_of(sub, here, self.files.names_of)
        self.files.problems += problems
        return self.files.patched(sub, patch) if patch is not None else sub

    def _add(self, node: NodeSpec) -> None:
        if len(self.nodes) >= MOST_NODES:
            text = f"the pipeline has more than {MOST_NODES:,} nodes, sub-pipelines unfolded"
            raise InputError([*self.files.problems, node.value.problem("RG018", text, key=True)])
        self.nodes[node.id] = node

    def _without_type(self, name: str, node: Value) -> None:
        others = [other.id for other in self.nodes.values() if other.type]
        hint = suggestion(name, others, most=0) or "; add `type:`"
        self.files.say(node.problem("RG108", f"node '{name}' has no type{hint}", key=True))

    def _parameter(self, name: str, declared: Value, given: Value | None) -> Value | None:
        value = given if given is not None else declared.get("default")
        if value is None or value.data is None:
            text = f"the parameter '{name}' has no default; write {name}: {{default: VALUE}}"
            self.files.say(declared.problem("RG121", text, key=True))
            return None
        limits = Range(_number(declared, "min"), _number(declared, "max"))
        if limits.empty:
            text = f"the parameter '{name}' has a min of {limits.low:g} above its max of {limits.high:g}"
            self.files.say(declared.problem("RG121", text, key=True))
            return None
        for part in value.data if isinstance(value.data, list) else [value]:
            if limits != Range() and not fits(part.data, Annotated[float, limits]):
                this = shown(part.data) if fits(part.data, float) else part.kind
                text = f"the parameter '{name}': expected {words_for(float, limits)}, got {this}"
                self.files.say(value.problem("RG122", text))
                return None
        return value

    def _replaced(self, value: Value, values: Mapping[str, Value | None], used: set[str]) -> Value | None:
        """Replace `$name`; return None where the name is unknown or its parameter is wrong."""
        data = value.data
        if isinstance(data, str) and data.startswith("$"):
            match = re.match(_REFERENCE, data)
            if data.startswith("$$"):
                return value.with_data(data[1:])
            if match is None:
                return value
            used.add(match[1])
            if match[1] not in values:
                if ("parameters", match[1]) not in self.files.dropped:
                    hint = suggestion(match[1], values) or "; declare it under `parameters`, or write '$$' for a dollar"
                    text = f"the pipeline has no parameter '{match[1]}'{hint}"
                    self.files.say(value.problem("RG119", text))
                return None
            found = values[match[1]]
            return None if found is None else value.with_data(found.data)
        if isinstance(data, list):
            parts = [self._replaced(part, values, used) for part in data]
            return None if None in parts else value.with_data([part for part in parts if part is not None])
        if isinstance(data, dict):
            table = {key: self._replaced(part, values, used) for key, part in data.items()}
            kept = {key: part for key, part in table.items() if part is not None}
            return None if len(kept) < len(table) else value.with_data(kept)
        return value


def parameters(tree: Value) -> dict[str, PipelineParameter]:
    found = {}
    for name, declared in entries(tree, "parameters").items():
        value = declared.get("default")
        if value is not None:
            low, high = _number(declared, "min"), _number(declared, "max")
            doc = word(declared, "doc") or ""
            found[name] = PipelineParameter(name, value.plain(), declared.key_place, low, high, doc)
    return found


def _typed(node: Value, node_type: Value | None, name: str) -> Value:
    """Write the type as the resolved file needs it: as a path relative to that file."""
    if node_type is None or not node.mapping or not name or node_type.data == name:
        return node
    return node.updated({"type": node_type.with_data(name)})


def _number(declared: Value, key: str) -> float | None:
    value = declared.get(key)
    data = value.data if value is not None else None
    return data if isinstance(data, int | float) else None
