"""A shader file as a node type: a class generated from its header and declarations, without GL or Python code.

The class is like any other: checking, schema, docs and expansion need no special case.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any, TypeAlias

from msgspec.structs import replace

from rendergraph.catalog.entries import Entries, number_rule
from rendergraph.catalog.header import Header, read_header
from rendergraph.catalog.types import Listed, NodeType
from rendergraph.declare import Extensions, Input, Node, Port, WrittenPort, declaration_mistakes
from rendergraph.errors import InputError, shown_file
from rendergraph.glsl import Includes, read_text
from rendergraph.resources import folder
from rendergraph.steps import Steps
from rendergraph.textures import SEMANTICS, SIGNATURES

Record: TypeAlias = "Callable[[Any, Steps], None]"


_MOST_TYPES = 256
_TYPES: dict[tuple[object, ...], NodeType] = {}
"""Cached by everything that defines a type: a file is one class in all pipelines, which can then share passes."""


def load(name: str, listed: Listed, extensions: Extensions) -> NodeType:
    """Return the node type of a shader file; `extensions` provide the semantics of plugins."""
    file = listed.file
    raw = read_text(file)
    header = read_header(raw, file, shown_file(file))
    source = Includes(folder("rendergraph.shaders") / "include").expand(file, versions=True)
    semantics = tuple(semantic.value for semantic in _plugin_semantics(header, extensions))
    key = (file, shown_file(file), raw, source, semantics)
    found = _TYPES.get(key)
    if found is None:
        found = _make(Entries(file, raw, header, source, extensions))
        if len(_TYPES) >= _MOST_TYPES:
            _TYPES.clear()
        _TYPES[key] = found
    return replace(found, name=name, family=listed.family, plugin=listed.plugin)


def _plugin_semantics(header: Header, extensions: Extensions) -> list[Any]:
    """Return the plugins' semantics if the header uses one; otherwise no plugin is imported."""
    entries = [*header.inputs.values(), *header.outputs.values()]
    own = {known.name for known in SEMANTICS} | {known.name for known in SIGNATURES}
    foreign = any("semantic" in entry and entry["semantic"].data not in own for entry in entries)
    return extensions.semantics() if foreign else []


def _make(entries: Entries) -> NodeType:
    file, header = entries.file, entries.header
    entries.collect()
    if entries.problems:
        raise InputError(entries.problems)
    record = _compute(entries) if file.suffix == ".comp" else _fullscreen(entries)
    if entries.problems:
        raise InputError(entries.problems)
    name = "".join(part.capitalize() for part in file.stem.replace("-", "_").split("_")) or "Shader"
    doc = header.doc or f"The shader {file.name}."
    parts = {"__module__": __name__, "__doc__": doc, "shader": file.name, "record": record}
    cls = type(name, (Node,), {**parts, **entries.ports, **entries.parameters})
    # Missing docs are only a warning, and shaders of other tools may have capitals in names.
    if mistakes := declaration_mistakes(cls, lenient=True):
        where = f"shader '{file.name}'"
        raise InputError([found.relocate(entries.place_of(found.subject), context=where) for found in mistakes])
    lines = [line.rstrip() for line in entries.source.lines if line.strip()]
    text = "\n".join([*re.findall(r"^/\*---\n.*?\*/", entries.raw, re.DOTALL | re.MULTILINE)[:1], *lines])
    return NodeType("", "", cls, file, file.parent, warnings=tuple(entries.warnings(cls)), text=text)


def _fullscreen(entries: Entries) -> Record:
    file = entries.file.name
    ordered = entries.outputs_by_location()

    def record(self: Node, steps: Steps) -> None:
        if not ordered:
            steps.fullscreen(file)
            return
        ports = self.ports()  # the text fixes the locations, so none is left out
        steps.fullscreen(file, out={name: ports[name] for name in ordered})

    return record


def _compute(entries: Entries) -> Record:
    """Return a `record` with one dispatch of as many groups as its threads need."""
    file = entries.file.name
    local = tuple(_local_size(entries, f"local_size_{axis}") for axis in "xyz")
    if not any(f"local_size_{axis}" in entries.globals.input_layout for axis in "xyz"):
        text = "a compute shader declares the size of its work groups: layout(local_size_x = 8, local_size_y = 8) in;"
        entries.report("RG443", text)
    threads = _threads(entries)
    outputs = [name for name, port in entries.ports.items() if isinstance(port, WrittenPort)]

    def record(self: Node, steps: Steps) -> None:
        counts = (*threads(self, steps), 1, 1)[:3]
        x, y, z = (max(1, -(-count // size)) for count, size in zip(counts, local, strict=True))
        ports = self.ports()
        steps.compute(file, groups=(x, y, z), out={name: ports[name] for name in outputs})

    return record


def _local_size(entries: Entries, name: str) -> int:
    words = entries.globals.input_layout.get(name)
    try:
        value = entries.globals.number(words) if words is not None else 1
    except ValueError as error:
        entries.report("RG443", f"{name}: {error}")
        return 1
    if not 1 <= value <= 1024:
        entries.report("RG443", f"{name}: expected a whole number from 1 to 1024, got {value}")
    return value


def _threads(entries: Entries) -> Callable[[Node, Steps], tuple[int, ...]]:
    """Return the thread counts: the size of a texture, or the numbers of the header."""
    given = entries.header.threads
    if given is not None and (not isinstance(given.data, str) or given.data.startswith("$")):
        rules = [number_rule(part) for part in (given.data if isinstance(given.data, list) else [given])]
        return lambda node, steps: tuple(rule if isinstance(rule, int) else rule(node, steps.facts) for rule in rules)
    textures = [name for name, port in entries.ports.items() if isinstance(port, WrittenPort) and port.kind != "buffer"]
    name = str(given.data) if given is not None else (textures[0] if textures else "")
    port = entries.ports.get(name)
    if not isinstance(port, Input | WrittenPort) or port.kind == "buffer":
        if given is not None:
            entries.problems.append(given.problem("RG443", f"'threads' names no texture of this node: '{name}'"))
        else:
            text = "there is no output texture whose texels give the threads; add threads: INPUT or threads: [x, y]"
            entries.report("RG443", text)
    return lambda node, steps: _texels(node.ports()[name], steps)


def _texels(port: Port, steps: Steps) -> tuple[int, ...]:
    if isinstance(port, Input) and not steps.connected(port):
        return (1,)
    desc = steps.desc(port)
    return desc.width, desc.height, desc.layers
