"""Installed packages: their versions and entry points, read from the folders of metadata beside their code.

`importlib.metadata` tells the same of every kind of archive, and its parsers of e-mails take longer to import than a
pipeline takes to plan; here a package is a folder of `sys.path` that ends in `.dist-info` (PyPA, "Recording installed
projects") or `.egg-info`, or an unpacked egg. What lies in a zip archive is not found.
"""

from __future__ import annotations

import importlib
import os
import re
import sys
from collections.abc import Iterable, Iterator
from functools import reduce
from typing import Any

from msgspec import Struct

from rendergraph.errors import Problem, UsageError

_ENDINGS = (".dist-info", ".egg-info")


class Package(Struct, frozen=True):
    """An installed package, by the folder of its metadata."""

    folder: str

    @property
    def name(self) -> str:
        """As it calls itself, which need not be how indexes compare it."""
        return self._said("Name") or _parts(self.folder)[0]

    @property
    def version(self) -> str:
        """As its folder is called, or as it says where that has none: one that is worked on."""
        return _parts(self.folder)[1] or self._said("Version")

    def _said(self, word: str) -> str:
        for file in ("METADATA", "PKG-INFO"):
            for line in _lines(self.folder, file):
                if line.startswith(f"{word}:"):
                    return line.partition(":")[2].strip()
        return ""


class EntryPoint(Struct, frozen=True):
    """A name under which a package offers something to others, written `name = module:attribute [extra]`."""

    group: str
    name: str
    value: str
    package: Package

    @property
    def module(self) -> str:
        """The module to import."""
        return self._target[0].strip()

    def load(self) -> Any:
        """Import it; raises whatever the module raises."""
        attributes = self._target[2].strip()
        return reduce(getattr, filter(None, attributes.split(".")), importlib.import_module(self.module))

    @property
    def _target(self) -> tuple[str, str, str]:
        return self.value.partition("[")[0].partition(":")


def plain(name: str) -> str:
    """A package's name as indexes compare them (PEP 503)."""
    return re.sub(r"[-_.]+", "-", name).lower()


def packages() -> dict[str, Package]:
    """What is installed by its plain name; where two folders of `sys.path` have one, the first counts."""
    found: dict[str, Package] = {}
    for root in dict.fromkeys(sys.path):
        try:
            inside = sorted(name for name in os.listdir(root or ".") if name.endswith(_ENDINGS))
        except OSError:
            continue
        if root.endswith(".egg"):
            inside.append("EGG-INFO")
        for folder in (os.path.join(root, name) for name in inside):
            found.setdefault(plain(_parts(folder)[0]), Package(folder))
    return found


def version(name: str) -> str | None:
    """The version of a package; None where it is not installed."""
    return versions([name])[name]


def versions(names: Iterable[str]) -> dict[str, str | None]:
    """The versions of packages by their names; None of those that are not installed."""
    known = packages()
    found = {name: known.get(plain(name)) for name in names}
    return {name: package.version if package is not None else None for name, package in found.items()}


def entry_points(*groups: str) -> Iterator[EntryPoint]:
    """What all packages offer under names such as `rendergraph.nodes`; nothing is imported."""
    for package in packages().values():
        group = ""
        for line in map(str.strip, _lines(package.folder, "entry_points.txt")):
            if line.startswith("["):
                group = line[1:-1].strip()
            elif group in groups and "=" in line and line[0] not in "#;":
                name, _, value = line.partition("=")
                yield EntryPoint(group, name.strip(), value.strip(), package)


def require(feature: str, extra: str, *modules: str) -> None:
    """Check that the packages of an extra are installed.

    Args:
        feature: what needs them, for the message.
        extra: as in `pip install 'rendergraph[extra]'`.
        modules: the modules that they provide.

    Raises:
        UsageError: one is missing.
    """
    from importlib.util import find_spec  # where an extra is used alone

    missing = [name.replace("_", "-") for name in modules if find_spec(name) is None]
    if missing:
        text = f"{feature} needs {', '.join(missing)}; pip install 'rendergraph[{extra}]'"
        raise UsageError(Problem("RG500", text))


def _parts(folder: str) -> tuple[str, str]:
    """Name and version that a folder of metadata has in its own name, or an egg in its."""
    home, name = os.path.split(folder)
    project, _, rest = (os.path.basename(home) if name == "EGG-INFO" else name).rpartition(".")[0].partition("-")
    return project, rest.partition("-")[0]


def _lines(folder: str, file: str) -> list[str]:
    try:
        with open(os.path.join(folder, file), encoding="utf-8", errors="replace") as opened:
            return opened.read().splitlines()
    except OSError:
        return []
