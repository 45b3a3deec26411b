"""A node type, and one that has been seen but not loaded."""

from __future__ import annotations

import re
from collections.abc import Mapping
from functools import cached_property
from pathlib import Path, PurePath

from msgspec import Struct

from rendergraph.declare import Input, Node, Views, WrittenPort
from rendergraph.errors import InputError, Place, Problem, shown_file
from rendergraph.resources import folder
from rendergraph.stamps import record_read

SHADERS = (".frag", ".comp")
"""Endings of shader files that are nodes by themselves: full-screen and compute."""


class NodeType(Struct, frozen=True, dict=True):
    """One node type.

    Attributes:
        name: the word after `type:`: the stem of its file, or the path of a shader file that is used by path.
        family: the folder it lies in (`shadows`), empty for a single file.
        cls: the class.
        file: its Python file, or the shader file that it is made of.
        shaders: the folder its shaders' names are relative to.
        inherited: those of the types it extends, the nearest first: what is not in `shaders` is looked for there.
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
    inherited: tuple[Path, ...] = ()
    missing: bool = False
    text: str = ""

    @cached_property
    def read(self) -> Mapping[str, Input]:
        """Those of its inputs that are read, and not continued."""
        return {name: port for name, port in self.cls.inputs().items() if isinstance(port, Input)}

    @cached_property
    def written(self) -> Mapping[str, WrittenPort]:
        """Its textures and buffers: what it makes or continues."""
        return {name: port for name, port in self.cls.ports().items() if isinstance(port, WrittenPort)}

    @cached_property
    def views(self) -> Mapping[str, Views]:
        """Its tables of views."""
        return {name: port for name, port in self.cls.ports().items() if isinstance(port, Views)}

    @property
    def is_shader(self) -> bool:
        """Whether it is a shader file without Python."""
        return self.file.suffix in SHADERS

    def shader_file(self, name: str, include: Path | None = None) -> tuple[Path, Path]:
        """The file of one of its shaders, and the folder that its includes in quotes must stay in.

        `<name>` lies in `include`, the shipped one by default; any other in the type's own folder, or in that of a type
        it extends. One that is nowhere belongs in the first.
        """
        if name.startswith("<"):
            include = include or shared_includes()
            return include / name[1:-1], include
        folder = next((home for home in (self.shaders, *self.inherited) if _is_there(home / name)), self.shaders)
        return folder / name, folder

    def choice_file(self, kind: str, choice: str) -> Path:
        """The include of one of the type's own choices: `kind/choice.glsl` among its shaders or the shared includes.

        Args:
            kind: the name under which plugins add choices to the parameter.
            choice: the word.

        Raises:
            InputError: there is no such file.
        """
        name = f"{kind}/{choice}.glsl"
        for home in (self.shaders, *self.inherited, shared_includes()):
            if _is_there(home / name):
                return home / name
        text = f"node type '{self.name}' has the choice '{choice}', but no include '{name}'"
        raise InputError(Problem("RG401", text, Place(shown_file(self.file))))

    @property
    def word(self) -> str:
        """What a node of the type may be called in a file; the type's own name is a path where a shader's path is."""
        return node_word(self.name)


def shared_includes() -> Path:
    """The folder where `#include <…>` looks."""
    return folder("rendergraph.shaders") / "include"


def _is_there(file: Path) -> bool:
    record_read(file)
    return file.is_file()


def node_word(name: str) -> str:
    """A type's name as a node's id."""
    return re.sub(r"[^A-Za-z0-9_-]", "_", PurePath(name).stem)


class Listed(Struct, frozen=True):
    """A module, or a shader file, that has been seen but not loaded; `module` is empty for a shader file.

    `named` says in words where its plugin is named by path.
    """

    module: str
    family: str
    file: Path
    shaders: Path
    plugin: str
    named: str = ""
