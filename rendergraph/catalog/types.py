"""A node type, and one that has been seen but not loaded."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from rendergraph.declare import Node


@dataclass(frozen=True)
class NodeType:
    """One node type.

    Attributes:
        name: the stem of its module, the word after `type:`.
        family: the folder it lies in (`shadows`), empty for a single file.
        cls: the class.
        file: its Python file.
        shaders: the folder its shaders' names are relative to.
        plugin: the name of the entry point it came by.
    """

    name: str
    family: str
    cls: type[Node]
    file: Path
    shaders: Path
    plugin: str = "builtin"


@dataclass(frozen=True)
class Listed:
    """A module that has been seen but not imported."""

    module: str
    family: str
    file: Path
    shaders: Path
    plugin: str
