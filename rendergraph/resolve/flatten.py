"""Flatten a merged tree to plain nodes: inline sub-pipelines and substitute `$parameters`."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated

from msgspec import Struct
from msgspec.structs import replace

from rendergraph.document import Value, shown
from rendergraph.errors import InputError, suggestion
from rendergraph.read import NAME, entries, flag, word
from rendergraph.resolve.files import Files
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
                self.files.report(setting.value.problem("RG109", text))
        for name, value in declared.items():
            if name not in used:
                problem = value.problem("RG151", f"the parameter '{name}' is used nowhere", key=True)
                self.files.notes.append(problem.as_warning())
        top = dict(tree.mapping)
        if scope:
            top.pop("plugins", None)  # the top of the resolved file names those of all files
        if "nodes" in top:
            top["nodes"] = top["nodes"].with_data(nodes)
        return tree.with_data(top)

    def _node(
        self,
        name: str,
        node: Value,
        scope: str,
        values: Mapping[str, Value | None],
        used: set[str],
        sets: Sequence[Setting],
    ) -> Value:
        parts = entries(node)
        params: dict[str, Value] = {}
        for key, value in entries(parts.get("params")).items():
            replaced = self._replaced(value, values, used)
            if replaced is not None and replaced.data is not None:
                params[key] = replaced
        inputs: dict[str, Value] = dict(parts["inputs"].items()) if "inputs" in parts else {}
        spec = NodeSpec(f"{scope}{name}", "", scope, inputs, params, node, self._disabled(parts, scope))
        node_type = parts.get("type")
        if node_type is not None and (sub := self.files.sub_pipeline(node_type)) is not None:
            return self._composite(spec, node_type, sub, sets)
        for setting in sets:
            text = f"node '{spec.id}' is not a sub-pipeline, so it has no inner nodes to set"
            self.files.report(setting.value.problem("RG109", text))
        if len(self.nodes) >= MOST_NODES:
            text = f"the pipeline has more than {MOST_NODES:,} nodes, sub-pipelines unfolded"
            raise InputError([*self.files.problems, node.problem("RG018", text, key=True)])
        self.nodes[spec.id] = spec
        if node_type is None:
            if ("nodes", name, "type") not in self.files.dropped:
                others = [other.id for other in self.nodes.values() if other.type]
                hint = suggestion(name, others, most=0) or "; add `type:`"
                self.files.report(node.problem("RG108", f"node '{name}' has no type{hint}", key=True))
            return node
        type_name = self.files.type_name(node_type)
        if problem := self.files.missing(node_type):
            self.files.report(problem)
        else:
            self.nodes[spec.id] = replace(spec, type=type_name)
        # The resolved file needs a path relative to itself.
        written = node.mapping and type_name and node_type.data != type_name
        return node.updated({"type": node_type.with_data(type_name)}) if written else node

    def _composite(self, spec: NodeSpec, node_type: Value, sub: Value, sets: Sequence[Setting]) -> Value:
        node, shown_type = spec.value, shown(word(node_type) or "sub-pipeline")
        path = self.files.path_of(node_type)
        if path in self._open or len(self._open) >= MOST_NESTED:
            self.files.report(node_type.problem("RG123", f"the sub-pipeline '{shown_type}' contains itself"))
            self.files.dropped.add(("nodes", spec.id.removeprefix(spec.scope)))
            return node
        patch, problems = patch_of(sub, [one for one in sets if len(one.scope) == 1], self.files.names_of)
        self.files.problems += problems
        sub = self.files.patched(sub, patch) if patch is not None else sub
        declared_inputs = entries(sub, "inputs")
        for given, word_for, code, known in (
            (spec.params, "param", "RG103", entries(sub, "parameters")),
            (spec.inputs, "input", "RG111", declared_inputs),
        ):
            for key, value in given.items():
                if key not in known:
                    text = f"sub-pipeline '{shown_type}' has no {word_for} '{key}'{suggestion(key, known)}"
                    self.files.report(value.problem(code, text, key=True))
        for key, declared in declared_inputs.items() if spec.disabled is None else ():
            if (key not in spec.inputs or spec.inputs[key].data is None) and not flag(declared, "optional"):
                text = f"input '{key}' of node '{spec.id}' is not connected; link it to a node's port"
                self.files.report(node.problem("RG114", text, key=True))
        inside, outputs = f"{spec.id}/", entries(sub, "outputs")
        self.scopes[inside] = Scope(spec.scope, declared_inputs, spec.inputs, outputs, node, spec.disabled)
        # An inline sub-pipeline has no file; a unique path stands for it.
        self._open.append(path or Path(f"/{len(self._open) + 1}"))
        deeper = [replace(setting, scope=setting.scope[1:]) for setting in sets if len(setting.scope) > 1]
        whole = self.flatten(sub, inside, spec.params, deeper)
        self._open.pop()
        return node.updated({"type": node_type.with_data(whole.data)})

    def _disabled(self, parts: Mapping[str, Value], scope: str) -> Value | None:
        own = parts.get("enabled")
        if own is not None and own.data is False:
            return own
        return self.scopes[scope].disabled if scope else None

    def _parameter(self, name: str, declared: Value, given: Value | None) -> Value | None:
        value = given if given is not None else declared.get("default")
        if value is None or value.data is None:
            text = f"the parameter '{name}' has no default; write {name}: {{default: VALUE}}"
            self.files.report(declared.problem("RG121", text, key=True))
            return None
        limits = Range(_number(declared, "min"), _number(declared, "max"))
        if limits.empty:
            text = f"the parameter '{name}' has a min of {limits.low:g} above its max of {limits.high:g}"
            self.files.report(declared.problem("RG121", text, key=True))
            return None
        for part in value.data if isinstance(value.data, list) else [value]:
            if limits != Range() and not fits(part.data, Annotated[float, limits]):
                this = shown(part.data) if fits(part.data, float) else part.kind
                text = f"the parameter '{name}': expected {words_for(float, limits)}, got {this}"
                self.files.report(value.problem("RG122", text))
                return None
        return value

    def _replaced(self, value: Value, values: Mapping[str, Value | None], used: set[str]) -> Value | None:
        """Replace `$name`; return None if the name is unknown or its parameter is wrong."""
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
                    self.files.report(value.problem("RG119", text))
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


def _number(declared: Value, key: str) -> float | None:
    value = declared.get(key)
    data = value.data if value is not None else None
    return data if isinstance(data, int | float) else None
