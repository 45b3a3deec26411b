"""Listing the node types of packages, folders and files, without importing or parsing anything.

A module is a node type, and so is a shader file. Where Python stands in a folder or beneath it, and in a folder
`shaders` beside `nodes`, shader files are most likely parts of those nodes; there only those with a header are types of
their own.
"""

from __future__ import annotations

import importlib.util
import math
import os
import re
import zlib
from collections.abc import Iterator
from pathlib import Path

from rendergraph.catalog import header
from rendergraph.catalog.extensions import MODULE
from rendergraph.catalog.reload import PREFIX, fresh_package
from rendergraph.catalog.types import SHADERS, Listed
from rendergraph.errors import InputError, Place, Problem
from rendergraph.stamps import record_read

MOST_FILES = 10_000
"""Files of a folder that a pipeline file names; a plugin has a few dozen."""

_NO_NODE = re.compile(r"_|test_|conftest\Z")
"""Modules that are helpers, or that pytest looks for: tests may lie beside the nodes they test."""
_STEM = re.compile(r"[A-Za-z][A-Za-z0-9_-]*\Z")
_HEAD_BYTES = 100_000


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


def shader_folder(module: str, file: Path) -> Path:
    """Where the shaders of a node's module lie: of `X.nodes.family.a` in `X.shaders/family`, else beside its file."""
    before, nodes, family = module.rpartition(".")[0].partition(".nodes")
    shaders = _shader_folder(before + nodes) if nodes and family[:1] in ("", ".") else None
    return file.parent if shaders is None else shaders.joinpath(*family.split("."))


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
    files = list(_files(folder))
    has_python = any(suffix == ".py" for _, _, _, suffix in files)
    for where, family, stem, suffix in files:
        file = os.path.join(where, stem + suffix)
        if suffix == ".py":
            module = ".".join([package, *filter(None, family.split("/")), stem])
            beside = Path(where) if shaders is None else shaders / family
            yield stem, Listed(module, family, Path(file), beside, plugin)
        elif not has_python or _has_header(file):
            yield stem, Listed("", family, Path(file), Path(where), plugin)
    for where, family, stem, suffix in _files(shaders) if shaders is not None else ():
        file = os.path.join(where, stem + suffix)
        if suffix in SHADERS and _has_header(file):
            yield stem, Listed("", family, Path(file), Path(where), plugin)


def _files(folder: Path, most: float = math.inf) -> Iterator[tuple[str, str, str, str]]:
    """Folder, family, stem and ending of everything that may be a node type.

    Raises:
        ValueError: there are more files than `most`, of whatever kind.
    """
    seen, top = 0, os.fspath(folder)
    for where, subfolders, files in os.walk(top):
        record_read(where)
        seen += len(files) + len(subfolders)
        if seen > most:
            raise ValueError(f"it has more than {most:,} files; name the folder of the effects itself")
        subfolders[:] = sorted(name for name in subfolders if name.isidentifier() and not name.startswith("_"))
        family = where.removeprefix(top).strip(os.sep).replace(os.sep, "/")
        for file in sorted(files):
            stem, suffix = os.path.splitext(file)
            is_module = suffix == ".py" and not _NO_NODE.match(stem) and (family, stem) != ("", MODULE)
            if is_module or (suffix in SHADERS and _STEM.match(stem)):
                yield where, family, stem, suffix


def _has_header(file: str) -> bool:
    if not os.path.isfile(file):  # opening a pipe would wait for somebody to write
        return False
    try:
        with open(file, "rb") as opened:
            text = opened.read(_HEAD_BYTES)
    except OSError:
        return False
    return header.BEGIN.encode() in text and header.is_in(text.decode("utf-8", "replace"))


def shaders(folder: Path) -> tuple[list[tuple[str, Listed]], list[Path]]:
    """The shader nodes of a folder that a pipeline file names, and the Python files beside them, which nobody runs.

    Raises:
        ValueError: it has more files than any plugin.
    """
    files = list(_files(folder, MOST_FILES))
    python = [Path(where, stem + suffix) for where, _, stem, suffix in files if suffix == ".py"]
    found = [
        (stem, Listed("", family, Path(file), Path(where), folder.name))
        for where, family, stem, suffix in files
        if suffix in SHADERS and (file := os.path.join(where, stem + suffix)) and (not python or _has_header(file))
    ]
    return found, python


def shader(file: Path) -> Listed:
    """One shader file that is used by its path."""
    return Listed("", "", file, file.parent, file.parent.name)


def package_of(path: Path) -> str:
    """What the package is called that stands for the folder of a plugin given by path."""
    folder = path.resolve() if path.is_dir() else path.resolve().parent
    return f"{PREFIX}{zlib.crc32(os.fsencode(folder)):08x}"


def loose(path: Path, place: Place | None = None, where: str = "") -> Iterator[tuple[str, Listed]]:
    """The modules of a file or folder that is not installed, as a package of their own, so that they can import
    each other relatively.

    Args:
        path: the file or folder.
        place: where it is named.
        where: the same in words, for a place that is no file.
    """
    record_read(path)
    if not path.exists():
        raise InputError(Problem("RG011", f"there is no plugin '{path}'{where}", place))
    path = path.resolve()
    folder = path if path.is_dir() else path.parent
    if path.suffix in SHADERS:
        yield path.stem, shader(path)
        return
    if not path.is_dir() and (path.suffix != ".py" or "." in path.stem or not path.is_file()):
        kinds = f"a folder, a Python module (a name without dots, then .py) or a shader file ({', '.join(SHADERS)})"
        raise InputError(Problem("RG011", f"there is no plugin in '{path}'{where}; one is {kinds}", place))
    package = package_of(path)
    fresh_package(package, folder)
    plugin = folder.name if path.is_dir() else path.stem
    nodes, shaders = folder / "nodes", folder / "shaders"
    if path.is_dir() and nodes.is_dir():
        yield from _modules(nodes, f"{package}.nodes", plugin, shaders if shaders.is_dir() else None)
    elif path.is_dir():
        yield from _modules(folder, package, plugin, None)
    else:
        yield path.stem, Listed(f"{package}.{path.stem}", "", path, folder, plugin)
