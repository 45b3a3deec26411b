"""JSON Merge Patch on values that know their place, and what it means for a node to get another type."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Set
from typing import Any

from msgspec import Struct

from rendergraph.document import Value
from rendergraph.errors import Problem
from rendergraph.read import entries, word


class TypeNames(Struct, frozen=True):
    """What a node type takes and makes, as far as merging asks; `optional` are inputs it can do without."""

    params: frozenset[str]
    inputs: frozenset[str]
    groups: Mapping[str, tuple[str, ...]]
    optional: frozenset[str]
    outputs: frozenset[str]


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

    A node that gets another type loses the inherited parameters and inputs that the new type lacks, and optional inputs
    of others lose their inherited links to outputs that it lacks, with a note; what the patch itself writes or removes
    is its own affair.
    """
    notes: list[Problem] = []
    old_nodes, new_nodes = entries(target, "nodes"), entries(patch, "nodes")
    kept = dict(old_nodes)
    disconnected: dict[str, dict[str, Value]] = {}
    fed: list[tuple[str, Value, Value, frozenset[str]]] = []
    for name, change in new_nodes.items():
        node = old_nodes.get(name)
        if node is None:
            continue
        new_type = change.get("type")
        retyped = new_type is not None and new_type.data is not None and _differ(node.get("type"), new_type)
        if retyped and new_type is not None and (names := names_of(new_type)):
            kept[name] = _drop(name, node, change, new_type, names, notes)
            fed.append((name, node, new_type, names.outputs))
        elif not retyped and (names := names_of(node.get("type") or node)) and names.groups:
            inputs = change.get("inputs")
            disconnected[name] = {
                key: link
                for key, link in (inputs.items() if inputs is not None else ())
                if link.data is None and any(key in members for members in names.groups.values())
            }
    for name, node, new_type, outputs in fed:
        before = names_of(node.get("type") or node)
        lost = before.outputs - outputs if before is not None else frozenset[str]()
        for other, key, port in _unlinked(name, lost, kept, new_nodes, names_of):
            text = f"node '{name}' is now '{word(new_type) or 'the new type'}', which has no output '{port}' of "
            text += f"'{word(node, 'type')}'; '{other}.{key}' does without"
            notes.append(_note(new_type, text))
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
            notes.append(_note(new_type, text))
    return node.with_data(parts)


def _note(new_type: Value, text: str) -> Problem:
    return new_type.problem("RG150", text).as_warning()


def _unlinked(
    name: str, lost: Set[str], nodes: dict[str, Value], patch: Mapping[str, Value], names_of: NamesOf
) -> Iterator[tuple[str, str, str]]:
    """Take inherited links to a node's lost outputs out of the optional inputs of others.

    Yields:
        The other node, its input and the output, of each link that is gone.
    """
    for other, node in list(nodes.items()) if lost else ():
        change = patch.get(other)
        own = _mapping(change.get("inputs") or change) if change is not None else {}
        for key, link in entries(node, "inputs").items():
            parts = link.data if isinstance(link.data, list) else [link]
            left = [part for part in parts if _port_of(name, key, part) not in lost]
            if key in own or len(left) == len(parts):
                continue
            names = names_of((change.get("type") if change is not None else None) or node.get("type") or node)
            inputs = nodes[other].get("inputs")
            if names is None or key not in names.optional or inputs is None:
                continue
            rest = {name: value for name, value in _mapping(inputs).items() if name != key}
            rest |= {key: link.with_data(left)} if left else {}
            nodes[other] = nodes[other].with_data({**_mapping(nodes[other]), "inputs": inputs.with_data(rest)})
            for port in sorted({str(_port_of(name, key, part)) for part in parts} & lost):
                yield other, key, port


def _port_of(node: str, key: str, link: Value) -> str | None:
    """The port of a node that a link leads to, None where it leads to another node."""
    source, _, port = str(link.data).partition("@")[0].partition(".")
    return (port or key) if source == node else None
