"""Installed packages: their versions and entry points, read from the metadata folders beside their code.

`importlib.metadata` also supports archives, but importing its e-mail parsers takes longer than planning a pipeline.
Here a package is a folder in `sys.path` that ends in `.dist-info` (PyPA, "Recording installed projects") or
`.egg-info`, or an unpacked egg. Packages in zip archives are not found.
"""

from __future__ import annotations

import importlib
import os
import re
import sys
from collections.abc import Iterable, Iterator
from functools import lru_cache, reduce
from importlib.machinery import ModuleSpec
from typing import Any

from msgspec import Struct

from rendergraph.errors import Problem, UsageError
from rendergraph.stamps import Stamp, folder_names, stamp


class Package(Struct, frozen=True):
    """An installed package, by the folder of its metadata."""

    folder: str

    @property
    def name(self) -> str:
        """The name in its metadata, not normalised."""
        return self._field("Name") or _name_and_version(self.folder)[0]

    @property
    def version(self) -> str:
        """The version in the folder's name; that in the metadata if an editable installation has none."""
        return _name_and_version(self.folder)[1] or self._field("Version")

    def _field(self, name: str) -> str:
        lines = (line for file in ("METADATA", "PKG-INFO") for line in _lines(self.folder, file))
        return next((line.partition(":")[2].strip() for line in lines if line.startswith(f"{name}:")), "")


class EntryPoint(Struct, frozen=True):
    """A name under which a package offers an object to others, written `name = module:attribute [extra]`."""

    group: str
    name: str
    value: str
    package: Package

    @property
    def module(self) -> str:
        return self._target[0].strip()

    def load(self) -> Any:
        """Import the object; exceptions of the module propagate."""
        attributes = self._target[2].strip()
        return reduce(getattr, filter(None, attributes.split(".")), importlib.import_module(self.module))

    @property
    def _target(self) -> tuple[str, str, str]:
        return self.value.partition("[")[0].partition(":")


def plain(name: str) -> str:
    """Return a package's normalised name (PEP 503)."""
    return re.sub(r"[-_.]+", "-", name).lower()


def packages() -> dict[str, Package]:
    """Return the installed packages by normalised name; the first folder in `sys.path` that has one wins."""
    found: dict[str, Package] = {}
    for root in dict.fromkeys(sys.path):
        try:
            names = folder_names(root or ".")
        except OSError:
            continue
        for name, package in _packages_of(root, names).items():
            found.setdefault(name, package)
    return found


@lru_cache
def _packages_of(root: str, names: tuple[str, ...]) -> dict[str, Package]:
    """Return the packages of a folder in `sys.path` that contains these names."""
    found: dict[str, Package] = {}
    metadata = [name for name in names if name.endswith((".dist-info", ".egg-info"))]
    for name in [*metadata, *(["EGG-INFO"] if root.endswith(".egg") else [])]:
        folder = os.path.join(root, name)
        found.setdefault(plain(_name_and_version(folder)[0]), Package(folder))
    return found


def version(name: str) -> str | None:
    return versions([name])[name]


def versions(names: Iterable[str]) -> dict[str, str | None]:
    known = packages()
    found = {name: known.get(plain(name)) for name in names}
    return {name: package.version if package is not None else None for name, package in found.items()}


def entry_points(*groups: str) -> Iterator[EntryPoint]:
    """Yield the entry points of all packages in groups such as `rendergraph.nodes`; nothing is imported."""
    for package in packages().values():
        state = stamp(os.path.join(package.folder, "entry_points.txt"))
        yield from (entry for entry in _entry_points_of(package, state) if entry.group in groups)


@lru_cache(4096)
def _entry_points_of(package: Package, state: Stamp) -> list[EntryPoint]:
    """Return all entry points of a package, cached by the state of its entry point file."""
    found, group = [], ""
    for line in map(str.strip, _lines(package.folder, "entry_points.txt") if state else ()):
        if line.startswith("["):
            group = line[1:-1].strip()
        elif group and "=" in line and line[0] not in "#;":
            name, _, value = line.partition("=")
            found.append(EntryPoint(group, name.strip(), value.strip(), package))
    return found


def module_spec(name: str) -> ModuleSpec | None:
    """Return where a module comes from; None if there is no such module, or its parent cannot be imported."""
    from importlib.util import find_spec  # most commands need none

    try:
        return find_spec(name)
    except (ImportError, ValueError, AttributeError):
        return None


def require(feature: str, extra: str, *modules: str) -> None:
    """Check that the `modules` of an extra are installed, which a feature needs."""
    missing = [name.replace("_", "-") for name in modules if module_spec(name) is None]
    if missing:
        text = f"{feature} needs {', '.join(missing)}; pip install 'rendergraph[{extra}]'"
        raise UsageError(Problem("RG500", text))


def _name_and_version(folder: str) -> tuple[str, str]:
    """Return name and version from the name of a metadata folder, or for `EGG-INFO` from that of the egg."""
    home, name = os.path.split(folder)
    project, _, rest = (os.path.basename(home) if name == "EGG-INFO" else name).rpartition(".")[0].partition("-")
    return project, rest.partition("-")[0]


def _lines(folder: str, file: str) -> list[str]:
    try:
        with open(os.path.join(folder, file), encoding="utf-8", errors="replace") as opened:
            return opened.read().splitlines()
    except OSError:
        return []
