"""Listing the node types of packages, folders and files, without importing anything."""

from __future__ import annotations

import importlib.util
import os
import zlib
from collections.abc import Iterator
from pathlib import Path

from rendergraph.catalog.extensions import MODULE
from rendergraph.catalog.reload import PREFIX, fresh_package
from rendergraph.catalog.types import Listed
from rendergraph.errors import InputError, Problem
from rendergraph.stamps import look


def package(plugin: str, package: str) -> Iterator[tuple[str, Listed]]:
    """The modules of an installed package, found without importing more than its parent."""
    try:
        spec = importlib.util.find_spec(package)
    except (ImportError, ValueError, AttributeError):
        spec = None
    if spec is None:  # an entry left behind by a half-removed package: its nodes are missing, no more
        return
    if not spec.submodule_search_locations:
        file = Path(spec.origin or "")
        yield file.stem, Listed(package, "", file, file.parent, plugin)
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


def _modules(folder: Path, package: str, plugin: str, shaders: Path | None) -> Iterator[tuple[str, Listed]]:
    for where, subfolders, files in os.walk(folder):
        look(Path(where))
        subfolders[:] = sorted(name for name in subfolders if name.isidentifier() and not name.startswith("_"))
        family = Path(where).relative_to(folder).as_posix().removeprefix(".")
        for file in sorted(files):
            stem, suffix = os.path.splitext(file)
            if suffix == ".py" and not stem.startswith("_") and (family, stem) != ("", MODULE):
                module = ".".join([package, *filter(None, family.split("/")), stem])
                beside = Path(where) if shaders is None else shaders / family
                yield stem, Listed(module, family, Path(where) / file, beside, plugin)


def package_of(path: Path) -> str:
    """What the package is called that stands for the folder of a plugin given by path."""
    folder = path.resolve() if path.is_dir() else path.resolve().parent
    return f"{PREFIX}{zlib.crc32(os.fsencode(folder)):08x}"


def loose(path: Path) -> Iterator[tuple[str, Listed]]:
    """The modules of a file or folder that is not installed, as a package of their own, so that they can import
    each other relatively.
    """
    look(path)
    if not path.exists():
        raise InputError(Problem("RG011", f"there is no plugin '{path}'"))
    path = path.resolve()
    folder = path if path.is_dir() else path.parent
    package = package_of(path)
    fresh_package(package, folder)
    plugin = folder.name if path.is_dir() else path.stem
    nodes, shaders = folder / "nodes", folder / "shaders"
    if path.is_dir() and nodes.is_dir() and shaders.is_dir():
        yield from _modules(nodes, f"{package}.nodes", plugin, shaders)
    elif path.is_dir():
        yield from _modules(folder, package, plugin, None)
    else:
        yield path.stem, Listed(f"{package}.{path.stem}", "", path, folder, plugin)
