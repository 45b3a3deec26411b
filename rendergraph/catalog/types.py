"""A node type, and one that has been seen but not loaded."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from pathlib import Path, PurePath

from rendergraph.declare import Node
from rendergraph.errors import Problem

SHADERS = (".frag", ".comp")
"""Endings of shader files that are nodes by themselves: full-screen and compute."""


@dataclass(frozen=True)
class NodeType:
    """One node type.

    Attributes:
        name: the word after `type:`: the stem of its file, or the path of a shader file that is used by path.
        family: the folder it lies in (`shadows`), empty for a single file.
        cls: the class.
        file: its Python file, or the shader file that it is made of.
        shaders: the folder its shaders' names are relative to.
        plugin: the name of the entry point, or of the folder, it came by.
        warnings: what is missing in a shader file and can be done without.
        missing: nobody has it; it stands in a graph that is only looked at.
        text: of a shader file its header and its lines with those of its includes, without comments.
    """

    name: str
    family: str
    cls: type[Node]
    file: Path
    shaders: Path
    plugin: str = "builtin"
    warnings: tuple[Problem, ...] = ()
    missing: bool = False
    text: str = field(default="", repr=False)

    @property
    def is_shader(self) -> bool:
        """Whether it is a shader file without Python."""
        return self.file.suffix in SHADERS

    @property
    def word(self) -> str:
        """What a node of the type may be called in a file; the type's own name is a path where a shader's path is."""
        return node_word(self.name)


def node_word(name: str) -> str:
    """A type's name as a node's id."""
    return re.sub(r"[^A-Za-z0-9_-]", "_", PurePath(name).stem)


@dataclass(frozen=True)
class Listed:
    """A module, or a shader file, that has been seen but not loaded; `module` is empty for a shader file.

    `named` says in words where its plugin is named by path.
    """

    module: str
    family: str
    file: Path
    shaders: Path
    plugin: str
    named: str = ""
