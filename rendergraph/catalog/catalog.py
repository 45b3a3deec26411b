"""Node types by name, imported when they are asked for."""

from __future__ import annotations

import re
import sys
from collections.abc import Iterable, Mapping
from pathlib import Path

from rendergraph.catalog import find, modules
from rendergraph.catalog.extensions import extensions
from rendergraph.catalog.types import Listed, NodeType
from rendergraph.declare import NO_EXTENSIONS, Extensions, Node
from rendergraph.errors import InputError, Problem, suggestion

GROUP = "rendergraph.nodes"
"""The entry point group; an entry's value is a package of node modules in folders by family."""


class Catalog:
    """Node types by name, imported when they are asked for."""

    def __init__(
        self,
        listed: Mapping[str, list[Listed]],
        types: Mapping[str, NodeType] | None = None,
        extensions: Extensions = NO_EXTENSIONS,
    ) -> None:
        self._listed = dict(listed)
        self._types = dict(types or {})
        self.extensions = extensions
        """What plugins add beside node types, imported when the first name is asked for."""

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

        plugin_paths = tuple(plugin_paths)
        listed: dict[str, list[Listed]] = {}
        for entry in entry_points(group=GROUP) if installed else ():
            _add(listed, find.package(entry.name, entry.value.partition(":")[0]))
        for path in plugin_paths:
            _add(listed, find.loose(path))
        folders = [(find.package_of(path), path.resolve()) for path in plugin_paths if path.is_dir()]
        return cls(listed, extensions=extensions(folders, installed=installed))

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
            self._types[name] = modules.load(name, self._listed[name])
        return self._types[name]


def _add(listed: dict[str, list[Listed]], found: Iterable[tuple[str, Listed]]) -> None:
    for name, module in found:
        listed.setdefault(name, []).append(module)
