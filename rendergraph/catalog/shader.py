"""A shader file as a node type: a class made of its header and of what its text declares. No GL, no Python of anyone's.

The class is like any author's: checking, schema, docs and expansion see no difference.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rendergraph.catalog.entries import Entries
from rendergraph.catalog.header import Header, read_header
from rendergraph.catalog.threads import Record, compute, fullscreen
from rendergraph.catalog.types import Listed, NodeType
from rendergraph.declare import Extensions, Node, declaration_mistakes
from rendergraph.errors import InputError, Problem, shown_file
from rendergraph.glsl import Includes, SourceText, read_text
from rendergraph.resources import folder
from rendergraph.textures import SEMANTICS, SIGNATURES

_KEPT = 256
_MADE: dict[tuple[object, ...], _ShaderType] = {}
"""Types made so far: a file is one class in all pipelines, which then share its passes."""


@dataclass(frozen=True)
class _ShaderType:
    cls: type[Node]
    warnings: tuple[Problem, ...]
    text: str


def load(name: str, listed: Listed, extensions: Extensions) -> NodeType:
    """The node type of a shader file.

    Args:
        name: the type's name.
        listed: the file.
        extensions: for semantics that plugins add.

    Raises:
        InputError: the file cannot be read, or something in it can be no node's; with all mistakes.
    """
    file = listed.file
    raw = read_text(file)
    shown = shown_file(file)
    header = read_header(raw, file, shown)
    source = Includes(folder("rendergraph.shaders") / "include").expand(file, versions=True)
    key = (file, shown, raw, source, tuple(semantic.value for semantic in _plugged(header, extensions)))
    made = _MADE.get(key)
    if made is None:
        made = _make(file, shown, raw, header, source, extensions)
        if len(_MADE) >= _KEPT:
            _MADE.clear()
        _MADE[key] = made
    return NodeType(name, listed.family, made.cls, file, file.parent, listed.plugin, made.warnings, text=made.text)


def _plugged(header: Header, extensions: Extensions) -> list[Any]:
    """The plugins' semantics, where the header has a word of theirs: part of what the class is made of."""
    entries = [*header.inputs.values(), *header.outputs.values()]
    own = {semantic.name for semantic in SEMANTICS} | {signature.name for signature in SIGNATURES}
    foreign = any("semantic" in entry and entry["semantic"].data not in own for entry in entries)
    return list(extensions.semantics()) if foreign else []


def _make(file: Path, shown: str, raw: str, header: Header, source: SourceText, extensions: Extensions) -> _ShaderType:
    entries = Entries(file, shown, raw, header, source, extensions)
    entries.collect()
    if entries.problems:
        raise InputError(entries.problems)
    record: Record = compute(entries) if file.suffix == ".comp" else fullscreen(entries)
    if entries.problems:
        raise InputError(entries.problems)
    doc = header.doc or f"The shader {file.name}."
    words = "".join(part.capitalize() for part in file.stem.replace("-", "_").split("_")) or "Shader"
    parts = {"__module__": __name__, "__doc__": doc, "shader": file.name, "record": record}
    cls = type(words, (Node,), {**parts, **entries.ports, **entries.parameters})
    # Docs may be missing, which a warning says; and other tools' shaders have names with capitals.
    if problems := declaration_mistakes(cls, lenient=True):
        who = f"shader '{file.name}'"
        raise InputError([one.relocate(entries.place_of(one.subject), context=who) for one in problems])
    lines = [line.rstrip() for line in source.lines if line.strip()]
    text = "\n".join([*re.findall(r"^/\*---\n.*?\*/", raw, re.DOTALL | re.MULTILINE)[:1], *lines])
    return _ShaderType(cls, tuple(entries.warnings(cls)), text)
