"""JSON Merge Patch on values that know their place, and what it means for a node to get another type."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from rendergraph.document import Value
from rendergraph.errors import Problem
from rendergraph.read import entries, word


@dataclass(frozen=True)
class TypeNames:
    """What a node type takes, as far as merging asks."""

    params: frozenset[str]
    inputs: frozenset[str]
    groups: dict[str, tuple[str, ...]]


NamesOf = Callable[[Value], TypeNames | None]
"""From the value of `type` to what it takes, None where there is no such type."""


def merge_patch(target: Value | None, patch: Value) -> Value:
    """RFC 7386: mappings merge, null removes, everything else replaces; each value keeps its own place."""
    if not isinstance(patch.data, dict):
        return patch
    merged: dict[str, Value] = {}
    if target is not None and isinstance(target.data, dict):
        merged.update(target.data)
    for key, value in patch.data.items():
        if value.data is None:
            merged.pop(key, None)
        else:
            merged[key] = merge_patch(merged.get(key), value)
    return patch.with_data(merged)


def diff(old: Any, new: Any) -> Any:
    """The merge patch that makes `new` of `old`, both plain data without nulls; `{}` where they are equal."""
    if not isinstance(old, dict) or not isinstance(new, dict):
        return new
    patch: dict[str, Any] = {key: None for key in old if key not in new}
    for key, value in new.items():
        if key not in old:
            patch[key] = value
        elif old[key] != value or type(old[key]) is not type(value):
            patch[key] = diff(old[key], value)
    return patch


def merge_pipeline(target: Value, patch: Value, names_of: NamesOf) -> tuple[Value, list[Problem]]:
    """A pipeline with a patch applied, and what was dropped on the way.

    A node that gets another type loses the inherited parameters and inputs that the new type lacks, with a note; those
    that the patch itself writes or removes are its own affair.
    """
    notes: list[Problem] = []
    old_nodes, new_nodes = entries(target, "nodes"), entries(patch, "nodes")
    kept = dict(old_nodes)
    disconnected: dict[str, dict[str, Value]] = {}
    for name, change in new_nodes.items():
        node = old_nodes.get(name)
        if node is None:
            continue
        new_type = change.get("type")
        retyped = new_type is not None and new_type.data is not None and _differ(node.get("type"), new_type)
        if retyped and new_type is not None and (names := names_of(new_type)):
            kept[name] = _drop(name, node, change, new_type, names, notes)
        elif not retyped and (names := names_of(node.get("type") or node)) and names.groups:
            inputs = change.get("inputs")
            disconnected[name] = {
                key: link
                for key, link in (inputs.items() if inputs is not None else ())
                if link.data is None and any(key in members for members in names.groups.values())
            }
    if "nodes" in (target.data if isinstance(target.data, dict) else {}):
        nodes = target.get("nodes")
        assert nodes is not None
        target = target.with_data({**_mapping(target), "nodes": nodes.with_data(kept)})
    merged = merge_patch(target, patch)
    # Merging takes a null away, but beside a group it still has to say that this one member is not connected.
    for name, links in disconnected.items():
        present = merged.get("nodes", name, "inputs")
        if links and present is not None:
            _mapping(present).update(links)
    return merged, notes


def _mapping(value: Value) -> dict[str, Value]:
    return value.data if isinstance(value.data, dict) else {}


def _differ(old: Value | None, new: Value) -> bool:
    if old is None:
        return False
    if isinstance(old.data, str) and isinstance(new.data, str):
        return old.data != new.data
    return True


def _drop(name: str, node: Value, change: Value, new_type: Value, names: TypeNames, notes: list[Problem]) -> Value:
    parts = dict(_mapping(node))
    old, new = word(node, "type"), word(new_type) or "the new type"
    for part, known in (("params", names.params), ("inputs", names.inputs)):
        inherited = entries(node, part)
        written = change.get(part)
        own = _mapping(written) if written is not None else {}
        lost = [key for key in inherited if key not in known and key not in own]
        if part in parts and lost:
            parts[part] = parts[part].with_data({key: value for key, value in inherited.items() if key not in lost})
            word_for = part.removesuffix("s") if len(lost) == 1 else part
            listed = ", ".join(f"'{key}'" for key in lost)
            text = f"node '{name}' is now '{new}', which has no {word_for} {listed} of '{old}'; dropped"
            problem = new_type.problem("RG150", text)
            notes.append(Problem(problem.code, problem.text, problem.place, problem.line_text, "warning"))
    return node.with_data(parts)
