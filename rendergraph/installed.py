"""Installed packages: their versions and entry points, read from the folders of metadata beside their code.

`importlib.metadata` tells the same of every kind of archive, and its parsers of e-mails take longer to import than a
pipeline takes to plan; here a package is a folder of `sys.path` that ends in `.dist-info` (PyPA, "Recording installed
projects") or `.egg-info`, as every installer of today leaves one.
"""

from __future__ import annotations

import importlib
import os
import re
import sys
from collections.abc import Iterator
from functools import reduce
from typing import Any

from msgspec import Struct

_FOLDER = (".dist-info", ".egg-info")


class Package(Struct, frozen=True):
    """An installed package.

    Attributes:
        folder: its metadata.
        version: as its folder is called; empty where a folder that is worked on has none.
    """

    folder: str
    version: str

    @property
    def name(self) -> str:
        """As it calls itself, which need not be how indexes compare it."""
        for file in ("METADATA", "PKG-INFO"):
            for line in _lines(self.folder, file):
                if line.startswith("Name:"):
                    return line.removeprefix("Name:").strip()
        return os.path.basename(self.folder).partition("-")[0]


class EntryPoint(Struct, frozen=True):
    """A name under which a package offers something to others, written `name = module:attribute`."""

    name: str
    value: str
    package: Package

    @property
    def module(self) -> str:
        """The module to import."""
        return self.value.partition(":")[0].strip()

    def load(self) -> Any:
        """Import it; raises whatever the module raises."""
        attributes = self.value.partition(":")[2].partition("[")[0].strip()
        return reduce(getattr, filter(None, attributes.split(".")), importlib.import_module(self.module))


def plain(name: str) -> str:
    """A package's name as indexes compare them (PEP 503)."""
    return re.sub(r"[-_.]+", "-", name).lower()


def packages() -> dict[str, Package]:
    """What is installed by its plain name; where two folders of `sys.path` have one, the first counts."""
    found: dict[str, Package] = {}
    for root in dict.fromkeys(sys.path):
        try:
            inside = sorted(name for name in os.listdir(root or ".") if name.endswith(_FOLDER))
        except OSError:
            continue
        for name in inside:
            project, _, rest = name.rpartition(".")[0].partition("-")
            found.setdefault(plain(project), Package(os.path.join(root, name), rest.partition("-")[0]))
    return found


def version(name: str) -> str | None:
    """The version of a package; None where it is not installed."""
    package = packages().get(plain(name))
    return package.version if package is not None else None


def entry_points(group: str) -> Iterator[EntryPoint]:
    """What all packages offer under a name such as `rendergraph.nodes`; nothing is imported."""
    for package in packages().values():
        within = False
        for line in map(str.strip, _lines(package.folder, "entry_points.txt")):
            if line.startswith("["):
                within = line[1:-1].strip() == group
            elif within and "=" in line and line[0] not in "#;":
                name, _, value = line.partition("=")
                yield EntryPoint(name.strip(), value.strip(), package)


def _lines(folder: str, file: str) -> list[str]:
    try:
        with open(os.path.join(folder, file), encoding="utf-8", errors="replace") as opened:
            return opened.read().splitlines()
    except OSError:
        return []
