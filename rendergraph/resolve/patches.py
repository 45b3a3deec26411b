"""Merge patches of YAML values, of pipelines whose nodes change types, and of `--set` options."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence, Set
from typing import Any

from msgspec import Struct

from rendergraph.document import Source, Value, from_plain, merge_patch, parse, shown
from rendergraph.errors import InputError, Option, Place, Problem, UsageError, nearest, suggestion
from rendergraph.read import entries, word


class TypeNames(Struct, frozen=True):
    """The parameters and ports of a node type that merging needs; `optional` inputs need no link."""

    params: frozenset[str]
    inputs: frozenset[str]
    groups: Mapping[str, tuple[str, ...]]
    optional: frozenset[str]
    outputs: frozenset[str]


NamesOf = Callable[[Value], TypeNames | None]
"""Returns the names of the type that a `type` value names; None if it does not exist."""


def merge_scene(target: Value | None, patch: Value) -> Value:
    """Merge a pipeline's changes to its scene, which keep their nulls: they remove from a file that is read later."""
    if isinstance(patch.data, dict) and target is not None and isinstance(target.data, str):
        target = target.with_data({"extends": target})
    return merge_patch(target, patch, keep_nulls=True)


def diff(old: Any, new: Any) -> Any:
    """Return the merge patch that turns `old` into `new`, both plain data without nulls; `{}` if they are equal."""
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
    """Apply a patch; return the result and notes about dropped values.

    A node that changes its type loses inherited parameters and inputs that the new type lacks, and optional inputs of
    other nodes lose inherited links to outputs that it lacks. Values that the patch itself sets or removes stay.
    """
    notes: list[Problem] = []
    old_nodes, new_nodes = entries(target, "nodes"), entries(patch, "nodes")
    kept = dict(old_nodes)
    disconnected: dict[str, dict[str, Value]] = {}
    fed: list[tuple[str, Value, Value, frozenset[str]]] = []
    for name, change in new_nodes.items():
        if (node := old_nodes.get(name)) is None:
            continue
        new_type = _new_type(node, change)
        if new_type is not None and (names := names_of(new_type)):
            kept[name] = _drop(name, node, change, new_type, names, notes)
            fed.append((name, node, new_type, names.outputs))
        elif new_type is None and (names := names_of(node.get("type") or node)) and names.groups:
            inputs = change.get("inputs")
            members = {member for group in names.groups.values() for member in group}
            inherited = inputs.mapping if inputs is not None else {}
            disconnected[name] = {key: link for key, link in inherited.items() if link.data is None and key in members}
    for name, node, new_type, outputs in fed:
        before = names_of(node.get("type") or node)
        lost = before.outputs - outputs if before is not None else frozenset[str]()
        for other, key, port in _unlinked(name, lost, kept, new_nodes, names_of):
            text = f"node '{name}' is now '{word(new_type) or 'the new type'}', which has no output '{port}' of "
            text += f"'{word(node, 'type')}'; '{other}.{key}' does without"
            notes.append(_note(new_type, text))
    if (nodes := target.get("nodes")) is not None:
        target = target.updated({"nodes": nodes.with_data(kept)})
    merged = merge_patch(target, patch)
    if (scene := patch.get("scene")) is not None and scene.data is not None:
        merged = merged.updated({"scene": merge_scene(target.get("scene"), scene)})
    # Merging removes nulls, but beside a group a null must stay: it disconnects one member.
    for name, links in disconnected.items():
        present = merged.get("nodes", name, "inputs")
        if links and present is not None:
            present.mapping.update(links)
    return merged, notes


def _new_type(node: Value, change: Value) -> Value | None:
    """Return the type that a change gives a node, if it is another than before."""
    old, new = node.get("type"), change.get("type")
    if old is None or new is None or new.data is None:
        return None
    return None if isinstance(new.data, str) and new.data == old.data else new


def _drop(name: str, node: Value, change: Value, new_type: Value, names: TypeNames, notes: list[Problem]) -> Value:
    parts = dict(node.mapping)
    old, new = word(node, "type"), word(new_type) or "the new type"
    for part, known in (("params", names.params), ("inputs", names.inputs)):
        inherited = entries(node, part)
        written = change.get(part)
        own = written.mapping if written is not None else {}
        lost = [key for key in inherited if key not in known and key not in own]
        if part in parts and lost:
            left = {key: value for key, value in inherited.items() if key not in lost}
            if left:
                parts[part] = parts[part].with_data(left)
            else:
                del parts[part]
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
    """Remove inherited links to a node's lost outputs from optional inputs; yield node, input and output of each."""
    for other, node in list(nodes.items()) if lost else ():
        change = patch.get(other)
        own = (change.get("inputs") or change).mapping if change is not None else {}
        for key, link in entries(node, "inputs").items():
            parts = link.data if isinstance(link.data, list) else [link]
            left = [part for part in parts if _port_of(name, key, part) not in lost]
            if key in own or len(left) == len(parts):
                continue
            names = names_of((change.get("type") if change is not None else None) or node.get("type") or node)
            inputs = nodes[other].get("inputs")
            if names is None or key not in names.optional or inputs is None:
                continue
            rest = {name: value for name, value in inputs.items() if name != key}
            rest |= {key: link.with_data(left)} if left else {}
            nodes[other] = nodes[other].updated({"inputs": inputs.with_data(rest)})
            for port in sorted({str(_port_of(name, key, part)) for part in parts} & lost):
                yield other, key, port


def _port_of(node: str, key: str, link: Value) -> str | None:
    source, _, port = str(link.data).partition("@")[0].partition(".")
    return (port or key) if source == node else None


_NODE_KEYS: dict[str, tuple[Any, str]] = {
    "type": (str, "the name of a node type"),
    "enabled": (bool | None, "true or false"),
}
_ID = "[A-Za-z_][A-Za-z0-9_-]*"
_PATH = rf"((?:{_ID}/)*)(?:({_ID})\.)?({_ID})\Z|(?P<scene>scene)\.(?P<keys>[^./]+(?:\.[^./]+)+)\Z"


class Setting(Struct, frozen=True):
    """One assignment: the path as typed, the sub-pipelines it descends into, a node or None, a name, a value."""

    scope: tuple[str, ...]
    node: str | None
    name: str
    value: Value
    text: str


def settings(sets: Sequence[str] | Mapping[str, object]) -> list[Setting]:
    """Parse assignments: `PATH=VALUE` texts, or a mapping of paths to values."""
    problems: list[Problem] = []
    found: list[Setting] = []
    given = sets.items() if isinstance(sets, Mapping) else (_split(text) for text in sets)
    for path, raw in given:
        is_text = not isinstance(sets, Mapping)
        source = Source(Option("--set", f"{path}={raw}" if is_text and raw is not None else path))
        match = re.match(_PATH, path)
        if raw is None and is_text:
            problems.append(source.problem("RG120", "a setting is written PATH=VALUE, as in light.ambient=0.1"))
        elif match is None or (match[1] and match[2] is None):
            words = "NODE.PARAM, NODE.INPUT, NODE.type, NODE.enabled or the NAME of a parameter"
            problems.append(source.problem("RG120", f"'{shown(path)}' is not a path; write {words}"))
        else:
            try:
                value = _value(str(raw), source) if is_text else from_plain(raw, source)
            except InputError as error:
                problems += [problem.relocate(Place(source.origin), code="RG120") for problem in error.problems]
            else:
                scope = tuple((match[1] or "").split("/")[:-1])
                found.append(Setting(scope, match["scene"] or match[2], match["keys"] or match[3], value, path))
    if problems:
        raise UsageError(problems)
    return found


def _split(text: str) -> tuple[str, str | None]:
    path, equals, raw = text.partition("=")
    return path.strip(), raw if equals else None


def _value(text: str, source: Source) -> Value:
    if text.lstrip().startswith("#"):
        return Value(text, source)  # probably a colour; YAML would read a comment
    return _with_source(parse(text, source.origin).root, source)


def _with_source(value: Value, source: Source) -> Value:
    data = value.data
    if isinstance(data, dict):
        data = {key: _with_source(child, source) for key, child in data.items()}
    elif isinstance(data, list):
        data = [_with_source(child, source) for child in data]
    return Value(data, source)


def patch_of(tree: Value, wanted: Sequence[Setting], names_of: NamesOf) -> tuple[Value | None, list[Problem]]:
    """Return the patch of assignments without a scope, types first, and problems with them."""
    if not wanted:
        return None, []
    problems: list[Problem] = []
    root = Value({}, wanted[0].value.source)
    nodes, parameters = entries(tree, "nodes"), entries(tree, "parameters")

    def put(setting: Setting, *path: str) -> None:
        found = root
        for step in path[:-1]:
            found = found.mapping.setdefault(step, Value({}, setting.value.source))
        found.mapping[path[-1]] = setting.value

    def refuse(setting: Setting, code: str, text: str) -> None:
        problems.append(setting.value.problem(code, text))

    known: list[tuple[Setting, str]] = []
    for setting in wanted:
        node, name = setting.node, setting.name
        if node == "scene" and "scene" not in nodes:
            put(setting, "scene", *name.split("."))
        elif node is None and name in parameters:
            put(setting, "parameters", name, "default")
        elif node is None:
            refuse(setting, "RG119", _no_parameter(setting, parameters, nodes, names_of))
        elif node not in nodes:
            refuse(setting, "RG109", f"there is no node '{node}'{suggestion(node, nodes)}")
        elif name not in _NODE_KEYS:
            known.append((setting, node))
        elif isinstance(setting.value.data, _NODE_KEYS[name][0]):
            put(setting, "nodes", node, name)
        else:
            text = f"'{setting.text}': expected {_NODE_KEYS[name][1]}, got {setting.value.kind}"
            refuse(setting, "RG106", text)
    for setting, node in known:
        name, new_type = setting.name, root.get("nodes", node, "type") or nodes[node].get("type")
        names = names_of(new_type) if new_type is not None else None
        if names is None:
            continue  # an unknown type is reported only once, at the type
        if name in names.params:
            put(setting, "nodes", node, "params", name)
        elif name not in names.inputs:
            hint = suggestion(name, sorted(names.params | names.inputs))
            text = f"node '{node}' ({word(new_type) or 'sub-pipeline'}) has no param or input '{name}'"
            refuse(setting, "RG103", text + hint)
        elif _is_link(setting.value):
            put(setting, "nodes", node, "inputs", name)
        else:
            refuse(setting, "RG106", f"'{setting.text}': expected a link as in 'node.port', a list of links, or null")
    return root, problems


def _is_link(value: Value) -> bool:
    parts = value.data if isinstance(value.data, list) else [value]
    return all(isinstance(part.data, str) for part in parts) or value.data is None


def _no_parameter(
    setting: Setting, parameters: Mapping[str, Value], nodes: Mapping[str, Value], names_of: NamesOf
) -> str:
    text = f"the pipeline has no parameter '{setting.name}'"
    if setting.name in ("size", "scene"):
        return f"{text}; --{setting.name} sets the {setting.name}"
    if setting.name in nodes and setting.value.data in (None, False, "off", "none"):
        return f"{text}; to leave out node '{setting.name}', write {setting.name}.enabled=false"
    if setting.name in nodes:
        return f"{text}; to set one of node '{setting.name}', write {setting.name}.PARAM=VALUE"
    if nearest(setting.name, parameters) is None and (meant := _of_nodes(setting.name, nodes, names_of)):
        return f"{text}; did you mean {' or '.join(meant)}?"
    return text + suggestion(setting.name, parameters)


def _of_nodes(name: str, nodes: Mapping[str, Value], names_of: NamesOf) -> list[str]:
    known: dict[str, list[str]] = {}
    for node, value in nodes.items():
        of_type = value.get("type")
        names = names_of(of_type) if of_type is not None else None
        for parameter in sorted(names.params) if names else ():
            known.setdefault(parameter, []).append(f"'{node}.{parameter}'")
    near = nearest(name, known)
    return known[near] if near else []
