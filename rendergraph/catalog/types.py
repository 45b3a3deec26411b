"""A node type, one that has been found but not loaded, and the import of its module.

Modules of plugins by path are reloaded when a file of their folder has changed. All modules of one folder, including
helpers, are dropped together, so that none refers to an old class of another. Installed packages are imported once, as
usual.
"""

from __future__ import annotations

import importlib
import re
import sys
from collections.abc import Mapping, Sequence
from functools import cached_property
from importlib.machinery import FileFinder, ModuleSpec, SourceFileLoader
from pathlib import Path, PurePath
from types import CodeType, ModuleType

from msgspec import Struct

from rendergraph.declare import Input, Node, Views, WrittenPort, declaration_mistakes
from rendergraph.declare.blame import declaration_of, describe_error, source_location
from rendergraph.errors import InputError, Place, Problem, is_interruption, shown_file
from rendergraph.installed import module_spec
from rendergraph.resources import folder
from rendergraph.stamps import Stamp, modified, record_read, replay_reads, track_reads

SHADERS = (".frag", ".comp")
"""Endings of shader files that are nodes by themselves: full-screen and compute."""


PREFIX = "rendergraph_plugin_"
"""Prefix of the names of packages that stand for folders; a number follows."""

_FILES: dict[str, dict[str, Stamp]] = {}
"""Package to the source files of its modules in `sys.modules`."""


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


def load(name: str, listed: Listed) -> NodeType:
    """Import the one node class of a module; raise if the module fails or declares its node wrongly."""
    place = Place(shown_file(listed.file))
    try:
        module = importlib.import_module(listed.module)
    except BaseException as error:  # anything that third-party code raises is its mistake
        if is_interruption(error):
            raise
        text = f"node type '{name}' cannot be imported: {describe_error(error)}"
        where = source_location(error, listed.module, listed.file.parent) or place
        raise InputError(Problem("RG491", text, where)) from error
    types = [value for value in vars(module).values() if isinstance(value, type) and issubclass(value, Node)]
    own = [cls for cls in types if cls.__module__ == module.__name__ and not cls.__name__.startswith("_")]
    classes = list(dict.fromkeys(own))
    if len(classes) != 1:
        names = ", ".join(cls.__name__ for cls in classes) or "none"
        text = f"the module of node type '{name}' must define one Node class; it has {names}"
        raise InputError(Problem("RG492", text, place))
    return of_class(name, classes[0], listed)


def of_class(name: str, cls: type[Node], listed: Listed) -> NodeType:
    """Return the node type of a class; raise if it declares its node wrongly."""
    problems = declaration_mistakes(cls)
    if not problems and not cls.ports():
        problems = [Problem("RG490", "the class has no ports; add an output, as in `color = Output(Radiance, doc=…)`")]
    if problems:
        who = f"node type '{name}'"
        raise InputError([p.relocate(declaration_of(cls, listed.file, p.subject), context=who) for p in problems])
    bases = [base.__module__ for base in cls.__mro__[1:] if issubclass(base, Node) and base is not Node]
    folders = [_shaders_of(base, file_of(base)) for base in bases]
    inherited = tuple(dict.fromkeys(folder for folder in folders if folder != listed.shaders))
    return NodeType(name, listed.family, cls, listed.file, listed.shaders, listed.plugin, inherited=inherited)


def file_of(module: str) -> Path:
    """Return the file of an imported module; a notebook's has none."""
    return Path(getattr(sys.modules.get(module), "__file__", None) or "")


def _shaders_of(module: str, file: Path) -> Path:
    """Return the folder of a module's shaders: `X.shaders/family` for `X.nodes.family.a`, else the module's own."""
    before, nodes, family = module.rpartition(".")[0].partition(".nodes")
    shaders = shader_folder(before + nodes) if nodes and family[:1] in ("", ".") else None
    return file.parent if shaders is None else shaders.joinpath(*family.split("."))


def shader_folder(package: str) -> Path | None:
    """Return the folder of `X.shaders` beside `X.nodes`."""
    parent, _, last = package.rpartition(".")
    if not parent or last != "nodes":
        return None
    spec = module_spec(f"{parent}.shaders")
    folders = spec.submodule_search_locations if spec else None
    return Path(next(iter(folders))) if folders else None


class _Loader(SourceFileLoader):
    """Compiles the source each time, because .pyc files are dated in whole seconds and edits may be quicker."""

    def get_code(self, fullname: str) -> CodeType:
        with track_reads() as files:
            record_read(Path(self.path))
        _FILES.setdefault(fullname.partition(".")[0], {}).update(files)
        return self.source_to_code(self.get_data(self.path), self.path)


class _Finder:
    """Finds the modules of packages from `fresh_package` in the current state of their folders."""

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        if path is None or not fullname.startswith(PREFIX):
            return None
        specs = (FileFinder(folder, (_Loader, [".py"])).find_spec(fullname) for folder in path)
        return next((spec for spec in specs if spec is not None), None)


_FINDER = _Finder()


def fresh_package(name: str, folder: Path) -> None:
    """Make a folder importable as a package; drop its imported modules if a file has changed."""
    if _FINDER not in sys.meta_path:
        sys.meta_path.insert(0, _FINDER)
    if name in sys.modules and modified(_FILES.get(name, {})):
        for module in [module for module in sys.modules if module == name or module.startswith(f"{name}.")]:
            del sys.modules[module]
        del _FILES[name]
    if name not in sys.modules:
        package = ModuleType(name)
        package.__path__ = [str(folder)]
        sys.modules[name] = package
    replay_reads(_FILES.get(name, {}))
