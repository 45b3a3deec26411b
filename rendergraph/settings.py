"""The project's settings file, cache limits, and the folders from which files may be read.

Pipelines and scenes are untrusted data: files that they refer to must lie inside a root, with symbolic links resolved.
The settings file `rendergraph.toml` makes a project's folder a root. Its other settings (more roots, plugins, which are
code) apply only if the user works inside that project, so that a downloaded folder cannot grant itself permissions.
"""

from __future__ import annotations

import os
from collections.abc import Iterable
from itertools import islice
from pathlib import Path
from typing import Annotated

from msgspec import Struct

from rendergraph.document import Source, from_plain, read_bytes, shown
from rendergraph.errors import InputError, Place, Problem
from rendergraph.keys import Codes, Key, Table, Validator, plain
from rendergraph.keys.values import listed
from rendergraph.stamps import record_read
from rendergraph.typecheck import Brief, Matching, Range

FILE_NAME = "rendergraph.toml"
_PATHS = listed(Annotated[str, Matching(r"\s*[^\s\0][^\0]*\Z"), Brief("path")], "paths")
_SIZE = Annotated[int, Range(0, 1_000_000)]


class CacheLimits(Struct, frozen=True):
    """Limits of a session's caches on the GPU, from which the least recently used is freed first.

    Attributes:
        programs: number of compiled programs, each of which takes a few MB with a software driver.
        mebibytes: textures and buffers of compiled pipelines, and copies of kept values, in MiB.

    The last four compiled pipelines are cached with all their programs, as far as `mebibytes` allows. The current
    pipeline is always kept.
    """

    programs: int = 32
    mebibytes: int = 1024

    @property
    def bytes(self) -> int:
        return self.mebibytes << 20


_MEBIBYTES = "Textures and buffers of compiled pipelines, and copies of kept values."
_CACHE = Table(
    "`cache`",
    (
        Key("programs", _SIZE, "Compiled programs.", default=CacheLimits().programs),
        Key("mebibytes", _SIZE, _MEBIBYTES, default=CacheLimits().mebibytes, unit="MiB"),
    ),
)
SETTINGS = Table(
    "a settings file",
    (
        Key("asset_roots", _PATHS, "More folders from which files may be read.", example='asset_roots = ["../assets"]'),
        Key("plugins", _PATHS, "Files and folders with nodes: code.", example='plugins = ["my_effects"]'),
        Key("cache", _CACHE, "Limits of a session's caches on the GPU.", example="cache = {programs = 64}"),
    ),
)
"""The keys of `rendergraph.toml`; its paths are relative to it."""
_CODES = Codes(unknown="RG017", wrong="RG017", name="RG017", file="RG017")
_MOST_BYTES = 100_000


class Settings(Struct, frozen=True):
    file: Path
    asset_roots: tuple[Path, ...] = ()
    plugins: tuple[Path, ...] = ()
    cache: CacheLimits = CacheLimits()

    @property
    def folder(self) -> Path:
        return self.file.parent


def nearest_settings(folder: Path) -> Settings | None:
    """Return the settings file in a folder, with symbolic links resolved, or the nearest one above it."""
    for candidate in (folder, *folder.parents):
        file = candidate / FILE_NAME
        record_read(file)
        if os.path.isfile(file):
            return load(file)
    return None


def load(file: Path) -> Settings:
    import tomllib  # only for projects with such a file

    source = Source(str(file), file)
    try:
        table = tomllib.loads(read_bytes(file, _MOST_BYTES).decode("utf-8"))
    except (ValueError, RecursionError) as error:
        raise InputError(source.problem("RG017", f"not a valid settings file: {shown(error, 120)}")) from None
    validator = Validator(_CODES)
    root = validator.file(from_plain(table, source), SETTINGS, "settings")
    if validator.problems or root is None:
        raise InputError(validator.problems)
    settings = plain(root, SETTINGS)
    cache = CacheLimits(**settings.pop("cache", {}))
    paths = {key: tuple(file.parent / expand_home(path) for path in found) for key, found in settings.items()}
    return Settings(file, **paths, cache=cache)


class Roots(Struct, frozen=True):
    """The folders from which files may be read, with symbolic links resolved."""

    folders: tuple[Path, ...]

    @classmethod
    def of_file(cls, file: Path, extra: Iterable[Path] = ()) -> Roots:
        """Return the roots for all files reached from a file that the user named.

        Args:
            file: the file; its own folder is a root, and so is that of the nearest settings file above it.
        """
        home = _resolved(file.parent)
        folders = [home]
        project = nearest_settings(home)
        if project is not None:
            folders.append(_resolved(project.folder))
            here = _resolved(Path.cwd())
            if here.is_relative_to(folders[-1]):
                folders += [_resolved(folder) for folder in project.asset_roots]
        folders += [_resolved(folder) for folder in extra]
        return cls(tuple(dict.fromkeys(folders)))

    def check(self, path: Path, place: Place | None = None, written: str | None = None) -> Path:
        """Return the file at a path, with symbolic links resolved; raise for a `mistake`."""
        mistake = self.mistake(path, written)
        if mistake:
            raise InputError(Problem(*mistake, place))
        return _resolved(path)

    def mistake(self, path: Path, written: str | None = None, *, folder: bool = False) -> tuple[str, str] | None:
        """Return code and text if a path may not be read: it is outside all roots, missing, or not a regular file.

        Args:
            path: the path, joined to the folder of the file that contains it.
            written: the path as written there; by default `path`.
        """
        name = shown(written or path, 120)
        record_read(path)
        if "://" in (written or str(path)):
            return "RG012", f"'{name}' is not a file path; only local files can be loaded"
        try:
            resolved = path.resolve()
            # Checked first, so that a pipeline cannot find out which files exist outside.
            if not any(resolved.is_relative_to(folder) for folder in self.folders):
                text = f"'{name}' lies outside the folder of the file that names it; --asset-root DIR allows DIR too"
                return "RG012", text
            if resolved.is_dir() if folder else resolved.is_file():
                return None
            if resolved.is_dir():
                return "RG011", f"'{name}' is a folder; a file is expected"
            if resolved.is_file():
                return "RG011", f"'{name}' is a file; expected a folder"
            if resolved.exists():
                return "RG011", f"'{name}' is not a regular file"
        except (OSError, ValueError, RuntimeError):
            return "RG011", f"'{name}' cannot be a file's path"
        return "RG011", f"there is no {'folder' if folder else 'file'} '{name}'{_neighbour(resolved)}"


def expand_home(text: str) -> Path:
    path = Path(text)
    try:
        return path.expanduser()
    except RuntimeError:  # there is no such user
        return path


def _neighbour(path: Path) -> str:
    from difflib import get_close_matches  # only for misspelt names

    try:
        names = sorted(entry.name for entry in islice(path.parent.iterdir(), 1000))
    except OSError:
        return ""
    close = get_close_matches(path.name, names, n=1, cutoff=0.8)
    return f"; did you mean '{shown(close[0])}'?" if close else ""


def _resolved(path: Path) -> Path:
    try:
        return path.resolve()
    except (OSError, RuntimeError):
        return path.absolute()
