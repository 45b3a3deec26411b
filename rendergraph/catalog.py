"""Finding node types: the standard nodes and a stranger's plugin arrive by the same entry point.

Folders are listed, modules are not imported: a type's name is the stem of its module, and a run imports only the nodes
it uses.
"""

from __future__ import annotations

import importlib
import importlib.util
import os
import re
import sys
import traceback
import zlib
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType

from rendergraph.declare import Node, declaration_mistakes
from rendergraph.errors import InputError, Place, Problem, suggestion

GROUP = "rendergraph.nodes"
"""The entry point group; an entry's value is a package of node modules in folders by family."""


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
class _Listed:
    """A module that has been seen but not imported."""

    module: str
    family: str
    file: Path
    shaders: Path
    plugin: str


class Catalog:
    """Node types by name, imported when they are asked for."""

    def __init__(self, listed: Mapping[str, list[_Listed]], types: Mapping[str, NodeType] | None = None) -> None:
        self._listed = dict(listed)
        self._types = dict(types or {})

    @classmethod
    def discover(cls, plugin_paths: Iterable[Path] = (), *, installed: bool = True) -> Catalog:
        """All installed node types, and those in files and folders the user named.

        Args:
            plugin_paths: node modules, or folders of them; code, so never taken from a pipeline file.
            installed: look at entry points too.

        Raises:
            InputError: a plugin path does not exist.
        """
        from importlib.metadata import entry_points

        listed: dict[str, list[_Listed]] = {}
        for entry in entry_points(group=GROUP) if installed else ():
            _add(listed, _package(entry.name, entry.value.partition(":")[0]))
        for path in plugin_paths:
            _add(listed, _loose(path))
        return cls(listed)

    @classmethod
    def of(cls, *classes: type[Node], shaders: Path = Path(), **named: type[Node]) -> Catalog:
        """A catalog of classes at hand, for tests; a type's name is the class's in snake case, or the keyword."""
        named = {re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", c.__name__).lower(): c for c in classes} | named
        files = {name: Path(getattr(sys.modules.get(c.__module__), "__file__", "") or "") for name, c in named.items()}
        return cls({}, {name: NodeType(name, "", c, files[name], shaders, "test") for name, c in named.items()})

    def __contains__(self, name: object) -> bool:
        return name in self._types or name in self._listed

    def names(self) -> list[str]:
        """The names of all types, sorted; nothing is imported."""
        return sorted(self._types.keys() | self._listed.keys())

    def families(self) -> dict[str, list[str]]:
        """Family to the names of its types, both sorted; nothing is imported."""
        table: dict[str, list[str]] = {}
        for name in self.names():
            family = self._types[name].family if name in self._types else self._listed[name][0].family
            table.setdefault(family, []).append(name)
        return dict(sorted(table.items()))

    def get(self, name: str) -> NodeType:
        """A type, imported on first use.

        Raises:
            InputError: there is none of that name, two plugins have one, its module fails, or it is declared wrongly.
        """
        if name not in self._types:
            if name not in self._listed:
                raise InputError(Problem("RG102", f"there is no node type '{name}'{suggestion(name, self.names())}"))
            self._types[name] = _load(name, self._listed[name])
        return self._types[name]


def _add(listed: dict[str, list[_Listed]], found: Iterable[tuple[str, _Listed]]) -> None:
    for name, module in found:
        listed.setdefault(name, []).append(module)


def _package(plugin: str, package: str) -> Iterator[tuple[str, _Listed]]:
    """The modules of an installed package, found without importing more than its parent."""
    try:
        spec = importlib.util.find_spec(package)
    except (ImportError, ValueError, AttributeError):
        spec = None
    if spec is None:  # an entry left behind by a half-removed package: its nodes are missing, no more
        return
    if not spec.submodule_search_locations:
        file = Path(spec.origin or "")
        yield file.stem, _Listed(package, "", file, file.parent, plugin)
        return
    shaders = _shader_folder(package)
    for folder in spec.submodule_search_locations:
        yield from _modules(Path(folder), package, plugin, shaders)


def _shader_folder(package: str) -> Path | None:
    """`X.shaders` beside `X.nodes`."""
    parent, _, last = package.rpartition(".")
    if not parent or last != "nodes":
        return None
    try:
        spec = importlib.util.find_spec(f"{parent}.shaders")
    except (ImportError, ValueError, AttributeError):
        return None
    folders = spec.submodule_search_locations if spec else None
    return Path(next(iter(folders))) if folders else None


def _modules(folder: Path, package: str, plugin: str, shaders: Path | None) -> Iterator[tuple[str, _Listed]]:
    for where, subfolders, files in os.walk(folder):
        subfolders[:] = sorted(name for name in subfolders if name.isidentifier() and not name.startswith("_"))
        family = Path(where).relative_to(folder).as_posix().removeprefix(".")
        for file in sorted(files):
            stem, suffix = os.path.splitext(file)
            if suffix == ".py" and not stem.startswith("_"):
                module = ".".join([package, *filter(None, family.split("/")), stem])
                beside = Path(where) if shaders is None else shaders / family
                yield stem, _Listed(module, family, Path(where) / file, beside, plugin)


def _loose(path: Path) -> Iterator[tuple[str, _Listed]]:
    """The modules of a file or folder that is not installed, as a package of their own, so that they can import
    each other relatively.
    """
    if not path.exists():
        raise InputError(Problem("RG011", f"there is no plugin '{path}'"))
    path = path.resolve()
    folder = path if path.is_dir() else path.parent
    package = f"rendergraph_plugin_{zlib.crc32(os.fsencode(folder)):08x}"
    if package not in sys.modules:
        module = ModuleType(package)
        module.__path__ = [str(folder)]
        sys.modules[package] = module
    plugin = folder.name if path.is_dir() else path.stem
    nodes, shaders = folder / "nodes", folder / "shaders"
    if path.is_dir() and nodes.is_dir() and shaders.is_dir():
        yield from _modules(nodes, f"{package}.nodes", plugin, shaders)
    elif path.is_dir():
        yield from _modules(folder, package, plugin, None)
    else:
        yield path.stem, _Listed(f"{package}.{path.stem}", "", path, folder, plugin)


def _load(name: str, found: list[_Listed]) -> NodeType:
    listed = found[0]
    place = Place(str(listed.file))
    if len(found) > 1:
        plugins = " and ".join(f"'{other.plugin}' ({other.file})" for other in found)
        raise InputError(Problem("RG493", f"node type '{name}' comes from {plugins}; rename one", place))
    try:
        module = importlib.import_module(listed.module)
    except Exception as error:  # whatever a stranger's module raises is a mistake in that module
        raise InputError(_failed(name, listed.file, error)) from error
    classes = [
        value
        for value in vars(module).values()
        if isinstance(value, type) and issubclass(value, Node) and value.__module__ == module.__name__
    ]
    classes = [cls for cls in dict.fromkeys(classes) if not cls.__name__.startswith("_")]
    if len(classes) != 1:
        names = ", ".join(cls.__name__ for cls in classes) or "none"
        text = f"the module of node type '{name}' must define one Node class, it has {names}"
        raise InputError(Problem("RG492", text, place))
    mistakes = declaration_mistakes(classes[0])
    if mistakes:
        raise InputError([Problem("RG490", f"node type '{name}': {mistake}", place) for mistake in mistakes])
    return NodeType(name, listed.family, classes[0], listed.file, listed.shaders, listed.plugin)


def _failed(name: str, file: Path, error: Exception) -> Problem:
    """The author's own line of what a module raised."""
    line = 0
    if isinstance(error, SyntaxError) and error.filename == str(file):
        line = error.lineno or 0
    for frame in traceback.extract_tb(error.__traceback__):
        if frame.filename == str(file):
            line = frame.lineno or line
    text = f"node type '{name}' cannot be imported: {type(error).__name__}: {error}"
    return Problem("RG491", " ".join(text.split()), Place(str(file), line, 1 if line else 0))
