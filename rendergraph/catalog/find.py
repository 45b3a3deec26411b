"""Find node types and plugin extensions in packages, folders and files; no node is imported or parsed.

A module is a node type, and so is a shader file. In a folder with Python files, and in a folder `shaders` beside
`nodes`, a shader file is usually part of a node; there it is a type only if it has a header.
"""

from __future__ import annotations

import importlib.util
import math
import os
import re
import sys
import zlib
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from msgspec import Struct

from rendergraph.catalog import header
from rendergraph.catalog.types import PREFIX, SHADERS, Listed, fresh_package, shader_folder
from rendergraph.declare.blame import describe_error, source_location
from rendergraph.declare.extensions import Extension, Extensions, Source, extension_mistakes
from rendergraph.errors import InputError, Place, Problem, is_interruption, shown_file
from rendergraph.installed import EntryPoint, Package, module_spec, plain
from rendergraph.settings import expand_home, nearest_settings
from rendergraph.stamps import FileCache, record_read

OWN = "rendergraph"
"""The distribution that no plugin replaces."""
EXTENSIONS = "rendergraph.extensions"
"""The entry point group; an entry's value is `package.module:NAME`."""
MODULE = "extension"
NAME = "EXTENSION"
"""The extension of a plugin's folder is `EXTENSION` in `extension.py`."""
VARIABLE = "RENDERGRAPH_PATH"
"""Folders and files with nodes, separated as in PATH."""
MOST_FILES = 10_000
"""Limit of files in a folder that a pipeline file names; plugins have a few dozen."""

_NO_NODE = re.compile(r"_|test_|conftest\Z")
"""Modules that are helpers, or that pytest looks for: tests may lie beside the nodes they test."""
_STEM = re.compile(r"[A-Za-z][A-Za-z0-9_-]*\Z")
_HEAD_BYTES = 100_000
_MODULES: FileCache[list[tuple[str, Listed]]] = FileCache(16)
"""The modules of installed packages."""


class PluginPath(Struct, frozen=True):
    """A plugin by path, and where it is named: a place in a settings file, or a phrase."""

    path: Path
    place: Place | None = None
    where: str = ""

    @property
    def words(self) -> str:
        """The phrase that says where it is named, to follow its path."""
        return self.where or (f", which {self.place.file} names" if self.place is not None else ", given as a plugin")


def configured() -> Iterator[PluginPath]:
    """Yield the plugins of the settings of the project around the current folder, then of the environment."""
    project = nearest_settings(Path.cwd())
    if project is not None:
        for path in project.plugins:
            yield PluginPath(path, Place(shown_file(project.file)))
    for text in filter(None, map(str.strip, os.environ.get(VARIABLE, "").split(os.pathsep))):
        yield PluginPath(expand_home(text), where=f", which {VARIABLE} names")


def projects(folders: Iterable[Path]) -> frozenset[str]:
    """Return the normalized names of the distributions whose projects these are, which replace installed copies."""
    return frozenset({_project(folder) for folder in folders} - {"", OWN})


def _project(folder: Path) -> str:
    file = folder / "pyproject.toml"
    record_read(file)
    if not file.is_file():
        return ""
    import tomllib  # only for folders of projects

    try:
        name = tomllib.loads(file.read_text(encoding="utf-8"))["project"]["name"]
    except (OSError, ValueError, KeyError, TypeError):
        return ""
    return plain(name) if isinstance(name, str) else ""


def package(plugin: str, package: str) -> Iterator[tuple[str, Listed]]:
    """Yield the modules of an installed package; only its parent package is imported."""
    spec = module_spec(package)
    if spec is None:  # an entry left behind by a half-removed package: only its nodes are missing
        return
    if not spec.submodule_search_locations:
        file = Path(spec.origin or "")
        yield file.stem, Listed(package, "", file, file.parent, plugin)
        return
    shaders = shader_folder(package)
    for folder in spec.submodule_search_locations:
        where = Path(folder), package, plugin, shaders
        yield from _MODULES.get(where, partial(_modules, *where))


def _modules(folder: Path, package: str, plugin: str, shaders: Path | None) -> list[tuple[str, Listed]]:
    found: list[tuple[str, Listed]] = []
    files = list(_files(folder))
    has_python = any(file.suffix == ".py" for file, _ in files)
    for file, family in files:
        if file.suffix == ".py":
            module = ".".join([package, *filter(None, family.split("/")), file.stem])
            beside = file.parent if shaders is None else shaders / family
            found.append((file.stem, Listed(module, family, file, beside, plugin)))
        elif not has_python or _has_header(file):
            found.append((file.stem, Listed("", family, file, file.parent, plugin)))
    for file, family in _files(shaders) if shaders is not None else ():
        if file.suffix in SHADERS and _has_header(file):
            found.append((file.stem, Listed("", family, file, file.parent, plugin)))
    return found


def _files(folder: Path, most: float = math.inf) -> Iterator[tuple[Path, str]]:
    """Yield files that may be node types, with their families; ValueError for more than `most`."""
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
                yield Path(where, file), family


def _has_header(file: Path) -> bool:
    record_read(file)
    if not file.is_file():  # opening a pipe would block
        return False
    try:
        with file.open("rb") as opened:
            text = opened.read(_HEAD_BYTES)
    except OSError:
        return False
    return header.BEGIN.encode() in text and header.is_in(text.decode("utf-8", "replace"))


def shaders(folder: Path, most_files: int = MOST_FILES) -> tuple[list[tuple[str, Listed]], list[Path]]:
    """Return the shader nodes of a folder that a pipeline file names, and the Python files there, which are not run."""
    files = list(_files(folder, most_files))
    python = [file for file, _ in files if file.suffix == ".py"]
    found = [
        (file.stem, Listed("", family, file, file.parent, folder.name))
        for file, family in files
        if file.suffix in SHADERS and (not python or _has_header(file))
    ]
    return found, python


def shader(file: Path) -> Listed:
    """Return a shader file that is used by its path."""
    return Listed("", "", file, file.parent, file.parent.name)


def package_of(folder: Path) -> str:
    """Return the name of the package that stands for the resolved folder of a plugin given by path."""
    return f"{PREFIX}{zlib.crc32(os.fsencode(folder)):08x}"


def loose(named: PluginPath) -> Iterator[tuple[str, Listed]]:
    """Yield the types of a file or folder that is not installed; its modules can import each other relatively."""
    path, where = named.path, named.where
    record_read(path)
    if not path.exists():
        raise InputError(Problem("RG011", f"there is no plugin '{path}'{where}", named.place))
    path = path.resolve()
    folder = path if path.is_dir() else path.parent
    if path.suffix in SHADERS:
        yield path.stem, shader(path)
        return
    if not path.is_dir() and (path.suffix != ".py" or "." in path.stem or not path.is_file()):
        kinds = f"a folder, a Python module (a name without dots, then .py) or a shader file ({', '.join(SHADERS)})"
        raise InputError(Problem("RG011", f"there is no plugin in '{path}'{where}; use {kinds}", named.place))
    package = package_of(folder)
    fresh_package(package, folder)
    plugin = folder.name if path.is_dir() else path.stem
    nodes, shaders = folder / "nodes", folder / "shaders"
    if path.is_dir() and nodes.is_dir():
        yield from _modules(nodes, f"{package}.nodes", plugin, shaders if shaders.is_dir() else None)
    elif path.is_dir():
        yield from _modules(folder, package, plugin, None)
    else:
        yield path.stem, Listed(f"{package}.{path.stem}", "", path, folder, plugin)


def extensions(folders: Sequence[Path], offered: Iterable[EntryPoint]) -> Extensions:
    """Return what plugins add; nothing is imported before it is requested."""
    entries = sorted(offered, key=lambda entry: entry.value)
    return Extensions(lambda: _sources(folders, entries))


def _sources(folders: Iterable[Path], offered: Iterable[EntryPoint]) -> Iterator[Source]:
    for entry in offered:
        yield _source(entry.package.name, _file(entry), entry.load, entry.value)
    for folder in folders:
        file = folder / f"{MODULE}.py"
        record_read(file)
        if file.is_file():
            entry = EntryPoint(EXTENSIONS, NAME, f"{package_of(folder)}.{MODULE}:{NAME}", Package(str(folder)))
            yield _source(folder.name, file, entry.load, f"{MODULE}.py:{NAME}")


def _file(entry: EntryPoint) -> Path:
    """The file of an entry's module, found without importing more than its parent; empty if there is none."""
    try:
        spec = importlib.util.find_spec(entry.module)
    except BaseException as error:  # its parent cannot be imported, which loading will report
        if is_interruption(error):
            raise
        spec = None
    return Path(spec.origin) if spec is not None and spec.origin else Path()


def _source(plugin: str, file: Path, load: Callable[[], Any], value: str) -> Source:
    record_read(file)
    place = Place(shown_file(file)) if file.name else None
    try:
        found = load()
    except BaseException as error:  # anything that third-party code raises is its mistake
        if is_interruption(error):
            raise
        text = f"the extension of plugin '{plugin}' ({value}) cannot be imported: {describe_error(error)}"
        where = (source_location(error, file.parent) if file.name else None) or place
        return Source(plugin, file, None, (Problem("RG494", text, where),))
    if not isinstance(found, Extension):
        text = f"'{value}' of plugin '{plugin}' is {type(found).__name__}, not an Extension"
        return Source(plugin, file, None, (Problem("RG495", text, place),))
    defined = sys.modules.get(value.partition(":")[0])
    file = file if file.name else Path(getattr(defined, "__file__", None) or "")
    mistakes = extension_mistakes(found, file.parent)
    problems = tuple(mistake.relocate(place, code="RG495", context=f"plugin '{plugin}'") for mistake in mistakes)
    return Source(plugin, file, None if mistakes else found, problems)
