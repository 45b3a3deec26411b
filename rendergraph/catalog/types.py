"""A node type, and one that has been found but not loaded."""

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
        name: the value of `type:`: the stem of its file, or the path of a shader file that is used by path.
        shaders: the folder its shaders' names are relative to.
        inherited: the same of the types that it extends, nearest first, for shaders that are not in `shaders`.
        missing: a placeholder for an unknown type, in a graph that is only shown.
        text: for a shader file, its header and lines with those of its includes, without comments.
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
        """Its inputs, without those that it continues."""
        return {name: port for name, port in self.cls.inputs().items() if isinstance(port, Input)}

    @cached_property
    def written(self) -> Mapping[str, WrittenPort]:
        """The textures and buffers that it creates or continues."""
        return {name: port for name, port in self.cls.ports().items() if isinstance(port, WrittenPort)}

    @cached_property
    def views(self) -> Mapping[str, Views]:
        return {name: port for name, port in self.cls.ports().items() if isinstance(port, Views)}

    @property
    def is_shader(self) -> bool:
        return self.file.suffix in SHADERS

    def shader_file(self, name: str, include: Path | None = None) -> tuple[Path, Path]:
        """Return the file of one of its shaders, and the folder that its includes in quotes must stay in.

        `<name>` is in `include`, the shipped one by default; any other in the type's own folder, or in that of a type
        it extends. A missing file belongs in the first.
        """
        if name.startswith("<"):
            include = include or shared_includes()
            return include / name[1:-1], include
        folder = next((home for home in (self.shaders, *self.inherited) if _is_there(home / name)), self.shaders)
        return folder / name, folder

    def choice_file(self, kind: str, choice: str) -> Path:
        """Return the include of one of its own choices: `kind/choice.glsl` among its shaders or the shared includes."""
        name = f"{kind}/{choice}.glsl"
        for home in (self.shaders, *self.inherited, shared_includes()):
            if _is_there(home / name):
                return home / name
        text = f"node type '{self.name}' has the choice '{choice}', but no include '{name}'"
        raise InputError(Problem("RG401", text, Place(shown_file(self.file))))

    @property
    def word(self) -> str:
        """A node id for the type, whose name may be a path."""
        return re.sub(r"[^A-Za-z0-9_-]", "_", PurePath(self.name).stem)


def shared_includes() -> Path:
    return folder("rendergraph.shaders") / "include"


def _is_there(file: Path) -> bool:
    record_read(file)
    return file.is_file()


class Listed(Struct, frozen=True):
    """A module or shader file that has been found but not loaded; `module` is empty for a shader file.

    `named` is a phrase that says where its plugin is named by path.
    """

    module: str
    family: str
    file: Path
    shaders: Path
    plugin: str
    named: str = ""
