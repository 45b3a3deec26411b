"""Node types by name, imported on first use."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

from msgspec.structs import replace

from rendergraph.catalog import find, types
from rendergraph.catalog.types import Listed, NodeType
from rendergraph.declare import NO_EXTENSIONS, Extensions, Node
from rendergraph.declare.node import type_name
from rendergraph.errors import InputError, Place, Problem, shown_file, suggestion
from rendergraph.installed import entry_points, plain

GROUP = "rendergraph.nodes"
"""The entry point group; an entry's value is a package of node modules in folders by family."""
NOTEBOOK = "notebook"
"""The plugin name of classes that a script or a notebook defines."""


class Catalog:
    """Node types by name, imported on first use."""

    def __init__(
        self,
        listed: Mapping[str, Sequence[Listed]],
        types: Mapping[str, NodeType] | None = None,
        extensions: Extensions = NO_EXTENSIONS,
        notes: tuple[Problem, ...] = (),
    ) -> None:
        self._listed = {name: tuple(found) for name, found in listed.items()}
        self._types = dict(types or {})
        self._loaded: dict[tuple[str, tuple[Listed, ...]], NodeType] = {}
        self._classes: dict[str, type[Node]] = {}
        self.notes = notes
        """Warnings about plugins that the environment names but that do not exist, as folders of PATH need not."""
        self.extensions = extensions
        """What plugins add besides node types, imported when the first name is requested."""

    @classmethod
    def discover(cls, plugin_paths: Iterable[Path] = (), *, installed: bool = True) -> Catalog:
        """Return all installed node types, and those in files and folders the user named.

        These are, in this order, packages by entry point, `plugins` of the settings of the project around the current
        folder, `RENDERGRAPH_PATH`, and `plugin_paths`. A folder that is a package's project, according to its
        `pyproject.toml`, replaces an installed copy of the package.

        Args:
            plugin_paths: node modules, shader files, or folders of them; code, so never taken from a pipeline file.
            installed: also search beyond `plugin_paths`.
        """
        named = {entry.path.resolve(): entry for entry in find.configured()} if installed else {}
        named |= {path.resolve(): find.PluginPath(path) for path in plugin_paths}
        listed: dict[str, list[Listed]] = {}
        folders = [path for path in named if path.is_dir()]
        own = find.projects(folders)
        offered = list(entry_points(GROUP, find.EXTENSIONS)) if installed else []
        if own:
            offered = [entry for entry in offered if plain(entry.package.name) not in own]
        for entry in (entry for entry in offered if entry.group == GROUP):
            _add(listed, find.package(entry.name, entry.module))
        notes = []
        for plugin in named.values():
            try:
                _add(listed, ((name, replace(one, named=plugin.words)) for name, one in find.loose(plugin)))
            except InputError as error:
                if not plugin.where or plugin.path.exists():
                    raise
                notes += [problem.as_warning() for problem in error.problems]
        added = find.extensions(folders, [entry for entry in offered if entry.group == find.EXTENSIONS])
        found = cls(listed, extensions=added, notes=tuple(notes))
        return found.with_classes(own_classes()) if installed else found

    def with_file(self, name: str, file: Path) -> Catalog:
        """Return the same with one shader file under the name, which is usually its path."""
        return self.with_shaders([(name, find.shader(file.resolve()))])

    def with_shaders(self, found: Iterable[tuple[str, Listed]]) -> Catalog:
        """Return the same with shader files that a pipeline file names; loaded types are shared."""
        listed = {name: list(those) for name, those in self._listed.items()}
        _add(listed, found)
        more = Catalog(listed, self._types, self.extensions, self.notes)
        more._loaded, more._classes = self._loaded, self._classes
        return more

    @classmethod
    def of(cls, *classes: type[Node], shaders: Path = Path(), **named: type[Node]) -> Catalog:
        """Return a catalog of classes, for tests; a type's name is the class's in snake case, or the keyword."""
        named = {type_name(c): c for c in classes} | named
        files = {name: types.file_of(c.__module__) for name, c in named.items()}
        return cls({}, {name: NodeType(name, "", c, files[name], shaders, "test") for name, c in named.items()})

    def with_classes(self, named: Mapping[str, type[Node]]) -> Catalog:
        """Return the same with classes of a running program, which replace other types of the same names.

        Their shaders are in the current folder, or in the folder of the class's module.
        """
        others = {name: one for name, one in self._types.items() if one.cls is named.get(name, one.cls)}
        more = Catalog(self._listed, others, self.extensions, self.notes)
        more._loaded, more._classes = self._loaded, {**self._classes, **named}
        return more

    def __contains__(self, name: object) -> bool:
        return any(name in known for known in (self._types, self._classes, self._listed))

    def names(self) -> list[str]:
        return sorted(self._types.keys() | self._classes.keys() | self._listed.keys())

    def has_plugin(self, name: str) -> bool:
        """Whether anything comes from a plugin of this name, spelled like a package or like a module."""
        plugins = {one.plugin for found in self._listed.values() for one in found}
        return any(plain(plugin) == plain(name) for plugin in plugins)

    def files(self) -> set[Path]:
        return {one.file for found in self._listed.values() for one in found}

    def families(self) -> dict[str, list[str]]:
        table: dict[str, list[str]] = {}
        for name in self.names():
            known = self._types.get(name) or next(iter(self._listed.get(name, ())), None)
            family = known.family if known is not None and name not in self._classes else ""
            table.setdefault(family, []).append(name)
        return dict(sorted(table.items()))

    def get(self, name: str) -> NodeType:
        """Return a type, importing it on first use."""
        if name in self._types:
            return self._types[name]
        if (cls := self._classes.get(name)) is not None:
            file = types.file_of(cls.__module__)
            listed = Listed(cls.__module__, "", file, (file.parent if file.name else Path()).resolve(), NOTEBOOK)
            return self._types.setdefault(name, types.of_class(name, cls, listed))
        if name not in self._listed:
            raise InputError(Problem("RG102", f"there is no node type '{name}'{suggestion(name, self.names())}"))
        key = (name, self._listed[name])
        if key not in self._loaded:
            self._loaded[key] = self._load(*key)
        return self._loaded[key]

    def usable(self, names: Iterable[str] | None = None) -> tuple[list[NodeType], list[Problem]]:
        """Return the valid types among all or these names, and the mistakes in the others."""
        found: list[NodeType] = []
        problems: list[Problem] = []
        for name in self.names() if names is None else names:
            try:
                found.append(self.get(name))
            except InputError as error:
                problems += error.problems
        return found, problems

    def _load(self, name: str, found: Sequence[Listed]) -> NodeType:
        listed = found[0]
        if len(found) > 1:
            plugins = " and ".join(f"'{other.plugin}' ({shown_file(other.file)}{other.named})" for other in found)
            text = f"node type '{name}' comes from {plugins}; rename one"
            raise InputError(Problem("RG493", text, Place(shown_file(listed.file))))
        if listed.module:
            return types.load(name, listed)
        from rendergraph.catalog import shader  # most pipelines use no shader files

        return shader.load(name, listed, self.extensions)


def own_classes() -> dict[str, type[Node]]:
    """Return the node classes of the running script or notebook, by the names of their types."""
    values = list(vars(sys.modules["__main__"]).values()) if "__main__" in sys.modules else []
    classes = [value for value in values if isinstance(value, type) and issubclass(value, Node)]
    return {type_name(cls): cls for cls in classes if cls.__module__ == "__main__" and cls.__name__[0] != "_"}


def _add(listed: dict[str, list[Listed]], found: Iterable[tuple[str, Listed]]) -> None:
    """Add types; a file that is named twice is one type."""
    for name, one in found:
        known = listed.setdefault(name, [])
        if all(one.file != other.file for other in known):
            known.append(one)
